"""Late image results."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarios.effects.base import Effect, parameter
from scenarios.effects.frames import Frames


@dataclass(frozen=True)
class CameraLatency(Effect):
    """Results are stamped with the position of the car at their arrival, although the picture is older.

    Every change of class appears farther along the road by the distance driven in the meantime.
    """

    id = "camera_latency"
    stage = "perception"
    subsystem = "camera"
    equation = "stamp = place seen + X(t) - X(t - delay), which is v delay at constant speed"
    source = "Eq. (11) of Tian et al. (2022), doi:10.3390/rs14215583, with the position taken at arrival"
    excited_by = "surface borders passed at two or more speeds"
    confounders = ("camera_pitch",)

    delay_s: float = parameter(
        "s",
        "age of the picture when its result is stamped",
        neutral=0.0,
        low=0.0,
        high=1.0,
        starts=(0.02, 0.06, 0.2),
    )

    def perceive(self, frames: Frames) -> Frames:
        """Results arrive later and carry the place of their arrival."""
        if self.delay_s == 0.0:
            return frames
        arrival_s = frames.arrival_s + self.delay_s
        at_arrival = np.interp(arrival_s, frames.drive_time_s, frames.drive_camera_m)
        return replace(frames, arrival_s=arrival_s, stamp_camera_m=at_arrival)
