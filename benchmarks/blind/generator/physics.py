"""What moves the car, in numbers: each has a neutral value that leaves the nominal car."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]


class Physics(NamedTuple):
    """Everything that moves the car; SI units. Wheel order fl, fr, rl, rr."""

    mass: float
    front_arm: float
    rear_arm: float
    cog_height: float
    pitch_time: float
    springs_share: float
    springs_time: float
    springs_tilt: float
    body_rate: float
    radius: float
    radius_tilt: float
    radius_growth: float
    lever: float
    inertia: float
    inertia_tilt: float
    stiffness_drive: float
    stiffness_brake: float
    stiffness_load: float
    stiffness_tilt: float
    factor_left: float
    factor_right: float
    patch_depth: float
    stretch_depth: float
    wet_fall: float
    falloff: float
    falloff_floor: float
    falloff_curve: int
    falloff_time: float
    relaxation: float
    relaxation_load: bool
    relaxation_shrinks: bool
    relaxation_speed: float
    force_relaxation: float
    foreign_share: float
    foreign_curve: int
    foreign_first: float
    foreign_second: float
    peak: Array
    heating: float
    cooling: float
    drag: float
    drag_height: float
    fanning: float
    lift: float
    gust_drag: float
    wind: Array
    roll_force: float
    roll_moment: float
    roll_growth: float
    roll_linear: float
    roll_wet: float
    brake_drag: float
    brake_share: Array
    brake_pulse: float
    bearing: float
    grade: float
    wave_slope: float
    wave_length: float
    profile: Array
    delay: float
    message: float
    message_joined: bool
    beat: float
    wait: float
    lag: float
    lag_first: float
    lag_sign: float
    lag_damping: float
    slew: float
    gain: Array
    gain_sign: float
    gain_speed: float
    pad_rise: float
    slip_allowed: float
    slip_cut: float
    dead_band: float
    torque_limit: float
    power: float
    derating: float
    ripple: float
    ripple_order: float
    shaft_stiffness: float
    shaft_damping: float
    shaft_play: float
    shaft_tilt: float
    motor_inertia: float
    slosh_share: float
    slosh_rate: float
    border: Array
    mu_left: Array
    mu_right: Array
