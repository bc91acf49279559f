"""The plots of a replay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenarios.known import interval
from scenarios.plot_style import (
    BAND,
    BLUE,
    GREY,
    PLAIN,
    PURPLE,
    TRUTH,
    WHEEL_STYLES,
    Style,
    estimator_styles,
)
from scenarios.plots import Figure, Panel, Series, strips
from sim2real.replay.run import DYNAMICS, Replay
from trpac_core.tyre import INITIAL_SLOPE
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

TOP_THETA = 1.3
"""Least upper end of the axes of theta: it holds the greatest bound of `robust` [-]."""
ROOM = 1.05
"""Upper end of an axis over its greatest value [-]."""
SPIKES = 3.0
"""Greatest value over the 99.5 % quantile above which an axis is cut off, and says so [-]."""
UNUSABLE = "no row of the log has usable readings of a wheel."


def estimate(done: Replay) -> Figure:
    """The car's estimate with its interval and the reference, the flags, speed and torque."""
    time_s = done.inputs.time_s
    theta, std, peak = done.ours.of_the_car
    of_the_car = done.of_the_car["TRPAC_low"], done.of_the_car["TRPAC_high"]
    low, high = interval(done.method, theta, std, *of_the_car)
    styles = estimator_styles([done.method.title, DYNAMICS])
    series = [
        Series("95 % interval", time_s, high, Style(BAND), low=low),
        Series(f"TRPAC ({done.method.title})", time_s, theta, styles[done.method.title]),
    ]
    if done.inputs.mu_reference is not None:
        series.append(Series("TRPAC_peak", time_s, peak, Style(PURPLE, width=1.2)))
    if done.camera.left or done.camera.right:
        alone = done.traces[DYNAMICS].of_the_car[0]
        series.append(Series(f"without camera ({DYNAMICS})", time_s, alone, styles[DYNAMICS]))
    torque = done.inputs.wheel_torque_nm
    return Figure(
        "TRPAC with its interval, flags, speed and torque over time",
        (
            _theta("TRPAC [-]", done, *series, height=1.6),
            _flags(done),
            _over_time(
                done, "speed [m/s]", UNUSABLE, Series("", time_s, done.inputs.speed_m_s, PLAIN), height=0.7
            ),
            _over_time(done, "wheel torque [N m]", UNUSABLE, *_by_wheel(time_s, torque), height=0.8),
        ),
    )


def _flags(done: Replay) -> Panel:
    """Strips: slip above the threshold, tyre seen, camera used."""
    flags = {
        "camera": np.any(done.flag, axis=1),
        "tyre": np.any(done.seen, axis=1),
        "excited": np.any(done.ours.excited, axis=1),
    }
    series = strips(done.inputs.time_s, flags, (Style(PURPLE), Style(BLUE), Style(GREY)))
    empty = "no flag was ever set: no tyre slipped above its threshold, and no class of a camera was used."
    ticks = {float(row): name for row, name in enumerate(flags)}
    return _over_time(done, "flags", empty, *series, y_limits=(-0.6, 2.6), ticks=ticks, height=0.5)


def wheels(done: Replay) -> Figure:
    """Estimate, slip and used friction of each wheel."""
    time_s = done.inputs.time_s
    theta, slip, used = (
        np.where(done.usable, values, np.nan) for values in (done.ours.theta, done.slip, done.used_friction)
    )
    return Figure(
        "TRPAC, slip and used friction of each wheel over time",
        (
            _theta("TRPAC of each wheel [-]", done, *_by_wheel(time_s, theta), height=1.2),
            _from_zero(done, "slip", slip),
            _from_zero(done, "used friction", used),
        ),
    )


