"""Rolling resistance."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter, share_of_axles
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class RollingResistance(Effect):
    """A torque proportional to the wheel load opposes the rotation; a wheel at standstill stays at standstill."""

    id = "rolling_resistance"
    form = "moment at the wheels"
    stage = "dynamics"
    subsystem = "wheel"
    equation = "I omega' = T - F_x R - c F_z R"
    source = "Gillespie (1992), Fundamentals of Vehicle Dynamics, ch. 4; ISO 28580 defines the coefficient"
    excited_by = "coasting at low speed"
    confounders = ("brake_drag", "road_grade", "torque_gain")

    coefficient: float = parameter(
        "-",
        "resisting force over vertical load",
        neutral=0.0,
        low=0.0,
        high=0.3,
        starts=(0.008, 0.02, 0.05),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The moment is proportional to each wheel's own load."""
        return parameters._replace(rolling_coefficient=self.per_wheel(self.coefficient))


@dataclass(frozen=True)
class RollingResistanceForce(RollingResistance):
    """The same as a force on the body; the wheels' torque balance does not contain it."""

    form = "force on the body"
    equation = "m v' = sum F_x - c sum F_z"

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The force is proportional to all wheels' load; it holds a standing car."""
        return parameters._replace(hub_resistance=self.coefficient)


@dataclass(frozen=True)
class RollingResistanceOfAxles(RollingResistance):
    """The tyres of the two axles differ; `coefficient` is the mean."""

    form = "axles unlike"
    equation = "c (1 + unlike) in front, c (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.3, most=1.0)
