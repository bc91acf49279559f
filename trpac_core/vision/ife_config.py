"""Settings of the image estimator."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from .camera import Camera
from .evidence import WeightLaw

GROUP_NAMES = ("near", "middle", "far")
SIDES = {"left": (1.0,), "right": (-1.0,), "both": (1.0, -1.0)}
"""Front wheels whose tracks are looked at, as the sign of their lateral position."""


MOST_WAY_M, MOST_WIDTH_M, MOST_PATCHES = 200.0, 40.0, 500
LEAST_GRID_M, LEAST_STEP_M = 0.005, 0.01
MOST_DEVIATION_M, MOST_GROWTH_M_S = 2.0, 0.01
"""Limits beyond which a frame would cost minutes or all memory [m], [m/s]."""
STEEPEST_SIGMOID, FARTHEST_CENTRE = 100.0, 1.0
"""A steeper sigmoid, or one centred beyond what shares can be, gives all classes the same weight, or none any [-]."""


@dataclass(frozen=True)
class IfeConfig:
    """Settings of the estimator; the defaults are Table 3 and section 3 of the paper where it states them.

    Parameters
    ----------
    camera : Camera
        The camera file. Pictures of another size with the same shape scale it.
    track_m, wheelbase_m : float
        Of the vehicle [m].
    side : {'left', 'right', 'both'}
        Front wheels whose tracks are looked at.
    ranges_m : tuple of 3 pairs
        Distances driven by the rear axle over which the near, middle and far group lie; the first starts at the
        preview distance [m].
    a_m : float
        Grid size a [m].
    b : tuple of 3 ints
        Patches per group.
    roi_width_m : float
        Width of road that a group's patches show in the geometric mean [m].
    roi_spread : float
        Factor by which the widest is wider and the narrowest narrower, the others evenly between [-]; 1: all alike.
        Grain shows in narrow patches, gloss and snow beside the tracks in wide ones, where the road is wide enough.
    step_m : float
        Distance between ellipses, and step of the covariance recursion [m].
    k1, k2 : float
        Growth of the track's uncertainty along and across [m/s]; k1 < k2.
    start_deviation_m : float
        Standard deviation of the wheel's place at the start: tyre width and mounting [m].
    weight_law : WeightLaw
        Parameters of the evidence weights.
    flag_threshold : float
        Q_v above which the flag is set [-].
    least_mass : float
        Largest mass m_0 of Eq. (8), before the combination, from which the flag may be set [-]. Patches of one frame
        share light, camera and road: combined as if independent, nearly any of them gives a P_fusion near 1.
    seed : int
        Of the drawing of patches.
    groups_looked_at : int
        How many groups from the near one on have a verdict. The frame's is the near group's, so 1 gives the same in
        less time, bit by bit; the others are for users of the road further ahead.
    use_trajectory, remove_shadow, calibrate, weight_evidence, use_scene, use_foresight, use_lines : bool
        Each False leaves that part of the method out, to measure what it is worth: the whole drivable strip
        ahead in place of the ellipses; shadow kept; T = 1; equal evidence weights in Eq. (8); patches judged
        without the picture around them; no memory of what the lane showed of road that is near now; patches
        that may lie on lines across the road.
    """

    camera: Camera = field(default_factory=Camera)
    track_m: float = 1.356
    wheelbase_m: float = 2.305
    side: Literal["left", "right", "both"] = "both"
    ranges_m: tuple[tuple[float, float], ...] = ((2.5, 4.5), (4.5, 7.5), (7.5, 12.0))
    a_m: float = 0.02
    b: tuple[int, int, int] = (4, 6, 8)
    roi_width_m: float = 1.2
    roi_spread: float = 1.0
    step_m: float = 0.25
    k1: float = 5e-5
    k2: float = 2e-4
    start_deviation_m: float = 0.08
    strip_half_width_m: float = 4.0
    weight_law: WeightLaw = field(default_factory=WeightLaw)
    flag_threshold: float = 0.5
    least_mass: float = 0.8
    seed: int = 0
    groups_looked_at: int = len(GROUP_NAMES)
    use_trajectory: bool = True
    remove_shadow: bool = True
    calibrate: bool = True
    weight_evidence: bool = True
    use_scene: bool = True
    use_foresight: bool = True
    use_lines: bool = True

    def __post_init__(self) -> None:
        """Refuse settings that contradict themselves, all at once; raises ValueError."""
        checks = {
            f"side must be one of {list(SIDES)}, is {self.side!r}": self.side in SIDES,
            "ranges_m and b must have three entries, near, middle and far": len(self.ranges_m)
            == len(self.b)
            == 3,
            "each range must end beyond its start and start at 0 or beyond": all(
                0.0 <= low < high for low, high in self.ranges_m
            ),
            "b must be at least 2 in each group, since one patch alone cannot be fused": min(self.b) >= 2,
            "0 < k1 < k2 must hold, as in section 3.2": 0.0 < self.k1 < self.k2,
            "track, wheelbase, a, patch width, step, start deviation and strip width must be above 0": min(
                self.track_m,
                self.wheelbase_m,
                self.a_m,
                self.roi_width_m,
                self.step_m,
                self.start_deviation_m,
                self.strip_half_width_m,
            )
            > 0.0,
            f"ranges must end within {MOST_WAY_M:g} m, which no camera sees the surface beyond": all(
                high <= MOST_WAY_M for _, high in self.ranges_m
            ),
            f"b must be at most {MOST_PATCHES} in each group": max(self.b) <= MOST_PATCHES,
            f"a must be at least {LEAST_GRID_M:g} m and the step {LEAST_STEP_M:g} m": self.a_m >= LEAST_GRID_M
            and self.step_m >= LEAST_STEP_M,
            f"start deviation must be at most {MOST_DEVIATION_M:g} m and k2 {MOST_GROWTH_M_S:g} m/s, patch and strip "
            f"{MOST_WIDTH_M:g} m wide": self.start_deviation_m <= MOST_DEVIATION_M
            and self.k2 <= MOST_GROWTH_M_S
            and max(self.roi_width_m * self.roi_spread, 2.0 * self.strip_half_width_m) <= MOST_WIDTH_M,
            "roi_spread must be 1 (all patches alike) or more": self.roi_spread >= 1.0,
            "sigma must lie in [0, 1]": 0.0 <= self.weight_law.sigma <= 1.0,
            f"the weights' sigmoid must have a slope in [0, {STEEPEST_SIGMOID:g}] and its centre within "
            f"+-{FARTHEST_CENTRE:g}": 0.0 <= self.weight_law.sigmoid_slope <= STEEPEST_SIGMOID
            and abs(self.weight_law.sigmoid_centre) <= FARTHEST_CENTRE,
            "least_mass must lie in [0, 1]": 0.0 <= self.least_mass <= 1.0,
            "seed must not be negative": self.seed >= 0,
            "groups_looked_at must be 1, 2 or 3": 1 <= self.groups_looked_at <= len(GROUP_NAMES),
        }
        problems = [text for text, good in checks.items() if not good]
        if problems:
            raise ValueError(f"Settings of the image estimator: {'; '.join(problems)}.")
