"""A sensor that wanders by itself: noise that lasts for seconds and that its own signal alone has.

The wheels' sensors tell of themselves how much they drift, left against right (`observing/drift.py`). A ground speed by
satellites or by optics, and an accelerometer, may wander while they do not, and there is but one of each. So such a
wandering is believed only where it is of the size of the sensor's noise from row to row, where what it does to all
signals through the observer is what they show, and where neither rows nor any effect speak of more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from sim2real.how_far.gap import GAP_SIGNALS
from sim2real.observing.drift import DRIFT_S, left_of
from sim2real.observing.drive import ACCEL, CHANNELS, GROUPS, SPEED
from sim2real.observing.evidence import Evidence, all_logs
from sim2real.observing.observer import Simulation
from sim2real.result import Verdict
from sim2real.which.closure import floors
from sim2real.which.contest import Contest, Entry
from sim2real.which.goodness import block_squares
from sim2real.which.quiet import LONE_GAIN, QUIET_GAIN, none_takes
from sim2real.which.selection import Decision, decide

Array = NDArray[np.float64]

SENSORS = {"vehicle_speed": SPEED, "accel_x": ACCEL}
BESIDE_AN_EFFECT = {"vehicle_speed": SPEED}
"""What may wander beside an effect: an accelerometer that does, and a speed, are also what a force leaves that the
effect has not."""
MOST = 2.0
"""Greatest wandering that is noise, in standard deviations of that on the grid of the diagnosis: what is white averages
out on the way there from the log's own rate, a wandering does not [-]."""
MOST_ROWS = 1.3
"""How far the rows of any log may be off, in what noise and such a wandering make of them on average: within half a
minute a wandering has its bad seconds or has none [-]."""


def nothing_but_wandering(
    decision: Decision, contest: Contest, model: Simulation, fit_to: Evidence, holdout: Evidence
) -> Decision:
    """The decision, `no_gap` in place of `unknown` where sensors wander.

    No effect may take anything that counts; where the one that does leaves the gap open, it may take what noise leaves
    room for: it moves a little with what the sensors do.
    """
    if decision.verdict is not Verdict.UNKNOWN:
        return decision
    if not none_takes(QUIET_GAIN if decision.left_open else LONE_GAIN, contest, fit_to, holdout):
        return decision
    said = _said_of_calm(contest, contest.null, model, SENSORS, fit_to, holdout)
    return said if said and said.verdict is Verdict.NO_GAP else decision


def effect_beside_wandering(
    decision: Decision, contest: Contest, fit_to: Evidence, holdout: Evidence
) -> Decision:
    """The decision, for the best effect in place of `unknown` where a wandering speed is all that it leaves."""
    if decision.verdict is not Verdict.UNKNOWN or not contest.singles:
        return decision
    entry = min(contest.singles, key=lambda e: e.loss)
    if any(e.loss < (1.0 - LONE_GAIN) * entry.loss for e in (*contest.pairs, *contest.structured)):
        return decision
    car = entry.fitted.candidate.model(entry.fitted.x)
    said = _said_of_calm(contest, entry, car, BESIDE_AN_EFFECT, fit_to, holdout)
    return said if said and said.winner is entry and said.verdict is not Verdict.UNKNOWN else decision


def _said_of_calm(
    contest: Contest,
    entry: Entry,
    car: Simulation,
    sensors: Mapping[str, int],
    fit_to: Evidence,
    holdout: Evidence,
) -> Decision | None:
    """The decision once what an entry leaves is put down to sensors; None where the rows or the sensors forbid it."""
    found = _wandering(entry, car, sensors, fit_to, holdout)
    if found is None:
        return None
    wandering, *calm = found
    return replace(decide(contest, *calm), wandering=wandering)


def _wandering(
    entry: Entry, model: Simulation, sensors: Mapping[str, int], fit_to: Evidence, holdout: Evidence
) -> tuple[tuple[str, ...], Evidence, Evidence] | None:
    """Which of some sensors wander, and both parts of the evidence with that in their noise; None where it is too much.

    How much is what brings the variances of the signals' blocks nearest to those seen, a sum over sensors and times.
    It is too much where the rows show more than that, too.
    """
    drives, noises = all_logs(fit_to, holdout)
    units = [(tau_s, np.eye(len(CHANNELS))[channel]) for channel in sensors.values() for tau_s in DRIFT_S]
    makes = [left_of(model, d, n, [[unit] for unit in units]) for d, n in zip(drives, noises, strict=True)]
    lengths = np.array([len(drive) for drive in drives], dtype=np.float64)
    mean = np.average([blocks for blocks, _ in makes], axis=0, weights=lengths)
    slow = np.average([noise.slow for noise in noises], axis=0, weights=lengths)
    seen = block_squares(entry, fit_to, holdout)
    of = list(GROUPS.values())
    excess = np.maximum([np.mean(seen[at] - 1.0 - slow[at]) for at in of], 0.0)
    weight = np.array([1.0 / max(float(np.mean(seen[at])), 1.0) for at in of])
    design = np.array([[np.mean(row[at]) for row in mean] for at in of])
    squares, _ = nnls(design * weight[:, None], excess * weight)
    by_sensor = squares.reshape(len(sensors), -1).sum(axis=1)
    if by_sensor.max() > MOST**2 or not by_sensor.any():
        return None
    for log, (_, rows) in zip((*fit_to.each(), *holdout.each()), makes, strict=True):
        if floors(model, model, log) > MOST_ROWS * np.sqrt(1.0 + _of_rows(squares @ rows)):
            return None
    calm = tuple(
        replace(noise, slow=noise.slow + squares @ blocks)
        for noise, (blocks, _) in zip(noises, makes, strict=True)
    )
    fitted = len(fit_to.noises)
    names = tuple(name for name, square in zip(sensors, by_sensor, strict=True) if square > 0.0)
    return names, replace(fit_to, noises=calm[:fitted]), replace(holdout, noises=calm[fitted:])


def _of_rows(variances: Array) -> float:
    """What variances of the channels' rows add to the square of a gap [-]."""
    of_signals = (variances[GROUPS[name]] for name in GAP_SIGNALS)
    return float(np.mean([np.nanmean(v) for v in of_signals if np.isfinite(v).any()]))
