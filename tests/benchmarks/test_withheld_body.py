"""Forms of the effects on air, road, mass and loads, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    DRY,
    HALF_WARM_S,
    LOCKED,
    NO_COMMAND,
    SLIDING,
    _slip,
    _warmth,
    forms_of,
    moving,
    numbered,
    slopes,
    with_form,
)
from withheld_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import air, details, kernel
from benchmarks.gap.withheld.generator.air import BARRIER_M, NOD_M_S2, SHUT_M_S, WAKE_S
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    PROFILE_STEP_M,
    ROLL_M_S,
    STOPS_M_S2,
    TEXTURE_M,
    USUAL_M_S,
)
from benchmarks.gap.withheld.generator.kernel import BODY, PITCH, SWAY, N, V, W, X
from benchmarks.gap.withheld.generator.world import World, nominal

pytestmark = pytest.mark.long

WET_ROAD = Road((0.0,), (0.5,))


def _slowing(world: World, speed: float, at_s: float) -> float:
    """How fast a car that coasts loses speed about a time [m/s^2]."""
    rows = round(at_s * 1000.0)
    path = roll(world, speed, at_s + 0.3)
    return float((path[rows - 200, V] - path[rows + 200, V]) / 0.4)


@pytest.mark.parametrize("chosen", forms_of("aero_drag", by=4))
def test_drag_coasts_down_by_the_hyperbola(chosen):
    path = roll(with_form(*chosen, drag_area_m2=0.8), 30.0, 20.0)
    rate = 0.5 * 1.225 * 0.8 * 30.0 / carried(CAR)
    assert path[-1, V] == pytest.approx(30.0 / (1.0 + rate * 20.0), rel=1e-3)


@pytest.mark.parametrize("chosen", forms_of("aero_drag", by=4))
def test_air_changes_the_loads_by_no_more_than_its_lift(chosen):
    world = with_form(*chosen, drag_area_m2=0.8)
    path = roll(world, 30.0, 1.0, -2000.0)[500:]
    air = path[:, V] ** 2 / CAR.mass_kg
    lift = LOCKED / 9.81 * world.physics.lift * air
    assert_allclose(path[:, N], -LOCKED + lift - world.physics.drag * air, rtol=1e-3)
    assert world.physics.lift <= 0.5 * world.physics.drag


@pytest.mark.parametrize("chosen", forms_of("road_grade", by=4))
def test_grade_pulls_by_its_mean(chosen):
    path = roll(with_form(*chosen, grade=0.02), 22.0, 10.5)
    end = int(np.searchsorted(path[:, X], 2.0 * 110.0))
    pull = 9.81 * 0.02 * CAR.mass_kg / carried(CAR)
    assert 22.0**2 - path[end, V] ** 2 == pytest.approx(2.0 * pull * path[end, X], rel=5e-3)


def test_links_carry_their_share_at_once_and_the_springs_the_rest_later():
    path = roll(with_form("load_transfer", "links_and_springs", cog_height_m=0.6), 10.0, 2.0, 100.0)
    left = path[200:400, BODY] / path[200:400, N]
    times = np.arange(200, 400) * 1e-3
    expected = np.exp(-times / 0.06)
    assert_allclose(1.0 - left, expected, atol=0.02)
    assert 0.2 < 0.4 < 0.6


def test_a_body_on_its_springs_overshoots_by_its_damping():
    path = roll(with_form("load_transfer", "pitching_body", cog_height_m=0.6), 10.0, 2.0, 100.0)
    overshoot = path[:, PITCH].max() / path[-1, N] - 1.0
    damping = kernel.BODY_DAMPING
    assert overshoot == pytest.approx(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)), abs=0.02)


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
    assert 2.0 * (0.25 * p.lift - tilt) == pytest.approx(0.2 * p.drag)


@pytest.mark.parametrize(("road", "factor"), [(Road(), 1.0), (WET_ROAD, 1.0 + 0.2)])
def test_water_adds_to_the_resistance_of_a_dry_road(road, factor):
    path = roll(with_form("rolling_resistance", "more_when_wet", road=road, coefficient=0.015), 20.0, 5.0)
    lost = 5.0 * factor * 0.015 * CAR.mass_kg * 9.81 / carried(CAR)
    assert path[-1, V] == pytest.approx(20.0 - lost, rel=1e-4)


def test_resistance_grows_in_a_line():
    world = with_form("rolling_resistance", "linear_in_speed", coefficient=0.02)
    paths = [roll(world, share * ROLL_M_S, 0.5)[:, V] for share in (1.5, 0.5)]
    fast, slow = (path[-1] - path[200] for path in paths)
    assert fast / slow == pytest.approx((1.0 + 0.5 * 0.15) / (1.0 - 0.5 * 0.15), rel=1e-2)


@pytest.mark.parametrize("form", numbered(("sections", "rolling_country")))
def test_profiles_of_the_road_are_even_on_the_whole_and_within_reason(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * details.PROFILE_STEP_M == 220.0
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


def test_shutters_close_at_speed():
    world = with_form("aero_drag", "shutters", drag_area_m2=0.8)
    for speed in (10.0, USUAL_M_S, 30.0):
        share = 1.0 + -0.06 * np.tanh((speed - USUAL_M_S) / SHUT_M_S)
        path = roll(world, speed, 0.4)
        rate = 0.5 * 1.225 * 0.8 * share * path[300, V] ** 2 / carried(CAR)
        assert path[200, V] - path[400, V] == pytest.approx(0.2 * rate, rel=5e-3)


def test_a_breeze_is_the_drag_of_air_that_moves_a_little():
    path = roll(with_form("aero_drag", "breeze", drag_area_m2=0.8), 20.0, 26.0)
    clock = np.arange(0.0, 26.0, 0.01)
    wind = sum(
        size * np.sin(2.0 * np.pi * clock / s + phase)
        for size, s, phase in ((1.3, 13.0, 0.7), (0.7, 5.6, 2.1))
    )
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


@pytest.mark.parametrize("form", numbered(("crests", "surveyed")))
def test_profiles_of_the_road_close_and_are_even_on_the_whole(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * PROFILE_STEP_M > 300.0
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.25 < np.abs(profile).max() < 0.4
    steps = np.abs(np.diff(np.append(profile, profile[0])))
    assert steps[-1] <= steps[:-1].max() + 1e-12 < 0.1


def test_a_carrier_behind_the_car_lightens_its_front():
    p = with_form("mass_offset", "carrier", mass_kg=80.0).physics
    behind = (1.7 - 1.0) * CAR.cog_to_rear_axle_m
    front = [CAR.mass_kg * CAR.cog_to_rear_axle_m / CAR.wheelbase_m, p.mass * p.rear_arm / CAR.wheelbase_m]
    assert front[1] - front[0] == pytest.approx(-80.0 * behind / CAR.wheelbase_m)


def test_tyres_sink_under_the_load_that_they_get():
    path = roll(with_form("mass_offset", "sinking_tyres", mass_kg=300.0), 20.0, 1.0)
    less = CAR.wheel_radius_m - path[-1, V] / path[-1, W : W + 4]
    front_arm = CAR.wheelbase_m - CAR.cog_to_rear_axle_m
    rear = (front_arm + 0.5 * CAR.cog_to_rear_axle_m) / CAR.wheelbase_m
    weight = 0.5 * 300.0 * 9.81 * 4e-07
    assert_allclose(less, weight * np.array([1.0 - rear, 1.0 - rear, rear, rear]), rtol=0.01)
    assert less.max() < 0.002 * CAR.wheel_radius_m


@pytest.mark.parametrize(("reading_m_s2", "share"), [(6.0, 1.35), (-6.0, 0.65)])
def test_a_nose_dives_sooner_than_it_lifts(reading_m_s2, share):
    p = with_form("load_transfer", "dives_sooner", cog_height_m=0.6).physics
    y, dy = np.zeros(N), np.zeros(N)
    kernel.lean(p, y, reading_m_s2, dy)
    assert dy[kernel.PITCH] == pytest.approx(reading_m_s2 / (0.05 * share), rel=1e-6)


def test_lift_at_the_front_leaves_the_rear():
    p = with_form("aero_drag", "front_lift", drag_area_m2=0.8).physics
    moment = 0.5 * p.drag * p.drag_height / CAR.wheelbase_m
    assert 0.25 * p.lift - moment == pytest.approx(0.0)
    assert 2.0 * (0.25 * p.lift + moment) == pytest.approx(0.15 * 0.5 * 1.225 * 0.8)


def test_wind_from_the_side_adds_to_the_drag_the_more_the_slower():
    world = with_form("aero_drag", "cross_wind", drag_area_m2=0.8)

    def force(speed: float) -> float:
        """Along the car: drag of the whole air's speed and askew, by its angle."""
        angle = np.arctan2(3.5, speed)
        return (1.0 + air.CROSS_RISE * np.tan(angle) ** 2) * (speed**2 + 3.5**2) * np.cos(angle)

    for speed in (10.0, USUAL_M_S, 28.0):
        path = roll(world, speed, 0.4)
        told = 0.5 * 1.225 * 0.8 * USUAL_M_S**2 * force(path[200, V]) / force(USUAL_M_S)
        assert (path[100, V] - path[300, V]) / 0.2 == pytest.approx(told / carried(CAR), rel=2e-3)
    assert air.crossed(3.5, 10.0) < 1.5


