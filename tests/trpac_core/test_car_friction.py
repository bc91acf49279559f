"""The car's one TRPAC: the stated rule, and that its deviation is honest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.car_friction import Friction, car_friction, lower, surer

EVEN = (3300.0, 3300.0, 3300.0, 3300.0)
theta = st.floats(0.05, 1.2)
deviation = st.floats(0.0, 0.3)
friction = st.builds(Friction, theta, deviation)


def car(*thetas, deviation=0.01, load_n=EVEN):
    return car_friction(tuple(Friction(value, deviation) for value in thetas), load_n, 0.08)


def test_an_even_road_gives_its_friction():
    assert car(0.5, 0.5, 0.5, 0.5).theta == pytest.approx(0.5)


def test_on_split_friction_the_front_uses_both_sides_and_the_rear_the_lower_one():
    # A quarter of the weight on each wheel: (0.3 + 0.8 + 2 * 0.3) / 4.
    assert car(0.3, 0.8, 0.3, 0.8).theta == pytest.approx(0.425)
    assert car(0.8, 0.3, 0.8, 0.3).theta == pytest.approx(0.425)


def test_wheels_count_with_their_loads():
    assert car(0.3, 0.8, 0.3, 0.8, load_n=(4000.0, 4000.0, 2000.0, 2000.0)).theta == pytest.approx(
        (4000.0 * 0.3 + 4000.0 * 0.8 + 4000.0 * 0.3) / 12_000.0
    )


def test_a_wheel_that_shows_nothing_takes_its_partners_road():
    known, unknown = Friction(0.3, 0.02), Friction(0.8, 0.29)
    for wheels in ((known, known, unknown, unknown), (unknown, unknown, known, known)):
        assert car_friction(wheels, EVEN, 0.08).theta == pytest.approx(0.3)
    taken, _ = surer(unknown, known, 0.08)
    assert taken == (0.3, pytest.approx(np.hypot(0.02, 0.08)))


@pytest.mark.parametrize("silent", range(4))
def test_a_partner_is_the_wheel_behind_or_ahead_and_not_one_of_the_other_side(silent):
    wheels = [Friction(theta, 0.02) for theta in (0.3, 0.8, 0.3, 0.8)]
    wheels[silent] = Friction(0.5, 0.29)
    assert car_friction(tuple(wheels), EVEN, 0.08).theta == pytest.approx(0.425)


def test_a_wheel_that_is_sure_keeps_its_own_road():
    own = Friction(0.8, 0.02)
    assert surer(own, Friction(0.3, 0.001), 0.08)[0] is own


def test_four_ignorant_wheels_know_no_more_than_one():
    nothing = Friction(0.8, 0.29)
    assert car_friction((nothing,) * 4, EVEN, 0.08).deviation == pytest.approx(0.29, rel=1e-6)


GRID = np.linspace(-8.0, 8.0, 321)
MASS = np.exp(-0.5 * GRID**2) / np.exp(-0.5 * GRID**2).sum()


@given(first=friction, second=friction)
def test_lower_is_clarks_moment(first, second):
    one = first.theta + first.deviation * GRID[:, None]
    other = second.theta + second.deviation * GRID[None, :]
    stated = lower(first, second)
    square = MASS @ (np.minimum(one, other) - stated.theta) ** 2 @ MASS
    assert stated.deviation**2 == pytest.approx(square, rel=0.02, abs=1e-7)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 1.0])
def test_deviation_covers_the_error_whatever_the_wheels_have_in_common(correlation):
    rng = np.random.default_rng(2)
    thetas, deviations = np.array([0.35, 0.8, 0.3, 0.85]), np.array([0.05, 0.03, 0.06, 0.04])
    common = rng.standard_normal((20_000, 1))
    own = rng.standard_normal((20_000, 4))
    errors = deviations * (np.sqrt(correlation) * common + np.sqrt(1.0 - correlation) * own)
    truth = car(*thetas).theta
    stated = [
        car_friction(tuple(map(Friction, thetas + error, deviations)), EVEN, 1.0) for error in errors[:2000]
    ]
    inside = np.mean([abs(one.theta - truth) <= 2.0 * one.deviation for one in stated])
    assert inside > 0.94


@given(wheels=st.tuples(friction, friction, friction, friction))
def test_the_car_lies_between_its_wheels(wheels):
    stated = car_friction(wheels, (3000.0, 3500.0, 2500.0, 4000.0), 0.08)
    thetas = [wheel.theta for wheel in wheels]
    assert min(thetas) - 1e-9 <= stated.theta <= max(thetas) + 1e-9
    assert stated.deviation <= np.hypot(max(wheel.deviation for wheel in wheels), 0.08) * 1.5
