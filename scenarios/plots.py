"""Plots as data: drawn as interactive plots of a report by plotly, or as a PNG picture by matplotlib."""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from textwrap import fill
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scenarios.plot_style import GREY, INK, LINE, MARKERS, MATPLOTLIB, SHADE, Colour, Style
from trpac_core.files import quoted

Array = NDArray[Any]
Limits = tuple[float, float]

MOST_POINTS = 3000
"""Points of a series in a report; longer ones are thinned."""
PER_BUCKET = 4
"""Points that are kept of a bucket: first, least, greatest, last."""
PANEL_PX, SHORT_PX = 190, 90
"""Height of a panel's axes of height 1, and the least height [px]."""
HALF_STRIP = 0.36
"""Half height of a flag's bar; bars are 1 apart."""
NO_BREAK = "\N{NO-BREAK SPACE}"
WIDTH_IN, ROW_IN, DPI = 9.6, 1.6, 150
"""Width of a PNG picture, height of a panel of height 1 [in], and its resolution."""


@dataclass(frozen=True)
class Series:
    """A series of a panel.

    Attributes
    ----------
    name : str
        Its name in the legend.
    x, y : array, shape (n,)
        The points; NaN breaks the line.
    style : Style
        Colour, line and marker.
    kind : str
        line, step (a value holds until the next point), points, marked (line with markers).
    low : array, shape (n,), optional
        Lower edge of a band whose upper edge is y.
    right : bool
        Whether it belongs to the right axis.
    """

    name: str
    x: Array
    y: Array
    style: Style
    kind: Literal["line", "step", "points", "marked"] = "line"
    low: Array | None = None
    right: bool = False


