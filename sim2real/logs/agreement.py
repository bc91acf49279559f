"""Whether the signals of a log agree with one another: scales, units and signs of single columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.checks import span
from sim2real.logs.contract import POSITION, TIME, WHEEL_SPEEDS
from sim2real.logs.table import Array, Finding
from trpac_core.vehicle import WHEELS

MOVING_M_S = 3.0
"""From this speed on a wheel speed is compared with it [m/s]."""
WHEEL_PER_METRE = (1.5, 6.5)
"""Wheel speed over ground speed, radius 0.15 to 0.67 m [rad/m]; with km/h, with rpm and with both it lies outside."""
ROLLING_SHARE = 0.1
"""Least share of the rows in which a wheel turns so: it may be locked or spin in the others [-]."""
FACTOR = 1.3
"""Ratio of two signals that measure the same from which on one of them is warned of: between noise, grades and tyres
that differ, a tenth together, and a unit or a gear taken wrong, at least 1.5 [-]."""
REFUSED = 2.0
"""Such a ratio of position and speed that is refused: no odometer or tyre is off so far [-]."""
DISTANCE_M = 10.0
"""From this distance on the position is compared with the integral of speed [m]."""
SMOOTH_S = 0.5
"""The accelerometer is compared with the change of speed over pieces of this length [s]."""
VARIED_M_S2 = 0.5
"""Standard deviation of the change of speed that an accelerometer along the car shows in any case [m/s2]."""
SIGNIFICANT = 4.0
"""Student's t of a correlation from which on it is no chance [-]."""
ALIKE = 0.98
"""Correlation from which on two signals differ by a factor alone [-]."""
TURNING_RAD_S = 0.05
"""Yaw rate from which on a curve's signals are compared: 1 m of arc in 4 s at 5 m/s [rad/s]."""
TRACKS_M = (0.9, 2.6)
"""Tracks of road vehicles [m]."""
WHEELBASES_M = (1.4, 9.0)
"""Speed times steering angle over yaw rate: wheelbases of road vehicles, with their understeer [m]."""


def check_agreement(
    time_s: Array, signals: Mapping[str, Array], derived: frozenset[str]
) -> Iterator[Finding]:
    """Findings on columns that disagree with the others by a factor or a sign; `derived` ones measure nothing."""
    yield from _check_motion(time_s, signals, derived)
    yield from _check_torques(signals)
    yield from _check_turning(signals)


def check_wheels(signals: Mapping[str, Array]) -> Iterator[Finding]:
    """Whether the wheels turn about as fast as the car moves: units, signs; said once where all are off alike."""
    off, medians = {}, {}
    for name in (n for n in WHEEL_SPEEDS if n in signals and "vehicle_speed_m_s" in signals):
        speed = signals["vehicle_speed_m_s"]
        moving = (np.abs(speed) > MOVING_M_S) & np.isfinite(speed + signals[name])
        if np.count_nonzero(moving) < 2:
            continue
        per_metre = signals[name][moving] / speed[moving]
        rolling = (per_metre >= WHEEL_PER_METRE[0]) & (per_metre <= WHEEL_PER_METRE[1])
        if np.mean(rolling) < ROLLING_SHARE:
            off[name] = float(np.median(per_metre))
        else:
            medians[name] = float(np.median(per_metre[rolling]))
    if len(off) == len(WHEEL_SPEEDS) and len({_ratio_hint(ratio) for ratio in off.values()}) == 1:
        yield _wheel_finding("every wheel speed", float(np.median(list(off.values()))))
        return
    for name, ratio in off.items():
        yield _wheel_finding(f"column {name}", ratio)
    for name, ratio in medians.items():
        others = [other for wheel, other in medians.items() if wheel != name]
        if len(others) > 1 and not 1.0 / FACTOR <= (times := ratio / float(np.median(others))) <= FACTOR:
            yield Finding(
                f"{name} is {times:.2g} times the other wheels' speed; is its unit or scale wrong?",
                fatal=False,
            )


def _wheel_finding(what: str, ratio: float) -> Finding:
    return Finding(
        f"{what} over vehicle_speed_m_s is {ratio:.3g} rad/m in the median; expected {span(WHEEL_PER_METRE)} rad/m "
        f"(one over the wheel's radius). {_ratio_hint(ratio)}"
    )


