"""From the motion to the log: what each sensor does to its signal, and its noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

from .kernel import ANGLE, RECORD_STEP_S, N, V, W, X
from .motors import COMMAND_STEP_S
from .sensor_set import Sensors
from .signals import beat, hold, lag, limited, mean_age, mislocked, played, ringing, tracked

Array = NDArray[np.floating[Any]]
WHEELS = ("fl", "fr", "rl", "rr")
NODDING_S, MOST_NODDING = 0.1, 0.4
"""How late a body pitches, and by how much that changes a scale's deviation at most [-]."""
MEMORY_S, MEMORY_M_S2 = 1.5, 1.0
"""How long an accelerometer remembers where it was bent to, and from what acceleration on."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations, the coloured share of the variance and its correlation time; clock and losses."""

    wheel_rad_s: float
    speed_m_s: float
    accel_m_s2: float
    position_m: float
    coloured_share: float
    correlation_s: float
    jitter: float
    """Standard deviation of the rows' times [row steps]."""
    lost: float
    """Share of samples lost [-]."""

    @property
    def sigmas(self) -> Array:
        """Of the six readings: four wheel speeds, vehicle speed, accelerometer."""
        return np.array([self.wheel_rad_s] * 4 + [self.speed_m_s, self.accel_m_s2])


def draw_noise(rng: Generator) -> Noise:
    """Noise of a production car's sensors up to good test equipment."""
    wheel, speed, accel = (np.exp(rng.uniform(*np.log(b))) for b in ((0.02, 0.1), (0.01, 0.05), (0.03, 0.15)))
    return Noise(
        wheel_rad_s=float(wheel),
        speed_m_s=float(speed),
        accel_m_s2=float(accel),
        position_m=float(rng.choice([0.0, rng.uniform(0.005, 0.05)])),
        coloured_share=float(rng.uniform(0.0, 0.4)),
        correlation_s=float(rng.uniform(0.005, 0.015)),
        jitter=float(rng.choice([0.0, rng.uniform(0.02, 0.1)], p=[0.7, 0.3])),
        lost=float(rng.choice([0.0, rng.uniform(0.001, 0.01)], p=[0.7, 0.3])),
    )


def read(path: Array, sensors: Sensors, time_s: Array) -> Array:
    """Noise-free readings at `time_s`.

    Parameters
    ----------
    path : array, shape (n, N + 1)
        The kernel's record.
    sensors : Sensors
    time_s : array, shape (m,)
        Within the record [s].

    Returns
    -------
    array, shape (m, 6)
        Four wheel speeds, vehicle speed, accelerometer.
    """
    record = np.arange(len(path)) * RECORD_STEP_S
    rng = np.random.default_rng([sensors.seed, 11])
    wheel_phase, _, *turns = np.random.default_rng([sensors.seed, 12]).uniform(0.0, 1.0, 6)
    wheel_at: Array = time_s - sensors.wheel_delay_s - beat(time_s, sensors.wheel_beat_s, wheel_phase)
    wheel_at = wheel_at + mean_age(sensors.wheel_filter_s)
    out = np.empty((time_s.size, 6))
    for w in range(4):
        if sensors.wheel_window_s > 0.0:
            wheel = _counted(record, path[:, ANGLE + w], sensors, wheel_at, rng)
        else:
            turning = lag(path[:, W + w], sensors.wheel_filter_s)
            turning = hold(turning, sensors.wheel_hold_s, np.random.default_rng([sensors.seed, 17]))
            wheel = np.interp(wheel_at, record, turning)
        if sensors.wheel_runout > 0.0:
            angle = np.interp(wheel_at, record, path[:, ANGLE + w])
            wheel = wheel * (1.0 + sensors.wheel_runout * np.cos(angle + 2.0 * np.pi * turns[w]))
        out[:, w] = wheel * sensors.wheel_scale[w]
        if sensors.wheel_offset_rad_s != 0.0:
            out[:, w] += sensors.wheel_offset_rad_s
        if sensors.wheel_least_rad_s > 0.0:
            out[out[:, w] < sensors.wheel_least_rad_s, w] = 0.0
    if sensors.wheel_blend > 0.0:
        out[:, :4] += sensors.wheel_blend * (out[:, :4].mean(axis=1, keepdims=True) - out[:, :4])
    out[:, 4] = _speed(path, record, sensors, time_s, rng)
    out[:, 5] = _acceleration(path, record, sensors, time_s)
    return out


def _counted(record: Array, angle: Array, sensors: Sensors, time_s: Array, rng: Generator) -> Array:
    """Speed from the pulses of each finished window [rad/s]; a wheel that was rolling before the record began."""
    teeth, window = sensors.wheel_teeth, sensors.wheel_window_s
    phase, first = rng.uniform(0.0, 1.0), rng.uniform(0.0, window)
    ends = time_s if sensors.wheel_window_runs else np.floor((time_s - first) / window) * window + first
    before = np.gradient(angle[:3], RECORD_STEP_S)[0]

    def pulses(at: Array) -> Array:
        turned = np.interp(at, record, angle) + before * np.minimum(at, 0.0)
        return np.floor(turned * teeth / (2.0 * np.pi) + phase)

    return (pulses(ends) - pulses(ends - window)) * 2.0 * np.pi / (teeth * window)


