"""Wrong mounting angle of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.base import Effect, parameter
from scenarios.effects.frames import Frames

LEAST_ANGLE_RAD = 0.005
"""Rays are not followed closer to the horizon than this: they would meet the road beyond 280 m [rad]."""


def seen_distance_m(
    stamped_m: NDArray[np.float64], height_m: float, pitch_rad: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance at which a pitched camera truly looks where its file says that it looks at a stamped one.

    The file takes a point at distance d to lie atan(h / d) below the horizon. The picture shows there what lies
    pitch more below it, at h / tan(atan(h / d) + pitch).

    Parameters
    ----------
    stamped_m : array
        Distance ahead of the lens by the camera file, above 0 [m].
    height_m : float
        Of the lens above the road [m].
    pitch_rad : float or array
        Additional pitch of the real camera, nose down positive [rad].

    Examples
    --------
    >>> round(float(seen_distance_m(2.9, 1.4, 0.05)), 3)   # 0.34 m nearer than stamped
    2.561
    """
    angle = np.arctan2(height_m, stamped_m) + pitch_rad
    return height_m / np.tan(np.clip(angle, LEAST_ANGLE_RAD, 0.5 * np.pi))


@dataclass(frozen=True)
class CameraPitch(Effect):
    """The camera is pitched differently from its file.

    A camera that is pitched down sees road nearer than its stamp. Every change of class then appears farther along the
    road, by a distance that hardly depends on speed.
    """

    id = "camera_pitch"
    stage = "perception"
    subsystem = "camera"
    equation = "end seen = h / tan(atan(h / end stamped) + pitch), either end of a stretch"
    source = "Geometry of a pinhole camera over a flat road, Eqs. (5) and (6) of Tian et al. (2022)"
    excited_by = "surface borders passed at two or more speeds"
    confounders = ("camera_latency",)

    pitch_rad: float = parameter(
        "rad",
        "additional pitch over the camera file, nose down positive",
        neutral=0.0,
        low=-0.4,
        high=0.4,
        starts=(-0.08, -0.02, 0.02, 0.08),
    )

    def perceive(self, frames: Frames) -> Frames:
        """The stretch seen is not the one stamped."""
        if self.pitch_rad == 0.0:
            return frames
        seen_m = seen_distance_m(frames.stamped_m, frames.camera_height_m, self.pitch_rad)
        return replace(frames, seen_m=seen_m)
