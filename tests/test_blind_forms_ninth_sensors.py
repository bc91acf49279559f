"""The ninth family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import QUIET

from benchmarks.gap.withheld.baselines import _on_grid
from benchmarks.gap.withheld.generator.kernel import N, V, W
from benchmarks.gap.withheld.generator.recording_ninth import (
    BEFORE_S,
    beating_tones,
    meaned,
    slow_place,
    triggered,
)
from benchmarks.gap.withheld.generator.scales import MOUNT_M_S, MOUNT_SHARE
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.signals import JUMP_S
from benchmarks.gap.withheld.generator.tyre_ninth import brush_elliptic, splined

pytestmark = pytest.mark.long


@pytest.mark.parametrize("delay", [0.1, 0.02])
def test_a_median_is_late_by_the_delay_and_drops_what_is_short(delay):
    path = np.zeros((4001, N + 1))
    path[2000:, W : W + 4] = 1.0
    path[3000:3005, W : W + 4] = 50.0
    sensors = with_form("wheel_speed_delay", "median", delay_s=delay).sensors
    assert sensors.wheel_median_s <= 2.0 * delay
    at = np.array([2.0 + delay - 0.003, 2.0 + delay + 0.003, 3.0 + delay + 0.002])
    assert_allclose(read(path, sensors, at)[:, 0], [0.0, 1.0, 1.0])


@pytest.mark.parametrize("delay", [0.25, 0.06])
def test_epochs_go_on_as_they_came(delay):
    """Of the square of the time what is beyond a message is short by u (u + T), u since the message of T."""
    epoch, clock = min(0.1, delay), np.arange(8001) * 1e-3
    path = np.zeros((8001, N + 1))
    path[:, V] = clock**2
    sensors = with_form("vehicle_speed_delay", "extrapolated_epochs", delay_s=delay).sensors
    at = np.arange(2.0, 7.0, 1e-3)
    short = (at - delay) ** 2 - read(path, sensors, at)[:, 4]
    assert short.min() == pytest.approx(0.0, abs=2e-4)
    assert short.max() == pytest.approx(2.0 * epoch**2, rel=0.03)
    path[:, V] = 3.0 * clock
    assert_allclose(read(path, sensors, at)[:, 4], 3.0 * (at - delay), rtol=1e-9)


def test_a_scale_is_more_where_a_bracket_shakes(ramp):
    sensors = with_form("vehicle_speed_scale", "shaking_bracket", factor=0.96).sensors
    _, true, told = reading(ramp, sensors)
    speed = true[:, 4]
    shakes = np.exp(-(((speed - MOUNT_M_S) / 3.0) ** 2))
    assert_allclose(told[:, 4] / speed - 1.0, -0.04 * (1.0 + 0.3 * (shakes - MOUNT_SHARE)), atol=1e-9)
    speeds = np.linspace(5.0, 30.0, 2001)
    assert np.mean(np.exp(-(((speeds - MOUNT_M_S) / 3.0) ** 2))) == pytest.approx(MOUNT_SHARE, rel=1e-3)


def test_a_bias_goes_between_two_levels():
    path = np.zeros((28001, N + 1))
    sensors = with_form("accelerometer_bias", "in_jumps", bias_m_s2=-0.4).sensors
    told = read(path, sensors, np.arange(0.0, 8.0 * JUMP_S, 0.01))[:, 5]
    assert_allclose(np.unique(np.round(told, 9)), [-0.48, -0.32])
    assert told.mean() == pytest.approx(-0.4, rel=2e-3)
    assert np.count_nonzero(np.abs(np.diff(told)) > 0.1) == pytest.approx(8, abs=1)


# --- tyres, noise, logger


def test_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert brush_elliptic(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-4)
    half = brush_elliptic(4.0 / np.pi * peak / slope, slope, peak)
    assert half == pytest.approx(peak * (0.5 + 1.0 / np.pi), rel=1e-9)
    assert peak * (1.0 - 1e-3) < brush_elliptic(1.0, slope, peak) <= peak
    best = 2.5 * peak / slope
    assert splined(1e-7, slope, peak, 2.5, 0.8) == pytest.approx(0.006, rel=1e-4)
    assert splined(best, slope, peak, 2.5, 0.8) == pytest.approx(peak)
    assert splined(0.5 * best, slope, peak, 2.5, 0.8) == pytest.approx(peak * (0.125 * 2.5 + 0.5))
    assert splined(1.0, slope, peak, 2.5, 0.8) == pytest.approx(0.8 * peak)
    assert splined(0.5 * (best + 1.0), slope, peak, 2.5, 0.8) == pytest.approx(0.9 * peak)


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    values = beating_tones(white, clock, rng) / white.sigmas
    power = np.abs(np.fft.rfft(values, axis=0)) ** 2
    power /= power.sum(axis=0)
    top = np.sort(power[1:], axis=0)[-6:]
    hertz = np.fft.rfftfreq(clock.size, 2e-3)[1:][np.argmax(power[1:], axis=0)]
    assert np.all((top.sum(axis=0) > 0.18) & (top.sum(axis=0) < 0.27))
    assert np.all((hertz > 17.9) & (hertz < 41.3))
    values = meaned(white, clock, rng)
    near, far = ([np.corrcoef(column[lag:], column[:-lag])[0, 1] for column in values.T] for lag in (1, 13))
    assert np.all(np.array(near) > 0.4)
    assert_allclose(far, 0.0, atol=0.03)
    sparse = meaned(white, np.arange(50_000) * 0.02, rng)
    assert_allclose([np.corrcoef(c[1:], c[:-1])[0, 1] for c in sparse.T], 0.0, atol=0.03)


def test_a_place_comes_with_every_second_row(log):
    told = slow_place(log)
    assert told["position_m"][::2].equals(log["position_m"][::2])
    assert told["position_m"][1::2].isna().all()
    assert told.drop(columns="position_m").equals(log.drop(columns="position_m"))


def test_rows_are_stamped_from_a_trigger_on(log):
    told = triggered(log)
    before = log["time_s"][0] - told["time_s"][0]
    assert BEFORE_S[0] <= before <= BEFORE_S[1]
    assert told["time_s"].iloc[0] < 0.0 < told["time_s"].iloc[-1]
    assert_allclose(np.diff(told["time_s"]), 1.0 / 250.0, rtol=1e-4)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_a_simple_ranker_reads_such_logs(log):
    shown, place = _on_grid(log, 8000)
    for other in (slow_place(log), triggered(log)):
        told, there = _on_grid(other, 8000)
        assert_allclose(told, shown, rtol=0, atol=1e-3)
        assert_allclose(there, place, rtol=0, atol=1e-3)


# --- deviations outside the library


def test_wheels_are_told_by_an_offset(ramp):
    _, true, told = reading(ramp, by_further("wheel_speed_offset", offset_rad_s=-0.7).sensors)
    assert_allclose(told[:, :4] - true[:, :4], -0.7)
    assert_allclose(told[:, 4:], true[:, 4:])


def test_a_loop_is_not_late_on_a_ramp_and_runs_over_its_end():
    clock, path = np.arange(12001) * 1e-3, np.zeros((12001, N + 1))
    path[:, V] = np.interp(clock, [0.0, 8.0, 12.0], [10.0, 26.0, 26.0])
    sensors = by_further("speed_tracking_loop", loop_s=0.2).sensors
    told = read(path, sensors, clock)[:, 4] - path[:, V]
    assert_allclose(told[5000:7990], 0.0, atol=1e-3)
    since = clock[8000:] - 8.0
    turn = np.sqrt(0.75) / 0.2
    over = 2.0 * np.exp(-since / 0.4) * np.sin(turn * since) / turn
    assert_allclose(told[8000:], over, atol=5e-3)
    assert told.max() > 0.2


def test_an_accelerometer_forgets_what_is_steady():
    path = np.zeros((9001, N + 1))
    path[1000:, N] = 2.0
    told = read(
        path, by_further("accelerometer_fades", time_constant_s=2.0).sensors, np.array([0.9, 1.0, 3.0, 9.0])
    )
    assert_allclose(told[:, 5], [0.0, 2.0, 2.0 * np.exp(-1.0), 2.0 * np.exp(-4.0)], atol=2e-3)
