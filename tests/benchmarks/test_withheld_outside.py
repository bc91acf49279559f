"""Deviations outside the library, each held to its known limit by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    DRY,
    NO_COMMAND,
    SLIDING,
    by_further,
    driven,
    reading,
    slip_of,
    slopes,
)
from withheld_plant import CAR, carried, roll

from benchmarks.gap.withheld.generator import details, kernel, motors
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.details import (
    BENDS_M,
    GRAVEL_M,
    GRAVEL_SHARE,
    STALL_S,
    USUAL_M_S,
    USUAL_RAD_S,
)
from benchmarks.gap.withheld.generator.kernel import LAG, SWAY, N, V, W, X
from benchmarks.gap.withheld.generator.motors import NOTCH_RAD_S
from benchmarks.gap.withheld.generator.sensor_set import Sensors
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.signals import MISLOCK_S, PAD_DAMPING, RELOCK_S
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def short_ramp():
    """Path of a car that speeds up evenly."""
    return roll(nominal(CAR, Road()), 10.0, 10.0, 100.0)


def test_a_motors_power_is_its_limit():
    path = roll(by_further("motor_power_limit", power_w=4000.0), 20.0, 6.0, 200.0)
    gained = 0.5 * carried(CAR) * (path[-1, V] ** 2 - path[1000, V] ** 2)
    assert gained == pytest.approx(4.0 * 4000.0 * 5.0, rel=0.02)
    braking = roll(by_further("motor_power_limit", power_w=4000.0), 20.0, 2.0, -200.0)
    assert_allclose(braking[:, V], roll(nominal(CAR, Road()), 20.0, 2.0, -200.0)[:, V])


def test_a_hot_motor_gives_less():
    path = roll(by_further("motor_derating", share=0.4), 5.0, 30.0, 60.0)
    at = np.array([100, 12_000, 29_000])
    left = 1.0 - 0.4 * (1.0 - np.exp(-at * 1e-3 / motors.DERATING_S))
    assert_allclose(path[at, N] / path[100, N], left / left[0], rtol=0.01)


def test_one_brake_drags_one_wheel():
    path = roll(by_further("one_brake_drags", wheel=2.0, torque_nm=60.0), 20.0, 5.0)
    lost = 5.0 * 60.0 / 0.29 / carried(CAR)
    assert 20.0 - path[-1, V] == pytest.approx(lost, rel=1e-3)
    slips = path[-1, W : W + 4] * 0.29 / path[-1, V] - 1.0
    assert slips.argmin() == 2
    assert np.ptp(np.delete(slips, 2)) < 0.1 * abs(slips[2])


def test_a_sensors_limit_and_offset():
    path = roll(nominal(CAR, Road()), 25.0, 2.5, -2000.0)
    at = np.arange(0.5, 2.0, 0.01)
    true = read(path, Sensors(), at)
    limited = read(path, by_further("accelerometer_limit", limit_m_s2=4.0).sensors, at)
    assert_allclose(limited[:, 5], np.maximum(true[:, 5], -4.0))
    offset = read(path, by_further("speed_offset", offset_m_s=0.4).sensors, at)
    assert_allclose(offset[:, 4], true[:, 4] + 0.4)
    assert_allclose(offset[:, :4], true[:, :4])


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


def test_an_accelerometer_that_pitches_reads_gravity_too(short_ramp):
    at, true, told = reading(short_ramp, by_further("accelerometer_pitches", share=0.1).sensors)
    assert at.size > 100
    assert_allclose(told[:, 5], 1.1 * true[:, 5], rtol=1e-3)


def test_a_speed_in_steps_is_below_the_speed(short_ramp):
    _, true, told = reading(short_ramp, by_further("speed_in_steps", step_m_s=0.25).sensors)
    assert_allclose(told[:, 4] / 0.25, np.round(told[:, 4] / 0.25), atol=1e-9)
    off = (true - told)[:, 4]
    assert off.min() >= 0.0
    assert off.max() < 0.25
    assert off.mean() == pytest.approx(0.125, rel=0.1)


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
    slips = slip_of(by_further("unlike_tyres_by_axle", front_more=0.3), 15.0, 30.0)
    assert slips[2] / slips[0] == pytest.approx(1.3 / 0.7, rel=0.01)
    stiffness = 1.0 / slips
    plain = 1.0 / slip_of(nominal(CAR, Road()), 15.0, 30.0)
    assert stiffness.mean() == pytest.approx(plain.mean(), rel=0.01)


def test_wheel_speeds_stand_together_where_messages_stay_out(short_ramp):
    at = np.arange(0.0, 10.0, 1e-3)
    told = read(short_ramp, by_further("wheel_speed_dropouts", hold_s=0.3).sensors, at)
    true = read(short_ramp, Sensors(), at)
    stands = np.diff(told[:, :4], axis=0) == 0.0
    assert 3 * 290 < stands[:, 0].sum() < 8 * 310
    assert np.all(stands == stands[:, :1])
    assert_allclose(told[:, 4:], true[:, 4:], rtol=0, atol=0)


def test_an_accelerometer_is_late_by_its_delay():
    path = np.zeros((4001, N + 1))
    path[:, N] = np.sin(np.arange(4001) * 2e-3)
    at = np.arange(1.0, 3.0, 0.01)
    told = read(path, by_further("accelerometer_delay", delay_s=0.15).sensors, at)[:, 5]
    assert_allclose(told, np.sin(2.0 * (at - 0.15)), atol=1e-6)


def test_a_predicted_speed_is_ahead_by_its_time(short_ramp):
    at, true, told = reading(short_ramp, by_further("speed_predicted_ahead", ahead_s=0.2).sensors)
    ahead = (told - true)[:, 4] / np.gradient(true[:, 4], at)
    assert_allclose(ahead, 0.2, rtol=0.01)


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


def test_an_accelerometer_bends_by_the_square(ramp):
    path = ramp.copy()
    path[:, N] = np.linspace(-6.0, 6.0, len(path))
    at, true, off = reading(path, by_further("accelerometer_bends", per_m_s2=0.02).sensors)
    assert_allclose((off - true)[:, 5], 0.02 * true[:, 5] ** 2, atol=1e-3)
    assert_allclose(off[:, :5], true[:, :5], rtol=0, atol=0)
    assert at.size > 100


def test_a_speed_follows_no_faster_than_it_may():
    path = np.zeros((6001, N + 1))
    path[:, V] = 20.0
    path[2000:3000, V] = 20.0 - 6.0 * np.arange(1000) * 1e-3
    path[3000:, V] = 14.0
    sensors = by_further("speed_rate_limited", limit_m_s2=3.0).sensors
    told = read(path, sensors, np.array([1.9, 2.5, 3.0, 3.5, 4.1]))[:, 4]
    assert_allclose(told, [20.0, 18.5, 17.0, 15.5, 14.0], atol=0.01)


def test_a_side_gives_more_than_told_and_the_other_less():
    p = by_further("torque_vectored", left_more=0.2).physics
    command = np.full((5, 4), 100.0)
    given = [kernel.motor_torque(p, command, w, 0.01, 0.0, 30.0) for w in range(4)]
    assert_allclose(given, [120.0, 80.0, 120.0, 80.0])


def test_a_wheel_is_told_to_stand_below_its_least_speed(ramp):
    _, true, told = reading(ramp, by_further("wheel_speed_dies", least_rad_s=40.0).sensors)
    slow = true[:, :4] < 40.0
    assert 0.02 < slow.mean() < 0.9
    assert np.all(told[:, :4][slow] == 0.0)
    assert_allclose(told[:, :4][~slow], true[:, :4][~slow])


def test_a_speed_has_play_between_up_and_down():
    path, clock = np.zeros((8001, N + 1)), np.arange(8001) * 1e-3
    path[:, V] = 20.0 + 2.0 * np.sin(np.pi * clock)
    told = read(
        path, by_further("speed_hysteresis", play_m_s=0.5).sensors, np.array([2.5, 2.6, 3.5, 4.0, 4.45])
    )
    speed = np.array([21.5, 21.5, 18.5, 18.5, 20.0 + 2.0 * np.sin(np.pi * 4.45) - 0.5])
    assert_allclose(told[:, 4], [*speed[:3], 19.5, speed[4]], atol=1e-5)


def test_an_accelerometer_tells_whole_steps(ramp):
    path = ramp.copy()
    path[:, N] = np.linspace(-6.0, 6.0, len(path))
    _, true, told = reading(path, by_further("accelerometer_in_steps", step_m_s2=0.8).sensors)
    assert_allclose(told[:, 5] / 0.8, np.round(told[:, 5] / 0.8), atol=1e-9)
    assert np.abs(told - true)[:, 5].max() <= 0.4 + 1e-9
    assert np.mean(told - true, axis=0)[5] == pytest.approx(0.0, abs=0.02)
    assert_allclose(read(path, Sensors(), np.array([2.0]))[:, :5], path[2000, [*range(W, W + 4), V]][None])
    assert path[2000, X] > 0.0


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
            reads = slopes(p, speed=speed, place=part * BENDS_M)[1]
            assert reads == pytest.approx(told, rel=1e-3, abs=1e-4)
    path = roll(by_further("cornering_drag", force_n=300.0), 20.0, 5.0)
    bends = [details.winding(at) for at in path[:, X]]
    lost = 300.0 * np.trapezoid(bends * (path[:, V] / 20.0) ** 2, path[:, X])
    assert 0.5 * carried(CAR) * (20.0**2 - path[-1, V] ** 2) == pytest.approx(lost, rel=2e-3)


def test_wheels_are_told_by_an_offset(ramp):
    _, true, told = reading(ramp, by_further("wheel_speed_offset", offset_rad_s=-0.7).sensors)
    assert_allclose(told[:, :4] - true[:, :4], -0.7)
    assert_allclose(told[:, 4:], true[:, 4:])


def test_a_loop_is_not_late_on_a_ramp_and_runs_over_its_end():
    clock, path = np.arange(12001) * 1e-3, np.zeros((12001, N + 1))
    path[:, V] = np.interp(clock, [0.0, 8.0, 12.0], [10.0, 26.0, 26.0])
    sensors = by_further("speed_tracking_loop", loop_s=0.2).sensors
    told = read(path, sensors, clock)[:, 4] - path[:, V]
    assert_allclose(told[5000:7990], 0.0, atol=1e-3)
    since = clock[8000:] - 8.0
    turn = np.sqrt(0.75) / 0.2
    over = 2.0 * np.exp(-since / 0.4) * np.sin(turn * since) / turn
    assert_allclose(told[8000:], over, atol=5e-3)
    assert told.max() > 0.2


def test_an_accelerometer_forgets_what_is_steady():
    path = np.zeros((9001, N + 1))
    path[1000:, N] = 2.0
    told = read(
        path, by_further("accelerometer_fades", time_constant_s=2.0).sensors, np.array([0.9, 1.0, 3.0, 9.0])
    )
    assert_allclose(told[:, 5], [0.0, 2.0, 2.0 * np.exp(-1.0), 2.0 * np.exp(-4.0)], atol=2e-3)


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
    assert_allclose(path[500:, N], -SLIDING * DRY * (1.0 + more * tilt), rtol=1e-3)


def test_wheels_are_told_in_part_by_their_mean(ramp):
    path = ramp.copy()
    path[:, W] *= 0.9
    _, true, told = reading(path, by_further("wheel_speeds_blended", share=0.3).sensors)
    mean = true[:, :4].mean(axis=1, keepdims=True)
    assert_allclose(told[:, :4], 0.7 * true[:, :4] + 0.3 * mean)
    assert_allclose(told[:, :4].mean(axis=1, keepdims=True), mean)
    assert_allclose(told[:, 4:], true[:, 4:])


@pytest.mark.parametrize("share", [0.1, -0.2])
def test_a_speed_sensor_locks_onto_something_else(ramp, share):
    at, true, told = reading(ramp, by_further("speed_mislocks", share=share).sensors)
    off = told[:, 4] / true[:, 4] - 1.0
    wrong = np.abs(off) > 1e-9
    assert_allclose(off[wrong], share)
    assert wrong.mean() == pytest.approx(MISLOCK_S / RELOCK_S, rel=0.15)
    begun = at[1:][np.diff(wrong.astype(int)) > 0]
    assert begun.size >= 6
    assert np.all(np.bincount(np.floor(begun / RELOCK_S).astype(int)) <= 1)


def test_an_accelerometer_swings_on_its_pad():
    path, period = np.zeros((6001, N + 1)), 0.2
    path[2000:, N] = 2.0
    clock = np.arange(6001) * 1e-3
    told = read(path, by_further("accelerometer_on_soft_pad", period_s=period).sensors, clock)[:, 5]
    since, rate = np.maximum(clock - 2.0, 0.0), 2.0 * np.pi / period
    turn = np.sqrt(1.0 - PAD_DAMPING**2) * rate
    decay = np.exp(-PAD_DAMPING * rate * since)
    swing = decay * (np.cos(turn * since) + PAD_DAMPING * rate / turn * np.sin(turn * since))
    assert_allclose(told, np.where(clock >= 2.0, 2.0 * (1.0 - swing), 0.0), atol=0.04)
    assert told.max() > 3.2
    assert told[-1] == pytest.approx(2.0, abs=1e-3)
