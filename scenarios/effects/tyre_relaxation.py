"""Relaxation of the tyre force."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter, share_of_axles, share_of_sides
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreRelaxation(Effect):
    """The tyre force follows the slip with a lag over the distance rolled."""

    id = "tyre_relaxation"
    form = "the force lags"
    stage = "dynamics"
    subsystem = "tyre"
    equation = "F_x' = (V / length) (F_steady - F_x), V = max(omega R, v, 0.01 m/s)"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 7, single-point contact patch model"
    excited_by = "steps of torque at low speed: the time lag is length / v"
    confounders = ("torque_lag", "torque_delay", "wheel_speed_delay", "driveline_compliance")

    length_m: float = parameter(
        "m",
        "distance rolled to 63 % of the force after a step of slip",
        neutral=0.0,
        low=0.0,
        high=3.0,
        starts=(0.1, 0.3, 0.8),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The force becomes a state."""
        return parameters._replace(relaxation_m=self.per_wheel(self.length_m))


@dataclass(frozen=True)
class TyreRelaxationOfSlip(TyreRelaxation):
    """The slip lags instead of the force: the same at small slip, a shorter lag in sliding."""

    form = "the slip lags"
    equation = "s' = (V / length) (slip - s), F_x = F_steady(s), V = max(omega R, v, 0.01 m/s)"

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The lagging slip becomes a state."""
        return super().dynamics(parameters)._replace(slip_lags=1.0)


@dataclass(frozen=True)
class TyreRelaxationWithLoad(TyreRelaxationOfSlip):
    """The relaxation length is proportional to the load; `length_m` is that at the mean load."""

    form = "longer with load"
    equation = "s' = V F_z0 / (length F_z) (slip - s), F_x = F_steady(s), F_z0 = m g / 4"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 7, relaxation length and contact length"

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The slip of wheels with more load lags more."""
        return super().dynamics(parameters)._replace(relaxation_by_load=1.0)


@dataclass(frozen=True)
class TyreRelaxationWhileItAdheres(TyreRelaxationOfSlip):
    """The relaxation length falls with the slope of the force over slip."""

    form = "shorter as the tyre slides"
    equation = "s' = V / max(length F'(s) / F'(0), 0.1 length) (slip - s), F_x = F(s), F the steady force"
    source = "Pacejka (2012), Tire and Vehicle Dynamics, ch. 7, relaxation length of a tyre at finite slip"

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The lag shrinks with the slope of the force at the lagging slip."""
        return super().dynamics(parameters)._replace(relaxation_by_slope=1.0)


@dataclass(frozen=True)
class TyreRelaxationOfAxles(TyreRelaxationOfSlip):
    """The tyres of the two axles differ; `length_m` is the mean."""

    form = "axles unlike"
    equation = "s' = V / L (slip - s), F_x = F_steady(s), L = length (1 +- unlike), + in front"

    unlike: float = share_of_axles(start=0.15, most=0.5)


@dataclass(frozen=True)
class TyreRelaxationOfWheels(TyreRelaxationOfAxles):
    """Each tyre has its own length; `length_m` is the mean."""

    form = "each wheel its own"
    of_wheels = True
    equation = (
        "s' = V / L (slip - s), F_x = F_steady(s), L = length (1 + unlike +- front_sides) in front, "
        "length (1 - unlike +- rear_sides) in the rear, + on the left"
    )

    front_sides: float = share_of_sides("front", start=0.15, most=0.4)
    rear_sides: float = share_of_sides("rear", start=0.15, most=0.4)
