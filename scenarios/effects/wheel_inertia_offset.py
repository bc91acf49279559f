"""Inertia of the wheels."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter, share_of_axles
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class WheelInertiaOffset(Effect):
    """The inertia of wheel and motor differs from the vehicle file."""

    id = "wheel_inertia_offset"
    form = "all wheels alike"
    stage = "dynamics"
    subsystem = "wheel"
    equation = "I omega' = T - F_x R with the true I"
    source = "Eq. (12) of Tian et al. 2022, doi:10.3390/rs14215583"
    excited_by = "fast changes of wheel speed: spinning and locking wheels on a slippery road"
    confounders = ("mass_offset", "torque_gain", "torque_lag", "driveline_compliance")

    inertia_kg_m2: float = parameter(
        "kg m^2",
        "true inertia of one wheel with its motor",
        neutral=lambda car: car.wheel_inertia_kg_m2,
        low=lambda car: 0.2 * car.wheel_inertia_kg_m2,
        high=lambda car: 5.0 * car.wheel_inertia_kg_m2,
        starts=lambda car: tuple(s * car.wheel_inertia_kg_m2 for s in (0.6, 0.85, 1.2, 2.0)),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The true inertias take the nominal ones' place."""
        return parameters._replace(wheel_inertia_kg_m2=self.per_wheel(self.inertia_kg_m2))


@dataclass(frozen=True)
class WheelInertiaOffsetOfAxles(WheelInertiaOffset):
    """Wheels and motors of the two axles differ; `inertia_kg_m2` is the mean."""

    form = "axles unlike"
    equation = "I (1 + unlike) in front, I (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.2, most=0.5)
