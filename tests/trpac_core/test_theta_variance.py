"""The variance's parts against what they are derived from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trpac_core.theta_variance import (
    GREATEST_ROAD,
    LEAST_ROAD,
    Evidence,
    VarianceModel,
    advanced_variance,
    bounded_variance,
    camera_share,
    drifted_variance,
    reading_noise,
    unknown_variance,
    variance_with_camera,
)

from trpac_core.tyre import tyre_at_slip

MODEL = VarianceModel()
LOAD_N, C_X = 3000.0, 50_000.0


def settled_std(theta, slip, line_share=0.0, noise_share=0.0, torque_friction=0.0, model=MODEL):
    """Standard deviation after 2 s of a tyre that shows theta."""
    at = tyre_at_slip(slip, LOAD_N, C_X)
    evidence = Evidence(theta, at.friction(theta), at, line_share, noise_share, torque_friction)
    variance, lag = unknown_variance(model, theta), 0.0
    for _ in range(200):
        variance, lag = advanced_variance(model, variance, lag, theta, evidence, 0.11, 12.5, 0.0, 0.01)
    return variance**0.5


@given(st.floats(-0.1, 1.1), st.floats(0.1, 1.0))
def test_two_deviations_hold_95_percent_of_the_roads_above_a_bound(theta_hat, least):
    roads = np.linspace(least, GREATEST_ROAD, 20_001)
    held = np.abs(roads - theta_hat) <= 2.0 * bounded_variance(theta_hat, least) ** 0.5
    assert held.mean() == pytest.approx(0.95, abs=1e-3)


@given(st.floats(0.05, 1.2))
def test_two_deviations_of_the_unknown_hold_95_percent_of_all_roads(theta_hat):
    roads = np.linspace(LEAST_ROAD, GREATEST_ROAD, 20_001)
    held = np.abs(roads - theta_hat) <= 2.0 * unknown_variance(MODEL, theta_hat) ** 0.5
    assert held.mean() == pytest.approx(0.95, abs=1e-2)  # 0.33 is a rounded figure


def test_a_class_may_claim_the_less_the_surer_the_estimate_is():
    """All of the difference where nothing is known, next to nothing where the estimate is as good as the tyre's."""
    stds = (0.02, 0.1, 0.2, unknown_variance(MODEL, 0.5) ** 0.5)
    shares = [camera_share(MODEL, std * std, 0.5) for std in stds]
    assert shares == sorted(shares)
    assert shares[0] < 0.03
    assert shares[-1] == pytest.approx(1.0)


def test_the_tyre_tells_less_the_closer_it_is_to_not_sliding():
    stds = [settled_std(0.5, slip, line_share=0.01) for slip in (0.06, 0.03, 0.0205, 0.0186)]
    assert stds == sorted(stds)
    assert stds[0] < 0.03
    assert stds[-1] > 0.1


def test_a_car_known_less_well_leaves_a_larger_deviation_however_long_it_is_excited():
    stds = [settled_std(0.5, 0.03, line_share=share) for share in (0.0, 0.02, 0.05, 0.1)]
    assert stds == sorted(stds)
    assert stds[-1] > 3.0 * stds[0]


def test_deviation_is_that_of_drawn_errors_of_the_elastic_line():
    """Monte Carlo through the tyre's own inverse, far enough from L = 1 for all draws to slide."""
    theta, slip, share = 0.3, 0.03, 0.05
    at = tyre_at_slip(slip, LOAD_N, C_X)
    draws = np.random.default_rng(1).normal(1.0, share, 4000)
    found = np.array([at.theta(at.friction(theta) * draw) for draw in draws])
    model = (settled_std(theta, slip, line_share=share) ** 2 - (MODEL.car_share * theta) ** 2) ** 0.5
    assert model == pytest.approx(found.std(), rel=0.1)


@pytest.mark.parametrize(("noise_share", "torque_friction"), [(0.05, 0.0), (0.0, 0.01), (0.04, 0.01)])
def test_noise_of_one_reading_is_that_of_drawn_ones(noise_share, torque_friction):
    theta, at = 0.3, tyre_at_slip(0.03, LOAD_N, C_X)
    rng, friction = np.random.default_rng(2), at.friction(theta)
    draws = friction + friction * noise_share * rng.standard_normal(4000)
    draws += torque_friction * rng.standard_normal(4000)
    found = np.std([at.theta(draw) for draw in draws])
    assert reading_noise(friction, at, noise_share, torque_friction) == pytest.approx(found / theta, rel=0.1)


