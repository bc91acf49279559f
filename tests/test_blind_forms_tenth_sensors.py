"""The tenth family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import QUIET

from benchmarks.gap.withheld.baselines import _on_grid
from benchmarks.gap.withheld.generator.kernel import ANGLE, N, V, W, X
from benchmarks.gap.withheld.generator.recording_tenth import (
    CLOCK_OFF,
    KEPT_SHARE,
    multiplexed,
    own_clock,
    slow_wheels,
    standing,
)
from benchmarks.gap.withheld.generator.scales import WAVES_M
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.signals import FAN_S, MISLOCK_S, PAD_DAMPING, RELOCK_S
from benchmarks.gap.withheld.generator.tyre_tenth import humped


@pytest.mark.parametrize("delay", [0.1, 0.02])
def test_wheels_are_told_by_the_mean_since_the_last_message(ramp, delay):
    """Each reading stands for the cycle, is the mean over one, and was at its end half a cycle less late."""
    cycle = min(0.03, delay)
    sensors = with_form("wheel_speed_delay", "means", delay_s=delay).sensors
    at = np.arange(2.0, 9.0, 1e-3)
    told = read(ramp, sensors, at)[:, 0]
    changes = np.flatnonzero(np.diff(told))
    assert np.mean(np.diff(at[changes])) == pytest.approx(cycle, rel=0.01)
    ages = at - np.interp(told, ramp[:, W], np.arange(len(ramp)) * 1e-3)
    assert ages.mean() == pytest.approx(delay, abs=1e-3)
    assert_allclose([ages.min(), ages.max()], [delay - 0.5 * cycle, delay + 0.5 * cycle], atol=2e-3)
    path = np.zeros((4001, N + 1))
    path[2000:, W : W + 4] = 1.0
    steps = np.unique(np.round(read(path, sensors, np.arange(1.0, 3.5, 1e-3))[:, 0], 6))
    assert steps.size in (2, 3)
    assert_allclose([steps[0], steps[-1]], [0.0, 1.0])


def test_a_fast_wheel_hands_on_every_second_pulse():
    """Above the usual speed the counts are even, and below it as they would be else."""
    clock = np.arange(12_001) * 1e-3
    path = np.zeros((12_001, N + 1))
    path[:, W : W + 4] = (50.0 + 3.0 * clock)[:, None]
    path[:, ANGLE : ANGLE + 4] = (50.0 * clock + 1.5 * clock**2)[:, None]
    sensors = with_form("wheel_speed_quantisation", "halved_when_fast", teeth=100.0, window_s=0.02).sensors
    at = np.arange(1.0, 11.0, 0.0137)
    counted = read(path, sensors, at)[:, 0] * 100.0 * 0.02 / (2.0 * np.pi)
    plain = read(path, replace(sensors, wheel_halves_rad_s=0.0), at)[:, 0] * 100.0 * 0.02 / (2.0 * np.pi)
    fast = plain > 65.0 * 100.0 * 0.02 / (2.0 * np.pi)
    assert 0.2 < fast.mean() < 0.8
    assert_allclose(counted[~fast], plain[~fast])
    assert_allclose(0.5 * counted[fast], np.round(0.5 * counted[fast]), atol=1e-6)
    assert np.abs(counted - plain).max() == pytest.approx(1.0)
    assert counted[fast].mean() == pytest.approx(plain[fast].mean(), rel=3e-3)


@pytest.mark.parametrize("delay", [0.25, 0.06])
def test_a_speed_is_the_slope_of_a_line_through_places(delay):
    over, clock = min(0.2, 2.0 * delay), np.arange(6001) * 1e-3
    path = np.zeros((6001, N + 1))
    path[:, V] = 20.0 + np.sin(7.0 * clock) + 3.0 * (clock > 3.0)
    places = np.concatenate([[0.0], np.cumsum(0.5 * (path[1:, V] + path[:-1, V]))]) * 1e-3
    sensors = with_form("vehicle_speed_delay", "fitted_line", delay_s=delay).sensors
    assert sensors.speed_fitted_s <= 2.0 * delay
    for at in (2.0, 3.0 + delay, 3.03 + delay, 4.5):
        seen = np.abs(clock - (at - delay)) <= 0.5 * over + 1e-9
        slope = np.polyfit(clock[seen], places[seen], 1)[0]
        assert read(path, sensors, np.array([at]))[0, 4] == pytest.approx(slope, abs=0.05)


def test_a_scale_goes_up_and_down_with_the_road(ramp):
    sensors = with_form("vehicle_speed_scale", "over_waves", factor=0.96).sensors
    at, true, told = reading(ramp, sensors)
    place = np.interp(at, np.arange(len(ramp)) * 1e-3, ramp[:, X])
    share = 1.0 + 0.2 * np.sin(2.0 * np.pi * place / WAVES_M)
    assert_allclose(told[:, 4] / true[:, 4] - 1.0, -0.04 * share, atol=1e-9)


def test_a_bias_goes_with_a_fan():
    path = np.zeros((40_001, N + 1))
    sensors = with_form("accelerometer_bias", "with_a_fan", bias_m_s2=-0.4).sensors
    told = read(path, sensors, np.arange(0.0, 8.0 * FAN_S, 0.002))[:, 5]
    assert told.mean() == pytest.approx(-0.4, rel=1e-3)
    assert_allclose([told.min(), told.max()], [-0.48, -0.32], atol=2e-4)
    assert np.abs(np.diff(told)).max() < 5e-4
    turns = np.flatnonzero(np.diff(np.sign(np.diff(told))))
    assert_allclose(np.diff(turns) * 0.002, FAN_S, atol=0.01)


# --- tyres, noise, logger


def test_a_tyre_at_known_points():
    slope, peak = 60_000.0, 3000.0
    best = np.e * peak / slope
    assert humped(1e-7, slope, peak, 0.8) == pytest.approx(0.006, rel=1e-4)
    assert humped(best, slope, peak, 0.8) == pytest.approx(peak)
    assert humped(0.5 * best, slope, peak, 0.8) == pytest.approx(0.5 * np.exp(0.5) * peak)
    assert humped(2.0 * best, slope, peak, 0.8) == pytest.approx((0.8 + 0.2 * 2.0 / np.e) * peak)
    assert humped(1.0, slope, peak, 0.8) == pytest.approx(0.8 * peak, rel=5e-3)


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    together = np.corrcoef(multiplexed(white, clock, rng).T)
    kept = np.sqrt(KEPT_SHARE * (1.0 - KEPT_SHARE))
    expected = np.eye(6) + kept * (np.roll(np.eye(6), 1, axis=0) + np.roll(np.eye(6), -1, axis=0))
    assert_allclose(together, expected, atol=0.02)
    values = standing(white, clock, rng)
    stands = np.mean(np.diff(values, axis=0) == 0.0, axis=0)
    assert np.all((stands > 1.0 - 141.0 / 500.0) & (stands < 1.0 - 69.0 / 500.0))
    sparse = standing(white, np.arange(50_000) * 0.02, rng)
    assert_allclose([np.corrcoef(c[1:], c[:-1])[0, 1] for c in sparse.T], 0.0, atol=0.03)


def test_wheels_come_with_every_second_row(log):
    told, wheels = slow_wheels(log), [c for c in log if c.startswith("wheel_speed")]
    assert len(wheels) == 4
    assert told[wheels][::2].equals(log[wheels][::2])
    assert told[wheels][1::2].isna().all(axis=None)
    assert told.drop(columns=wheels).equals(log.drop(columns=wheels))


def test_a_logger_has_its_own_clock(log):
    told = own_clock(log)
    rate = told["time_s"].to_numpy() / log["time_s"].to_numpy()
    assert 1e-6 < abs(rate[-1] - 1.0) <= CLOCK_OFF
    assert_allclose(rate[100:], rate[-1], atol=1e-6)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_a_simple_ranker_reads_such_logs(log):
    slow = log.assign(**{c: 20.0 + np.sin(log["time_s"]) for c in log if c.startswith("wheel_speed")})
    shown, place = _on_grid(slow, 8000)
    for other in (slow_wheels(slow), own_clock(slow)):
        told, there = _on_grid(other, 8000)
        assert_allclose(told[:, :4], shown[:, :4], rtol=0, atol=2e-3)
        assert_allclose(there, place, rtol=0, atol=0.05)


# --- deviations outside the library


def test_wheels_are_told_in_part_by_their_mean(ramp):
    path = ramp.copy()
    path[:, W] *= 0.9
    _, true, told = reading(path, by_further("wheel_speeds_blended", share=0.3).sensors)
    mean = true[:, :4].mean(axis=1, keepdims=True)
    assert_allclose(told[:, :4], 0.7 * true[:, :4] + 0.3 * mean)
    assert_allclose(told[:, :4].mean(axis=1, keepdims=True), mean)
    assert_allclose(told[:, 4:], true[:, 4:])


@pytest.mark.parametrize("share", [0.1, -0.2])
def test_a_speed_sensor_locks_onto_something_else(ramp, share):
    at, true, told = reading(ramp, by_further("speed_mislocks", share=share).sensors)
    off = told[:, 4] / true[:, 4] - 1.0
    wrong = np.abs(off) > 1e-9
    assert_allclose(off[wrong], share)
    assert wrong.mean() == pytest.approx(MISLOCK_S / RELOCK_S, rel=0.15)
    begun = at[1:][np.diff(wrong.astype(int)) > 0]
    assert begun.size >= 6
    assert np.all(np.bincount(np.floor(begun / RELOCK_S).astype(int)) <= 1)


def test_an_accelerometer_swings_on_its_pad():
    path, period = np.zeros((6001, N + 1)), 0.2
    path[2000:, N] = 2.0
    clock = np.arange(6001) * 1e-3
    told = read(path, by_further("accelerometer_on_soft_pad", period_s=period).sensors, clock)[:, 5]
    since, rate = np.maximum(clock - 2.0, 0.0), 2.0 * np.pi / period
    turn = np.sqrt(1.0 - PAD_DAMPING**2) * rate
    decay = np.exp(-PAD_DAMPING * rate * since)
    swing = decay * (np.cos(turn * since) + PAD_DAMPING * rate / turn * np.sin(turn * since))
    assert_allclose(told, np.where(clock >= 2.0, 2.0 * (1.0 - swing), 0.0), atol=0.04)
    assert told.max() > 3.2
    assert told[-1] == pytest.approx(2.0, abs=1e-3)
