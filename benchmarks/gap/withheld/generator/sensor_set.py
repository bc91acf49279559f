"""The sensors of a car, and what each does to its signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sensors:
    """What the sensors do; the defaults are ideal ones.

    `wheel_beat_s` is by how much the age of a reading differs over a beat of two clocks, `*_filter_s` the part of it
    that a low pass takes; its mean age stays the delay.
    """

    wheel_delay_s: float = 0.0
    wheel_beat_s: float = 0.0
    wheel_filter_s: float = 0.0
    wheel_hold_s: float = 0.0
    wheel_teeth: float = 0.0
    wheel_window_s: float = 0.0
    wheel_window_runs: bool = False
    """The window ends at the row, instead of one after the other."""
    wheel_least_rad_s: float = 0.0
    """Below which a wheel is told to stand: the sensor's signal is too small."""
    wheel_offset_rad_s: float = 0.0
    """Of all wheels' readings."""
    wheel_blend: float = 0.0
    """Share of each wheel's reading that is the mean of all [-]."""
    wheel_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    wheel_radius_m: float = 0.0
    """Where a speed is taken from the wheels [m]."""
    wheel_runout: float = 0.0
    """Amplitude of the reading over a turn of the wheel, each wheel with its own phase [-]."""
    speed_delay_s: float = 0.0
    speed_filter_s: float = 0.0
    speed_ahead_s: float = 0.0
    """What the speed is predicted over, though it is not late."""
    speed_clock: float = 0.0
    """Share by which the speed sensor's clock is slow: its signal is ever later [-]."""
    speed_scale: float = 1.0
    speed_scale_pitch: float = 0.0
    """By which it differs with the body's pitch, where the car accelerates [1/(m/s^2)]."""
    speed_mislocks: float = 0.0
    """By which the speed is off while the sensor has locked onto something else [-]."""
    speed_play_m_s: float = 0.0
    """How far the speed has to change, either way, before what is told follows."""
    speed_rate_m_s2: float = np.inf
    """As fast as the told speed may change."""
    speed_step_m_s: float = 0.0
    """In which the speed is told, what is below a step dropped."""
    speed_rolling: float = 0.0
    """Share of the speed that is taken from the wheels [-]."""
    speed_offset_m_s: float = 0.0
    speed_loop_s: float = 0.0
    """Of a loop that tracks the speed and its rate, one over its frequency [s/rad]."""
    speed_lag_s: float = 0.0
    speed_hold_s: float = 0.0
    accel_bias_m_s2: float = 0.0
    accel_bias_memory: float = 0.0
    """By which the bias differs after the one direction and the other [-]."""
    accel_period_s: float = 0.0
    """Of a sensor that swings on a soft pad."""
    accel_step_m_s2: float = 0.0
    """In which the acceleration is told, to the nearest."""
    accel_bend_s2_m: float = 0.0
    """What the reading's square adds to it [1/(m/s^2)]."""
    accel_fades_s: float = 0.0
    """In which a sensor that has no steady reading forgets what it read."""
    accel_delay_s: float = 0.0
    accel_pitch: float = 0.0
    """What gravity adds to the reading as the body pitches, after `NODDING_S` [-]."""
    accel_limit_m_s2: float = np.inf
    accel_scale: float = 1.0
    accel_lag_s: float = 0.0
    seed: int = 0
    """For pulse phases, messages and the moments of dropouts."""
