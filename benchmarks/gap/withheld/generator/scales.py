"""By how much a vehicle speed's scale and an accelerometer's bias differ from moment to moment and place to place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .details import GRAIN_M, USUAL_M_S, WARM_S
from .kernel import RECORD_STEP_S, N, V, X
from .signals import cycling, jumping, lag, slow

if TYPE_CHECKING:
    from .sensor_set import Sensors

Array = NDArray[np.floating[Any]]

SWAY_S = 9.0
NODDING_S, MOST_NODDING = 0.1, 0.4
"""How late a body pitches, and by how much that changes a scale's deviation at most [-]."""
MEMORY_S, MEMORY_M_S2 = 1.5, 1.0
"""How long a sensor remembers where it was bent to, and from what acceleration on."""
AIRED_S = 6.0
"""In which the air stream's cooling tells on a sensor."""
MOUNT_M_S, MOUNT_OVER_M_S = 18.0, 3.0
"""Speed at which a wheel's turns shake a sensor's bracket, and over what."""
MOUNT_SHARE = np.sqrt(np.pi) * MOUNT_OVER_M_S / (30.0 - 5.0)
"""Mean of the shaking over the speeds from 5 to 30 m/s [-]."""
TABLE_M_S = 20.0 / 3.6
"""Over which a calibration's error goes up and down between its points."""
WAVES_M = 31.0
"""Of a road that lifts and lowers the body, and a sensor below it with it."""


def scale_of(path: Array, sensors: Sensors, time_s: Array, speed: Array) -> float | Array:
    """Of the vehicle speed, whose deviation may differ with time, speed and pitch [-]."""
    differs = (sensors.speed_sway, sensors.speed_scale_growth, sensors.speed_scale_pitch)
    places = (sensors.speed_scale_grain, sensors.speed_scale_warming, sensors.speed_scale_jumps)
    speeds = (sensors.speed_scale_table, sensors.speed_scale_mount)
    rest = (sensors.speed_scale_wander, sensors.speed_scale_waves)
    if not any((*differs, *places, *speeds, *rest)):
        return sensors.speed_scale
    sway = 1.0 + sensors.speed_sway * np.sin(2.0 * np.pi * time_s / SWAY_S)
    sway = sway + sensors.speed_scale_growth * (speed / USUAL_M_S - 1.0)
    if sensors.speed_scale_pitch != 0.0:
        record = np.arange(len(path)) * RECORD_STEP_S
        nod = sensors.speed_scale_pitch * np.interp(time_s, record, lag(path[:, N], NODDING_S))
        sway = sway + np.clip(nod, -MOST_NODDING, MOST_NODDING)
    if sensors.speed_scale_grain > 0.0:
        sway = sway + sensors.speed_scale_grain * _coarse(path, time_s)
    if sensors.speed_scale_warming > 0.0:
        sway = sway + sensors.speed_scale_warming * (1.0 - 2.0 * np.exp(-time_s / WARM_S))
    if sensors.speed_scale_jumps > 0.0:
        sway = sway + sensors.speed_scale_jumps * jumping(time_s, sensors.seed)
    if sensors.speed_scale_wander > 0.0:
        sway = sway + sensors.speed_scale_wander * slow(time_s, sensors.seed)
    if sensors.speed_scale_table > 0.0:
        sway = sway + sensors.speed_scale_table * np.sin(2.0 * np.pi * speed / TABLE_M_S)
    if sensors.speed_scale_mount > 0.0:
        shakes = np.exp(-(((speed - MOUNT_M_S) / MOUNT_OVER_M_S) ** 2))
        sway = sway + sensors.speed_scale_mount * (shakes - MOUNT_SHARE)
    if sensors.speed_scale_waves > 0.0:
        sway = sway + sensors.speed_scale_waves * np.sin(2.0 * np.pi * _place(path, time_s) / WAVES_M)
    return 1.0 + (sensors.speed_scale - 1.0) * sway


def bias_of(path: Array, sensors: Sensors, time_s: Array) -> Array:
    """Of the accelerometer [m/s^2]."""
    record = np.arange(len(path)) * RECORD_STEP_S
    bias = sensors.accel_bias_m_s2 * (1.0 + sensors.accel_warming * (1.0 - 2.0 * np.exp(-time_s / WARM_S)))
    if sensors.accel_bias_growth != 0.0:
        faster = np.interp(time_s, record, path[:, V]) / USUAL_M_S - 1.0
        bias = bias * (1.0 + sensors.accel_bias_growth * faster)
    if sensors.accel_wander > 0.0:
        bias = bias * (1.0 + sensors.accel_wander * slow(time_s, sensors.seed))
    if sensors.accel_bias_grain > 0.0:
        bias = bias * (1.0 + sensors.accel_bias_grain * _coarse(path, time_s))
    if sensors.accel_bias_memory > 0.0:
        bent = lag(np.tanh(path[:, N] / MEMORY_M_S2), MEMORY_S)
        bias = bias * (1.0 + sensors.accel_bias_memory * np.interp(time_s, record, bent))
    if sensors.accel_bias_jumps > 0.0:
        bias = bias * (1.0 + sensors.accel_bias_jumps * jumping(time_s, sensors.seed))
    if sensors.accel_bias_fan > 0.0:
        bias = bias * (1.0 + sensors.accel_bias_fan * cycling(time_s, sensors.seed))
    if sensors.accel_bias_aired != 0.0:
        aired = np.interp(time_s, record, lag(path[:, V], AIRED_S)) / USUAL_M_S - 1.0
        bias = bias * (1.0 - sensors.accel_bias_aired * aired)
    return bias


def _coarse(path: Array, time_s: Array) -> Array:
    """1 on a coarse road's stretches and -1 between them [-]."""
    return np.asarray(np.tanh(4.0 * np.sin(2.0 * np.pi * _place(path, time_s) / GRAIN_M)))


def _place(path: Array, time_s: Array) -> Array:
    return np.asarray(np.interp(time_s, np.arange(len(path)) * RECORD_STEP_S, path[:, X]))
