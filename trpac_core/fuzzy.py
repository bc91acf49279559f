"""Fuzzy sets of Table 2 of Tian et al. 2022.

A cell of Table 2 names the threshold first and K_v second; the threshold's letter follows the row (theta_img) alone
and K_v's the column (the difference) alone. With memberships that add up to 1, product inference and one value
per output set, the table therefore falls apart into two interpolations, which is what is computed here.
"""

from __future__ import annotations

from dataclasses import dataclass

K_V_LIMIT = 3.0
"""Upper end of K_v's domain [-] (section 4.2)."""


@dataclass(frozen=True)
class Partition:
    """Three fuzzy sets S, M, B that add up to 1: trapezoids given by where each is full.

    S is full up to `small`, M at `medium`, B from `big` on; between them membership goes over linearly.
    """

    small: float
    medium: float
    big: float

    def __post_init__(self) -> None:
        """Refuse sets that do not ascend; raises ValueError."""
        if not self.small < self.medium < self.big:
            raise ValueError(
                f"Fuzzy sets lie at {self.small:g}, {self.medium:g}, {self.big:g}; expected S below M below B."
            )

    def memberships(self, value: float) -> tuple[float, float, float]:
        """Degrees of S, M and B, which add up to 1 [-]."""
        if value <= self.small:
            return 1.0, 0.0, 0.0
        if value >= self.big:
            return 0.0, 0.0, 1.0
        if value <= self.medium:
            share = (value - self.small) / (self.medium - self.small)
            return 1.0 - share, share, 0.0
        share = (value - self.medium) / (self.big - self.medium)
        return 0.0, 1.0 - share, share

    def blend(self, value: float, outputs: tuple[float, float, float]) -> float:
        """Centre of gravity of three output values under the memberships."""
        small, medium, big = self.memberships(value)
        of_small, of_medium, of_big = outputs
        return small * of_small + medium * of_medium + big * of_big
