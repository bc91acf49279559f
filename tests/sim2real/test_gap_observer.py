"""The plant as an observer along a log: noise where the model is right, a pattern of its own where it is not."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import (
    BARE,
    DRY,
    MODEL,
    SIGMA,
    STEP_S,
    clean,
    noisy,
    pulses,
    random_drives,
    remeasured,
    rms,
    road_of,
    trace,
)
from random_gap_drives import SEVERITY

from scenarios.effects import EFFECTS
from scenarios.effects.aero_drag import AeroDrag
from scenarios.effects.mass_offset import MassOffset
from scenarios.effects.road_grade import RoadGrade
from scenarios.effects.torque_gain import TorqueGain
from scenarios.effects.wheel_speed_quantisation import WheelSpeedQuantisation
from scenarios.files import VehicleFile
from scenarios.plant.pipeline import simulate
from sim2real.observing.drive import ACCEL, CHANNELS, POSITION, SPEED, WHEEL, awake
from sim2real.observing.evidence import residuals
from sim2real.observing.lattice import SmoothCounter
from sim2real.observing.observer import MEMORY_S, Push, Simulation

G = 9.81


def no_push(n):
    return Push(np.zeros((n, 4)), np.zeros(n), False, np.zeros((n, len(CHANNELS))))


@pytest.fixture(scope="module")
def tame():
    """A drive below the grip limit, without noise."""
    return clean(pulses(8.0), 15.0)


# --- sensors that wake after the logger


@pytest.fixture(scope="module")
def braking():
    """A drive whose first seconds are the hardest braking: nobody who does not see it knows how fast the car is."""
    torque = trace((0, 0), (0.2, -500), (1.2, -500), (1.4, 0), (2.5, 0), (3, 300), (5, 300), duration_s=6.0)
    return noisy(clean(torque, 25.0))


def asleep(drive, channels, first):
    measured = drive.measured.copy()
    measured[:first, channels] = np.nan
    return awake(remeasured(drive, measured))


@pytest.mark.parametrize(
    "channels", [slice(SPEED, ACCEL), slice(POSITION, ACCEL), slice(SPEED, SPEED + 1), slice(0, ACCEL + 1)]
)
def test_a_drive_begins_where_its_speed_is_known(braking, channels):
    drive = asleep(braking, channels, 120)
    np.testing.assert_array_equal(drive.time_s, braking.time_s[120:])
    np.testing.assert_array_equal(drive.measured, braking.measured[120:])
    np.testing.assert_allclose(rms(residuals(MODEL, drive) / SIGMA), 1.0, atol=0.12)


def test_without_a_speed_sensor_it_begins_where_a_wheel_is_known(braking):
    measured = braking.measured.copy()
    measured[:, SPEED] = np.nan
    measured[:120, WHEEL] = np.nan
    measured[:200, 2] = np.nan
    drive = awake(remeasured(braking, measured))
    np.testing.assert_array_equal(drive.time_s, braking.time_s[120:])


@pytest.mark.parametrize("channels", [slice(POSITION, POSITION + 1), slice(ACCEL, ACCEL + 1), WHEEL])
def test_what_else_wakes_late_costs_no_row_and_no_residual(braking, channels):
    drive = asleep(braking, channels, 120)
    assert len(drive) == len(braking)
    np.testing.assert_allclose(rms(residuals(MODEL, drive) / SIGMA), 1.0, atol=0.12)


def test_a_drive_that_is_awake_stays_as_it_is(braking):
    same = awake(braking)
    np.testing.assert_array_equal(same.time_s, braking.time_s)
    np.testing.assert_array_equal(same.measured, braking.measured)


# --- noise where the model is right


@pytest.mark.parametrize("effect", [e for e in SEVERITY if e != "wheel_speed_quantisation"])
def test_residuals_of_the_true_model_are_the_sensors_noise_and_those_of_another_are_not(effect):
    values = SEVERITY[effect](0.9 if effect == "driveline_compliance" else 0.3)
    drive = noisy(clean(hard_torque(), 12.0, road_of(0.9, 0.5, 0.9, 0.4), {effect: values}))
    right = rms(residuals(MODEL.with_effects(EFFECTS[effect](**values)), drive) / SIGMA)
    wrong = rms(residuals(MODEL, drive) / SIGMA)
    np.testing.assert_allclose(right, 1.0, atol=0.1)
    assert wrong.max() > 1.5


def hard_torque():
    """Steps, coasting, brakes to the limit of 0.4: every effect shows."""
    points = []
    for k in range(3):
        points += [(4 * k + t, T) for t, T in ((0, 0), (0.3, 0), (0.4, 300), (1.4, 300), (1.5, -100))]
        points += [
            (4 * k + t, T) for t, T in ((1.9, -100), (2.0, 0), (2.5, 0), (2.6, -420), (3.2, -420), (3.3, 0))
        ]
    return trace(*points, duration_s=12.0)


def test_without_any_gap_the_random_drives_leave_noise():
    found = [residuals(MODEL, drive) for drive in random_drives({}, count=4, seed=3)]
    averaged = SIGMA / 2.0  # of four rows
    np.testing.assert_allclose(rms(np.concatenate(found) / averaged), 1.0, atol=0.1)


def test_lost_samples_leave_the_others_as_good(tame):
    drive = noisy(tame)
    kept = np.random.default_rng(1).uniform(size=drive.measured.shape) > 0.4
    kept[200:300, SPEED] = False
    patchy = residuals(MODEL, remeasured(drive, np.where(kept, drive.measured, np.nan)))
    assert not np.isfinite(patchy[~kept]).any()
    np.testing.assert_allclose(rms(patchy / SIGMA), 1.0, atol=0.15)


# --- a pattern of its own where it is not

FOLLOWED = np.array([2e-4, 2e-4, *(4 * [5e-3]), 0.02])
"""What the looser tolerance of following leaves at kinks of the torque, in each channel's unit; less than noise."""
ROLLING = 4.0 * BARE.wheel_inertia_kg_m2 / BARE.wheel_radius_m**2 / BARE.mass_kg
"""Inertia of the wheels per that of the car."""
RATE_1_S = 1.0 / MEMORY_S[SPEED] + ROLLING / MEMORY_S[WHEEL][0]
"""Rate at which the speed comes to its measurement: the wheels come to theirs and draw the car along [1/s]."""


