"""Forms of the effects on motors, brakes and shafts, each held to its known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    AIRBORNE,
    DRY,
    HALF_WARM_S,
    NO_COMMAND,
    WET,
    driven,
    forms_of,
    moving,
    numbered,
    slopes,
    with_form,
)
from withheld_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    HUNT_S,
    LASH_NM,
    QUEUE_S,
    TEXTURE_M,
    USUAL_NM,
    USUAL_RAD_S,
    WARM_S,
)
from benchmarks.gap.withheld.generator.kernel import ANGLE, LAG, MOTOR, STAGE, TWIST, N, V, W
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long

CIRCUIT = np.array([1.6, 0.4, 0.4, 1.6])

UNDAMPED = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.6}
SHAFT = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 4.0, "motor_inertia_kg_m2": 0.6}
SHAFT_UNDAMPED = {"stiffness_nm_rad": 9000.0, "damping_nm_s_rad": 0.0, "motor_inertia_kg_m2": 0.6}


def _lags(form: str) -> np.ndarray:
    """Of the four motors, by the area between a step and what follows it [s]."""
    command = np.zeros((201, 4))
    command[101:] = 100.0
    path = driven(with_form("torque_lag", form, time_constant_s=0.1), command)
    told = np.interp(np.arange(len(path)) * 1e-3, np.arange(201) * 1e-2, command[:, 0])
    return np.sum(told[:, None] - path[:, LAG : LAG + 4], axis=0) * 1e-3 / 100.0


def _told(form: str, times: np.ndarray, delay: float, wheel: int) -> np.ndarray:
    """Ages of a short_ramp that the motors are told."""
    p = with_form("torque_delay", form, delay_s=delay).physics
    short_ramp = np.arange(401)[:, None] * np.ones(4)
    told = np.array([kernel.motor_torque(p, short_ramp, wheel, t, 0.0, 30.0) for t in times])
    return times - 0.01 * told


@pytest.fixture(scope="module")
def short_ramp():
    """Path of a car that speeds up evenly."""
    return roll(nominal(CAR, Road()), 10.0, 10.0, 100.0)


def _lags_of_steps(form: str, step: float = 100.0, **given: float) -> np.ndarray:
    """Of the four motors, by the area between a step and what follows it, up and then down [s]."""
    command = np.zeros((401, 4))
    command[101:251] = step
    path = driven(with_form("torque_lag", form, **(given or {"time_constant_s": 0.1})), command)
    told = np.interp(np.arange(len(path)) * 1e-3, np.arange(401) * 1e-2, command[:, 0])
    off = told[:, None] - path[:, LAG : LAG + 4]
    return np.array([np.sum(off[:2000], axis=0), -np.sum(off[2400:], axis=0)]) * 1e-3 / step


@pytest.mark.parametrize("chosen", forms_of("torque_lag", by=4))
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


@pytest.mark.parametrize("chosen", forms_of("brake_drag", by=4))
def test_drag_at_the_wheels_slows_by_its_mean(chosen):
    path = roll(with_form(*chosen, torque_nm=15.0), 20.0, 5.0)
    lost = 5.0 * 4.0 * 15.0 / 0.29 / carried(CAR)
    assert 20.0 - path[-1, V] == pytest.approx(lost, rel=5e-3)


def test_a_controlled_current_swings_over_by_its_damping():
    command = np.zeros((201, 4))
    command[101:] = 100.0
    path = driven(with_form("torque_lag", "swinging", time_constant_s=0.1), command)
    damping = 0.7
    over = np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    assert path[:, LAG].max() / 100.0 - 1.0 == pytest.approx(over, abs=0.005)


@pytest.mark.parametrize("form", numbered(("shafts", "with_play", "unequal_shafts")))
def test_drivelines_ring_at_the_frequency_of_their_shafts(form):
    """Shaft between motor and the wheel's rest, on a road that bears nothing; both sides' stiffness in the mean."""
    world = with_form("driveline_compliance", form, road=Road((0.0,), (1e-9,)), **UNDAMPED)
    path = roll(world, 15.0, 0.3, 60.0)
    series = 0.6 * (CAR.wheel_inertia_kg_m2 - 0.6) / CAR.wheel_inertia_kg_m2
    squares = []
    for wheel in (0, 1):
        twist = path[1:, TWIST + wheel] - path[-150:, TWIST + wheel].mean()
        times = np.flatnonzero(np.diff(np.sign(twist)) > 0)
        squares.append((2.0 * np.pi / (1e-3 * np.mean(np.diff(times)))) ** 2)
    assert np.mean(squares) == pytest.approx(9000.0 / series, rel=0.04)


def test_nothing_passes_a_shafts_play():
    world = with_form("driveline_compliance", "with_play", road=Road((0.0,), (1e-9,)), **UNDAMPED)
    command = np.full((101, 4), 1e-3)
    path = driven(world, command)
    play = 0.0035
    assert details.shaft_of(world.physics, 0, 0.99 * play, 5.0) == 0.0
    assert details.shaft_of(world.physics, 0, play + 0.01, 0.0) == pytest.approx(90.0)
    assert details.shaft_of(world.physics, 0, -play - 0.01, 0.0) == pytest.approx(-90.0)
    assert path[-1, MOTOR] > path[-1, W] >= path[0, W] - 1e-9


def test_motors_follow_by_their_axles_and_by_their_speeds_lag():
    assert_allclose(_lags("unlike_axles"), [0.125, 0.125, 0.075, 0.075], rtol=0.02)
    turning = 10.3 / CAR.wheel_radius_m
    assert_allclose(_lags("slower_at_speed"), 0.1 * (1.0 + 0.2 * (turning / USUAL_RAD_S - 1.0)), rtol=0.02)


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


@pytest.mark.parametrize("form", numbered(("rubbing_joints", "unlike_axles")))
def test_rubbing_and_unlike_drivelines_ring_at_their_frequency(form):
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
    assert drop == pytest.approx(4.0 * 1.5 / 9000.0, rel=0.1)


def test_torque_is_built_up_slower_than_it_is_let_go():
    """The logarithm of the hyperbolic cosine is the integral of its tangent: less of it counts near the end."""
    part = 0.3 * details.SMALL_TORQUE_NM / 100.0 * np.log(np.cosh(100.0 / details.SMALL_TORQUE_NM))
    up, down = _lags_of_steps("let_go_sooner")
    assert_allclose(up, 0.1 * (1.0 + part), rtol=0.02)
    assert_allclose(down, 0.1 * (1.0 - part), rtol=0.02)
    assert_allclose(0.5 * (up + down), 0.1, rtol=0.01)


def test_motors_lag_by_their_own_time_and_by_their_task():
    assert_allclose(_lags_of_steps("each_its_own")[0], [0.12, 0.08, 0.08, 0.12], rtol=0.02)
    for whole in (0.1, 0.03):
        assert_allclose(_lags_of_steps("in_a_task", time_constant_s=whole), whole, atol=0.0055)
    p = with_form("torque_lag", "in_a_task", time_constant_s=0.1).physics
    short_ramp = np.arange(401)[:, None] * np.ones(4)
    ages = [t - 0.01 * kernel.motor_torque(p, short_ramp, 0, t, 0.0, 30.0) for t in np.arange(1.0, 3.0, 1e-4)]
    assert np.mean(ages) + p.lag == pytest.approx(0.1, abs=1e-4)
    assert -1e-9 < min(ages) < max(ages) < 0.0101


def test_brakes_are_later_than_motors():
    p = with_form("torque_delay", "longer_in_braking", delay_s=0.06).physics
    for sign, delay in ((1.0, 0.051), (-1.0, 0.069)):
        short_ramp = sign * (100.0 + np.arange(401))[:, None] * np.ones(4)
        told = sign * kernel.motor_torque(p, short_ramp, 2, 2.0, 0.0, 30.0) - 100.0
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
    p = with_form("driveline_compliance", "rubber_joints", **SHAFT_UNDAMPED).physics
    middling = np.arctanh(0.5) * USUAL_NM / 9000.0
    assert details.shaft_of(p, 0, middling, 0.0) == pytest.approx(9000.0 * middling)
    assert details.shaft_of(p, 0, 1e-6, 0.0) / 1e-6 == pytest.approx(9000.0 * (1.0 - 0.125), rel=1e-4)
    assert details.shaft_of(p, 0, -1.0, 0.0) == pytest.approx(-9000.0 * 1.125, rel=1e-6)


def test_a_driveline_with_rubber_rings_softer_about_rest():
    """A small step swings about nothing, where the joint is an eighth softer."""
    path = roll(
        with_form("driveline_compliance", "rubber_joints", road=AIRBORNE, **SHAFT_UNDAMPED), 15.0, 0.3, 1.0
    )
    series = 0.6 * (CAR.wheel_inertia_kg_m2 - 0.6) / CAR.wheel_inertia_kg_m2
    twist = path[1:, TWIST] - path[1:, TWIST].mean()
    times = np.flatnonzero(np.diff(np.sign(twist)) > 0)
    natural = (2.0 * np.pi / (1e-3 * np.mean(np.diff(times)))) ** 2
    assert natural == pytest.approx(0.875 * 9000.0 / series, rel=0.04)


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


def test_a_stiff_driveline_s_motor_turns_with_its_wheel():
    given = {"stiffness_nm_rad": 9e6, "damping_nm_s_rad": 200.0, "motor_inertia_kg_m2": 0.6}
    world = with_form("driveline_compliance", "read_at_motor", **given)
    assert world.sensors.wheel_at_motor
    path = roll(nominal(CAR, Road()), 10.0, 1.0)
    assert_allclose(path[:, MOTOR : MOTOR + 4], path[:, W : W + 4])


def test_a_wheel_speed_may_be_the_motors():
    given = {"stiffness_nm_rad": 4000.0, "damping_nm_s_rad": 5.0, "motor_inertia_kg_m2": 0.6}
    world = with_form("driveline_compliance", "read_at_motor", **given)
    path, at = roll(world, 15.0, 1.0, 100.0), np.arange(0.0, 0.9, 1e-3)
    told = read(path, world.sensors, at)
    assert_allclose(told[:, :4], path[:900, MOTOR : MOTOR + 4])
    assert np.abs(told[:, 0] - path[:900, W]).max() > 0.1
    assert (path[-1, MOTOR] - path[-1, W]) == pytest.approx(0.0, abs=0.05)


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
        assert_allclose(slopes(p)[0][W : W + 4] * 1.2, -told, rtol=1e-9)


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


def test_a_part_of_the_torque_comes_slowly():
    """Three quarters with two thirds of the lag and the rest with twice of it: a ramp is late by the lag."""
    p = with_form("torque_lag", "slow_tail", time_constant_s=0.1).physics
    dy = slopes(p, LAG=30.0, STAGE=20.0)[0]
    assert_allclose(dy[LAG : LAG + 4], -30.0 / (0.1 * 2.0 / 3.0))
    assert_allclose(dy[STAGE : STAGE + 4], -20.0 / 0.2)
    given = dy[W : W + 4] - slopes(p)[0][W : W + 4]
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
    assert slopes(p, time=time, TWIST=0.03)[0][kernel.MOTOR] * 0.5 == pytest.approx(-150.0 * share, rel=1e-4)


@pytest.mark.parametrize("direction", [-100.0, 100.0])
def test_a_shaft_with_rubber_is_stiff_in_the_end(direction):
    """Motor and wheel of a stiff shaft turn as one wheel."""
    given = {"stiffness_nm_rad": 3e5, "damping_nm_s_rad": 150.0, "motor_inertia_kg_m2": 0.6}
    command = np.full((101, 4), direction)
    stiff = driven(with_form("driveline_compliance", "warming_rubber", **given), command)
    assert_allclose(stiff[-1, V], driven(nominal(CAR, Road()), command)[-1, V], rtol=2e-4)
