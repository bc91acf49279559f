"""The plant's compiled step: four wheels on modified Dugoff tyres, straight on.

Equations (docs/theory/plant.md has them with their sources):

    I omega' = T - F_x R - c F_z R - T_drag                     Eq. (12) in [1]_, with resistances
    m v'     = sum F_x - k v^2 - c_hub sum F_z - m g sin
    lambda   = abs(omega R - v) / max(omega R, v, floor)        Eq. (13) in [1]_

With relaxation each tyre force is a state that follows its steady value; with a driveline T is a shaft's torque, and
twist and motor speed are states. Both vanish from the step's linear equations by elimination per wheel.

The vehicle drives forward or stands: omega >= 0 and v >= 0. A torque that resists (a brake, rolling resistance)
can bring a wheel to rest and then holds it, it never turns it back; the ground holds a standing car likewise.

All compiled code is in this file, because numba's cache detects changes of a function's own file only. Its order:
tyre, road, wheel and vehicle, driveline, linear equations of the step, integrator, observer.

References
----------
.. [1] Tian et al. (2022), Remote Sensing 14, 5583, doi:10.3390/rs14215583.
.. [2] Bian et al. (2014), SAE 2014-01-0123.
.. [3] Pacejka (2012), Tire and Vehicle Dynamics.
.. [4] Canudas de Wit et al. (2003), Vehicle System Dynamics 39, doi:10.1076/vesd.39.3.189.14152.
.. [5] Gillespie (1992), Fundamentals of Vehicle Dynamics.
.. [6] Kiencke and Nielsen (2005), Automotive Control Systems.
.. [7] Verwer, Spee, Blom, Hundsdorfer (1999), SIAM J. Sci. Comput. 20.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from scenarios.plant.parameters import (
    FORCE,
    MOTOR,
    OF_VEHICLE,
    PER_WHEEL,
    POSITION,
    SPEED,
    STATES,
    TWIST,
    WHEEL,
    DynamicsParameters,
    PerWheel,
    RoadTable,
    Wheels,
)

FLOOR_SPEED_M_S = 0.01
"""Least denominator of slip, which is so 0 at standstill [m/s]."""

TOLERANCE_M_S = 2e-5
"""Accepted error estimate of a sub-step at rest, in wheel rim speed and vehicle speed; docs/theory/plant.md [m/s]."""

RELATIVE_TOLERANCE = 5e-5
"""Growth of the accepted error estimate per vehicle speed, for equal accuracy of slip at all speeds [-]."""

BRAKE_FADE_RAD_S = 0.02
"""Motor speed below which the brake torque falls to 0 at rest; the rim then creeps slower than FLOOR_SPEED_M_S
[rad/s]."""

FOLLOWING = 4.0
"""Factor on both tolerances in `follow`: the error is a fifteenth of the noise of the measurements [-]."""

SHORTEST_STEP_S = 1e-5
"""Length at which a sub-step is accepted with any error estimate [s]."""

ACCELERATION_TOLERANCE_M_S2 = 1e-7
"""Residual of the acceleration under load transfer after which one more Newton correction ends the iteration
[m/s^2]."""

RELEASE_SPEED_M_S = 1.0
"""Speed in the relaxation of a force that still brakes a standing car: a real car would rock back [m/s]."""

LEAST_RELAXATION = 0.1
"""Least share of the relaxation length, where load leaves the tyre or the tyre slides [-]."""

LEAST_STIFFNESS = 0.1
"""Least share of the tyre stiffness where load leaves the tyre; a negative stiffness would push [-]."""

INITIAL_SLOPE = 1.27
"""Slope of the modified Dugoff force by slip at slip 0, over C_x; the constant of its G, docs/theory/plant.md [-]."""

KNEE_AT, CREST_AT, SLIDING_FROM = 0.6, 2.4, 5.0
"""Values x = C_x lambda / (theta F_z) at which `reshaped` has its two bumps and half of its sliding part [-]."""

LEAST_GRIP_N = 1.0
"""Least theta F_z in the denominator of x [N]."""

LEAST_SLOPE = 1e-3
"""Least slope of the force by the lagging slip in the Jacobian, over the mean C_x [-]."""

BORDER_TOLERANCE_M = 1e-7
"""Distance before a road segment's start from which a contact point is on the segment [m]."""

compiled = njit(
    cache=True, error_model="numpy"
)  # divisions by 0 are avoided in the code, not by the compiler
# A call passes all parameters and counts references of every array, which takes as long as the arithmetic.
# LLVM's inlining (forceinline) compiles faster than numba's (inline="always").
inlined = njit(cache=True, error_model="numpy", forceinline=True)

# Rows of `Wheels.work`, which is one array because each array of a call costs time.
_STEADY, _LAG, _SLOPE_WHEEL, _SLOPE_SPEED = range(4)  # the tyre's, filled by `forces`
_GAIN, _BY_WHEEL, _BY_SPEED, _OWN, _SHARE, _MOTOR, _BRAKE = range(4, 11)  # the step's linear equations
_PER_STATE = 11  # force per lagging state: 1 where the force itself lags, C_x or less where the slip does

