"""A tyre by another formula."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreFormula(Effect):
    """A curve by the magic formula, of the same initial slope and peak as the simulation's on every road and load.

    It is structural, as `tyre_shape` is: that one bends the simulation's curve, this one is a curve of its own, which
    on slippery roads no bending by one and the same factor comes near to.
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
    excited_by = "slip near and beyond the force's maximum"
    confounders = ("friction_falloff", "friction_offset", "tyre_stiffness_offset")

    share: float = parameter(
        "-",
        "how far the curve is from the simulation's to the formula's",
        neutral=0.0,
        low=0.0,
        high=1.3,
        starts=(1.0,),
    )
    shape: float = parameter(
        "-",
        "shape factor C: the greater, the lower the force where the tyre slides",
        neutral=1.4,
        low=1.0,
        high=2.0,
        starts=(1.15, 1.6),
    )
    curvature: float = parameter(
        "-",
        "curvature factor E: the greater, the later the maximum",
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
