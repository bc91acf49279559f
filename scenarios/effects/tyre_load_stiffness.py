"""Stiffness of the tyres over their load."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreLoadStiffness(Effect):
    """The longitudinal stiffness of a tyre is proportional to a power of its load.

    The vehicle file has the stiffness at F_z0, the mean static load of its four wheels. Real tyres and magic formulas
    have exponents of 0.8 to 1. Structural, like `tyre_shape`: the nominal plant has no such dependence.
    """

    id = "tyre_load_stiffness"
    stage = "dynamics"
    subsystem = "tyre"
    structural = True
    equation = "C_x (F_z / F_z0)^exponent, F_z0 = m g / 4 without payload"
    source = "Pacejka (2012), Tyre and Vehicle Dynamics, Eq. (4.E15), slip stiffness over load"
    excited_by = "strong torque below the friction limit, with load transfer or a payload"
    confounders = ("tyre_stiffness_offset", "mass_offset", "torque_gain", "load_transfer")

    exponent: float = parameter(
        "-",
        "exponent of the load; 1 is proportional",
        neutral=0.0,
        low=0.0,
        high=1.5,
        starts=(0.4, 0.9),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Each wheel has the stiffness that its load gives."""
        return parameters._replace(stiffness_exponent=self.exponent)
