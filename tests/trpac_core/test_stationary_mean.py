"""Means of slip and used friction while the wheel stays at one point of the tyre's curve."""

import math

import numpy as np
import pytest
from trpac_core.excitation import FuzzyScheduler
from trpac_core.identifiability import (
    SHORT_MEAN_S,
    WheelInputs,
    confirmed_theta,
    point_of_mean,
    significance_of_mean,
)

from trpac_core.dife import FusionState, Gains, Wheel, fusion_step, settled
from trpac_core.slip import Slip
from trpac_core.stationary_mean import (
    GREATEST_GAMMA_FACTOR,
    MEMORY_S,
    MOVED_DEVIATIONS,
    NO_MEAN,
    StationaryMean,
    gamma_factor,
    mean_slip_deviation,
    unsettled_slip,
    with_reading,
)
from trpac_core.tyre import force, sliding_onset_friction

STEP_S, TAU_S, NOISE = 1e-3, 0.01, 1e-4
WHEEL, SCHEDULER, GAINS = Wheel(1.2, 0.29, 50_000.0), FuzzyScheduler(), Gains()


def filtered_noise(random: np.random.Generator, number: int) -> np.ndarray:
    """White noise through the sensors' filter, of deviation 1."""
    share = 1.0 - math.exp(-STEP_S / TAU_S)
    values, value = np.empty(number), 0.0
    for k, raw in enumerate(random.standard_normal(number) * math.sqrt((2.0 - share) / share)):
        value += share * (raw - value)
        values[k] = value
    return values


@pytest.mark.parametrize("number", [50, 200])
def test_a_mean_is_at_least_as_sure_as_it_says(number: int) -> None:
    random, ends = np.random.default_rng(1), []
    for _ in range(300):
        mean = NO_MEAN
        for value in filtered_noise(random, 100 + number)[100:]:
            # An open gate: what is asked here is what a mean of that length leaves of the noise.
            mean = with_reading(mean, 0.01 + NOISE * value, 0.2, 0.0, 1.0, STEP_S)
        ends.append(mean.slip)
    stated = mean_slip_deviation(mean, NOISE, 2.0 * TAU_S, 0.0)
    assert 0.75 * stated < np.std(ends) < 1.1 * stated
    assert stated < 0.6 * NOISE


def test_no_mean_lessens_a_constant_doubt() -> None:
    long = StationaryMean(0.01, 0.2, 0.0, 10.0)
    assert mean_slip_deviation(long, NOISE, 2.0 * TAU_S, 3.0 * NOISE) >= 3.0 * NOISE
    forgetting = StationaryMean(0.01, 0.2, 0.0, 2.0 * MEMORY_S)
    assert mean_slip_deviation(long, NOISE, 2.0 * TAU_S, 0.0) == mean_slip_deviation(
        forgetting, NOISE, 2.0 * TAU_S, 0.0
    )


def test_it_begins_anew_where_slip_goes_elsewhere_or_the_tyre_is_being_loaded() -> None:
    mean = with_reading(with_reading(NO_MEAN, 0.01, 0.2, 0.0, NOISE, STEP_S), 0.01, 0.22, 0.0, NOISE, STEP_S)
    assert mean.duration_s == pytest.approx(2.0 * STEP_S)
    assert mean.friction == pytest.approx(0.21)
    for side in (1.0, -1.0):
        away = 0.01 + side * 1.1 * MOVED_DEVIATIONS * NOISE
        assert with_reading(mean, away, 0.3, 0.0, NOISE, STEP_S) == StationaryMean(away, 0.3, 0.0, STEP_S)
        assert with_reading(mean, 0.01, 0.3, side * 5.0 * NOISE, NOISE, STEP_S).duration_s == STEP_S


def test_a_long_mean_forgets_with_its_memory() -> None:
    mean = StationaryMean(0.01, 0.2, 0.0, 10.0)
    for _ in range(round(MEMORY_S / STEP_S)):
        mean = with_reading(mean, 0.01 + NOISE, 0.3, NOISE, NOISE, STEP_S)
    new = 1.0 - math.exp(-1.0)
    assert mean.slip == pytest.approx(0.01 + new * NOISE, abs=5e-3 * NOISE)
    assert mean.friction == pytest.approx(0.2 + new * 0.1, abs=5e-4)
    assert mean.rise == pytest.approx(new * NOISE, rel=5e-3)


