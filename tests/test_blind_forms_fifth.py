"""The fifth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, numbered, with_form
from test_blind_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import details, forms_fifth, kernel
from benchmarks.gap.withheld.generator.air import SHUT_M_S
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    PROFILE_STEP_M,
    TEXTURE_M,
    USUAL_M_S,
    USUAL_NM,
    USUAL_RAD_S,
)
from benchmarks.gap.withheld.generator.falling import ARCTANGENT, fallen
from benchmarks.gap.withheld.generator.forms import ASPECTS, OUTSIDES, Family, is_further
from benchmarks.gap.withheld.generator.kernel import LAG, MOTOR, TWIST, N, V, W, X
from benchmarks.gap.withheld.generator.table import Group, table

pytestmark = pytest.mark.long

LOCKED = 0.79 * 0.9 * 9.81
"""Deceleration with locked wheels on a dry road [m/s^2]."""
AIRBORNE = Road((0.0,), (1e-9,))
SHAFT = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.6}
SPLIT = {"left_factor": 0.5, "right_factor": 1.0}


def test_what_the_family_adds_is_what_the_page_says():
    fourth, fifth = ASPECTS[Family.FOURTH], ASPECTS[Family.FIFTH]
    assert set(fourth) == set(fifth)
    assert sum(len(fifth[aspect]) - len(forms) for aspect, forms in fourth.items()) == 52
    assert len(OUTSIDES[Family.FIFTH]) - len(OUTSIDES[Family.FOURTH]) == 6
    counts = [[s.group for s in table("full", f)].count(Group.PAIR) for f in (Family.FOURTH, Family.FIFTH)]
    assert counts == [24, 29]


# --- effects


def test_shutters_close_at_speed():
    world = with_form("aero_drag", "shutters", drag_area_m2=0.8)
    for speed in (10.0, USUAL_M_S, 30.0):
        share = 1.0 + forms_fifth.SHUTTERS * np.tanh((speed - USUAL_M_S) / SHUT_M_S)
        path = roll(world, speed, 0.4)
        rate = 0.5 * 1.225 * 0.8 * share * path[300, V] ** 2 / carried(CAR)
        assert path[200, V] - path[400, V] == pytest.approx(0.2 * rate, rel=5e-3)


def test_a_breeze_is_the_drag_of_air_that_moves_a_little():
    path = roll(with_form("aero_drag", "breeze", drag_area_m2=0.8), 20.0, 26.0)
    clock = np.arange(0.0, 26.0, 0.01)
    wind = sum(size * np.sin(2.0 * np.pi * clock / s + phase) for size, s, phase in forms_fifth.BREEZES)
    assert np.abs(wind).max() < 2.1
    assert abs(wind.mean()) < 0.15
    for i in (300, 900, 1700, 2300):
        rate = 0.5 * 1.225 * 0.8 * (path[10 * i, V] + wind[i]) ** 2 / carried(CAR)
        slowed = (path[10 * i - 50, V] - path[10 * i + 50, V]) / 0.1
        assert slowed == pytest.approx(rate, rel=5e-3)


def test_coarse_stretches_resist_by_their_mean():
    path = roll(with_form("rolling_resistance", "coarse_stretches", coefficient=0.02), 22.0, 8.0)
    end = int(np.searchsorted(path[:, X], 2.0 * TEXTURE_M))
    lost = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * path[end, X])
    assert lost == pytest.approx(0.02 * 9.81 * CAR.mass_kg / carried(CAR), rel=2e-3)
    at = [int(np.searchsorted(path[:, X], share * TEXTURE_M)) for share in (0.25, 0.75)]
    coarse, smooth = (path[i - 100, V] - path[i + 100, V] for i in at)
    assert coarse / smooth == pytest.approx(1.25 / 0.75, rel=0.01)


def test_unlike_axles_resist_by_the_weight_that_they_bear():
    p = with_form("rolling_resistance", "unlike_axles", coefficient=0.02).physics
    shares = np.array([details.rolling_of(p, w, 0.0, 17.0, 1.0) for w in range(4)])
    loads = np.array([p.rear_arm, p.rear_arm, p.front_arm, p.front_arm])
    assert shares @ loads / loads.sum() == pytest.approx(1.0)
    assert 1.1 < shares[0] / shares[2] < 1.7


@pytest.mark.parametrize("form", numbered(forms_fifth.EFFECTS["road_grade"]))
def test_profiles_of_the_road_close_and_are_even_on_the_whole(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * PROFILE_STEP_M > 300.0
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.25 < np.abs(profile).max() < 0.4
    steps = np.abs(np.diff(np.append(profile, profile[0])))
    assert steps[-1] <= steps[:-1].max() + 1e-12 < 0.1


def test_a_carrier_behind_the_car_lightens_its_front():
    p = with_form("mass_offset", "carrier", mass_kg=80.0).physics
    behind = (forms_fifth.HITCH - 1.0) * CAR.cog_to_rear_axle_m
    front = [CAR.mass_kg * CAR.cog_to_rear_axle_m / CAR.wheelbase_m, p.mass * p.rear_arm / CAR.wheelbase_m]
    assert front[1] - front[0] == pytest.approx(-80.0 * behind / CAR.wheelbase_m)


def test_tyres_sink_under_the_load_that_they_get():
    path = roll(with_form("mass_offset", "sinking_tyres", mass_kg=300.0), 20.0, 1.0)
    less = CAR.wheel_radius_m - path[-1, V] / path[-1, W : W + 4]
    front_arm = CAR.wheelbase_m - CAR.cog_to_rear_axle_m
    rear = (front_arm + 0.5 * CAR.cog_to_rear_axle_m) / CAR.wheelbase_m
    weight = 0.5 * 300.0 * 9.81 * forms_fifth.SINKING_M_N
    assert_allclose(less, weight * np.array([1.0 - rear, 1.0 - rear, rear, rear]), rtol=0.01)
    assert less.max() < 0.002 * CAR.wheel_radius_m


def test_the_wheels_radii_have_the_mean():
    radii = roll(with_form("wheel_radius_offset", "each_its_own", radius_m=0.30), 20.0, 1.0)[-1]
    radii = radii[V] / radii[W : W + 4]
    assert radii.mean() == pytest.approx(0.30, rel=1e-4)
    assert np.ptp(radii) == pytest.approx(2.0 * (0.2 + 0.1) * 0.01, rel=0.01)


@pytest.mark.parametrize("inertia", [0.8, 1.8])
def test_a_rotor_turns_up_with_its_wheel(inertia):
    world = with_form("wheel_inertia_offset", "rotor_on_shaft", road=AIRBORNE, inertia_kg_m2=inertia)
    path = roll(world, 10.0, 1.0, 20.0)
    assert_allclose(path[-1, [W, MOTOR]] - path[0, [W, MOTOR]], 20.0 / inertia, rtol=2e-3)
    p = world.physics
    assert p.inertia - p.motor_inertia > 0.4
    series = p.motor_inertia * (inertia - p.motor_inertia) / inertia
    assert np.sqrt(p.shaft_stiffness / series) / (2.0 * np.pi) == pytest.approx(forms_fifth.ROTOR_HZ)


def test_the_wheels_inertias_have_the_mean():
    world = with_form("wheel_inertia_offset", "each_its_own", road=AIRBORNE, inertia_kg_m2=1.7)
    path = roll(world, 10.0, 1.0, 20.0)
    inertias = 20.0 / (path[-1, W : W + 4] - path[0, W : W + 4])
    assert inertias.mean() == pytest.approx(1.7, rel=1e-3)
    assert np.ptp(inertias) == pytest.approx(2.0 * (0.2 + 0.1) * 0.5, rel=0.01)


@pytest.mark.parametrize(("reading_m_s2", "share"), [(6.0, 1.35), (-6.0, 0.65)])
def test_a_nose_dives_sooner_than_it_lifts(reading_m_s2, share):
    p = with_form("load_transfer", "dives_sooner", cog_height_m=0.6).physics
    y, dy = np.zeros(N), np.zeros(N)
    kernel.lean(p, y, reading_m_s2, dy)
    assert dy[kernel.PITCH] == pytest.approx(reading_m_s2 / (forms_fifth.SPRINGS_S * share), rel=1e-6)


def test_each_axles_tyres_ring_over_their_own_length():
    length, speed, heavy = 0.5, 20.0, replace(CAR, mass_kg=1e5)
    path = roll(with_form("tyre_relaxation", "unlike_axles", heavy, length_m=length), speed, 0.5, 20.0)
    for wheel, own in ((0, 1.2 * length), (2, 0.8 * length)):
        turns = np.flatnonzero(np.diff(np.sign(np.diff(path[:251, W + wheel]))) != 0)
        natural = 1.27 * 50_000.0 * 0.29**2 / (1.2 * own)
        expected = np.pi / np.sqrt(natural - (speed / own / 2.0) ** 2)
        assert 1e-3 * np.mean(np.diff(turns)) == pytest.approx(expected, rel=0.03)


def _stiffnesses(form: str, torque: float) -> np.ndarray:
    path = roll(with_form("tyre_stiffness_offset", form, stiffness_n=30_000.0), 20.0, 0.6, torque)
    rims = path[-1, W : W + 4] * CAR.wheel_radius_m
    slips = (rims - path[-1, V]) / np.maximum(rims, path[-1, V])
    forces = CAR.mass_kg * path[-1, N] / 4.0
    return forces / (1.27 * slips)


def test_stiffness_has_its_mean_over_driving_and_braking_and_over_the_wheels():
    driving, braking = (_stiffnesses("unlike_in_braking", torque).mean() for torque in (40.0, -40.0))
    assert 0.5 * (driving + braking) == pytest.approx(30_000.0, rel=0.01)
    assert 0.5 * (driving - braking) == pytest.approx(0.12 * -20_000.0, rel=0.03)
    own = _stiffnesses("each_its_own", 40.0)
    assert own.mean() == pytest.approx(30_000.0, rel=0.01)
    assert_allclose(own - own.mean(), 0.2 * -20_000.0 * np.array([1.0, -1.0, -1.0, 1.0]), rtol=0.05)


def test_friction_has_fallen_by_half_where_the_arctangent_has():
    assert fallen(ARCTANGENT, 2.0 / np.pi, 0.4) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("effect", "given"), [("friction_offset", {"factor": 0.75}), ("mu_split", SPLIT)], ids=["0", "1"]
)
def test_friction_in_blotches_and_under_the_wheels_that_clear_the_road(effect, given):
    p = with_form(effect, "blotches", **given).physics
    assert p.blotches.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.1 < p.blotches.std() < np.abs(p.blotches).max() < 0.5
    left = given.get("left_factor", 0.75)
    places = np.arange(p.blotches.size) * PROFILE_STEP_M
    for place in (12.0, 133.0, 401.0):
        more = np.interp(place, places, p.blotches)
        friction = details.friction(p, 0, place - p.front_arm, 20.0)
        assert friction == pytest.approx(0.9 * (1.0 + (left - 1.0) * (1.0 + more)))
    world = with_form(effect, "cleared", **given)
    path = roll(world, 30.0, 1.0, -2000.0)
    assert_allclose(path[500:, N], -0.75 * LOCKED, rtol=1e-3)
    front, rear = (details.friction(world.physics, wheel, 50.0, 20.0) for wheel in (0, 2))
    assert front < 0.9 * left < rear < 0.9


def _lags(form: str) -> np.ndarray:
    """Of the four motors, by the area between a step and what follows it [s]."""
    command = np.zeros((201, 4))
    command[101:] = 100.0
    path = driven(with_form("torque_lag", form, time_constant_s=0.1), command)
    told = np.interp(np.arange(len(path)) * 1e-3, np.arange(201) * 1e-2, command[:, 0])
    return np.sum(told[:, None] - path[:, LAG : LAG + 4], axis=0) * 1e-3 / 100.0


def test_motors_follow_by_their_axles_and_by_their_speeds_lag():
    assert_allclose(_lags("unlike_axles"), [0.125, 0.125, 0.075, 0.075], rtol=0.02)
    turning = 10.3 / CAR.wheel_radius_m
    assert_allclose(_lags("slower_at_speed"), 0.1 * (1.0 + 0.2 * (turning / USUAL_RAD_S - 1.0)), rtol=0.02)


def _told(form: str, times: np.ndarray, delay: float, wheel: int) -> np.ndarray:
    """Ages of a ramp that the motors are told."""
    p = with_form("torque_delay", form, delay_s=delay).physics
    ramp = np.arange(401)[:, None] * np.ones(4)
    told = np.array([kernel.motor_torque(p, ramp, wheel, t, 0.0, 30.0) for t in times])
    return times - 0.01 * told


def test_torque_is_late_by_axles_and_by_messages_that_are_lost():
    times = np.arange(1.0, 3.8, 1e-3)
    assert_allclose(_told("unlike_axles", times, 0.06, 0), 0.066, atol=1e-9)
    assert_allclose(_told("unlike_axles", times, 0.06, 3), 0.054, atol=1e-9)
    ages = _told("losing_messages", times, 0.06, 1)
    assert ages.mean() == pytest.approx(0.06, abs=0.0015)
    assert ages.min() > 0.045
    assert 0.02 < np.mean(ages > 0.06 - 0.0016 + 0.0101) < 0.2


def test_gains_have_their_mean_over_the_sides_and_are_stated_at_the_usual_torque():
    gains = with_form("torque_gain", "unlike_sides", factor=0.9).physics.gain
    assert gains.mean() == pytest.approx(0.9)
    assert_allclose(gains[[0, 2]], 0.88)
    p = with_form("torque_gain", "saturating", factor=0.9).physics
    for torque, factor in ((USUAL_NM, 0.9), (-USUAL_NM, 0.9), (2.0 * USUAL_NM, 0.92), (0.0, 0.88)):
        command = np.full((5, 4), torque)
        assert kernel.motor_torque(p, command, 0, 0.01, 0.0, 30.0) == pytest.approx(factor * torque)


def test_a_fast_disc_knocks_the_pads_back():
    world = with_form("brake_drag", "knocked_back", torque_nm=40.0)
    for share, factor in ((0.5, 1.125), (1.0, 1.0), (1.3, 0.925)):
        speed = share * USUAL_RAD_S * CAR.wheel_radius_m
        path = roll(world, speed + 0.1, 0.5)
        slowed = (path[100, V] - path[400, V]) / 0.3
        assert slowed == pytest.approx(factor * 4.0 * 40.0 / 0.29 / carried(CAR), rel=0.01)


@pytest.mark.parametrize("form", numbered(forms_fifth.EFFECTS["driveline_compliance"]))
def test_drivelines_ring_at_the_frequency_of_their_shafts(form):
    world = with_form("driveline_compliance", form, road=AIRBORNE, **SHAFT)
    path = roll(world, 15.0, 0.3, 60.0)
    series = 0.6 * (CAR.wheel_inertia_kg_m2 - 0.6) / CAR.wheel_inertia_kg_m2
    squares = []
    for wheel in (0, 2):
        twist = path[1:110, TWIST + wheel] - path[-50:, TWIST + wheel].mean()
        times = np.flatnonzero(np.diff(np.sign(twist)) > 0)
        squares.append((2.0 * np.pi / (1e-3 * np.mean(np.diff(times)))) ** 2)
    assert np.mean(squares) == pytest.approx(9000.0 / series, rel=0.05)


def test_joints_that_rub_take_the_same_from_each_swing():
    """Dry friction f takes 4 f / k from the size of each period, whatever the size is."""
    given = {**SHAFT, "damping_nm_s_rad": 0.0}
    path = roll(with_form("driveline_compliance", "rubbing_joints", road=AIRBORNE, **given), 15.0, 0.2, 400.0)
    twist = path[1:, TWIST]
    peaks = [twist[i] for i in range(1, 190) if twist[i - 1] < twist[i] >= twist[i + 1]]
    drop = (peaks[0] - peaks[3]) / 3.0
    assert drop == pytest.approx(4.0 * forms_fifth.RUBBING_NM / 9000.0, rel=0.1)


# --- deviations outside the library


def test_an_actuator_hangs_behind_on_the_way_up_and_down():
    command = np.interp(np.arange(301), [0, 100, 200, 300], [0.0, 0.0, 200.0, 0.0])[:, None] * np.ones(4)
    path = driven(by_further("actuator_hysteresis", torque_nm=25.0), command)
    assert_allclose(path[[1500, 1900], LAG], [75.0, 155.0], atol=0.5)
    assert_allclose(path[[2050, 2090], LAG], 175.0, atol=0.5)
    assert_allclose(path[[2500, 2900], LAG], [125.0, 45.0], atol=0.5)


def test_axles_share_what_they_are_told():
    command = np.zeros((5, 4))
    command[:, :2] = 100.0
    p = by_further("axles_share_torque", share=0.2).physics
    assert_allclose([kernel.motor_torque(p, command, w, 0.01, 0.0, 30.0) for w in range(4)], [80, 80, 20, 20])


def test_a_wheel_out_of_round_turns_unevenly_once_a_turn():
    path = roll(by_further("wheels_out_of_round", share=0.01), 6.0, 8.0)
    turning = path[3000:, W] - path[3000:, W].mean()
    spectrum = np.abs(np.fft.rfft(turning * np.hanning(turning.size)))
    hertz = np.fft.rfftfreq(turning.size, 1e-3)[int(np.argmax(spectrum))]
    assert hertz == pytest.approx(path[3000:, W].mean() / (2.0 * np.pi), rel=0.06)
    assert turning.std() * np.sqrt(2.0) == pytest.approx(0.01 * path[3000:, W].mean(), rel=0.15)


def test_slush_slows_where_the_road_is_slippery():
    world = by_further("slush_drag", n_s2_m2=1.0)
    assert_allclose(roll(world, 20.0, 1.0)[:, V], 20.0, rtol=1e-12)
    wet = world.moved(mu_left=np.array([0.5]), mu_right=np.array([0.5]))
    path = roll(wet, 20.0, 10.0)
    rate = 1.0 * 20.0 / carried(CAR)
    assert path[-1, V] == pytest.approx(20.0 / (1.0 + rate * 10.0), rel=1e-3)


def test_what_the_fourth_family_lacks():
    assert is_further({"driveline_compliance": "rubbing_joints"}, "driveline_compliance", Family.FOURTH)
    assert not is_further({"driveline_compliance": "with_play"}, "driveline_compliance", Family.FOURTH)
    assert is_further({"driveline_compliance": "with_play"}, "driveline_compliance", Family.THIRD)
