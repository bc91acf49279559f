"""A sensor that wanders by itself: noise that lasts for seconds and that its own signal alone has.

The wheels' sensors tell of themselves how much they drift, left against right (`drift.py`). A ground speed by
satellites or by optics, and an accelerometer, may wander while they do not, and there is but one of each. So such a
wandering is believed only where it is of the size of the sensor's noise from row to row, where what it does to all
signals through the observer is what they show, and where neither rows nor any effect speak of more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from sim2real.closure import floors
from sim2real.contest import Contest, Entry
from sim2real.drift import DRIFT_S, slow_part
from sim2real.drive import ACCEL, GROUPS, SPEED
from sim2real.evidence import Evidence
from sim2real.goodness import block_squares
from sim2real.observer import Simulation
from sim2real.quiet import LONE_GAIN, nothing_gains
from sim2real.result import Verdict
from sim2real.selection import Decision, decide

Array = NDArray[np.float64]

SENSORS = {"vehicle_speed": SPEED, "accel_x": ACCEL}
MOST = 2.0
"""Greatest wandering that is noise, in standard deviations of that on the grid of the diagnosis: what is white averages
out on the way there from the log's own rate, a wandering does not [-]."""
MOST_FLOORS = 1.5
"""And what the rows of any log may be off by, in noise floors: a speed that wanders by as much makes about that [-]."""


def held_to_wandering(
    decision: Decision, contest: Contest, model: Simulation, fit_to: Evidence, holdout: Evidence
) -> Decision:
    """The decision, another than `unknown` where all that is left is how sensors wander by themselves.

    What is left is that of the model as it is, where no effect takes anything that counts, or of the best effect, where
    nothing beside it does.
    """
    if decision.verdict is not Verdict.UNKNOWN:
        return decision
    entry = contest.null if nothing_gains(contest) else min(contest.singles, key=lambda e: e.loss)
    others = (*contest.singles, *contest.pairs, *contest.structured)
    if entry is not contest.null and any(e.loss < (1.0 - LONE_GAIN) * entry.loss for e in others):
        return decision
    car = model if entry.fit is None else entry.fit.candidate.model(entry.fit.x)
    logs = [log for part in (fit_to, holdout) for log in part.each()]
    if any(floors(car, car, log) > MOST_FLOORS for log in logs):
        return decision
    found = _wandering(entry, car, fit_to, holdout)
    if found is None:
        return decision
    wandering, *calm = found
    said = decide(contest, *calm)
    expected = said.verdict is Verdict.NO_GAP if entry is contest.null else said.winner is entry
    return (
        replace(said, wandering=wandering) if expected and said.verdict is not Verdict.UNKNOWN else decision
    )


def _wandering(
    entry: Entry, model: Simulation, fit_to: Evidence, holdout: Evidence
) -> tuple[tuple[str, ...], Evidence, Evidence] | None:
    """Which sensors wander, and both parts of the evidence with that in their noise; None where it is too much.

    How much is what brings the variances of the signals' blocks nearest to those seen, a sum over sensors and times.
    """
    parts = (fit_to, holdout)
    units = [(channel, tau) for channel in SENSORS.values() for tau in DRIFT_S]
    makes = {
        (i, k): np.array([slow_part(model, d, n, *unit) for unit in units])
        for i, part in enumerate(parts)
        for k, (d, n) in enumerate(zip(part.drives, part.noises, strict=True))
    }
    lengths = np.array([len(parts[i].drives[k]) for i, k in makes], dtype=np.float64)
    mean = np.average(np.array(list(makes.values())), axis=0, weights=lengths)
    slow = np.average([parts[i].noises[k].slow for i, k in makes], axis=0, weights=lengths)
    seen = block_squares(entry, fit_to, holdout)
    of = list(GROUPS.values())
    excess = np.maximum([np.mean(seen[at] - 1.0 - slow[at]) for at in of], 0.0)
    weight = np.array([1.0 / max(float(np.mean(seen[at])), 1.0) for at in of])
    design = np.array([[np.mean(row[at]) for row in mean] for at in of])
    squares, _ = nnls(design * weight[:, None], excess * weight)
    by_sensor = squares.reshape(len(SENSORS), -1).sum(axis=1)
    if by_sensor.max() > MOST**2 or not by_sensor.any():
        return None
    fit_noises, hold_noises = (
        tuple(replace(n, slow=n.slow + squares @ makes[i, k]) for k, n in enumerate(part.noises))
        for i, part in enumerate(parts)
    )
    names = tuple(name for name, square in zip(SENSORS, by_sensor, strict=True) if square > 0.0)
    return names, replace(fit_to, noises=fit_noises), replace(holdout, noises=hold_noises)