def test_what_no_driving_can_tell_of_load_and_torque_stays():
    sure = VarianceModel(tyre_share=0.0, car_share=0.04)
    assert settled_std(0.3, 0.05, model=sure) == pytest.approx(0.04 * 0.3)


def test_of_noise_as_much_stays_as_the_estimator_leaves():
    """`settled_std` has an estimator that leaves 0.11 of its variance."""
    left, friction = 0.11**0.5, tyre_at_slip(0.03, LOAD_N, C_X).friction(0.3)
    of_slip, of_torque = settled_std(0.3, 0.03, 0.0, 0.06), settled_std(0.3, 0.03, 0.0, 0.0, 0.01)
    assert of_slip == pytest.approx(settled_std(0.3, 0.03, 0.06 * left), rel=1e-3)
    assert of_torque == pytest.approx(settled_std(0.3, 0.03, 0.01 / friction * left), rel=1e-3)


@pytest.mark.parametrize("two_deviations_off", [-1.0, 0.0, 1.0])
def test_a_tyre_that_is_not_seen_to_slide_bounds_the_road_from_below(two_deviations_off):
    """However its force is read within two deviations: no tighter than the true road would."""
    at = tyre_at_slip(0.015, LOAD_N, C_X)
    theta, deviation = 0.4, (0.04**2 + 0.03**2 + MODEL.tyre_share**2) ** 0.5
    friction = at.friction(theta) * (1.0 + 2.0 * deviation * two_deviations_off)
    evidence = Evidence(None, friction, at, 0.04, 0.03, 0.0)

    def bounded(theta_hat, variance):
        return advanced_variance(MODEL, variance, 0.0, theta_hat, evidence, 0.11, 12.5, 0.0, 0.01)[0]

    unknown = unknown_variance(MODEL, 1.0)
    assert bounded_variance(1.0, theta) <= bounded(1.0, unknown) < unknown
    assert bounded(0.8, 1e-4) == pytest.approx(1e-4), "an estimate within the bound stays as sure as it was"
    assert bounded(0.06, 1e-4) > 0.01, "one below it is off by that"


def test_a_distance_within_the_readings_noise_is_no_error_of_the_estimate():
    at = tyre_at_slip(0.05, LOAD_N, C_X)
    evidence = Evidence(0.3, at.friction(0.3), at, 0.0, 0.1, 0.0)
    variance, lag = 1e-4, 0.0
    for _ in range(200):
        variance, lag = advanced_variance(MODEL, variance, lag, 0.32, evidence, 0.11, 12.5, 0.0, 0.01)
    assert lag == pytest.approx(-0.02)
    assert variance**0.5 < 0.018


@pytest.mark.parametrize("step_s", [0.001, 0.02, 0.1])
def test_the_smoothed_distance_never_overshoots(step_s):
    at = tyre_at_slip(0.05, LOAD_N, C_X)
    evidence = Evidence(0.3, at.friction(0.3), at, 0.01, 0.01, 0.0)
    _, lag = advanced_variance(MODEL, 1e-4, 0.0, 0.8, evidence, 0.11, 12.5, 0.0, step_s)
    assert -0.5 <= lag < 0.0


def test_no_way_makes_surer_and_no_class_claims_more_than_its_distance():
    unknown = unknown_variance(MODEL, 0.3)
    assert drifted_variance(MODEL, 2.0 * unknown, 0.3, 100.0) == 2.0 * unknown
    assert camera_share(MODEL, 2.0 * unknown, 0.3) == 1.0


def test_knowledge_fades_with_the_way_up_to_nothing():
    variances = [drifted_variance(MODEL, 1e-4, 0.3, way) for way in (0.0, 1.0, 10.0, 1e4)]
    assert variances == sorted(variances)
    assert variances[1] - variances[0] == pytest.approx(MODEL.road_change**2, rel=0.05)
    assert variances[-1] == pytest.approx(unknown_variance(MODEL, 0.3))


def test_a_tyre_that_goes_on_showing_something_else_widens_at_once():
    at = tyre_at_slip(0.05, LOAD_N, C_X)
    evidence = Evidence(0.3, at.friction(0.3), at, 0.01, 0.01, 0.0)
    variance, lag = 1e-4, 0.0
    for _ in range(5):
        variance, lag = advanced_variance(MODEL, variance, lag, 0.8, evidence, 0.11, 12.5, 0.0, 0.01)
    assert variance**0.5 > 0.4


