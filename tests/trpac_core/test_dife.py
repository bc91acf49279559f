"""DE and DIFE on one wheel whose road is known, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from trpac_core.excitation import FuzzyScheduler
from trpac_core.identifiability import WheelInputs, least_theta, visible_theta
from trpac_core.theta_variance import VarianceModel

from trpac_core import tyre
from trpac_core.dife import (
    GREATEST_THETA,
    LEAST_THETA,
    NEVER_SEEN_M,
    OTHER_CLASS_M,
    SEEN_HOLD_M,
    FusionState,
    Gains,
    VisualTerm,
    Wheel,
    fusion_step,
    settled,
)
from trpac_core.slip import Slip

WHEEL = Wheel(1.2, 0.29, 50_000.0)
SCHEDULER = FuzzyScheduler()
GAINS = Gains(K=60.0, gamma=6.0)
STEP_S = 1e-3
LOAD_N = 3000.0


def on_road(theta, slip=0.03, deviation=0.0, change=0.0):
    """A wheel that turns evenly at a slip: its torque balances the tyre's force."""
    force = tyre.force(theta, slip, LOAD_N, WHEEL.longitudinal_stiffness_n, 1.0)
    omega = 10.0 / WHEEL.radius_m / (1.0 - slip)
    return WheelInputs(omega, omega, force * WHEEL.radius_m, Slip(slip, 1.0), LOAD_N, deviation, change)


def stepped(state, inputs, gains=GAINS, theta_img=None, step_s=STEP_S):
    return fusion_step(state, inputs, WHEEL, gains, SCHEDULER, theta_img, step_s)


def run(inputs, theta_hat, seconds, gains=GAINS, theta_img=None):
    state = settled(FusionState(theta_hat, 0.0), inputs, WHEEL, gains)
    trace = []
    for _ in range(round(seconds / STEP_S)):
        step = stepped(state, inputs, gains, theta_img)
        state = step.state
        trace.append(state.theta_hat)
    return np.array(trace), step


def test_de_is_first_order_with_rate_gamma():
    """Eq. (16) with the force known: theta_hat goes to theta like exp(-gamma t)."""
    trace, _ = run(on_road(0.3), 0.5, 0.5)
    time = STEP_S * np.arange(1, len(trace) + 1)
    assert trace == pytest.approx(0.3 + 0.2 * np.exp(-GAINS.gamma * time), abs=2e-3)


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
    assert found == pytest.approx([inputs.wheel_torque_nm / WHEEL.radius_m] * 500, rel=3e-3)


@pytest.mark.parametrize(("form", "rate"), [(VisualTerm.OUTSIDE, 1.0), (VisualTerm.INSIDE, 6.0)])
def test_printed_forms_settle_where_their_two_terms_balance(form, rate):
    """gamma (theta - x) + rate K_v(|theta_img - x|) (theta_img - x) = 0, with the camera wrong and no guard."""
    gains = replace(GAINS, visual_term=form, tyre_first=False)
    x = run(on_road(0.3), 0.3, 4.0, gains, theta_img=0.8)[0][-1]
    K_v = SCHEDULER.K_v(0.8 - x)
    assert K_v > 0.0
    assert gains.gamma * (0.3 - x) + rate * K_v * (0.8 - x) == pytest.approx(0.0, abs=2e-2)


def test_the_camera_hurries_the_estimate_but_does_not_drag_it_off():
    inputs = on_road(0.3)
    alone, with_camera = (run(inputs, 0.8, 0.3, theta_img=image)[0] for image in (None, 0.2))
    assert np.all(with_camera[1:] < alone[1:])
    wrong = run(inputs, 0.3, 2.0, theta_img=0.8)[0]
    assert wrong == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize(
    ("theta", "start", "theta_img"), [(0.3, 0.6, 0.8), (0.3, 0.5, 0.8), (0.6, 0.45, 0.2)]
)
def test_a_class_on_the_other_side_of_the_estimate_than_the_tyre_does_nothing(theta, start, theta_img):
    inputs = on_road(theta, slip=0.06)
    assert np.all(run(inputs, start, 0.3, theta_img=theta_img)[0] == run(inputs, start, 0.3)[0])


