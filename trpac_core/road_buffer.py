"""Frames classified and stamped onto the road ahead of one wheel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .estimator_data import EstimatorConfig, EstimatorState, RoadClass
from .sensors import Sensors
from .vision.ife import Ife
from .vision.preview import Outcome, PreviewConfig, add_frame, prune
from .vision.trajectory import Motion


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
        outcome = _classified(state, ife, frame, sensors, acceleration_m_s2)
    elif state.preview.stamps:
        surface = state.preview.stamps[-1].outcome.surface
        outcome = Outcome(surface, Q_v=0.0, flag=False, captured_s=state.time_s)
    else:
        state.frame_failed = True
        return
    prune(state.preview, preview, state.position_m)
    add_frame(
        state.preview,
        preview,
        outcome,
        position_m=state.position_m,
        speed_m_s=sensors.vehicle_speed_m_s,
        frame_interval_s=1.0 / config.vision.camera.fps,
    )
    state.frame_failed = frame is None


def _classified(
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
