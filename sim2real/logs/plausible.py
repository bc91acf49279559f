"""Samples that no car can have made: they are lost samples, each signal's counted and named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.contract import TIME, WHEEL_SPEEDS
from sim2real.logs.resampling import median_step
from sim2real.logs.table import Array, Finding, Table
from trpac_core.vehicle import WHEELS

SMALLEST_RADIUS_M = 0.15
"""Of a road vehicle's wheel [m]."""
FASTEST_M_S = 150.0
"""Speed that no road vehicle reaches [m/s]."""
HARDEST_M_S2 = 30.0
"""Change of a car's speed that no tyres make, short of a crash [m/s2]: three times the grip of a slick."""
SPIN_RAD_S2 = 20_000.0
"""Acceleration of a wheel that no brake makes [rad/s2]: 6 kN m on a small wheel of 0.3 kg m2."""
LARGEST_NM = 40_000.0
"""Torque that no axle of a lorry carries [N m]."""
MOST_LOST = 0.2
"""Share of a signal's samples up to which what does not fit the others is taken for lost [-]."""
ENDS = frozenset(2**bits - below for bits in range(8, 17) for below in (0, 1, 2))
"""Raw values at the end of a range of 8 to 16 bits, and next to it: a bus's codes for "no value"."""
ISOLATED = 5.0
"""How far beyond all other values such a code lies, over the greatest of them [-]."""


@dataclass(frozen=True)
class Reach:
    """How far a signal can go.

    Attributes
    ----------
    most : float
        Greatest absolute value.
    jump : float
        Change between two samples that noise alone may make.
    rate, spin : float
        Greatest lasting rate of change, and that within one step of the signal, both per second.
    """

    most: float
    jump: float = np.inf
    rate: float = 0.0
    spin: float = 0.0


_WHEEL = Reach(
    2.0 * FASTEST_M_S / SMALLEST_RADIUS_M,  # one that spins is faster than any car
    3.0 / SMALLEST_RADIUS_M,
    HARDEST_M_S2 / SMALLEST_RADIUS_M,
    SPIN_RAD_S2,
)
REACHES: Mapping[str, Reach] = {
    **dict.fromkeys(WHEEL_SPEEDS, _WHEEL),
    **{f"wheel_torque_{w}_nm": Reach(LARGEST_NM) for w in WHEELS},
    "vehicle_speed_m_s": Reach(FASTEST_M_S, 3.0, HARDEST_M_S2),
    "accel_x_m_s2": Reach(200.0),
    "accel_y_m_s2": Reach(200.0),
    "yaw_rate_rad_s": Reach(20.0),
    "steering_angle_rad": Reach(25.0),
}
"""By column of the log format, in its unit."""

Row = Callable[[int], str]


def without_codes(table: Table, invalid: Mapping[str, tuple[float, ...]]) -> Table:
    """The table with lost samples where a column of the file holds a value that a mapping file calls invalid."""
    numbers, notes = dict(table.numbers), list(table.notes)
    for name, values in numbers.items():
        codes = (*invalid.get("*", ()), *invalid.get(name, ()))
        lost = (
            np.logical_or.reduce([np.isclose(values, c, rtol=1e-9, atol=0.0) for c in codes])
            if codes
            else None
        )
        if lost is not None and lost.any():
            numbers[name] = np.where(lost, np.nan, values)
            notes.append(f"{np.count_nonzero(lost)} invalid samples of {name!r} lost")
    return table.with_numbers(numbers, notes)


def without_stuck_codes(table: Table, signals: frozenset[str]) -> Table:
    """The table with lost samples where one of these columns is stuck at an end of a bus's range, beyond all others."""
    numbers, findings = dict(table.numbers), []
    for name in signals & numbers.keys():
        values = numbers[name]
        finite = values[np.isfinite(values)]
        for code in (float(finite.max()), float(finite.min())) if len(finite) else ():
            at = np.flatnonzero(values == code)
            if not _is_code(code) or not _is_isolated(values, code, at):
                continue
            numbers[name] = np.where(values == code, np.nan, numbers[name])
            findings.append(
                Finding(
                    f"column {name!r}: {len(at)} samples from row {table.rows[at[0]]} on are {code:g}, the end of a "
                    "bus's range and far beyond all others; they are lost samples. A mapping file can say so: "
                    f"`invalid: {{{name!r}: [{code:g}]}}`.",
                    fatal=False,
                )
            )
    return table.with_numbers(numbers, table.notes, findings)


def lost_samples(time_s: Array, signals: Mapping[str, Array]) -> tuple[dict[str, Array], list[Finding]]:
    """The signals with NaN where no car can have made a sample, and what was lost of each."""
    kept, findings = dict(signals), []
    for name, reach in REACHES.items():
        if name not in signals:
            continue
        lost = _beyond(time_s, signals[name], reach)
        count = int(np.count_nonzero(lost))
        if count == 0:
            continue
        at = np.flatnonzero(lost)
        first = f"the first {signals[name][at[0]]:.6g} at {TIME} {time_s[at[0]]:.6g}"
        text = f"{name}: {count} samples are impossible for a car, {first}"
        if count > MOST_LOST * np.count_nonzero(np.isfinite(signals[name])):
            findings.append(Finding(f"{text}; expected at most {MOST_LOST:.0%} of such. Is its unit right?"))
            continue
        kept[name] = np.where(lost, np.nan, signals[name])
        findings.append(Finding(f"{text}; they are lost samples.", fatal=False))
    return kept, findings


def _beyond(time_s: Array, values: Array, reach: Reach) -> NDArray[np.bool_]:
    """Samples out of range, and stretches that a signal cannot have jumped to and back from."""
    lost = np.isfinite(values) & (np.abs(values) > reach.most)
    there = np.flatnonzero(np.isfinite(values) & ~lost)
    if len(there) < 2 or not np.isfinite(reach.jump):
        return lost
    t, x = time_s[there], values[there]
    step = median_step(t)
    ends = np.flatnonzero(np.abs(np.diff(x)) > reach.jump + reach.spin * step + reach.rate * np.diff(t)) + 1
    if len(ends) == 0:
        return lost
    stretches = list(zip([0, *ends], [*ends, len(x)], strict=True))
    longest = max(range(len(stretches)), key=lambda k: stretches[k][1] - stretches[k][0])
    for order, edge in ((stretches[longest + 1 :], 1), (stretches[:longest][::-1], 0)):
        known = stretches[longest][1] - 1 if edge else stretches[longest][0]
        for first, end in order:
            near, far = (first, end - 1) if edge else (end - 1, first)
            if abs(x[near] - x[known]) <= reach.jump + reach.spin * step + reach.rate * abs(
                t[near] - t[known]
            ):
                known = far
            else:
                lost[there[first:end]] = True
    return lost


def _is_code(value: float) -> bool:
    """Whether a value is the end of a bus's range, or next to it, in steps of 1, 2, 2.5 or 5 of a decimal digit."""
    for decimals in range(5):
        for scale in (1.0, 0.5, 0.4, 0.2):
            raw = min(abs(value), 1e9) * 10.0**decimals * scale
            if abs(raw - round(raw)) < 1e-6 * raw and round(raw) in ENDS:
                return True
    return False


def _is_isolated(values: Array, code: float, at: NDArray[np.intp]) -> bool:
    others = values[np.isfinite(values) & (values != code)]
    if len(at) < 2 or len(at) > MOST_LOST * len(values) or len(others) < 2:
        return False
    return bool(abs(code) > ISOLATED * np.abs(others).max() and np.ptp(others) > 0.0)
