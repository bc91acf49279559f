"""What is slow in a way that no effect of the library is, and passes for one that is.

A speed sensor behind a low-pass filter is taken for a late one: both lag by their time constant where the speed changes
evenly, but where the acceleration itself jumps, a delay shifts the corner and a filter rounds it off. A torque whose
rate is limited is taken for one that lags or comes late: both do in steps, but its lag grows with the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from scenarios.effects import Effect
from scenarios.effects.base import Array, Signals, parameter
from scenarios.effects.torque_lag import TorqueLag
from scenarios.effects.vehicle_speed_delay import VehicleSpeedDelay
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.result import Unexplained
from sim2real.which.contest import Contest, Entry, enter
from sim2real.which.fitting import FULL_STEPS, OutsideCandidate


@dataclass(frozen=True)
class SlowSpeed(VehicleSpeedDelay):
    """A ground speed behind a first-order low-pass filter with this time constant."""

    form = "low-pass filter"
    equation = "delay v_read' = v - v_read, exact for a speed linear between the rows"

    def in_words(self, share: float) -> Unexplained:
        """The filter's answer to a step, and what of the misfit it takes."""
        since_s = np.linspace(0.0, 5.0, 41) * self.delay_s
        sentence = (
            f"The vehicle speed reads as behind a low-pass filter of {self.delay_s:.3g} s, which rounds corners off "
            f"where a delay shifts them. Such a filter takes {100.0 * share:.0f} % of the misfit: look at the "
            "vehicle speed sensor."
        )
        return Unexplained(
            "vehicle_speed_sensor",
            "vehicle_speed",
            "time since a step",
            "-",
            "is negative throughout",
            "decays with its time constant",
            share,
            since_s,
            -np.exp(-since_s / max(self.delay_s, 1e-9)),
            sentence,
        )

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """The filter; back again, a shift by its time constant serves the observer, and does not lift the noise."""
        slow = TorqueLag(self.delay_s).actuate(time_s, signals["vehicle_speed_m_s"])
        return {**signals, "vehicle_speed_m_s": slow}


@dataclass(frozen=True)
class LimitedTorqueRate(Effect):
    """A torque that follows its command at no more than a rate."""

    id = "torque_lag"
    form = "limited rate"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "|T_true'| <= 1 kN m / s_per_kn_m"
    source = "definition"
    excited_by = "steps of torque, large ones more"
    confounders = ("torque_lag", "torque_delay")

    s_per_kn_m: float = parameter(
        "s/(kN m)",
        "time that a kilonewton metre takes",
        neutral=0.0,
        low=0.0,
        high=20.0,
        starts=(0.05, 0.2),
    )

    def in_words(self, share: float) -> Unexplained:
        """What the limit takes off the command's rate, and what of the misfit it takes."""
        most_nm_s = 1000.0 / max(self.s_per_kn_m, 1e-9)
        rate_nm_s = np.linspace(-2.0, 2.0, 41) * most_nm_s
        sentence = (
            f"The torque follows its command at no more than {most_nm_s:.3g} N m/s: large steps lag more than small "
            f"ones. Such a limit takes {100.0 * share:.0f} % of the misfit: look at the powertrain."
        )
        return Unexplained(
            "powertrain",
            "wheel_torque",
            "rate of the torque",
            "N m/s",
            "opposes it",
            "is none up to a limit and all that is beyond it",
            share,
            rate_nm_s,
            np.clip(rate_nm_s, -most_nm_s, most_nm_s) - rate_nm_s,
            sentence,
        )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Row by row, as far as the rate allows."""
        if self.s_per_kn_m == 0.0 or len(time_s) < 2:
            return torque_nm
        step_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
        most_nm = 1000.0 * step_s / self.s_per_kn_m
        return np.asarray(_limited(np.ascontiguousarray(torque_nm, dtype=np.float64), most_nm))


@njit(cache=True)
def _limited(torque_nm: Array, most_nm: float) -> Array:
    """Each wheel's torque, changed by no more than `most_nm` from row to row."""
    limited = torque_nm.copy()
    for i in range(1, len(torque_nm)):
        for wheel in range(torque_nm.shape[1]):
            change = torque_nm[i, wheel] - limited[i - 1, wheel]
            limited[i, wheel] = limited[i - 1, wheel] + min(max(change, -most_nm), most_nm)
    return limited


PASSES_FOR: dict[str, type[SlowSpeed | LimitedTorqueRate]] = {
    "vehicle_speed_delay": SlowSpeed,
    "torque_lag": LimitedTorqueRate,
    "torque_delay": LimitedTorqueRate,
}
"""Effects of the library, and what is taken for them."""


SHARES = (0.95, 0.85, 0.7, 0.5, 0.3, 0.15)
"""Limits of the torque's rate that are tried first, as shares of the fastest command's [-]."""


def impostor(contest: Contest, model: Simulation, fit_to: Evidence, holdout: Evidence) -> Entry | None:
    """What passes for the best effect, fitted in its place; None where nothing known does."""
    best = contest.singles[0]
    if best.ids[0] not in PASSES_FOR:
        return None
    slow = PASSES_FOR[best.ids[0]] is SlowSpeed
    starts = np.atleast_2d(best.fitted.x) if slow else _limits(fit_to)
    return enter(
        OutsideCandidate(model, best.ids, kind=PASSES_FOR[best.ids[0]]), fit_to, holdout, starts, FULL_STEPS
    )


def characterise(contest: Contest) -> Unexplained | None:
    """The impostor in the form of a result, where nothing else explains the gap as well."""
    entry = contest.impostor
    if entry is None or entry.loss > min(contest.lone, contest.singles[0].loss):
        return None
    (effect,) = entry.fitted.candidate.effects(entry.fitted.x)
    assert isinstance(effect, SlowSpeed | LimitedTorqueRate)
    return effect.in_words(1.0 - entry.loss / max(contest.null.loss, 1e-12))


def _limits(fit_to: Evidence) -> Array:
    """Limits of the torque's rate to start from, shape (m, 1): one above the fastest command has no slope."""
    fastest = max(float(np.abs(np.diff(d.torque_nm, axis=0)).max()) / d.step_s for d in fit_to.drives)
    return 1000.0 / (np.array(SHARES)[:, None] * max(fastest, 1.0))
