"""The plant's compiled step: four wheels on modified Dugoff tyres, straight on.

Equations (docs/plant.md has them with their sources):

    I omega' = T - F_x R - c F_z R          Eq. (12) of [1]_, with the rolling resistance's moment
    m v'     = sum F_x - k v^2
    lambda   = abs(omega R - v) / max(omega R, v, floor)        Eq. (13) of [1]_

The vehicle drives forward or stands: omega >= 0 and v >= 0. A torque that resists (a brake, rolling resistance)
can bring a wheel to rest and then holds it, it never turns it back.

References
----------
.. [1] Tian et al. (2022), Remote Sensing 14, 5583, doi:10.3390/rs14215583.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trpac_core.vehicle import GRAVITY_M_S2

FLOOR_SPEED_M_S = 0.01
"""Below this speed slip is taken relative to the floor, so that standstill has slip 0 and not 0/0 [m/s]."""

TOLERANCE_M_S = 2e-5
"""Accepted error estimate of a sub-step at rest, in wheel rim and vehicle speed [m/s]; see docs/plant.md."""

RELATIVE_TOLERANCE = 5e-5
"""What the accepted error estimate grows by with speed, which keeps slip equally accurate at all speeds [-]."""

SHORTEST_STEP_S = 1e-7
"""A sub-step of this length is taken whatever its error estimate says [s]."""

ACCELERATION_TOLERANCE_M_S2 = 1e-7
"""Accepted residual of the acceleration under load transfer, before its last Newton correction [m/s^2]."""

BORDER_TOLERANCE_M = 1e-7
"""A contact point this close to the next road segment counts as being on it [m]."""

compiled = njit(cache=True, error_model="numpy")  # divisions are guarded here, not by the compiler

_GAMMA = 1.0 - 1.0 / np.sqrt(2.0)  # makes the two-stage Rosenbrock method L-stable


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


class RoadTable(NamedTuple):
    """The road as the compiled step reads it; the first segment also holds before its start."""

    start_m: NDArray[np.float64]
    theta: NDArray[np.float64]
    """Friction under the left and the right wheels, shape (segments, 2) [-]."""


@compiled
def tyre_force(theta: float, slip: float, load_n: float, stiffness_n: float) -> tuple[float, float, float]:
    """Modified Dugoff force without side slip, and its slopes.

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

    References
    ----------
    .. [1] Bian et al. (2014), SAE 2014-01-0123; coefficients as in docs/plant.md.
    """
    shape = (1.15 - 0.75 * theta) * slip * slip - (1.63 - 0.75 * theta) * slip + 1.27
    shape_by_slip = 2.0 * (1.15 - 0.75 * theta) * slip - (1.63 - 0.75 * theta)
    grip_n = theta * load_n
    if grip_n * (1.0 - slip) >= 2.0 * stiffness_n * slip:  # L >= 1: the whole contact patch adheres
        stretch = slip / (1.0 - slip) if slip < 1.0 else 0.0
        force = stiffness_n * stretch * shape
        by_slip = stiffness_n * (shape / (1.0 - slip) ** 2 + stretch * shape_by_slip) if slip < 1.0 else 0.0
        return force, by_slip, 0.0
    # C_x lambda / (1 - lambda) L = grip / 2, so that lambda = 1 needs no special case.
    adhering = grip_n * (1.0 - slip) / (2.0 * stiffness_n * slip)
    adhering_by_slip = -grip_n / (2.0 * stiffness_n * slip * slip)
    force = grip_n * (1.0 - 0.5 * adhering) * shape
    by_slip = grip_n * ((1.0 - 0.5 * adhering) * shape_by_slip - 0.5 * adhering_by_slip * shape)
    return force, by_slip, theta * (1.0 - adhering) * shape


class Wheels(NamedTuple):
    """Working arrays of one evaluation, shape (4,) each; theta is input, the others are filled."""

    theta: NDArray[np.float64]
    force_n: NDArray[np.float64]
    load_n: NDArray[np.float64]
    slip: NDArray[np.float64]
    force_by_wheel: NDArray[np.float64]
    """Slope of the force by wheel speed [N s/rad]."""
    force_by_speed: NDArray[np.float64]
    """Slope of the force by vehicle speed [N s/m]."""
    rate_1: NDArray[np.float64]
    rate_2: NDArray[np.float64]
    free: NDArray[np.float64]
    """0 for a wheel that is held at rest, else 1."""


@compiled
def new_wheels() -> tuple[Wheels, Wheels]:
    """Working arrays of the two stages; both read the same theta."""
    a = np.zeros((17, 4))
    first = Wheels(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8])
    return first, Wheels(a[0], a[9], a[10], a[11], a[12], a[13], a[14], a[15], a[16])


@compiled
def forces(y: NDArray, accel: float, p: DynamicsParameters, wheels: Wheels) -> float:
    """Fill loads, slips, signed forces and force slopes; return the acceleration [m/s^2].

    With load transfer the acceleration stands on both sides; Newton's method on it starts from `accel`.
    """
    speed = max(y[1], 0.0)
    half_base = 0.5 / (p.cog_to_front_axle_m + p.cog_to_rear_axle_m)
    front_n = p.mass_kg * GRAVITY_M_S2 * p.cog_to_rear_axle_m * half_base
    rear_n = p.mass_kg * GRAVITY_M_S2 * p.cog_to_front_axle_m * half_base
    transfer_kg = p.mass_kg * p.transfer_height_m * half_base
    drag_n = p.drag_kg_m * speed * speed
    for _ in range(8):
        shift_n = transfer_kg * accel
        total_n = 0.0
        total_by_accel = 0.0
        for i in range(4):
            rim = max(y[2 + i], 0.0) * p.wheel_radius_m
            scale = max(rim, speed, FLOOR_SPEED_M_S)
            slip = abs(rim - speed) / scale
            load_n = max(front_n - shift_n, 0.0) if i < 2 else max(rear_n + shift_n, 0.0)
            force, by_slip, by_load = tyre_force(wheels.theta[i], slip, load_n, p.longitudinal_stiffness_n)
            sign = 1.0 if rim >= speed else -1.0
            total_n += sign * force
            total_by_accel += sign * by_load * (-transfer_kg if i < 2 else transfer_kg)
            wheels.force_n[i] = sign * force
            wheels.load_n[i] = load_n
            wheels.slip[i] = slip
            # The falling branch is left out of the Jacobian: it is not stiff, and the method keeps its order.
            slope = max(by_slip, 0.0) / scale
            wheels.force_by_wheel[i] = slope * p.wheel_radius_m * (speed / rim if rim == scale else 1.0)
            wheels.force_by_speed[i] = -slope * (rim / speed if speed == scale else 1.0)
        error = (total_n - drag_n) / p.mass_kg - accel
        accel += error / (1.0 - total_by_accel / p.mass_kg)
        if p.transfer_height_m == 0.0 or abs(error) < ACCELERATION_TOLERANCE_M_S2:
            break
    return accel


@compiled
def _wheel_rate(i: int, speed_rad_s: float, torque_nm: float, p: DynamicsParameters, wheels: Wheels) -> float:
    """Omega' of one wheel [rad/s^2]; a resting wheel that nothing drives forward stays at rest."""
    resistance_n = wheels.force_n[i] + p.rolling_coefficient * wheels.load_n[i]
    rate = (torque_nm - resistance_n * p.wheel_radius_m) / p.wheel_inertia_kg_m2
    return 0.0 if speed_rad_s <= 0.0 and rate <= 0.0 else rate


