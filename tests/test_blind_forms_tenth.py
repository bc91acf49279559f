"""The tenth family's forms and deviations, each held to its effect's known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blind_forms import by_further, driven, with_form
from test_blind_forms_ninth import DRY, LOCKED, moving
from test_blind_plant import CAR, LimitDrive, roll

from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.air import NOD_M_S2
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import STOPS_M_S2, TEXTURE_M, WARM_S
from benchmarks.gap.withheld.generator.falling import LINE_AND_TAIL, fallen
from benchmarks.gap.withheld.generator.forms import Family, is_further
from benchmarks.gap.withheld.generator.kernel import LAG, PITCH, SLIP, STAGE, N, V, W
from benchmarks.gap.withheld.generator.motors import NOTCH_RAD_S
from benchmarks.gap.withheld.generator.world import nominal

HALF_WARM_S = WARM_S * np.log(2.0)


def test_what_the_ninth_family_lacks():
    assert is_further({"torque_lag": "slow_tail"}, "torque_lag", Family.NINTH)
    assert not is_further({"torque_lag": "less_when_warm"}, "torque_lag", Family.NINTH)


def test_what_the_family_adds_to_the_physics_is_none_of_the_nominal_car():
    """All that is neutral at nothing, set by hand, is the nominal car bit for bit."""
    limit = LimitDrive()
    scaled = ("drag_nod", "roll_flat", "relaxation_side", "grip_load", "gain_power", "brake_texture")
    absolute = ("pitch_stops", "stiffness_sides", "grip_axles", "delay_warm", "lag_tail", "notch")
    assert all(getattr(limit.world.physics, name) == 0.0 for name in (*scaled, *absolute, "shaft_warm"))
    of_none = limit.world.moved(**dict.fromkeys((*scaled, "shaft_warm"), 0.3))
    assert limit.is_nominal(of_none)


# --- effects


@pytest.mark.parametrize("pushed", [-6.0, 0.0, 2.0])
def test_a_drag_is_more_of_a_car_that_squats(pushed):
    p = with_form("aero_drag", "nodding", drag_area_m2=0.8).physics
    share = 1.0 + 0.1 * np.tanh(pushed / NOD_M_S2)
    told = -share * 0.5 * 1.225 * 0.8 * 20.0**2 / CAR.mass_kg
    assert moving(p, PITCH=pushed)[0][V] == pytest.approx(told, rel=1e-9)


def test_a_flat_spot_resists_once_a_turn():
    p = with_form("rolling_resistance", "flat_spots", coefficient=0.012).physics
    told = 0.012 * 0.25 * CAR.mass_kg * 9.81 * 0.29
    angles = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    lost = np.array([-np.mean(moving(p, ANGLE=angle)[0][W : W + 4]) for angle in angles]) * 1.2
    assert lost.mean() == pytest.approx(told, rel=1e-6)
    front = np.array([-moving(p, ANGLE=angle)[0][W] for angle in (0.0, np.pi)]) * 1.2
    assert front[0] / front[1] == pytest.approx(1.3 / 0.7, rel=1e-6)


def test_one_tyre_has_not_been_changed():
    path = roll(with_form("wheel_radius_offset", "one_other", radius_m=0.30), 20.0, 1.0)[-1]
    radii = path[V] / path[W : W + 4]
    assert_allclose(radii, [0.3025, 0.3025, 0.3025, 0.2925], rtol=1e-5)
    assert radii.mean() == pytest.approx(0.30, rel=1e-5)


@pytest.mark.parametrize(("pitch", "off"), [(0.0, 1.0), (4.0, 1.0), (-4.0, -2.0), (9.0, 0.5)])
def test_springs_come_to_their_stops(pitch, off):
    p = with_form("load_transfer", "springs_with_stops", cog_height_m=0.6).physics
    dy = np.zeros(N)
    y = np.zeros(N)
    y[PITCH] = pitch
    kernel.lean(p, y, pitch + off, dy)
    sooner = 1.0 + 0.8 * np.tanh((pitch / STOPS_M_S2) ** 2)
    assert dy[PITCH] == pytest.approx(off * sooner / 0.06)


def test_each_tyre_relaxes_over_a_length_of_its_own():
    p = with_form("tyre_relaxation", "each_its_own", length_m=0.5).physics
    lengths = -0.01 * 20.0 / moving(p, SLIP=0.01)[0][SLIP : SLIP + 4]
    assert_allclose(lengths, [0.6, 0.4, 0.4, 0.6], rtol=1e-9)
    assert lengths.mean() == pytest.approx(0.5)


@pytest.mark.parametrize("stiffness", [30_000.0, 70_000.0])
def test_tyres_of_one_side_are_more_worn(stiffness):
    p = with_form("tyre_stiffness_offset", "unlike_sides", stiffness_n=stiffness).physics
    at, still = moving(p, slip=1e-4)[0], moving(p)[0]
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
    assert_allclose(brakes[500:, N], -LOCKED * DRY * 0.7, rtol=2e-3)


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


def test_a_part_of_the_torque_comes_slowly():
    """Three quarters with two thirds of the lag and the rest with twice of it: a ramp is late by the lag."""
    p = with_form("torque_lag", "slow_tail", time_constant_s=0.1).physics
    dy = moving(p, LAG=30.0, STAGE=20.0)[0]
    assert_allclose(dy[LAG : LAG + 4], -30.0 / (0.1 * 2.0 / 3.0))
    assert_allclose(dy[STAGE : STAGE + 4], -20.0 / 0.2)
    given = dy[W : W + 4] - moving(p)[0][W : W + 4]
    assert_allclose(given * 1.2, 0.75 * 30.0 + 0.25 * 20.0)
    ramp = np.maximum(np.arange(301) - 100.0, 0.0)[:, None] * np.ones(4)
    later = np.vstack([np.zeros((10, 4)), ramp[:-10]])
    late = driven(with_form("torque_lag", "slow_tail", time_constant_s=0.1), ramp)
    # Of the ramp's mean what both lags have not yet made up is the mean of their squares over two.
    missed = 0.75 * (0.1 * 2.0 / 3.0) ** 2 + 0.25 * 0.2**2 - 0.5 * 0.1**2
    expected = driven(nominal(CAR, Road()), later)[-1, V] - 10.0
    gained = late[-1, V] - 10.0
    assert gained == pytest.approx(expected * (1.0 + 2.0 * missed / 1.9**2), rel=2e-3)


@pytest.mark.parametrize(("time", "delay"), [(0.0, 0.085), (HALF_WARM_S, 0.1), (150.0, 0.115)])
def test_a_delay_grows(time, delay):
    p = with_form("torque_delay", "ever_later", delay_s=0.1).physics
    ramp = np.arange(20_001.0)[:, None] * np.ones(4)
    told = 0.01 * kernel.motor_torque(p, ramp, 2, time + 1.0, 0.0, 60.0)
    warm = details.warmth(time + 1.0) - details.warmth(time)
    assert told == pytest.approx(time + 1.0 - delay - 0.015 * warm, abs=1e-5)


@pytest.mark.parametrize(
    ("torque", "turning", "share"), [(150.0, 65.0, 1.0), (-75.0, 65.0, 0.925), (300.0, 90.0, 1.15)]
)
def test_a_gain_goes_with_the_power(torque, turning, share):
    p = with_form("torque_gain", "with_power", factor=0.8).physics
    given = kernel.motor_torque(p, np.full((5, 4), torque), 1, 0.02, 0.0, turning)
    assert given / torque == pytest.approx(1.0 - 0.2 * share)


@pytest.mark.parametrize(("part", "share"), [(0.25, 0.75), (0.75, 1.25)])
def test_pads_are_shaken_free(part, share):
    p = with_form("brake_drag", "shaken_free", torque_nm=12.0).physics
    at = part * TEXTURE_M
    told = [
        details.braking(p, w, at - (p.front_arm if w < 2 else -p.rear_arm), 0.3, 60.0, 1.0) for w in range(4)
    ]
    assert_allclose(told, 12.0 * share, rtol=1e-3)
    places = np.linspace(0.0, TEXTURE_M, 1000, endpoint=False)
    drags = [details.braking(p, 0, place, 0.3, 60.0, 1.0) for place in places]
    assert np.mean(drags) == pytest.approx(12.0, rel=1e-6)


@pytest.mark.parametrize(("time", "share"), [(0.0, 1.12), (HALF_WARM_S, 1.0), (150.0, 0.88)])
def test_a_shaft_with_rubber_softens(time, share):
    given = {"stiffness_nm_rad": 5000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.5}
    p = with_form("driveline_compliance", "warming_rubber", **given).physics
    assert details.shaft_of(p, 1, 0.03, 0.0, 0.0, time) == pytest.approx(150.0 * share, rel=1e-4)
    assert details.shaft_of(p, 1, 0.0, 2.0, 0.0, time) == pytest.approx(8.0)
    assert moving(p, time=time, TWIST=0.03)[0][kernel.MOTOR] * 0.5 == pytest.approx(-150.0 * share, rel=1e-4)


@pytest.mark.parametrize("direction", [-100.0, 100.0])
def test_a_shaft_with_rubber_is_stiff_in_the_end(direction):
    """Motor and wheel of a stiff shaft turn as one wheel."""
    given = {"stiffness_nm_rad": 3e5, "damping_nm_s_rad": 150.0, "motor_inertia_kg_m2": 0.6}
    command = np.full((101, 4), direction)
    stiff = driven(with_form("driveline_compliance", "warming_rubber", **given), command)
    assert_allclose(stiff[-1, V], driven(nominal(CAR, Road()), command)[-1, V], rtol=2e-4)


# --- deviations outside the library


def test_a_motor_gives_less_in_a_band_of_speeds():
    p = by_further("torque_notch", at_rad_s=60.0, share=0.4).physics
    speeds = np.array([60.0, 60.0 - NOTCH_RAD_S, 60.0 + NOTCH_RAD_S, 20.0, 100.0])
    for torque in (120.0, -120.0):
        given = [kernel.motor_torque(p, np.full((5, 4), torque), 3, 0.01, 0.0, speed) for speed in speeds]
        shares = np.array([0.4, 0.4 / np.e, 0.4 / np.e, 0.0, 0.0])
        assert_allclose(given, torque * (1.0 - shares), rtol=1e-9)


@pytest.mark.parametrize("more", [0.2, -0.1])
def test_one_axle_grips_more(more):
    world = by_further("unlike_grip_by_axle", front_more=more)
    told = [details.friction(world.physics, wheel, 5.0, 20.0) for wheel in range(4)]
    assert_allclose(told, DRY * (1.0 + more * np.array([1.0, 1.0, -1.0, -1.0])))
    p = world.physics
    tilt = (p.rear_arm - p.front_arm) / (p.front_arm + p.rear_arm)
    path = roll(world, 25.0, 1.0, -3000.0)
    assert_allclose(path[500:, N], -LOCKED * DRY * (1.0 + more * tilt), rtol=1e-3)
