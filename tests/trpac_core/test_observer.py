"""The force observer's error equation: proved symbolically, then seen in a simulation by other means."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from trpac_core import observer, tyre

I, R, F_Z, C_X, K = 1.2, 0.29, 3000.0, 5e4, 60.0


def test_error_equation_holds_for_any_tyre_curve():
    """e' = -K e + F_z [mu_lambda(theta) - mu_lambda(theta_hat)] lambda', from (12), (14) and (15) alone."""
    t, inertia, radius, gain, load = sp.symbols("t I R K F_z", positive=True)
    theta = sp.Symbol("theta")
    sigma = sp.Symbol("sigma")
    slip, theta_hat, omega, s, torque = (
        sp.Function(name)(t) for name in ("slip", "theta_hat", "omega", "s", "T")
    )
    mu = sp.Function("mu")
    F = load * mu(theta, slip) * sigma
    F_hat = load * mu(theta_hat, slip) * sigma - inertia / radius * (s + gain * omega)
    by_theta, by_slip = (
        lambda th: sp.Subs(sp.diff(mu(a, slip), a), a, th).doit(),
        lambda th: sp.Subs(sp.diff(mu(th, b), b), b, slip).doit(),
    )
    a, b = sp.symbols("a b")
    omega_rate = (torque - F * radius) / inertia
    s_rate = -gain / inertia * (torque - radius * F_hat) + radius / inertia * load * by_theta(
        theta_hat
    ) * sigma * sp.diff(theta_hat, t)
    e = F - F_hat
    e_rate = sp.diff(e, t).subs({sp.diff(omega, t): omega_rate, sp.diff(s, t): s_rate}).doit()
    claimed = -gain * e + load * sigma * (by_slip(theta) - by_slip(theta_hat)) * sp.diff(slip, t)
    assert sp.simplify((e_rate - claimed).doit()) == 0


def simulated_error(theta, theta_hat, gain, step_s, end_s, start_error_n=0.0):
    """Observer on a wheel whose slip is swept; truth by an independent integrator, the observer by ours."""
    speed = 10.0

    def torque(t):
        return 250.0 + 60.0 * np.sin(9.0 * t)

    def wheel(t, omega):
        size = (omega[0] * R - speed) / (omega[0] * R)
        return [(torque(t) - R * tyre.force(theta, size, F_Z, C_X, 1.0)) / I]

    times = np.arange(0.0, end_s, step_s)
    truth = solve_ivp(wheel, (0.0, end_s), [10.15 / R], method="LSODA", t_eval=times, rtol=1e-10, atol=1e-12)
    omegas = truth.y[0]
    slips = (omegas * R - speed) / (omegas * R)
    forces = np.array([tyre.force(theta, size, F_Z, C_X, 1.0) for size in slips])
    s = -gain * omegas[0] + start_error_n * R / I
    errors = []
    for t, omega, size, force in zip(times, omegas, slips, forces, strict=True):
        model = tyre.force(theta_hat, size, F_Z, C_X, 1.0)
        errors.append(force - observer.observed_force(model, s, omega, gain, I, R))
        s = observer.advanced_state(s, model, 0.0, torque(t), omega, gain, I, R, step_s)
    return times, np.array(errors), slips


def test_error_decays_with_the_gain_when_theta_is_right():
    times, errors, _ = simulated_error(0.5, 0.5, K, 1e-5, 0.05, start_error_n=400.0)
    assert errors[0] == pytest.approx(400.0, rel=1e-3)
    assert np.polyfit(times, np.log(errors), 1)[0] == pytest.approx(-K, rel=0.01)


def test_simulated_error_rate_is_the_predicted_one_with_theta_wrong():
    times, errors, slips = simulated_error(0.5, 0.4, K, 2e-5, 0.3)
    rate = np.gradient(errors, times)
    slip_rate = np.gradient(slips, times)
    slope = np.array(
        [
            tyre.friction_by_slip(0.5, size, F_Z, C_X) - tyre.friction_by_slip(0.4, size, F_Z, C_X)
            for size in slips
        ]
    )
    predicted = -K * errors + F_Z * slope * slip_rate
    inner = slice(2000, -100)
    scale = np.abs(predicted[inner]).max()
    # Inputs held over 20 us lag by half a step, which at these rates is half a per cent of the largest one.
    assert np.abs(rate[inner] - predicted[inner]).max() < 1e-2 * scale


@pytest.mark.parametrize("step_s", [1e-3, 0.1, 5.0])
def test_any_step_size_is_stable_and_settles_on_the_torque(step_s):
    """A wheel that turns evenly has F = T / R; the observer ends there from a wrong start, with no slip in play."""
    s = 1e4
    for _ in range(2000):
        s = observer.advanced_state(s, 0.0, 0.0, 200.0, 40.0, K, I, R, step_s)
    assert observer.observed_force(0.0, s, 40.0, K, I, R) == pytest.approx(200.0 / R, rel=1e-9)


def test_settled_state_starts_at_the_wanted_force():
    s = observer.settled_state(500.0, 900.0, 33.0, K, I, R)
    assert observer.observed_force(500.0, s, 33.0, K, I, R) == pytest.approx(900.0)
