"""Observer and estimator of Eqs. (14) to (18) on one wheel whose road is known, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core import tyre
from trpac_core.dife import (
    INNOVATION,
    LEAST_SENSITIVITY,
    FusionState,
    Gains,
    VisualTerm,
    Wheel,
    WheelInputs,
    fusion_step,
    settled,
    visual_gain,
)
from trpac_core.slip import Slip
from trpac_core.stationary_mean import NO_MEAN
from trpac_core.tyre import GREATEST_THETA, LEAST_THETA

WHEEL = Wheel(1.2, 0.29, 50_000.0)
C_X = WHEEL.longitudinal_stiffness_n
GAINS = Gains(K=60.0, gamma=6.0)
STEP_S, LOAD_N, NOISE_S = 1e-3, 3000.0, 0.02


def on_road(theta, slip=0.03, noise=1e-5, rise=0.0):
    """A wheel that turns evenly at a slip: its torque balances the tyre's force."""
    force_n = tyre.force(theta, slip, LOAD_N, C_X, 1.0)
    omega = 10.0 / WHEEL.radius_m / (1.0 - slip)
    return WheelInputs(
        omega, omega, force_n * WHEEL.radius_m, Slip(slip, 1.0), LOAD_N, True, noise, rise, NOISE_S
    )


def stepped(state, inputs, gains=GAINS, theta_img=None, onset_theta=0.05, step_s=STEP_S):
    return fusion_step(state, inputs, WHEEL, gains, theta_img, onset_theta, step_s)


def run(inputs, theta_hat, seconds, gains=GAINS, theta_img=None, onset_theta=0.05):
    state = settled(FusionState(theta_hat, 0.0), inputs, WHEEL, gains)
    trace = []
    for _ in range(round(seconds / STEP_S)):
        step = stepped(state, inputs, gains, theta_img, onset_theta)
        state = step.state
        trace.append(state.theta_hat)
    return np.array(trace), step


def test_it_is_first_order_at_gamma_twice_gamma_and_faster_from_afar():
    """Eq. (16) with the force known, against a numerical solution of its own."""
    trace, _ = run(on_road(0.3), 0.5, 0.5)
    theta, wanted = 0.5, []
    for k in range(500):
        factor = min(1.0 + (k + 1) * STEP_S / NOISE_S, 2.0)
        rate = GAINS.gamma * factor * (1.0 + INNOVATION * (factor - 1.0) * (theta - 0.3))
        theta += STEP_S * rate * (0.3 - theta)
        wanted.append(theta)
    assert trace == pytest.approx(np.array(wanted), abs=2e-3)


@given(st.floats(0.1, 0.8), st.floats(0.1, 1.0))
def test_it_converges_on_the_roads_theta_from_anywhere_and_the_force_with_it(theta, start):
    inputs = on_road(theta, slip=0.06)
    trace, step = run(inputs, start, 2.0)
    assert trace[-1] == pytest.approx(theta, abs=1e-3)
    assert step.tyre_force_n * WHEEL.radius_m == pytest.approx(inputs.wheel_torque_nm, rel=1e-3)


@pytest.mark.parametrize("theta_img", [None, 0.2])
def test_a_braked_wheel_is_seen_as_a_driven_one_is(theta_img):
    driven = on_road(0.3)
    braked = driven._replace(wheel_torque_nm=-driven.wheel_torque_nm, slip=Slip(driven.slip.size, -1.0))
    both = [run(inputs, 0.6, 0.7, theta_img=theta_img) for inputs in (braked, driven)]
    assert both[0][0] == pytest.approx(both[1][0], abs=1e-9)
    assert both[0][1].tyre_force_n == pytest.approx(-both[1][1].tyre_force_n)