_GAMMA = 1.0 - 1.0 / np.sqrt(2.0)  # makes the two-stage Rosenbrock method L-stable


@inlined
def falling_shape(theta: float, slip: float) -> tuple[float, float]:
    """Factor G of the modified Dugoff tyre, by which its force is Dugoff's, and the slope of G by slip [-]."""
    square, line = 1.15 - 0.75 * theta, 1.63 - 0.75 * theta
    return square * slip * slip - line * slip + INITIAL_SLOPE, 2.0 * square * slip - line


@inlined
def tyre_force(theta: float, slip: float, load_n: float, stiffness_n: float) -> tuple[float, float, float]:
    """Modified Dugoff force without side slip [2]_, coefficients as in docs/theory/plant.md, and its slopes.

    Parameters
    ----------
    theta, slip : float
        Adhesion, unsigned slip in [0, 1] [-].
    load_n, stiffness_n : float
        Vertical load, C_x [N].

    Returns
    -------
    tuple
        Unsigned force [N], its derivative by slip [N], and by load [-].
    """
    shape, shape_by_slip = falling_shape(theta, slip)
    grip_n = theta * load_n
    if grip_n * (1.0 - slip) >= 2.0 * stiffness_n * slip:  # L >= 1: the whole contact patch adheres
        stretch = slip / (1.0 - slip)
        by_slip = stiffness_n * (shape / (1.0 - slip) ** 2 + stretch * shape_by_slip)
        return stiffness_n * stretch * shape, by_slip, 0.0
    # C_x lambda / (1 - lambda) L = grip / 2, so that lambda = 1 needs no special case.
    adhering = grip_n * (1.0 - slip) / (2.0 * stiffness_n * slip)
    adhering_by_slip = -grip_n / (2.0 * stiffness_n * slip * slip)
    force = grip_n * (1.0 - 0.5 * adhering) * shape
    by_slip = grip_n * ((1.0 - 0.5 * adhering) * shape_by_slip - 0.5 * adhering_by_slip * shape)
    return force, by_slip, theta * (1.0 - adhering) * shape


@inlined
def bump(x: float, at: float) -> tuple[float, float]:
    """A function 4 u^2 / (1 + u^2)^2 of u = x / at, which is 1 at `at` and 0 far from it, and its slope by x [-]."""
    square = (x / at) ** 2
    return 4.0 * square / (1.0 + square) ** 2, 8.0 * x / (at * at) * (1.0 - square) / (1.0 + square) ** 3


# Every further tyre curve has this signature: force and slopes in, force and slopes out.
@inlined
def reshaped(
    tyre: tuple[float, float, float],
    theta: float,
    slip: float,
    load_n: float,
    stiffness_n: float,
    p: DynamicsParameters,
) -> tuple[float, float, float]:
    """A tyre's force and slopes times a function of x = C_x lambda / (theta F_z) that is 1 at slip 0."""
    force, by_slip, by_load = tyre
    grip_n = max(theta * load_n, LEAST_GRIP_N)
    x = stiffness_n * slip / grip_n
    knee, knee_by_x = bump(x, KNEE_AT)
    crest, crest_by_x = bump(x, CREST_AT)
    far = SLIDING_FROM * SLIDING_FROM
    ratio = 1.0 + p.knee * knee + p.crest * crest + p.sliding * x * x / (x * x + far)
    by_x = p.knee * knee_by_x + p.crest * crest_by_x + p.sliding * 2.0 * x * far / (x * x + far) ** 2
    by_slip = by_slip * ratio + force * by_x * stiffness_n / grip_n
    by_load = by_load * ratio - force * by_x * x / max(load_n, LEAST_GRIP_N)
    return force * ratio, by_slip, by_load


@inlined
def peak_force(theta: float, load_n: float, stiffness_n: float) -> tuple[float, float]:
    """The greatest force of the modified Dugoff tyre over all slips [N], and its derivative by load [-].

    Beyond full adhesion it is theta F_z (1 + a / 4 - a / (4 lambda)) shape(lambda) with a = theta F_z / C_x. Where the
    derivative vanishes is a fixed point, whose iteration converges in a few steps because the force is flat there.
    """
    a = theta * load_n / stiffness_n
    # Above theta 2.17 the force does not fall with slip at first, and the bound on slip applies.
    slip = np.sqrt(0.25 * a * INITIAL_SLOPE / max(-falling_shape(theta, 0.0)[1], 1e-3))
    force = by_load = 0.0
    for _ in range(4):
        slip = min(max(slip, a / (2.0 + a)), 0.6)
        shape, shape_by_slip = falling_shape(theta, slip)
        reach = 1.0 + 0.25 * a - 0.25 * a / slip
        force = theta * load_n * reach * shape
        by_load = theta * (2.0 * reach - 1.0) * shape  # where the force is flat, slip may be constant
        slip = np.sqrt(0.25 * a * shape / max(-reach * shape_by_slip, 1e-3))
    return force, by_load


