"""The ninth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, with_form
from test_blind_plant import CAR, LimitDrive, carried, roll

from benchmarks.gap.withheld.generator import air, details, kernel
from benchmarks.gap.withheld.generator.air import BARRIER_M
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import BENDS_M, WARM_S
from benchmarks.gap.withheld.generator.forms import Family, is_further
from benchmarks.gap.withheld.generator.kernel import ANGLE, LAG, SLIP, TWIST, N, V, W, X
from benchmarks.gap.withheld.generator.physics import Physics
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

NO_COMMAND = np.zeros((2, 4))
DRY, WET = 0.9, 0.5
LOCKED = 0.79 * 9.81
"""Deceleration with locked wheels over the friction [m/s^2]."""


def moving(
    p: Physics, slip: float = 0.0, speed: float = 20.0, time: float = 0.0, place: float = 0.0, **state: float
) -> tuple[np.ndarray, float]:
    """Derivative of a car whose wheels all slip alike, and what an accelerometer reads [m/s^2].

    `state` is what else is set, by the kernel's names: of the body, and else of all wheels.
    """
    y = kernel.begin(p, 0.0, speed, np.full(4, speed / p.radius), time, NO_COMMAND)
    y[X] = place
    y[W : W + 4] = speed / p.radius / (1.0 - slip)
    for name, value in state.items():
        first = getattr(kernel, name)
        y[first : first + (1 if name == "PITCH" else 4)] = value
    dy = np.zeros(N)
    return dy, kernel.slope(p, y, time, NO_COMMAND, dy)


def test_what_the_eighth_family_lacks():
    assert is_further({"torque_lag": "less_when_warm"}, "torque_lag", Family.EIGHTH)
    assert not is_further({"torque_lag": "gentle_about_zero"}, "torque_lag", Family.EIGHTH)


def test_what_the_family_adds_to_the_physics_is_none_of_the_nominal_car():
    """All that is neutral at nothing, set by hand, is the nominal car bit for bit."""
    limit = LimitDrive()
    names = ("height_jack", "load_side", "radius_wet", "inertia_speed", "grip_sign", "grip_slide", "lag_warm")
    more = ("relaxation_rise", "drag_shelter", "bend_drag", "roll_slow", "brake_wet", "delay_speed")
    rest = ("gain_turn", "torque_step", "shaft_turn")
    assert all(getattr(limit.world.physics, name) == 0.0 for name in (*names, *more, *rest))
    scaled = ("height_jack", "lag_warm", "relaxation_rise", "drag_shelter", "roll_slow", "brake_wet")
    of_none = limit.world.moved(**dict.fromkeys((*scaled, "grip_sign", "grip_slide", "gain_turn"), 0.3))
    assert limit.is_nominal(of_none)


# --- effects


@pytest.mark.parametrize(("part", "share"), [(0.25, 0.85), (0.75, 1.15), (0.5, 1.0)])
def test_a_drag_is_less_in_shelter(part, share):
    p = with_form("aero_drag", "sheltered_stretches", drag_area_m2=0.8).physics
    told = -share * 0.5 * 1.225 * 0.8 * 20.0**2 / CAR.mass_kg
    assert moving(p, place=part * BARRIER_M)[1] == pytest.approx(told, rel=1e-3)
    places = np.linspace(0.0, BARRIER_M, 1000, endpoint=False)
    assert np.mean([air.sheltered(0.15, at) for at in places]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("speed", [4.0, 17.0, 30.0])
def test_a_seal_resists_more_when_slow(speed):
    p = with_form("rolling_resistance", "seals_when_slow", coefficient=0.012).physics
    share = 1.0 + 0.4 * (np.exp(-speed / 8.0) - np.exp(-17.0 / 8.0))
    lost = -np.mean(moving(p, speed=speed)[0][W : W + 4]) * 1.2
    assert lost == pytest.approx(share * 0.012 * 0.25 * CAR.mass_kg * 9.81 * 0.29, rel=1e-6)
    assert 0.9 < share < 1.2


def test_a_load_on_one_side_presses_that_side_s_tyres():
    p = with_form("mass_offset", "on_one_side", mass_kg=300.0).physics
    assert p.mass == pytest.approx(CAR.mass_kg + 300.0)
    assert p.load_side * p.mass * 0.75 == pytest.approx(300.0 * 0.4)
    path = roll(with_form("mass_offset", "on_one_side", mass_kg=300.0), 25.0, 1.0, -3000.0)
    assert_allclose(path[500:, N], -LOCKED * DRY, rtol=1e-3)
    spins = roll(with_form("mass_offset", "on_one_side", mass_kg=300.0), 10.0, 0.5, 900.0)[-1, W : W + 4]
    assert np.all(spins[[1, 3]] > spins[[0, 2]])


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
    assert_allclose(brakes[500:, N], -LOCKED * DRY * (1.0 - 0.3 * 1.15), rtol=1e-3)
    p = with_form("friction_offset", "more_in_braking", factor=0.7).physics
    told = [details.friction(p, 1, 5.0, 20.0, 0.0, details.gripping(p, rub)) for rub in (5.0, 0.0, -5.0)]
    assert_allclose(told, DRY * (1.0 - 0.3 * np.array([0.85, 1.0, 1.15])), rtol=1e-9)


def test_a_sliding_wheel_sweeps_the_slippery_side():
    given = {"left_factor": 0.6, "right_factor": 1.0}
    path = roll(with_form("mu_split", "swept_away", **given), 28.0, 1.0, -3000.0)
    told = 0.5 + 0.5 * (1.0 - 0.4 * 0.875)
    assert_allclose(path[500:, N], -LOCKED * DRY * told, rtol=2e-3)
    p = with_form("mu_split", "swept_away", **given).physics
    grips = [1.0 + details.gripping(p, rub) for rub in (0.0, 2.0 * np.arctanh(0.5), 30.0, -30.0)]
    assert_allclose(grips, [1.125, 1.0, 0.875, 0.875], rtol=1e-9)


@pytest.mark.parametrize(("time", "share"), [(0.0, 1.2), (WARM_S * np.log(2.0), 1.0), (150.0, 0.8)])
def test_a_lag_is_told_half_warm(time, share):
    p = with_form("torque_lag", "less_when_warm", time_constant_s=0.1).physics
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 70.0), time, NO_COMMAND)
    y[LAG : LAG + 4] = 30.0
    dy = np.zeros(N)
    kernel.slope(p, y, time, NO_COMMAND, dy)
    assert_allclose(dy[LAG : LAG + 4], -30.0 / (0.1 * share), rtol=1e-4)


@pytest.mark.parametrize(("turning", "delay"), [(65.0, 0.1), (130.0, 0.09), (32.5, 0.12), (1.0, 0.12)])
def test_a_delay_goes_in_part_with_the_motor_s_turn(turning, delay):
    p = with_form("torque_delay", "older_when_slow", delay_s=0.1).physics
    ramp = np.arange(1001.0)[:, None] * np.ones(4)
    assert 0.01 * kernel.motor_torque(p, ramp, 2, 5.0, 0.0, turning) == pytest.approx(5.0 - delay)


def test_a_gain_has_its_mean_over_a_turn():
    p = with_form("torque_gain", "over_a_turn", factor=0.8).physics
    angles = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    command = np.full((5, 4), -100.0)
    gains = np.array([kernel.motor_torque(p, command, 1, 0.02, a, 30.0) for a in angles]) / -100.0
    assert_allclose([gains.mean(), gains.min(), gains.max()], [0.8, 0.76, 0.84], atol=1e-5)


def test_a_wet_disc_drags_less():
    for road, told in ((DRY, 12.0), (WET, 9.0)):
        p = with_form("brake_drag", "less_when_wet", road=Road((0.0,), (road,)), torque_nm=12.0).physics
        assert_allclose(moving(p)[0][W : W + 4] * 1.2, -told, rtol=1e-9)


def test_a_bent_shaft_has_its_stiffness_over_a_turn():
    given = {"stiffness_nm_rad": 5000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.5}
    p = with_form("driveline_compliance", "bent_joints", **given).physics
    angles = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    torques = np.array([details.shaft_of(p, 1, 0.03, 0.0, a) for a in angles])
    assert_allclose([torques.mean(), torques.min(), torques.max()], [150.0, 127.5, 172.5], rtol=1e-4)
    assert details.shaft_of(p, 1, 0.0, 2.0, 0.7) == pytest.approx(8.0)
    y = kernel.begin(p, 0.0, 20.0, np.full(4, 69.0), 0.0, NO_COMMAND)
    y[TWIST], y[ANGLE], dy = 0.03, 0.5 * np.pi, np.zeros(N)
    kernel.slope(p, y, 0.0, NO_COMMAND, dy)
    assert dy[kernel.MOTOR] * 0.5 == pytest.approx(-127.5)


@pytest.mark.parametrize("direction", [-100.0, 100.0])
def test_a_bent_shaft_is_stiff_in_the_end(direction):
    """Motor and wheel of a stiff shaft turn as one wheel."""
    given = {"stiffness_nm_rad": 3e5, "damping_nm_s_rad": 150.0, "motor_inertia_kg_m2": 0.6}
    command = np.full((101, 4), direction)
    stiff = driven(with_form("driveline_compliance", "bent_joints", **given), command)
    assert_allclose(stiff[-1, V], driven(nominal(CAR, Road()), command)[-1, V], rtol=2e-4)


# --- deviations outside the library


def test_a_torque_is_told_in_whole_steps():
    """What is below a step is dropped, in driving and in braking."""
    p = by_further("torque_in_steps", step_nm=40.0).physics
    for told, given in ((120.1, 120.0), (119.0, 80.0), (39.0, 0.0), (-79.0, -40.0)):
        assert kernel.motor_torque(p, np.full((5, 4), told), 3, 0.01, 0.0, 30.0) == pytest.approx(given)


def test_bends_slow_the_car_by_their_drag():
    p = by_further("cornering_drag", force_n=300.0).physics
    for part, share in ((0.25, 1.0), (0.5, 0.5), (0.75, 0.0)):
        for speed in (10.0, 20.0):
            told = -share * 300.0 * (speed / 20.0) ** 2 / CAR.mass_kg
            reads = moving(p, speed=speed, place=part * BENDS_M)[1]
            assert reads == pytest.approx(told, rel=1e-3, abs=1e-4)
    path = roll(by_further("cornering_drag", force_n=300.0), 20.0, 5.0)
    bends = [details.winding(at) for at in path[:, X]]
    lost = 300.0 * np.trapezoid(bends * (path[:, V] / 20.0) ** 2, path[:, X])
    assert 0.5 * carried(CAR) * (20.0**2 - path[-1, V] ** 2) == pytest.approx(lost, rel=2e-3)
