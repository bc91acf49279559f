"""The fifth family's forms of sensors, tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, reading, with_form
from test_blind_plant import CAR, QUIET, roll

from benchmarks.gap.withheld.generator import forms_fifth, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import GRAIN_M
from benchmarks.gap.withheld.generator.kernel import ANGLE, V
from benchmarks.gap.withheld.generator.recording_fifth import (
    BITS,
    CHANGES,
    POPS_S,
    POPS_SHARE,
    RANGES,
    SUPPLY_SHARE,
    bounded,
    converted_in_bits,
    mains,
    on_change,
    popping,
    shared_supply,
    slow_receiver,
    stones,
)
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.tyre import cubed
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def ramp():
    """Path of a car that speeds up evenly."""
    return roll(nominal(CAR, Road()), 10.0, 10.0, 100.0)


def test_wheels_are_read_in_turn(ramp):
    at, true, late = reading(ramp, with_form("wheel_speed_delay", "in_turn", delay_s=0.05).sensors)
    ages = ((true - late)[:, :4] / np.gradient(true[:, :4], at, axis=0)).mean(axis=0)
    assert_allclose(ages, [0.044, 0.048, 0.052, 0.056], atol=2e-4)


@pytest.mark.parametrize(("effect", "column"), [("wheel_speed_delay", 2), ("vehicle_speed_delay", 4)])
def test_messages_get_lost(ramp, effect, column):
    at = np.arange(1.0, 9.0, 1e-3)
    sensors = with_form(effect, "losing_messages", delay_s=0.05).sensors
    changes = np.diff(read(ramp, sensors, at)[:, column]) != 0.0
    assert changes.sum() == pytest.approx(400 * (1.0 - forms_fifth.LOST), rel=0.05)


def test_a_receiver_tells_the_mean_over_its_epoch(ramp):
    at = np.arange(1.0, 9.0, 1e-3)
    told = read(ramp, with_form("vehicle_speed_delay", "epochs", delay_s=0.2).sensors, at)[:, 4]
    changes = np.flatnonzero(np.diff(told))
    assert_allclose(np.diff(changes), 100, atol=1)
    ages = at - np.interp(told, ramp[:, V], np.arange(len(ramp)) * 1e-3)
    assert ages.min() == pytest.approx(0.15, abs=2e-3)
    assert ages.max() == pytest.approx(0.25, abs=2e-3)


def test_a_late_tasks_windows_differ_and_lose_nothing(ramp):
    """By the time of a pulse in the log; here by more, to be seen among more teeth."""
    coarse = with_form("wheel_speed_quantisation", "late_task", teeth=64.0, window_s=0.02).sensors
    assert coarse.wheel_window_jitter * 0.02 == pytest.approx(2.0 * np.pi / 64.0 / 65.0)
    sensors = replace(coarse, wheel_teeth=40_000.0, wheel_window_jitter=0.15)
    at = np.arange(1.0, 9.0, 1e-4)
    counted = read(ramp, sensors, at)[:, 0]
    ends = at[np.flatnonzero(np.diff(counted))]
    assert_allclose(np.diff(ends).mean(), 0.02, rtol=1e-3)
    turned = np.interp(at[[0, -1]], np.arange(len(ramp)) * 1e-3, ramp[:, ANGLE])
    told = np.sum(counted[::200]) * 0.02
    assert told == pytest.approx(turned[1] - turned[0], rel=5e-3)
    plain = read(ramp, replace(sensors, wheel_window_jitter=0.0), at)[:, 0]
    off = (counted / plain - 1.0).std()
    assert off == pytest.approx(0.15 / np.sqrt(6.0), rel=0.1)


def test_scattered_teeth_come_at_their_own_moments_and_none_is_lost(ramp):
    speed = 2.0 * np.pi / 0.04 * CAR.wheel_radius_m
    path, at = roll(nominal(CAR, Road()), speed, 3.0), np.arange(1.0, 2.9, 0.0137)
    whole = with_form("wheel_speed_quantisation", "scattered_teeth", teeth=64.0, window_s=0.04).sensors
    assert_allclose(read(path, whole, at)[:, :4] * 0.04 / (2.0 * np.pi), 1.0, atol=1e-9)
    own, even = (
        read(ramp, replace(whole, wheel_window_s=0.01, wheel_scatter=scatter), np.arange(1.0, 9.0, 0.01))
        for scatter in (whole.wheel_scatter, 1e-9)
    )
    off = np.abs(own - even)[:, :4] * 0.64 / (2.0 * np.pi)
    assert off.max() < 2.1
    assert np.mean(off > 0.5) == pytest.approx(2.0 * 0.1 * np.sqrt(2.0 / np.pi), rel=0.2)


def test_scale_differs_on_coarse_stretches_and_while_it_warms_up():
    path, at = roll(nominal(CAR, Road()), 20.0, 30.0), np.arange(0.5, 29.0, 0.01)
    for form, share in (
        ("on_coarse_stretches", 0.15 * np.tanh(4.0 * np.sin(2.0 * np.pi * 20.0 * at / GRAIN_M))),
        ("warming", 0.12 * (1.0 - 2.0 * np.exp(-at / 15.0))),
    ):
        told = read(path, with_form("vehicle_speed_scale", form, factor=0.96).sensors, at)[:, 4]
        assert_allclose(told / 20.0 - 1.0, -0.04 * (1.0 + share), rtol=1e-6)
        assert share.mean() == pytest.approx(0.0, abs=0.02)


def test_a_sensor_mounted_askew_reads_gravity_and_less_of_all_else(ramp):
    askew = np.arcsin(0.6 / 9.81)
    at, true, told = reading(ramp, with_form("accelerometer_bias", "tilted", bias_m_s2=-0.6).sensors)
    assert at.size > 100
    assert_allclose(told[:, 5], true[:, 5] * np.cos(askew) - 9.81 * np.sin(askew), atol=2e-6)


def test_a_bias_wanders_about_itself(ramp):
    sensors = with_form("accelerometer_bias", "wandering", bias_m_s2=0.3).sensors
    at = np.arange(0.0, 3000.0, 0.1)
    bias = read(ramp, sensors, at)[:, 5] - read(ramp, replace(sensors, accel_bias_m_s2=0.0), at)[:, 5]
    assert bias.mean() == pytest.approx(0.3, rel=5e-3)
    assert 0.3 * 0.15 < np.abs(bias - 0.3).max() <= 0.3 * forms_fifth.WANDER


# --- tyres, noise, logger


def test_tyres_at_known_points():
    x = 0.05 * 60_000.0 / 3000.0
    expected = 3000.0 * (1.0 - np.exp(-(x + 0.2 * x**2 + (0.04 + 1.0 / 12.0) * x**3)))
    assert cubed(0.05, 60_000.0, 3000.0, 0.2) == pytest.approx(expected)
    p = forms_fifth.FOREIGN["hyperbolic_tangent"].apply(nominal(CAR, Road()), share=1.0).physics
    load = CAR.mass_kg * 9.81 / 4.0
    whole = kernel.tyre_force(p, 1.0, 0.0, 0.9, load, 0.0)
    slip = whole / (1.27 * CAR.stiffness_n)
    assert kernel.tyre_force(p, slip, 0.0, 0.9, load, 0.0) == pytest.approx(np.tanh(1.0) * whole, rel=1e-6)


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    spectrum = np.abs(np.fft.rfft(mains(white, clock, rng)[:, 3] / white.sigmas[3])) ** 2
    hertz = np.fft.rfftfreq(clock.size, 5e-3)
    near = spectrum[np.abs(hertz - 50.0) < 0.2].sum() / spectrum.sum()
    assert near == pytest.approx(0.2, abs=0.02)
    level = popping(white, clock, rng) / white.sigmas
    assert_allclose(np.mean(level[20:] * level[:-20], axis=0), POPS_SHARE * np.exp(-0.2 / POPS_S), atol=0.02)
    alike = np.corrcoef(shared_supply(white, clock, rng).T)
    assert_allclose(alike[~np.eye(6, dtype=bool)], SUPPLY_SHARE, atol=0.02)
    assert np.abs(bounded(white, clock, rng) / white.sigmas).max() == pytest.approx(np.sqrt(3.0), rel=1e-3)
    hits = stones(white, clock, rng) / white.sigmas
    loud = np.corrcoef((hits**2).T)
    assert np.all(loud[~np.eye(6, dtype=bool)] > 0.02)
    assert np.all(np.mean(hits**4, axis=0) > 3.3)


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(3)
    columns = ["wheel_torque_fl_nm", "wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]
    made = pd.DataFrame(np.cumsum(0.01 * rng.normal(size=(3000, 4)), axis=0), columns=columns)
    made.insert(0, "time_s", np.arange(3000) * 5e-3)
    made["position_m"] = 5.0 * made["time_s"]
    made.loc[[5, 900], "accel_x_m_s2"] = np.nan
    return made


def test_a_converter_has_whole_steps(log):
    told = converted_in_bits(log)
    steps = told["wheel_speed_fl_rad_s"] / (RANGES["wheel_speed"] / 2**BITS)
    assert_allclose(steps, np.round(steps), atol=1e-9)
    assert RANGES["wheel_speed"] > 45.0 / 0.285
    assert told["position_m"].equals(log["position_m"])


def test_a_value_stands_until_it_has_changed(log):
    told, least = on_change(log), CHANGES["accel"]
    off = (told - log)["accel_x_m_s2"]
    assert off.abs().max() < least
    moved = told["accel_x_m_s2"].dropna().diff().iloc[1:]
    assert np.all((moved == 0.0) | (moved.abs() >= least))
    assert 0.1 < (moved == 0.0).mean() < 0.9
    assert told["time_s"].equals(log["time_s"])


def test_a_slow_receiver_leaves_every_second_row_without_a_speed(log):
    told = slow_receiver(log)
    assert told["vehicle_speed_m_s"].isna().to_numpy().tolist() == [False, True] * 1500
    assert told.drop(columns="vehicle_speed_m_s").equals(log.drop(columns="vehicle_speed_m_s"))


# --- deviations outside the library


def test_an_accelerometer_that_pitches_reads_gravity_too(ramp):
    at, true, told = reading(ramp, by_further("accelerometer_pitches", share=0.1).sensors)
    assert at.size > 100
    assert_allclose(told[:, 5], 1.1 * true[:, 5], rtol=1e-3)


def test_a_speed_in_steps_is_below_the_speed(ramp):
    _, true, told = reading(ramp, by_further("speed_in_steps", step_m_s=0.25).sensors)
    assert_allclose(told[:, 4] / 0.25, np.round(told[:, 4] / 0.25), atol=1e-9)
    off = (true - told)[:, 4]
    assert off.min() >= 0.0
    assert off.max() < 0.25
    assert off.mean() == pytest.approx(0.125, rel=0.1)