@inlined
def by_formula(
    tyre: tuple[float, float, float],
    theta: float,
    slip: float,
    load_n: float,
    stiffness_n: float,
    p: DynamicsParameters,
) -> tuple[float, float, float]:
    """Weighted mean of a tyre's force, and slopes, with a magic formula of the same initial slope and peak.

    The formula is D sin(C arctan(B lambda - E (B lambda - arctan B lambda))), Eq. (4.49) in [3]_, without its shifts.
    """
    force, by_slip, by_load = tyre
    peak_n, peak_by_load = peak_force(theta, load_n, stiffness_n)
    if peak_n < LEAST_GRIP_N:
        return tyre
    rate = INITIAL_SLOPE * stiffness_n / (p.formula_shape * peak_n)
    x = rate * slip
    bent = x - p.formula_curvature * (x - np.arctan(x))
    angle = p.formula_shape * np.arctan(bent)
    bent_by_x = 1.0 - p.formula_curvature * x * x / (1.0 + x * x)
    other = peak_n * np.sin(angle)
    other_by_slip = peak_n * np.cos(angle) * p.formula_shape / (1.0 + bent * bent) * bent_by_x * rate
    other_by_load = (other - slip * other_by_slip) / peak_n * peak_by_load
    share = p.formula_share
    return (
        force + share * (other - force),
        by_slip + share * (other_by_slip - by_slip),
        by_load + share * (other_by_load - by_load),
    )


@inlined
def _mean_of_wheels(values: PerWheel) -> float:
    """The compiled form of `scenarios.effects.base.mean_of_wheels`."""
    return 0.25 * ((values[0] + values[1]) + (values[2] + values[3]))


@inlined
def steady_tyre(
    theta: float, slip: float, load_n: float, stiffness_n: float, p: DynamicsParameters
) -> tuple[float, float, float]:
    """Steady force of a tyre with the parameters' curve, and its slopes; arguments and units as `tyre_force`."""
    tyre = tyre_force(theta, slip, load_n, stiffness_n)
    if p.knee != 0.0 or p.crest != 0.0 or p.sliding != 0.0:
        tyre = reshaped(tyre, theta, slip, load_n, _mean_of_wheels(p.longitudinal_stiffness_n), p)
    if p.formula_share != 0.0:
        tyre = by_formula(tyre, theta, slip, load_n, stiffness_n, p)
    return tyre


@inlined
def stiffening(load_n: float, more_load: float, p: DynamicsParameters) -> float:
    """Tyre stiffness under a load over the vehicle file's [-]; more_load: the load over the mean static load less 1.

    C_x (1 + by_load (F_z / F_z0 - 1)) or C_x (F_z / F_z0)^exponent; ch. 4 of [3]_.
    """
    share = max(1.0 + p.stiffness_by_load * more_load, LEAST_STIFFNESS)
    if p.stiffness_exponent != 0.0:
        share *= max((load_n / p.reference_load_n) ** p.stiffness_exponent, LEAST_STIFFNESS)
    return share


@inlined
def adhesion_left(sliding_m_s: float, p: DynamicsParameters) -> float:
    """Share of the adhesion at a sliding speed [-]: exponential after [4]_, or hyperbolic."""
    if p.falloff_s_m <= 0.0:
        return 1.0
    fallen = p.falloff_s_m * sliding_m_s
    left = 1.0 / (1.0 + fallen) if p.falloff_hyperbolic > 0.0 else np.exp(-fallen)
    return p.falloff_floor + (1.0 - p.falloff_floor) * left


@inlined
def relaxation_length(
    i: int, more_load: float, slope_n: float, stiffness_n: float, p: DynamicsParameters
) -> float:
    """Relaxation length of the tyre of wheel i [m], ch. 7 of [3]_.

    more_load is the load over the mean static load less 1 [-], slope_n the slope of the steady force by slip [N].
    """
    gone = p.relaxation_by_slope * max(1.0 - slope_n / (INITIAL_SLOPE * stiffness_n), 0.0)
    return p.relaxation_m[i] * max((1.0 + p.relaxation_by_load * more_load) * (1.0 - gone), LEAST_RELAXATION)


@inlined
def segment_at(start_m: NDArray, contact_m: float) -> int:
    """Index of the road segment under a contact point."""
    index = 0
    while index + 1 < start_m.shape[0] and contact_m >= start_m[index + 1] - BORDER_TOLERANCE_M:
        index += 1
    return index


