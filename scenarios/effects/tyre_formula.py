"""A tyre by another formula."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreFormula(Effect):
    """A magic-formula curve with the same initial slope and peak as the simulation's tyre on every road and load.

    Structural, like `tyre_shape`, which deforms the curve of the simulation instead of replacing it.
    """

    id = "tyre_formula"
    stage = "dynamics"
    subsystem = "tyre"
    structural = True
    equation = (
        "F_x = (1 - share) F_Dugoff + share D sin(C arctan(u - E (u - arctan u))), u = slope lambda / (C D), "
        "D the modified Dugoff tyre's greatest force, C shape, E curvature"
    )
    source = "Pacejka (2012), Tyre and Vehicle Dynamics, Eq. (4.49)"
    excited_by = "slip near and beyond the maximum of the force"
    confounders = ("friction_falloff", "friction_offset", "tyre_stiffness_offset")

    share: float = parameter(
        "-",
        "0 is the curve of the simulation, 1 that of the formula",
        neutral=0.0,
        low=0.0,
        high=1.3,
        starts=(1.0,),
    )
    shape: float = parameter(
        "-",
        "shape factor C: a larger one gives less force in sliding",
        neutral=1.4,
        low=1.0,
        high=2.0,
        starts=(1.15, 1.6),
    )
    curvature: float = parameter(
        "-",
        "curvature factor E: a larger one moves the maximum to more slip",
        neutral=0.0,
        low=-6.0,
        high=0.95,
        starts=(-1.0, 0.4),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """All tyres have the other curve."""
        return parameters._replace(
            formula_share=self.share, formula_shape=self.shape, formula_curvature=self.curvature
        )
