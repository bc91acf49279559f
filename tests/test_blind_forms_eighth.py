"""The eighth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, with_form
from test_blind_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import HUNT_S, LASH_NM, QUEUE_S
from benchmarks.gap.withheld.generator.falling import EXPONENTIAL, fallen
from benchmarks.gap.withheld.generator.forms import OUTSIDES, Family, is_further
from benchmarks.gap.withheld.generator.forms_eighth import CIRCUIT, SETTLED, SLAB_M
from benchmarks.gap.withheld.generator.kernel import LAG, N, V, W, X
from benchmarks.gap.withheld.generator.physics import Physics
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

NO_COMMAND = np.zeros((2, 4))
DRY, WET = 0.9, 0.5


def moving(p: Physics, slip: float = 0.0, speed: float = 20.0) -> tuple[np.ndarray, np.ndarray, float]:
    """State of a car whose wheels all slip alike, its derivative, and what an accelerometer reads [m/s^2]."""
    y = kernel.begin(p, 0.0, speed, np.full(4, speed / p.radius), 0.0, NO_COMMAND)
    y[W : W + 4] = speed / p.radius / (1.0 - slip)
    dy = np.zeros(N)
    return y, dy, kernel.slope(p, y, 0.0, NO_COMMAND, dy)


def test_what_the_seventh_family_lacks():
    assert is_further({"friction_falloff": "sooner_when_wet"}, "friction_falloff", Family.SEVENTH)
    assert not is_further({"friction_falloff": "rooted"}, "friction_falloff", Family.SEVENTH)


# --- effects


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
    end = int(np.searchsorted(path[:, X], 9.0 * SLAB_M))
    pull = 9.81 * 0.03 * CAR.mass_kg / carried(CAR)
    assert 22.0**2 - path[end, V] ** 2 == pytest.approx(2.0 * pull * path[end, X], rel=5e-3)
    steepest = (9.81 * 0.03 * (1.0 + SETTLED) * CAR.mass_kg / carried(CAR)) * 1e-3
    assert -np.diff(path[:, V]).min() == pytest.approx(steepest, rel=0.01)


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


def test_a_lag_about_no_torque_keeps_what_a_step_lacks():
    """A step to the usual torque lacks as much as one of an even lag does."""
    p = with_form("torque_lag", "gentle_about_zero", road=Road((0.0,), (1e-9,)), time_constant_s=0.1).physics
    command = np.full((200, 4), 150.0)
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 60.0), 0.0, command)
    y[LAG : LAG + 4] = 0.0
    kernel.integrate(p, y, 0, 1500, 3, command, np.zeros((1501, N + 1)))
    lacks = 1.5 - (y[W : W + 4] - 60.0) * 1.2 / 150.0
    assert_allclose(lacks, 0.1, rtol=2e-3)
    shares = [details.lag_of(p, 0, 50.0, 150.0, given) for given in (0.0, LASH_NM, 150.0)]
    base = shares[2]
    assert_allclose(shares, [base + 0.5, base + 0.5 / np.e, base], rtol=1e-9)
    assert 0.85 < base < 1.0


def test_a_queue_for_torque_has_the_delay_on_the_whole():
    p = with_form("torque_delay", "queue", delay_s=0.1).physics
    ramp = np.arange(1001.0)[:, None] * np.ones(4)
    clock = np.arange(1.0, 1.0 + 2.0 * QUEUE_S, 1e-3)
    heard = np.array([0.01 * kernel.motor_torque(p, ramp, 2, t, 0.0, 30.0) for t in clock])
    ages = clock - heard
    assert ages.mean() == pytest.approx(0.1, rel=5e-3)
    assert_allclose([ages.min(), ages.max()], [0.085, 0.115], rtol=1e-6)
    assert np.diff(heard).min() > -1e-9


def test_a_hunting_gain_has_its_mean():
    p = with_form("torque_gain", "hunting", factor=0.8).physics
    clock = np.linspace(0.0, HUNT_S, 400, endpoint=False)
    command = np.full((900, 4), -100.0)
    gains = np.array([kernel.motor_torque(p, command, 1, t, 0.0, 30.0) for t in clock]) / -100.0
    assert_allclose([gains.mean(), gains.min(), gains.max()], [0.8, 1.0 - 0.23, 1.0 - 0.17], rtol=1e-6)


def test_one_circuit_drags_from_corner_to_corner():
    drags = [with_form("brake_drag", f, torque_nm=10.0).physics for f in ("one_circuit", "even")]
    lost = [moving(p)[1][W : W + 4] for p in drags]
    assert_allclose(lost[0] / lost[1], CIRCUIT, rtol=1e-9)
    assert CIRCUIT.mean() == pytest.approx(1.0)
    assert CIRCUIT[0] == CIRCUIT[3] != CIRCUIT[1] == CIRCUIT[2]


def test_a_driveline_has_its_stiffness_on_the_mean_of_both_directions():
    given = {"stiffness_nm_rad": 5000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.5}
    p = with_form("driveline_compliance", "softer_in_braking", **given).physics
    drives, brakes = details.shaft_of(p, 1, 0.03, 0.0), details.shaft_of(p, 1, -0.03, 0.0)
    assert_allclose([drives, brakes], [150.0 * 1.15, -150.0 * 0.85], rtol=1e-5)
    assert details.shaft_of(p, 1, 0.0, 2.0) == pytest.approx(8.0)
    twists = np.linspace(-0.05, 0.05, 400)
    assert np.all(np.diff([details.shaft_of(p, 1, t, 0.0) for t in twists]) > 0.0)


@pytest.mark.parametrize("direction", [-100.0, 100.0])
def test_a_driveline_is_stiff_in_the_end(direction):
    """Motor and wheel of a stiff shaft turn as one wheel."""
    given = {"stiffness_nm_rad": 3e5, "damping_nm_s_rad": 150.0, "motor_inertia_kg_m2": 0.6}
    command = np.full((101, 4), direction)
    stiff = driven(with_form("driveline_compliance", "softer_in_braking", **given), command)
    assert_allclose(stiff[-1, V], driven(nominal(CAR, Road()), command)[-1, V], rtol=2e-4)


# --- deviations outside the library


def test_a_side_gives_more_than_told_and_the_other_less():
    p = by_further("torque_vectored", left_more=0.2).physics
    command = np.full((5, 4), 100.0)
    given = [kernel.motor_torque(p, command, w, 0.01, 0.0, 30.0) for w in range(4)]
    assert_allclose(given, [120.0, 80.0, 120.0, 80.0])


def test_a_blurred_border_goes_straight_from_one_road_to_the_next():
    world = OUTSIDES[Family.EIGHTH]["road_borders_blurred"].apply(
        nominal(CAR, Road((0.0, 50.0, 100.0), (DRY, WET, DRY))), {"over_m": 20.0}
    )
    p = world.physics
    places = np.array([20.0, 40.0, 45.0, 49.999, 50.0, 55.0, 60.0, 75.0, 95.0, 105.0, 150.0])
    told = [details.friction(p, 0, at - p.front_arm, 20.0) for at in places]
    assert_allclose(told, [0.9, 0.9, 0.8, 0.7, 0.7, 0.6, 0.5, 0.5, 0.6, 0.8, 0.9], atol=1e-4)
    assert_allclose(details.friction(p, 3, 45.0 + p.rear_arm, 20.0), 0.8)


def test_locked_wheels_feel_a_blurred_border_over_its_length():
    road = Road((0.0, 30.0), (DRY, WET))
    blurs = OUTSIDES[Family.EIGHTH]["road_borders_blurred"].apply(nominal(CAR, road), {"over_m": 16.0})
    path = roll(blurs, 30.0, 2.5, -3000.0)[300:]
    axles = [path[:, X] + CAR.wheelbase_m - CAR.cog_to_rear_axle_m, path[:, X] - CAR.cog_to_rear_axle_m]
    share = [np.interp(at, [22.0, 38.0], [DRY, WET]) for at in axles]
    front = CAR.cog_to_rear_axle_m / CAR.wheelbase_m
    told = -0.79 * 9.81 * (front * share[0] + (1.0 - front) * share[1])
    assert_allclose(path[:, N], told, rtol=2e-3)
    assert path[-1, X] > 45.0
    assert path[0, X] < 15.0