@inlined
def fill_theta(position_m: float, p: DynamicsParameters, road: RoadTable, theta: NDArray) -> float:
    """Fill theta under the wheels; returns the least distance from a contact to the border ahead of it [m]."""
    front_m = position_m + p.cog_to_front_axle_m
    rear_m = position_m - p.cog_to_rear_axle_m
    front = segment_at(road.start_m, front_m)
    rear = segment_at(road.start_m, rear_m)
    theta[0], theta[1] = road.theta[front, 0], road.theta[front, 1]
    theta[2], theta[3] = road.theta[rear, 0], road.theta[rear, 1]
    ahead = np.inf
    if front + 1 < road.start_m.shape[0]:
        ahead = min(ahead, road.start_m[front + 1] - front_m)
    if rear + 1 < road.start_m.shape[0]:
        ahead = min(ahead, road.start_m[rear + 1] - rear_m)
    return ahead


@compiled
def new_wheels() -> tuple[Wheels, Wheels]:
    """Working arrays of the two stages; both read the same theta."""
    theta = np.zeros(4)
    a, free, rates, work = np.zeros((6, 4)), np.ones((2, 5)), np.zeros((2, 16)), np.zeros((2, 12, 4))
    first = Wheels(theta, a[0], a[1], a[2], rates[0], free[0], work[0])
    second = Wheels(theta, a[3], a[4], a[5], rates[1], free[1], work[1])
    return first, second


@inlined
def _relaxes(p: DynamicsParameters) -> bool:
    """Whether tyre forces or slips are states."""
    return p.relaxation_m[0] > 0.0


@compiled
def initial_y(speed_m_s: float, position_m: float, p: DynamicsParameters) -> NDArray:
    """The state of a freely rolling car, shape (18,)."""
    y = np.zeros(STATES)
    y[POSITION], y[SPEED] = position_m, speed_m_s
    for i in range(4):
        y[WHEEL + i] = speed_m_s / p.wheel_radius_m[i]
    if p.motor_inertia_kg_m2 > 0.0:
        y[MOTOR : MOTOR + 4] = y[WHEEL : WHEEL + 4]
    return y


@inlined
def slip_of(rim_m_s: float, speed_m_s: float) -> tuple[float, float]:
    """Unsigned slip of a wheel [-], Eq. (13) in [1]_ with a least denominator, and that denominator [m/s]."""
    reference_m_s = max(rim_m_s, speed_m_s, FLOOR_SPEED_M_S)
    return abs(rim_m_s - speed_m_s) / reference_m_s, reference_m_s


@inlined
def static_loads(p: DynamicsParameters) -> tuple[float, float, float]:
    """Load of a front and of a rear wheel without acceleration [N], and the load transfer per acceleration [kg].

    F_z,front = m (g l_r - a h) / (2 L), F_z,rear = m (g l_f + a h) / (2 L); ch. 1 of [5]_.
    """
    half_base = 0.5 / (p.cog_to_front_axle_m + p.cog_to_rear_axle_m)
    front_n = p.mass_kg * p.gravity_m_s2 * p.cog_to_rear_axle_m * half_base
    rear_n = p.mass_kg * p.gravity_m_s2 * p.cog_to_front_axle_m * half_base
    return front_n, rear_n, p.mass_kg * p.transfer_height_m * half_base


@inlined
def body_resistance(speed_m_s: float, tyres_n: float, p: DynamicsParameters) -> tuple[float, float]:
    """Air drag and rolling resistance on the body [N]; the latter holds a standing car and does not push it back.

    F = 0.5 rho C_d A v^2 + c_hub m g; ch. 4 of [5]_.
    """
    most_n = p.hub_resistance * p.mass_kg * p.gravity_m_s2
    holding_n = min(most_n, max(tyres_n - p.mass_kg * p.slope_m_s2, 0.0))
    return p.drag_kg_m * speed_m_s * speed_m_s, most_n if speed_m_s > 0.0 else holding_n