def test_a_grade_shows_as_memory_times_gravity_in_the_speed_and_not_in_the_accelerometer():
    slope = 0.03
    drive = clean(trace((0, 120), duration_s=10.0), 12.0, effects={"road_grade": {"grade": slope}})
    rest = MODEL.predict(drive).channels
    rest = (drive.measured - rest)[drive.time_s > 6.0]
    pull = -G * slope / np.hypot(1.0, slope)
    np.testing.assert_allclose(rest[:, SPEED], pull / RATE_1_S, rtol=0.03)
    assert np.abs(rest[:, ACCEL]).max() < 0.2 * abs(pull)


def test_a_biased_accelerometer_shows_in_the_accelerometer_alone(tame):
    drive = remeasured(tame, tame.measured + np.eye(7)[ACCEL] * 0.2)
    rest = drive.measured - MODEL.predict(drive).channels
    np.testing.assert_allclose(rest[:, ACCEL], 0.2, atol=FOLLOWED[ACCEL])
    assert np.abs(rest[:, [POSITION, SPEED]]).max() < 1e-3


# --- following and not following


def test_a_log_without_measurements_is_the_plain_simulation_from_rest():
    drive = clean(pulses(6.0), 0.0)
    blind = replace(drive, measured=np.full_like(drive.measured, np.nan))
    run = simulate(BARE, DRY, drive.torque_nm, STEP_S, 0.0, 0.0)
    seen = MODEL.predict(blind)
    np.testing.assert_allclose(seen.states[:, SPEED], run.speed_m_s, atol=FOLLOWED[SPEED])
    np.testing.assert_allclose(seen.states[:, WHEEL], run.wheel_speed_rad_s, atol=FOLLOWED[WHEEL][0])
    np.testing.assert_allclose(seen.channels[:, ACCEL], run.accel_x_m_s2, atol=FOLLOWED[ACCEL])
    np.testing.assert_allclose(seen.force_n, run.tyre_force_n, atol=FOLLOWED[ACCEL] * BARE.mass_kg / 4.0)


def test_a_log_that_is_measured_at_its_start_alone_is_the_plain_simulation_from_there():
    drive = clean(trace((0, 0), (0.5, 0), (0.6, 250), (3, -200), duration_s=6.0), 14.0)
    measured = drive.measured.copy()
    measured[40:] = np.nan
    seen = MODEL.predict(replace(drive, measured=measured))
    assert np.all(np.abs(seen.channels - drive.measured) < FOLLOWED)


def test_a_car_whose_speed_is_not_measured_yet_begins_as_fast_as_its_wheels_roll(tame):
    measured = tame.measured.copy()
    measured[:40, SPEED] = np.nan
    seen = MODEL.predict(remeasured(tame, measured)).states
    np.testing.assert_allclose(seen[:40, SPEED], tame.measured[:40, SPEED], atol=0.05)


