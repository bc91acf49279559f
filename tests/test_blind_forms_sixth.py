"""The sixth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, numbered, with_form
from test_blind_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import air, details, forms_sixth, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    PROFILE_STEP_M,
    ROLL_M_S,
    STALL_S,
    USUAL_M_S,
    USUAL_NM,
    WARM_S,
)
from benchmarks.gap.withheld.generator.falling import TWO_RATES, fallen
from benchmarks.gap.withheld.generator.forms import ASPECTS, OUTSIDES, Family, is_further
from benchmarks.gap.withheld.generator.kernel import LAG, SWAY, TWIST, N, V, W
from benchmarks.gap.withheld.generator.table import Group, table
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

LOCKED = 0.79 * 0.9 * 9.81
"""Deceleration with locked wheels on a dry road [m/s^2]."""
AIRBORNE = Road((0.0,), (1e-9,))
SHAFT = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 0.0, "motor_inertia_kg_m2": 0.6}
SPLIT = {"left_factor": 0.5, "right_factor": 1.0}


def test_what_the_family_adds_is_what_the_page_says():
    fifth, sixth = ASPECTS[Family.FIFTH], ASPECTS[Family.SIXTH]
    assert set(fifth) == set(sixth)
    assert sum(len(sixth[aspect]) - len(forms) for aspect, forms in fifth.items()) == 49
    assert len(OUTSIDES[Family.SIXTH]) - len(OUTSIDES[Family.FIFTH]) == 8
    counts = [[s.group for s in table("full", f)].count(Group.PAIR) for f in (Family.FIFTH, Family.SIXTH)]
    assert counts == [29, 33]


# --- effects


def test_lift_at_the_front_leaves_the_rear():
    p = with_form("aero_drag", "front_lift", drag_area_m2=0.8).physics
    moment = 0.5 * p.drag * p.drag_height / CAR.wheelbase_m
    assert 0.25 * p.lift - moment == pytest.approx(0.0)
    assert 2.0 * (0.25 * p.lift + moment) == pytest.approx(forms_sixth.FRONT_LIFT * 0.5 * 1.225 * 0.8)


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


@pytest.mark.parametrize("form", numbered(forms_sixth.EFFECTS["road_grade"]))
def test_profiles_of_the_road_close_and_are_even_on_the_whole(form):
    profile = with_form("road_grade", form, grade=0.03).physics.profile
    assert profile.size * PROFILE_STEP_M > 300.0
    assert profile.mean() == pytest.approx(0.0, abs=1e-12)
    assert 0.25 < np.abs(profile).max() < 0.45
    steps = np.abs(np.diff(np.append(profile, profile[0])))
    assert steps[-1] <= steps[:-1].max() + 1e-12 < 0.25


def test_a_loose_load_sways_and_then_goes_along():
    world = with_form("mass_offset", "loose_load", mass_kg=300.0)
    p = world.physics
    assert p.slosh_share * p.mass == pytest.approx(forms_sixth.LOOSE * 300.0)
    path = roll(world, 10.0, 16.0, 40.0)
    whole = roll(with_form("mass_offset", "at_centre", mass_kg=300.0), 10.0, 16.0, 40.0)
    assert path[-1, N] == pytest.approx(whole[-1, N], rel=1e-3)
    assert path[-1, SWAY] == pytest.approx(-path[-1, N] / (2.0 * np.pi * forms_sixth.LOOSE_HZ) ** 2, rel=0.01)
    assert with_form("mass_offset", "loose_load", mass_kg=-100.0).physics.slosh_share == 0.0


def _slip(world, speed: float, torque: float, seconds: float = 0.6) -> np.ndarray:
    """Of each wheel in the end, over its size as the simulation has it [-]."""
    path = roll(world, speed, seconds, torque)
    rims = path[-1, W : W + 4] * CAR.wheel_radius_m
    return (rims - path[-1, V]) / np.maximum(rims, path[-1, V])


def test_tyres_stiffen_by_half_of_what_their_load_is_more():
    loaded = with_form("mass_offset", "stiffening_tyres", mass_kg=0.4 * CAR.mass_kg)
    soft = with_form("mass_offset", "at_centre", mass_kg=0.4 * CAR.mass_kg)
    ratio = _slip(soft, 15.0, 30.0).mean() / _slip(loaded, 15.0, 30.0).mean()
    assert ratio == pytest.approx(1.2, rel=0.01)


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


def test_a_soft_body_pitches_at_its_frequency():
    p = with_form("load_transfer", "soft_body", cog_height_m=0.6).physics
    y, dy = np.zeros(kernel.N), np.zeros(kernel.N)
    kernel.lean(p, y, 2.0, dy)
    assert dy[kernel.BODY] == pytest.approx((2.0 * np.pi * 1.4) ** 2 * 2.0)


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
    assert np.ptp(p.blotches) == pytest.approx(forms_sixth.REPAIRS)
    inside, outside = (details.friction(p, 0, at - p.front_arm, 20.0) for at in (50.0, 90.0))
    assert outside - inside == pytest.approx(0.9 * 0.5 * (1.0 - left))
    world = with_form(effect, "more_at_speed", **given)
    assert details.friction(world.physics, 0, 0.0, USUAL_M_S) == pytest.approx(0.9 * left)
    faster = details.friction(world.physics, 0, 0.0, 1.5 * USUAL_M_S)
    assert faster == pytest.approx(0.9 * (1.0 - (1.0 - left) * 1.125))
    path = roll(world, USUAL_M_S + 0.5, 0.2, -2000.0)
    assert_allclose(path[150:, N], -0.75 * LOCKED, rtol=5e-3)


def _lags(form: str, step: float = 100.0, **given: float) -> np.ndarray:
    """Of the four motors, by the area between a step and what follows it, up and then down [s]."""
    command = np.zeros((401, 4))
    command[101:251] = step
    path = driven(with_form("torque_lag", form, **(given or {"time_constant_s": 0.1})), command)
    told = np.interp(np.arange(len(path)) * 1e-3, np.arange(401) * 1e-2, command[:, 0])
    off = told[:, None] - path[:, LAG : LAG + 4]
    return np.array([np.sum(off[:2000], axis=0), -np.sum(off[2400:], axis=0)]) * 1e-3 / step


def test_torque_is_built_up_slower_than_it_is_let_go():
    """The logarithm of the hyperbolic cosine is the integral of its tangent: less of it counts near the end."""
    part = 0.3 * details.SMALL_TORQUE_NM / 100.0 * np.log(np.cosh(100.0 / details.SMALL_TORQUE_NM))
    up, down = _lags("let_go_sooner")
    assert_allclose(up, 0.1 * (1.0 + part), rtol=0.02)
    assert_allclose(down, 0.1 * (1.0 - part), rtol=0.02)
    assert_allclose(0.5 * (up + down), 0.1, rtol=0.01)


def test_motors_lag_by_their_own_time_and_by_their_task():
    assert_allclose(_lags("each_its_own")[0], [0.12, 0.08, 0.08, 0.12], rtol=0.02)
    for whole in (0.1, 0.03):
        assert_allclose(_lags("in_a_task", time_constant_s=whole), whole, atol=0.0055)
    p = with_form("torque_lag", "in_a_task", time_constant_s=0.1).physics
    ramp = np.arange(401)[:, None] * np.ones(4)
    ages = [t - 0.01 * kernel.motor_torque(p, ramp, 0, t, 0.0, 30.0) for t in np.arange(1.0, 3.0, 1e-4)]
    assert np.mean(ages) + p.lag == pytest.approx(0.1, abs=1e-4)
    assert -1e-9 < min(ages) < max(ages) < 0.0101


def test_brakes_are_later_than_motors():
    p = with_form("torque_delay", "longer_in_braking", delay_s=0.06).physics
    for sign, delay in ((1.0, 0.051), (-1.0, 0.069)):
        ramp = sign * (100.0 + np.arange(401))[:, None] * np.ones(4)
        told = sign * kernel.motor_torque(p, ramp, 2, 2.0, 0.0, 30.0) - 100.0
        assert 2.0 - 0.01 * told == pytest.approx(delay, abs=1e-5)


@pytest.mark.parametrize("delay", [0.01, 0.1])
def test_what_a_filter_takes_is_part_of_the_delay(delay):
    p = with_form("torque_delay", "smoothed", delay_s=delay).physics
    assert p.delay + p.lag == pytest.approx(delay)
    assert p.lag == pytest.approx(min(0.3 * delay, 0.008))


def test_gains_have_their_mean_over_the_motors_and_over_a_drive():
    gains = with_form("torque_gain", "each_its_own", factor=0.9).physics.gain
    assert gains.mean() == pytest.approx(0.9)
    assert np.ptp(gains) == pytest.approx(0.04)
    p = with_form("torque_gain", "warming", factor=0.9).physics
    command, clock = np.full((3001, 4), 100.0), np.linspace(0.0, 24.0, 200)
    told = np.array([kernel.motor_torque(p, command, 1, t, 0.0, 30.0) for t in clock]) / 100.0
    assert_allclose(told, 0.9 - 0.1 * 0.15 * (1.0 - 2.0 * np.exp(-clock / WARM_S)))
    assert told.mean() == pytest.approx(0.9, abs=1e-3)


def test_a_hand_brake_drags_at_the_rear_by_the_mean():
    path = roll(with_form("brake_drag", "hand_brake", torque_nm=30.0), 20.0, 2.0)
    assert path[-1, V] == pytest.approx(20.0 - 2.0 * 4.0 * 30.0 / 0.29 / carried(CAR), rel=1e-4)
    slips = path[-1, W : W + 4] * 0.29 / path[-1, V] - 1.0
    assert slips[2] / slips[0] == pytest.approx(1.7 / 0.3, rel=0.15)


def test_a_rubber_joint_has_the_told_stiffness_at_a_middling_torque():
    p = with_form("driveline_compliance", "rubber_joints", **SHAFT).physics
    middling = np.arctanh(0.5) * USUAL_NM / 9000.0
    assert details.shaft_of(p, 0, middling, 0.0) == pytest.approx(9000.0 * middling)
    assert details.shaft_of(p, 0, 1e-6, 0.0) / 1e-6 == pytest.approx(9000.0 * (1.0 - 0.125), rel=1e-4)
    assert details.shaft_of(p, 0, -1.0, 0.0) == pytest.approx(-9000.0 * 1.125, rel=1e-6)


def test_a_driveline_with_rubber_rings_softer_about_rest():
    """A small step swings about nothing, where the joint is an eighth softer."""
    path = roll(with_form("driveline_compliance", "rubber_joints", road=AIRBORNE, **SHAFT), 15.0, 0.3, 1.0)
    series = 0.6 * (CAR.wheel_inertia_kg_m2 - 0.6) / CAR.wheel_inertia_kg_m2
    twist = path[1:, TWIST] - path[1:, TWIST].mean()
    times = np.flatnonzero(np.diff(np.sign(twist)) > 0)
    natural = (2.0 * np.pi / (1e-3 * np.mean(np.diff(times)))) ** 2
    assert natural == pytest.approx(0.875 * 9000.0 / series, rel=0.04)


# --- deviations outside the library


def test_motors_brake_less_the_slower_they_turn():
    p = by_further("regeneration_fades", below_m_s=8.0, share=0.6).physics
    for torque, speed, share in ((-100.0, 4.0, 0.7), (-100.0, 10.0, 1.0), (100.0, 4.0, 1.0)):
        command = np.full((5, 4), torque)
        given = kernel.motor_torque(p, command, 0, 0.01, 0.0, speed / CAR.wheel_radius_m)
        assert given == pytest.approx(share * torque)


def test_motors_hold_their_torque_where_messages_stay_out():
    p = by_further("torque_dropouts", hold_s=0.3).physics
    times = np.arange(0.0, 10.0 * STALL_S, 1e-3)
    heard = np.array([details.stalled(p.stall, t) for t in times])
    held = times - heard
    assert held.max() == pytest.approx(0.3, abs=2e-3)
    assert np.mean(held > 0.0) == pytest.approx(0.3 / STALL_S, rel=0.02)
    assert np.all(np.diff(heard) > -1e-12)
    assert np.flatnonzero(np.diff(heard) > 0.2).size == 10


def test_a_head_wind_slows_by_the_drag_that_it_has_more():
    for wind in (4.0, -4.0):
        path = roll(by_further("head_wind", wind_m_s=wind, drag_area_m2=0.7), 20.0, 1.0)
        force = 0.5 * 1.225 * 0.7 * ((path[500, V] + wind) ** 2 - path[500, V] ** 2)
        assert (path[200, V] - path[800, V]) / 0.6 == pytest.approx(force / carried(CAR), rel=2e-3)


def test_the_road_changes_elsewhere_than_its_map_says():
    p = by_further("road_map_shifted", shift_m=6.0).physics._replace(
        border=np.array([0.0, 50.0]) + 6.0, mu_left=np.array([0.9, 0.3]), mu_right=np.array([0.9, 0.3])
    )
    assert_allclose(by_further("road_map_shifted", shift_m=-3.0).physics.border, [-3.0])
    grips = [details.friction(p, 0, at - p.front_arm, 20.0) for at in (2.0, 55.0, 57.0)]
    assert_allclose(grips, [0.9, 0.9, 0.3])


def test_tyres_of_two_makes_have_the_mean_of_the_told_stiffness():
    slips = _slip(by_further("unlike_tyres_by_axle", front_more=0.3), 15.0, 30.0)
    assert slips[2] / slips[0] == pytest.approx(1.3 / 0.7, rel=0.01)
    stiffness = 1.0 / slips
    plain = 1.0 / _slip(nominal(CAR, Road()), 15.0, 30.0)
    assert stiffness.mean() == pytest.approx(plain.mean(), rel=0.01)


def test_what_the_fifth_family_lacks():
    assert is_further({"driveline_compliance": "rubber_joints"}, "driveline_compliance", Family.FIFTH)
    assert not is_further({"driveline_compliance": "rubbing_joints"}, "driveline_compliance", Family.FIFTH)
    assert is_further({"driveline_compliance": "rubbing_joints"}, "driveline_compliance", Family.FOURTH)
