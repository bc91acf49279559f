"""Payload."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class MassOffset(Effect):
    """The mass differs from the vehicle file; the centre of gravity does not move."""

    id = "mass_offset"
    form = "in the middle"
    stage = "dynamics"
    subsystem = "vehicle"
    equation = "(m + m_payload) v' = sum F; loads with m + m_payload"
    source = "Newton's second law"
    excited_by = "changes of torque: acceleration over force"
    confounders = ("torque_gain", "aero_drag", "road_grade", "wheel_radius_offset")

    mass_kg: float = parameter(
        "kg",
        "payload in addition to the mass of the vehicle file",
        neutral=0.0,
        low=lambda car: -0.3 * car.mass_kg,
        high=lambda car: 1.0 * car.mass_kg,
        starts=lambda car: (-0.1 * car.mass_kg, 0.1 * car.mass_kg, 0.25 * car.mass_kg),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The payload adds to the vehicle's mass."""
        return parameters._replace(mass_kg=parameters.mass_kg + self.mass_kg)


@dataclass(frozen=True)
class MassOffsetPlaced(MassOffset):
    """The payload moves the centre of gravity along the car."""

    form = "where it lies"
    equation = "the same; the centre of gravity moves back by behind m_payload / (m + m_payload)"
    source = "Statics: the moments of the weights about an axle"

    behind_m: float = parameter(
        "m",
        "distance of the payload behind the centre of gravity",
        neutral=0.0,
        low=lambda car: -1.2 * car.cog_to_front_axle_m,
        high=lambda car: 1.2 * car.cog_to_rear_axle_m,
        starts=lambda car: (-0.6 * car.cog_to_front_axle_m, 0.6 * car.cog_to_rear_axle_m),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The payload adds to the mass and moves its centre."""
        back_m = self.behind_m * self.mass_kg / (parameters.mass_kg + self.mass_kg)
        return parameters._replace(
            mass_kg=parameters.mass_kg + self.mass_kg,
            cog_to_front_axle_m=parameters.cog_to_front_axle_m + back_m,
            cog_to_rear_axle_m=parameters.cog_to_rear_axle_m - back_m,
        )
