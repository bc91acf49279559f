"""What moves the car, in numbers: all that has a default is neutral there, and leaves the nominal car."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .tyre import MAGIC, THETA_GRID

Array = NDArray[np.floating[Any]]


class Physics(NamedTuple):
    """Everything that moves the car; SI units. Wheel order fl, fr, rl, rr."""

    mass: float
    front_arm: float
    rear_arm: float
    cog_height: float
    radius: float
    inertia: float
    stiffness_drive: float
    stiffness_brake: float
    drag: float
    roll_moment: float
    border: Array
    mu_left: Array
    mu_right: Array
    border_blur: float = 0.0
    springs_share: float = 0.0
    springs_time: float = 1.0
    load_side: float = 0.0
    radius_tilt: float = 0.0
    radius_growth: float = 0.0
    radius_side: float = 0.0
    radius_sides: float = 0.0
    out_of_round: float = 0.0
    stiffness_tilt: float = 0.0
    stiffness_texture: float = 0.0
    factor_left: float = 1.0
    factor_right: float = 1.0
    blotches: Array = np.zeros(0)
    grip_sign: float = 0.0
    grip_axles: float = 0.0
    wet_fall: float = 0.0
    falloff: float = 0.0
    falloff_floor: float = 1.0
    falloff_logarithmic: bool = False
    falloff_wet: float = 0.0
    relaxation: float = 0.0
    relaxation_load: bool = False
    foreign_share: float = 0.0
    foreign_curve: int = MAGIC
    foreign_first: float = 1.45
    foreign_second: float = 0.0
    peak: Array = np.zeros(THETA_GRID.size)
    heating: float = 0.0
    cooling: float = 0.0
    drag_height: float = 0.0
    bend_drag: float = 0.0
    lift: float = 0.0
    gust_drag: float = 0.0
    wind: Array = np.zeros(2)
    roll_force: float = 0.0
    roll_growth: float = 0.0
    roll_linear: float = 0.0
    roll_load: float = 0.0
    roll_warm: float = 0.0
    gravel: float = 0.0
    slush: float = 0.0
    brake_drag: float = 0.0
    brake_share: Array = np.ones(4)
    brake_pulse: float = 0.0
    bearing: float = 0.0
    grade: float = 0.0
    wave_slope: float = 0.0
    wave_length: float = 1.0
    delay: float = 0.0
    message: float = 0.0
    stall: float = 0.0
    lag: float = 0.0
    lag_zero: float = 0.0
    actuator_play: float = 0.0
    slew: float = 0.0
    gain: Array = np.ones(4)
    gain_sway: float = 0.0
    gain_power: float = 0.0
    axle_share: float = 0.0
    axle_split: float = 0.0
    axle_viscous: float = 0.0
    pad_rise: float = 0.0
    regen_fade: float = 1.0
    regen_lost: float = 0.0
    slip_allowed: float = 1.0
    slip_cut: float = 0.0
    dead_band: float = 0.0
    torque_step: float = 0.0
    torque_limit: float = 1e9
    power: float = 0.0
    notch: float = 0.0
    notch_rad_s: float = 1.0
    derating: float = 0.0
    ripple: float = 0.0
    ripple_order: float = 1.0
    shaft_stiffness: float = 1.0
    shaft_damping: float = 0.0
    shaft_axles: float = 0.0
    motor_inertia: float = 0.0
    slosh_share: float = 0.0
    slosh_rate: float = 1.0