def _speed(path: Array, record: Array, sensors: Sensors, time_s: Array, rng: Generator) -> Array:
    """Reading of the vehicle speed sensor [m/s]."""
    at = time_s * (1.0 - sensors.speed_clock) - sensors.speed_delay_s + mean_age(sensors.speed_filter_s)
    speed = path[:, V]
    if sensors.speed_rolling > 0.0:
        rolled = path[:, W : W + 4].mean(axis=1) * sensors.wheel_radius_m
        speed = speed + sensors.speed_rolling * (rolled - speed)
    if sensors.speed_ahead_s > 0.0:
        speed = speed + sensors.speed_ahead_s * path[:, N]
    if sensors.speed_play_m_s > 0.0:
        speed = played(speed, sensors.speed_play_m_s)
    if sensors.speed_loop_s > 0.0:
        speed = tracked(speed, sensors.speed_loop_s)
    if np.isfinite(sensors.speed_rate_m_s2):
        speed = limited(speed, sensors.speed_rate_m_s2)
    speed = hold(lag(speed, sensors.speed_lag_s + sensors.speed_filter_s), sensors.speed_hold_s, rng)
    scale: float | Array = sensors.speed_scale
    if sensors.speed_scale_pitch != 0.0:
        nod = sensors.speed_scale_pitch * np.interp(time_s, record, lag(path[:, N], NODDING_S))
        scale = 1.0 + (sensors.speed_scale - 1.0) * (1.0 + np.clip(nod, -MOST_NODDING, MOST_NODDING))
    shown = scale * np.interp(at, record, speed) + sensors.speed_offset_m_s
    if sensors.speed_mislocks != 0.0:
        shown *= 1.0 + sensors.speed_mislocks * mislocked(time_s, sensors.seed)
    if sensors.speed_step_m_s > 0.0:
        shown = np.floor(shown / sensors.speed_step_m_s) * sensors.speed_step_m_s
    return np.asarray(shown)


def _acceleration(path: Array, record: Array, sensors: Sensors, time_s: Array) -> Array:
    """Reading of the accelerometer [m/s^2]."""
    accel = ringing(lag(path[:, N], sensors.accel_lag_s), sensors.accel_period_s)
    if sensors.accel_fades_s > 0.0:
        accel = accel - lag(accel, sensors.accel_fades_s)
    if sensors.accel_pitch > 0.0:
        accel = accel + sensors.accel_pitch * lag(path[:, N], NODDING_S)
    if sensors.accel_bend_s2_m != 0.0:
        accel = accel + sensors.accel_bend_s2_m * accel * accel
    bias: float | Array = sensors.accel_bias_m_s2
    if sensors.accel_bias_memory > 0.0:
        bent = lag(np.tanh(path[:, N] / MEMORY_M_S2), MEMORY_S)
        bias = bias * (1.0 + sensors.accel_bias_memory * np.interp(time_s, record, bent))
    shown = sensors.accel_scale * np.interp(time_s - sensors.accel_delay_s, record, accel) + bias
    shown = np.clip(shown, -sensors.accel_limit_m_s2, sensors.accel_limit_m_s2)
    if sensors.accel_step_m_s2 > 0.0:
        shown = np.round(shown / sensors.accel_step_m_s2) * sensors.accel_step_m_s2
    return np.asarray(shown)


def noise_of(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White plus first-order coloured noise of the six readings, shape (m, 6)."""
    shape = (time_s.size, 6)
    keep = np.exp(-np.median(np.diff(time_s)) / noise.correlation_s)
    pushes = rng.standard_normal(shape) * np.sqrt(1.0 - keep**2)
    pushes[0] = rng.standard_normal(6)
    coloured = lfilter([1.0], [1.0, -keep], pushes, axis=0)
    white = rng.standard_normal(shape)
    share = noise.coloured_share
    return (np.sqrt(1.0 - share) * white + np.sqrt(share) * coloured) * noise.sigmas


def make_log(
    path: Array,
    command: Array,
    sensors: Sensors,
    noise: Noise,
    rate_hz: float,
    rng: Generator,
    noisy: Callable[[Noise, Array, Generator], Array] = noise_of,
) -> pd.DataFrame:
    """The log as the car's logger wrote it: noise, jittered clock, lost samples.

    Without jitter every corner of the command falls on a row, so that a straight line between rows is the command;
    at 250 Hz every second one does, which leaves no gap that shows.
    """
    rows = int((len(path) - 1) * RECORD_STEP_S * rate_hz)
    time_s = (
        np.arange(1, rows + 1) + np.clip(rng.normal(0.0, 1.0, rows) * noise.jitter, -0.3, 0.3)
    ) / rate_hz
    values = read(path, sensors, time_s) + noisy(noise, time_s, rng)
    record = np.arange(len(path)) * RECORD_STEP_S
    position = np.interp(time_s, record, path[:, X]) + noise.position_m * rng.standard_normal(rows)
    values[rng.random(values.shape) < noise.lost] = np.nan
    clock = np.arange(len(command)) * COMMAND_STEP_S
    columns = {"time_s": np.round(time_s, 7)}
    for w, name in enumerate(WHEELS):
        columns[f"wheel_torque_{name}_nm"] = np.round(np.interp(time_s, clock, command[:, w]), 4)
    for w, name in enumerate(WHEELS):
        columns[f"wheel_speed_{name}_rad_s"] = np.round(values[:, w], 5)
    columns["vehicle_speed_m_s"] = np.round(values[:, 4], 5)
    columns["accel_x_m_s2"] = np.round(values[:, 5], 5)
    columns["position_m"] = np.round(position, 4)
    return pd.DataFrame(columns)
