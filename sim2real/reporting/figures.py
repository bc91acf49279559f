"""The plots of a diagnosis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenarios.plot_style import BLUE, DASHED, INK, SHADE, SOLID, VERMILLION, WHEEL_STYLES, Style
from scenarios.plots import Figure, Panel, Series, Shade
from sim2real.result import NextManoeuvre, Trace, Unexplained
from sim2real.where.equations import QUANTITIES, TWO_SIDED
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER = Style(INK, width=1.2), Style(VERMILLION, DASHED), Style(BLUE, SOLID)
"""One style per thing, in all plots."""
ZOOM_S = 2.0
"""Length of the window that is looked at closely [s]."""
MEAN_S = 0.1
"""Window of the running mean that shows a pattern under the noise [s]."""
LEFT_OUT = 0.005
"""Share of the largest residuals that may leave the plot, so that a spike hides nothing [-]."""
BAND_SIGMA = 2.0
"""Half width of the shown noise band: 95 % of the samples of a right model lie in it."""
NO_SAMPLE = "no sample of this signal can be compared with the simulation."


def largest_gap(shown: Trace, added: str) -> Figure:
    """One signal in the window in which the simulation is furthest off; `added` names the effects of its after."""
    start, end = worst_window(shown)
    rows = (shown.time_s >= start) & (shown.time_s <= end)
    return Figure(
        f"{shown.signal} where the simulation is furthest off",
        (Panel(label_of(shown.signal), NO_SAMPLE, _curves(shown, added, rows), x_limits=(start, end)),),
    )


def trace(shown: Trace, added: str) -> Figure:
    """One signal over the hold-out, and its residuals; `added` as in `largest_gap`."""
    ends = float(shown.time_s[0]), float(shown.time_s[-1])
    worst = (Shade(*worst_window(shown)),)
    every = np.ones(len(shown.time_s), dtype=bool)
    rest = f"measured − model [{pretty_unit(shown.unit)}]"
    return Figure(
        f"{shown.signal} and what the simulation leaves of it over time",
        (
            Panel(
                label_of(shown.signal), NO_SAMPLE, _curves(shown, added, every), shades=worst, x_limits=ends
            ),
            Panel(rest, NO_SAMPLE, _residuals(shown), shades=worst, x_limits=ends, y_limits=_limits(shown)),
        ),
    )


def _same(shown: Trace) -> bool:
    """Whether nothing was added, so that there is one simulation to draw."""
    return bool(np.array_equal(shown.before, shown.after, equal_nan=True))


def _curves(shown: Trace, added: str, rows: NDArray[np.bool_]) -> tuple[Series, ...]:
    curves = [("measured", shown.measured, MEASURED), ("simulated", shown.before, BEFORE)]
    if not _same(shown):
        curves.append((f"simulated with {added}", shown.after, AFTER))
    return tuple(Series(name, shown.time_s[rows], values[rows], style) for name, values, style in curves)


def _residuals(shown: Trace) -> tuple[Series, ...]:
    ends, edge = shown.time_s[[0, -1]], np.full(2, BAND_SIGMA * shown.noise)
    series = [Series("noise, ± 2 standard deviations", ends, edge, Style(SHADE), low=-edge)]
    models = [("simulated", shown.before, BEFORE), ("with the effect", shown.after, AFTER)]
    for name, model, style in models[: 1 if _same(shown) else 2]:
        rest = shown.measured - model
        thin = Style(style.colour, width=0.5)
        mean = Style(style.colour, style.dash, width=2.0)
        series.append(Series("", shown.time_s, rest, thin))
        series.append(
            Series(f"{name}, mean over {MEAN_S:g} s", shown.time_s, _running_mean(shown.time_s, rest), mean)
        )
    return tuple(series)


def _running_mean(time_s: Array, values: Array) -> Array:
    """Mean over a centred window of `MEAN_S`; lost samples are left out of it."""
    window = np.ones(2 * round(0.5 * MEAN_S / (time_s[1] - time_s[0])) + 1)
    there = np.convolve(np.isfinite(values), window, mode="same")
    total = np.convolve(np.nan_to_num(values), window, mode="same")
    return np.divide(total, there, out=np.full(len(values), np.nan), where=there > 0.5)


def _limits(shown: Trace) -> tuple[float, float]:
    """Symmetric limits for the residuals but for `LEFT_OUT` of the largest."""
    rest = np.abs([shown.measured - shown.before, shown.measured - shown.after])
    rest = rest[np.isfinite(rest)]
    largest = float(np.quantile(rest, 1.0 - LEFT_OUT)) if len(rest) else 0.0
    limit = 1.1 * max(largest, 2.0 * BAND_SIGMA * shown.noise)
    return -limit, limit


def worst_window(shown: Trace, length_s: float = ZOOM_S) -> tuple[float, float]:
    """Start and end of the window in which the simulation before is furthest off in the mean square [s]."""
    step_s = float(shown.time_s[1] - shown.time_s[0])
    rows = min(max(round(length_s / step_s), 1), len(shown.time_s))
    square = np.nan_to_num((shown.measured - shown.before) ** 2)
    sums = np.convolve(square, np.ones(rows), mode="valid")
    first = int(np.argmax(sums))
    return float(shown.time_s[first]), float(shown.time_s[first + rows - 1])


def missing_term(term: Unexplained) -> Figure:
    """The curve of a term that no effect of the library has."""
    begins = np.diff(term.x) < 0.0  # one curve per log where the quantity is time
    if term.depends_on in TWO_SIDED:
        begins |= np.diff(np.sign(term.x)) > 0.0
    starts = np.flatnonzero(begins) + 1
    x, y = np.insert(term.x, starts, np.nan), np.insert(term.y, starts, np.nan)
    sign = ", negative where it brakes" if term.depends_on in TWO_SIDED else ""
    panel = Panel(
        f"further term, {words(term.subsystem)} [{pretty_unit(term.unit)}]",
        "the logs give the term no value.",
        (Series("", x, y, Style(VERMILLION), "marked"),),
        x_label=quantity_label(term.depends_on) + sign,
    )
    return Figure(f"The missing term over {term.depends_on}", (panel,))


def quantity_label(quantity: str) -> str:
    """What a missing term depends on, with its unit."""
    return (
        f"{quantity} [{pretty_unit(QUANTITIES[quantity][0])}]"
        if quantity in QUANTITIES
        else label_of(quantity)
    )


def profile(manoeuvre: NextManoeuvre) -> Figure:
    """The torque to drive next; wheels that get the same share a line."""
    lines: dict[bytes, list[str]] = {}
    for i, wheel in enumerate(WHEELS):
        lines.setdefault(manoeuvre.wheel_torque_nm[:, i].tobytes(), []).append(wheel)
    series = tuple(
        Series(
            "all wheels" if len(wheels) == len(WHEELS) else ", ".join(wheels),
            manoeuvre.time_s,
            manoeuvre.wheel_torque_nm[:, WHEELS.index(wheels[0])],
            WHEEL_STYLES[wheels[0]],
        )
        for wheels in lines.values()
    )
    ends = float(manoeuvre.time_s[0]), float(manoeuvre.time_s[-1])
    panel = Panel("torque of each wheel [N m]", "the profile has no torque.", series, x_limits=ends)
    return Figure("Torque of each wheel over time", (panel,))


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