def test_a_tyre_on_the_drum_resists_by_speed_and_a_little_less_by_load():
    p = with_form("rolling_resistance", "as_on_the_drum", coefficient=0.02).physics
    assert details.rolling_of(p, 0, 0.0, ROLL_M_S, 1.0) == pytest.approx(1.0)
    assert details.rolling_of(p, 0, 0.0, 2.0 * ROLL_M_S, 1.0) == pytest.approx(1.05)
    assert details.rolling_of(p, 0, 0.0, ROLL_M_S, 2.0) == pytest.approx(2.0**-0.1)
    world = with_form("rolling_resistance", "as_on_the_drum", coefficient=0.02)
    for share in (0.6, 1.5):
        path = roll(world, share * ROLL_M_S, 0.5)
        factor = (1.0 + 0.05 * (share - 1.0)) * (1.0 + 0.06 * (share**2 - 1.0))
        rate = (path[100, V] - path[400, V]) / 0.3
        assert rate == pytest.approx(factor * 0.02 * 9.81 * CAR.mass_kg / carried(CAR), rel=5e-3)


def test_the_sides_resist_by_their_mean():
    p = with_form("rolling_resistance", "unlike_sides", coefficient=0.02).physics
    shares = [details.rolling_of(p, w, 0.0, 20.0, 1.0) for w in range(4)]
    assert_allclose(shares, [1.15, 0.85, 1.15, 0.85])


