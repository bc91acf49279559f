"""Grade of the road."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters
from trpac_core.vehicle import GRAVITY_M_S2


@dataclass(frozen=True)
class RoadGrade(Effect):
    """The road has a constant grade; the car never rolls backwards.

    The accelerometer reads v' plus g times the sine of the road angle.
    """

    id = "road_grade"
    stage = "dynamics"
    subsystem = "road"
    equation = "F = -m g s / sqrt(1 + s^2); loads times 1 / sqrt(1 + s^2)"
    source = "Gillespie (1992), Fundamentals of Vehicle Dynamics, ch. 1, loads on grades"
    excited_by = "any driving, best with low torque: speed compared with the accelerometer"
    confounders = ("accelerometer_bias", "rolling_resistance", "mass_offset", "aero_drag")

    grade: float = parameter(
        "-",
        "rise over run, positive uphill",
        neutral=0.0,
        low=-0.3,
        high=0.3,
        starts=(-0.05, -0.015, 0.015, 0.05),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Gravity has a part along the road, and less of it loads the wheels."""
        length = hypot(1.0, self.grade)
        return parameters._replace(
            slope_m_s2=GRAVITY_M_S2 * self.grade / length, gravity_m_s2=GRAVITY_M_S2 / length
        )
