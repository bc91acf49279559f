"""The seventh family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import CAR, QUIET, roll

from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.kernel import MOTOR, N, V, W
from benchmarks.gap.withheld.generator.recording_seventh import (
    LOUDER,
    WAKES_S,
    YAW_SHARE,
    in_turns,
    waking,
    working_loose,
    yawing,
)
from benchmarks.gap.withheld.generator.sensors import Sensors, read
from benchmarks.gap.withheld.generator.signals import JUMP_S
from benchmarks.gap.withheld.generator.tyre import arctangent, sine_rise
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


def test_a_wheel_speed_may_be_the_motors():
    given = {"stiffness_nm_rad": 4000.0, "damping_nm_s_rad": 5.0, "motor_inertia_kg_m2": 0.6}
    world = with_form("driveline_compliance", "read_at_motor", **given)
    path, at = roll(world, 15.0, 1.0, 100.0), np.arange(0.0, 0.9, 1e-3)
    told = read(path, world.sensors, at)
    assert_allclose(told[:, :4], path[:900, MOTOR : MOTOR + 4])
    assert np.abs(told[:, 0] - path[:900, W]).max() > 0.1
    assert (path[-1, MOTOR] - path[-1, W]) == pytest.approx(0.0, abs=0.05)


def test_a_queue_holds_one_more_for_as_long_as_one_less(ramp):
    at = np.arange(1.0, 1.0 + 4.0 * JUMP_S, 1e-3)
    sensors = with_form("wheel_speed_delay", "queue", delay_s=0.05).sensors
    true, late = read(ramp, Sensors(), at)[:, 0], read(ramp, sensors, at)[:, 0]
    ages = at - np.interp(late, true, at)
    assert ages[200:].mean() == pytest.approx(0.05, rel=0.02)
    inside = (np.abs(ages - 0.0425) < 2e-4) | (np.abs(ages - 0.0575) < 2e-4)
    assert inside[200:].mean() > 0.98
    assert np.diff(late).min() >= 0.0


def test_a_sensor_that_shakes_counts_a_little_more_and_less():
    path, at = roll(nominal(CAR, Road()), 20.0, 12.0), np.arange(1.0, 11.0, 0.02)
    given = {"teeth": 960.0, "window_s": 0.02}
    forms = ("window_by_window", "shaking_sensor")
    told = [read(path, with_form("wheel_speed_quantisation", f, **given).sensors, at)[:, 0] for f in forms]
    pulse = 2.0 * np.pi / (960.0 * 0.02)
    off = (told[1] - 20.0 / 0.29) / pulse
    assert np.abs(off).max() < 1.0 + 2.0 * 0.3
    assert told[1].std() > 1.1 * told[0].std()
    assert told[1].mean() == pytest.approx(told[0].mean(), rel=1e-3)


@pytest.mark.parametrize("delay", [0.1, 0.03])
def test_a_mean_of_means_weighs_its_middle_most(delay):
    path, over = np.zeros((4001, N + 1)), min(0.04, delay)
    path[2000:, V] = 1.0
    sensors = with_form("vehicle_speed_delay", "averaged_twice", delay_s=delay).sensors
    at = 1.9995 + delay + over * np.array([-1.1, -0.5, 0.0, 0.5, 1.1])
    assert_allclose(read(path, sensors, at)[:, 4], [0.0, 0.125, 0.5, 0.875, 1.0], atol=1e-3)


def test_a_scale_wanders_about_what_is_told():
    path = roll(nominal(CAR, Road()), 20.0, 60.0)
    at = np.arange(0.5, 59.0, 0.01)
    told = read(path, with_form("vehicle_speed_scale", "wandering", factor=1.05).sensors, at)[:, 4]
    off = told / 20.0 - 1.0
    assert off.mean() == pytest.approx(0.05, rel=0.03)
    assert 0.05 * 0.8 - 1e-9 < off.min() < 0.05 * 0.95 < 0.05 * 1.05 < off.max() < 0.05 * 1.2 + 1e-9


def test_a_bias_remembers_where_the_sensor_was_bent_to():
    sensors = with_form("accelerometer_bias", "remembering", bias_m_s2=0.4).sensors
    path = np.zeros((24001, N + 1))
    path[:8000, N], path[8000:16000, N] = 3.0, -3.0
    told = read(path, sensors, np.array([7.99, 15.99, 23.99]))[:, 5]
    assert_allclose(told, [3.0 + 0.4 * 1.2, -3.0 + 0.4 * 0.8, 0.4], rtol=3e-3)


# --- tyres, noise, logger


def test_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert sine_rise(np.pi / 6.0 / 20.0, slope, peak, 0.8) == pytest.approx(0.5 * peak)
    assert sine_rise(np.pi / 2.0 / 20.0, slope, peak, 0.8) == pytest.approx(peak)
    bell = sine_rise(3.0 * np.pi / 20.0, slope, peak, 0.8)
    assert bell == pytest.approx(peak * (0.8 + 0.2 * np.exp(-1.0)))
    assert arctangent(1.0, slope, peak) == pytest.approx(peak, rel=1e-6)
    assert arctangent(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-5)
    assert 0.4 < arctangent(0.05, slope, peak) / peak < 0.7


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(200_000) * 5e-3, np.random.default_rng(0)
    alike = np.corrcoef(yawing(white, clock, rng).T)
    assert_allclose(alike[[0, 2, 0], [1, 3, 3]], -YAW_SHARE, atol=0.03)
    assert_allclose(alike[[0, 1], [2, 3]], YAW_SHARE, atol=0.03)
    assert_allclose(alike[[0, 1, 4], [4, 5, 5]], 0.0, atol=0.03)
    thirds = working_loose(white, clock, rng).reshape(10, -1, 6).std(axis=1) / white.sigmas
    assert np.all(np.diff(thirds[::3], axis=0) > 0.0)
    ratios = thirds[-1] / thirds[0]
    least, most = ((1.0 + 0.45 * more) / (1.0 - 0.45 * more) for more in LOUDER)
    assert np.all((ratios > 0.95 * least) & (ratios < 1.05 * most))


def test_axles_come_in_turn(log):
    told = in_turns(log)
    for place, gone in (("fl", 1), ("fr", 1), ("rl", 0), ("rr", 0)):
        lost = told[f"wheel_speed_{place}_rad_s"].isna().to_numpy()
        assert np.array_equal(lost, np.arange(6000) % 2 == gone)
    rest = [c for c in log if not c.startswith("wheel_speed")]
    assert told[rest].equals(log[rest])
    kept = told["wheel_speed_rl_rad_s"].dropna()
    assert kept.equals(log["wheel_speed_rl_rad_s"].loc[kept.index])


def test_senders_wake_one_after_another(log):
    lost = waking(log).isna()
    assert not lost[["time_s", "wheel_torque_fl_nm"]].to_numpy().any()
    wheels = lost[[c for c in lost if c.startswith("wheel_speed")]].to_numpy()
    assert np.all(wheels == wheels[:, :1])
    first = [int(np.argmin(lost[c])) for c in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2")]
    assert len(set(first)) == 3
    assert all(WAKES_S[0] <= n / 250.0 <= WAKES_S[1] + 0.004 for n in first)
    assert not lost.iloc[max(first) :].to_numpy().any()


# --- deviations outside the library


def test_an_accelerometer_bends_by_the_square(ramp):
    path = ramp.copy()
    path[:, N] = np.linspace(-6.0, 6.0, len(path))
    at, true, off = reading(path, by_further("accelerometer_bends", per_m_s2=0.02).sensors)
    assert_allclose((off - true)[:, 5], 0.02 * true[:, 5] ** 2, atol=1e-3)
    assert_allclose(off[:, :5], true[:, :5], rtol=0, atol=0)
    assert at.size > 100


def test_a_speed_follows_no_faster_than_it_may():
    path = np.zeros((6001, N + 1))
    path[:, V] = 20.0
    path[2000:3000, V] = 20.0 - 6.0 * np.arange(1000) * 1e-3
    path[3000:, V] = 14.0
    sensors = by_further("speed_rate_limited", limit_m_s2=3.0).sensors
    told = read(path, sensors, np.array([1.9, 2.5, 3.0, 3.5, 4.1]))[:, 4]
    assert_allclose(told, [20.0, 18.5, 17.0, 15.5, 14.0], atol=0.01)