def test_a_class_beyond_what_the_tyre_shows_pulls_as_one_that_says_the_same():
    inputs = on_road(0.5, slip=0.06)
    beyond, same = (run(inputs, 0.8, 0.5, theta_img=theta_img)[0] for theta_img in (0.2, 0.5))
    assert beyond == pytest.approx(same, abs=2e-3)


def test_the_right_class_leaves_no_bias_of_its_own():
    assert run(on_road(0.3), 0.8, 3.0, theta_img=0.2)[0][-1] == pytest.approx(0.3, abs=1e-3)
    assert run(on_road(0.5), 0.3, 3.0, theta_img=0.6)[0][-1] == pytest.approx(0.5, abs=1e-3)


def test_an_elastic_tyre_shows_nothing_and_the_estimate_holds():
    trace, step = run(on_road(0.9, slip=0.008), 0.7, 1.0)
    assert np.all(trace == 0.7)
    assert step.theta_tyre is None


def at_sliding_limit(share, slip):
    """A wheel on the road that is this share of the one on which its tyre just slides."""
    return share * 2.0 * tyre.slip_ratio_force(slip, WHEEL.longitudinal_stiffness_n) / LOAD_N


@given(st.floats(0.5, 1.2), st.floats(0.004, 0.03))
def test_nothing_is_shown_where_theta_would_be_off_by_ten_times_what_the_used_friction_is(share, slip):
    theta = at_sliding_limit(share, slip)
    lower, upper = (
        tyre.used_friction(theta + d, slip, LOAD_N, WHEEL.longitudinal_stiffness_n) for d in (-1e-5, 1e-5)
    )
    slope = (upper - lower) / 2e-5
    inputs = on_road(theta, slip)
    shown = visible_theta(inputs.wheel_torque_nm / WHEEL.radius_m, inputs, WHEEL.longitudinal_stiffness_n)
    if slope < 0.099:
        assert shown is None
    elif slope > 0.101:
        assert shown == pytest.approx(min(theta, GREATEST_THETA), abs=1e-5)


@pytest.mark.parametrize("theta_img", [None, 0.6])
def test_a_tyre_that_hardly_slides_does_not_move_the_estimate(theta_img):
    """On 0.62 its force is 0.04 % below that of one that does not slide at all, as it does on all roads above."""
    inputs = on_road(at_sliding_limit(0.98, 0.0185), 0.0185)
    assert np.all(run(inputs, 0.7, 0.5, theta_img=theta_img)[0] == 0.7)


@pytest.mark.parametrize("slip", [0.0, 1e-4])
def test_a_wheel_that_rolls_freely_shows_no_ice(slip):
    """Without force and with no slip beyond noise any road would do."""
    inputs = WheelInputs(34.0, 34.0, 0.0, Slip(slip, 1.0), LOAD_N, 1e-4, 0.0)
    assert visible_theta(0.0, inputs, WHEEL.longitudinal_stiffness_n) is None


@pytest.mark.parametrize("known_as", ["slip_deviation", "slip_change"])
def test_noise_at_the_elastic_end_is_not_taken_for_a_slippery_road(known_as):
    """On 0.9 at L > 1 force and slip lie on the elastic line; a slip read 5 % high looks like a sliding tyre."""
    truth = on_road(0.9, slip=0.016)
    misread = truth._replace(slip=Slip(0.016 * 1.05, 1.0))
    force_n = truth.wheel_torque_nm / WHEEL.radius_m
    fooled = visible_theta(force_n, misread, WHEEL.longitudinal_stiffness_n)
    assert fooled is not None
    assert fooled < 0.7
    aware = misread._replace(**{known_as: 0.0008})
    assert visible_theta(force_n, aware, WHEEL.longitudinal_stiffness_n) is None


