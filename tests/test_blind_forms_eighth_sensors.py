"""The eighth family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import QUIET

from benchmarks.gap.withheld.generator.kernel import ANGLE, N, V, W, X
from benchmarks.gap.withheld.generator.recording_eighth import (
    BOX_SHARE,
    CLOCK_S,
    by_the_clock,
    filled_in,
    one_box,
    resampled,
)
from benchmarks.gap.withheld.generator.scales import AIRED_S, TABLE_M_S
from benchmarks.gap.withheld.generator.sensors import Sensors, read
from benchmarks.gap.withheld.generator.tyre_eighth import COMPOSITE_AT, COMPOSITE_TOP, bristles, composite

pytestmark = pytest.mark.long


@pytest.mark.parametrize("delay", [0.1, 0.02])
def test_two_filters_are_late_by_the_delay(delay):
    each, path = min(0.4 * delay, 0.015), np.zeros((4001, N + 1))
    path[2000:, W : W + 4] = 1.0
    sensors = with_form("wheel_speed_delay", "smoothed_twice", delay_s=delay).sensors
    since = np.array([-0.5, 0.5, 1.0, 2.0, 4.0])
    told = read(path, sensors, 2.0 + delay - 2.0 * each + since * each)[:, 0]
    rise = np.maximum(since, 0.0)
    assert_allclose(told, 1.0 - (1.0 + rise) * np.exp(-rise), atol=0.06)
    assert told[0] == 0.0


def test_a_counter_takes_two_windows_of_a_slow_wheel():
    given = {"teeth": 96.0, "window_s": 0.02}
    forms = ("longer_when_slow", "window_by_window")
    slow, fast = (with_form("wheel_speed_quantisation", f, **given).sensors for f in forms)
    at = np.arange(1.0, 5.0, 0.0137)
    for speed, step in ((15.0, 0.5), (35.0, 1.0)):
        path = np.zeros((6001, N + 1))
        path[:, ANGLE : ANGLE + 4] = np.arange(6001)[:, None] * 1e-3 * speed
        pulses = read(path, slow, at)[:, :4] * 96.0 * 0.02 / (2.0 * np.pi)
        assert_allclose(pulses / step, np.round(pulses / step), atol=1e-6)
        assert np.any(np.abs(pulses - np.round(pulses)) > 0.4) == (step < 1.0)
        assert pulses.mean() == pytest.approx(speed * 96.0 * 0.02 / (2.0 * np.pi), rel=0.02)
    path[:, ANGLE : ANGLE + 4] = np.arange(6001)[:, None] * 1e-3 * 65.0
    assert_allclose(read(path, slow, at), read(path, fast, at))


@pytest.mark.parametrize("delay", [0.25, 0.06])
def test_epochs_are_joined_by_straight_lines(delay):
    epoch, clock = min(0.1, delay), np.arange(8001) * 1e-3
    path = np.zeros((8001, N + 1))
    path[:, V] = clock**2
    sensors = with_form("vehicle_speed_delay", "joined_epochs", delay_s=delay).sensors
    at = np.arange(2.0, 7.0, 1e-3)
    told = read(path, sensors, at)[:, 4]
    bends = np.flatnonzero(np.abs(np.diff(told, 2)) > 1e-6)
    assert_allclose(np.diff(np.unique(np.round(bends / (1e3 * epoch)))), 1.0)
    assert_allclose((told - (at - delay) ** 2).max(), (0.5 * epoch) ** 2, rtol=0.01)
    assert_allclose((told - (at - delay) ** 2).min(), 0.0, atol=1e-5)


def test_a_scale_errs_between_a_calibration_s_points(ramp):
    sensors = with_form("vehicle_speed_scale", "by_table", factor=1.04).sensors
    _, true, told = reading(ramp, sensors)
    off, speed = told[:, 4] / true[:, 4] - 1.0, true[:, 4]
    assert_allclose(off, 0.04 * (1.0 + 0.15 * np.sin(2.0 * np.pi * speed / TABLE_M_S)), atol=1e-9)
    assert off.max() > 0.04 * 1.14
    assert off.min() < 0.04 * 0.86


def test_a_bias_is_less_after_a_while_in_the_air_stream():
    path = np.zeros((40001, N + 1))
    path[:10_000, V], path[10_000:, V] = 20.0, 30.0
    sensors = with_form("accelerometer_bias", "aired", bias_m_s2=-0.4).sensors
    told = read(path, sensors, np.array([9.0, 10.0 + AIRED_S, 39.9]))[:, 5]
    assert_allclose(told, -0.4 * np.array([1.0, 1.0 - 0.1 * (1.0 - np.exp(-1.0)), 0.9]), rtol=2e-3)


# --- tyres, noise, logger


def test_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert bristles(1.0, slope, peak) == pytest.approx(peak, rel=1e-6)
    assert bristles(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-4)
    top = peak / (1.0 - (1.0 - np.exp(-40.0 * 0.975)) / (40.0 * 0.975))
    assert bristles(0.5 * top / slope, slope, peak) == pytest.approx(top * np.exp(-1.0), rel=2e-4)
    best = COMPOSITE_AT / (0.25 * np.pi * 20.0 * COMPOSITE_TOP)
    assert composite(best, slope, peak, 0.2) == pytest.approx(peak, rel=1e-7)
    assert max(composite(s, slope, peak, 0.0) for s in np.linspace(0.0, 1.0, 4001)) <= peak * (1.0 + 1e-9)
    one = composite(best / COMPOSITE_AT, slope, peak, 0.2)
    assert one == pytest.approx(peak / COMPOSITE_TOP * (4.0 / np.pi + 1.34) / 2.89)
    assert 0.78 < composite(1.0, slope, peak, 0.2) / peak < 0.81


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    alike = np.corrcoef(one_box(white, clock, rng).T)
    assert np.abs(alike[4, 5]) == pytest.approx(BOX_SHARE, abs=0.02)
    assert_allclose([alike[0, 1], alike[0, 4], alike[3, 5]], 0.0, atol=0.03)
    values = resampled(white, clock, rng)
    bends = np.abs(np.diff(values, 2, axis=0)) > 1e-9 * white.sigmas
    rates = bends.mean(axis=0) / 2e-3 / 2.0
    assert np.all((rates > 57.0) & (rates < 123.0))
    assert len(set(np.round(rates))) > 3


def test_what_was_lost_is_a_straight_line(log):
    lost = log.copy()
    lost.loc[[0, 500, 501, 5999], "vehicle_speed_m_s"] = np.nan
    told = filled_in(lost)
    assert list(told) == list(log)
    assert not told.isna().to_numpy().any()
    assert told[["time_s", "wheel_torque_fl_nm"]].equals(log[["time_s", "wheel_torque_fl_nm"]])
    speed = log["vehicle_speed_m_s"]
    line = speed[499] + (speed[502] - speed[499]) * np.array([1.0, 2.0]) / 3.0
    assert_allclose(told["vehicle_speed_m_s"].iloc[500:502], line, rtol=1e-9)
    changed = (told != log).sum()
    assert 20 < changed.sum() < 120
    assert (told["vehicle_speed_m_s"][[0, 5999]] == speed[[1, 5998]].to_numpy()).all()


def test_rows_are_stamped_by_the_time_of_day(log):
    told = by_the_clock(log)
    begun = told["time_s"][0] - log["time_s"][0]
    assert CLOCK_S[0] <= begun <= CLOCK_S[1]
    assert_allclose(np.diff(told["time_s"]), 1.0 / 250.0, rtol=1e-7)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


# --- deviations outside the library


def test_a_wheel_is_told_to_stand_below_its_least_speed(ramp):
    _, true, told = reading(ramp, by_further("wheel_speed_dies", least_rad_s=40.0).sensors)
    slow = true[:, :4] < 40.0
    assert 0.02 < slow.mean() < 0.9
    assert np.all(told[:, :4][slow] == 0.0)
    assert_allclose(told[:, :4][~slow], true[:, :4][~slow])


def test_a_speed_has_play_between_up_and_down():
    path, clock = np.zeros((8001, N + 1)), np.arange(8001) * 1e-3
    path[:, V] = 20.0 + 2.0 * np.sin(np.pi * clock)
    told = read(
        path, by_further("speed_hysteresis", play_m_s=0.5).sensors, np.array([2.5, 2.6, 3.5, 4.0, 4.45])
    )
    speed = np.array([21.5, 21.5, 18.5, 18.5, 20.0 + 2.0 * np.sin(np.pi * 4.45) - 0.5])
    assert_allclose(told[:, 4], [*speed[:3], 19.5, speed[4]], atol=1e-5)


def test_an_accelerometer_tells_whole_steps(ramp):
    path = ramp.copy()
    path[:, N] = np.linspace(-6.0, 6.0, len(path))
    _, true, told = reading(path, by_further("accelerometer_in_steps", step_m_s2=0.8).sensors)
    assert_allclose(told[:, 5] / 0.8, np.round(told[:, 5] / 0.8), atol=1e-9)
    assert np.abs(told - true)[:, 5].max() <= 0.4 + 1e-9
    assert np.mean(told - true, axis=0)[5] == pytest.approx(0.0, abs=0.02)
    assert_allclose(read(path, Sensors(), np.array([2.0]))[:, :5], path[2000, [*range(W, W + 4), V]][None])
    assert path[2000, X] > 0.0
