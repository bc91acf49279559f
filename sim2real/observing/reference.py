"""Reference logs: what the nominal model leaves of the same manoeuvre without the fault, or of another simulation.

A car that is built otherwise than the nominal model leaves residuals without any fault. A second log of the same
manoeuvre has them too: residuals minus residuals is what the fault alone does, to first order. Each log is followed by
an observer of its own, so that the two need not have the same speed or torque.

References
----------
.. [1] Kennedy, O'Hagan (2001), Journal of the Royal Statistical Society B 63, 425-464: the discrepancy of a model,
   here measured where others assume a prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from sim2real.logs.errors import LogError
from sim2real.observing.drive import CHANNELS, POSITION, Drive
from sim2real.observing.evidence import SETTLING_S, residuals
from sim2real.observing.observer import Simulation

Array = NDArray[np.float64]
By = Literal["time", "position"]
"""What says that rows of two logs are the same point of the manoeuvre: `time_s` or `position_m`, as in the files."""

LEAST_COVERED = 0.5
"""Share of a log's rows that its reference has to cover at least; the others are no evidence [-]."""
SMOOTHED_S = 0.2
"""Positions are averaged over this time before rows are matched by them: they have noise of centimetres [s]."""
FORGOTTEN_S = 0.3
"""Before and after rows at which the two cars are on different roads, the reference is not used for so long: three
times the observer's memory of the wheels [s]."""
OTHER_TORQUE = 0.25
"""Root mean square of the torques' difference over that of the torque from which on a pair was driven otherwise [-]."""


def held_against(model: Simulation, drive: Drive, reference: Drive, by: By = "time") -> Drive:
    """The drive with what the nominal model leaves of its reference, on the drive's rows.

    Parameters
    ----------
    model : Simulation
        The nominal model: the car with the effects of its own file.
    drive, reference : Drive
        The log, and the same manoeuvre without the fault.
    by : "time" or "position"
        What says that rows of the two are the same point of the manoeuvre.

    Raises
    ------
    LogError
        The reference covers less than `LEAST_COVERED` of the log, or a position is needed and not known.
    """
    at = _left_of(model, drive, reference, by)
    share = _share(drive, at)
    if share < LEAST_COVERED:
        raise LogError(_too_little(drive, reference, by, share))
    return replace(drive, reference=at)


def held_against_stretches(
    model: Simulation, drive: Drive, stretches: Sequence[tuple[float, Drive]]
) -> Drive:
    """The same with a reference in stretches, matched by time: each from its time on [s], to the next one's."""
    whole = np.full(drive.measured.shape, np.nan)
    for from_s, stretch in stretches:
        rows = drive.time_s >= from_s - 1e-9
        whole[rows] = _left_of(model, drive, stretch, "time")[rows]
    share = _share(drive, whole)
    if share < LEAST_COVERED:
        raise LogError(
            f"{drive.name}: {stretches[0][1].name} moves where the log does, on the same friction by road.yaml, in "
            f"{100.0 * share:.0f} % of its rows; expected at least {100.0 * LEAST_COVERED:.0f} %. Does the unit "
            "begin with the log's speed and position, and get all of its torque?"
        )
    return replace(drive, reference=whole)


def _left_of(model: Simulation, drive: Drive, reference: Drive, by: By) -> Array:
    """What the model leaves of a reference, at the drive's rows, shape (n, 7)."""
    at = _matched(reference, residuals(_with_counter(model, reference), reference), drive, by)
    if by == "time":
        at[_on_another_road(model, drive, reference)] = np.nan
    return at


def _share(drive: Drive, at: Array) -> float:
    return covered(at, drive.moving & (drive.time_s >= drive.time_s[0] + SETTLING_S))