def test_the_estimate_follows_a_mean_quicker_within_bounds() -> None:
    assert gamma_factor(NO_MEAN, 2.0 * TAU_S) == 1.0
    assert gamma_factor(StationaryMean(0.01, 0.2, 0.0, TAU_S), 2.0 * TAU_S) == 1.5
    assert gamma_factor(StationaryMean(0.01, 0.2, 0.0, 1.0), 2.0 * TAU_S) == GREATEST_GAMMA_FACTOR


def test_a_moved_slip_is_forgotten_as_the_force_settles_and_noise_does_not_count() -> None:
    assert unsettled_slip(0.0, 2.0 * NOISE, NOISE, 0.01) == 0.0
    moved = unsettled_slip(0.0, 50.0 * NOISE, NOISE, 0.01)
    assert moved == 50.0 * NOISE
    assert unsettled_slip(moved, 0.0, NOISE, 0.016) == pytest.approx(moved / math.e)
    assert unsettled_slip(moved, 3.0 * NOISE, NOISE, 0.016) == pytest.approx(moved / math.e)


def at_rest(theta: float, slip: float, doubt: float) -> tuple[WheelInputs, FusionState]:
    """A wheel that stays at one point of the curve, and an estimate of 0.8."""
    load_n, noise = 3217.0, 1.5e-4
    force_n = force(theta, slip, load_n, WHEEL.longitudinal_stiffness_n, 1.0)
    # The wheel gains speed with the car; at an even slip that is all that torque and force differ by: left out here.
    inputs = WheelInputs(
        22.0, 22.0, force_n * WHEEL.radius_m, Slip(slip, 1.0), load_n, max(noise, doubt), noise, 0.0, True,
        noise, doubt, 0.0, 2.0 * TAU_S,
    )  # fmt: skip
    return inputs, settled(FusionState(0.8, 0.0), inputs, WHEEL, GAINS)


def shown_after(theta: float, slip: float, doubt: float) -> float | None:
    """Time until a wheel at rest on the curve shows theta [s]; None within 0.3 s never."""
    inputs, state = at_rest(theta, slip, doubt)
    for step in range(300):
        outcome = fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, None, STEP_S)
        if outcome.theta_tyre is not None:
            assert outcome.theta_tyre == pytest.approx(theta, abs=1e-3)
            return step * STEP_S
        state = outcome.state
    return None


def test_time_shows_what_one_reading_hides_and_doubt_still_hides_it() -> None:
    found = shown_after(0.18, 0.0068, 3e-5)
    assert found is not None
    assert 0.0 < found < 0.2
    assert shown_after(0.18, 0.0068, 5e-4) is None
    assert shown_after(0.9, 0.0068, 3e-5) is None


def test_the_estimate_follows_a_mean_that_has_been_held_at_twice_gamma() -> None:
    inputs, state = at_rest(0.3, 0.03, 0.0)
    errors = []
    for _ in range(100):
        state = fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, None, STEP_S).state
        errors.append(state.theta_hat - 0.3)
    assert errors[99] / errors[49] == pytest.approx(math.exp(-2.0 * GAINS.gamma * 0.05), rel=0.05)


def test_a_class_hurries_an_estimate_that_follows_a_mean_and_leaves_it_on_the_tyres() -> None:
    inputs, alone = at_rest(0.4, 0.03, 0.0)
    fused = alone
    for step in range(300):
        alone, fused = (
            fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, theta_img, STEP_S).state
            for state, theta_img in ((alone, None), (fused, 0.2))
        )
        assert 0.4 - 1e-3 < fused.theta_hat <= alone.theta_hat
        if step == 50:
            assert fused.theta_hat < alone.theta_hat - 3e-3


def test_a_wheel_that_rolled_freely_in_between_begins_a_new_mean() -> None:
    inputs, state = at_rest(0.3, 0.03, 0.0)
    rolling = inputs._replace(wheel_torque_nm=0.0, slip=Slip(0.0, 0.0))
    duration_s = []
    for now in (*[inputs] * 50, rolling, inputs):
        state = fusion_step(state, now, WHEEL, GAINS, SCHEDULER, None, STEP_S).state
        duration_s.append(state.mean.duration_s)
    assert duration_s[-3:] == [pytest.approx(50 * STEP_S), 0.0, STEP_S]


