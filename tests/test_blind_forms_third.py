"""The third family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, forms_of, numbered, reading, with_form
from test_blind_plant import CAR, QUIET, carried, roll

from benchmarks.gap.withheld.generator import forms_third, kernel, motors
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import PATCH_M, USUAL_RAD_S
from benchmarks.gap.withheld.generator.forms import NOISES, Family, is_further
from benchmarks.gap.withheld.generator.kernel import BODY, PITCH, N, V, W, X
from benchmarks.gap.withheld.generator.recording import (
    DIGITS_THIRD,
    NOISES_THIRD,
    REPEATED,
    losing_runs,
    repeating,
)
from benchmarks.gap.withheld.generator.recording_fourth import DIGITS_FOURTH, NOISES_FOURTH
from benchmarks.gap.withheld.generator.scales import SWAY_S
from benchmarks.gap.withheld.generator.sensors import Noise, Sensors, read
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

LOCKED = 0.79 * 0.9 * 9.81
"""Deceleration with locked wheels on a dry road [m/s^2]."""


# --- effects


@pytest.mark.parametrize("chosen", forms_of("aero_drag", later=False))
def test_drag_coasts_down_by_the_hyperbola(chosen):
    path = roll(with_form(*chosen, drag_area_m2=0.8), 30.0, 20.0)
    rate = 0.5 * 1.225 * 0.8 * 30.0 / carried(CAR)
    assert path[-1, V] == pytest.approx(30.0 / (1.0 + rate * 20.0), rel=1e-3)


@pytest.mark.parametrize("chosen", forms_of("aero_drag", later=False))
def test_air_changes_the_loads_by_no_more_than_its_lift(chosen):
    world = with_form(*chosen, drag_area_m2=0.8)
    path = roll(world, 30.0, 1.0, -2000.0)[500:]
    air = path[:, V] ** 2 / CAR.mass_kg
    lift = LOCKED / 9.81 * world.physics.lift * air
    assert_allclose(path[:, N], -LOCKED + lift - world.physics.drag * air, rtol=1e-3)
    assert world.physics.lift <= 0.5 * world.physics.drag


@pytest.mark.parametrize("chosen", forms_of("road_grade", later=False))
def test_grade_pulls_by_its_mean(chosen):
    path = roll(with_form(*chosen, grade=0.02), 22.0, 10.5)
    end = int(np.searchsorted(path[:, X], 2.0 * forms_third.GRADE_M))
    pull = 9.81 * 0.02 * CAR.mass_kg / carried(CAR)
    assert 22.0**2 - path[end, V] ** 2 == pytest.approx(2.0 * pull * path[end, X], rel=5e-3)


@pytest.mark.parametrize("chosen", forms_of("wheel_radius_offset", but=("warming",)))
def test_radius_is_that_of_free_rolling(chosen):
    world = with_form(*chosen, radius_m=0.30)
    free = roll(world, 20.0, 1.0)[-1]
    assert free[V] == pytest.approx(20.0, rel=1e-4)
    assert np.mean(free[V] / free[W : W + 4]) == pytest.approx(0.30, rel=1e-5)
    path = roll(world, 10.0, 4.0, 150.0)
    lever = 0.30 * world.physics.lever
    rotating = 4.0 * CAR.wheel_inertia_kg_m2 / (0.30 * lever)
    gained = 4.0 * 4.0 * 150.0 / lever / (CAR.mass_kg + rotating)
    assert path[-1, V] - 10.0 == pytest.approx(gained, rel=5e-3)
    assert 0.29 - 1e-9 <= lever <= 0.30 + 1e-9


@pytest.mark.parametrize("chosen", forms_of("wheel_inertia_offset", but=("more_at_speed",)))
def test_inertia_is_the_mean_of_the_wheels(chosen):
    path = roll(with_form(*chosen, road=Road((0.0,), (1e-6,)), inertia_kg_m2=2.0), 10.0, 1.0, 20.0)
    assert np.mean(20.0 / (path[-1, W : W + 4] - path[0, W : W + 4])) == pytest.approx(2.0, rel=1e-3)


def test_links_carry_their_share_at_once_and_the_springs_the_rest_later():
    path = roll(with_form("load_transfer", "links_and_springs", cog_height_m=0.6), 10.0, 2.0, 100.0)
    left = path[200:400, BODY] / path[200:400, N]
    times = np.arange(200, 400) * 1e-3
    expected = np.exp(-times / forms_third.SPRINGS_S)
    assert_allclose(1.0 - left, expected, atol=0.02)
    assert 0.2 < forms_third.LINKS < 0.6


def test_a_body_on_its_springs_overshoots_by_its_damping():
    path = roll(with_form("load_transfer", "pitching_body", cog_height_m=0.6), 10.0, 2.0, 100.0)
    overshoot = path[:, PITCH].max() / path[-1, N] - 1.0
    damping = kernel.BODY_DAMPING
    assert overshoot == pytest.approx(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)), abs=0.02)


@pytest.mark.parametrize("chosen", forms_of("tyre_relaxation", but=("partly_at_once",)))
def test_relaxation_length_is_that_of_a_wheel_at_rest_in_the_mean(chosen):
    p = with_form(*chosen, length_m=0.4).physics
    load = 0.25 * p.mass * 9.81
    if p.relaxation > 0.0:
        assert kernel.relaxing(p, 0.0, 0.9, load) == pytest.approx(0.4)
        assert 0.05 < kernel.relaxing(p, 0.5, 0.9, 1.3 * load) < 0.6
    else:
        assert p.force_relaxation == 0.4


@pytest.mark.parametrize("chosen", forms_of("tyre_stiffness_offset", later=False))
def test_stiffness_shows_in_the_slip_at_the_mean_load(chosen):
    even = replace(CAR, cog_to_rear_axle_m=0.5 * CAR.wheelbase_m)
    path = roll(with_form(*chosen, even, stiffness_n=25_000.0), 15.0, 1.0, 100.0)
    stiff = roll(nominal(even, Road()), 15.0, 1.0, 100.0)
    slips = [at[-1, W : W + 4] * 0.29 / at[-1, V] - 1.0 for at in (path, stiff)]
    assert np.mean(1.0 / slips[0]) / np.mean(1.0 / slips[1]) == pytest.approx(0.5, rel=0.03)


@pytest.mark.parametrize(
    ("chosen", "given"),
    [
        pytest.param(c, given, id=f"{i}")
        for i, (c, given) in enumerate(
            ((effect, form), given)
            for effect, given in {
                "friction_offset": {"factor": 0.75},
                "mu_split": {"left_factor": 0.5, "right_factor": 1.0},
            }.items()
            for form in forms_third.EFFECTS[effect]
        )
    ],
)
def test_friction_brakes_by_its_mean(chosen, given):
    """Kinetic energy that locked wheels take over whole patches."""
    path = roll(with_form(*chosen, **given), 25.0, 3.0, -2000.0)[500:]
    end = int(np.searchsorted(path[:, X], path[0, X] + PATCH_M))
    braked = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * (path[end, X] - path[0, X]))
    assert braked == pytest.approx(0.75 * LOCKED, rel=5e-3)


@pytest.mark.parametrize("chosen", forms_of("torque_lag", later=False))
def test_lag_shifts_the_speed_by_its_time(chosen):
    times = []
    for torque in (100.0, -100.0):
        command = np.zeros((301, 4))
        command[101:] = torque
        free = driven(nominal(CAR, Road()), command)[:, V]
        late = driven(with_form(*chosen, time_constant_s=0.1), command)[:, V]
        times.append((free[-1] - late[-1]) / (free[-1] - free[2000]))
    assert np.mean(times) == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("chosen", forms_of("torque_gain", but=("warming",)))
def test_gain_scales_the_acceleration(chosen):
    worlds, gains = (with_form(*chosen, factor=0.9), nominal(CAR, Road())), []
    for sign in (1.0, -1.0):
        start = USUAL_RAD_S * CAR.wheel_radius_m - sign * 3.0
        changes = [roll(world, start, 4.0, sign * 150.0)[-1, V] - start for world in worlds]
        gains.append(changes[0] / changes[1])
    assert np.mean(gains) == pytest.approx(0.9, rel=2e-3)


@pytest.mark.parametrize("chosen", forms_of("brake_drag", later=False))
def test_drag_at_the_wheels_slows_by_its_mean(chosen):
    path = roll(with_form(*chosen, torque_nm=15.0), 20.0, 5.0)
    lost = 5.0 * 4.0 * 15.0 / 0.29 / carried(CAR)
    assert 20.0 - path[-1, V] == pytest.approx(lost, rel=5e-3)


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


@pytest.mark.parametrize("chosen", forms_of("vehicle_speed_scale", later=False))
def test_speed_is_scaled_by_the_mean(chosen):
    path = roll(nominal(CAR, Road()), 20.0, 2.0 * SWAY_S)
    at = np.linspace(0.0, 2.0 * SWAY_S, 4000, endpoint=False)
    told = read(path, with_form(*chosen, factor=1.04).sensors, at)[:, 4]
    assert told.mean() / 20.0 == pytest.approx(1.04, rel=1e-4)
    assert_allclose(told / 20.0 - 1.0, 0.04, rtol=0.15)


@pytest.mark.parametrize("chosen", forms_of("accelerometer_bias", later=False))
def test_bias_is_the_mean_of_a_log(chosen):
    path = roll(nominal(CAR, Road()), 20.0, 29.0)
    told = read(path, with_form(*chosen, bias_m_s2=0.3).sensors, np.arange(0.0, 29.0, 0.01))[:, 5]
    assert told.mean() == pytest.approx(0.3, rel=0.02)
    assert_allclose(told, 0.3, rtol=0.11)


# --- noise and logger


@pytest.mark.parametrize("noisy", numbered([*NOISES_THIRD.values(), *NOISES_FOURTH.values()]))
@pytest.mark.parametrize("rate", [100.0, 1200.0])
def test_noise_has_its_size_in_a_log_and_little_of_it_is_slow(noisy, rate):
    noise, rows = Noise(0.05, 0.02, 0.1, 0.0, 0.2, 0.01, 0.0, 0.0), int(30.0 * rate)
    values = [
        noisy(noise, np.arange(rows) / rate, np.random.default_rng(i)) / noise.sigmas for i in range(12)
    ]
    sizes = np.std(values, axis=1)
    assert sizes.mean() == pytest.approx(1.0, rel=0.03)
    assert np.all(np.abs(sizes - 1.0) < 0.15)
    seconds = np.mean(np.reshape(values, (12, 30, -1, 6)), axis=2)
    assert seconds.std() < 0.35


def test_kinds_of_noise_are_told_apart():
    assert len({noisy(QUIET, np.arange(900) / 100.0, np.random.default_rng(0)).tobytes()
                for noisy in NOISES.values()}) == len(NOISES)  # fmt: skip


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(3)
    columns = [
        "time_s",
        "wheel_torque_fl_nm",
        "wheel_speed_fl_rad_s",
        "vehicle_speed_m_s",
        "accel_x_m_s2",
        "position_m",
    ]
    made = pd.DataFrame(rng.normal(size=(20_000, 6)), columns=columns)
    made.loc[7, "vehicle_speed_m_s"] = np.nan
    return made


@pytest.mark.parametrize("digits", numbered([*DIGITS_THIRD.values(), *DIGITS_FOURTH.values()]))
def test_loggers_leave_clock_command_and_places(digits, log):
    kept = digits(log)
    assert list(kept) == list(log)
    assert len(kept) == len(log)
    assert kept["time_s"].equals(log["time_s"])
    assert_allclose(kept["wheel_torque_fl_nm"], log["wheel_torque_fl_nm"], atol=0.051)
    assert_allclose(kept["position_m"], log["position_m"], atol=0.0051)


def test_a_repeated_sample_is_the_one_before(log):
    kept = repeating(log)
    for name in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"):
        changed = np.flatnonzero(kept[name].to_numpy() != log[name].to_numpy())
        assert 0.5 * REPEATED < changed.size / len(log) < 2.0 * REPEATED
        assert np.array_equal(kept[name].to_numpy()[changed], kept[name].to_numpy()[changed - 1])
    assert not kept.isna().any().any()


def test_lost_runs_are_few_and_the_rest_is_kept(log):
    kept = losing_runs(log)
    lost = kept.isna() & log.notna()
    assert 20 < lost.to_numpy().sum() < 200
    assert kept[~lost].equals(log[~lost])
    ends = lost.to_numpy().astype(int)
    assert (np.diff(ends, axis=0) == 1).sum() <= 12


# --- deviations outside the library


def test_a_motors_power_is_its_limit():
    path = roll(by_further("motor_power_limit", power_w=4000.0), 20.0, 6.0, 200.0)
    gained = 0.5 * carried(CAR) * (path[-1, V] ** 2 - path[1000, V] ** 2)
    assert gained == pytest.approx(4.0 * 4000.0 * 5.0, rel=0.02)
    braking = roll(by_further("motor_power_limit", power_w=4000.0), 20.0, 2.0, -200.0)
    assert_allclose(braking[:, V], roll(nominal(CAR, Road()), 20.0, 2.0, -200.0)[:, V])


def test_a_hot_motor_gives_less():
    path = roll(by_further("motor_derating", share=0.4), 5.0, 30.0, 60.0)
    at = np.array([100, 12_000, 29_000])
    left = 1.0 - 0.4 * (1.0 - np.exp(-at * 1e-3 / motors.DERATING_S))
    assert_allclose(path[at, N] / path[100, N], left / left[0], rtol=0.01)


def test_one_brake_drags_one_wheel():
    path = roll(by_further("one_brake_drags", wheel=2.0, torque_nm=60.0), 20.0, 5.0)
    lost = 5.0 * 60.0 / 0.29 / carried(CAR)
    assert 20.0 - path[-1, V] == pytest.approx(lost, rel=1e-3)
    slips = path[-1, W : W + 4] * 0.29 / path[-1, V] - 1.0
    assert slips.argmin() == 2
    assert np.ptp(np.delete(slips, 2)) < 0.1 * abs(slips[2])


def test_a_sensors_limit_and_offset():
    path = roll(nominal(CAR, Road()), 25.0, 2.5, -2000.0)
    at = np.arange(0.5, 2.0, 0.01)
    true = read(path, Sensors(), at)
    limited = read(path, by_further("accelerometer_limit", limit_m_s2=4.0).sensors, at)
    assert_allclose(limited[:, 5], np.maximum(true[:, 5], -4.0))
    offset = read(path, by_further("speed_offset", offset_m_s=0.4).sensors, at)
    assert_allclose(offset[:, 4], true[:, 4] + 0.4)
    assert_allclose(offset[:, :4], true[:, :4])


def test_what_the_second_family_lacks():
    assert is_further({"load_transfer": "pitching_body"}, "load_transfer", Family.SECOND)
    assert not is_further({"load_transfer": "through_springs"}, "load_transfer", Family.SECOND)
    assert is_further({"load_transfer": "through_springs"}, "load_transfer", Family.FIRST)
    assert not is_further({"torque_lag": "one_stage"}, "torque_lag", Family.FIRST)
    assert not is_further({}, "torque_lag", Family.FIRST)
