"""Different friction left and right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import RoadTable
from trpac_core.vehicle import Vehicle

LEAST_SPLIT = 0.01
"""Difference of the factors from which on left and right differ [-]."""


@dataclass(frozen=True)
class MuSplit(Effect):
    """The friction under the left and under the right wheels differs from the road file by one factor each.

    The car still drives straight.
    """

    id = "mu_split"
    stage = "road"
    subsystem = "road"
    equation = "theta_left = left_factor theta, theta_right = right_factor theta"
    source = "definition; manoeuvre as in ISO 14512"
    excited_by = "driving or braking near the friction limit: more slip at the left or at the right wheels"
    confounders = ("friction_offset", "friction_falloff")

    left_factor: float = parameter(
        "-",
        "true friction on the left over that of the road file",
        neutral=1.0,
        low=0.05,
        high=3.0,
        starts=(0.6, 1.0, 1.4),
    )
    right_factor: float = parameter(
        "-",
        "true friction on the right over that of the road file",
        neutral=1.0,
        low=0.05,
        high=3.0,
        starts=(0.6, 1.0, 1.4),
    )

    def is_itself(self, vehicle: Vehicle) -> bool:
        """Equal factors are no split."""
        return abs(self.left_factor - self.right_factor) >= LEAST_SPLIT

    def road(self, table: RoadTable) -> RoadTable:
        """The friction on the left and on the right is scaled."""
        return table._replace(theta=table.theta * np.array([self.left_factor, self.right_factor]))
