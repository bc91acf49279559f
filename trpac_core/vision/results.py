"""Results of the image-based fusion estimator for a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .classes import Surface
from .networks import RoadMasks


@dataclass(frozen=True)
class GroupResult:
    """Result of one group of ellipses.

    `probabilities` are P_fusion of dry, wet, snow and ice, `m_0` is the largest mass of Eq. (8) before the
    combination. With `n_roi` of 0 or 1 they are the evidence weights, `m_0` is 0, the surface is that of the largest
    weight, and the flag is not set.
    """

    name: str
    range_m: tuple[float, float]
    surface: Surface
    probabilities: tuple[float, float, float]
    P_fusion: float
    p_util: float
    Q_v: float
    m_0: float
    flag: bool
    n_roi: int
    n_ell: int
    n_rs: int


@dataclass(frozen=True)
class GroupView:
    """One group as it lies in the picture.

    Attributes
    ----------
    outlines_px : array, shape (n, corners, 2)
        95 % ellipses; NaN where they are not ahead of the lens [px].
    boxes_px : array, shape (n_roi, 4)
        Left, top, right, bottom of the patches [px].
    probabilities : array, shape (n_roi, 3)
        Calibrated probabilities of the patches [-].
    """

    outlines_px: NDArray[np.float64]
    boxes_px: NDArray[np.int64]
    probabilities: NDArray[np.float64]


@dataclass(frozen=True)
class FrameView:
    """Regions and masks of a frame, for drawing.

    `usable` is the mask of road out of the shadow, `lines_px` the ends of the lines across the road, shape (n, 2, 2);
    NaN where they are not ahead of the lens [px].
    """

    masks: RoadMasks
    usable: NDArray[np.bool_]
    groups: tuple[GroupView, ...]
    lines_px: NDArray[np.float64]


@dataclass(frozen=True)
class FrameResult:
    """Result of a frame: that of its near group, since the paper updates frame by frame (section 3.4)."""

    groups: tuple[GroupResult, ...]
    frame: int
    view: FrameView | None = None

    @property
    def near(self) -> GroupResult:
        """The group that starts at the preview distance."""
        return self.groups[0]

    @property
    def surface(self) -> Surface:
        """Fused class."""
        return self.near.surface

    @property
    def probabilities(self) -> tuple[float, float, float]:
        """Fused probabilities of dry, wet, snow and ice [-]."""
        return self.near.probabilities

    @property
    def P_fusion(self) -> float:
        """Fused probability of the class [-]."""
        return self.near.P_fusion

    @property
    def p_util(self) -> float:
        """Usable share of the road that is looked at [-]."""
        return self.near.p_util

    @property
    def Q_v(self) -> float:
        """Visual information confidence, Eq. (10) [-]."""
        return self.near.Q_v

    @property
    def flag(self) -> bool:
        """Whether the visual information is to be trusted."""
        return self.near.flag

    def told_by_bus(self, flag_threshold: float) -> float:
        """Q_v for a receiver that sets its flag by Q_v alone: at most its threshold where the flag is 0 [-]."""
        return self.Q_v if self.flag else min(self.Q_v, flag_threshold)