@dataclass(frozen=True)
class Shade:
    """A stretch of the x axis with a ground of its own, and a text at its top."""

    start: float
    end: float
    colour: Colour = SHADE
    text: str = ""


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    label, right_label : str
        What the y axes show, with the unit.
    empty : str
        The sentence in its place where no series has a value: what is missing, and why.
    series, shades : tuple
        What is drawn.
    x_label : str
        What the x axis shows, with the unit.
    x_limits, y_limits : pair of float, optional
        Ends of the axes.
    x_log, y_log : bool
        Whether an axis is logarithmic.
    ticks : dict
        Labels of the y axis by value, in place of numbers.
    height : float
        Height in relation to others.
    """

    label: str
    empty: str
    series: tuple[Series, ...]
    x_label: str = "time [s]"
    shades: tuple[Shade, ...] = ()
    right_label: str = ""
    x_limits: Limits | None = None
    y_limits: Limits | None = None
    x_log: bool = False
    y_log: bool = False
    ticks: Mapping[float, str] | None = None
    height: float = 1.0

    @property
    def shown(self) -> list[Series]:
        """The series that have a value."""
        return [s for s in self.series if np.isfinite(np.asarray(s.y, dtype=float)).any()]

    @property
    def legend(self) -> list[Series]:
        """The series to be named: none where the label names the only one."""
        return [s for s in self.shown if s.name]

    @property
    def spec(self) -> dict[str, Any]:
        """The panel for plotly; colours are names of CSS variables."""
        curves: list[dict[str, Any]] = []
        for number, series in enumerate(self.shown):
            curves += [curve | {"legendgroup": str(number)} for curve in _of_plotly(series)]
        return {"data": curves, "layout": _layout(self)}


@dataclass(frozen=True)
class Figure:
    """Panels that belong together.

    Attributes
    ----------
    label : str
        What they show, for readers who do not see them.
    panels : tuple of Panel
        From top to bottom.
    linked : bool
        Whether they have one x axis, along which they are zoomed together.
    """

    label: str
    panels: tuple[Panel, ...]
    linked: bool = True


def thin(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Indices of at most about `most` points that show a series as all of them do.

    Each bucket keeps its first, least, greatest and last point, and its first lost sample.

    References
    ----------
    .. [1] Jugel, Jerzak, Hackenbroich, Markl (2014), M4, Proc. VLDB Endowment 7, 797-808.
    """
    values = np.asarray(values, dtype=float)
    if len(values) <= most:
        return np.arange(len(values))
    kept: set[int] = set()
    edges = np.linspace(0, len(values), most // PER_BUCKET + 1).astype(int).tolist()
    for start, end in pairwise(edges):
        known = np.flatnonzero(np.isfinite(values[start:end])) + start
        kept |= {start, end - 1}
        if len(known):
            kept |= {int(known[values[known].argmin()]), int(known[values[known].argmax()])}
        if len(known) < end - start:
            kept.add(start + int(np.isnan(values[start:end]).argmax()))
    return np.array(sorted(kept), dtype=np.intp)


def strips(time_s: Array, flags: Mapping[str, Array], styles: Iterable[Style]) -> tuple[Series, ...]:
    """A bar for each flag while it is set, one above the other at 0, 1, 2, ...; a flag that is never set has none."""
    made = []
    for row, (flag, style) in enumerate(zip(flags.values(), styles, strict=False)):
        below = np.full(len(flag), row - HALF_STRIP)
        bar = np.where(flag, row + HALF_STRIP, below) if np.any(flag) else np.full(len(flag), np.nan)
        made.append(Series("", time_s, bar, style, "step", below))
    return tuple(made)


def _of_plotly(series: Series) -> list[dict[str, Any]]:
    """The series as curves of plotly: a band has two."""
    style, y = series.style, np.asarray(series.y, dtype=float)
    x = np.asarray(series.x, dtype=float)
    line: dict[str, Any] = {
        "color": style.colour.name,
        "width": style.width,
        "dash": style.dash_svg,
        "shape": "hv" if series.kind == "step" else "linear",
    }
    common: dict[str, Any] = {
        "type": "scatter",
        "name": html.escape(quoted(series.name), quote=False),
        "mode": {"points": "markers", "marked": "lines+markers"}.get(series.kind, "lines"),
        "line": line,
        "showlegend": False,
        "yaxis": "y2" if series.right else "y",
    }
    if series.kind in ("points", "marked"):
        size = 4 if series.kind == "points" and len(y) > 50 else 8
        common["marker"] = {"color": style.colour.name, "symbol": style.marker, "size": size}
    if series.low is None:
        order = np.argsort(x, kind="stable") if series.kind == "points" else np.arange(len(y))
        at = order[thin(y[order], MOST_POINTS // 2 if series.kind == "points" else MOST_POINTS)]
        return [common | _points(x[at], y[at])]
    low = np.asarray(series.low, dtype=float)
    known = np.isfinite(y) & np.isfinite(low)
    x, y, low = x[known], y[known], low[known]
    below = thin(low) if len(low) and np.ptp(low) else np.array([0, -1][: len(low)])
    above = thin(y)
    edge = common | {"line": line | {"width": 0}, "hoverinfo": "skip"}
    filled = edge | {"fill": "tonexty", "fillcolor": series.style.colour.name}
    return [edge | _points(x[below], low[below]), filled | _points(x[above], y[above])]


def _points(x: Array, y: Array) -> dict[str, Any]:
    """Coordinates, in the binary form that plotly reads."""
    return {"x": _packed(x, "f8"), "y": _packed(y, "f4")}


def _packed(values: Array, kind: str) -> dict[str, str]:
    return {"dtype": kind, "bdata": b64encode(np.asarray(values, dtype=f"<{kind}").tobytes()).decode("ascii")}


def _layout(panel: Panel) -> dict[str, Any]:
    """The layout of a panel for plotly."""
    axis = {"gridcolor": LINE.name, "zerolinecolor": LINE.name, "linecolor": GREY.name, "automargin": False}
    label = html.escape(quoted(panel.x_label), quote=False)
    x = axis | {"title": {"text": label, "standoff": 6}, "type": "log" if panel.x_log else "linear"}
    y = axis | {"type": "log" if panel.y_log else "linear", "fixedrange": True, "nticks": 6}
    for spec, limits, log in ((x, panel.x_limits, panel.x_log), (y, panel.y_limits, panel.y_log)):
        if limits is not None:
            spec["range"] = [float(v) for v in (np.log10(limits) if log else limits)]
        if log:
            spec |= {"dtick": 1, "exponentformat": "power"}
    if panel.ticks is not None:
        y |= {"tickvals": list(panel.ticks), "ticktext": list(panel.ticks.values()), "showgrid": False}
    layout: dict[str, Any] = {
        "height": max(PANEL_PX * panel.height, SHORT_PX) + 44,
        "margin": {"l": 62, "r": 56 if panel.right_label else 12, "t": 6, "b": 38},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": INK.name, "size": 12, "family": "system-ui, sans-serif"},
        "hovermode": "closest" if any(s.kind == "points" for s in panel.series) else "x",
        "hoverlabel": {"bgcolor": "--ground", "font": {"color": INK.name}},
        "dragmode": "zoom",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": GREY.name, "activecolor": INK.name},
        "uirevision": "kept",
        "xaxis": x,
        "yaxis": y,
        "shapes": [
            {
                "type": "rect",
                "yref": "paper",
                "layer": "below",
                "line": {"width": 0},
                "fillcolor": shade.colour.name,
                "x0": shade.start,
                "x1": shade.end,
                "y0": 0,
                "y1": 1,
            }
            for shade in panel.shades
        ],
        "annotations": [
            {
                "x": 0.5 * (shade.start + shade.end),
                "y": 1,
                "yref": "paper",
                "yanchor": "top",
                "showarrow": False,
                "text": html.escape(shade.text, quote=False).replace("\n", "<br>"),
            }
            for shade in panel.shades
            if shade.text
        ],
    }
    if panel.right_label:
        right = {"overlaying": "y", "side": "right", "tickmode": "auto", "nticks": 5}
        layout["yaxis2"] = axis | right | {"fixedrange": True, "showgrid": False}
    return layout


def png(figure: Figure, title: str = "", width_in: float = WIDTH_IN, row_in: float = ROW_IN) -> bytes:
    """The figure as a PNG picture, panels one below the other."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure as Sheet  # takes a second to load

    buffer, heights = BytesIO(), [panel.height for panel in figure.panels]
    with rc_context(MATPLOTLIB):
        sheet = Sheet(figsize=(width_in, row_in * sum(heights) + 0.6), layout="constrained")
        axes = sheet.subplots(len(heights), 1, sharex=figure.linked, height_ratios=heights, squeeze=False)
        for axis, panel in zip(axes[:, 0], figure.panels, strict=True):
            _draw(axis, panel)
            if not figure.linked or panel is figure.panels[-1]:
                axis.set_xlabel(_plain(panel.x_label))
        if title:
            sheet.suptitle(_plain(title), fontsize=9)
        sheet.align_ylabels(axes[:, 0])
        sheet.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()


def _draw(axis: Any, panel: Panel) -> None:
    """Draw a panel with matplotlib."""
    for shade in panel.shades:
        ground, alpha = _opaque(shade.colour)
        axis.axvspan(shade.start, shade.end, color=ground, alpha=alpha, lw=0, zorder=-10)
        if shade.text:
            layout = {"transform": axis.get_xaxis_transform(), "ha": "center", "va": "top", "fontsize": 8}
            axis.text(0.5 * (shade.start + shade.end), 0.98, shade.text.replace("$", r"\$"), **layout)
    right = axis.twinx() if panel.right_label else axis
    if panel.right_label:
        right.set_ylabel(_plain(panel.right_label))
        right.grid(visible=False)
    for series in panel.shown:
        _draw_series(right if series.right else axis, series)
    name, bracket, unit = _plain(panel.label).partition(" [")
    label = fill(f"{name}{bracket}{unit.replace(' ', NO_BREAK)}", max(round(14 * panel.height), 11))
    axis.set_ylabel(label)
    axis.spines["right"].set_visible(bool(panel.right_label))
    axis.set_xscale("log" if panel.x_log else "linear")
    axis.set_yscale("log" if panel.y_log else "linear")
    if panel.x_limits is not None:
        axis.set_xlim(*panel.x_limits)
    if panel.y_limits is not None:
        axis.set_ylim(*panel.y_limits)
    if panel.ticks is not None:
        axis.set_yticks(list(panel.ticks), list(panel.ticks.values()))
        axis.grid(visible=False)
    if not panel.shown:
        axis.text(
            0.5, 0.5, _plain(panel.empty), transform=axis.transAxes, ha="center", va="center", wrap=True
        )
    if panel.legend:
        both = (axis,) if right is axis else (axis, right)
        named = [line for a in both for line in a.get_legend_handles_labels()[0]]
        # Above the axes, where it covers no curve
        axis.legend(handles=named, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=8)


def _draw_series(axis: Any, series: Series) -> None:
    style, label = series.style, _plain(series.name) or None
    if series.low is not None:
        colour, alpha = _opaque(style.colour)
        step = "post" if series.kind == "step" else None
        axis.fill_between(
            series.x, series.low, series.y, color=colour, alpha=alpha, lw=0, step=step, label=label
        )
        return
    options = style.matplotlib | {"label": label}
    if series.kind in ("points", "marked"):
        options |= {"marker": MARKERS[style.marker], "markersize": 2.0 if len(series.x) > 50 else 5.0}
    if series.kind == "points":
        options["linestyle"] = "none"
    if series.kind == "step":
        options["drawstyle"] = "steps-post"
    axis.plot(series.x, series.y, **options)


def _opaque(colour: Colour) -> tuple[tuple[float, ...] | str, float]:
    """A colour and its opacity for matplotlib."""
    if not colour.light.startswith("rgba"):
        return colour.light, 1.0
    red, green, blue, alpha = (float(v) for v in colour.light[5:-1].split(","))
    return (red / 255.0, green / 255.0, blue / 255.0), alpha


def _plain(text: str) -> str:
    """A text for matplotlib, with dollar signs escaped."""
    return quoted(text).replace("$", r"\$")