def curve(done: Replay) -> Figure:
    """Used friction over slip where the car drove: the tyre as the log shows it."""
    rows = done.usable & done.inputs.moving[:, None]
    slip, used = np.where(rows, done.slip, np.nan), np.where(rows, done.used_friction, np.nan)
    most_slip, most_used = _end(slip), _end(used)
    points = [
        Series(wheel, slip[rows[:, i], i], used[rows[:, i], i], style, "points")
        for i, (wheel, style) in enumerate(WHEEL_STYLES.items())
    ]
    if rows.any():
        # The load is the wheels' mean: the line is to be compared with the points, not to go through them.
        load_n = float(np.nanmean(done.ours.load_n[rows]))
        slope = INITIAL_SLOPE * done.inputs.vehicle.longitudinal_stiffness_n / load_n
        end = min(most_slip, most_used / slope)
        line = np.array([0.0, end])
        points.append(Series("1.27 C_x / F_z", line, slope * line, TRUTH))
    panel = Panel(
        _label("used friction", used),
        "no row of the log has usable readings while the car drives.",
        tuple(points),
        x_label=_label("slip", slip),
        x_limits=(0.0, most_slip),
        y_limits=(0.0, most_used),
        height=1.6,
    )
    return Figure("Used friction over slip", (panel,))


def compared(done: Replay) -> Figure:
    """The car's estimate beside those of the peers."""
    styles = estimator_styles(list(done.traces))
    series = [
        Series(name, done.inputs.time_s, t.of_the_car[2], styles[name]) for name, t in done.traces.items()
    ]
    panel = _theta("TRPAC_peak [-]", done, *series, height=1.4)
    return Figure("Peak friction by all estimators over time", (panel,))


def _by_wheel(time_s: Array, values: Array) -> list[Series]:
    return [Series(w, time_s, values[:, i], WHEEL_STYLES[w]) for i, w in enumerate(WHEELS)]


def _theta(label: str, done: Replay, *series: Series, height: float) -> Panel:
    """A panel of friction over time, with the log's reference where it has one."""
    reference = done.inputs.mu_reference
    if reference is not None:
        series += (Series("mu_reference", done.inputs.time_s, reference, TRUTH, "step"),)
    lines = [s.y for s in series if s.low is None]
    top = max(TOP_THETA, *(ROOM * _greatest(y) for y in lines))
    series = tuple(
        replace(s, name=f"{s.name} (cut off at {top:.2f})")
        if s.low is not None and _greatest(s.y) > top
        else s
        for s in series
    )
    return _over_time(done, label, UNUSABLE, *series, y_limits=(0.0, top), height=height)


def _from_zero(done: Replay, name: str, values: Array) -> Panel:
    """A panel of a quantity of each wheel, of which no value is below 0."""
    series = _by_wheel(done.inputs.time_s, values)
    return _over_time(done, _label(name, values), UNUSABLE, *series, y_limits=(0.0, _end(values)))


def _over_time(
    done: Replay,
    label: str,
    empty: str,
    *series: Series,
    y_limits: tuple[float, float] | None = None,
    ticks: dict[float, str] | None = None,
    height: float = 1.0,
) -> Panel:
    ends = float(done.inputs.time_s[0]), float(done.inputs.time_s[-1])
    return Panel(label, empty, series, x_limits=ends, y_limits=y_limits, ticks=ticks, height=height)


def _greatest(values: Array) -> float:
    """The greatest value that is known; 0 where none is."""
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else 0.0


def _cut(values: Array) -> float | None:
    """Where an axis is cut off, since a few values are far above all others; None where it holds all."""
    known = values[np.isfinite(values)]
    usual = float(np.quantile(known, 0.995)) if len(known) else 0.0
    return ROOM * usual if usual > 0.0 and _greatest(values) > SPIKES * usual else None


def _end(values: Array) -> float:
    """Upper end of an axis that begins at 0."""
    cut = _cut(values)
    return max(ROOM * _greatest(values), 1e-3) if cut is None else cut


def _label(name: str, values: Array) -> str:
    """Label of an axis, with where it is cut off."""
    cut = _cut(values)
    return f"{name} [-]" if cut is None else f"{name}, cut off at {cut:.2g} [-]"
