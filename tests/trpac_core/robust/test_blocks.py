"""Blocks of readings: their means, a wheel's balance of which the force is known, the noise of known white noise."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.robust.blocks import Filling, Means, Noise, heard, means_of, reading

I, R, LOAD = 1.2, 0.29, 3000.0


def block(wheel_speed, speed, torque=200.0, load=LOAD, duration_s=0.01, samples=10):
    return Means(wheel_speed, torque, speed, load, duration_s, samples)


def read(before, now, friction_before=0.0, rolling=0.0):
    return reading(before, now, friction_before, I, R, rolling)


@given(st.lists(st.tuples(*[st.floats(-100.0, 100.0)] * 4, st.floats(1e-4, 1e-2)), min_size=1, max_size=20))
def test_the_means_are_those_over_time(rows):
    values, steps = np.array(rows)[:, :4], np.array(rows)[:, 4]
    sums = (values * steps[:, None]).sum(axis=0)
    found = means_of(Filling(*sums.tolist(), float(steps.sum()), len(rows)))
    assert found[:4] == pytest.approx(np.average(values, axis=0, weights=steps), rel=1e-9, abs=1e-9)
    assert found[4:] == (pytest.approx(steps.sum()), len(rows))


def test_a_block_without_a_new_value_has_one_sample():
    assert means_of(Filling(1.0, 1.0, 1.0, 1.0, 0.01, 0)).samples == 1
    assert means_of(Filling(1.0, 1.0, 1.0, 1.0, 0.01, 2)).samples == 2


@pytest.mark.parametrize(("torque_nm", "force_n"), [(300.0, 800.0), (-300.0, -800.0), (0.0, 500.0)])
@pytest.mark.parametrize("durations", [(0.01, 0.01), (0.01, 0.05)])
def test_the_wheels_balance_gives_the_force_that_drove_it(torque_nm, force_n, durations):
    """A wheel under constant torque and force gains speed evenly: omega' = (T - F R) / I."""
    rate = (torque_nm - force_n * R) / I

    def mean_over(start_s, duration_s, samples=1000):
        t = start_s + (np.arange(samples) + 0.5) * duration_s / samples
        return block(float((60.0 + rate * t).mean()), 15.0, torque_nm, duration_s=duration_s)

    before, now = mean_over(0.0, durations[0]), mean_over(durations[0], durations[1])
    found = read(before, now, friction_before=0.1)
    assert found.friction == pytest.approx(force_n / LOAD, rel=1e-9)
    assert found.friction_change == pytest.approx(force_n / LOAD - 0.1, rel=1e-9)
    assert found.duration_s == pytest.approx(sum(durations) / 2.0)


@pytest.mark.parametrize(("wheel_speed", "speed", "over"), [(60.0, 15.0, 60.0 * R), (50.0, 15.0, 15.0)])
def test_slip_is_signed_and_taken_over_the_faster_speed(wheel_speed, speed, over):
    found = read(block(wheel_speed, speed), block(wheel_speed, speed))
    assert found.slip == pytest.approx((wheel_speed * R - speed) / over)
    assert math.copysign(1.0, found.slip) == math.copysign(1.0, wheel_speed * R - speed)
    assert found.speed_m_s == pytest.approx(over)
    assert found.slip_change == 0.0


def test_a_reading_lies_between_its_blocks():
    before, now = block(50.0, 14.0, 100.0, 3000.0, samples=10), block(54.0, 14.4, 300.0, 3200.0, samples=7)
    found = read(before, now)
    rim, speed = 52.0 * R, 14.2
    assert found.slip == pytest.approx((rim - speed) / rim)
    assert found.speed_m_s == pytest.approx(rim)
    assert found.load_n == pytest.approx(3100.0)
    assert found.friction == pytest.approx((200.0 - I * 400.0) / R / 3100.0)
    assert found.slip_change == pytest.approx((4.0 * R - 0.4) / rim)
    assert found.rim_m_s == pytest.approx(50.0 * R)
    assert read(now, before).rim_m_s == pytest.approx(50.0 * R)
    assert (found.samples, read(now, before).samples) == (7, 10)


@pytest.mark.parametrize(("rim_m_s", "rolls"), [(0.99, False), (1.0, False), (1.01, True), (20.0, True)])
def test_rolling_resistance_takes_torque_of_a_wheel_that_rolls(rim_m_s, rolls):
    one = block(rim_m_s / R, rim_m_s)
    taken = read(one, one).friction - read(one, one, rolling=0.0065).friction
    assert taken == pytest.approx(0.0065 if rolls else 0.0, abs=1e-12)


def test_a_slow_wheel_has_a_slip_too():
    found = read(block(0.4 / R, 0.3), block(0.4 / R, 0.2))
    assert (found.slip, found.slip_change) == (pytest.approx(0.375), pytest.approx(0.25))


def test_at_standstill_there_is_no_slip():
    still = block(0.0, 0.0)
    found = read(still, still)
    assert (found.slip, found.slip_change, found.speed_m_s) == (0.0, 0.0, 0.0)


# Noise


def noise_of(values, step_s, least=1e-12, start=1.0):
    noise, course = Noise(start), []
    for value in values:
        noise = heard(noise, float(value), step_s, least)
        course.append(noise.variance)
    return np.array(course)


@pytest.mark.parametrize("held", [1, 5, 20])
@pytest.mark.parametrize("sigma", [0.01, 3.0])
def test_white_noise_on_a_ramp_is_read_to_ten_per_cent(held, sigma):
    """Mean over 50 s: a ramp has no second difference, and a value that is held counts once."""
    draw = np.random.default_rng(1)
    values = 5.0 * np.arange(50_000) * 1e-3 + sigma * draw.standard_normal(50_000)
    course = noise_of(np.repeat(values, held), 1e-3)
    assert math.sqrt(course[len(course) // 10 :].mean()) == pytest.approx(sigma, rel=0.1)


def test_what_was_told_is_forgotten_within_the_memory_of_0_3_s():
    """The told variance of 1 is gone to 1 / e of it after 0.3 s without noise."""
    course = noise_of(np.arange(1, 310, dtype=float), 1e-3)
    assert course[301] == pytest.approx(math.exp(-1.0), rel=1e-9)


def test_two_values_say_nothing_of_noise():
    assert noise_of([3.0, 7.0], 1e-3) == pytest.approx([1.0, 1.0])
    assert noise_of([3.0, 7.0, -50.0], 1.0)[2] > 100.0


def test_a_second_difference_counts_as_six_variances():
    """Values 0, 0.5, -1: second difference 2, its square over 6 is 2 / 3."""
    share = 1.0 - math.exp(-0.1 / 0.3)
    course = noise_of([0.0, 0.5, -1.0], 0.1)
    assert course[2] == pytest.approx(1.0 + share * (4.0 / 6.0 - 1.0), rel=1e-12)


def test_the_first_value_may_be_nought():
    """A first value of 0 is a value, not one that is held."""
    first = heard(Noise(1.0), 0.0, 1e-3, 0.1)
    assert first.values == 1
    assert heard(first, 0.0, 1e-3, 0.1) == first


def test_the_noise_is_at_least_the_told():
    course = noise_of(np.arange(1, 5000, dtype=float), 1e-3, least=0.25)
    assert course.min() == 0.25
