"""Longitudinal load transfer."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class LoadTransfer(Effect):
    """Acceleration shifts load from the front to the rear axle without delay (rigid suspension)."""

    id = "load_transfer"
    stage = "dynamics"
    subsystem = "vehicle"
    equation = "F_z,front = m (g l_r - a_x h) / (2 L) per wheel, F_z,rear = m (g l_f + a_x h) / (2 L)"
    source = "Gillespie (1992), Fundamentals of Vehicle Dynamics, ch. 1, dynamic axle loads on level ground"
    excited_by = "strong acceleration or braking near the friction limit"
    confounders = ("friction_offset", "tyre_stiffness_offset")

    cog_height_m: float = parameter(
        "m",
        "height of the centre of gravity",
        neutral=0.0,
        low=0.0,
        high=1.5,
        starts=(0.3, 0.6),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Loads follow the acceleration through the centre of gravity's height."""
        return parameters._replace(transfer_height_m=self.cog_height_m)
