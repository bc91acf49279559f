"""The frames of the camera chain, on which effects act."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Frames:
    """Times, positions and results of the camera chain, one row per picture.

    Attributes
    ----------
    time_s, arrival_s : array, shape (n,)
        When the picture was taken, and when its result arrives [s].
    speed_m_s : array, shape (n,)
        Speed when the picture was taken [m/s].
    camera_m, stamp_camera_m : array, shape (n,)
        Position of the camera when the picture was taken, and the position assumed by the stamp [m].
    stamped_m, seen_m : array, shape (n, 2)
        Begin and end of the stretch ahead of the camera: by the camera file, and true [m].
    confidence, wrong_share : array, shape (n,)
        Q_v, and the probability that the class is wrong [-].
    camera_height_m : float
        Height of the lens above the road [m].
    class_friction : array, shape (3,)
        Friction by class, dry, wet, snow and ice [-].
    drive_time_s, drive_camera_m : array, shape (m,)
        Times and positions of the camera over the drive, for effects that shift time [s], [m].
    """

    time_s: Array
    arrival_s: Array
    speed_m_s: Array
    camera_m: Array
    stamp_camera_m: Array
    stamped_m: Array
    seen_m: Array
    confidence: Array
    wrong_share: Array
    camera_height_m: float
    class_friction: Array
    drive_time_s: Array
    drive_camera_m: Array

    def dimmed(self, share: Array) -> Frames:
        """The frames with confidence and probability of the right class multiplied by `share`, shape (n,)."""
        right = (1.0 - self.wrong_share) * share
        return replace(self, confidence=self.confidence * share, wrong_share=1.0 - right)
