r"""The wheel on the modified Dugoff tyre as a state equation for Kalman filters.

State (omega, v, theta): I omega' = T - R F_x(theta, lambda(omega, v)), v' = a_x as measured, theta' = 0. At small slip
the first equation is stiff (1,000 1/s at walking speed), so a step is that of the exponential Rosenbrock-Euler
method [1]_: exact for the equation linearised at the step's start, stable for any step.

References
----------
.. [1] Hochbruck, Ostermann (2010), Exponential integrators, Acta Numerica 19, 209-286, section 2.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from trpac_core.slip import GREATEST_SLIP, wheel_slip
from trpac_core.tyre import GREATEST_THETA, LEAST_THETA, friction_by_slip, friction_by_theta, used_friction
from trpac_core.vehicle import Vehicle

MOST_GROWTH = 2.0
"""Bound of rate times step where the slope is positive, on the tyre's falling branch [-]."""

MOST_STEP_S = 0.002
"""Longest step: the wheel crosses the knee of the tyre's curve in a few milliseconds [s]."""


class WheelState(NamedTuple):
    """Wheel speed [rad/s], vehicle speed [m/s], theta [-]."""

    wheel_speed_rad_s: float
    speed_m_s: float
    theta: float


class WheelStep(NamedTuple):
    """The state after a step, and the first row of the transition's Jacobian, whose other rows are of the identity."""

    state: WheelState
    by_wheel_speed: float
    by_speed: float
    by_theta: float


class Slope(NamedTuple):
    """Tyre force [N] and its derivatives with respect to the state."""

    force_n: float
    by_wheel_speed: float
    by_speed: float
    by_theta: float


def tyre_slope(state: WheelState, load_n: float, vehicle: Vehicle, floor_m_s: float) -> Slope:
    """Tyre force of a state and its derivatives; theta is limited to its domain."""
    stiffness_n, radius_m = vehicle.longitudinal_stiffness_n, vehicle.wheel_radius_m
    theta = min(max(state.theta, LEAST_THETA), GREATEST_THETA)
    omega, speed = state.wheel_speed_rad_s, state.speed_m_s
    slip = wheel_slip(omega, speed, radius_m, floor_m_s)
    rim = omega * radius_m
    if max(rim, speed) < floor_m_s:
        return Slope(0.0, 0.0, 0.0, 0.0)
    direction = slip.direction or 1.0
    by_slip_n = load_n * friction_by_slip(theta, max(slip.size, 1e-9), load_n, stiffness_n)
    if slip.size >= GREATEST_SLIP:
        by_omega, by_speed = 0.0, 0.0
    elif direction > 0.0:  # lambda = 1 - v / (omega R)
        by_omega, by_speed = speed / (omega * rim), -1.0 / rim
    else:  # lambda = 1 - omega R / v
        by_omega, by_speed = -radius_m / speed, rim / speed**2
    return Slope(
        direction * load_n * used_friction(theta, slip.size, load_n, stiffness_n) if slip.size else 0.0,
        direction * by_slip_n * by_omega,
        direction * by_slip_n * by_speed,
        direction * load_n * friction_by_theta(theta, slip.size, load_n, stiffness_n) if slip.size else 0.0,
    )


def advanced(
    state: WheelState,
    torque_nm: float,
    acceleration_m_s2: float,
    load_n: float,
    vehicle: Vehicle,
    step_s: float,
    floor_m_s: float,
) -> WheelStep:
    """The state after a step with constant torque and acceleration, in parts of at most `MOST_STEP_S`.

    Parameters
    ----------
    state : WheelState
        State at the start of the step.
    torque_nm, acceleration_m_s2, load_n : float
        Wheel torque [N m], acceleration of the car [m/s^2] and load of the wheel [N] over the step.
    vehicle : Vehicle
        The car.
    step_s, floor_m_s : float
        Step [s], and the speed below which slip is 0 [m/s].
    """
    parts = max(math.ceil(step_s / MOST_STEP_S - 1e-9), 1)
    by_wheel_speed, by_speed, by_theta = 1.0, 0.0, 0.0
    for _ in range(parts):
        part = _part(state, torque_nm, acceleration_m_s2, load_n, vehicle, step_s / parts, floor_m_s)
        state = part.state
        by_wheel_speed *= part.by_wheel_speed
        by_speed = part.by_wheel_speed * by_speed + part.by_speed
        by_theta = part.by_wheel_speed * by_theta + part.by_theta
    return WheelStep(state, by_wheel_speed, by_speed, by_theta)


def _part(
    state: WheelState,
    torque_nm: float,
    acceleration_m_s2: float,
    load_n: float,
    vehicle: Vehicle,
    step_s: float,
    floor_m_s: float,
) -> WheelStep:
    """The state after one exponential step."""
    slope = tyre_slope(state, load_n, vehicle, floor_m_s)
    inertia, radius_m = vehicle.wheel_inertia_kg_m2, vehicle.wheel_radius_m
    rate = -radius_m * slope.by_wheel_speed / inertia
    z = min(rate * step_s, MOST_GROWTH)
    # phi = (exp(z) - 1) / z is the share of the step that a force of the step's start acts over
    held_s = step_s * (math.expm1(z) / z if z else 1.0)
    spin = (torque_nm - radius_m * slope.force_n) / inertia - (
        radius_m * slope.by_speed * acceleration_m_s2 * 0.5 * step_s / inertia
    )
    return WheelStep(
        WheelState(
            state.wheel_speed_rad_s + spin * held_s,
            state.speed_m_s + acceleration_m_s2 * step_s,
            state.theta,
        ),
        math.exp(z),
        -radius_m * slope.by_speed / inertia * held_s,
        -radius_m * slope.by_theta / inertia * held_s,
    )
