"""Gain of the torque."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Array, Effect, parameter


@dataclass(frozen=True)
class TorqueGain(Effect):
    """Motors and brakes make more or less torque than commanded, always by the same factor."""

    id = "torque_gain"
    stage = "actuators"
    subsystem = "powertrain"
    equation = "T_true = factor T"
    source = "definition"
    excited_by = "strong torque in both directions"
    look_alikes = ("mass_offset", "wheel_radius_offset", "brake_drag", "rolling_resistance")

    factor: float = parameter(
        "-",
        "true torque per command",
        neutral=1.0,
        low=0.2,
        high=3.0,
        starts=(0.75, 0.92, 1.08, 1.25),
    )

    def actuate(self, time_s: Array, torque_nm: Array) -> Array:
        """All torque is scaled."""
        return torque_nm * self.factor