def _check_motion(time_s: Array, signals: Mapping[str, Array], derived: frozenset[str]) -> Iterator[Finding]:
    """Position against speed, and the accelerometer against its change; which is off, where that can be told."""
    if "vehicle_speed_m_s" not in signals:
        return
    way = None if POSITION in derived else _way(time_s, signals)
    change = _change(time_s, signals)
    ratio, slope = way[0] / way[1] if way else np.nan, change.slope if change else np.nan
    culprit = _culprit(ratio, slope)
    if way and not 1.0 / FACTOR <= ratio <= FACTOR:
        yield Finding(
            f"column {POSITION} changes by {way[0]:.4g} m while the speed integrates to {way[1]:.4g} m; "
            f"{culprit or f'one of them or {TIME} is off, '}expected the distance driven along the road in metres, "
            f"without a reset. Where it was not measured, a mapping file can say `{POSITION}: {{integrate: {{copy: "
            "vehicle_speed_m_s}}`.",
            fatal=not 1.0 / REFUSED <= ratio <= REFUSED,
        )
        if "accel_x_m_s2" not in culprit:
            return
    if change is None:
        return
    if change.reversed:
        yield Finding(
            "accel_x_m_s2 goes against the change of vehicle_speed_m_s; is its sign reversed?", fatal=False
        )
    elif change.low > FACTOR or change.high < 1.0 / FACTOR:
        hint = culprit.removesuffix(", ") or f"or is {TIME}, or the speed, off by as much?"
        if 0.05 < slope < 0.25:
            hint = "is it in g?"
        elif slope <= 0.05:
            hint = "is it the longitudinal acceleration, and in m/s2?"
        yield Finding(
            f"accel_x_m_s2 is {slope:.2g} times the change of vehicle_speed_m_s; {hint}", fatal=False
        )


def _way(time_s: Array, signals: Mapping[str, Array]) -> tuple[float, float] | None:
    """Change of the position, and the integral of speed over the same rows [m]; None where it is short."""
    speed, position = signals["vehicle_speed_m_s"], signals.get(POSITION)
    if position is None:
        return None
    known = np.isfinite(speed) & np.isfinite(position)
    if np.count_nonzero(known) < 2:
        return None
    driven = float(np.trapezoid(speed[known], time_s[known]))
    moved = float(position[known][-1] - position[known][0])
    return (moved, driven) if abs(driven) > DISTANCE_M else None


@dataclass(frozen=True)
class _Change:
    """The accelerometer over the change of speed: between which factors it lies, and whether it goes against it."""

    low: float
    high: float
    reversed: bool

    @property
    def slope(self) -> float:
        """The factor, where noise is shared alike."""
        return float(np.sqrt(self.low * self.high))


def _change(time_s: Array, signals: Mapping[str, Array]) -> _Change | None:
    """The accelerometer over the change of speed; None where they tell nothing of each other.

    Noise of either makes the slope over the other too small, so that the factor lies between the slope of one and the
    inverse slope of the other.
    """
    accel = signals.get("accel_x_m_s2")
    if accel is None:
        return None
    known = np.isfinite(signals["vehicle_speed_m_s"]) & np.isfinite(accel)
    t, v, a = time_s[known], signals["vehicle_speed_m_s"][known], accel[known]
    if len(t) < 2:
        return None
    piece = np.floor((t - t[0]) / SMOOTH_S).astype(int)
    _, first = np.unique(piece, return_index=True)
    change = np.diff(v[first]) / np.diff(t[first])
    mean = (np.add.reduceat(a, first) / np.diff([*first, len(a)]))[:-1]
    if len(change) < 3 or np.ptp(change) == 0.0:
        return None
    (xx, xy), (_, yy) = np.cov(change, mean)
    together = float(xy / np.sqrt(xx * yy)) if yy > 0.0 else 0.0
    if abs(together) * np.sqrt(len(change) - 2) >= SIGNIFICANT * np.sqrt(max(1.0 - together**2, 0.0)):
        return _Change(float(abs(xy) / xx), float(yy / abs(xy)), together < -0.5)
    return _Change(0.0, 0.0, reversed=False) if xx > VARIED_M_S2**2 and abs(xy) < 0.25 * xx else None


