"""The sixth family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import CAR, QUIET, roll

from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import GRAIN_M, USUAL_M_S, USUAL_RAD_S
from benchmarks.gap.withheld.generator.kernel import N, V, W, X
from benchmarks.gap.withheld.generator.recording_sixth import (
    AXLE_SHARE,
    CHIRP_HZ,
    CHIRP_SHARE,
    FRAME_LOST,
    TICK_S,
    by_axle,
    chirping,
    in_ticks,
    losing_frames,
    own_colours,
    rough_stretches,
    significant_digits,
    skewed,
    slow_accelerometer,
)
from benchmarks.gap.withheld.generator.sensors import Sensors, read
from benchmarks.gap.withheld.generator.signals import JUMP_S
from benchmarks.gap.withheld.generator.tyre import blended, plain_dugoff, two_lines
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def ramp():
    """Path of a car that speeds up evenly."""
    return roll(nominal(CAR, Road()), 10.0, 10.0, 100.0)


def test_rear_wheels_are_read_later_than_front_ones(ramp):
    at, true, late = reading(ramp, with_form("wheel_speed_delay", "unlike_axles", delay_s=0.05).sensors)
    ages = ((true - late)[:, :4] / np.gradient(true[:, :4], at, axis=0)).mean(axis=0)
    assert_allclose(ages, [0.045, 0.045, 0.055, 0.055], atol=2e-4)


@pytest.mark.parametrize(
    ("effect", "column", "usual"),
    [("wheel_speed_delay", 1, USUAL_RAD_S), ("vehicle_speed_delay", 4, USUAL_M_S)],
)
def test_a_value_that_takes_a_distance_is_older_when_slow(ramp, effect, column, usual):
    at, true, late = reading(ramp, with_form(effect, "older_when_slow", delay_s=0.05).sensors)
    ages = ((true - late)[:, column]) / np.gradient(true[:, column], at)
    assert_allclose(ages, 0.05 * (0.7 + 0.3 * usual / true[:, column]), rtol=0.01)
    standing = with_form(effect, "older_when_slow", delay_s=0.05).sensors
    path = np.zeros((3000, N + 1))
    path[:, [V, W + 1]] = np.arange(3000)[:, None] * 1e-6
    slow = 2.0 - read(path, standing, np.array([2.0]))[0, column] * 1e3
    assert slow == pytest.approx(0.05 * (0.7 + 0.3 * 3.0), rel=1e-3)


def test_of_two_windows_one_is_told(ramp):
    given = {"teeth": 100_000.0, "window_s": 0.02}
    at = np.arange(1.0, 9.0, 1e-3)
    both, half = (
        read(ramp, with_form("wheel_speed_quantisation", form, **given).sensors, at)[:, 0]
        for form in ("window_by_window", "every_second_window")
    )
    assert np.sum(np.diff(both) != 0.0) == pytest.approx(400, abs=2)
    assert np.sum(np.diff(half) != 0.0) == pytest.approx(200, abs=2)
    ages = at - np.interp(half, ramp[:, W], np.arange(len(ramp)) * 1e-3)
    assert ages.mean() == pytest.approx(0.02 + 0.01, abs=2e-3)


def test_a_scale_has_two_levels_and_their_mean():
    path, at = roll(nominal(CAR, Road()), 20.0, 30.0), np.arange(0.5, 28.5, 0.01)
    told = (
        read(path, with_form("vehicle_speed_scale", "in_jumps", factor=1.05).sensors, at)[:, 4] / 20.0 - 1.0
    )
    assert_allclose(np.unique(np.round(told, 9)), [0.05 * 0.88, 0.05 * 1.12])
    assert told.mean() == pytest.approx(0.05, rel=2e-3)
    assert np.sum(np.diff(told) != 0.0) == pytest.approx(28.0 / JUMP_S, abs=1)


def test_a_bias_is_more_on_coarse_stretches():
    path = roll(nominal(CAR, Road()), 20.0, 16.0)
    at = np.linspace(0.1, 0.1 + 4.0 * GRAIN_M / 20.0, 4000, endpoint=False)
    told = read(path, with_form("accelerometer_bias", "on_coarse_stretches", bias_m_s2=-0.3).sensors, at)[
        :, 5
    ]
    assert told.mean() == pytest.approx(-0.3, rel=2e-3)
    place = np.interp(at, np.arange(len(path)) * 1e-3, path[:, X])
    coarse = np.sin(2.0 * np.pi * place / GRAIN_M) > 0.5
    assert_allclose(told[coarse], -0.36, rtol=0.01)


# --- tyres, noise, logger


def test_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    level = (peak**-2.0 - slope**-2.0) ** -0.5
    assert blended(0.05, slope, peak, 2.0) == pytest.approx((3000.0**-2.0 + level**-2.0) ** -0.5)
    assert blended(1.0, slope, peak, 2.4) == pytest.approx(peak)
    assert two_lines(0.1, slope, peak, 0.8) == pytest.approx(peak)
    assert two_lines(0.05, slope, peak, 0.8) == pytest.approx(0.75 * peak)
    assert two_lines(0.55, slope, peak, 0.8) == pytest.approx(0.9 * peak)
    assert two_lines(1.0, slope, peak, 0.8) == pytest.approx(0.8 * peak)
    slip = 1.0 / 21.0  # where the adhesion is the peak
    assert plain_dugoff(slip, slope, peak) == pytest.approx(0.75 * peak)
    assert plain_dugoff(0.5 * slip, slope, peak) == pytest.approx(slope / 41.0)


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    loud = np.abs(rough_stretches(white, clock, rng) / white.sigmas).reshape(-1, 40, 6).mean(axis=1)
    alike = np.corrcoef(loud.T)
    assert np.all(alike[~np.eye(6, dtype=bool)] > 0.5)
    sides = np.mean((skewed(white, clock, rng) / white.sigmas) ** 3, axis=0)
    assert_allclose(np.abs(sides), 2.0 / np.sqrt(6.0), rtol=0.1)
    spectrum = np.abs(np.fft.rfft(chirping(white, clock, rng) / white.sigmas, axis=0)) ** 2
    hertz = np.fft.rfftfreq(clock.size, 5e-3)
    inside = (hertz > CHIRP_HZ[0] - 1.0) & (hertz < CHIRP_HZ[1] + 1.0)
    floor = spectrum[~inside].mean(axis=0) * inside.sum()
    share = (spectrum[inside].sum(axis=0) - floor) / spectrum.sum(axis=0)
    assert_allclose(share, CHIRP_SHARE, atol=0.02)
    alike = np.corrcoef(by_axle(white, clock, rng).T)
    assert_allclose(alike[[0, 2], [1, 3]], AXLE_SHARE, atol=0.02)
    assert_allclose(alike[[0, 0, 1, 4], [2, 3, 2, 0]], 0.0, atol=0.02)


def test_readings_have_their_own_colours():
    clock, rng = np.arange(60_000) * 1e-3, np.random.default_rng(1)
    values = own_colours(QUIET, clock, rng) / QUIET.sigmas
    near = np.mean(values[2:] * values[:-2], axis=0)
    assert np.ptp(near) > 0.1
    assert np.all((near > 0.02) & (near < 0.62))


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(3)
    columns = ["wheel_torque_fl_nm", "wheel_speed_fl_rad_s", "wheel_speed_rr_rad_s", "vehicle_speed_m_s"]
    made = pd.DataFrame(rng.normal(20.0, 9.0, (6000, 4)), columns=columns)
    made.insert(0, "time_s", np.arange(1, 6001) / 700.0)
    made["accel_x_m_s2"], made["position_m"] = rng.normal(0.0, 3.0, 6000), 15.0 * made["time_s"]
    return made


def test_rows_are_stamped_in_ticks_and_stay_in_order(log):
    told = in_ticks(log)
    ticks = told["time_s"] / TICK_S
    assert_allclose(ticks, np.round(ticks), atol=1e-6)
    assert np.abs(told["time_s"] - log["time_s"]).max() <= 0.5 * TICK_S + 1e-9
    assert np.diff(told["time_s"]).min() > 0.0
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_values_have_so_many_figures(log):
    told = significant_digits(
        log.assign(vehicle_speed_m_s=[0.0, np.nan, 12.3456, -0.98768, 9.99996, 123.45] * 1000)
    )
    assert_allclose(told["vehicle_speed_m_s"].to_numpy()[:6], [0.0, np.nan, 12.35, -0.9877, 10.0, 123.4])
    figures = [float(f"{value:.3g}") for value in log["accel_x_m_s2"]]
    assert_allclose(told["accel_x_m_s2"], figures, atol=1e-9)
    assert told["time_s"].equals(log["time_s"])


def test_messages_get_lost_with_all_that_they_carry(log):
    lost = losing_frames(log).isna()
    assert lost["wheel_speed_fl_rad_s"].equals(lost["wheel_speed_rr_rad_s"])
    for column in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"):
        assert lost[column].mean() == pytest.approx(FRAME_LOST, rel=0.5)
    assert not (lost["wheel_speed_fl_rad_s"] & lost["accel_x_m_s2"]).sum() > 3
    assert not lost[["time_s", "wheel_torque_fl_nm", "position_m"]].to_numpy().any()


def test_a_slow_accelerometer_leaves_every_second_row_without_it(log):
    told = slow_accelerometer(log)
    assert told["accel_x_m_s2"].isna().to_numpy().tolist() == [False, True] * 3000
    assert told.drop(columns="accel_x_m_s2").equals(log.drop(columns="accel_x_m_s2"))


# --- deviations outside the library


def test_wheel_speeds_stand_together_where_messages_stay_out(ramp):
    at = np.arange(0.0, 10.0, 1e-3)
    told = read(ramp, by_further("wheel_speed_dropouts", hold_s=0.3).sensors, at)
    true = read(ramp, Sensors(), at)
    stands = np.diff(told[:, :4], axis=0) == 0.0
    assert 3 * 290 < stands[:, 0].sum() < 8 * 310
    assert np.all(stands == stands[:, :1])
    assert_allclose(told[:, 4:], true[:, 4:], rtol=0, atol=0)


def test_an_accelerometer_is_late_by_its_delay():
    path = np.zeros((4001, N + 1))
    path[:, N] = np.sin(np.arange(4001) * 2e-3)
    at = np.arange(1.0, 3.0, 0.01)
    told = read(path, by_further("accelerometer_delay", delay_s=0.15).sensors, at)[:, 5]
    assert_allclose(told, np.sin(2.0 * (at - 0.15)), atol=1e-6)


def test_a_predicted_speed_is_ahead_by_its_time(ramp):
    at, true, told = reading(ramp, by_further("speed_predicted_ahead", ahead_s=0.2).sensors)
    ahead = (told - true)[:, 4] / np.gradient(true[:, 4], at)
    assert_allclose(ahead, 0.2, rtol=0.01)
