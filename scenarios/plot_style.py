"""Colours, lines and markers of all plots: the palette of Okabe and Ito, and never colour alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from trpac_core.vehicle import WHEELS


@dataclass(frozen=True)
class Colour:
    """A colour on a light and on a dark page; `name` is its CSS variable."""

    name: str
    light: str
    dark: str


INK = Colour("--ink", "#1d2125", "#e6e7e9")
GREY = Colour("--grey", "#5a6068", "#a9afb8")
LINE = Colour("--line", "#dcdfe3", "#3a3e44")
BLUE = Colour("--blue", "#0072b2", "#56b4e9")
VERMILLION = Colour("--vermillion", "#d55e00", "#e8773a")
GREEN = Colour("--green", "#009e73", "#009e73")
PURPLE = Colour("--purple", "#cc79a7", "#cc79a7")
BAND = Colour("--band", "rgba(0, 114, 178, 0.20)", "rgba(86, 180, 233, 0.25)")
"""Fill of an interval."""
SHADE = Colour("--shade", "rgba(90, 96, 104, 0.14)", "rgba(169, 175, 184, 0.18)")
"""Fill behind a stretch of an axis."""
WET = Colour("--wet", "rgba(0, 114, 178, 0.16)", "rgba(86, 180, 233, 0.22)")
SNOW = Colour("--snow", "rgba(86, 180, 233, 0.07)", "rgba(230, 240, 255, 0.09)")
LOST = Colour("--lost", "rgba(213, 94, 0, 0.25)", "rgba(232, 119, 58, 0.3)")
"""Fill behind a stretch without samples."""
COLOURS = (INK, GREY, LINE, BLUE, VERMILLION, GREEN, PURPLE, BAND, SHADE, WET, SNOW, LOST)

SOLID: tuple[int, ...] = ()
DASHED, DOTTED, DASH_DOT, LONG_DASHED = (7, 4), (2, 3), (8, 3, 2, 3), (12, 4)
DASH_DOT_DOT = (8, 3, 2, 3, 2, 3)
"""Lengths of dashes and gaps [px]."""
MARKERS = {"circle": "o", "square": "s", "diamond": "D", "triangle-up": "^", "x": "x", "cross": "P"}
"""Markers by their names in plotly and in matplotlib."""


@dataclass(frozen=True)
class Style:
    """How a series is drawn."""

    colour: Colour
    dash: tuple[int, ...] = SOLID
    marker: str = "circle"
    width: float = 1.6

    @property
    def dash_svg(self) -> str:
        """The dashes for SVG and plotly."""
        return ",".join(f"{length}px" for length in self.dash) or "solid"

    @property
    def matplotlib(self) -> dict[str, Any]:
        """Arguments of matplotlib's `plot`, on a light ground."""
        dash: Any = (0, tuple(0.8 * length for length in self.dash)) if self.dash else "-"
        return {"color": self.colour.light, "linestyle": dash, "linewidth": 0.8 * self.width}


TRUTH = Style(INK, LONG_DASHED, "x", 1.8)
"""What is true, measured, or a reference."""
PLAIN = Style(INK, width=1.4)
"""A series that is alone in its panel."""
WHEEL_STYLES = dict(
    zip(
        WHEELS,
        (
            Style(BLUE, SOLID, "circle"),
            Style(VERMILLION, DASHED, "square"),
            Style(GREEN, DOTTED, "diamond", 2.2),
            Style(PURPLE, DASH_DOT, "triangle-up"),
        ),
        strict=True,
    )
)
ESTIMATOR_STYLES = {
    "robust": Style(BLUE, SOLID, "circle", 2.0),
    "DIFE": Style(VERMILLION, DASHED, "square", 2.0),
    "as printed": Style(VERMILLION, DASH_DOT_DOT, "cross", 2.0),
    "DE": Style(GREEN, DASH_DOT, "diamond"),
    "IFE": Style(PURPLE, DOTTED, "triangle-up", 2.2),
}
OTHER_STYLES = (
    Style(INK, DOTTED, "x"),
    Style(GREY, DASHED, "cross"),
    Style(PURPLE, SOLID, "square"),
    Style(GREEN, LONG_DASHED, "circle"),
    Style(INK, DASH_DOT, "diamond"),
    Style(GREY, SOLID, "triangle-up"),
    Style(BLUE, DOTTED, "x"),
    Style(VERMILLION, LONG_DASHED, "diamond"),
)
"""Styles of further series; after the last the first again."""


def estimator_styles(names: list[str]) -> dict[str, Style]:
    """A style for each of these estimators."""
    known = {name: ESTIMATOR_STYLES.get(name.replace("_", " ")) for name in names}
    others = [name for name, style in known.items() if style is None]
    further = {name: OTHER_STYLES[i % len(OTHER_STYLES)] for i, name in enumerate(others)}
    return {name: style or further[name] for name, style in known.items()}


MATPLOTLIB: dict[Any, Any] = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.edgecolor": GREY.light,
    "axes.labelcolor": INK.light,
    "xtick.color": GREY.light,
    "ytick.color": GREY.light,
    "axes.grid": True,
    "grid.color": LINE.light,
    "axes.axisbelow": True,
    "legend.frameon": False,
}
"""Settings of matplotlib's figures."""
