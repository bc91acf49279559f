"""The seventh family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, numbered, with_form
from test_blind_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import air, details, forms_seventh, kernel
from benchmarks.gap.withheld.generator.air import WAKE_S
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    GRAVEL_M,
    GRAVEL_SHARE,
    PROFILE_STEP_M,
    TEXTURE_M,
    WARM_S,
    WEAVE_S,
)
from benchmarks.gap.withheld.generator.falling import ROOTED, fallen
from benchmarks.gap.withheld.generator.forms import ASPECTS, OUTSIDES, RATES_HZ, Family, is_further
from benchmarks.gap.withheld.generator.kernel import BODY, MOTOR, PITCH, SLIP, N, V, W, X
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.table import SEVENTH_PAIRS, Group, table
from benchmarks.gap.withheld.generator.world import World, nominal

pytestmark = pytest.mark.long

LOCKED = 0.79 * 0.9 * 9.81
"""Deceleration with locked wheels on a dry road [m/s^2]."""
AIRBORNE = Road((0.0,), (1e-9,))
HALF_WARM_S = WARM_S * np.log(2.0)
"""When what warms up is as on the mean."""
NO_COMMAND = np.zeros((2, 4))


def test_what_the_family_adds_is_what_the_page_says():
    sixth, seventh = ASPECTS[Family.SIXTH], ASPECTS[Family.SEVENTH]
    assert set(sixth) == set(seventh)
    assert all(len(seventh[effect]) > len(sixth[effect]) for effect in LIBRARY)
    assert sum(len(seventh[aspect]) - len(forms) for aspect, forms in sixth.items()) == 31
    assert len(OUTSIDES[Family.SEVENTH]) - len(OUTSIDES[Family.SIXTH]) == 6
    counts = [[s.group for s in table("full", f)].count(Group.PAIR) for f in (Family.SIXTH, Family.SEVENTH)]
    assert counts == [33, 36]
    assert all(set(pair) < set(LIBRARY) for pair in SEVENTH_PAIRS)
    rates = RATES_HZ[Family.SEVENTH]
    assert sum(rates.values()) == pytest.approx(1.0)
    assert all(rate % 50.0 == 0.0 for rate in rates)


def test_what_the_sixth_family_lacks():
    assert is_further({"friction_falloff": "rooted"}, "friction_falloff", Family.SIXTH)
    assert not is_further({"friction_falloff": "two_rates"}, "friction_falloff", Family.SIXTH)


# --- effects


def _slowing(world: World, speed: float, at_s: float) -> float:
    """How fast a car that coasts loses speed about a time [m/s^2]."""
    rows = round(at_s * 1000.0)
    path = roll(world, speed, at_s + 0.3)
    return float((path[rows - 200, V] - path[rows + 200, V]) / 0.4)


def _warmth(at_s: float) -> float:
    return float(1.0 - 2.0 * np.exp(-at_s / WARM_S))


def test_a_drag_in_traffic_has_its_mean():
    clock = np.linspace(0.0, WAKE_S, 2000, endpoint=False)
    shares = np.array([air.in_wake(0.15, t) for t in clock])
    assert shares.mean() == pytest.approx(1.0, abs=1e-9)
    assert_allclose([shares.min(), shares.max()], [0.85, 1.15], atol=1e-3)
    world = with_form("aero_drag", "in_traffic", drag_area_m2=0.8)
    for at_s, share in ((0.25 * WAKE_S, 0.85), (0.75 * WAKE_S, 1.15)):
        speed = roll(world, 20.0, at_s)[-1, V]
        force = share * 0.5 * 1.225 * 0.8 * speed**2
        assert _slowing(world, 20.0, at_s) == pytest.approx(force / carried(CAR), rel=3e-3)


@pytest.mark.parametrize("at_s", [1.0, HALF_WARM_S, 25.0])
def test_what_resists_when_cold_or_warm_has_its_mean_half_way(at_s):
    weight = CAR.mass_kg * 9.81
    rolling = with_form("rolling_resistance", "warming", coefficient=0.012)
    told = 0.012 * weight * (1.0 - 0.15 * _warmth(at_s)) / carried(CAR)
    assert _slowing(rolling, 22.0, at_s) == pytest.approx(told, rel=3e-3)
    brakes = with_form("brake_drag", "warming", torque_nm=6.0)
    told = 4.0 * 6.0 / 0.29 * (1.0 + 0.2 * _warmth(at_s)) / carried(CAR)
    assert _slowing(brakes, 22.0, at_s) == pytest.approx(told, rel=3e-3)


@pytest.mark.parametrize("form", numbered(forms_seventh.EFFECTS["road_grade"]))
def test_profile_of_the_road_closes_and_is_even_on_the_whole(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * PROFILE_STEP_M > 250.0
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.25 < np.abs(profile).max() < 0.5
    assert np.abs(np.diff(np.append(profile, profile[0]))).max() < 0.06


def test_a_battery_in_the_floor_lowers_the_centre_of_gravity():
    tall = replace(CAR, modelled={"load_transfer": {"cog_height_m": 0.54}})
    p = with_form("mass_offset", "in_the_floor", tall, mass_kg=300.0).physics
    assert p.cog_height == pytest.approx(0.54 - 0.25 * 300.0 / (CAR.mass_kg + 300.0))
    assert with_form("mass_offset", "in_the_floor", mass_kg=300.0).physics.cog_height == 0.0


def test_loaded_tyres_grip_a_little_less_for_their_load():
    world = with_form("mass_offset", "load_sensitive_tyres", mass_kg=0.3 * CAR.mass_kg)
    path = roll(world, 20.0, 0.6, -3000.0)
    assert_allclose(path[400:, N], -LOCKED * 1.3**-0.12, rtol=2e-3)


@pytest.mark.parametrize("at_s", [1.0, HALF_WARM_S, 25.0])
def test_a_warm_tyre_rolls_nearer_to_its_radius(at_s):
    path = roll(with_form("wheel_radius_offset", "warming", radius_m=0.30), 20.0, at_s)[-1]
    radii = path[V] / path[W : W + 4]
    assert_allclose(radii, 0.30 - 0.1 * 0.01 * _warmth(at_s), rtol=1e-5)


def test_three_wheels_are_alike_and_the_fourth_is_a_spare():
    world = with_form("wheel_inertia_offset", "spare_wheel", road=AIRBORNE, inertia_kg_m2=2.0)
    path = roll(world, 10.0, 1.0, 20.0)
    inertia = 20.0 / (path[-1, W : W + 4] - path[0, W : W + 4])
    assert_allclose(inertia, 1.2 + 0.8 * np.array([1.3, 1.3, 1.3, 0.1]), rtol=1e-3)
    light = with_form("wheel_inertia_offset", "spare_wheel", inertia_kg_m2=0.6)
    alike = with_form("wheel_inertia_offset", "all_alike", inertia_kg_m2=0.6 - 0.18)
    assert light.split == alike.split


def test_dampers_carry_what_their_friction_bears():
    """Where they stick, the loads are as far as at once; beyond, the springs lack the rest."""
    sticking, at_once = (
        with_form("load_transfer", f, cog_height_m=0.6).physics for f in ("sticking_dampers", "at_once")
    )
    for body, counted in ((1.9, 2.0), (1.0, 1.6), (3.0, 2.4)):
        y = kernel.begin(at_once, 0.0, 20.0, np.full(4, 76.0), 0.0, NO_COMMAND)
        slopes = []
        for p, pitch in ((sticking, 2.0), (at_once, counted)):
            y[PITCH], y[BODY], dy = pitch, body, np.zeros(N)
            kernel.slope(p, y, 0.0, NO_COMMAND, dy)
            slopes.append(dy[W : W + 4])
        assert_allclose(slopes[0], slopes[1], rtol=1e-12)


def test_a_relaxation_length_is_less_of_warm_tyres():
    p = with_form("tyre_relaxation", "warming", length_m=0.5).physics
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 20.0 / 0.29), 0.0, NO_COMMAND)
    y[W : W + 4] *= 1.002
    for at_s in (0.0, HALF_WARM_S, 30.0):
        dy = np.zeros(N)
        kernel.slope(p, y, at_s, NO_COMMAND, dy)
        lengths = (0.002 / 1.002) * 20.0 * 1.002 / dy[SLIP : SLIP + 4]
        assert_allclose(lengths, 0.5 * (1.0 - 0.12 * _warmth(at_s)), rtol=1e-9)


def test_tyres_are_stiffer_on_coarse_stretches_and_as_told_on_the_whole():
    places = np.linspace(0.0, TEXTURE_M, 3000, endpoint=False)
    assert np.mean([details.coarse(at) for at in places]) == pytest.approx(0.0, abs=1e-9)
    p = with_form("tyre_stiffness_offset", "on_coarse_stretches", stiffness_n=30_000.0).physics
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 20.0 / 0.29), 0.0, NO_COMMAND)
    y[W : W + 4] *= 1.001
    for place in (0.25 * TEXTURE_M, 0.6 * TEXTURE_M):
        y[X] = place
        force = kernel.slope(p, y, 0.0, NO_COMMAND, np.zeros(N)) * CAR.mass_kg
        ends = [details.coarse(place + arm) for arm in (p.front_arm, -p.rear_arm)]
        told = 30_000.0 - 0.2 * 20_000.0 * np.mean(ends)
        assert force == pytest.approx(4.0 * 1.27 * told * 0.001 / 1.001, rel=0.01)


def test_friction_falls_by_a_root():
    assert fallen(ROOTED, 0.75, 0.4) == pytest.approx(0.4 + 0.6 * (1.25 - 0.75))


def test_friction_dries_and_a_car_weaves():
    p = with_form("friction_offset", "drying", factor=0.7).physics
    told = [details.friction(p, 1, 0.0, 20.0, t) for t in (0.0, HALF_WARM_S, 1e3)]
    assert_allclose(told, 0.9 * (1.0 - 0.3 * np.array([1.2, 1.0, 0.8])))
    p = with_form("mu_split", "weaving", left_factor=0.6, right_factor=1.0).physics
    clock = np.linspace(0.0, WEAVE_S, 400, endpoint=False)
    left, right = (np.array([details.friction(p, w, 0.0, 20.0, t) for t in clock]) for w in (0, 3))
    assert left.mean() == pytest.approx(0.9 * 0.6)
    assert_allclose([left.min(), left.max()], [0.9 * 0.5, 0.9 * 0.7])
    assert_allclose(right, 0.9)


def test_a_lag_is_told_of_the_usual_torque():
    p = with_form("torque_lag", "longer_for_much", time_constant_s=0.1).physics
    shares = [details.lag_of(p, 0, 50.0, told, 0.0) for told in (0.0, 150.0, -300.0, 900.0)]
    assert_allclose(shares, [0.75, 1.0, 1.25, 1.25])


def test_torque_that_is_in_part_at_once_lags_by_the_time():
    command = np.zeros((301, 4))
    command[101:] = 100.0
    free = driven(nominal(CAR, Road()), command)[:, V]
    late = driven(with_form("torque_lag", "partly_at_once", time_constant_s=0.1), command)
    lost = (free[-1] - late[-1, V]) / (free[-1] - free[2000])
    assert lost == pytest.approx(0.1, rel=0.01)
    p = with_form("torque_lag", "partly_at_once", road=AIRBORNE, time_constant_s=0.1).physics
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 60.0), 0.0, NO_COMMAND)
    dy = np.zeros(N)
    kernel.slope(p, y, 0.0, np.full((2, 4), 100.0), dy)
    assert_allclose(dy[W : W + 4], 0.2 * 100.0 / 1.2, rtol=1e-3)


@pytest.mark.parametrize("delay", [0.05, 0.003])
def test_motors_are_told_in_turn(delay):
    p = with_form("torque_delay", "in_turn", delay_s=delay).physics
    ramp = np.arange(401.0)[:, None] * np.ones(4)
    ages = [2.0 - 0.01 * kernel.motor_torque(p, ramp, w, 2.0, 0.0, 30.0) for w in range(4)]
    assert_allclose(ages, delay + min(0.006, delay) * np.array([-1.0, -1.0 / 3.0, 1.0 / 3.0, 1.0]))


def test_a_torque_map_errs_between_its_points():
    p = with_form("torque_gain", "by_map", factor=0.9).physics
    for torque, gain in ((150.0, 0.9), (-50.0, 0.9), (25.0, 1.0 - 0.112), (-75.0, 1.0 - 0.088)):
        command = np.full((5, 4), torque)
        assert kernel.motor_torque(p, command, 2, 0.01, 0.0, 30.0) == pytest.approx(gain * torque)
    severest = with_form("torque_gain", "by_map", factor=1.25).physics
    steps = np.arange(0.0, 500.0, 1.0)
    given = [kernel.motor_torque(severest, np.full((5, 4), t), 2, 0.01, 0.0, 30.0) for t in steps]
    assert np.all(np.diff(given) > 0.0)


# --- deviations outside the library


@pytest.mark.parametrize("wheel", range(4))
def test_one_tyre_alone_is_flat(wheel):
    path = roll(by_further("one_tyre_flat", wheel=wheel, less_m=0.008), 20.0, 2.0)[-1]
    radii = path[V] / path[W : W + 4]
    assert_allclose(radii, 0.29 - 0.008 * (np.arange(4) == wheel), rtol=1e-5)


def test_one_axle_gives_more_than_told_and_the_other_less():
    p = by_further("torque_split_shifted", front_more=0.2).physics
    command = np.full((5, 4), -100.0)
    given = [kernel.motor_torque(p, command, w, 0.01, 0.0, 30.0) for w in range(4)]
    assert_allclose(given, [-120.0, -120.0, -80.0, -80.0])


def test_coupled_axles_hand_on_torque_by_their_speeds():
    p, dy, free = by_further("axles_coupled", nm_s_rad=30.0).physics, np.zeros(N), np.zeros(N)
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 20.0 / 0.29), 0.0, NO_COMMAND)
    y[W : W + 2] += 0.5
    kernel.slope(p, y, 0.0, NO_COMMAND, dy)
    kernel.slope(nominal(CAR, Road()).physics, y, 0.0, NO_COMMAND, free)
    assert_allclose((dy - free)[W : W + 4], 15.0 / 1.2 * np.array([-1.0, -1.0, 1.0, 1.0]), rtol=1e-6)
    assert dy[V] == free[V]


def test_gravel_slows_by_its_share_of_the_road():
    world = by_further("loose_gravel", coefficient=0.05)
    path = roll(world, 20.0, 12.0)
    end = int(np.searchsorted(path[:, X], 2.0 * GRAVEL_M))
    slowing = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * path[end, X])
    told = 0.05 * GRAVEL_SHARE * 9.81 * CAR.mass_kg / carried(CAR)
    assert slowing == pytest.approx(told, rel=0.01)
    assert_allclose([details.gravelly(0.0), details.gravelly(1.5 * GRAVEL_M)], [0.0, 1.0], atol=1e-6)


def test_a_stiff_driveline_s_motor_turns_with_its_wheel():
    given = {"stiffness_nm_rad": 9e6, "damping_nm_s_rad": 200.0, "motor_inertia_kg_m2": 0.6}
    world = with_form("driveline_compliance", "read_at_motor", **given)
    assert world.sensors.wheel_at_motor
    path = roll(nominal(CAR, Road()), 10.0, 1.0)
    assert_allclose(path[:, MOTOR : MOTOR + 4], path[:, W : W + 4])