@inlined
def forces(y: NDArray, accel: float, p: DynamicsParameters, wheels: Wheels) -> float:
    """Fill loads, slips, signed forces and force slopes; returns the accelerometer's reading [m/s^2].

    With load transfer the loads depend on the acceleration, which Newton's method solves for from `accel`.
    """
    speed = max(y[SPEED], 0.0)
    front_n, rear_n, transfer_kg = static_loads(p)
    per_mean = 4.0 / (p.mass_kg * p.gravity_m_s2)
    least_slope_n = LEAST_SLOPE * _mean_of_wheels(p.longitudinal_stiffness_n)
    relaxes = _relaxes(p)
    slip_lags = relaxes and p.slip_lags > 0.0
    for _ in range(8):
        shift_n = transfer_kg * accel
        total_n = 0.0
        total_by_accel = 0.0
        for i in range(4):
            radius_m = p.wheel_radius_m[i]
            rim = max(y[WHEEL + i], 0.0) * radius_m
            slip, scale = slip_of(rim, speed)
            load_n = max(front_n - shift_n, 0.0) if i < 2 else max(rear_n + shift_n, 0.0)
            more_load = load_n * per_mean - 1.0
            theta = wheels.theta[i] * adhesion_left(abs(rim - speed), p)
            acting = slip if rim >= speed else -slip
            if slip_lags:
                wheels.work[_STEADY, i] = acting
                acting = min(max(y[FORCE + i], -1.0), 1.0)
            stiffness_n = p.longitudinal_stiffness_n[i] * stiffening(load_n, more_load, p)
            force, by_slip, by_load = steady_tyre(theta, abs(acting), load_n, stiffness_n, p)
            force, by_load = np.copysign(force, acting), np.copysign(by_load, acting)
            # The falling branch is not in the Jacobian: it is not stiff, and the method keeps its order.
            slope = max(by_slip, 0.0)
            if relaxes:
                releases = speed <= 0.0 and y[FORCE + i] < 0.0
                length_m = relaxation_length(i, more_load, slope, stiffness_n, p)
                wheels.work[_LAG, i] = (max(scale, RELEASE_SPEED_M_S) if releases else scale) / length_m
                wheels.work[_PER_STATE, i] = 1.0
            if slip_lags:
                slope = wheels.work[_PER_STATE, i] = max(slope, least_slope_n)
            if relaxes and not slip_lags:
                wheels.work[_STEADY, i] = force
                wheels.force_n[i] = y[FORCE + i]
            else:
                wheels.force_n[i] = force
                total_by_accel += by_load * (-transfer_kg if i < 2 else transfer_kg)
            total_n += wheels.force_n[i]
            wheels.load_n[i] = load_n
            wheels.slip[i] = slip
            slope /= scale
            wheels.work[_SLOPE_WHEEL, i] = slope * radius_m * (speed / rim if rim == scale else 1.0)
            wheels.work[_SLOPE_SPEED, i] = -slope * (rim / speed if speed == scale else 1.0)
        drag_n, hub_n = body_resistance(speed, total_n, p)
        error = (total_n - drag_n - hub_n) / p.mass_kg - accel
        accel += error / (1.0 - total_by_accel / p.mass_kg)
        if p.transfer_height_m == 0.0 or abs(error) < ACCELERATION_TOLERANCE_M_S2:
            break
    # The ground holds a standing car that would roll back.
    return max(accel, p.slope_m_s2) if speed <= 0.0 else accel


@inlined
def refresh(y: NDArray, accel: float, p: DynamicsParameters, road: RoadTable, first: Wheels) -> float:
    """Update `first` after y was changed outside of `advance`; returns the accelerometer's reading [m/s^2]."""
    fill_theta(y[POSITION], p, road, first.theta)
    return forces(y, accel, p, first)


@inlined
def _wheel_rate(i: int, speed_rad_s: float, torque_nm: float, p: DynamicsParameters, wheels: Wheels) -> float:
    """Acceleration of a wheel [rad/s^2], Eq. (12) in [1]_ with resistances; they hold a wheel at rest."""
    resistance_n = wheels.force_n[i] + p.rolling_coefficient[i] * wheels.load_n[i]
    inertia = p.wheel_inertia_kg_m2[i] - p.motor_inertia_kg_m2
    rate = (torque_nm - resistance_n * p.lever_m[i] - p.drag_torque_nm[i]) / inertia
    return 0.0 if speed_rad_s <= 0.0 and rate <= 0.0 else rate


@inlined
def _motor_torque(speed_rad_s: float, torque_nm: float) -> tuple[float, float]:
    """Torque on a motor [N m], and its decrease per motor speed [N m s/rad].

    A negative torque is a brake, which opposes the motor's motion. Within BRAKE_FADE_RAD_S of rest it acts like a
    damper: a brake that reverses at rest would chatter.
    """
    if torque_nm >= 0.0 or speed_rad_s >= BRAKE_FADE_RAD_S:
        return torque_nm, 0.0
    if speed_rad_s <= -BRAKE_FADE_RAD_S:
        return -torque_nm, 0.0
    return torque_nm * speed_rad_s / BRAKE_FADE_RAD_S, -torque_nm / BRAKE_FADE_RAD_S


@inlined
def _fill_rates(
    y: NDArray, torque_nm: NDArray, next_nm: NDArray, part: float, p: DynamicsParameters, wheels: Wheels
) -> None:
    """Fill the rates of y from the wheel speeds on, and the flags of free motion, at a part of the output step."""
    total_n = 0.0
    for i in range(4):
        torque = torque_nm[i] + (next_nm[i] - torque_nm[i]) * part
        if p.motor_inertia_kg_m2 > 0.0:
            speed_difference = y[MOTOR + i] - y[WHEEL + i]
            shaft_nm = (
                p.shaft_stiffness_nm_rad[i] * y[TWIST + i] + p.shaft_damping_nm_s_rad * speed_difference
            )
            motor_nm, wheels.work[_BRAKE, i] = _motor_torque(y[MOTOR + i], torque)
            wheels.rates[TWIST - WHEEL + i] = speed_difference
            wheels.rates[MOTOR - WHEEL + i] = (motor_nm - shaft_nm) / p.motor_inertia_kg_m2
            torque = shaft_nm
        rate = _wheel_rate(i, y[WHEEL + i], torque, p, wheels)
        wheels.free[i] = 0.0 if y[WHEEL + i] <= 0.0 and rate == 0.0 else 1.0
        wheels.rates[i] = rate
        if _relaxes(p):
            behind = wheels.work[_STEADY, i] - y[FORCE + i]
            wheels.rates[FORCE - WHEEL + i] = wheels.work[_LAG, i] * behind
        total_n += wheels.force_n[i]
    held_n = p.mass_kg * (p.slope_m_s2 + p.hub_resistance * p.gravity_m_s2)
    wheels.free[4] = 0.0 if y[SPEED] <= 0.0 and total_n < held_n else 1.0


