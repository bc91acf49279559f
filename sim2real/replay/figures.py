"""The plots of a replay."""

from __future__ import annotations

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

TOP_THETA = 1.25
"""Upper end of the axes of theta [-]."""
TOP_USED = 1.5
"""Upper end of the axes of used friction [-]."""
UNUSABLE = "no row of the log has usable readings of a wheel."


def estimate(done: Replay) -> Figure:
    """The car's estimate with its interval and the reference, the flags, speed and torque."""
    time_s = done.inputs.time_s
    theta, std, peak = done.ours.of_the_car
    of_the_car = done.of_the_car["TRPAC_low"], done.of_the_car["TRPAC_high"]
    low, high = (bound * peak / theta for bound in interval(done.method, theta, std, *of_the_car))
    styles = estimator_styles([done.method.title, DYNAMICS])
    series = [
        Series("95 % interval", time_s, high, Style(BAND), low=low),
        Series(f"TRPAC_peak ({done.method.title})", time_s, peak, styles[done.method.title]),
    ]
    if done.camera.left or done.camera.right:
        alone = done.traces[DYNAMICS].of_the_car[2]
        series.append(Series(f"without camera ({DYNAMICS})", time_s, alone, styles[DYNAMICS]))
    torque = done.inputs.wheel_torque_nm
    return Figure(
        "Estimated peak friction with its interval, flags, speed and torque over time",
        (
            _theta("peak friction [-]", done, *series, height=1.6),
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
    peak, slip, used = (
        _by_wheel(time_s, np.where(done.usable, values, np.nan))
        for values in (done.ours.peak, done.slip, done.used_friction)
    )
    return Figure(
        "Peak friction, slip and used friction of each wheel over time",
        (
            _theta("TRPAC_peak of each wheel [-]", done, *peak, height=1.2),
            _over_time(done, "slip [-]", UNUSABLE, *slip, y_limits=(0.0, _largest(done.slip))),
            _over_time(
                done,
                "used friction [-]",
                UNUSABLE,
                *used,
                y_limits=(0.0, min(_largest(done.used_friction), TOP_USED)),
            ),
        ),
    )


def curve(done: Replay) -> Figure:
    """Used friction over slip where the car drove: the tyre as the log shows it."""
    rows = done.usable & done.inputs.moving[:, None]
    slip, used = np.where(rows, done.slip, np.nan), np.where(rows, done.used_friction, np.nan)
    most_slip, most_used = _largest(slip), min(_largest(used), TOP_USED)
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
        "used friction [-]",
        "no row of the log has usable readings while the car drives.",
        tuple(points),
        x_label="slip [-]",
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
    return _over_time(done, label, UNUSABLE, *series, y_limits=(0.0, TOP_THETA), height=height)


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


def _largest(values: Array) -> float:
    """Upper end of an axis: all but the largest half per cent, with some room."""
    known = values[np.isfinite(values)]
    return max(1.1 * float(np.quantile(known, 0.995)), 1e-3) if len(known) else 1.0
