"""The camera's side of one wheel: frames judged and stamped onto the road ahead, and found again under the wheel."""

from __future__ import annotations

import math
from bisect import bisect_right
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from .estimator_data import EstimatorConfig, EstimatorState, RoadClass
from .sensors import Sensors
from .vision.ife import Ife
from .vision.preview import Outcome, PreviewConfig, PreviewState, add_frame, covering, prune
from .vision.trajectory import Motion

_begin = attrgetter("X_lb_m")


class RoadUnderWheel:
    """What the camera said of the road at a place, looked up anew only where another stamp or a gap begins."""

    def __init__(self, config: PreviewConfig) -> None:
        self._config = config
        self._stamps: PreviewState | None = None
        self._outcome: Outcome | None = None
        self._from_m, self._until_m = 0.0, 0.0

    def at(self, stamps: PreviewState, position_m: float) -> Outcome | None:
        """Outcome for the road at a coordinate, as `covering` has it [m]."""
        if stamps is self._stamps and self._from_m <= position_m < self._until_m:
            return self._outcome
        outcome = covering(stamps, self._config, position_m)
        self._stamps, self._outcome = stamps, outcome
        self._from_m, self._until_m = self._span(stamps, outcome, position_m)
        return outcome

    def _span(self, stamps: PreviewState, outcome: Outcome | None, position_m: float) -> tuple[float, float]:
        """From where to where the same outcome stands; nothing where stamps do not ascend [m]."""
        if not stamps.ascending:
            return 0.0, 0.0
        begun = bisect_right(stamps.stamps, position_m, key=_begin)
        until_m = stamps.stamps[begun].X_lb_m if begun < len(stamps.stamps) else math.inf
        if not begun:
            return -math.inf, until_m
        newest = stamps.stamps[begun - 1]
        held_m = newest.X_ub_m + self._config.hold_m
        return (held_m, until_m) if outcome is None else (newest.X_lb_m, min(held_m, until_m))


def take_frame(
    state: EstimatorState,
    config: EstimatorConfig,
    preview: PreviewConfig,
    ife: Ife | None,
    frame: NDArray[np.uint8] | RoadClass | None,
    sensors: Sensors,
    acceleration_m_s2: float,
) -> None:
    """Stamp a frame's verdict onto the road ahead; a failed frame, None, says that it knows nothing.

    Raises
    ------
    ImageError
        If the picture does not fit the camera; nothing has changed then.
    """
    if isinstance(frame, RoadClass):
        flag = frame.confidence > config.vision.flag_threshold
        outcome = Outcome(frame.surface, frame.confidence, flag, state.time_s)
    elif frame is not None:
        outcome = _judged(state, ife, frame, sensors, acceleration_m_s2)
    elif state.preview.stamps:
        surface = state.preview.stamps[-1].outcome.surface
        outcome = Outcome(surface, Q_v=0.0, flag=False, captured_s=state.time_s)
    else:
        state.frame_failed = True
        return
    state.preview = add_frame(
        prune(state.preview, preview, state.position_m),
        preview,
        outcome,
        position_m=state.position_m,
        speed_m_s=sensors.vehicle_speed_m_s,
        frame_interval_s=1.0 / config.vision.camera.fps,
    )
    state.frame_failed = frame is None


def _judged(
    state: EstimatorState,
    ife: Ife | None,
    frame: NDArray[np.uint8],
    sensors: Sensors,
    acceleration_m_s2: float,
) -> Outcome:
    """Classify a picture."""
    if ife is None:
        raise TypeError("A picture came, but the estimator was made without an image estimator.")
    motion = Motion(
        sensors.vehicle_speed_m_s,
        acceleration_m_s2,
        sensors.steering_angle_rad,
        sensors.yaw_rate_rad_s,
        state.position_m,
    )
    state.ife, result = ife.process(state.ife, frame, motion)
    return Outcome(result.surface, result.Q_v, result.flag, state.time_s)
