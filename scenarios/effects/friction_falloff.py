"""Friction that falls with sliding speed."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.effects.base import Effect, parameter
from scenarios.plant.parameters import DynamicsParameters


@dataclass(frozen=True)
class FrictionFalloff(Effect):
    """Friction falls exponentially with the sliding speed of the tyre, to a lower limit."""

    id = "friction_falloff"
    form = "exponential"
    stage = "dynamics"
    subsystem = "tyre"
    equation = "theta_eff = theta (floor + (1 - floor) exp(-falloff abs(omega R - v)))"
    source = (
        "Canudas de Wit et al. (2003), Vehicle System Dynamics 39, doi:10.1076/vesd.39.3.189.14152 (Stribeck)"
    )
    excited_by = "spinning or locked wheels at speed"
    confounders = ("friction_offset", "tyre_stiffness_offset", "mu_split")

    falloff_s_m: float = parameter(
        "s/m",
        "rate of the fall over sliding speed",
        neutral=0.0,
        low=0.0,
        high=5.0,
        starts=(0.05, 0.2, 0.8),
    )
    floor: float = parameter(
        "-",
        "share of the friction that is left at high sliding speed",
        neutral=1.0,
        low=0.05,
        high=1.0,
        starts=(0.45, 0.75),
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The friction of each wheel falls with its sliding speed."""
        return parameters._replace(falloff_s_m=self.falloff_s_m, falloff_floor=self.floor)


@dataclass(frozen=True)
class FrictionFalloffHyperbolic(FrictionFalloff):
    """The same initial fall, then slower."""

    form = "hyperbolic"
    equation = "theta_eff = theta (floor + (1 - floor) / (1 + falloff abs(omega R - v)))"
    source = (
        "after Hess and Soom (1990), Journal of Tribology 112, 147-152, whose fall is of the second power"
    )

    def dynamics(self, parameters: DynamicsParameters) -> DynamicsParameters:
        """The same fall by another function of the sliding speed."""
        return super().dynamics(parameters)._replace(falloff_hyperbolic=1.0)