@inlined
def _shaft(i: int, gh: float, p: DynamicsParameters) -> tuple[float, float]:
    """Torque of a shaft [6]_ within gh [s] per speed difference: by its twist, and with damping [N m s/rad]."""
    stiffness = gh * p.shaft_stiffness_nm_rad[i]
    return stiffness, gh * (stiffness + p.shaft_damping_nm_s_rad)


@inlined
def _factor(speed: float, h: float, p: DynamicsParameters, wheels: Wheels) -> float:
    """Eliminate all wheels from 1 - gamma h A; fills the pivots, returns that of the vehicle speed.

    A couples each wheel with the vehicle's speed alone. Within a wheel, shaft and motor act as inertia, and a lagging
    force as a smaller slope of the force.
    """
    gh = _GAMMA * h
    pivot = 1.0 + gh * 2.0 * p.drag_kg_m * speed / p.mass_kg
    at = wheels.work
    for i in range(4):
        inertia = p.wheel_inertia_kg_m2[i]
        if p.motor_inertia_kg_m2 > 0.0:
            _, shaft = _shaft(i, gh, p)
            motor = at[_MOTOR, i] = p.motor_inertia_kg_m2 + gh * at[_BRAKE, i]
            inertia = inertia - p.motor_inertia_kg_m2 + motor / (motor + shaft) * shaft
        lagged = gh * wheels.work[_LAG, i]
        share = lagged / (1.0 + lagged) if _relaxes(p) else 1.0
        at[_BY_WHEEL, i] = wheels.work[_SLOPE_WHEEL, i] * share
        at[_BY_SPEED, i] = wheels.work[_SLOPE_SPEED, i] * share
        at[_GAIN, i] = gh * (p.lever_m[i] / inertia) * wheels.free[i]
        at[_OWN, i] = 1.0 + at[_GAIN, i] * at[_BY_WHEEL, i]
        at[_SHARE, i] = gh * at[_BY_WHEEL, i] / (p.mass_kg * at[_OWN, i])
        pivot -= (gh / p.mass_kg - at[_SHARE, i] * at[_GAIN, i]) * at[_BY_SPEED, i]
    return pivot


@inlined
def _solve(
    speed_rhs: float, pivot: float, h: float, p: DynamicsParameters, wheels: Wheels, k: NDArray
) -> float:
    """Solve (1 - gamma h A) k = right-hand side, in place for the wheels; returns the part of the vehicle speed."""
    gh = _GAMMA * h
    at = wheels.work
    has_shaft = p.motor_inertia_kg_m2 > 0.0
    rhs = speed_rhs
    for i in range(4):
        stiffness, shaft = _shaft(i, gh, p)
        inertia = p.wheel_inertia_kg_m2[i] - p.motor_inertia_kg_m2
        if has_shaft:
            k[MOTOR - WHEEL + i] *= p.motor_inertia_kg_m2 / at[_MOTOR, i]
        if has_shaft and wheels.free[i] > 0.0:
            passed = stiffness * k[TWIST - WHEEL + i] + shaft * k[MOTOR - WHEEL + i]
            share = at[_MOTOR, i] / (at[_MOTOR, i] + shaft)
            k[i] = (inertia * k[i] + share * passed) / (inertia + share * shaft)
        if _relaxes(p):
            k[FORCE - WHEEL + i] /= 1.0 + gh * wheels.work[_LAG, i]
            lagging_n = at[_PER_STATE, i] * k[FORCE - WHEEL + i]
            k[i] -= at[_GAIN, i] * lagging_n
            rhs += gh / p.mass_kg * lagging_n
        rhs += at[_SHARE, i] * k[i]
    k_speed = rhs / pivot if wheels.free[4] > 0.0 else speed_rhs
    for i in range(4):
        stiffness, shaft = _shaft(i, gh, p)
        k[i] = (k[i] - at[_GAIN, i] * at[_BY_SPEED, i] * k_speed) / at[_OWN, i]
        if _relaxes(p):
            k[FORCE - WHEEL + i] += (at[_BY_WHEEL, i] * k[i] + at[_BY_SPEED, i] * k_speed) / at[_PER_STATE, i]
        if has_shaft:
            pull = shaft * k[i] - stiffness * k[TWIST - WHEEL + i]
            motor = at[_MOTOR, i]
            k[MOTOR - WHEEL + i] = (motor * k[MOTOR - WHEEL + i] + pull) / (motor + shaft)
            k[TWIST - WHEEL + i] += gh * (k[MOTOR - WHEEL + i] - k[i])
    return k_speed


