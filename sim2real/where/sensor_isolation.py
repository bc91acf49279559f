"""A sensor that stands alone: without its signal the model foretells all the others.

The observer follows the log once more without one channel. Where what it leaves of the other channels is noise, while
with that channel it was not, the fault lies in its sensor, whatever its shape; Frank's bank of dedicated observers.

References
----------
.. [1] Frank (1990), Automatica 26, 459-474, doi:10.1016/0005-1098(90)90018-D.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.hypotheses.contest import as_it_is
from sim2real.hypotheses.goodness import fitness
from sim2real.observing.drive import SPEED, WHEEL
from sim2real.observing.evidence import SETTLING_S, Evidence
from sim2real.observing.observer import Simulation
from sim2real.where.equations import EQUATIONS, Equation

Array = NDArray[np.float64]

CLEARED = 1.4
"""Up to this misfit what is left of the other channels is noise [-]."""


def lone_sensor(model: Simulation, fit_to: Evidence, holdout: Evidence) -> Equation | None:
    """The equation of the one sensor without which all other signals agree; None if there is none.

    Nor where all together are no more than noise: then leaving one out tells nothing.
    """
    if _misfit(model, fit_to, holdout) <= CLEARED:
        return None
    candidates = [e for e in EQUATIONS if e.channel is not None]
    left = [_misfit_without(e.channel, model, fit_to, holdout) for e in candidates if e.channel is not None]
    best = int(np.argmin(left))
    return candidates[best] if left[best] <= CLEARED else None


def _misfit(model: Simulation, fit_to: Evidence, holdout: Evidence) -> float:
    return fitness(as_it_is(model, fit_to, holdout), fit_to, holdout).misfit


def _misfit_without(channel: int, model: Simulation, fit_to: Evidence, holdout: Evidence) -> float:
    return _misfit(model, _without(channel, model, fit_to), _without(channel, model, holdout))


def _without(channel: int, model: Simulation, evidence: Evidence) -> Evidence:
    drives = []
    for drive in evidence.drives:
        measured, counted = drive.measured.copy(), drive.counted.copy()
        # The observer needs a state to start from; these first rows do not count.
        begun = drive.time_s < drive.time_s[0] + SETTLING_S
        if channel == SPEED:
            measured[begun, SPEED] = model.vehicle.wheel_radius_m * measured[begun, WHEEL].mean(axis=1)
        measured[~begun, channel] = np.nan
        counted[channel] = False
        drives.append(replace(drive, measured=measured, counted=counted))
    return replace(evidence, drives=tuple(drives))
