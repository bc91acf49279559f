"""Payload."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class MassOffset(Effect):
    """The car is heavier or lighter than its file says; its centre of gravity stays where it is."""

    id = "mass_offset"
    form = "in the middle"
    stage = "dynamics"
    subsystem = "vehicle"
    equation = "(m + m_payload) v' = sum F; loads with m + m_payload"
    source = "Newton's second law"
    excited_by = "changes of torque: the acceleration per force"
    confounders = ("torque_gain", "aero_drag", "road_grade", "wheel_radius_offset")

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


@dataclass(frozen=True)
class MassOffsetPlaced(MassOffset):
    """The payload lies somewhere along the car and takes the centre of gravity with it."""

    form = "where it lies"
    equation = "as in the middle; the centre of gravity moves back by behind m_payload / (m + m_payload)"
    source = "Statics: the moments of the weights about an axle"

    behind_m: float = parameter(
        "m",
        "how far behind the car's centre of gravity the payload lies",
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
