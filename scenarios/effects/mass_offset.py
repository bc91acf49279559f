"""Payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenarios.effects.base import Effect, parameter

if TYPE_CHECKING:
    from scenarios.plant.dynamics import DynamicsParameters


@dataclass(frozen=True)
class MassOffset(Effect):
    """The car is heavier or lighter than its file says; its centre of gravity stays where it is."""

    id = "mass_offset"
    stage = "dynamics"
    subsystem = "vehicle"
    equation = "(m + m_payload) v' = sum F; loads with m + m_payload"
    source = "Newton's second law"
    excited_by = "changes of torque: the acceleration per force"
    look_alikes = ("torque_gain", "aero_drag", "road_grade", "wheel_radius_offset")

    mass_kg: float = parameter(
        "kg",
        "payload, on top of the vehicle's mass",
        neutral=0.0,
        low=lambda car: -0.3 * car.mass_kg,
        high=lambda car: 1.0 * car.mass_kg,
        starts=lambda car: (-0.1 * car.mass_kg, 0.1 * car.mass_kg, 0.25 * car.mass_kg),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The payload adds to the vehicle's mass."""
        return parameters._replace(mass_kg=parameters.mass_kg + self.mass_kg)
