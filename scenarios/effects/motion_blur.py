"""Pictures smeared by the car's own motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.base import Effect, parameter
from scenarios.effects.frames import Frames

TOLERATED_SMEAR_M = 4.0
"""Smear on the road that leaves 1/e of the right classes [m].

By ``benchmarks/vision/measure_camera_laws.py``: networks before were right on 0.88 and 0.79 of what they are right on
undisturbed, at a smear of 0.5 and 1 m (60 rendered roads; 0.88 and 0.78 by this law), the shipped ones are on 0.72 and
0.60.
"""


def share_left(speed_m_s: NDArray[np.float64], exposure_s: float) -> NDArray[np.float64]:
    """Share of right classes, and of confidence, that motion blur leaves, same shape as the speed [-]."""
    return np.exp(-speed_m_s * exposure_s / TOLERATED_SMEAR_M)


@dataclass(frozen=True)
class MotionBlur(Effect):
    """The picture is blurred by speed times exposure time; confidence as in `exposure_shift`."""

    id = "motion_blur"
    stage = "perception"
    subsystem = "camera"
    equation = "Q_v and share of right classes times exp(-v exposure / 4 m)"
    source = "measured: benchmarks/vision/measure_camera_laws.py"
    excited_by = "low and high speed on the same surface"
    confounders = ("exposure_shift",)

    exposure_s: float = parameter(
        "s",
        "exposure time in addition to the simulation's",
        neutral=0.0,
        low=0.0,
        high=0.2,
        starts=(0.005, 0.02, 0.06),
    )

    def perceive(self, frames: Frames) -> Frames:
        """Confidence and right classes decrease with speed."""
        return frames.dimmed(share_left(frames.speed_m_s, self.exposure_s))