@compiled
def _solve(
    speed_rhs: float, speed: float, h: float, p: DynamicsParameters, wheels: Wheels, k: NDArray
) -> float:
    """Solve (1 - gamma h A) k = right-hand side, in place for the wheels; return the vehicle speed's part.

    A couples each wheel with the vehicle's speed alone, so eliminating the wheels leaves one scalar equation.
    """
    gh = _GAMMA * h
    pivot = 1.0 + gh * 2.0 * p.drag_kg_m * speed / p.mass_kg
    rhs = speed_rhs
    per_newton = p.wheel_radius_m / p.wheel_inertia_kg_m2
    for i in range(4):
        gain = gh * per_newton * wheels.free[i]
        share = gh * wheels.force_by_wheel[i] / (p.mass_kg * (1.0 + gain * wheels.force_by_wheel[i]))
        pivot -= (gh / p.mass_kg - share * gain) * wheels.force_by_speed[i]
        rhs += share * k[i]
    k_speed = rhs / pivot
    for i in range(4):
        gain = gh * per_newton * wheels.free[i]
        k[i] = (k[i] - gain * wheels.force_by_speed[i] * k_speed) / (1.0 + gain * wheels.force_by_wheel[i])
    return k_speed


@compiled
def segment_at(start_m: NDArray, contact_m: float) -> int:
    """Index of the road segment under a contact point."""
    index = 0
    while index + 1 < start_m.shape[0] and contact_m >= start_m[index + 1] - BORDER_TOLERANCE_M:
        index += 1
    return index


