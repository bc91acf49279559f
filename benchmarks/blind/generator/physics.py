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
    pitch_sign: float
    body_rate: float
    radius: float
    radius_tilt: float
    radius_growth: float
    radius_side: float
    radius_sides: float
    out_of_round: float
    lever: float
    inertia: float
    inertia_tilt: float
    inertia_side: float
    stiffness_drive: float
    stiffness_brake: float
    stiffness_load: float
    stiffness_tilt: float
    stiffness_side: float
    stiffness_warm: float
    stiffness_speed: float
    factor_left: float
    factor_right: float
    patch_depth: float
    stretch_depth: float
    blotches: Array
    grip_tilt: float
    grip_speed: float
    wet_fall: float
    falloff: float
    falloff_floor: float
    falloff_curve: int
    falloff_time: float
    relaxation: float
    relaxation_load: bool
    relaxation_shrinks: bool
    relaxation_speed: float
    relaxation_tilt: float
    relaxation_direct: float
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
    drag_fast: float
    drag_cross: float
    lift: float
    gust_drag: float
    wind: Array
    roll_force: float
    roll_moment: float
    roll_growth: float
    roll_linear: float
    roll_wet: float
    roll_texture: float
    roll_tilt: float
    roll_side: float
    roll_load: float
    slush: float
    brake_drag: float
    brake_share: Array
    brake_pulse: float
    brake_release: float
    bearing: float
    grade: float
    wave_slope: float
    wave_length: float
    profile: Array
    delay: float
    delay_tilt: float
    delay_sign: float
    message: float
    message_joined: bool
    message_lost: float
    beat: float
    wait: float
    stall: float
    lag: float
    lag_first: float
    lag_sign: float
    lag_damping: float
    lag_tilt: float
    lag_side: float
    lag_rise: float
    lag_speed: float
    actuator_play: float
    slew: float
    gain: Array
    gain_sign: float
    gain_speed: float
    gain_load: float
    gain_warm: float
    axle_share: float
    pad_rise: float
    regen_fade: float
    regen_lost: float
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
    shaft_axles: float
    shaft_friction: float
    shaft_rise: float
    motor_inertia: float
    slosh_share: float
    slosh_rate: float
    border: Array
    mu_left: Array
    mu_right: Array
