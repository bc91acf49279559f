"""Forms of the effects on sensors, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    forms_of,
    reading,
    with_form,
)
from withheld_plant import CAR, roll

from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import GRAIN_M, USUAL_M_S, USUAL_RAD_S
from benchmarks.gap.withheld.generator.kernel import ANGLE, N, V, W, X
from benchmarks.gap.withheld.generator.scales import (
    AIRED_S,
    MOUNT_M_S,
    MOUNT_SHARE,
    SWAY_S,
    TABLE_M_S,
    WAVES_M,
)
from benchmarks.gap.withheld.generator.sensor_set import Sensors
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.signals import FAN_S, JUMP_S
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def short_ramp():
    """Path of a car that speeds up evenly."""
    return roll(nominal(CAR, Road()), 10.0, 10.0, 100.0)


def test_teeth_off_their_places_show_over_a_turn_and_shared_windows_at_once():
    path = roll(nominal(CAR, Road()), 20.3, 20.0)
    given = {"teeth": 4096.0, "window_s": 0.005}
    own = with_form("wheel_speed_quantisation", "uneven_teeth", **given).sensors
    _, true, counted = reading(path, own)
    swing = own.wheel_uneven * 2.0 * np.pi / 4096.0 * true[:, 0]
    tooth = 2.0 * np.pi / (4096.0 * 0.005)
    assert np.abs(counted[:, 0] - true[:, 0]).max() < swing.max() + 1.01 * tooth
    climbing = roll(nominal(CAR, Road()), 10.0, 6.0, 150.0)
    shared = with_form("wheel_speed_quantisation", "shared_windows", teeth=4096.0, window_s=0.04).sensors
    at = np.arange(1.0, 5.0, 1e-3)
    changes = [np.diff(sensed) != 0.0 for sensed in read(climbing, shared, at).T[:4]]
    assert all(np.array_equal(changes[0], other) for other in changes[1:])


@pytest.mark.parametrize("chosen", forms_of("vehicle_speed_scale", by=4))
def test_speed_is_scaled_by_the_mean(chosen):
    path = roll(nominal(CAR, Road()), 20.0, 2.0 * SWAY_S)
    at = np.linspace(0.0, 2.0 * SWAY_S, 4000, endpoint=False)
    told = read(path, with_form(*chosen, factor=1.04).sensors, at)[:, 4]
    assert told.mean() / 20.0 == pytest.approx(1.04, rel=1e-4)
    assert_allclose(told / 20.0 - 1.0, 0.04, rtol=0.15)


@pytest.mark.parametrize("chosen", forms_of("accelerometer_bias", by=4))
def test_bias_is_the_mean_of_a_log(chosen):
    path = roll(nominal(CAR, Road()), 20.0, 29.0)
    told = read(path, with_form(*chosen, bias_m_s2=0.3).sensors, np.arange(0.0, 29.0, 0.01))[:, 5]
    assert told.mean() == pytest.approx(0.3, rel=0.02)
    assert_allclose(told, 0.3, rtol=0.11)


def test_windows_that_overlap_and_flanks_that_are_late():
    path = roll(nominal(CAR, Road()), 10.0, 6.0, 150.0)
    at = np.arange(1.0, 5.0, 1e-3)
    given = {"teeth": 4096.0, "window_s": 0.04}
    changes = {
        form: np.diff(read(path, with_form("wheel_speed_quantisation", form, **given).sensors, at)[:, 0])
        != 0.0
        for form in ("window_by_window", "overlapping_windows")
    }
    assert changes["window_by_window"].sum() == pytest.approx(100, abs=1)
    assert changes["overlapping_windows"].sum() == pytest.approx(400, abs=30)
    late = with_form("wheel_speed_quantisation", "late_flanks", teeth=64.0, window_s=0.01).sensors
    plain = replace(late, wheel_flanks=0.0)
    counts = [read(path, sensors, at)[:, 0] * 0.64 / (2.0 * np.pi) for sensors in (late, plain)]
    assert np.abs(counts[0] - counts[1]).max() == pytest.approx(1.0)
    assert counts[0].mean() == pytest.approx(counts[1].mean(), rel=2e-3)
    assert path[-1, ANGLE] > 0.0


def test_scale_and_bias_are_stated_at_the_usual_speed():
    path = roll(nominal(CAR, Road()), 0.5 * USUAL_M_S, 4.0)
    at = np.arange(1.0, 3.0, 0.01)
    scaled = read(path, with_form("vehicle_speed_scale", "grows_with_speed", factor=1.04).sensors, at)[:, 4]
    assert_allclose(scaled / 10.0 - 1.0, 0.04 * (1.0 - 0.5 * 0.15), rtol=1e-9)
    biased = read(path, with_form("accelerometer_bias", "with_vibration", bias_m_s2=0.3).sensors, at)[:, 5]
    assert_allclose(biased, 0.3 * (1.0 - 0.5 * 0.2), rtol=1e-9)
    pulling = roll(nominal(CAR, Road()), 10.0, 4.0, 200.0)
    nodding = read(pulling, with_form("vehicle_speed_scale", "with_pitch", factor=1.04).sensors, at)[:, 4]
    true = np.interp(at, np.arange(len(pulling)) * 1e-3, pulling[:, V])
    nod = 0.04 * pulling[2000, N]
    assert_allclose(nodding / true - 1.0, 0.04 * (1.0 + nod), rtol=1e-3)


def test_wheels_are_read_in_turn(short_ramp):
    at, true, late = reading(short_ramp, with_form("wheel_speed_delay", "in_turn", delay_s=0.05).sensors)
    ages = ((true - late)[:, :4] / np.gradient(true[:, :4], at, axis=0)).mean(axis=0)
    assert_allclose(ages, [0.044, 0.048, 0.052, 0.056], atol=2e-4)


@pytest.mark.parametrize(("effect", "column"), [("wheel_speed_delay", 2), ("vehicle_speed_delay", 4)])
def test_messages_get_lost(short_ramp, effect, column):
    at = np.arange(1.0, 9.0, 1e-3)
    sensors = with_form(effect, "losing_messages", delay_s=0.05).sensors
    changes = np.diff(read(short_ramp, sensors, at)[:, column]) != 0.0
    assert changes.sum() == pytest.approx(400 * (1.0 - 0.08), rel=0.05)


def test_a_receiver_tells_the_mean_over_its_epoch(short_ramp):
    at = np.arange(1.0, 9.0, 1e-3)
    told = read(short_ramp, with_form("vehicle_speed_delay", "epochs", delay_s=0.2).sensors, at)[:, 4]
    changes = np.flatnonzero(np.diff(told))
    assert_allclose(np.diff(changes), 100, atol=1)
    ages = at - np.interp(told, short_ramp[:, V], np.arange(len(short_ramp)) * 1e-3)
    assert ages.min() == pytest.approx(0.15, abs=2e-3)
    assert ages.max() == pytest.approx(0.25, abs=2e-3)


def test_a_late_tasks_windows_differ_and_lose_nothing(short_ramp):
    """By the time of a pulse in the walking_log; here by more, to be seen among more teeth."""
    coarse = with_form("wheel_speed_quantisation", "late_task", teeth=64.0, window_s=0.02).sensors
    assert coarse.wheel_window_jitter * 0.02 == pytest.approx(2.0 * np.pi / 64.0 / 65.0)
    sensors = replace(coarse, wheel_teeth=40_000.0, wheel_window_jitter=0.15)
    at = np.arange(1.0, 9.0, 1e-4)
    counted = read(short_ramp, sensors, at)[:, 0]
    ends = at[np.flatnonzero(np.diff(counted))]
    assert_allclose(np.diff(ends).mean(), 0.02, rtol=1e-3)
    turned = np.interp(at[[0, -1]], np.arange(len(short_ramp)) * 1e-3, short_ramp[:, ANGLE])
    told = np.sum(counted[::200]) * 0.02
    assert told == pytest.approx(turned[1] - turned[0], rel=5e-3)
    plain = read(short_ramp, replace(sensors, wheel_window_jitter=0.0), at)[:, 0]
    off = (counted / plain - 1.0).std()
    assert off == pytest.approx(0.15 / np.sqrt(6.0), rel=0.1)


def test_scattered_teeth_come_at_their_own_moments_and_none_is_lost(short_ramp):
    speed = 2.0 * np.pi / 0.04 * CAR.wheel_radius_m
    path, at = roll(nominal(CAR, Road()), speed, 3.0), np.arange(1.0, 2.9, 0.0137)
    whole = with_form("wheel_speed_quantisation", "scattered_teeth", teeth=64.0, window_s=0.04).sensors
    assert_allclose(read(path, whole, at)[:, :4] * 0.04 / (2.0 * np.pi), 1.0, atol=1e-9)
    own, even = (
        read(
            short_ramp, replace(whole, wheel_window_s=0.01, wheel_scatter=scatter), np.arange(1.0, 9.0, 0.01)
        )
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


def test_a_sensor_mounted_askew_reads_gravity_and_less_of_all_else(short_ramp):
    askew = np.arcsin(0.6 / 9.81)
    at, true, told = reading(short_ramp, with_form("accelerometer_bias", "tilted", bias_m_s2=-0.6).sensors)
    assert at.size > 100
    assert_allclose(told[:, 5], true[:, 5] * np.cos(askew) - 9.81 * np.sin(askew), atol=2e-6)


def test_a_bias_wanders_about_itself(short_ramp):
    sensors = with_form("accelerometer_bias", "wandering", bias_m_s2=0.3).sensors
    at = np.arange(0.0, 3000.0, 0.1)
    bias = (
        read(short_ramp, sensors, at)[:, 5]
        - read(short_ramp, replace(sensors, accel_bias_m_s2=0.0), at)[:, 5]
    )
    assert bias.mean() == pytest.approx(0.3, rel=5e-3)
    assert 0.3 * 0.15 < np.abs(bias - 0.3).max() <= 0.3 * 0.25


def test_rear_wheels_are_read_later_than_front_ones(short_ramp):
    at, true, late = reading(short_ramp, with_form("wheel_speed_delay", "unlike_axles", delay_s=0.05).sensors)
    ages = ((true - late)[:, :4] / np.gradient(true[:, :4], at, axis=0)).mean(axis=0)
    assert_allclose(ages, [0.045, 0.045, 0.055, 0.055], atol=2e-4)


@pytest.mark.parametrize(
    ("effect", "column", "usual"),
    [("wheel_speed_delay", 1, USUAL_RAD_S), ("vehicle_speed_delay", 4, USUAL_M_S)],
)
def test_a_value_that_takes_a_distance_is_older_when_slow(short_ramp, effect, column, usual):
    at, true, late = reading(short_ramp, with_form(effect, "older_when_slow", delay_s=0.05).sensors)
    ages = ((true - late)[:, column]) / np.gradient(true[:, column], at)
    assert_allclose(ages, 0.05 * (0.7 + 0.3 * usual / true[:, column]), rtol=0.01)
    standing = with_form(effect, "older_when_slow", delay_s=0.05).sensors
    path = np.zeros((3000, N + 1))
    path[:, [V, W + 1]] = np.arange(3000)[:, None] * 1e-6
    slow = 2.0 - read(path, standing, np.array([2.0]))[0, column] * 1e3
    assert slow == pytest.approx(0.05 * (0.7 + 0.3 * 3.0), rel=1e-3)


def test_of_two_windows_one_is_told(short_ramp):
    given = {"teeth": 100_000.0, "window_s": 0.02}
    at = np.arange(1.0, 9.0, 1e-3)
    both, half = (
        read(short_ramp, with_form("wheel_speed_quantisation", form, **given).sensors, at)[:, 0]
        for form in ("window_by_window", "every_second_window")
    )
    assert np.sum(np.diff(both) != 0.0) == pytest.approx(400, abs=2)
    assert np.sum(np.diff(half) != 0.0) == pytest.approx(200, abs=2)
    ages = at - np.interp(half, short_ramp[:, W], np.arange(len(short_ramp)) * 1e-3)
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