@compiled
def look_up_theta(position_m: float, p: DynamicsParameters, road: RoadTable, theta: NDArray) -> float:
    """Fill theta under the wheels; return the least distance from a contact to the border ahead of it [m]."""
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
    """One two-stage Rosenbrock (ROS2) step from y to trial; return error estimate [m/s], acceleration."""
    for i in range(4):
        torque = torque_nm[i] + (next_torque_nm[i] - torque_nm[i]) * begin
        rate = _wheel_rate(i, y[2 + i], torque, p, first)
        first.free[i] = 0.0 if y[2 + i] <= 0.0 and rate == 0.0 else 1.0
        first.rate_1[i] = rate
    speed_1 = _solve(accel, y[1], h, p, first, first.rate_1)
    trial[1] = y[1] + h * speed_1
    for i in range(4):
        trial[2 + i] = y[2 + i] + h * first.rate_1[i]
    accel = forces(trial, accel, p, second)
    for i in range(4):
        torque = torque_nm[i] + (next_torque_nm[i] - torque_nm[i]) * end
        rate = _wheel_rate(i, trial[2 + i], torque, p, second)
        first.rate_2[i] = rate - 2.0 * first.rate_1[i]
    speed_2 = _solve(accel - 2.0 * speed_1, y[1], h, p, first, first.rate_2)
    error = abs(speed_1 + speed_2)
    trial[1] = max(y[1] + h * (1.5 * speed_1 + 0.5 * speed_2), 0.0)
    for i in range(4):
        error = max(error, p.wheel_radius_m * abs(first.rate_1[i] + first.rate_2[i]))
        trial[2 + i] = max(y[2 + i] + h * (1.5 * first.rate_1[i] + 0.5 * first.rate_2[i]), 0.0)
    trial[0] = y[0] + 0.5 * h * (y[1] + trial[1])
    return 0.5 * h * error, accel


@compiled
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
) -> float:
    """Move y over one output step with torque linear between its ends; return the acceleration there [m/s^2].

    `first` must hold the forces at y, and does so again at the end. Sub-steps end at every road border that a wheel
    crosses and shrink until their error estimate is accepted.
    """
    at_s = 0.0
    h = step_s
    ahead_m = look_up_theta(y[0], p, road, first.theta)
    while step_s - at_s > 1e-9 * step_s:
        h = min(h, step_s - at_s)
        if y[1] * h > ahead_m:
            h = ahead_m / y[1]
        begin, end = at_s / step_s, (at_s + h) / step_s
        error, new_accel = _try_step(
            y, trial, torque_nm, next_torque_nm, begin, end, h, accel, p, first, second
        )
        tolerance = TOLERANCE_M_S + RELATIVE_TOLERANCE * y[1]
        if error > tolerance and h > SHORTEST_STEP_S:
            h = max(h * max(0.9 * np.sqrt(tolerance / error), 0.1), SHORTEST_STEP_S)
            continue
        y[:] = trial
        at_s += h
        h *= min(0.9 * np.sqrt(tolerance / max(error, 1e-3 * tolerance)), 10.0)
        ahead_m = look_up_theta(y[0], p, road, first.theta)
        accel = forces(y, new_accel, p, first)
    return accel


@compiled
def run(
    y: NDArray,
    torque_nm: NDArray,
    step_s: float,
    p: DynamicsParameters,
    road: RoadTable,
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Simulate all rows from y (position, speed, four wheel speeds), which ends as the last row's state.

    Returns
    -------
    tuple
        States (n, 6), accelerometer (n,) [m/s^2], and slip [-], tyre force [N], load [N], theta [-] (n, 4).
    """
    n = torque_nm.shape[0]
    states, accels = np.empty((n, 6)), np.empty(n)
    slip, force_n, load_n, theta = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4))
    first, second = new_wheels()
    trial = np.empty(6)
    look_up_theta(y[0], p, road, first.theta)
    accel = forces(y, 0.0, p, first)
    for k in range(n):
        accels[k] = accel
        states[k] = y
        slip[k], force_n[k] = first.slip, first.force_n
        load_n[k], theta[k] = first.load_n, first.theta
        if k + 1 < n:
            accel = advance(y, trial, torque_nm[k], torque_nm[k + 1], step_s, accel, p, road, first, second)
    return states, accels, slip, force_n, load_n, theta
