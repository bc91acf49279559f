"""Over- or underexposed pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.effects.base import Effect, parameter
from scenarios.effects.frames import Frames

TOLERATED_STOPS = 4.3
"""Exposure error that leaves 1/e of the right classes [stops].

By ``benchmarks/vision/measure_camera_laws.py``: networks before were right on 0.96, 0.80, 0.49 of what they are right
on undisturbed, at 1, 2, 3 stops to either side (60 rendered roads; 0.95, 0.81, 0.61 by this law), the shipped ones are
on 0.99, 0.89, 0.76: a camera lies between.
"""


def share_left(stops: float) -> float:
    """Share of right classes, and of confidence, that an exposure error leaves [-]."""
    return float(np.exp(-((stops / TOLERATED_STOPS) ** 2)))


@dataclass(frozen=True)
class ExposureShift(Effect):
    """Pictures are overexposed (stops above 0) or underexposed.

    The law is that of a calibrated chain, whose confidence is its share of right classes. The confidence of the shipped
    networks hardly falls below 3 stops, because Dempster's rule keeps it near 1.
    """

    id = "exposure_shift"
    stage = "perception"
    subsystem = "camera"
    equation = "Q_v and share of right classes times exp(-(stops / 4.3)^2); linear light times 2^stops"
    source = "measured: benchmarks/vision/measure_camera_laws.py"
    excited_by = "any drive with a known normal confidence; best with the pictures"
    confounders = ("motion_blur",)

    stops: float = parameter(
        "stops",
        "exposure error; overexposed is positive",
        neutral=0.0,
        low=-6.0,
        high=6.0,
        starts=(-3.0, -1.5, 1.5, 3.0),
    )

    def perceive(self, frames: Frames) -> Frames:
        """Confidence and right classes decrease alike at all speeds."""
        return frames.dimmed(np.full(len(frames.time_s), share_left(self.stops)))