def _culprit(ratio: float, slope: float) -> str:
    """Which column's factor explains both ratios; empty where one of them is not known or has a sign.

    A factor k of the time divides position over the integral of speed by k and multiplies the accelerometer over the
    change of speed by k; of the speed it divides both; of the position and of the accelerometer it multiplies one.
    """
    if not (ratio > 0.0 and slope > 0.0):
        return ""
    seen = np.log([ratio, slope])
    sides = {
        TIME: (-1.0, 1.0),
        "vehicle_speed_m_s": (-1.0, -1.0),
        POSITION: (1.0, 0.0),
        "accel_x_m_s2": (0.0, 1.0),
    }
    by = {name: float(seen @ side / np.dot(side, side)) for name, side in sides.items()}
    left = {name: float(np.linalg.norm(seen - by[name] * np.array(side))) for name, side in sides.items()}
    name = min(left, key=lambda n: left[n])
    return f"{name} looks about {np.exp(by[name]):.2g} times too large, "


def _check_torques(signals: Mapping[str, Array]) -> Iterator[Finding]:
    """Torques of one axle that differ by a lasting factor or sign."""
    for left, right in (WHEELS[:2], WHEELS[2:]):
        names = f"wheel_torque_{left}_nm", f"wheel_torque_{right}_nm"
        if any(name not in signals for name in names):
            continue
        slope = _slope(signals[names[1]], signals[names[0]])
        if slope is not None and not 1.0 / FACTOR <= slope <= FACTOR:
            what = "has the other sign than" if slope < 0.0 else f"is {slope:.3g} times"
            yield Finding(
                f"{names[0]} {what} {names[1]} in the whole log; is a unit, a scale or a sign wrong?",
                fatal=False,
            )


def _check_turning(signals: Mapping[str, Array]) -> Iterator[Finding]:
    """Yaw rate against the rear wheels, lateral acceleration and steering angle against it."""
    speed, yaw = signals.get("vehicle_speed_m_s"), signals.get("yaw_rate_rad_s")
    if speed is None or yaw is None:
        return
    turning = (np.abs(speed) > MOVING_M_S) & (np.abs(yaw) > TURNING_RAD_S)
    rear = [signals.get(f"wheel_speed_{w}_rad_s") for w in ("rl", "rr")]
    if rear[0] is not None and rear[1] is not None:
        over = turning & (np.abs(rear[0] + rear[1]) > 0.0)
        difference = 2.0 * (rear[1] - rear[0])[over] / (rear[1] + rear[0])[over] * speed[over]
        track = _slope(yaw[over], difference)
        if track is not None and not TRACKS_M[0] <= track <= TRACKS_M[1]:
            yield Finding(
                f"yaw_rate_rad_s and the rear wheels' speeds make a track of {track:.3g} m; expected "
                f"{span(TRACKS_M)} m. Is the yaw rate's unit or sign wrong?",
                fatal=False,
            )
    for name, of, values, (low, high), unit in (
        (
            "accel_y_m_s2",
            speed * yaw,
            1.0,
            (1.0 / FACTOR, FACTOR),
            "times the vehicle's speed times yaw_rate_rad_s",
        ),
        ("steering_angle_rad", yaw, speed, WHEELBASES_M, "m of wheelbase by speed and yaw_rate_rad_s"),
    ):
        if name not in signals:
            continue
        slope = _slope(of[turning], (signals[name] * values)[turning])
        if slope is not None and not low <= slope <= high:
            yield Finding(
                f"{name} is {slope:.3g} {unit}; expected {low:.2g} to {high:.2g}. Is its unit or sign wrong?",
                fatal=False,
            )


def _slope(of: Array, values: Array) -> float | None:
    """Factor between two signals without an offset, by their mean squares; None where they are not `ALIKE`."""
    known: NDArray[np.bool_] = np.isfinite(of) & np.isfinite(values)
    x, y = of[known], values[known]
    xx, xy, yy = float(x @ x), float(x @ y), float(y @ y)
    if len(x) < 10 or xx <= 0.0 or yy <= 0.0 or abs(xy) < ALIKE * np.sqrt(xx * yy):
        return None
    return float(np.sign(xy) * np.sqrt(yy / xx))


def _ratio_hint(ratio: float) -> str:
    if ratio < 0.0:
        return "Is a sign reversed?"
    if ratio < WHEEL_PER_METRE[0]:
        return (
            "Is the vehicle's speed in km/h, or the wheel's in m/s or rev/s? A mapping file says so: "
            "`vehicle_speed_m_s: {column: NAME, unit: km/h}`."
        )
    return (
        "Is the wheel's speed in rpm, deg/s or km/h? A mapping file says so: "
        "`wheel_speed_fl_rad_s: {column: NAME, unit: rpm}`."
    )
