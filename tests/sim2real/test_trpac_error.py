"""The estimator's error before and after a diagnosis, on drives of the plant with a withheld effect."""

import re
from dataclasses import replace

import numpy as np
import pytest
from long import beyond

from scenarios.effects import EFFECTS, make_effect
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import make_setup, simulate
from scenarios.plant.sensors import SensorNoise, make_log, mu_reference
from sim2real.how_far.trpac_error import places, trpac_error
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, make_drive

NOISE = SensorNoise(wheel_speed_noise_rad_s=0.05, vehicle_speed_noise_m_s=0.02, accel_x_noise_m_s2=0.08)
FINE_S, EVERY = 1e-3, 5
CAR = VehicleFile.model_validate(
    {
        "schema": 1,
        "name": "test car",
        "mass_kg": 1343.8,
        "wheelbase_m": 2.305,
        "track_m": 1.356,
        "cog_height_m": 0.54,
        "cog_to_rear_axle_m": 1.193,
        "wheel_radius_m": 0.29,
        "wheel_inertia_kg_m2": 1.2,
        "motor_peak_torque_nm": 320.0,
        "tyre": {"model": "modified_dugoff", "longitudinal_stiffness_n": 50_000.0},
    }
)


def road_of(*thetas, length_m=40.0):
    """Stretches of equal length; a theta, or one left and one right."""
    pairs = [theta if isinstance(theta, tuple) else (theta, theta) for theta in thetas]
    return RoadFile.model_validate(
        {
            "schema": 1,
            "segments": [
                {"start_m": i * length_m, "mu_left": left, "mu_right": right, "surface": "wet"}
                for i, (left, right) in enumerate(pairs)
            ],
        }
    )


ICE_AND_WET = road_of(0.9, 0.3, 0.5, 0.3, 0.5, 0.9)
HARD = ([0.0, 0.5, 0.6, 1.6, 1.7, 2.2, 2.4, 3.2, 3.4, 4.0], [0, 0, 310, 310, 0, 0, -380, -380, 0, 0])
"""Coast, drive hard, coast, brake hard, coast: times [s] and torque [N m], again and again."""
MILD = ([0.0, 1.0, 2.0, 3.0, 4.0], [0, 40, 40, -40, 0])
LOCKING = ([0.0, 0.5, 0.6, 1.6, 1.7, 2.2, 2.3, 3.0, 3.1, 4.0], [0, 0, 310, 310, 0, 0, -900, -900, 0, 0])


def make(effects, road=ICE_AND_WET, profile=HARD, duration_s=16.0, speed_m_s=13.0):
    """A drive of the car with these effects, and the reference's peak friction on its rows."""
    real = VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})
    at_s = np.arange(round(duration_s / FINE_S)) * FINE_S
    torque = np.repeat(np.interp(at_s % profile[0][-1], *profile)[:, None], 4, axis=1)
    trajectory = simulate(real, road, torque, FINE_S, speed_m_s, 0.0)
    log = make_log(trajectory, real, NOISE, seed=5)[::EVERY]
    columns = {name: log[name].to_numpy(dtype=np.float64) for name in log.columns}
    reference = mu_reference(trajectory, real)[::EVERY]
    return make_drive("log", road, columns["time_s"], columns), reference


def effects_of(effects):
    return [make_effect(key, values, CAR.to_core()) for key, values in effects.items()]


@pytest.mark.parametrize(
    "effects",
    beyond(
        5,
        [
            {"wheel_radius_offset": {"radius_m": 0.284}},
            {"torque_gain": {"factor": 0.88}},
            {"torque_delay": {"delay_s": 0.06}},
            {"torque_lag": {"time_constant_s": 0.1}},
            {"tyre_stiffness_offset": {"stiffness_n": 38_000.0}},
            {"mass_offset": {"mass_kg": 250.0}},
            {"wheel_inertia_offset": {"inertia_kg_m2": 2.4}},
            {"load_transfer": {"cog_height_m": 0.54}},
            {"rolling_resistance": {"coefficient": 0.03}},
            {"brake_drag": {"torque_nm": 30.0}},
            {"wheel_speed_delay": {"delay_s": 0.04}},
            {"vehicle_speed_delay": {"delay_s": 0.04}},
            {"vehicle_speed_scale": {"factor": 1.02}},
            {"torque_gain": {"factor": 0.9}, "wheel_radius_offset": {"radius_m": 0.295}},
        ],
    ),
    ids="+".join,
)
def test_what_was_found_mends_the_estimate(effects):
    drive, _ = make(effects)
    error = trpac_error(CAR, drive, effects_of(effects))
    assert error.after < 0.4 * error.before
    assert error.after < 0.025
    for key in effects:
        assert f"{key} changes" in error.sentence