def test_a_wrong_class_dry_does_not_keep_the_estimator_off_a_sliding_tyre():
    """Its threshold, at 0.022, lies above the slip of 0.0195; the tyre is seen to slide all the same."""
    inputs = on_road(0.5, slip=0.0195)
    trace, step = run(inputs, 0.3, 2.0, theta_img=0.8)
    assert step.threshold > 0.0195
    assert step.excited
    assert trace[-1] == pytest.approx(0.5, abs=2e-3)


@given(
    st.floats(0.0, 0.999),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-3000.0, 3000.0),
    st.floats(1e-6, 100.0),
    st.one_of(st.none(), st.floats(0.0, 1.2)),
)
def test_whatever_comes_the_estimate_stays_in_its_domain(slip, direction, torque, step_s, theta_img):
    inputs = WheelInputs(40.0, 40.0, torque, Slip(slip, direction if slip else 0.0), LOAD_N, 1e-4, 0.0)
    state = FusionState(0.5, 0.0)
    for _ in range(5):
        state = stepped(state, inputs, GAINS, theta_img, step_s).state
        assert LEAST_THETA <= state.theta_hat <= GREATEST_THETA
        assert np.isfinite(state.s)


def test_ten_short_steps_are_one_long_one():
    """Both equations are solved exactly over a step: with the target at rest the step size does not matter."""
    inputs = on_road(0.3)
    start = settled(FusionState(0.32, 0.0), inputs, WHEEL, GAINS)
    long = stepped(start, inputs, step_s=0.01).state.theta_hat
    short = start
    for _ in range(10):
        short = stepped(short, inputs).state
    # The target moves a little with F_hat meanwhile: a first-order remainder of (gamma + K) dt of the way made.
    assert short.theta_hat == pytest.approx(long, abs=2e-4)


def test_a_wrong_class_snow_does_not_pull_below_what_the_tyre_carries():
    """Elastic on 0.9 at a used friction of 0.33: no road of 0.2 could do that."""
    inputs = on_road(0.9, slip=0.016, deviation=2e-4)
    trace, step = run(inputs, 0.8, 2.0, theta_img=0.2)
    assert step.excited
    assert step.theta_tyre is None
    least = least_theta(inputs.wheel_torque_nm / WHEEL.radius_m, inputs, WHEEL.longitudinal_stiffness_n)
    assert 0.33 < least < 0.6
    assert trace.min() > least


@given(st.floats(0.1, 1.0), st.floats(0.003, 0.1), st.floats(0.0, 0.002))
def test_least_theta_never_exceeds_the_truth(theta, slip, deviation):
    assume(slip + 2.0 * deviation < tyre.peak_slip(theta, LOAD_N, WHEEL.longitudinal_stiffness_n))
    inputs = on_road(theta, slip, deviation)
    force_n = inputs.wheel_torque_nm / WHEEL.radius_m
    assert least_theta(force_n, inputs, WHEEL.longitudinal_stiffness_n) <= theta + 1e-6


def test_a_tyre_that_does_not_slide_allows_no_road_below_the_one_on_which_it_just_would():
    inputs = on_road(0.9, slip=0.01)
    force_n = inputs.wheel_torque_nm / WHEEL.radius_m
    least = least_theta(force_n, inputs, WHEEL.longitudinal_stiffness_n)
    assert least == pytest.approx(at_sliding_limit(1.0, 0.01))
    assert least_theta(-force_n, inputs, WHEEL.longitudinal_stiffness_n) == 0.0


def test_no_road_beyond_the_greatest_is_shown_or_asked_for():
    for slip in (0.03, 0.08):
        inputs = on_road(1.6, slip)
        force_n = inputs.wheel_torque_nm / WHEEL.radius_m
        assert visible_theta(force_n, inputs, WHEEL.longitudinal_stiffness_n) in (None, GREATEST_THETA)
        assert least_theta(force_n, inputs, WHEEL.longitudinal_stiffness_n) <= GREATEST_THETA


