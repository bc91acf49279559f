"""Longitudinal stiffness of the tyres."""

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
class TyreStiffnessOffset(Effect):
    """The longitudinal stiffness of all tyres differs from the vehicle file."""

    id = "tyre_stiffness_offset"
    form = "all wheels alike"
    stage = "dynamics"
    subsystem = "tyre"
    equation = "F_x(lambda) with the true C_x"
    source = "Bian et al. (2014), SAE 2014-01-0123"
    excited_by = "strong torque below the friction limit: slip over force"
    confounders = ("friction_offset", "wheel_radius_offset", "vehicle_speed_scale", "load_transfer")

    stiffness_n: float = parameter(
        "N",
        "true longitudinal stiffness C_x of one tyre",
        neutral=lambda car: car.longitudinal_stiffness_n,
        low=lambda car: 0.1 * car.longitudinal_stiffness_n,
        high=lambda car: 6.0 * car.longitudinal_stiffness_n,
        starts=lambda car: tuple(s * car.longitudinal_stiffness_n for s in (0.5, 0.8, 1.3, 2.0)),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The true stiffnesses take the nominal ones' place."""
        return parameters._replace(longitudinal_stiffness_n=self.per_wheel(self.stiffness_n))


@dataclass(frozen=True)
class TyreStiffnessOffsetOfAxles(TyreStiffnessOffset):
    """The tyres of the two axles differ; `stiffness_n` is the mean."""

    form = "axles unlike"
    equation = "C_x (1 + unlike) in front, C_x (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.1, most=0.5)


@dataclass(frozen=True)
class TyreStiffnessOffsetOfWheels(TyreStiffnessOffsetOfAxles):
    """Each tyre has its own stiffness; `stiffness_n` is the mean."""

    form = "each wheel its own"
    of_wheels = True
    equation = (
        "C_x (1 + unlike +- front_sides) in front, C_x (1 - unlike +- rear_sides) in the rear, + on the left"
    )

    front_sides: float = share_of_sides("front", start=0.1, most=0.4)
    rear_sides: float = share_of_sides("rear", start=0.1, most=0.4)

    def is_itself(self, vehicle: Vehicle) -> bool:
        """Whether all tyres are of another stiffness."""
        return all_are_off(self.per_wheel(self.stiffness_n), vehicle.longitudinal_stiffness_n)


@dataclass(frozen=True)
class TyreStiffnessOffsetWithLoad(TyreStiffnessOffset):
    """The stiffness grows with the wheel load; `stiffness_n` is that at the mean load."""

    form = "with load"
    equation = "C_x (1 + by_load (F_z / F_z0 - 1)), F_z0 = m g / 4"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 4, slip stiffness over load"

    by_load: float = parameter(
        "-",
        "share of the stiffness that grows with load; 1 is proportional",
        neutral=0.0,
        low=-0.5,
        high=1.5,
        starts=(-0.2, 0.3, 1.0),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Each wheel has the stiffness that its load gives."""
        return super().dynamics(parameters)._replace(stiffness_by_load=self.by_load)