@inlined
def _states(p: DynamicsParameters) -> int:
    """Number of used entries of y."""
    return STATES if _relaxes(p) or p.motor_inertia_kg_m2 > 0.0 else FORCE


@inlined
def _try_step(
    y: NDArray,
    trial: NDArray,
    torque_nm: NDArray,
    next_torque_nm: NDArray,
    begin: float,
    end: float,
    h: float,
    accel: float,
    p: DynamicsParameters,
    first: Wheels,
    second: Wheels,
) -> tuple[float, float]:
    """Take a two-stage Rosenbrock step, ROS2 of [7]_, from y to trial; returns error estimate [m/s], accelerometer."""
    count = _states(p) - WHEEL
    k_1, k_2 = first.rates, second.rates
    _fill_rates(y, torque_nm, next_torque_nm, begin, p, first)
    pivot = _factor(y[SPEED], h, p, first)
    speed_1 = _solve(accel - p.slope_m_s2 if first.free[4] > 0.0 else 0.0, pivot, h, p, first, k_1)
    trial[SPEED] = y[SPEED] + h * speed_1
    for j in range(count):
        trial[WHEEL + j] = y[WHEEL + j] + h * k_1[j]
    accel = forces(trial, accel, p, second)
    _fill_rates(trial, torque_nm, next_torque_nm, end, p, second)
    for j in range(count):
        k_2[j] -= 2.0 * k_1[j]
    speed_2 = _solve(accel - p.slope_m_s2 - 2.0 * speed_1, pivot, h, p, first, k_2)
    error = abs(speed_1 + speed_2)
    for j in range(count):
        trial[WHEEL + j] = y[WHEEL + j] + h * (1.5 * k_1[j] + 0.5 * k_2[j])
    radius_m = _mean_of_wheels(p.wheel_radius_m)
    trial[SPEED] = max(y[SPEED] + h * (1.5 * speed_1 + 0.5 * speed_2), 0.0)
    for i in range(4):
        error = max(error, radius_m * abs(k_1[i] + k_2[i]))
        trial[WHEEL + i] = max(trial[WHEEL + i], 0.0)
        if p.motor_inertia_kg_m2 > 0.0:
            motor = MOTOR - WHEEL + i
            error = max(error, radius_m * abs(k_1[motor] + k_2[motor]))
    trial[POSITION] = y[POSITION] + 0.5 * h * (y[SPEED] + trial[SPEED])
    return 0.5 * h * error, accel


@inlined
def advance(
    y: NDArray,
    trial: NDArray,
    torque_nm: NDArray,
    next_torque_nm: NDArray,
    step_s: float,
    accel: float,
    p: DynamicsParameters,
    road: RoadTable,
    first: Wheels,
    second: Wheels,
    h: float,
    looser: float,
) -> tuple[float, float]:
    """Advance y over one output step with torque linear between its ends; returns the accelerometer [m/s^2].

    `first` must hold the forces at y, and does so again at the end. Sub-steps end at every road border that a wheel
    crosses and shrink until their error estimate is accepted, from a first one of h [s] and with tolerances `looser`
    than the plant's own by that factor. Also returns the first accepted sub-step [s].
    """
    count = _states(p)
    at_s = 0.0
    held_s = 0.0
    ahead_m = fill_theta(y[POSITION], p, road, first.theta)
    while step_s - at_s > 1e-9 * step_s:
        h = min(h, step_s - at_s)
        if y[SPEED] * h > ahead_m:
            h = ahead_m / y[SPEED]
        begin, end = at_s / step_s, (at_s + h) / step_s
        error, new_accel = _try_step(
            y, trial, torque_nm, next_torque_nm, begin, end, h, accel, p, first, second
        )
        tolerance = looser * (TOLERANCE_M_S + RELATIVE_TOLERANCE * y[SPEED])
        if error > tolerance and h > SHORTEST_STEP_S:
            h = max(h * max(0.9 * np.sqrt(tolerance / error), 0.1), SHORTEST_STEP_S)
            continue
        for j in range(count):
            y[j] = trial[j]
        held_s = h if at_s == 0.0 else held_s
        at_s += h
        h *= min(0.9 * np.sqrt(tolerance / max(error, 1e-3 * tolerance)), 10.0)
        ahead_m = fill_theta(y[POSITION], p, road, first.theta)
        accel = forces(y, new_accel, p, first)
    return accel, held_s


