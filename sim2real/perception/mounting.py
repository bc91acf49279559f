"""Where the lens sits, and what a mounting angle is worth where nobody says so.

What shows in the logs is by how far places are off. The angle that does so depends on the lens's height and distance,
which `trpac gap diagnose` is not told: its intervals hold what other usual places would make of the same distance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scenarios.effects.camera_pitch import seen_distance_m
from sim2real.result import Interval

HEIGHTS = (0.85, 1.15)
"""Range of the lens's height in shares of the assumed one: a low car's and a van's [-]."""
STEEPEST_RAD = 0.4
"""Angle beyond which no mounting is thought to be off [rad]."""


@dataclass(frozen=True)
class Mounting:
    """Where the lens is, and how much further back it may be.

    Attributes
    ----------
    height_m : float
        Above the road [m].
    further_m : float
        By how much it may lie behind the place taken, up to the centre of gravity; 0 where the camera is known [m].
    """

    height_m: float
    further_m: float = 0.0

    def over_places(self, pitch: Interval, ahead_m: float) -> Interval:
        """A pitch's interval over all places of the lens that are possible, for stamps so far ahead of it."""
        if not self.further_m:
            return pitch
        lens = list(product(HEIGHTS, (0.0, self.further_m)))
        ends = [self._elsewhere(p, ahead_m, *place) for p in (pitch.low, pitch.high) for place in lens]
        return replace(pitch, low=min(pitch.low, *ends), high=max(pitch.high, *ends))

    def _elsewhere(self, pitch_rad: float, ahead_m: float, height: float, further_m: float) -> float:
        """The pitch that moves places as far, for a lens of another height and so much further back [rad]."""
        seen_m = float(seen_distance_m(np.array([ahead_m]), self.height_m, pitch_rad)[0])
        height_m = height * self.height_m
        other = np.arctan2(height_m, seen_m + further_m) - np.arctan2(height_m, ahead_m + further_m)
        return float(np.clip(other, -STEEPEST_RAD, STEEPEST_RAD))