@given(st.floats(0.05, 3.0), st.floats(1e-4, 0.3), st.floats(0.0, 0.3), st.floats(0.0, 0.3))
def test_any_force_leaves_a_variance_between_none_and_that_of_the_unknown(fraction, slip, line, noise):
    """Also one far beyond the elastic line, which no tyre of the model has but a car with another tyre."""
    at = tyre_at_slip(slip, LOAD_N, C_X)
    evidence = Evidence(0.5, fraction * at.adhering * at.g_0, at, line, noise, 0.0)
    variance, lag = advanced_variance(MODEL, 1e-4, 0.0, 0.5, evidence, 0.11, 12.5, 0.0, 0.01)
    assert 0.0 <= variance <= unknown_variance(MODEL, 0.5)
    assert lag == 0.0


def test_a_force_surely_beyond_the_elastic_one_says_only_that_the_road_has_more():
    at = tyre_at_slip(0.005, LOAD_N, C_X)
    evidence = Evidence(0.5, 1.5 * at.adhering * at.g_0, at, 0.01, 0.01, 0.0)
    variance, lag = 1e-4, 0.0
    for _ in range(400):
        variance, lag = advanced_variance(MODEL, variance, lag, 0.5, evidence, 0.11, 12.5, 0.0, 0.01)
    assert variance == pytest.approx(bounded_variance(0.5, 2.0 * at.adhering), rel=0.05)


@pytest.mark.parametrize("fraction", [0.5, 1.0, 1.5])
def test_a_car_that_is_configured_without_any_error_is_no_error(fraction):
    at = tyre_at_slip(0.01, LOAD_N, C_X)
    evidence = Evidence(0.5, fraction * at.adhering * at.g_0, at, 0.0, 0.0, 0.0)
    sure = VarianceModel(tyre_share=0.0, car_share=0.0)
    variance, _ = advanced_variance(sure, 1e-4, 0.0, 0.5, evidence, 0.11, 12.5, 0.0, 0.01)
    assert 0.0 <= variance <= unknown_variance(sure, 0.5)


@pytest.mark.parametrize("step_s", [0.002, 0.01, 0.04])
def test_variance_settles_as_the_square_of_the_loops_error(step_s):
    """theta_hat' = gamma (theta - theta_hat): what is left of an error after t is exp(-gamma t) of it."""
    at, gamma = tyre_at_slip(0.05, LOAD_N, C_X), 12.5
    evidence = Evidence(0.3, at.friction(0.3), at, 0.01, 0.0, 0.0)
    start, variances = 0.04, []
    for seconds in (0.04, 0.08, 10.0):
        variance = start
        for _ in range(round(seconds / step_s)):
            variance, _ = advanced_variance(MODEL, variance, 0.0, 0.3, evidence, 0.11, gamma, 0.0, step_s)
        variances.append(variance)
    settled = variances.pop()
    left = [(variance - settled) / (start - settled) for variance in variances]
    assert left == pytest.approx([np.exp(-gamma * 0.04) ** 2, np.exp(-gamma * 0.08) ** 2], rel=1e-6)


@given(st.floats(0.005, 0.33), st.floats(0.05, 1.2), st.floats(0.2, 0.8))
def test_camera_and_estimate_are_as_by_bayes_rule_but_no_surer_than_the_surer_of_the_two(
    std, theta_hat, theta_img
):
    """About the estimate, which is what the deviation is of: the camera's own error there is scatter and distance."""
    roads = np.linspace(-2.0, 4.0, 6001)
    scatter = MODEL.class_scatter
    weights = np.exp(-0.5 * ((roads - theta_hat) / std) ** 2 - 0.5 * ((roads - theta_img) / scatter) ** 2)
    by_bayes = np.average((roads - theta_hat) ** 2, weights=weights)
    surer = min(std**2, scatter**2 + (theta_img - theta_hat) ** 2)
    found = variance_with_camera(MODEL, std**2, theta_hat, theta_img)
    assert found == pytest.approx(max(by_bayes, surer), rel=1e-6)


def test_the_camera_narrows_where_it_agrees_and_widens_where_it_does_not():
    unknown, sure = unknown_variance(MODEL, 0.8), 1e-4
    assert variance_with_camera(MODEL, unknown, 0.8, 0.8) < unknown
    assert variance_with_camera(MODEL, unknown, 0.8, 0.2) > unknown
    assert variance_with_camera(MODEL, sure, 0.3, 0.8) == pytest.approx(sure, rel=0.1)
    assert variance_with_camera(MODEL, unknown, 0.8, None) == unknown
