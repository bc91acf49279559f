"""The pictures of a diagnosis, each as the bytes of a PNG file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sim2real.result import NextManoeuvre, Trace, Unexplained
from sim2real.where.equations import QUANTITIES, TWO_SIDED
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER, FLOOR = "#30343b", "#d55e00", "#0072b2", "#8a8f98"
"""One colour per thing, in all pictures and in the report's own bars: before and after are of the palette of Okabe and
Ito, which the colour-blind can tell apart."""
BEFORE_STYLE = (0, (4, 1.5))
"""Dashes, so that before and after differ in grey too."""
WHEEL_LINES = ((AFTER, "-"), (BEFORE, BEFORE_STYLE), ("#009e73", "-."), ("#cc79a7", ":"))
WIDTH_IN, NARROW_IN = 9.6, 4.4
"""Width of a picture, and of one that is to be read on a phone [in]."""
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa0a8",
    "axes.labelcolor": MEASURED,
    "xtick.color": "#5c626b",
    "ytick.color": "#5c626b",
    "axes.grid": True,
    "grid.color": "#e4e6e9",
    "axes.axisbelow": True,
    "legend.frameon": False,
}

ZOOM_S = 2.0
"""Length of the window that is looked at closely [s]."""
MEAN_S = 0.1
"""Window of the running mean that shows a pattern under the noise [s]."""
LEFT_OUT = 0.005
"""Share of the largest residuals that may leave the picture of the whole drive, so that a spike hides nothing [-]."""
BAND_SIGMA = 2.0
"""Half width of the shown noise band: 95 % of the samples of a right model lie in it."""


@contextmanager
def _sheet(
    rows: int, columns: int, height_in: float, width_in: float = WIDTH_IN, **options: Any
) -> Iterator[tuple[Figure, Array, BytesIO]]:
    """A figure, its axes, and the buffer that holds its PNG afterwards, whose width in pixels is always the same."""
    buffer = BytesIO()
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            rows,
            columns,
            figsize=(width_in, height_in),
            squeeze=False,
            layout="constrained",
            **options,
        )
        try:
            yield figure, axes, buffer
            figure.savefig(buffer, format="png", dpi=DPI * WIDTH_IN / width_in, metadata={"Software": None})
        finally:
            plt.close(figure)


def largest_gap(shown: Trace, added: str) -> bytes:
    """One signal in the window in which the simulation is furthest off; `added` names the effects of its after."""
    start, end = worst_window(shown)
    with _sheet(1, 1, 2.9, NARROW_IN) as (_, axes, buffer):
        axis: Axes = axes[0, 0]
        _curves(axis, shown, added)
        axis.set_xlim(start, end)
        _fit_to_window(axis, shown, start, end)
        axis.set_xlabel("time [s]")
        axis.set_ylabel(label_of(shown.signal))
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=8)
    return buffer.getvalue()


def trace(shown: Trace, added: str) -> bytes:
    """One signal over the hold-out, its residuals, and both again in the worst window; `added` as in `largest_gap`."""
    start, end = worst_window(shown)
    with _sheet(2, 2, 3.5, sharex="col", width_ratios=[2.2, 1.0], height_ratios=[1.35, 1.0]) as (
        _,
        axes,
        buffer,
    ):
        for column in (0, 1):
            _curves(axes[0, column], shown, added)
            _residuals(axes[1, column], shown)
            axes[1, column].set_xlabel("time [s]")
        axes[0, 0].set_xlim(shown.time_s[0], shown.time_s[-1])
        axes[0, 1].set_xlim(start, end)
        for axis in axes[:, 0]:
            axis.axvspan(start, end, color="#f3e3d3", lw=0, zorder=-10)
        axes[0, 0].set_ylabel(f"[{pretty_unit(shown.unit)}]")
        axes[1, 0].set_ylabel(f"measured − model\n[{pretty_unit(shown.unit)}]")
        axes[0, 1].set_title(f"worst window, {start:.1f} to {end:.1f} s", fontsize=9)
        axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
        _fit_to_window(axes[0, 1], shown, start, end)
        axes[1, 0].set_ylim(_limits(shown, shown.time_s[0], shown.time_s[-1], LEFT_OUT))
        axes[1, 1].set_ylim(_limits(shown, start, end, 0.0))
    return buffer.getvalue()


def _same(shown: Trace) -> bool:
    """Whether nothing was added, so that there is one simulation to draw."""
    return bool(np.array_equal(shown.before, shown.after, equal_nan=True))


def _curves(axis: Axes, shown: Trace, added: str) -> None:
    axis.plot(shown.time_s, shown.measured, color=MEASURED, lw=1.6, alpha=0.55, label="measured")
    axis.plot(shown.time_s, shown.before, color=BEFORE, ls=BEFORE_STYLE, lw=1.2, label="simulated")
    if not _same(shown):
        axis.plot(
            shown.time_s,
            shown.after,
            color=AFTER,
            lw=1.0,
            label=f"simulated with {added}".replace(" and ", "\nand "),
        )


def _residuals(axis: Axes, shown: Trace) -> None:
    band = BAND_SIGMA * shown.noise
    axis.axhspan(-band, band, color="#e9ebee", lw=0)
    models = [(shown.before, BEFORE, BEFORE_STYLE), (shown.after, AFTER, "-")]
    for model, colour, style in models[: 1 if _same(shown) else 2]:
        rest = shown.measured - model
        axis.plot(shown.time_s, rest, color=colour, lw=0.5, alpha=0.45)
        axis.plot(shown.time_s, _running_mean(shown.time_s, rest), color=colour, ls=style, lw=1.3)


def _running_mean(time_s: Array, values: Array) -> Array:
    """Mean over a centred window of `MEAN_S`; lost samples are left out of it."""
    window = np.ones(2 * round(0.5 * MEAN_S / (time_s[1] - time_s[0])) + 1)
    there = np.convolve(np.isfinite(values), window, mode="same")
    total = np.convolve(np.nan_to_num(values), window, mode="same")
    return np.divide(total, there, out=np.full(len(values), np.nan), where=there > 0.5)


def _limits(shown: Trace, start: float, end: float, left_out: float) -> tuple[float, float]:
    """Symmetric limits for the residuals in a window but for this share of the largest."""
    rows = (shown.time_s >= start) & (shown.time_s <= end)
    rest = np.abs([shown.measured - shown.before, shown.measured - shown.after])[:, rows]
    rest = rest[np.isfinite(rest)]
    largest = float(np.quantile(rest, 1.0 - left_out)) if len(rest) else 0.0
    limit = 1.1 * max(largest, 2.0 * BAND_SIGMA * shown.noise)
    return -limit, limit


def _fit_to_window(axis: Axes, shown: Trace, start: float, end: float) -> None:
    """Limits of the closer look from what lies in it."""
    rows = (shown.time_s >= start) & (shown.time_s <= end)
    inside = np.concatenate([a[rows] for a in (shown.measured, shown.before, shown.after)])
    inside = inside[np.isfinite(inside)]
    if len(inside) and np.ptp(inside) > 0.0:
        axis.set_ylim(inside.min() - 0.08 * np.ptp(inside), inside.max() + 0.08 * np.ptp(inside))


def worst_window(shown: Trace, length_s: float = ZOOM_S) -> tuple[float, float]:
    """Start and end of the window in which the simulation before is furthest off in the mean square [s]."""
    step_s = float(shown.time_s[1] - shown.time_s[0])
    rows = min(max(round(length_s / step_s), 1), len(shown.time_s))
    square = np.nan_to_num((shown.measured - shown.before) ** 2)
    sums = np.convolve(square, np.ones(rows), mode="valid")
    first = int(np.argmax(sums))
    return float(shown.time_s[first]), float(shown.time_s[first + rows - 1])


def missing_term(term: Unexplained) -> bytes:
    """The curve of a term that no effect of the library has."""
    with _sheet(1, 1, 2.9, NARROW_IN) as (_, axes, buffer):
        axis: Axes = axes[0, 0]
        axis.axhline(0.0, color=FLOOR, lw=0.8)
        begins = np.diff(term.x) < 0.0  # one curve per log where the quantity is time
        if term.depends_on in TWO_SIDED:
            begins |= np.diff(np.sign(term.x)) > 0.0
        starts = np.flatnonzero(begins) + 1
        for x, y in zip(np.split(term.x, starts), np.split(term.y, starts), strict=True):
            axis.plot(x, y, color=BEFORE, lw=1.6, alpha=0.8, marker="o", ms=3.0)
        sides = ",\nnegative where it brakes" if term.depends_on in TWO_SIDED else ""
        axis.set_xlabel(quantity_label(term.depends_on) + sides)
        axis.set_ylabel(f"further term, {words(term.subsystem)} [{pretty_unit(term.unit)}]")
    return buffer.getvalue()


def quantity_label(quantity: str) -> str:
    """What a missing term depends on, with its unit."""
    return (
        f"{quantity} [{pretty_unit(QUANTITIES[quantity][0])}]"
        if quantity in QUANTITIES
        else label_of(quantity)
    )


def profile(manoeuvre: NextManoeuvre) -> bytes:
    """The torque to drive next; wheels that get the same share a line."""
    lines: dict[bytes, list[str]] = {}
    for i, wheel in enumerate(WHEELS):
        lines.setdefault(manoeuvre.wheel_torque_nm[:, i].tobytes(), []).append(wheel)
    with _sheet(1, 1, 2.7) as (_, axes, buffer):
        axis: Axes = axes[0, 0]
        axis.axhline(0.0, color=FLOOR, lw=0.8)
        for (colour, style), wheels in zip(WHEEL_LINES, lines.values(), strict=False):
            torque = manoeuvre.wheel_torque_nm[:, WHEELS.index(wheels[0])]
            label = "all wheels" if len(wheels) == len(WHEELS) else ", ".join(wheels)
            axis.plot(manoeuvre.time_s, torque, color=colour, ls=style, lw=1.6, label=label)
        axis.set_xlim(manoeuvre.time_s[0], manoeuvre.time_s[-1])
        axis.set_xlabel("time [s]")
        axis.set_ylabel("torque per wheel [N m]")
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, ncols=4)
    return buffer.getvalue()


UNIT_ENDINGS = {
    "_rad_s": "rad/s",
    "_m_s2": "m/s^2",
    "_m_s": "m/s",
    "_nm": "N m",
    "_rad": "rad",
    "_m": "m",
    "_s": "s",
    "_n": "N",
}
"""How the contract's names end, longest first, and the unit that this says."""


def label_of(name: str) -> str:
    """A name in code as an axis label: `vehicle_speed_m_s` is 'vehicle speed [m/s]'."""
    for ending, unit in UNIT_ENDINGS.items():
        if name.endswith(ending):
            return f"{words(name.removesuffix(ending))} [{pretty_unit(unit)}]"
    return words(name)


def words(name: str) -> str:
    """A name in code as words."""
    return name.replace("_", " ")


def pretty_unit(unit: str) -> str:
    """A unit with its powers raised."""
    return unit.replace("^2", "²").replace("^3", "³")
