"""Stiffness of the tyres over their load."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreLoadStiffness(Effect):
    """Each tyre's longitudinal stiffness goes with a power of its load; the file's stiffness is that at F_z0.

    F_z0 is the mean static load of the four wheels of the car in the vehicle file. A payload makes the tyres stiffer.
    The exponent of real tyres and of magic formulas is 0.8 to 1.

    It is structural, as `tyre_shape` is: the nominal plant's stiffness does not depend on the load, every other tyre
    model's does.
    """

    id = "tyre_load_stiffness"
    stage = "dynamics"
    subsystem = "tyre"
    structural = True
    equation = "C_x (F_z / F_z0)^exponent, F_z0 = m g / 4 without payload"
    source = "Pacejka (2012), Tyre and Vehicle Dynamics, Eq. (4.E15), slip stiffness over load"
    excited_by = "strong torque below the grip limit, with load transfer or a payload"
    confounders = ("tyre_stiffness_offset", "mass_offset", "torque_gain", "load_transfer")

    exponent: float = parameter(
        "-",
        "power of the load that the stiffness goes with: 1 in proportion",
        neutral=0.0,
        low=0.0,
        high=1.5,
        starts=(0.4, 0.9),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """Each wheel has the stiffness that its load gives."""
        return parameters._replace(stiffness_exponent=self.exponent)
