"""Friction of the whole road."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import RoadTable


@dataclass(frozen=True)
class FrictionOffset(Effect):
    """The friction of the whole road differs from the road file by one factor."""

    id = "friction_offset"
    stage = "road"
    subsystem = "road"
    equation = "theta_true = factor theta"
    source = "definition"
    excited_by = "driving or braking near the friction limit"
    confounders = ("mu_split", "tyre_stiffness_offset", "friction_falloff", "load_transfer")

    factor: float = parameter(
        "-",
        "true friction over that of the road file",
        neutral=1.0,
        low=0.1,
        high=3.0,
        starts=(0.6, 0.85, 0.95, 1.05, 1.15, 1.4),
    )

    def road(self, table: RoadTable) -> RoadTable:
        """All of the road's friction is scaled."""
        return table._replace(theta=table.theta * self.factor)
