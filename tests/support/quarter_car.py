"""A quarter of a car on one wheel whose tyre is known, driven and braked by given torque."""

from typing import NamedTuple

import numpy as np

from trpac_core import tyre

I, R, LOAD = 1.2, 0.29, 3200.0
SUBSTEP_S = 1e-4


def told_curve(theta, slip):
    """The tyre that the estimator is told of: C_x is 50 kN."""
    return tyre.used_friction(theta, abs(slip), LOAD, 5e4)


def softer_curve(theta, slip):
    """The same formula, a quarter softer."""
    return tyre.used_friction(theta, abs(slip), LOAD, 4e4)


def magic_formula(theta, slip):
    """Pacejka's with C = 1.5 and E = 0, as stiff as it is told at slip 0."""
    return theta * np.sin(1.5 * np.arctan(1.27 * 5e4 / LOAD / theta / 1.5 * abs(slip)))


class Drive(NamedTuple):
    """Signals at the steps, shape (n,)."""

    wheel_speed_rad_s: np.ndarray
    wheel_torque_nm: np.ndarray
    vehicle_speed_m_s: np.ndarray
    theta: np.ndarray


def driven(torque, theta, duration_s, curve=told_curve, speed_m_s=8.0, step_s=1e-3, noise=1.0, seed=0):
    """A drive under torque(t) on a road theta(t); `noise` scales 0.01 rad/s, 3.2 N m and 0.003 m/s."""
    omega, speed, rows = speed_m_s / R, speed_m_s, []
    every = round(step_s / SUBSTEP_S)
    for k in range(round(duration_s / SUBSTEP_S)):
        t = k * SUBSTEP_S
        if k % every == 0:
            rows.append((omega, torque(t), speed, theta(t)))
        sliding = omega * R - speed
        slip = sliding / max(omega * R, speed)
        force = np.sign(slip) * LOAD * curve(theta(t), slip) if slip else 0.0
        omega += SUBSTEP_S * (torque(t) - force * R) / I
        speed += SUBSTEP_S * force / (LOAD / 9.81)
    found = np.array(rows)
    noisy = noise * np.random.default_rng(seed).standard_normal((len(found), 3)) * (0.01, 3.2, 0.003)
    return Drive(*(found[:, :3] + noisy).T, found[:, 3])


def pulses(torque_nm, period_s=0.8, share=0.6):
    """Torque that comes and goes, with edges of 50 ms."""

    def torque(t):
        phase = t % period_s
        return torque_nm * float(np.clip(min(phase, share * period_s - phase) / 0.05, 0.0, 1.0))

    return torque
