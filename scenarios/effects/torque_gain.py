"""Gain of the torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.effects.base import Array, Effect, parameter

FRONT_LESS_REAR = np.array([1.0, 1.0, -1.0, -1.0])


@dataclass(frozen=True)
class TorqueGain(Effect):
    """Motors and brakes produce the commanded torque times one factor."""

    id = "torque_gain"
    form = "all wheels alike"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "T_true = factor T"
    source = "definition"
    excited_by = "strong torque in both directions"
    confounders = ("mass_offset", "wheel_radius_offset", "brake_drag", "rolling_resistance")

    factor: float = parameter(
        "-",
        "true torque over command",
        neutral=1.0,
        low=0.2,
        high=3.0,
        starts=(0.75, 0.92, 1.08, 1.25),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """All torque is scaled."""
        return torque_nm * self.factor


@dataclass(frozen=True)
class TorqueGainOfAxles(TorqueGain):
    """The factors of the two axles differ; `factor` is the mean."""

    form = "axles unlike"
    equation = "T_true = (factor + unlike) T in front, (factor - unlike) T in the rear"

    unlike: float = parameter(
        "-",
        "half of the difference, front minus rear",
        neutral=0.0,
        low=-0.5,
        high=0.5,
        starts=(-0.03, 0.03),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Each axle's torque is scaled."""
        return torque_nm * (self.factor + self.unlike * FRONT_LESS_REAR)


@dataclass(frozen=True)
class TorqueGainOfSigns(TorqueGain):
    """The factors in driving and in braking differ; `factor` is the mean."""

    form = "driving and braking unlike"
    equation = "T_true = (factor + apart) T in driving, (factor - apart) T in braking"

    apart: float = parameter(
        "-",
        "half of the difference, driving minus braking",
        neutral=0.0,
        low=-0.5,
        high=0.5,
        starts=(-0.03, 0.03),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """Torque of each sign is scaled."""
        return torque_nm * (self.factor + self.apart * np.sign(torque_nm))
