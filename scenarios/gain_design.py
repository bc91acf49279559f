"""Design of the gains K and gamma from a bandwidth, a noise level and an accuracy.

The force observer and the estimator are a cascade. K is bounded by the dynamics that the wheel's equation neglects
(motor torque lag and driveline torsion, from about 10 Hz on), and is set to that corner. gamma is bounded by the
cascade, whose outer loop must be slower than the observer by `SEPARATION`, and by noise: at the least useful excitation
two standard deviations of the estimate must be within the paper's steady-state error of 0.02. gamma is the largest
value that satisfies both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from trpac_core.tyre import friction_by_slip, friction_by_theta, onset_slip
from trpac_core.vehicle import Vehicle

SEPARATION = 5.0
"""Ratio of the observer's to the estimator's bandwidth [-]."""


@dataclass(frozen=True)
class DesignPoint:
    """Requirements and operating point of the design; the noise is that of the sensors in the shipped scenarios.

    The operating point is that of least excitation in the paper's simulation: the road of middle friction at full motor
    torque.
    """

    force_bandwidth_hz: float = 10.0
    wheel_speed_noise_rad_s: float = 0.01
    wheel_torque_noise_nm: float = 3.2
    vehicle_speed_noise_m_s: float = 0.003
    sample_time_s: float = 0.001
    theta: float = 0.5
    sensitivity: float = 0.25
    longitudinal_acceleration_m_s2: float = 3.2
    speed_m_s: float = 8.0
    theta_deviation: float = 0.01


@dataclass(frozen=True)
class Design:
    """Gains [1/s], and the standard deviation of theta_hat under sensor noise [-]."""

    K: float
    gamma: float
    theta_deviation: float


def linearised(point: DesignPoint, vehicle: Vehicle, K: float, gamma: float) -> control.StateSpace:
    """Linear system of observer and estimator at an excited operating point.

    States: s and theta_hat; inputs: errors of wheel torque, wheel speed and vehicle speed; output: theta_hat.
    """
    I, R, C_x = vehicle.wheel_inertia_kg_m2, vehicle.wheel_radius_m, vehicle.longitudinal_stiffness_n
    load_n = vehicle.wheel_load(True, point.longitudinal_acceleration_m_s2)
    slip = onset_slip(point.theta, load_n, C_x, point.sensitivity)
    by_theta = load_n * friction_by_theta(point.theta, slip, load_n, C_x)
    by_slip = load_n * friction_by_slip(point.theta, slip, load_n, C_x)
    circumferential = point.speed_m_s / (1.0 - slip)
    slip_by_speeds = np.array([0.0, point.speed_m_s * R / circumferential**2, -1.0 / circumferential])
    # F_hat as a row over the states (s, theta_hat) and one over the inputs (T, omega, v)
    force_x = np.array([-I / R, by_theta])
    force_u = by_slip * slip_by_speeds + np.array([0.0, -I / R * K, 0.0])
    theta_x = gamma * ((force_x / by_theta) - np.array([0.0, 1.0]))
    theta_u = gamma * (force_u - by_slip * slip_by_speeds) / by_theta
    s_x = K * R / I * force_x + R / I * by_theta * theta_x
    s_u = K * R / I * force_u + R / I * by_theta * theta_u - np.array([K / I, 0.0, 0.0])
    return control.ss(np.vstack((s_x, theta_x)), np.vstack((s_u, theta_u)), [[0.0, 1.0]], np.zeros((1, 3)))


def theta_deviation(point: DesignPoint, vehicle: Vehicle, K: float, gamma: float) -> float:
    """Standard deviation of theta_hat under white sensor noise, from the Lyapunov equation [-]."""
    system = linearised(point, vehicle, K, gamma)
    deviations = (point.wheel_torque_noise_nm, point.wheel_speed_noise_rad_s, point.vehicle_speed_noise_m_s)
    # A sequence of independent samples held over T has the spectral density sigma^2 T.
    density: NDArray[np.float64] = np.diag(np.square(deviations)) * point.sample_time_s
    covariance = control.lyap(system.A, system.B @ density @ system.B.T)
    return math.sqrt(float((system.C @ covariance @ system.C.T).item()))


def design_gains(point: DesignPoint, vehicle: Vehicle) -> Design:
    """The gains: K from the bandwidth, the largest gamma that separation and noise allow."""
    K = 2.0 * math.pi * point.force_bandwidth_hz
    gamma = K / SEPARATION
    if theta_deviation(point, vehicle, K, gamma) > point.theta_deviation:
        gamma = brentq(lambda g: theta_deviation(point, vehicle, K, g) - point.theta_deviation, 1e-3, gamma)
    return Design(K, gamma, theta_deviation(point, vehicle, K, gamma))