def test_a_simulation_that_is_right_leaves_a_small_error():
    drive, _ = make({})
    error = trpac_error(CAR, drive, [])
    assert error.before == error.after < 0.02
    assert "No effect" in error.sentence


def test_the_cars_own_effects_are_in_the_estimator_from_the_start():
    effects = {"wheel_radius_offset": {"radius_m": 0.284}, "load_transfer": {"cog_height_m": 0.54}}
    drive, _ = make(effects)
    knows = VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})
    assert trpac_error(knows, drive, []).before < 0.03
    assert trpac_error(CAR, drive, []).before > 0.1


@pytest.mark.parametrize(
    "effects",
    [
        {"tyre_relaxation": {"length_m": 0.4}},
        {"aero_drag": {"drag_area_m2": 0.7}},
        {"friction_falloff": {"falloff_s_m": 0.05, "floor": 0.6}},
    ],
    ids="".join,
)
def test_an_effect_without_a_place_leaves_the_estimate_as_it_is(effects):
    drive, _ = make(effects)
    error = trpac_error(CAR, drive, effects_of(effects))
    assert error.before == error.after
    assert f"{next(iter(effects))} has no parameter" in error.sentence


def test_every_effect_has_the_place_that_is_documented():
    parameters = make_setup(CAR, ICE_AND_WET).parameters
    found = {
        key: places(cls(**{p.name: p.start_values(CAR.to_core())[0] for p in cls.parameters()}), parameters)
        for key, cls in EFFECTS.items()
        if cls.stage != "perception"
    }
    assert {key: words for key, words in found.items() if words} == {
        "torque_gain": ("the wheel torque",),
        "torque_lag": ("the wheel torque",),
        "torque_delay": ("the wheel torque",),
        "brake_drag": ("the wheel torque",),
        "rolling_resistance": ("the rolling resistance",),
        "mass_offset": ("the mass",),
        "wheel_radius_offset": ("the wheel radius",),
        "wheel_inertia_offset": ("the wheel inertia",),
        "load_transfer": ("the height of the load transfer",),
        "tyre_stiffness_offset": ("the tyre stiffness",),
        "vehicle_speed_scale": ("the readings",),
        "vehicle_speed_delay": ("the readings",),
        "wheel_speed_delay": ("the readings",),
        "wheel_speed_quantisation": ("the readings",),
        "accelerometer_bias": ("the readings",),
    }
    assert {key for key, words in found.items() if not words} == {
        "aero_drag", "road_grade", "driveline_compliance", "tyre_relaxation", "friction_falloff", "friction_offset",
        "mu_split", "tyre_shape", "tyre_formula", "tyre_load_stiffness",
    }  # fmt: skip


@pytest.mark.parametrize(
    "effects",
    [
        {"friction_offset": {"factor": 0.8}},
        {"mu_split": {"left_factor": 0.8, "right_factor": 1.2}},
    ],
    ids="".join,
)
def test_the_road_as_found_is_what_the_estimate_is_held_to(effects):
    drive, _ = make(effects)
    error = trpac_error(CAR, drive, effects_of(effects))
    assert error.before == error.after < 0.02
    assert error.against == f"road.yaml's friction with {next(iter(effects))}"
    assert "estimates itself" in error.sentence
    assert trpac_error(CAR, drive, []).before > 0.05  # held to a road that is not there


def test_a_reference_is_taken_before_the_road_file():
    drive, reference = make({"friction_offset": {"factor": 0.8}})
    error = trpac_error(CAR, drive, [], reference)
    assert error.before < 0.02
    assert error.against == "mu_reference"
    assert trpac_error(CAR, drive, [], 1.1 * reference).before > 0.02  # the reference does count


