"""What goes into the plant's compiled step, and what it works on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trpac_core.vehicle import GRAVITY_M_S2

POSITION, SPEED, WHEEL, FORCE, TWIST, MOTOR, STATES = 0, 1, 2, 6, 10, 14, 18
"""Where the state vector y holds what: position [m], vehicle speed [m/s], and four each of wheel speed [rad/s], tyre
force [N] or lagging slip [-] (with relaxation), shaft twist [rad] and motor speed [rad/s] (with a driveline); unused
ones stay as they are."""


class DynamicsParameters(NamedTuple):
    """Everything that the dynamics stage depends on; effects replace fields."""

    mass_kg: float
    cog_to_front_axle_m: float
    cog_to_rear_axle_m: float
    wheel_radius_m: float
    wheel_inertia_kg_m2: float
    longitudinal_stiffness_n: float
    transfer_height_m: float = 0.0
    """Height through which acceleration moves load between the axles; 0: static loads [m]."""
    drag_kg_m: float = 0.0
    """Air drag per squared speed, 0.5 rho C_d A [kg/m]."""
    rolling_coefficient: float = 0.0
    """Rolling resistance moment per load and radius [-]."""
    hub_resistance: float = 0.0
    """Rolling resistance as a force on the body per load [-]."""
    drag_torque_nm: float = 0.0
    """Torque against each wheel's rotation [N m]."""
    slope_m_s2: float = 0.0
    """Gravity's part along the road, positive uphill [m/s^2]."""
    gravity_m_s2: float = GRAVITY_M_S2
    """Gravity's part across the road, which loads the wheels [m/s^2]."""
    falloff_s_m: float = 0.0
    """Rate at which adhesion falls with sliding speed; 0: it does not [s/m]."""
    falloff_floor: float = 1.0
    """Share of the adhesion that is left at high sliding speed [-]."""
    falloff_hyperbolic: float = 0.0
    """1: the fall is a hyperbola of the sliding speed, else exponential [-]."""
    knee: float = 0.0
    """By how much the tyre's force is off where adhesion begins to give way to sliding [-]."""
    crest: float = 0.0
    """By how much the tyre's force is off near its maximum [-]."""
    sliding: float = 0.0
    """By how much the tyre's force is off where it slides all over [-]."""
    formula_share: float = 0.0
    """How far the tyre's curve is from the modified Dugoff one to a magic formula of the same slope and peak [-]."""
    formula_shape: float = 1.4
    """That formula's shape factor C [-]."""
    formula_curvature: float = 0.0
    """That formula's curvature factor E [-]."""
    relaxation_m: float = 0.0
    """Way over which the tyre force follows its steady value; 0: at once [m]."""
    relaxation_by_load: float = 0.0
    """By which that way grows with a wheel's load, in shares of it over the mean static load: 1 in proportion [-]."""
    relaxation_by_slope: float = 0.0
    """Share of that way that shrinks as the force's slope by slip does; 1: all of it [-]."""
    axle_relaxation_m: float = 0.0
    """What that way is longer on the front wheels, and shorter on the rear ones [m]."""
    front_side_relaxation_m: float = 0.0
    """What it is longer beside that on the front left wheel, and shorter on the front right one [m]."""
    rear_side_relaxation_m: float = 0.0
    """The same of the rear wheels [m]."""
    slip_lags: float = 0.0
    """1: over that way it is the slip that follows, and the force is the steady one of the lagging slip [-]."""
    shaft_stiffness_nm_rad: float = 1e4
    shaft_damping_nm_s_rad: float = 0.0
    axle_inertia_kg_m2: float = 0.0
    """What the front wheels' inertia has more than wheel_inertia_kg_m2, and the rear wheels' less [kg m^2]."""
    axle_drag_torque_nm: float = 0.0
    """Likewise beside drag_torque_nm [N m]."""
    axle_rolling_coefficient: float = 0.0
    """Likewise beside rolling_coefficient [-]."""
    axle_shaft_stiffness_nm_rad: float = 0.0
    """Likewise beside shaft_stiffness_nm_rad [N m/rad]."""
    front_side_shaft_stiffness_nm_rad: float = 0.0
    """What the front left shaft's stiffness has more beside it, and the front right one's less [N m/rad]."""
    rear_side_shaft_stiffness_nm_rad: float = 0.0
    """The same of the rear shafts [N m/rad]."""
    axle_stiffness_n: float = 0.0
    """Likewise beside longitudinal_stiffness_n [N]."""
    front_side_stiffness_n: float = 0.0
    """What the front left tyre's stiffness has more beside it, and the front right one's less [N]."""
    rear_side_stiffness_n: float = 0.0
    """The same of the rear tyres [N]."""
    stiffness_by_load: float = 0.0
    """By which stiffness grows with a wheel's load, as relaxation_by_load does [-]."""
    lever_more_m: float = 0.0
    """What the forces' lever about the axle has more than the rolling radius [m]."""
    axle_radius_m: float = 0.0
    """What the front wheels' rolling radius has more than wheel_radius_m, and the rear wheels' less [m]."""
    front_side_radius_m: float = 0.0
    """What the front left wheel's rolling radius has more beside it, and the front right wheel's less [m]."""
    rear_side_radius_m: float = 0.0
    """The same of the rear wheels [m]."""
    motor_inertia_kg_m2: float = 0.0
    """The part of wheel_inertia_kg_m2 that turns with the motor, behind the shaft; 0: no shaft [kg m^2]."""


class RoadTable(NamedTuple):
    """The road as the compiled step reads it; the first segment also holds before its start."""

    start_m: NDArray[np.float64]
    theta: NDArray[np.float64]
    """Friction under the left and the right wheels, shape (segments, 2) [-]."""


class Wheels(NamedTuple):
    """Working arrays of one evaluation, shape (4,) each unless said; theta is input, the others are filled."""

    theta: NDArray[np.float64]
    force_n: NDArray[np.float64]
    """What the tyre does; with relaxation it lags behind its steady value."""
    load_n: NDArray[np.float64]
    slip: NDArray[np.float64]
    rates: NDArray[np.float64]
    """Of y from the wheel speeds on, shape (16,)."""
    free: NDArray[np.float64]
    """0 for what is held at rest, else 1: four wheels and the vehicle, shape (5,)."""
    work: NDArray[np.float64]
    """What only the step itself needs, shape (12, 4); dynamics.py names the rows."""
