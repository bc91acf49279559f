"""The sensors of a car, and what each does to its signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sensors:
    """What the sensors do; the defaults are ideal ones.

    A late signal may be one that is averaged or held: `*_average_s` is the time that a reading is the mean of,
    `*_message_s` the time from one message to the next, `*_joined` says that straight lines join the messages, and
    `*_beat_s` is by how much the age differs over a beat of two clocks, `*_wait_s` by how much it differs from one
    message to the next, `*_filter_s` is the part of it that a low pass takes, and `*_lost` the share of messages in
    whose place the one before stands. Its mean age stays the delay.
    """

    wheel_delay_s: float = 0.0
    wheel_average_s: float = 0.0
    wheel_message_s: float = 0.0
    wheel_joined: bool = False
    wheel_beat_s: float = 0.0
    wheel_wait_s: float = 0.0
    wheel_filter_s: float = 0.0
    wheel_filter_twice: bool = False
    """The low pass comes twice."""
    wheel_median_s: float = 0.0
    """Time whose middle value a reading is."""
    wheel_lost: float = 0.0
    wheel_turn_s: float = 0.0
    """By how much the last wheel's reading is older than on average, and the first one's younger."""
    wheel_axles_s: float = 0.0
    """By how much the rear wheels' readings are older than on average, and the front ones' younger."""
    wheel_paced_s: float = 0.0
    """Part of the delay that goes with the time of a pulse, at the usual speed."""
    wheel_queue_s: float = 0.0
    """By which a reading is older while a gateway's queue holds one more, and younger else."""
    wheel_at_motor: bool = False
    """The speeds are those of the motors' shafts."""
    wheel_hold_s: float = 0.0
    wheel_teeth: float = 0.0
    wheel_window_s: float = 0.0
    wheel_window_runs: bool = False
    """The window ends at the row, instead of one after the other."""
    wheel_window_shared: bool = False
    """All wheels are counted over the same windows."""
    wheel_window_parts: float = 1
    """How many windows overlap: a new one ends that often in the time of one. A half: every second one is told."""
    wheel_window_slow: float = 0.0
    """Share of the usual pulses of a window, below which those of the window before count too."""
    wheel_halves_rad_s: float = 0.0
    """Speed above which the sensor hands on every second pulse only, to spare who counts them."""
    wheel_flanks: float = 0.0
    """By which every second flank comes late [teeth]."""
    wheel_window_jitter: float = 0.0
    """By how much a window ends sooner at most, the next one beginning there [windows]."""
    wheel_scatter: float = 0.0
    """Standard deviation of the teeth's places, each with its own error [teeth]."""
    wheel_shakes: float = 0.0
    """By how much the sensor moves along the teeth as the wheel hops [teeth]."""
    wheel_uneven: float = 0.0
    """How far the teeth lie off their places, over a turn [teeth]."""
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
    speed_average_s: float = 0.0
    speed_average_twice: bool = False
    """The mean is of means over the same time."""
    speed_message_s: float = 0.0
    speed_joined: bool = False
    speed_extrapolated: bool = False
    """From each message on the speed goes straight on as from the last one to it."""
    speed_fitted_s: float = 0.0
    """Time of whose places the speed is a line's slope."""
    speed_beat_s: float = 0.0
    speed_wait_s: float = 0.0
    speed_filter_s: float = 0.0
    speed_lost: float = 0.0
    speed_paced_s: float = 0.0
    """Part of the delay that goes with the time for a distance, at the usual speed."""
    speed_ahead_s: float = 0.0
    """What the speed is predicted over, though it is not late."""
    speed_clock: float = 0.0
    """Share by which the speed sensor's clock is slow: its signal is ever later [-]."""
    speed_scale: float = 1.0
    speed_sway: float = 0.0
    """By which the scale's deviation differs over `SWAY_S` [-]."""
    speed_scale_growth: float = 0.0
    """By which the scale's deviation differs at double `USUAL_M_S` [-]."""
    speed_scale_pitch: float = 0.0
    """By which it differs with the body's pitch, where the car accelerates [1/(m/s^2)]."""
    speed_scale_grain: float = 0.0
    """By which it differs on a coarse road's stretches [-]."""
    speed_scale_warming: float = 0.0
    """By which it differs before and after the sensor is warm, over `WARM_S` [-]."""
    speed_scale_jumps: float = 0.0
    """By which it differs from one lock to the next [-]."""
    speed_scale_wander: float = 0.0
    """By which it differs over `SLOW_S` [-]."""
    speed_scale_table: float = 0.0
    """By which it differs between a calibration's points, `TABLE_M_S` apart [-]."""
    speed_scale_mount: float = 0.0
    """By which it differs where the sensor's bracket shakes, at about `MOUNT_M_S` [-]."""
    speed_scale_waves: float = 0.0
    """By which it differs over a road's long waves, `WAVES_M` each [-]."""
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
    accel_warming: float = 0.0
    """By which the bias differs before and after the sensor is warm, over `WARM_S` [-]."""
    accel_bias_growth: float = 0.0
    """By which the bias differs at double `USUAL_M_S` [-]."""
    accel_wander: float = 0.0
    """By which the bias differs over `SLOW_S` [-]."""
    accel_bias_grain: float = 0.0
    """By which the bias differs on a coarse road's stretches [-]."""
    accel_bias_memory: float = 0.0
    """By which the bias differs after the one direction and the other [-]."""
    accel_bias_aired: float = 0.0
    """By which the bias is less at double `USUAL_M_S`, after `AIRED_S` [-]."""
    accel_bias_jumps: float = 0.0
    """By which the bias differs from one level to the other [-]."""
    accel_bias_fan: float = 0.0
    """By which the bias differs as a fan warms and cools the sensor's box in turn [-]."""
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
