"""The fourth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, numbered, reading, with_form
from test_blind_plant import CAR, QUIET, carried, roll

from benchmarks.gap.withheld.generator import details, forms_fourth, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import ROLL_M_S, STRETCH_M, USUAL_M_S, USUAL_RAD_S
from benchmarks.gap.withheld.generator.forms import Family, is_further
from benchmarks.gap.withheld.generator.kernel import ANGLE, LAG, MOTOR, SWAY, TWIST, N, V, W, X
from benchmarks.gap.withheld.generator.recording_fourth import (
    DIFFERENCED,
    OVERRUNS,
    SHARED,
    differenced,
    overrunning,
    shaking_together,
    spiking,
    truncating,
)
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.tyre import brush_falling, brush_uniform
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

LOCKED = 0.79 * 0.9 * 9.81
"""Deceleration with locked wheels on a dry road [m/s^2]."""
WET = Road((0.0,), (0.5,))
SHAFT = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.6}


# --- effects


def test_wheels_take_their_share_of_the_drag_as_fans():
    """A free wheel takes it from the road, so that the car is slowed as by the whole; here it slows the wheel alone."""
    world = with_form("aero_drag", "fanning_wheels", road=Road((0.0,), (1e-9,)), drag_area_m2=0.8)
    path = roll(world, 20.0, 0.2)
    force = 0.12 * 0.5 * 1.225 * 0.8 * 20.0**2
    lost = 0.2 * force * 0.29 / 4.0 / CAR.wheel_inertia_kg_m2
    assert path[0, W] - path[-1, W] == pytest.approx(lost, rel=1e-2)


def test_lift_at_the_rear_leaves_the_front():
    p = with_form("aero_drag", "rear_lift", drag_area_m2=0.8).physics
    tilt = 0.5 * p.drag * p.drag_height / CAR.wheelbase_m
    assert 0.25 * p.lift + tilt == pytest.approx(0.0)
    assert 2.0 * (0.25 * p.lift - tilt) == pytest.approx(forms_fourth.REAR_LIFT * p.drag)


@pytest.mark.parametrize(("road", "factor"), [(Road(), 1.0), (WET, 1.0 + forms_fourth.ROLL_WET)])
def test_water_adds_to_the_resistance_of_a_dry_road(road, factor):
    path = roll(with_form("rolling_resistance", "more_when_wet", road=road, coefficient=0.015), 20.0, 5.0)
    lost = 5.0 * factor * 0.015 * CAR.mass_kg * 9.81 / carried(CAR)
    assert path[-1, V] == pytest.approx(20.0 - lost, rel=1e-4)


def test_resistance_grows_in_a_line():
    world = with_form("rolling_resistance", "linear_in_speed", coefficient=0.02)
    paths = [roll(world, share * ROLL_M_S, 0.5)[:, V] for share in (1.5, 0.5)]
    fast, slow = (path[-1] - path[200] for path in paths)
    assert fast / slow == pytest.approx((1.0 + 0.5 * 0.15) / (1.0 - 0.5 * 0.15), rel=1e-2)


@pytest.mark.parametrize("form", numbered(forms_fourth.EFFECTS["road_grade"]))
def test_profiles_of_the_road_are_even_on_the_whole_and_within_reason(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * details.PROFILE_STEP_M == forms_fourth.SECTIONS_M[-1]
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.2 < np.abs(profile).max() < 0.4
    assert details.profile_at(profile, 220.0 * 3 + 5.0) == pytest.approx(profile[1])
    assert details.profile_at(profile, 217.5) == pytest.approx(0.5 * (profile[-1] + profile[0]))


def test_a_load_on_the_roof_lifts_the_centre_of_gravity_where_loads_shift():
    low = with_form("mass_offset", "roof", mass_kg=200.0).physics
    assert low.cog_height == 0.0
    high = replace(CAR, modelled={"load_transfer": {"cog_height_m": 0.5}})
    p = with_form("mass_offset", "roof", high, mass_kg=200.0).physics
    assert p.cog_height == pytest.approx(0.5 + 200.0 / (CAR.mass_kg + 200.0))


def test_links_carry_more_in_braking():
    world = with_form("load_transfer", "anti_dive", cog_height_m=0.6)
    p = world.physics
    assert 0.0 < p.springs_share - p.springs_tilt < p.springs_share + p.springs_tilt < 1.0
    path = roll(world, 10.0, 2.0, 100.0)
    assert path[-1, kernel.BODY] == pytest.approx(path[-1, N], rel=1e-2)


@pytest.mark.parametrize(
    ("effect", "given"),
    [("friction_offset", {"factor": 0.75}), ("mu_split", {"left_factor": 0.5, "right_factor": 1.0})],
)
def test_stretches_brake_by_their_mean(effect, given):
    path = roll(with_form(effect, "stretches", **given), 30.0, 5.0, -2000.0)[500:]
    end = int(np.searchsorted(path[:, X], path[0, X] + STRETCH_M))
    braked = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * (path[end, X] - path[0, X]))
    assert braked == pytest.approx(0.75 * LOCKED, rel=5e-3)


def test_a_controlled_current_swings_over_by_its_damping():
    command = np.zeros((201, 4))
    command[101:] = 100.0
    path = driven(with_form("torque_lag", "swinging", time_constant_s=0.1), command)
    damping = forms_fourth.CURRENT_DAMPING
    over = np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    assert path[:, LAG].max() / 100.0 - 1.0 == pytest.approx(over, abs=0.005)


def test_messages_wait_evenly():
    waits = np.array([details.wait_of(float(cycle)) for cycle in range(3000)])
    assert abs(waits.mean()) < 0.02
    assert waits.std() == pytest.approx(1.0 / np.sqrt(12.0), rel=0.03)
    assert np.abs(np.corrcoef(waits[1:], waits[:-1])[0, 1]) < 0.05


@pytest.mark.parametrize("form", numbered(forms_fourth.EFFECTS["driveline_compliance"]))
def test_drivelines_ring_at_the_frequency_of_their_shafts(form):
    """Shaft between motor and the wheel's rest, on a road that bears nothing; both sides' stiffness in the mean."""
    world = with_form("driveline_compliance", form, road=Road((0.0,), (1e-9,)), **SHAFT)
    path = roll(world, 15.0, 0.3, 60.0)
    series = 0.6 * (CAR.wheel_inertia_kg_m2 - 0.6) / CAR.wheel_inertia_kg_m2
    squares = []
    for wheel in (0, 1):
        twist = path[1:, TWIST + wheel] - path[-150:, TWIST + wheel].mean()
        times = np.flatnonzero(np.diff(np.sign(twist)) > 0)
        squares.append((2.0 * np.pi / (1e-3 * np.mean(np.diff(times)))) ** 2)
    assert np.mean(squares) == pytest.approx(9000.0 / series, rel=0.04)


def test_nothing_passes_a_shafts_play():
    world = with_form("driveline_compliance", "with_play", road=Road((0.0,), (1e-9,)), **SHAFT)
    command = np.full((101, 4), 1e-3)
    path = driven(world, command)
    play = forms_fourth.PLAY_RAD
    assert details.shaft_of(world.physics, 0, 0.99 * play, 5.0) == 0.0
    assert details.shaft_of(world.physics, 0, play + 0.01, 0.0) == pytest.approx(90.0)
    assert details.shaft_of(world.physics, 0, -play - 0.01, 0.0) == pytest.approx(-90.0)
    assert path[-1, MOTOR] > path[-1, W] >= path[0, W] - 1e-9


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
    assert_allclose(scaled / 10.0 - 1.0, 0.04 * (1.0 - 0.5 * forms_fourth.SCALE_GROWTH), rtol=1e-9)
    biased = read(path, with_form("accelerometer_bias", "with_vibration", bias_m_s2=0.3).sensors, at)[:, 5]
    assert_allclose(biased, 0.3 * (1.0 - 0.5 * forms_fourth.BIAS_GROWTH), rtol=1e-9)
    pulling = roll(nominal(CAR, Road()), 10.0, 4.0, 200.0)
    nodding = read(pulling, with_form("vehicle_speed_scale", "with_pitch", factor=1.04).sensors, at)[:, 4]
    true = np.interp(at, np.arange(len(pulling)) * 1e-3, pulling[:, V])
    nod = forms_fourth.SCALE_PITCH * pulling[2000, N]
    assert_allclose(nodding / true - 1.0, 0.04 * (1.0 + nod), rtol=1e-3)


# --- tyres, noise, logger


def test_brushes_at_the_locked_wheel():
    assert brush_uniform(1.0, 60_000.0, 3000.0) == pytest.approx(3000.0)
    assert brush_uniform(0.05, 60_000.0, 3000.0) == pytest.approx(0.75 * 3000.0)
    forces = [brush_falling(s, 60_000.0, 3000.0, 0.8) for s in np.linspace(0.0, 1.0, 5001)]
    assert max(forces) == pytest.approx(3000.0, rel=1e-5)
    held = 2.0 * 0.2 / 1.4
    whole = 3.0 * (1.0 - held) * held**2 + 0.8 * (1.0 - 3.0 * held**2 + 2.0 * held**3)
    assert forces[-1] == pytest.approx(0.8 / whole * 3000.0)


def test_noise_has_its_spectrum():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    fast = differenced(white, clock, rng) / white.sigmas
    assert_allclose(np.mean(fast[1:] * fast[:-1], axis=0), -0.5 * DIFFERENCED, atol=0.02)
    alike = np.corrcoef(shaking_together(white, clock, rng).T)
    assert_allclose(alike[:4, :4][~np.eye(4, dtype=bool)], SHARED, atol=0.02)
    assert_allclose(alike[4:, :4], 0.0, atol=0.02)
    outliers = np.abs(spiking(white, clock, rng) / white.sigmas) > 4.5
    assert 0.001 < outliers.mean() < 0.003


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(3)
    columns = [
        "wheel_torque_fl_nm",
        "wheel_speed_fl_rad_s",
        "vehicle_speed_m_s",
        "accel_x_m_s2",
        "position_m",
    ]
    made = pd.DataFrame(rng.normal(size=(6000, 5)), columns=columns)
    made.insert(0, "time_s", np.arange(6000) * 5e-3)
    return made


def test_steps_are_dropped_downwards_by_little(log):
    off = (log - truncating(log))[["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]]
    assert off.to_numpy().min() >= 0.0
    assert np.all(off.mean() < 0.21 * QUIET.sigmas[3:])


def test_overruns_lose_what_is_measured_at_once(log):
    lost = overrunning(log).isna()
    measured = ["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]
    assert not lost.drop(columns=measured).to_numpy().any()
    assert lost[measured].nunique(axis=1).eq(1).all()
    assert 1 <= (np.diff(lost["accel_x_m_s2"].astype(int)) == 1).sum() <= OVERRUNS
    assert lost["accel_x_m_s2"].mean() < 0.02


# --- deviations outside the library


def test_a_slip_controller_holds_the_wheels():
    world = by_further("slip_controller", slip=0.05, share=0.8)
    held = roll(world, 10.0, 1.0, 100.0)
    free = roll(nominal(CAR, Road()), 10.0, 1.0, 100.0)
    assert_allclose(held[:, V], free[:, V], rtol=1e-9)
    icy = world.moved(mu_left=np.array([0.3]), mu_right=np.array([0.3]))
    slips = roll(icy, 10.0, 2.0, 350.0)[-1, [W, W + 2]] * 0.29 / roll(icy, 10.0, 2.0, 350.0)[-1, V] - 1.0
    assert np.all(slips < 0.25)
    p = world.physics
    assert details.let_through(p, 300.0, -0.5) == 300.0
    assert details.let_through(p, 300.0, 0.05) == 300.0
    assert details.let_through(p, -300.0, -0.05 - 0.5 * details.CUT_SLIP) == pytest.approx(
        -300.0 * (1.0 - 0.5 * 0.8)
    )
    assert details.let_through(p, 300.0, 0.9) == pytest.approx(300.0 * (1.0 - 0.8))


def test_a_brake_bites_more_the_slower():
    world = by_further("brake_torque_rise", share=0.3)
    speeds = USUAL_RAD_S * CAR.wheel_radius_m * np.array([0.6, 1.0, 1.4])
    slowed = [roll(world, speed, 0.2, -80.0)[50:, N].mean() for speed in speeds]
    assert_allclose(np.array(slowed) / slowed[1], [1.12, 1.0, 0.88], rtol=0.01)
    assert_allclose(roll(world, 20.0, 1.0, 80.0)[:, V], roll(nominal(CAR, Road()), 20.0, 1.0, 80.0)[:, V])


def test_a_load_sways_at_its_own_frequency_and_then_goes_along():
    path = roll(by_further("swaying_load", share=0.2, hertz=0.8), 10.0, 16.0, 40.0)
    place = path[:, SWAY] - path[-1, SWAY]
    times = np.flatnonzero(np.diff(np.sign(place[:8000])) > 0)
    wheels = carried(CAR) - CAR.mass_kg
    faster = np.sqrt((CAR.mass_kg + wheels) / (0.8 * CAR.mass_kg + wheels))
    assert 1e3 / np.mean(np.diff(times)) == pytest.approx(0.8 * faster, rel=0.03)
    assert path[-1, N] == pytest.approx(roll(nominal(CAR, Road()), 10.0, 16.0, 40.0)[-1, N], rel=1e-3)


def test_grip_falls_with_speed_in_the_wet_alone():
    p = by_further("wet_grip_falls_with_speed", share=0.4).physics
    wet = p._replace(mu_left=np.array([0.5]), mu_right=np.array([0.5]))
    assert details.friction(p, 0, 0.0, 30.0) == 0.9
    assert details.friction(wet, 0, 0.0, USUAL_M_S) == 0.5
    assert details.friction(wet, 0, 0.0, 1.5 * USUAL_M_S) == pytest.approx(0.5 * 0.8)


def test_a_speed_from_the_wheels_has_their_slip():
    path = roll(nominal(CAR, Road()), 20.0, 3.0, -300.0)
    at, true, told = reading(path, by_further("speed_from_wheels", share=0.5).sensors)
    assert at.size > 10
    assert_allclose(told[:, 4], 0.5 * true[:, 4] + 0.5 * 0.29 * true[:, :4].mean(axis=1), rtol=1e-9)


def test_what_the_third_family_lacks():
    assert is_further({"driveline_compliance": "with_play"}, "driveline_compliance", Family.THIRD)
    assert not is_further({"driveline_compliance": "shafts"}, "driveline_compliance", Family.THIRD)
    assert not is_further({"torque_lag": "two_stages"}, "torque_lag", Family.THIRD)
    assert is_further({"torque_lag": "swinging"}, "torque_lag", Family.THIRD)
