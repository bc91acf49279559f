"""Dragging brakes."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter, share_of_axles
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class BrakeDrag(Effect):
    """A constant torque opposes the rotation of every wheel; a wheel at standstill stays at standstill."""

    id = "brake_drag"
    form = "all wheels alike"
    stage = "dynamics"
    subsystem = "wheel"
    equation = "I omega' = T - F_x R - T_drag"
    source = "Eq. (12) of Tian et al. 2022, doi:10.3390/rs14215583, with a further torque"
    excited_by = "coasting at any speed"
    confounders = ("rolling_resistance", "road_grade", "aero_drag", "torque_gain")

    torque_nm: float = parameter(
        "N m",
        "resisting torque at each wheel",
        neutral=0.0,
        low=0.0,
        high=500.0,
        starts=(5.0, 20.0, 60.0),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The drag torques are independent of load."""
        return parameters._replace(drag_torque_nm=self.per_wheel(self.torque_nm))


@dataclass(frozen=True)
class BrakeDragOfAxles(BrakeDrag):
    """The brakes of one axle drag more; `torque_nm` is the mean of all wheels."""

    form = "axles unlike"
    equation = "T_drag (1 + unlike) in front, T_drag (1 - unlike) in the rear"

    unlike: float = share_of_axles(start=0.5, most=1.0)
