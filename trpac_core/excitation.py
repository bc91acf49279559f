"""Fuzzy scheduling of the excitation threshold and of the visual gain K_v, Table 2 of Tian et al. 2022.

A cell of Table 2 names the threshold first and K_v second; the threshold's letter follows the row (theta_img) alone
and K_v's the column (the difference) alone. With memberships that add up to 1, product inference and one value
per output set, the table therefore falls apart into two interpolations, which is what is computed here.
"""

from __future__ import annotations

from dataclasses import dataclass

from .tyre import onset_adhering

THRESHOLD_LIMIT = 0.06
"""Upper end of the threshold's domain [-] (section 4.2)."""
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


@dataclass(frozen=True)
class FuzzyScheduler:
    """Where the fuzzy sets lie. The paper gives their domains and the table, not their place.

    theta_img's sets are full at the class values 0.2, 0.6 and 0.8. A threshold set lies at the slip from which the
    tyre at hand shows a road that is `class_scatter` more slippery than its class says, so that such a
    road too is seen. Without a picture the road may be of any class and the S set's threshold stands. No
    threshold lies below `noise_factor` standard deviations of the slip. K_v's S set reaches over the
    class value's own scatter, or that would pull the settled estimate away from the tyre's.
    """

    theta_sets: Partition = Partition(0.2, 0.6, 0.8)
    difference_sets: Partition = Partition(0.15, 0.35, 0.6)
    K_v_values: tuple[float, float, float] = (0.0, 1.5, 3.0)
    class_scatter: float = 0.1
    onset_sensitivity: float = 0.1
    noise_factor: float = 3.0

    def threshold(
        self, theta_img: float | None, load_n: float, longitudinal_stiffness_n: float, slip_deviation: float
    ) -> float:
        """Slip above which the estimator runs [-].

        Parameters
        ----------
        theta_img : float or None
            Adhesion of the class that the camera gives the road; None where it gives none [-].
        load_n, longitudinal_stiffness_n : float
            Vertical load and longitudinal stiffness of the tyre at hand [N].
        slip_deviation : float
            Standard deviation of the slip through sensor noise [-].
        """
        ratio = self._onset(theta_img) * load_n / longitudinal_stiffness_n
        slip, noise = ratio / (1.0 + ratio), self.noise_factor * slip_deviation
        return min(max(slip, noise), THRESHOLD_LIMIT)

    def _onset(self, theta_img: float | None) -> float:
        """X / F_z from which a road of that class is identifiable [-]."""
        sets = self.theta_sets
        visible = (
            sets.small - self.class_scatter,
            sets.medium - self.class_scatter,
            sets.big - self.class_scatter,
        )
        most_slippery, _, _ = visible
        theta = most_slippery if theta_img is None else sets.blend(theta_img, visible)
        return onset_adhering(theta, self.onset_sensitivity)

    def K_v(self, difference: float) -> float:
        """Visual gain for a difference abs(theta_img - theta_hat) [-]."""
        return self.difference_sets.blend(difference, self.K_v_values)