def test_a_reference_of_both_sides_is_split_as_the_road_is():
    drive, reference = make({}, road_of(0.9, (0.3, 0.5), (0.5, 0.9), (0.3, 0.3)))
    assert trpac_error(CAR, drive, [], reference).before < 0.03


def test_where_the_reference_is_lost_nothing_is_judged():
    drive, reference = make({})
    wrong = np.where(drive.time_s < 8.0, 3.0 * reference, reference)
    assert trpac_error(CAR, drive, [], wrong).before > 0.2
    assert trpac_error(CAR, drive, [], np.where(drive.time_s < 8.0, np.nan, wrong)).before < 0.02
    assert trpac_error(CAR, drive, [], np.full_like(reference, np.nan)) is None


def test_a_reference_of_another_length_is_refused():
    drive, reference = make({}, duration_s=2.0)
    with pytest.raises(ValueError, match=r"shape \(399,\); expected \(400,\), a value per row of log"):
        trpac_error(CAR, drive, [], reference[:-1])


def test_lost_samples_are_survived():
    effects = {"wheel_radius_offset": {"radius_m": 0.284}}
    drive, _ = make(effects)
    whole = trpac_error(CAR, drive, effects_of(effects))
    measured = drive.measured.copy()
    measured[np.random.default_rng(1).random(measured.shape) < 0.002] = np.nan
    measured[700:760] = np.nan  # the bus is silent
    measured[1500:1900, ACCEL] = np.nan
    holed = trpac_error(CAR, replace(drive, measured=measured), effects_of(effects))
    assert holed.after < 0.4 * holed.before
    assert holed.after == pytest.approx(whole.after, abs=0.02)


def test_without_an_accelerometer_the_estimator_takes_the_speed():
    effects = {"load_transfer": {"cog_height_m": 0.54}}
    drive, _ = make(effects)
    counted = drive.counted.copy()
    counted[ACCEL] = False
    junk = drive.measured.copy()
    junk[:, ACCEL] = 3.0  # computed from others, badly: must not be used
    without = trpac_error(CAR, replace(drive, measured=junk, counted=counted), effects_of(effects))
    assert without.after < 0.03
    assert without.after < 0.4 * without.before


def test_without_excitation_there_is_nothing_to_say():
    drive, _ = make({}, road_of(0.9), MILD)
    assert trpac_error(CAR, drive, []) is None


def test_a_wrong_radius_sees_ice_on_a_dry_road_and_the_right_one_does_not():
    effects = {"wheel_radius_offset": {"radius_m": 0.28}}
    drive, _ = make(effects, road_of(0.9), MILD)
    error = trpac_error(CAR, drive, effects_of(effects))
    assert error.before > 0.5
    assert error.after < 0.2  # holds about its start value, 0.8
    assert re.search(r"Evaluated over \d+\.\d s before and 0\.0 s after", error.sentence)
    assert "After, it never suffices" in error.sentence


def test_a_tyre_thought_too_soft_misses_the_road_and_is_judged_for_it():
    effects = {"tyre_stiffness_offset": {"stiffness_n": 65_000.0}}
    drive, _ = make(effects, road_of(0.45))
    error = trpac_error(CAR, drive, effects_of(effects))
    assert error.before == pytest.approx(0.8 - 0.45)  # never leaves its start value
    assert error.after < 0.025
    assert re.search(r"Evaluated over 0\.0 s before and [1-9]\.\d s after", error.sentence)
    assert "Before, it never suffices" in error.sentence


def test_a_locked_wheel_tells_nothing_by_its_commanded_torque():
    drive, _ = make({}, road_of(0.9, 0.5, 0.3), LOCKING, speed_m_s=20.0)
    rim_m_s = drive.measured[:, CHANNELS.index("wheel_speed_fl_rad_s")] * CAR.wheel_radius_m
    locked_s = np.count_nonzero((rim_m_s < 0.1) & (drive.measured[:, SPEED] > 2.0)) * drive.step_s
    assert locked_s > 1.0
    assert trpac_error(CAR, drive, []).before < 0.04
