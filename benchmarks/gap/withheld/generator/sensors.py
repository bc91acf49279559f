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

from .counting import count
from .details import USUAL_M_S, USUAL_RAD_S, WAIT_S
from .kernel import ANGLE, COMMAND_STEP_S, MOTOR, RECORD_STEP_S, N, V, W, X
from .scales import NODDING_S, bias_of, scale_of
from .sensor_set import Sensors
from .signals import (
    beat,
    extrapolated,
    fitted,
    hold,
    joined,
    jumping,
    lag,
    limited,
    mean,
    mean_age,
    middle,
    mislocked,
    paced,
    played,
    ringing,
    sent,
    tracked,
    wait,
)

Array = NDArray[np.floating[Any]]
WHEELS = ("fl", "fr", "rl", "rr")


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
    wheel_phase, speed_phase, *turns = np.random.default_rng([sensors.seed, 12]).uniform(0.0, 1.0, 6)
    waits = np.random.default_rng([sensors.seed, 13]).uniform(-0.5, 0.5, (2, int(record[-1] / WAIT_S) + 2))
    wheel_at: Array = time_s - sensors.wheel_delay_s - beat(time_s, sensors.wheel_beat_s, wheel_phase)
    filters = 2.0 if sensors.wheel_filter_twice else 1.0
    wheel_at = (
        wheel_at + filters * mean_age(sensors.wheel_filter_s) - wait(time_s, sensors.wheel_wait_s, waits[0])
    )
    if sensors.wheel_queue_s > 0.0:
        late = sensors.wheel_queue_s * jumping(time_s, sensors.seed)
        wheel_at = np.maximum.accumulate(wheel_at - late)
    if not sensors.wheel_joined:
        wheel_at = sent(wheel_at, sensors.wheel_message_s, wheel_phase, sensors.wheel_lost, sensors.seed)
    speed_at: Array = time_s * (1.0 - sensors.speed_clock) - sensors.speed_delay_s
    speed_at = speed_at - beat(time_s, sensors.speed_beat_s, speed_phase)
    speed_at = speed_at + mean_age(sensors.speed_filter_s) - wait(time_s, sensors.speed_wait_s, waits[1])
    if not (sensors.speed_joined or sensors.speed_extrapolated):
        speed_at = sent(speed_at, sensors.speed_message_s, speed_phase, sensors.speed_lost, sensors.seed)
    if sensors.speed_paced_s > 0.0:
        pace = paced(np.interp(time_s, record, path[:, V]), USUAL_M_S)
        speed_at = speed_at - sensors.speed_paced_s * pace
    out, asked = np.empty((time_s.size, 6)), wheel_at
    for w in range(4):
        if sensors.wheel_turn_s > 0.0:
            wheel_at = asked - sensors.wheel_turn_s * (2.0 * w / 3.0 - 1.0)
        if sensors.wheel_axles_s > 0.0:
            wheel_at = asked - (-sensors.wheel_axles_s if w < 2 else sensors.wheel_axles_s)
        if sensors.wheel_paced_s > 0.0:
            pace = paced(np.interp(time_s, record, path[:, W + w]), USUAL_RAD_S)
            wheel_at = asked - sensors.wheel_paced_s * pace
        if sensors.wheel_window_s > 0.0:
            wheel = count(record, path[:, ANGLE + w], sensors, wheel_at, rng, wheel_phase)
        else:
            turning = lag(path[:, (MOTOR if sensors.wheel_at_motor else W) + w], sensors.wheel_filter_s)
            if sensors.wheel_filter_twice:
                turning = lag(turning, sensors.wheel_filter_s)
            turning = middle(turning, sensors.wheel_median_s)
            turning = hold(turning, sensors.wheel_hold_s, np.random.default_rng([sensors.seed, 17]))
            if sensors.wheel_joined:
                turning = joined(record, turning, sensors.wheel_message_s, wheel_phase)
            wheel = mean(record, turning, wheel_at, sensors.wheel_average_s)
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
    if sensors.speed_joined:
        speed = joined(record, speed, sensors.speed_message_s, speed_phase)
    if sensors.speed_extrapolated:
        speed = extrapolated(record, speed, sensors.speed_message_s, speed_phase)
    speed = fitted(speed, sensors.speed_fitted_s)
    if sensors.speed_average_twice:
        speed = mean(record, speed, record, sensors.speed_average_s)
    shown_speed = mean(record, speed, speed_at, sensors.speed_average_s)
    out[:, 4] = scale_of(path, sensors, time_s, shown_speed) * shown_speed + sensors.speed_offset_m_s
    if sensors.speed_mislocks != 0.0:
        out[:, 4] *= 1.0 + sensors.speed_mislocks * mislocked(time_s, sensors.seed)
    if sensors.speed_step_m_s > 0.0:
        out[:, 4] = np.floor(out[:, 4] / sensors.speed_step_m_s) * sensors.speed_step_m_s
    accel = ringing(lag(path[:, N], sensors.accel_lag_s), sensors.accel_period_s)
    if sensors.accel_fades_s > 0.0:
        accel = accel - lag(accel, sensors.accel_fades_s)
    if sensors.accel_pitch > 0.0:
        accel = accel + sensors.accel_pitch * lag(path[:, N], NODDING_S)
    if sensors.accel_bend_s2_m != 0.0:
        accel = accel + sensors.accel_bend_s2_m * accel * accel
    shown = sensors.accel_scale * np.interp(time_s - sensors.accel_delay_s, record, accel)
    shown = shown + bias_of(path, sensors, time_s)
    out[:, 5] = np.clip(shown, -sensors.accel_limit_m_s2, sensors.accel_limit_m_s2)
    if sensors.accel_step_m_s2 > 0.0:
        out[:, 5] = np.round(out[:, 5] / sensors.accel_step_m_s2) * sensors.accel_step_m_s2
    return out


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