@compiled
def run(
    y: NDArray,
    torque_nm: NDArray,
    step_s: float,
    p: DynamicsParameters,
    road: RoadTable,
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Simulate all rows from y, which becomes the last row's state.

    Returns
    -------
    tuple
        States (n, 6), or (n, 18) where forces or motors are states, accelerometer (n,) [m/s^2], and slip [-], tyre
        force [N], load [N], theta [-] (n, 4).
    """
    n = torque_nm.shape[0]
    count = _states(p)
    states, accels = np.empty((n, count)), np.empty(n)
    slip, force_n, load_n, theta = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4))
    first, second = new_wheels()
    trial = np.empty(STATES)
    accel = refresh(y, 0.0, p, road, first)
    for k in range(n):
        accels[k] = accel
        states[k] = y[:count]
        slip[k], force_n[k] = first.slip, first.force_n
        load_n[k], theta[k] = first.load_n, first.theta
        if k + 1 < n:
            torque, next_torque = torque_nm[k], torque_nm[k + 1]
            accel, _ = advance(
                y, trial, torque, next_torque, step_s, accel, p, road, first, second, step_s, 1.0
            )
    return states, accels, slip, force_n, load_n, theta


@compiled
def between(ends: NDArray, shares: NDArray) -> NDArray:
    """The first row of `ends` plus each share of the difference from it to each further row, in their unit."""
    values = ends[0].copy()
    for j in range(shares.shape[0]):
        values += shares[j] * (ends[j + 1] - ends[0])
    return values


@inlined
def _four(values: NDArray, field: int) -> PerWheel:
    """The values of a field that is per wheel, in a row of `DynamicsParameters.as_row`."""
    at = 4 * field
    return values[at], values[at + 1], values[at + 2], values[at + 3]


@compiled
def _car_between(ends: NDArray, shares: NDArray) -> DynamicsParameters:
    """The parameters between rows of `DynamicsParameters.as_row`, as `between` has them."""
    v = between(ends, shares)
    # to_fixed_tuple is numba's intrinsic, whose first argument its compiler gives.
    others: Any = to_fixed_tuple(v[4 * PER_WHEEL :], OF_VEHICLE)  # type: ignore[call-arg]
    return DynamicsParameters(
        _four(v, 0),
        _four(v, 1),
        _four(v, 2),
        _four(v, 3),
        _four(v, 4),
        _four(v, 5),
        _four(v, 6),
        _four(v, 7),
        *others,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def follow(
    y: NDArray,
    torque_nm: NDArray,
    push_m_s2: NDArray,
    measured: NDArray,
    memory_s: NDArray,
    step_s: float,
    ends: NDArray,
    start_m: NDArray,
    thetas: NDArray,
    shares: NDArray,
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Simulate all rows from y with position, speed and wheel speeds corrected towards measurements; see `run`.

    Parameters
    ----------
    y : array, shape (18,)
        State at the first row; ends as the last row's.
    torque_nm : array, shape (n, 4)
        Torque at the wheels, linear between the rows [N m].
    push_m_s2 : array, shape (n,)
        Further acceleration of the vehicle [m/s^2].
    measured : array, shape (n, 6)
        Position, speed and wheel speeds; NaN where there is none.
    memory_s : array, shape (6,)
        Time constant of the correction of a state [s]; the first rows are averaged instead.
    step_s : float
        Time between the rows [s].
    ends : array, shape (1 + m, VALUES)
        The car as `DynamicsParameters.as_row`, and m other cars.
    start_m, thetas : array, shape (segments,), (1 + m, segments, 2)
        Roads of the same segments, likewise.
    shares : array, shape (n, m)
        Share of the difference to each other car, row by row [-].

    Returns
    -------
    tuple
        As `run`, each row before the correction by its own measurement; states (n, 6).
    """
    n = torque_nm.shape[0]
    states, accels = np.empty((n, 6)), np.empty(n)
    slip, force_n, load_n, theta = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4))
    first, second = new_wheels()
    trial = np.empty_like(y)
    road = RoadTable(start_m, between(thetas, shares[0]))
    p = _car_between(ends, shares[0])
    accel = refresh(y, 0.0, p, road, first)
    held_s = step_s
    drawn = 1.0 - np.exp(-step_s / memory_s)
    for k in range(n):
        accels[k] = accel
        for j in range(6):
            states[k, j] = y[j]
        for i in range(4):  # element by element: array copies take a tenth of all time
            slip[k, i], force_n[k, i] = first.slip[i], first.force_n[i]
            load_n[k, i], theta[k, i] = first.load_n[i], first.theta[i]
        if k + 1 == n:
            break
        for j in range(6):
            if np.isfinite(measured[k, j]):
                share = max(drawn[j], 1.0 / (k + 5.0))
                y[j] += share * (measured[k, j] - y[j])
        y[SPEED] += push_m_s2[k] * step_s
        for j in range(SPEED, FORCE):
            y[j] = max(y[j], 0.0)
        if shares.shape[1] > 0:
            p = _car_between(ends, shares[k])
            road.theta[:] = between(thetas, shares[k])
        accel = refresh(y, accel, p, road, first)
        torque, next_torque = torque_nm[k], torque_nm[k + 1]
        accel, held_s = advance(
            y, trial, torque, next_torque, step_s, accel, p, road, first, second, 2.0 * held_s, FOLLOWING
        )
    return states, accels, slip, force_n, load_n, theta