@pytest.mark.parametrize("theta_img", [None, 0.2])
def test_an_estimate_on_its_way_leaves_the_observed_force_alone(theta_img):
    """Last term of Eq. (15), from a road on which the tyre would not slide to one where it does."""
    inputs = on_road(0.3)
    state = settled(FusionState(1.1, 0.0), inputs, WHEEL, GAINS)
    found = []
    for _ in range(500):
        step = stepped(state, inputs, theta_img=theta_img)
        state = step.state
        found.append(step.tyre_force_n)
    assert state.theta_hat < 0.4
    assert found == pytest.approx([inputs.wheel_torque_nm / WHEEL.radius_m] * 500, rel=1e-9)


@pytest.mark.parametrize(("form", "rate"), [(VisualTerm.OUTSIDE, 1.0), (VisualTerm.INSIDE, 6.0)])
def test_both_forms_settle_where_their_two_terms_balance(form, rate):
    """gamma' (theta - x) + rate K_v(|theta_img - x|) (theta_img - x) = 0, with the camera wrong."""
    gains = replace(GAINS, visual_term=form)
    trace, step = run(on_road(0.3), 0.3, 4.0, gains, theta_img=0.8)
    x = trace[-1]
    by_tyre = 2.0 * gains.gamma * (1.0 + INNOVATION * abs(0.3 - x))
    assert step.K_v == pytest.approx(visual_gain(gains, 0.8, x), abs=1e-3)
    assert step.K_v > 0.0
    assert x > 0.31
    assert by_tyre * (0.3 - x) + rate * step.K_v * (0.8 - x) == pytest.approx(0.0, abs=2e-2)


def test_a_class_pulls_an_excited_wheel_whose_tyre_shows_nothing_and_no_other():
    elastic = on_road(0.9, slip=0.012)
    pulled, step = run(elastic, 0.8, 0.5, theta_img=0.2)
    assert (step.theta_tyre, step.excited) == (None, True)
    assert pulled[-1] < 0.6
    still, step = run(elastic, 0.8, 0.5, theta_img=0.2, onset_theta=0.5)
    assert (step.K_v, step.excited) == (0.0, False)
    assert np.all(still == 0.8)


@given(st.floats(0.05, 1.0), st.floats(0.005, 0.1))
def test_the_threshold_is_where_the_onset_road_begins_to_slide(onset_theta, slip):
    step = stepped(FusionState(0.5, 0.0), on_road(0.4, slip), onset_theta=onset_theta)
    slides = onset_theta * LOAD_N < 2.0 * tyre.slip_ratio_force(slip, C_X) * (1.0 - 1e-9)
    assert step.excited == (slip > step.threshold)
    assert step.excited == slides or slip == pytest.approx(step.threshold, rel=1e-6)


def at_sliding_limit(share, slip):
    """The road that is this share of the one on which the tyre just slides [-]."""
    return share * 2.0 * tyre.slip_ratio_force(slip, C_X) / LOAD_N


@given(st.floats(0.5, 1.2), st.floats(0.004, 0.03))
def test_nothing_is_shown_where_theta_would_be_off_by_ten_times_what_the_used_friction_is(share, slip):
    theta = at_sliding_limit(share, slip)
    inputs = on_road(theta, slip, noise=0.0)
    lower, upper = (tyre.used_friction(theta + d, slip, LOAD_N, C_X) for d in (-1e-5, 1e-5))
    slope = (upper - lower) / 2e-5
    shown = stepped(settled(FusionState(theta, 0.0), inputs, WHEEL, GAINS), inputs).theta_tyre
    # A single reading of the curve counts as doubtful to 1.25 % of its slip.
    surely = tyre.used_friction(10.0, slip * (1.0 - 0.0125), LOAD_N, C_X) > tyre.used_friction(
        theta, slip, LOAD_N, C_X
    )
    if slope < 0.99 * LEAST_SENSITIVITY:
        assert shown is None
    elif surely and slope > 1.2 * LEAST_SENSITIVITY and share < 0.8:
        assert shown == pytest.approx(theta, abs=1e-5)


