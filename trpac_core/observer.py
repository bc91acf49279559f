"""Longitudinal force observer, Eqs. (14) and (15) of Tian et al. 2022 in the sign convention of Eq. (12).

As printed the pair holds only for the opposite sign of the force, and Eq. (15) lacks F_z in its last term. With
F_x > 0 driving the car it reads

    F_hat = F_z mu(theta_hat, lambda) sigma - (I / R) (s + K omega)
    s'    = -(K / I) (T - R F_hat) + (R / I) F_z (d mu / d theta) sigma theta_hat'

so that at constant theta the error e = F_x - F_hat obeys
e' = -K e + F_z [mu_lambda(theta) - mu_lambda(theta_hat)] lambda'. The tyre model gives the fast part of the force,
the wheel's balance of torque the slow part, and K is the corner between them.
"""

from __future__ import annotations

import math


def observed_force(
    model_force_n: float,
    s: float,
    wheel_speed_rad_s: float,
    gain: float,
    inertia_kg_m2: float,
    radius_m: float,
) -> float:
    """Observed tyre force F_hat, Eq. (14). [N].

    Parameters
    ----------
    model_force_n : float
        Force of the tyre model at the estimated theta, F_z mu(theta_hat, lambda) sigma [N].
    s : float
        The observer's inner state [rad/s^2].
    wheel_speed_rad_s, gain, inertia_kg_m2, radius_m : float
        omega [rad/s], K [1/s], I [kg m^2], R [m].
    """
    return model_force_n - inertia_kg_m2 / radius_m * (s + gain * wheel_speed_rad_s)


def settled_state(
    model_force_n: float,
    force_n: float,
    wheel_speed_rad_s: float,
    gain: float,
    inertia_kg_m2: float,
    radius_m: float,
) -> float:
    """The inner state s at which the observer gives a wanted force. [rad/s^2]."""
    return (model_force_n - force_n) * radius_m / inertia_kg_m2 - gain * wheel_speed_rad_s


def seen_at(x: float) -> float:
    """Share of the step at which an input that changes linearly counts for Eq. (15), x = K dt. [-].

    The mean of t / dt over the step, weighted as the observer forgets, with exp(-K (dt - t)): half of the way for short
    steps, the end of long ones.
    """
    return 0.5 + x / 12.0 if x < 1e-4 else 1.0 / -math.expm1(-x) - 1.0 / x


def advanced_state(
    s: float,
    model_force_n: float,
    model_change_n: float,
    wheel_torque_nm: float,
    wheel_speed_rad_s: float,
    gain: float,
    inertia_kg_m2: float,
    radius_m: float,
    step_s: float,
) -> float:
    """The inner state one step later, Eq. (15), exact for constant inputs over the step. [rad/s^2].

    With Eq. (14) put in, (15) is linear in s with the pole -K; its exact solution is stable for any step size. Its last
    term, integrated over the step, is what the model's force changes by with theta_hat: it leaves F_hat as it is.

    Parameters
    ----------
    s : float
        Inner state now [rad/s^2].
    model_force_n, model_change_n : float
        F_z mu sigma at theta_hat, and its change by theta_hat over the step [N].
    wheel_torque_nm, wheel_speed_rad_s : float
        Where they are `seen_at` of the step [N m], [rad/s]: with those of its start the inertia's share of a wheel that
        gains speed would be counted K dt / (1 - exp(-K dt)) times.
    gain, inertia_kg_m2, radius_m, step_s : float
        K [1/s], I [kg m^2], R [m] and the step [s].
    """
    per_force = radius_m / inertia_kg_m2
    drive = per_force * model_force_n - wheel_torque_nm / inertia_kg_m2 - gain * wheel_speed_rad_s
    decay = math.exp(-gain * step_s)
    return s * decay + drive * (1.0 - decay) + per_force * model_change_n
