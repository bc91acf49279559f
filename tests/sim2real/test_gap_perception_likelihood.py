"""The likelihood of crossings, against SciPy's Student's t."""

import numpy as np
import pytest
from scipy.stats import t as student

from sim2real.perception.crossings import find_crossings
from sim2real.perception.likelihood import (
    ERROR_M,
    LEAST_SHARE,
    LEAST_WIDTH_M,
    SCALES,
    likeliest,
    over_scales,
    profiles,
)


def test_it_is_the_probability_of_the_bracket_per_width():
    rng = np.random.default_rng(0)
    low = rng.normal(0.0, 1.0, 12)
    high = low + rng.uniform(0.1, 1.5, 12)
    shift = rng.normal(0.0, 2.0, (5, 12))
    for row, scale in zip(over_scales(shift, low, high, SCALES), SCALES, strict=True):
        inside = student.cdf((high - shift) / (scale * ERROR_M), 4) - student.cdf(
            (low - shift) / (scale * ERROR_M), 4
        )
        np.testing.assert_allclose(row, np.log(inside / (high - low)).sum(axis=1), rtol=1e-6)


def test_a_bracket_has_a_least_width_and_a_crossing_a_least_share():
    (((narrow,),), ((far,),)) = (
        over_scales(np.array([[shift]]), np.array([0.0]), np.array([0.0]), SCALES[:1])
        for shift in (0.0, 1e12)
    )
    half = 0.5 * LEAST_WIDTH_M / ERROR_M
    assert narrow == pytest.approx(np.log((student.cdf(half, 4) - student.cdf(-half, 4)) / LEAST_WIDTH_M))
    assert far == pytest.approx(np.log(LEAST_SHARE / LEAST_WIDTH_M))


def test_no_crossing_says_nothing_and_a_lost_one_is_lost():
    none = np.zeros(0)
    assert np.all(over_scales(np.zeros((3, 0)), none, none, SCALES) == 0.0)
    lost = np.array([np.nan])
    assert np.all(np.isnan(over_scales(np.zeros((1, 1)), lost, lost + 1.0, SCALES)))


@pytest.mark.parametrize("shape", [(0,), (3, 0), (3, 2, 0)])
def test_shifts_of_no_crossing_keep_their_shape(shape):
    none = find_crossings([])
    assert profiles(none, np.zeros(shape)).shape[2:] == shape[:-1]
    assert np.all(likeliest(none, np.zeros(shape), shifted=False) == 0.0)
