"""Rolling radius."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import (
    Effect,
    all_are_off,
    parameter,
    share_of_axles,
    share_of_sides,
)
from scenarios.plant.parameters import DynamicsParameters
from trpac_core.vehicle import Vehicle


@dataclass(frozen=True)
class WheelRadiusOffset(Effect):
    """The rolling radius of all wheels differs from the vehicle file, by wear, pressure or other tyres."""

    id = "wheel_radius_offset"
    form = "all wheels alike"
    stage = "dynamics"
    subsystem = "wheel"
    equation = "rim speed omega R and moment F_x R with the true R"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 1, effective rolling radius"
    excited_by = "free rolling: v over omega at zero torque"
    confounders = ("vehicle_speed_scale", "tyre_stiffness_offset", "mass_offset", "torque_gain")

    radius_m: float = parameter(
        "m",
        "true rolling radius",
        neutral=lambda car: car.wheel_radius_m,
        low=lambda car: 0.7 * car.wheel_radius_m,
        high=lambda car: 1.3 * car.wheel_radius_m,
        starts=lambda car: tuple(s * car.wheel_radius_m for s in (0.95, 0.985, 1.015, 1.05)),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The true radii take the nominal ones' place, in rolling and as levers."""
        return parameters._replace(
            wheel_radius_m=self.per_wheel(self.radius_m), lever_m=self.per_wheel(self.radius_m)
        )


@dataclass(frozen=True)
class WheelRadiusOffsetRolling(WheelRadiusOffset):
    """The rolling radius differs, the lever arm of the force does not."""

    form = "rolling alone"
    equation = "rim speed omega R with the true R, moment F_x R with the nominal one"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 1, effective rolling radius and loaded radius"

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The levers stay what they were."""
        return parameters._replace(wheel_radius_m=self.per_wheel(self.radius_m))


@dataclass(frozen=True)
class WheelRadiusOffsetOfAxles(WheelRadiusOffset):
    """The tyres of the two axles differ in wear or pressure; `radius_m` is the mean."""

    form = "axles unlike"
    equation = "R (1 + unlike) in front, R (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.003, most=0.05)


@dataclass(frozen=True)
class WheelRadiusOffsetOfWheels(WheelRadiusOffsetOfAxles):
    """Each tyre has its own radius; `radius_m` is the mean."""

    form = "each wheel its own"
    of_wheels = True
    equation = (
        "R (1 + unlike +- front_sides) in front, R (1 - unlike +- rear_sides) in the rear, + on the left"
    )

    front_sides: float = share_of_sides("front", start=0.003, most=0.05)
    rear_sides: float = share_of_sides("rear", start=0.003, most=0.05)

    def is_itself(self, vehicle: Vehicle) -> bool:
        """Whether all wheels are of another size."""
        return all_are_off(self.per_wheel(self.radius_m), vehicle.wheel_radius_m)