@pytest.mark.parametrize("form", numbered(("bridges", "pass")))
def test_profiles_with_bridges_and_bends_are_even_on_the_whole(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * PROFILE_STEP_M > 300.0
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.25 < np.abs(profile).max() < 0.45
    steps = np.abs(np.diff(np.append(profile, profile[0])))
    assert steps[-1] <= steps[:-1].max() + 1e-12 < 0.25


def test_a_loose_load_sways_and_then_goes_along():
    world = with_form("mass_offset", "loose_load", mass_kg=300.0)
    p = world.physics
    assert p.slosh_share * p.mass == pytest.approx(0.4 * 300.0)
    path = roll(world, 10.0, 16.0, 40.0)
    whole = roll(with_form("mass_offset", "at_centre", mass_kg=300.0), 10.0, 16.0, 40.0)
    assert path[-1, N] == pytest.approx(whole[-1, N], rel=1e-3)
    assert path[-1, SWAY] == pytest.approx(-path[-1, N] / (2.0 * np.pi * 1.1) ** 2, rel=0.01)
    assert with_form("mass_offset", "loose_load", mass_kg=-100.0).physics.slosh_share == 0.0


def test_tyres_stiffen_by_half_of_what_their_load_is_more():
    loaded = with_form("mass_offset", "stiffening_tyres", mass_kg=0.4 * CAR.mass_kg)
    soft = with_form("mass_offset", "at_centre", mass_kg=0.4 * CAR.mass_kg)
    ratio = _slip(soft, 15.0, 30.0).mean() / _slip(loaded, 15.0, 30.0).mean()
    assert ratio == pytest.approx(1.2, rel=0.01)


def test_a_soft_body_pitches_at_its_frequency():
    p = with_form("load_transfer", "soft_body", cog_height_m=0.6).physics
    y, dy = np.zeros(kernel.N), np.zeros(kernel.N)
    kernel.lean(p, y, 2.0, dy)
    assert dy[kernel.BODY] == pytest.approx((2.0 * np.pi * 1.4) ** 2 * 2.0)


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


@pytest.mark.parametrize("form", numbered(("ever_steeper",)))
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


@pytest.mark.parametrize(("speed", "share"), [(20.0, 1.0), (10.0, 2.0**0.08), (30.0, 1.5**-0.08)])
def test_a_drag_coefficient_falls_with_the_speed(speed, share):
    p = with_form("aero_drag", "less_when_fast", drag_area_m2=0.8).physics
    told = -share * 0.5 * 1.225 * 0.8 * speed**2 / CAR.mass_kg
    assert moving(p, speed=speed)[2] == pytest.approx(told, rel=1e-9)


def test_a_tyre_resists_by_its_coefficient_and_more_under_torque():
    p = with_form("rolling_resistance", "more_under_torque", coefficient=0.012).physics
    for slip in (0.0, 0.006, 0.02):
        free, held = moving(nominal(CAR, Road()).physics, slip), moving(p, slip)
        force = free[2] * CAR.mass_kg / 4.0
        loads = 0.012 * 0.25 * CAR.mass_kg * 9.81 * 0.29
        told = loads * (1.0 + 0.1 * min((force * 0.29 / 150.0) ** 2, 4.0))
        assert np.mean((free[1] - held[1])[W : W + 4]) * 1.2 == pytest.approx(told, rel=1e-3)
    path = roll(with_form("rolling_resistance", "more_under_torque", coefficient=0.012), 20.0, 5.0)
    slowing = 0.012 * 9.81 * CAR.mass_kg / carried(CAR)
    assert path[0, V] - path[-1, V] == pytest.approx(5.0 * slowing, rel=2e-3)


def test_slabs_have_the_grade_on_the_whole():
    path = roll(with_form("road_grade", "settled_slabs", grade=0.03), 22.0, 8.0)
    end = int(np.searchsorted(path[:, X], 9.0 * 16.0))
    pull = 9.81 * 0.03 * CAR.mass_kg / carried(CAR)
    assert 22.0**2 - path[end, V] ** 2 == pytest.approx(2.0 * pull * path[end, X], rel=5e-3)
    steepest = (9.81 * 0.03 * (1.0 + 0.35) * CAR.mass_kg / carried(CAR)) * 1e-3
    assert -np.diff(path[:, V]).min() == pytest.approx(steepest, rel=0.01)


@pytest.mark.parametrize(("part", "share"), [(0.25, 0.85), (0.75, 1.15), (0.5, 1.0)])
def test_a_drag_is_less_in_shelter(part, share):
    p = with_form("aero_drag", "sheltered_stretches", drag_area_m2=0.8).physics
    told = -share * 0.5 * 1.225 * 0.8 * 20.0**2 / CAR.mass_kg
    assert slopes(p, place=part * BARRIER_M)[1] == pytest.approx(told, rel=1e-3)
    places = np.linspace(0.0, BARRIER_M, 1000, endpoint=False)
    assert np.mean([air.sheltered(0.15, at) for at in places]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("speed", [4.0, 17.0, 30.0])
def test_a_seal_resists_more_when_slow(speed):
    p = with_form("rolling_resistance", "seals_when_slow", coefficient=0.012).physics
    share = 1.0 + 0.4 * (np.exp(-speed / 8.0) - np.exp(-17.0 / 8.0))
    lost = -np.mean(slopes(p, speed=speed)[0][W : W + 4]) * 1.2
    assert lost == pytest.approx(share * 0.012 * 0.25 * CAR.mass_kg * 9.81 * 0.29, rel=1e-6)
    assert 0.9 < share < 1.2


def test_a_load_on_one_side_presses_that_side_s_tyres():
    p = with_form("mass_offset", "on_one_side", mass_kg=300.0).physics
    assert p.mass == pytest.approx(CAR.mass_kg + 300.0)
    assert p.load_side * p.mass * 0.75 == pytest.approx(300.0 * 0.4)
    path = roll(with_form("mass_offset", "on_one_side", mass_kg=300.0), 25.0, 1.0, -3000.0)
    assert_allclose(path[500:, N], -SLIDING * DRY, rtol=1e-3)
    spins = roll(with_form("mass_offset", "on_one_side", mass_kg=300.0), 10.0, 0.5, 900.0)[-1, W : W + 4]
    assert np.all(spins[[1, 3]] > spins[[0, 2]])


def test_links_lift_in_driving_and_lower_in_braking():
    """The wheels of a car that pitches take what those of an even car of the height by hand take."""
    even, jacked = (
        with_form("load_transfer", form, cog_height_m=0.6).physics for form in ("at_once", "jacking_links")
    )
    for pitch in (-6.0, 4.0):
        by_hand = even._replace(cog_height=0.6 * (1.0 + 0.12 * np.tanh(pitch / 3.0)))
        slopes = np.zeros((3, N))
        for p, dy in zip((jacked, by_hand, even), slopes, strict=True):
            y = kernel.begin(p, 0.0, 20.0, np.full(4, 90.0), 0.0, NO_COMMAND)
            y[kernel.PITCH] = pitch
            kernel.slope(p, y, 0.0, NO_COMMAND, dy)
        assert_allclose(slopes[0, W : W + 4], slopes[1, W : W + 4], rtol=1e-12)
        assert np.all(np.abs(slopes[0] - slopes[2])[W : W + 4] > 1.0)


@pytest.mark.parametrize("pushed", [-6.0, 0.0, 2.0])
def test_a_drag_is_more_of_a_car_that_squats(pushed):
    p = with_form("aero_drag", "nodding", drag_area_m2=0.8).physics
    share = 1.0 + 0.1 * np.tanh(pushed / NOD_M_S2)
    told = -share * 0.5 * 1.225 * 0.8 * 20.0**2 / CAR.mass_kg
    assert slopes(p, PITCH=pushed)[0][V] == pytest.approx(told, rel=1e-9)


def test_a_flat_spot_resists_once_a_turn():
    p = with_form("rolling_resistance", "flat_spots", coefficient=0.012).physics
    told = 0.012 * 0.25 * CAR.mass_kg * 9.81 * 0.29
    angles = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    lost = np.array([-np.mean(slopes(p, ANGLE=angle)[0][W : W + 4]) for angle in angles]) * 1.2
    assert lost.mean() == pytest.approx(told, rel=1e-6)
    front = np.array([-slopes(p, ANGLE=angle)[0][W] for angle in (0.0, np.pi)]) * 1.2
    assert front[0] / front[1] == pytest.approx(1.3 / 0.7, rel=1e-6)


@pytest.mark.parametrize(("pitch", "off"), [(0.0, 1.0), (4.0, 1.0), (-4.0, -2.0), (9.0, 0.5)])
def test_springs_come_to_their_stops(pitch, off):
    p = with_form("load_transfer", "springs_with_stops", cog_height_m=0.6).physics
    dy = np.zeros(N)
    y = np.zeros(N)
    y[PITCH] = pitch
    kernel.lean(p, y, pitch + off, dy)
    sooner = 1.0 + 0.8 * np.tanh((pitch / STOPS_M_S2) ** 2)
    assert dy[PITCH] == pytest.approx(off * sooner / 0.06)