def _too_little(drive: Drive, reference: Drive, by: By, share: float) -> str:
    """The message of a reference that covers too small a share of a log."""
    (low, high), (first, last) = (_span(d, by) for d in (drive, reference))
    column, unit, other = ("time_s", "s", "position") if by == "time" else ("position_m", "m", "time")
    return (
        f"{drive.name}: its reference {reference.name} covers {100.0 * share:.0f} % of its rows in motion; expected at "
        f"least {100.0 * LEAST_COVERED:.0f} %. {column} runs from {low:.4g} to {high:.4g} {unit} in the log and from "
        f"{first:.4g} to {last:.4g} {unit} in the reference. Record the same manoeuvre, count {column} from the same "
        f"point in both, or match by {other}."
    )


def covered(reference: Array, counts: NDArray[np.bool_]) -> float:
    """Share of the rows that count at which a reference, shape (n, 7), says something [-]."""
    known = np.isfinite(reference).any(axis=1) & counts
    return float(known.sum() / max(int(counts.sum()), 1))


def other_torque(drive: Drive, reference: Drive, by: By = "time") -> float:
    """Root mean square of the difference of the two logs' torques over that of the log's torque [-]."""
    apart = drive.torque_nm - _matched(reference, reference.torque_nm, drive, by)
    size = float(np.sqrt(np.nanmean(drive.torque_nm**2)))
    return float(np.sqrt(np.nanmean(apart**2))) / max(size, 1e-9)


def _with_counter(model: Simulation, reference: Drive) -> Simulation:
    """The model with the pulse counter that the reference's own wheel speeds tell of: a counter is no structure."""
    lattice = reference.lattice
    return model.with_effects(lattice.effect()) if lattice and not model.has(lattice.effect().id) else model


def _matched(reference: Drive, values: Array, drive: Drive, by: By) -> Array:
    """Values of the reference's rows, shape (k, m), at the drive's rows, shape (n, m); NaN where it has none."""
    x, at = (reference.time_s, drive.time_s) if by == "time" else (way(reference), way(drive))
    onward = np.concatenate(([True], np.diff(x) > 0.0))
    columns = [np.interp(at, x[onward], column[onward], np.nan, np.nan) for column in values.T]
    return np.column_stack(columns)


def _on_another_road(model: Simulation, drive: Drive, reference: Drive) -> NDArray[np.bool_]:
    """Rows at which an axle of the two cars has another friction by road.yaml, or had it just before, shape (n,)."""
    if not all(np.isfinite(d.measured[:, POSITION]).any() for d in (drive, reference)):
        return np.zeros(len(drive), dtype=bool)
    own, other = way(drive), _matched(reference, way(reference)[:, None], drive, "time")[:, 0]
    known = np.isfinite(other)
    starts = [s.start_m for s in drive.road.segments]
    theta = np.array([(s.mu_left, s.mu_right) for s in drive.road.segments])
    front_m = model.vehicle.wheelbase_m - model.vehicle.cog_to_rear_axle_m
    apart = np.zeros(len(drive), dtype=bool)
    for ahead_m in (front_m, -model.vehicle.cog_to_rear_axle_m):
        here, there = (
            theta[np.maximum(np.searchsorted(starts, x + ahead_m, side="right") - 1, 0)]
            for x in (own, np.where(known, other, own))
        )
        apart |= (here != there).any(axis=1)
    rows = drive.rows_in(FORGOTTEN_S)
    return np.asarray(maximum_filter1d(apart, 2 * rows + 1))


def way(drive: Drive) -> Array:
    """Position that never falls, without its noise, shape (n,) [m]; raises LogError where it is not known."""
    position = drive.measured[:, POSITION]
    known = np.isfinite(position)
    if not known.any():
        raise LogError(
            f"{drive.name}: {CHANNELS[POSITION]} has no values, and rows are to be matched by position; expected a "
            "position that counts from the same place in both logs. Match by time otherwise."
        )
    filled = np.interp(drive.time_s, drive.time_s[known], position[known])
    smooth = uniform_filter1d(filled, drive.rows_in(SMOOTHED_S), mode="nearest")
    return np.asarray(np.maximum.accumulate(smooth))


def _span(drive: Drive, by: By) -> tuple[float, float]:
    x = drive.time_s if by == "time" else way(drive)
    return float(x[0]), float(x[-1])
