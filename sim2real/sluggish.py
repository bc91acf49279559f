"""A speed sensor that is slow, not late: a low-pass filter passes for a delay, and is no effect of the library.

Both lag by their time constant where the speed changes evenly. Where the acceleration itself jumps, a delay shifts the
corner and a filter rounds it off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarios.effects import Effect
from scenarios.effects.base import Array, Signals
from scenarios.effects.torque_lag import TorqueLag
from scenarios.effects.vehicle_speed_delay import VehicleSpeedDelay
from sim2real.contest import Contest, enter
from sim2real.evidence import Evidence
from sim2real.fitting import FULL_STEPS, Candidate
from sim2real.observer import Simulation

LATE = "vehicle_speed_delay"
"""The effect that a slow sensor is taken for."""


@dataclass(frozen=True)
class SlowSpeed(VehicleSpeedDelay):
    """A ground speed behind a first-order low-pass filter with this time constant."""

    form = "low-pass filter"
    equation = "delay v_read' = v - v_read, exact for a speed linear between the rows"

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The filter; back again, a shift by its time constant serves the observer, and does not lift the noise."""
        slow = TorqueLag(self.delay_s).actuate(time_s, signals["vehicle_speed_m_s"])
        return {**signals, "vehicle_speed_m_s": slow}


@dataclass(frozen=True)
class SlowCandidate(Candidate):
    """A candidate of `SlowSpeed`, which stands in no library."""

    @cached_property
    def kinds(self) -> tuple[type[Effect], ...]:
        """The one class."""
        return (SlowSpeed,)


def slow_speed(contest: Contest, model: Simulation, fit_to: Evidence, holdout: Evidence) -> float:
    """Loss that a slow speed sensor leaves; infinite where no late one comes first."""
    if not contest.singles or contest.singles[0].ids != (LATE,):
        return float("inf")
    start = np.atleast_1d(contest.singles[0].fitted.x)
    return enter(SlowCandidate(model, (LATE,)), fit_to, holdout, start, FULL_STEPS).loss
