"""A tyre curve of another shape."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class TyreShape(Effect):
    """A smooth deviation of the curve of force over slip, with the same initial slope.

    It is structural: a difference between tyre models that a diagnosis never names as a cause.
    """

    id = "tyre_shape"
    stage = "dynamics"
    subsystem = "tyre"
    structural = True
    equation = (
        "F_x times 1 + knee b(x / 0.6) + crest b(x / 2.4) + sliding x^2 / (x^2 + 5^2), "
        "x = C_x lambda / (theta F_z), b(u) = 4 u^2 / (1 + u^2)^2"
    )
    source = "own: smooth deviations, as between the formulas in Pacejka (2012), Tyre and Vehicle Dynamics"
    excited_by = "slip near and beyond the maximum of the force"
    confounders = ("friction_falloff", "friction_offset", "tyre_stiffness_offset")

    knee: float = parameter(
        "-",
        "relative deviation of the force where sliding begins",
        neutral=0.0,
        low=-0.35,
        high=0.35,
        starts=(-0.05, 0.05),
    )
    crest: float = parameter(
        "-",
        "relative deviation of the force near its maximum",
        neutral=0.0,
        low=-0.35,
        high=0.35,
        starts=(-0.05, 0.05),
    )
    sliding: float = parameter(
        "-",
        "relative deviation of the force in full sliding",
        neutral=0.0,
        low=-0.35,
        high=0.35,
        starts=(-0.05, 0.05),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """All tyres have the other curve."""
        return parameters._replace(knee=self.knee, crest=self.crest, sliding=self.sliding)