@given(st.floats(0.1, 1.0), st.floats(0.2, 0.9), st.floats(0.0, 0.001), st.floats(0.0, 0.001))
def test_least_theta_does_not_even_where_slip_is_read_two_deviations_too_small(theta, share, noise, change):
    slip = share * tyre.peak_slip(theta, LOAD_N, WHEEL.longitudinal_stiffness_n)
    read = slip - 2.0 * (noise + change)
    assume(read > 0.0)
    inputs = on_road(theta, slip, noise, change)
    misread = inputs._replace(slip=Slip(read, 1.0))
    least = least_theta(inputs.wheel_torque_nm / WHEEL.radius_m, misread, WHEEL.longitudinal_stiffness_n)
    assert least <= theta + 1e-6


def test_the_camera_rests_for_a_way_after_the_tyre_was_seen():
    """Elastic again after it slid: a wrong class must not undo what the tyre just showed, but may speak later on."""
    elastic = on_road(0.9, slip=0.0235, deviation=1e-4)._replace(way_m=0.01)
    state = settled(FusionState(0.5, 0.0, 0.0), elastic, WHEEL, GAINS)
    trace = []
    for _ in range(round(1.5 * SEEN_HOLD_M / elastic.way_m)):
        step = stepped(state, elastic, theta_img=0.8)
        state = step.state
        trace.append(state.theta_hat)
    assert step.theta_tyre is None
    resting = round(SEEN_HOLD_M / elastic.way_m)
    assert trace[: resting - 1] == [0.5] * (resting - 1)
    assert trace[-1] > 0.5


def after_snow(theta_img, metres, flicker_every_m=None, flicker=0.2, rests=True):
    """The estimate, seen as 0.5 under the class snow, after a way on which it is not seen and a class is given."""
    elastic = on_road(0.9, slip=0.0235, deviation=1e-4)._replace(way_m=0.01)
    unseen_m = 0.0 if rests else NEVER_SEEN_M
    state = settled(FusionState(0.5, 0.0, unseen_m, 0.2, 0.2, 0.0, rests), elastic, WHEEL, GAINS)
    for k in range(round(metres / elastic.way_m)):
        other = flicker_every_m is not None and k % round(flicker_every_m / elastic.way_m) == 0
        state = stepped(state, elastic, theta_img=flicker if other else theta_img).state
    return state.theta_hat


def test_another_class_that_stands_ends_the_rest():
    """Another class is another road: what the tyre showed before no longer speaks for it."""
    assert OTHER_CLASS_M == 4.0, "twice what one picture's verdict reaches"
    assert after_snow(0.8, OTHER_CLASS_M - 0.05) == 0.5
    assert after_snow(0.8, OTHER_CLASS_M + 0.3) > 0.5


def test_a_class_that_flickers_or_stays_does_not_end_the_rest():
    assert after_snow(0.8, 20.0, flicker_every_m=OTHER_CLASS_M - 0.1) == 0.5
    assert after_snow(0.2, 100.0) == 0.5


def test_classes_that_take_turns_do_not_stand_together():
    assert after_snow(0.8, 20.0, flicker_every_m=OTHER_CLASS_M - 0.1, flicker=0.6) == 0.5


def test_once_the_tyre_was_seen_a_class_speaks_after_it_has_stood():
    """Also on the road of another class than that under which the tyre was seen."""
    assert after_snow(0.8, OTHER_CLASS_M - 0.05, rests=False) == 0.5
    assert after_snow(0.8, OTHER_CLASS_M + 0.3, rests=False) > 0.5


def test_a_class_under_which_the_tyre_was_seen_says_nothing_more():
    sliding = on_road(0.5, slip=0.06)._replace(way_m=0.01)
    elastic = on_road(0.9, slip=0.0235, deviation=1e-4)._replace(way_m=0.01)
    state = run(sliding, 0.5, 0.1, theta_img=0.8)[1].state
    seen = state.theta_hat
    for _ in range(1000):
        state = stepped(state, elastic, theta_img=0.8).state
    assert state.unseen_m > 4.0 * SEEN_HOLD_M
    assert state.theta_hat == seen