def test_a_wrong_state_is_forgotten_with_the_memory(tame):
    measured = tame.measured.copy()
    rows = slice(250, 251)
    measured[rows, SPEED] += 1.0
    jolt = MODEL.predict(remeasured(tame, measured)).states - MODEL.predict(tame).states
    after = jolt[251:, SPEED]
    assert after[0] == pytest.approx(1.0 - np.exp(-STEP_S / MEMORY_S[SPEED]), rel=0.05)
    second = round(MEMORY_S[SPEED] / STEP_S)
    assert after[second] / after[0] == pytest.approx(np.exp(-RATE_1_S * MEMORY_S[SPEED]), rel=0.1)


# --- pushes


def test_a_push_of_torque_is_torque(tame):
    extra = 30.0 * np.sin(tame.time_s)[:, None] * np.array([1.0, 0.0, -1.0, 0.5])
    pushed = MODEL.predict(tame, replace(no_push(len(tame)), torque_nm=extra))
    commanded = MODEL.predict(replace(tame, torque_nm=tame.torque_nm + extra))
    np.testing.assert_array_equal(pushed.channels, commanded.channels)


def test_a_push_that_is_not_felt_is_gravity(tame):
    slope = 0.02
    pull = np.full(len(tame), -G * slope / np.hypot(1.0, slope))
    pushed = MODEL.predict(tame, replace(no_push(len(tame)), accel_m_s2=pull))
    graded = MODEL.with_effects(RoadGrade(slope)).predict(tame)
    np.testing.assert_allclose(pushed.states, graded.states, atol=5e-3)
    moved = graded.channels - MODEL.predict(tame).channels
    assert np.abs(moved[:, SPEED]).max() > 0.5 * abs(pull[0])
    assert np.abs(moved[:, ACCEL]).max() < 0.2 * abs(pull[0])


def test_a_push_that_is_felt_is_a_force(tame):
    seen = MODEL.predict(tame)
    area = 1.5
    drag = -0.5 * 1.2 * area * seen.states[:, SPEED] ** 2 / BARE.mass_kg
    pushed = MODEL.predict(tame, replace(no_push(len(tame)), accel_m_s2=drag, felt=True))
    dragged = MODEL.with_effects(AeroDrag(area)).predict(tame)
    moved, expected = pushed.channels - seen.channels, dragged.channels - seen.channels
    np.testing.assert_allclose(moved[:, SPEED], expected[:, SPEED], rtol=0.05, atol=2e-3)
    np.testing.assert_allclose(moved[:, ACCEL], expected[:, ACCEL], rtol=0.1, atol=5e-3)


@pytest.mark.parametrize("channel", range(7))
def test_a_push_of_an_offset_is_a_sensor_that_reads_too_much(tame, channel):
    offset = np.zeros((len(tame), 7))
    offset[:, channel] = 0.3
    biased = remeasured(tame, tame.measured + offset)
    seen = MODEL.predict(biased, replace(no_push(len(tame)), offset=offset))
    assert np.all(np.abs(seen.channels - biased.measured) < FOLLOWED)
    np.testing.assert_allclose(seen.states, MODEL.predict(tame).states, atol=1e-9)


def test_pushes_of_nothing_change_nothing(tame):
    np.testing.assert_array_equal(
        MODEL.predict(tame, no_push(len(tame))).channels, MODEL.predict(tame).channels
    )


# --- the model's effects


def test_an_added_effect_takes_the_place_of_the_files_own():
    car = VehicleFile.model_validate(
        {**BARE.model_dump(by_alias=True), "effects": {"mass_offset": {"mass_kg": 100.0}}}
    )
    own = Simulation(car)
    assert own.has("mass_offset")
    assert not own.has("torque_gain")
    more = own.with_effects(TorqueGain(0.9), MassOffset(50.0))
    assert more.effects == (TorqueGain(0.9), MassOffset(50.0))
    assert own.effects == (MassOffset(100.0),)


def test_effects_act_in_the_plants_order_whatever_order_they_are_given_in():
    some = [
        EFFECTS[key](**SEVERITY[key](0.2)) for key in ("accelerometer_bias", "torque_delay", "mass_offset")
    ]
    given = MODEL.with_effects(*some)
    turned = MODEL.with_effects(*reversed(some))
    assert given.effects == turned.effects
    order = [list(EFFECTS).index(e.id) for e in given.effects]
    assert order == sorted(order)


def test_a_counter_is_foretold_without_its_rounding(tame):
    model = MODEL.with_effects(WheelSpeedQuantisation(48.0, 0.04))
    assert model.effects == (SmoothCounter(48.0, 0.04),)
    braking = (tame.time_s > 2.7) & (tame.time_s < 3.6)
    steps = np.diff(model.predict(tame).channels[braking, WHEEL.start])
    assert (steps < 0.0).all()
