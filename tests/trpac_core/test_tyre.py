"""The modified Dugoff tyre against its published facts and independent numerics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from trpac_core import tyre

THETA = st.floats(0.05, 1.2)
SLIP = st.floats(0.002, 0.9)
LOAD = st.floats(1500.0, 6000.0)
STIFFNESS = st.floats(20_000.0, 120_000.0)


@pytest.mark.parametrize(("theta", "excess"), [(0.1, 0.18), (0.2, 0.14), (0.9, 0.06)])
def test_the_curve_rises_above_theta_and_most_on_slippery_roads(theta, excess):
    """For C_x of 50 to 80 kN the excess is about 18 % at theta 0.1, 12 to 15 % at 0.2 and 4 to 8 % at 0.9."""
    ratios = [tyre.peak_friction(theta, 3300.0, c) / theta for c in (50_000.0, 80_000.0)]
    assert np.mean(ratios) - 1.0 == pytest.approx(excess, abs=0.015)


@given(THETA)
def test_a_locked_wheel_keeps_0_79_of_theta(theta):
    """At lambda -> 1 the correction is 1.15 - 1.63 + 1.27 = 0.79 whatever theta."""
    assert tyre.used_friction(theta, 0.999, 3000.0, 5e4) == pytest.approx(0.79 * theta, rel=3e-3)


def test_initial_slope_is_1_27_C_x():
    assert tyre.used_friction(0.9, 1e-6, 3000.0, 5e4) * 3000.0 / 1e-6 == pytest.approx(1.27 * 5e4, rel=1e-4)


@given(THETA, SLIP, LOAD, STIFFNESS)
def test_derivatives_agree_with_finite_differences(theta, slip, load, stiffness):
    kink = theta * load * (1.0 - slip) / (2.0 * stiffness * slip)
    if abs(kink - 1.0) < 1e-3:
        return
    step = 1e-6
    by_theta = (
        tyre.used_friction(theta + step, slip, load, stiffness)
        - tyre.used_friction(theta - step, slip, load, stiffness)
    ) / (2 * step)
    by_slip = (
        tyre.used_friction(theta, slip + step, load, stiffness)
        - tyre.used_friction(theta, slip - step, load, stiffness)
    ) / (2 * step)
    assert tyre.friction_by_theta(theta, slip, load, stiffness) == pytest.approx(by_theta, rel=1e-4, abs=1e-6)
    assert tyre.friction_by_slip(theta, slip, load, stiffness) == pytest.approx(by_slip, rel=1e-4, abs=1e-3)


@given(THETA, SLIP, LOAD, STIFFNESS)
def test_inverse_returns_the_theta_that_made_the_force(theta, slip, load, stiffness):
    sliding = theta * load * (1.0 - slip) / (2.0 * stiffness * slip)
    friction = tyre.used_friction(theta, slip, load, stiffness)
    found = tyre.tyre_at_slip(slip, load, stiffness).theta(friction)
    if sliding < 0.999:
        assert found == pytest.approx(theta, rel=1e-5)
    elif sliding > 1.001 and found is not None:
        # Only G's small dependence on theta is left: any theta found is one below L = 1.
        assert tyre.used_friction(found, slip, load, stiffness) == pytest.approx(friction, rel=1e-9)


@given(st.floats(0.01, 1.0), st.floats(0.01, 0.5), LOAD, STIFFNESS)
def test_inverse_agrees_with_brent(friction, slip, load, stiffness):
    upper = 2.0 * stiffness * slip / (1.0 - slip) / load
    if tyre.used_friction(upper, slip, load, stiffness) <= friction:
        assert tyre.tyre_at_slip(slip, load, stiffness).theta(friction) is None
        return
    wanted = brentq(
        lambda theta: tyre.used_friction(theta, slip, load, stiffness) - friction, 0.0, upper, xtol=1e-13
    )
    assert tyre.tyre_at_slip(slip, load, stiffness).theta(friction) == pytest.approx(wanted, abs=1e-7)


@given(THETA, LOAD, st.floats(10_000.0, 120_000.0))
def test_peak_agrees_with_a_bounded_search(theta, load, stiffness):
    search = minimize_scalar(
        lambda slip: -tyre.used_friction(theta, slip, load, stiffness),
        bounds=(1e-4, 0.95),
        method="bounded",
        options={"xatol": 1e-9},
    )
    slip = tyre.peak_slip(theta, load, stiffness)
    if theta * load * (1.0 - slip) > 2.0 * stiffness * slip:
        return  # so soft that it never slides before its end: the maximum is the elastic part's
    assert tyre.peak_friction(theta, load, stiffness) == pytest.approx(-search.fun, rel=1e-6)


@given(THETA, LOAD, STIFFNESS, st.floats(0.05, 0.6))
def test_at_the_onset_the_tyre_shows_theta_as_wanted(theta, load, stiffness, sensitivity):
    slip = tyre.onset_slip(theta, load, stiffness, sensitivity)
    if slip < 0.05:
        assert tyre.friction_by_theta(theta, slip, load, stiffness) == pytest.approx(sensitivity, abs=0.09)


def test_force_is_odd_in_direction_and_zero_without_slip():
    drive = tyre.force(0.5, 0.02, 3000.0, 5e4, 1.0)
    assert tyre.force(0.5, 0.02, 3000.0, 5e4, -1.0) == -drive
    assert drive > 0.0
    assert tyre.used_friction(0.5, 1e-12, 3000.0, 5e4) < 1e-9