def test_a_sure_estimate_leaves_less_of_the_difference_to_the_class():
    """Not seen, and 0.3 from the class: half of that or less is within K_v's dead zone."""
    elastic = on_road(0.9, slip=0.0235, deviation=1e-4)
    state = settled(FusionState(0.5, 0.0), elastic, WHEEL, GAINS)
    given = (state, elastic, WHEEL, GAINS, SCHEDULER, 0.8, STEP_S)
    K_v = [fusion_step(*given, VarianceModel(), std * std).K_v for std in (0.05, 0.2, 0.5)]
    assert K_v[0] == 0.0
    assert 0.0 < K_v[1] < K_v[2] == pytest.approx(fusion_step(*given).K_v)


def test_beside_a_tyre_that_is_seen_a_class_hurries_a_sure_estimate_as_any():
    """How sure the estimate is weighs a class that speaks alone."""
    sliding = on_road(0.3)
    given = (settled(FusionState(0.8, 0.0), sliding, WHEEL, GAINS), sliding, WHEEL, GAINS, SCHEDULER)
    sure = fusion_step(*given, 0.2, STEP_S, VarianceModel(), 1e-4)
    assert sure.K_v == fusion_step(*given, 0.2, STEP_S).K_v == pytest.approx(SCHEDULER.K_v(0.5), rel=1e-3)


def test_a_locked_wheel_moves_neither_estimate_nor_force():
    """Its torque is the commanded one, which the road need not give."""
    locked = on_road(0.5, slip=0.999)._replace(
        wheel_torque_nm=-900.0, slip=Slip(0.999, -1.0), torque_known=False, wheel_speed_rad_s=0.0
    )
    state = settled(FusionState(0.7, 0.0), locked, WHEEL, GAINS)
    for _ in range(500):
        step = stepped(state, locked, theta_img=0.2)
        state = step.state
    assert state.theta_hat == 0.7
    assert not step.excited
    assert step.tyre_force_n == pytest.approx(
        tyre.force(0.7, 0.999, LOAD_N, WHEEL.longitudinal_stiffness_n, -1.0)
    )


def noisy_course(rng, steps=400):
    """Inputs of a wheel whose slip comes and goes, locked at times, and classes that come, change and fail."""
    slip, theta_img = 0.03, None
    for k in range(steps):
        if k % 40 == 0:
            slip, theta_img = rng.choice([0.0, 0.004, 0.02, 0.03, 0.08]), rng.choice([None, 0.2, 0.6, 0.8])
        noisy = on_road(0.4, abs(slip + 1e-4 * rng.standard_normal()), deviation=1e-4, change=1e-5)
        yield (
            noisy._replace(way_m=0.01, torque_known=k % 150 < 140, slip_noise=1e-4, slip_bias_deviation=1e-4),
            theta_img,
        )


def test_the_way_since_the_tyre_was_seen_begins_anew_at_each_sight_of_it():
    state, unseen_m = FusionState(0.8, 0.0), []
    for inputs, _ in noisy_course(np.random.default_rng(5)):
        state = fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, None, STEP_S).state
        unseen_m.append(state.unseen_m)
    assert min(unseen_m) == 0.0
    assert 0.3 < max(unseen_m[100:]) < 4.0


def test_a_step_without_a_picture_is_the_same_whatever_class_came_before():
    before = FusionState(0.6, 0.0)
    with_class = before._replace(theta_img=0.8, road_img=0.8, rests=True)
    for inputs, _ in noisy_course(np.random.default_rng(3)):
        alone, after = (
            fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, None, STEP_S)
            for state in (before, with_class)
        )
        assert after.dynamics == alone.dynamics
        assert (after.threshold, after.excited, after.K_v) == (alone.threshold, alone.excited, 0.0)
        before, with_class = alone.state, after.state
