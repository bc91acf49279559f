"""Means of slip and used friction while the wheel stays at one point of the tyre's curve."""

import math

import numpy as np
import pytest

from trpac_core.stationary_mean import (
    CURVE_SHARE,
    GREATEST_GAMMA_FACTOR,
    MEMORY_S,
    MOVED_DEVIATIONS,
    NO_MEAN,
    SHORT_MEAN_S,
    StationaryMean,
    gamma_factor,
    least_slip,
    with_reading,
)

STEP_S, TAU_S, NOISE = 1e-3, 0.01, 1e-4


def filtered_noise(random: np.random.Generator, number: int) -> np.ndarray:
    """White noise through the sensors' filter, of deviation 1."""
    share = 1.0 - math.exp(-STEP_S / TAU_S)
    values, value = np.empty(number), 0.0
    for k, raw in enumerate(random.standard_normal(number) * math.sqrt((2.0 - share) / share)):
        value += share * (raw - value)
        values[k] = value
    return values


def doubt(mean: StationaryMean, noise: float) -> float:
    """What is taken off a mean slip [-]."""
    return mean.slip - least_slip(mean, noise, 2.0 * TAU_S)


@pytest.mark.parametrize("number", [50, 200])
def test_a_mean_is_at_least_as_sure_as_it_says(number: int) -> None:
    random, ends = np.random.default_rng(1), []
    for _ in range(300):
        mean = NO_MEAN
        for value in filtered_noise(random, 100 + number)[100:]:
            # An open gate: what is asked here is what a mean of that length leaves of the noise.
            mean = with_reading(mean, NOISE * value, 0.2, 0.0, 1.0, STEP_S)
        ends.append(mean.slip)
    significance = 2.0 + 0.5 * math.exp(-mean.duration_s / SHORT_MEAN_S)
    stated = doubt(mean._replace(slip=0.0, rise=0.0), NOISE) / significance
    assert 0.75 * stated < np.std(ends) < 1.1 * stated
    assert stated < 0.6 * NOISE


@pytest.mark.parametrize(
    ("duration_s", "deviations"), [(0.0, 2.5), (SHORT_MEAN_S, 2.0 + 0.5 / math.e), (5.0, 2.0)]
)
def test_the_younger_a_mean_the_farther_it_must_be_from_a_tyre_that_does_not_slide(
    duration_s: float, deviations: float
) -> None:
    """Without noise what is left is the doubt about the tyre's curve."""
    mean = StationaryMean(0.03, 0.2, 0.0, duration_s)
    assert doubt(mean, 0.0) == pytest.approx(deviations * CURVE_SHARE * 0.03)


def test_noise_and_curve_add_in_squares_and_no_mean_lessens_the_curves() -> None:
    fresh, long = StationaryMean(0.03, 0.2, 0.0, 0.0), StationaryMean(0.03, 0.2, 0.0, 10.0)
    assert doubt(fresh, NOISE) == pytest.approx(2.5 * math.hypot(NOISE, CURVE_SHARE * 0.03))
    forgetting = long._replace(duration_s=2.0 * MEMORY_S)
    assert doubt(long, NOISE) == pytest.approx(doubt(forgetting, NOISE), rel=0.01)
    assert doubt(long, NOISE) == pytest.approx(2.0 * math.hypot(NOISE / math.sqrt(21.0), CURVE_SHARE * 0.03))


@pytest.mark.parametrize("rise", [1e-3, -1e-3])
def test_a_mean_of_a_tyre_that_is_being_loaded_or_unloaded_proves_less(rise: float) -> None:
    """Slip's way ahead of its own course counts as a deviation of that size."""
    mean = StationaryMean(0.03, 0.2, rise, 5.0)
    assert doubt(mean, 0.0) == pytest.approx(2.0 * (1e-3 + CURVE_SHARE * 0.03))


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
