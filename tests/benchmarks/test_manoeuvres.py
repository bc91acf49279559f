"""Braking, locking, coasting, reversing and cycling torque from 1 to 40 m/s: no confident wrong claim."""

import pytest

from benchmarks.accuracy.manoeuvres import MANOEUVRES, measure


@pytest.mark.parametrize("name", list(MANOEUVRES))
@pytest.mark.parametrize(
    ("speed_m_s", "theta"), [(1.0, 0.3), (3.0, 1.2), (10.0, 0.05), (20.0, 0.5), (40.0, 0.1)]
)
def test_no_claim_is_confidently_wrong(name, speed_m_s, theta):
    assert measure(name, speed_m_s, theta)["confidently_wrong"] <= 0.02


@pytest.mark.parametrize("theta", [0.1, 0.5])
def test_braking_shows_the_road_as_driving_does(theta):
    found = measure("braking", 10.0, theta)
    assert abs(found["TRPAC"] - theta) < max(0.05, 2.0 * found["TRPAC_std"])


def test_coasting_says_that_nothing_is_known():
    assert measure("coasting", 20.0, 0.5)["TRPAC_std"] > 0.3