@pytest.mark.parametrize(
    ("duration_s", "deviations"), [(0.0, 2.5), (SHORT_MEAN_S, 1.5 + 1.0 / math.e), (5.0, 1.5)]
)
def test_the_younger_a_mean_the_farther_it_must_be_from_a_tyre_that_does_not_slide(
    duration_s: float, deviations: float
) -> None:
    inputs, doubt = at_rest(0.3, 0.03, 0.0)[0]._replace(slip_noise=0.0, slip_bias_deviation=1e-3), 1e-3
    mean = StationaryMean(0.03, 0.2, 0.0, duration_s)
    slides_below = point_of_mean(mean, inputs, 50_000.0, significance_of_mean(mean)).slides_below
    assert slides_below == pytest.approx(
        sliding_onset_friction(0.03 - deviations * doubt, inputs.load_n, 50_000.0)
    )


@pytest.mark.parametrize("rise", [1e-3, -1e-3])
def test_a_mean_of_a_tyre_that_is_being_loaded_or_unloaded_proves_less(rise: float) -> None:
    """Slip's way ahead of its own course counts as a deviation of that size."""
    inputs = at_rest(0.3, 0.03, 0.0)[0]._replace(slip_noise=0.0, slip_bias_deviation=0.0)
    mean = StationaryMean(0.03, 0.2, rise, 5.0)
    slides_below = point_of_mean(mean, inputs, 50_000.0, significance_of_mean(mean)).slides_below
    assert slides_below == pytest.approx(sliding_onset_friction(0.03 - 1.5e-3, inputs.load_n, 50_000.0))


def estimate_after(theta: float, slip: float, doubt: float, theta_img: float | None) -> float:
    """Estimate after 0.3 s of a wheel at rest on the curve [-]."""
    inputs, state = at_rest(theta, slip, doubt)
    for _ in range(300):
        state = fusion_step(state, inputs, WHEEL, GAINS, SCHEDULER, theta_img, STEP_S).state
    return state.theta_hat


def test_what_the_tyre_alone_does_not_prove_counts_where_the_class_says_the_same() -> None:
    unsure = (0.18, 0.0068, 5e-4)
    assert estimate_after(*unsure, None) == 0.8
    assert estimate_after(*unsure, 0.2) == pytest.approx(0.18, abs=0.005)
    far = [estimate_after(*unsure, theta_img) for theta_img in (0.5, 0.8)]
    assert min(far) > 0.4, "a class that is far from what the tyre would show backs nothing"


@pytest.mark.parametrize(("theta_img", "agree"), [(0.2, False), (0.35, True), (0.5, True), (0.8, False)])
def test_only_a_class_near_what_the_tyre_would_show_backs_it(theta_img: float, agree: bool) -> None:
    inputs, _ = at_rest(0.45, 0.017, 1.5e-3)
    friction = inputs.wheel_torque_nm / WHEEL.radius_m / inputs.load_n
    mean = StationaryMean(inputs.slip.size, friction, 0.0, 0.1)
    point = point_of_mean(mean, inputs, WHEEL.longitudinal_stiffness_n, significance_of_mean(mean))
    assert point.theta(friction) is None, "the tyre alone is not sure"
    confirmed = confirmed_theta(theta_img, mean, inputs, WHEEL.longitudinal_stiffness_n)
    assert confirmed == (pytest.approx(0.45, abs=1e-3) if agree else None)
    short = mean._replace(duration_s=0.01)
    assert confirmed_theta(theta_img, short, inputs, WHEEL.longitudinal_stiffness_n) is None


def test_means_survive_a_saved_state() -> None:
    from trpac_core.estimator import EstimatorConfig, Sensors, TrpacEstimator

    first, second = TrpacEstimator(EstimatorConfig()), TrpacEstimator(EstimatorConfig())
    readings = Sensors(10.0 / 0.29 / 0.98, 200.0, 10.0, longitudinal_acceleration_m_s2=1.5)
    for _ in range(200):
        first.step(STEP_S, readings)
    second.restore(first.state())
    assert first._state.fusion.mean.duration_s > 0.1
    for _ in range(20):
        assert first.step(STEP_S, readings) == second.step(STEP_S, readings)