@pytest.mark.parametrize("known_as", ["slip_noise", "slip_rise"])
def test_noise_at_the_elastic_end_is_not_taken_for_a_slippery_road(known_as):
    """On 0.9 at L > 1 force and slip lie on the elastic line; a slip read 5 % high looks like a sliding tyre."""
    misread = on_road(0.9, slip=0.016, noise=0.0)._replace(slip=Slip(0.016 * 1.05, 1.0))
    start = settled(FusionState(0.9, 0.0), misread, WHEEL, GAINS)
    fooled = stepped(start, misread).theta_tyre
    assert fooled is not None
    assert fooled < 0.7
    assert stepped(start, misread._replace(**{known_as: 0.0008})).theta_tyre is None


def test_time_shows_what_one_reading_hides():
    """Ice at the end of the elastic line: seen after a while, and never on a dry road."""

    def first_seen(theta):
        inputs = on_road(theta, 0.0068, noise=1.5e-4)
        state = settled(FusionState(0.8, 0.0), inputs, WHEEL, GAINS)
        for k in range(300):
            step = stepped(state, inputs)
            if step.theta_tyre is not None:
                return k * STEP_S, step.theta_tyre
            state = step.state
        return None

    after_s, theta = first_seen(0.18)
    assert 0.0 < after_s < 0.2
    assert theta == pytest.approx(0.18, abs=1e-3)
    assert first_seen(0.9) is None


@pytest.mark.parametrize("slip", [0.0, 1e-4])
def test_a_wheel_that_rolls_freely_shows_no_ice(slip):
    rolling = WheelInputs(34.0, 34.0, 0.0, Slip(slip, 1.0 if slip else 0.0), LOAD_N, True, 1e-4, 0.0, NOISE_S)
    step = stepped(settled(FusionState(0.8, 0.0), rolling, WHEEL, GAINS), rolling, onset_theta=0.0)
    assert step.theta_tyre is None
    assert step.state.theta_hat == 0.8


def test_the_torque_of_a_locked_wheel_is_not_the_roads():
    inputs = on_road(0.5, 0.9)._replace(torque_known=False, wheel_torque_nm=-3000.0)
    before = FusionState(0.4, 12.0)
    step = stepped(before, inputs, theta_img=0.8)
    assert step.state.theta_hat == 0.4
    assert (step.excited, step.theta_tyre, step.K_v, step.state.mean) == (False, None, 0.0, NO_MEAN)
    assert step.tyre_force_n == pytest.approx(tyre.force(0.4, 0.9, LOAD_N, C_X, 1.0))


def test_a_wheel_that_rolled_freely_in_between_begins_a_new_mean():
    inputs = on_road(0.3)
    rolling = inputs._replace(wheel_torque_nm=0.0, slip=Slip(0.0, 0.0))
    state, duration_s = settled(FusionState(0.8, 0.0), inputs, WHEEL, GAINS), []
    for now in (*[inputs] * 50, rolling, inputs):
        state = stepped(state, now).state
        duration_s.append(state.mean.duration_s)
    assert duration_s[-3:] == [pytest.approx(50 * STEP_S), 0.0, STEP_S]


@given(
    st.floats(0.0, 0.999),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-3000.0, 3000.0),
    st.floats(1e-6, 100.0),
    st.one_of(st.none(), st.floats(0.0, 1.2)),
)
def test_whatever_comes_the_estimate_stays_in_its_domain(slip, direction, torque, step_s, theta_img):
    inputs = on_road(0.5)._replace(wheel_torque_nm=torque, slip=Slip(slip, direction if slip else 0.0))
    state = FusionState(0.5, 0.0)
    for _ in range(5):
        state = stepped(state, inputs, GAINS, theta_img, step_s=step_s).state
        assert LEAST_THETA <= state.theta_hat <= GREATEST_THETA
        assert np.isfinite(state.s)


def test_a_step_of_no_time_changes_nothing_that_counts():
    inputs = on_road(0.3)
    start = settled(FusionState(0.5, 0.0), inputs, WHEEL, GAINS)
    after = stepped(start, inputs, theta_img=0.2, step_s=0.0).state
    assert (after.theta_hat, after.s) == (start.theta_hat, pytest.approx(start.s))
