"""Forms of the effects on wheels, tyres and friction, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    AIRBORNE,
    DRY,
    HALF_WARM_S,
    LOCKED,
    NO_COMMAND,
    SLIDING,
    WET,
    _slip,
    _warmth,
    forms_of,
    moving,
    slopes,
    with_form,
)
from withheld_plant import CAR, roll

from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    PATCH_M,
    PROFILE_STEP_M,
    STRETCH_M,
    TEXTURE_M,
    USUAL_M_S,
    WARM_S,
    WEAVE_S,
)
from benchmarks.gap.withheld.generator.falling import (
    ARCTANGENT,
    EXPONENTIAL,
    LINE_AND_TAIL,
    ROOTED,
    TWO_RATES,
    fallen,
)
from benchmarks.gap.withheld.generator.kernel import MOTOR, SLIP, N, V, W, X
from benchmarks.gap.withheld.generator.outside import OUTSIDE
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

SPLIT = {"left_factor": 0.5, "right_factor": 1.0}


def _stiffnesses(form: str, torque: float) -> np.ndarray:
    path = roll(with_form("tyre_stiffness_offset", form, stiffness_n=30_000.0), 20.0, 0.6, torque)
    rims = path[-1, W : W + 4] * CAR.wheel_radius_m
    slips = (rims - path[-1, V]) / np.maximum(rims, path[-1, V])
    forces = CAR.mass_kg * path[-1, N] / 4.0
    return forces / (1.27 * slips)


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


@pytest.mark.parametrize("chosen", forms_of("tyre_relaxation", but=("partly_at_once",)))
def test_relaxation_length_is_that_of_a_wheel_at_rest_in_the_mean(chosen):
    p = with_form(*chosen, length_m=0.4).physics
    load = 0.25 * p.mass * 9.81
    if p.relaxation > 0.0:
        assert kernel.relaxing(p, 0.0, 0.9, load) == pytest.approx(0.4)
        assert 0.05 < kernel.relaxing(p, 0.5, 0.9, 1.3 * load) < 0.6
    else:
        assert p.force_relaxation == 0.4


@pytest.mark.parametrize("chosen", forms_of("tyre_stiffness_offset", by=4))
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
            for form in ("everywhere", "patchy")
        )
    ],
)
def test_friction_brakes_by_its_mean(chosen, given):
    """Kinetic energy that locked wheels take over whole patches."""
    path = roll(with_form(*chosen, **given), 25.0, 3.0, -2000.0)[500:]
    end = int(np.searchsorted(path[:, X], path[0, X] + PATCH_M))
    braked = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * (path[end, X] - path[0, X]))
    assert braked == pytest.approx(0.75 * LOCKED, rel=5e-3)


@pytest.mark.parametrize(
    ("effect", "given"),
    [("friction_offset", {"factor": 0.75}), ("mu_split", {"left_factor": 0.5, "right_factor": 1.0})],
)
def test_stretches_brake_by_their_mean(effect, given):
    path = roll(with_form(effect, "stretches", **given), 30.0, 5.0, -2000.0)[500:]
    end = int(np.searchsorted(path[:, X], path[0, X] + STRETCH_M))
    braked = (path[0, V] ** 2 - path[end, V] ** 2) / (2.0 * (path[end, X] - path[0, X]))
    assert braked == pytest.approx(0.75 * LOCKED, rel=5e-3)


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
    assert np.sqrt(p.shaft_stiffness / series) / (2.0 * np.pi) == pytest.approx(55.0)


def test_the_wheels_inertias_have_the_mean():
    world = with_form("wheel_inertia_offset", "each_its_own", road=AIRBORNE, inertia_kg_m2=1.7)
    path = roll(world, 10.0, 1.0, 20.0)
    inertias = 20.0 / (path[-1, W : W + 4] - path[0, W : W + 4])
    assert inertias.mean() == pytest.approx(1.7, rel=1e-3)
    assert np.ptp(inertias) == pytest.approx(2.0 * (0.2 + 0.1) * 0.5, rel=0.01)


def test_each_axles_tyres_ring_over_their_own_length():
    length, speed, heavy = 0.5, 20.0, replace(CAR, mass_kg=1e5)
    path = roll(with_form("tyre_relaxation", "unlike_axles", heavy, length_m=length), speed, 0.5, 20.0)
    for wheel, own in ((0, 1.2 * length), (2, 0.8 * length)):
        turns = np.flatnonzero(np.diff(np.sign(np.diff(path[:251, W + wheel]))) != 0)
        natural = 1.27 * 50_000.0 * 0.29**2 / (1.2 * own)
        expected = np.pi / np.sqrt(natural - (speed / own / 2.0) ** 2)
        assert 1e-3 * np.mean(np.diff(turns)) == pytest.approx(expected, rel=0.03)


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


def test_the_sides_radii_have_the_mean():
    path = roll(with_form("wheel_radius_offset", "unlike_sides", radius_m=0.30), 20.0, 1.0)[-1]
    radii = path[V] / path[W : W + 4]
    assert_allclose(radii, 0.30 + 0.2 * 0.01 * np.array([1.0, -1.0, 1.0, -1.0]), rtol=1e-4)


def test_wheels_of_another_size_turn_up_by_their_inertia():
    world = with_form("wheel_radius_offset", "other_size", road=AIRBORNE, radius_m=0.30)
    path = roll(world, 10.0, 1.0, 20.0)
    inertia = CAR.wheel_inertia_kg_m2 * (0.30 / 0.29) ** 3
    assert path[-1, W] - path[0, W] == pytest.approx(20.0 / inertia, rel=1e-3)
    rolling = roll(with_form("wheel_radius_offset", "other_size", radius_m=0.30), 20.0, 1.0)[-1]
    assert_allclose(rolling[W : W + 4], rolling[V] / 0.30, rtol=1e-6)


def test_force_that_is_in_part_at_once_lags_by_the_length():
    """Of a slip that steps up, what the force lacks over the way adds up to the length."""
    p = with_form("tyre_relaxation", "partly_at_once", length_m=0.5).physics
    way, step = 0.0, 1e-3
    lagged = 0.0
    for _ in range(8000):
        way += step * (1.0 - (lagged + p.relaxation_direct * (1.0 - lagged)))
        lagged += step * (1.0 - lagged) / kernel.relaxing(p, 0.0, 0.9, 3000.0)
    assert way == pytest.approx(0.5, rel=2e-3)


def test_force_is_in_part_at_once():
    """A wheel that is turned up off its rest: the force is a fifth of what it will be."""
    world = with_form("tyre_relaxation", "partly_at_once", length_m=0.5)
    p, dy = world.physics, np.zeros(N)
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 20.0 / 0.29), 0.0, np.zeros((2, 4)))
    y[W : W + 4] *= 1.002
    slip = 0.002 / 1.002
    reading = kernel.slope(p, y, 0.0, np.zeros((2, 4)), dy)
    assert reading * CAR.mass_kg / 4.0 == pytest.approx(0.2 * 1.27 * 50_000.0 * slip, rel=0.01)


def test_stiffness_is_told_of_the_usual_speed_and_of_the_whole_drive():
    told = {}
    for speed in (10.0, 20.0, 30.0):
        world = with_form("tyre_stiffness_offset", "less_at_speed", stiffness_n=30_000.0)
        plain = with_form("tyre_stiffness_offset", "everywhere", stiffness_n=30_000.0)
        ratio = _slip(plain, speed, 30.0).mean() / _slip(world, speed, 30.0).mean()
        told[speed] = 30_000.0 * ratio
    assert told[20.0] == pytest.approx(30_000.0, rel=2e-3)
    assert told[10.0] == pytest.approx(30_000.0 - 0.5 * 0.15 * 20_000.0, rel=5e-3)
    assert told[30.0] == pytest.approx(30_000.0 + 0.5 * 0.15 * 20_000.0, rel=5e-3)
    p = with_form("tyre_stiffness_offset", "warming", stiffness_n=30_000.0).physics
    clock = np.linspace(0.0, 24.0, 500)
    more = np.array([details.stiffened(p, t, 20.0) for t in clock])
    assert_allclose(more, -0.15 * 20_000.0 * (1.0 - 2.0 * np.exp(-clock / WARM_S)))
    assert abs(more.mean()) < 0.15 * np.abs(more).max()


def test_friction_falls_at_two_rates():
    assert fallen(TWO_RATES, 2.0, 0.4) == pytest.approx(0.4 + 0.3 * (np.exp(-3.4) + np.exp(-0.6)))


@pytest.mark.parametrize(
    ("effect", "given"), [("friction_offset", {"factor": 0.75}), ("mu_split", SPLIT)], ids=["0", "1"]
)
def test_friction_on_repairs_and_at_speed(effect, given):
    left = given.get("left_factor", 0.75)
    p = with_form(effect, "repairs", **given).physics
    assert p.blotches.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(p.blotches) == pytest.approx(0.5)
    inside, outside = (details.friction(p, 0, at - p.front_arm, 20.0) for at in (50.0, 90.0))
    assert outside - inside == pytest.approx(0.9 * 0.5 * (1.0 - left))
    world = with_form(effect, "more_at_speed", **given)
    assert details.friction(world.physics, 0, 0.0, USUAL_M_S) == pytest.approx(0.9 * left)
    faster = details.friction(world.physics, 0, 0.0, 1.5 * USUAL_M_S)
    assert faster == pytest.approx(0.9 * (1.0 - (1.0 - left) * 1.125))
    path = roll(world, USUAL_M_S + 0.5, 0.2, -2000.0)
    assert_allclose(path[150:, N], -0.75 * LOCKED, rtol=5e-3)


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


@pytest.mark.parametrize("radius", [0.30, 0.28])
def test_a_radius_goes_in_part_with_the_load(radius):
    path = roll(with_form("wheel_radius_offset", "deflecting", radius_m=radius), 20.0, 1.0)[-1]
    front = CAR.cog_to_rear_axle_m / (0.5 * CAR.wheelbase_m) - 1.0
    told = radius + 0.5 * (radius - 0.29) * front * np.array([1.0, 1.0, -1.0, -1.0])
    assert_allclose(path[V] / path[W : W + 4], told, rtol=1e-5)


def test_a_stiffness_is_told_on_dry_road():
    for road, told in ((DRY, 30_000.0), (WET, 30_000.0 + 0.3 * 20_000.0)):
        world = with_form(
            "tyre_stiffness_offset", "less_when_wet", road=Road((0.0,), (road,)), stiffness_n=3e4
        )
        assert moving(world.physics, 0.001)[2] * CAR.mass_kg == pytest.approx(
            4.0 * 1.27 * told * 0.001, rel=5e-3
        )
    stiff = with_form("tyre_stiffness_offset", "less_when_wet", stiffness_n=75_000.0)
    assert stiff.split >= with_form("tyre_stiffness_offset", "everywhere", stiffness_n=75_000.0).split


def test_a_falloff_is_told_on_dry_road():
    for road, told in ((DRY, 0.1), (WET, 0.13)):
        world = with_form(
            "friction_falloff", "sooner_when_wet", road=Road((0.0,), (road,)), falloff_s_m=0.1, floor=0.5
        )
        at = roll(world, 20.0, 0.8, -3000.0)[400:]
        left = [fallen(EXPONENTIAL, told * speed, 0.5) for speed in at[:, V]]
        assert_allclose(at[:, N], -0.79 * road * np.array(left) * 9.81, rtol=3e-3)


def test_a_friction_deviates_more_on_slippery_road():
    road = Road((0.0, 50.0), (DRY, WET))
    p = with_form("friction_offset", "more_when_wet", road=road, factor=0.7).physics
    told = [details.friction(p, w, at, 20.0) for at in (10.0, 80.0) for w in (0, 3)]
    assert_allclose(told, np.repeat([DRY * (1.0 - 0.3 * 0.85), WET * (1.0 - 0.3 * 1.15)], 2))
    p = with_form("mu_split", "more_when_wet", road=road, left_factor=0.6, right_factor=1.0).physics
    told = [details.friction(p, w, at, 20.0) for at in (10.0, 80.0) for w in (0, 3)]
    assert_allclose(told, [DRY * (1.0 - 0.4 * 0.85), DRY, WET * (1.0 - 0.4 * 1.15), WET])


def test_a_blurred_border_goes_straight_from_one_road_to_the_next():
    world = OUTSIDE["road_borders_blurred"].apply(
        nominal(CAR, Road((0.0, 50.0, 100.0), (DRY, WET, DRY))), {"over_m": 20.0}
    )
    p = world.physics
    places = np.array([20.0, 40.0, 45.0, 49.999, 50.0, 55.0, 60.0, 75.0, 95.0, 105.0, 150.0])
    told = [details.friction(p, 0, at - p.front_arm, 20.0) for at in places]
    assert_allclose(told, [0.9, 0.9, 0.8, 0.7, 0.7, 0.6, 0.5, 0.5, 0.6, 0.8, 0.9], atol=1e-4)
    assert_allclose(details.friction(p, 3, 45.0 + p.rear_arm, 20.0), 0.8)


@pytest.mark.parametrize("radius", [0.30, 0.28])
def test_a_radius_is_told_on_dry_road(radius):
    for road, told in ((DRY, radius), (WET, radius - 0.25 * (radius - 0.29))):
        world = with_form("wheel_radius_offset", "less_when_wet", road=Road((0.0,), (road,)), radius_m=radius)
        path = roll(world, 20.0, 1.0)[-1]
        assert_allclose(path[V] / path[W : W + 4], told, rtol=1e-5)


@pytest.mark.parametrize("speed", [10.0, 65.0 * 0.29, 28.0])
def test_an_inertia_is_told_at_the_usual_speed(speed):
    given = {"inertia_kg_m2": 1.8}
    p = with_form("wheel_inertia_offset", "more_at_speed", road=Road((0.0,), (1e-9,)), **given).physics
    command = np.full((2, 4), 50.0)
    y = kernel.begin(p, 0.0, speed, np.full(4, speed / 0.29), 0.0, command)
    dy = np.zeros(N)
    kernel.slope(p, y, 0.0, command, dy)
    told = 1.8 + 0.25 * 0.6 * (speed / 0.29 / 65.0 - 1.0)
    assert_allclose(dy[W : W + 4], 50.0 / told, rtol=1e-6)


def test_a_tyre_lets_its_force_go_sooner():
    p = with_form("tyre_relaxation", "let_go_sooner", length_m=0.5).physics
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 20.0 / 0.29), 0.0, NO_COMMAND)
    y[W : W + 4] = 20.0 / 0.29 / (1.0 - 0.01)
    dy = np.zeros(N)
    for lagged, share in ((0.0, 1.2), (0.01, 1.0), (0.02, 0.8)):
        y[SLIP : SLIP + 4] = lagged
        kernel.slope(p, y, 0.0, NO_COMMAND, dy)
        rate = (0.01 - lagged) * 20.0 / 0.99 / (0.5 * share)
        assert_allclose(dy[SLIP : SLIP + 4], rate, rtol=1e-3, atol=1e-12)


def test_a_friction_deviates_more_in_braking():
    brakes = roll(with_form("friction_offset", "more_in_braking", factor=0.7), 25.0, 1.0, -3000.0)
    assert_allclose(brakes[500:, N], -SLIDING * DRY * (1.0 - 0.3 * 1.15), rtol=1e-3)
    p = with_form("friction_offset", "more_in_braking", factor=0.7).physics
    told = [details.friction(p, 1, 5.0, 20.0, 0.0, details.gripping(p, rub)) for rub in (5.0, 0.0, -5.0)]
    assert_allclose(told, DRY * (1.0 - 0.3 * np.array([0.85, 1.0, 1.15])), rtol=1e-9)


def test_a_sliding_wheel_sweeps_the_slippery_side():
    given = {"left_factor": 0.6, "right_factor": 1.0}
    path = roll(with_form("mu_split", "swept_away", **given), 28.0, 1.0, -3000.0)
    told = 0.5 + 0.5 * (1.0 - 0.4 * 0.875)
    assert_allclose(path[500:, N], -SLIDING * DRY * told, rtol=2e-3)
    p = with_form("mu_split", "swept_away", **given).physics
    grips = [1.0 + details.gripping(p, rub) for rub in (0.0, 2.0 * np.arctanh(0.5), 30.0, -30.0)]
    assert_allclose(grips, [1.125, 1.0, 0.875, 0.875], rtol=1e-9)


def test_one_tyre_has_not_been_changed():
    path = roll(with_form("wheel_radius_offset", "one_other", radius_m=0.30), 20.0, 1.0)[-1]
    radii = path[V] / path[W : W + 4]
    assert_allclose(radii, [0.3025, 0.3025, 0.3025, 0.2925], rtol=1e-5)
    assert radii.mean() == pytest.approx(0.30, rel=1e-5)


def test_each_tyre_relaxes_over_a_length_of_its_own():
    p = with_form("tyre_relaxation", "each_its_own", length_m=0.5).physics
    lengths = -0.01 * 20.0 / slopes(p, SLIP=0.01)[0][SLIP : SLIP + 4]
    assert_allclose(lengths, [0.6, 0.4, 0.4, 0.6], rtol=1e-9)
    assert lengths.mean() == pytest.approx(0.5)


@pytest.mark.parametrize("stiffness", [30_000.0, 70_000.0])
def test_tyres_of_one_side_are_more_worn(stiffness):
    p = with_form("tyre_stiffness_offset", "unlike_sides", stiffness_n=stiffness).physics
    at, still = slopes(p, slip=1e-4)[0], slopes(p)[0]
    force = -(at - still)[W : W + 4] * 1.2 / 0.29
    told = stiffness + 0.2 * (stiffness - 50_000.0) * np.array([1.0, -1.0, 1.0, -1.0])
    assert_allclose(force, 1.27 * 1e-4 * told, rtol=2e-3)
    assert force.sum() == pytest.approx(4.0 * 1.27 * 1e-4 * stiffness, rel=2e-3)


def test_friction_falls_by_a_line_and_its_tail():
    told = [fallen(LINE_AND_TAIL, x, 0.4) for x in (0.0, 0.25, 0.5, 1.0, 2.0)]
    assert_allclose(told, 0.4 + 0.6 * np.array([1.0, 0.75, 0.5, 0.5 * np.exp(-1.0), 0.5 * np.exp(-3.0)]))
    before, after = (fallen(LINE_AND_TAIL, 0.5 + h, 0.4) - 0.7 for h in (-1e-6, 1e-6))
    assert after == pytest.approx(-before, rel=1e-4)


def test_a_friction_deviates_less_under_load():
    p = with_form("friction_offset", "less_under_load", factor=0.7).physics
    told = [details.friction(p, 1, 5.0, 20.0, 0.0, details.gripping(p, 0.0, x)) for x in (0.5, 1.0, 2.0, 3.0)]
    assert_allclose(told, DRY * (1.0 - 0.3 * np.array([1.15, 1.0, 0.7, 0.7])), rtol=1e-9)
    brakes = roll(with_form("friction_offset", "less_under_load", factor=0.7), 25.0, 1.0, -3000.0)
    assert_allclose(brakes[500:, N], -SLIDING * DRY * 0.7, rtol=2e-3)


def test_a_friction_told_with_loads_that_shift_is_that_under_them():
    """The front tyres of a car that brakes bear more, and what they lack is less."""
    world = with_form("friction_offset", "less_under_load", factor=0.7).moved(cog_height=0.6)
    at = roll(world, 25.0, 1.0, -3000.0)[700, N]
    p = world.physics
    length, quarter = p.front_arm + p.rear_arm, 0.25 * p.mass * 9.81
    front, rear = (
        (9.81 * arm + s * at * 0.6) * p.mass / (2.0 * length)
        for arm, s in ((p.rear_arm, -1), (p.front_arm, 1))
    )
    grips = [x * (1.0 - 0.3 * (1.0 - 0.3 * (x / quarter - 1.0))) for x in (front, rear)]
    assert at == pytest.approx(-0.79 * DRY * 2.0 * sum(grips) / p.mass, rel=2e-3)
    assert front > 1.2 * quarter


@pytest.mark.parametrize(("time", "share"), [(0.0, 1.25), (HALF_WARM_S, 1.0), (150.0, 0.75)])
def test_a_slippery_side_thaws(time, share):
    p = with_form("mu_split", "thawing", left_factor=0.6, right_factor=1.0).physics
    told = [details.friction(p, wheel, 5.0, 20.0, time) for wheel in range(4)]
    left = DRY * (1.0 - 0.4 * share)
    assert_allclose(told, [left, DRY, left, DRY], rtol=1e-4)
