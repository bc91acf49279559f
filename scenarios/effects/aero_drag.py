"""Air drag."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters

AIR_DENSITY_KG_M3 = 1.225
"""Density of air at sea level and 15 degrees Celsius, ISO 2533 standard atmosphere [kg/m^3]."""
AIR_DENSITY_SHARE = 0.025
"""Relative uncertainty of the air density: 1.2 kg/m^3 (dry air, 20 degrees, 1010 hPa) is common, too [-]."""


@dataclass(frozen=True)
class AeroDrag(Effect):
    """Air drag without wind; lift and the pitching moment of the drag are neglected."""

    id = "aero_drag"
    stage = "dynamics"
    subsystem = "vehicle"
    equation = "F_drag = 0.5 rho C_d A v^2"
    source = "Gillespie (1992), Fundamentals of Vehicle Dynamics, ch. 4; rho 1.225 kg/m^3 of ISO 2533"
    excited_by = "coasting or holding a high speed"
    confounders = ("rolling_resistance", "road_grade", "mass_offset")

    drag_area_m2: float = parameter(
        "m^2",
        "drag coefficient times frontal area",
        neutral=0.0,
        low=0.0,
        high=5.0,
        starts=(0.4, 0.8, 2.0),
        open_share=AIR_DENSITY_SHARE,
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Drag grows with the square of speed."""
        return parameters._replace(drag_kg_m=0.5 * AIR_DENSITY_KG_M3 * self.drag_area_m2)
