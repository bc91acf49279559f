"""Four wheels behind one camera: each as on its own, none silenced by another."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from ife_scene import CAMERA, DRY, SNOW, Masks, Middle, split_road

from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.four_wheels import (
    CAR,
    CarSensors,
    FourWheels,
    FourWheelsConfig,
    SideClasses,
    car_loads,
    car_setup,
)
from trpac_core.local_speed import local_speeds
from trpac_core.sensors import Sensors
from trpac_core.tyre import force
from trpac_core.vehicle import WHEELS, Vehicle
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.sides import SidesIfe

STEP_S = 0.001
CAR_DATA = Vehicle()
DIFE = FourWheelsConfig(EstimatorConfig(method=Method.DIFE))
ICE, DRY_ROAD = RoadClass(SNOW, 0.9), RoadClass(DRY, 0.9)
SPLIT = SideClasses(ICE, DRY_ROAD)
ROLLING = 15.0 / CAR_DATA.wheel_radius_m


def loads_of(read):
    """Loads of the default car for its sum, and what its wheels are given of them."""
    car = FourWheelsConfig().wheel.vehicle
    return car_loads(car, car_setup(car), read)


def sensors(**changes) -> CarSensors:
    plain = CarSensors((ROLLING / 0.98,) * 4, (200.0,) * 4, 15.0, longitudinal_acceleration_m_s2=1.5)
    return plain._replace(**changes)


def sliding(theta=(0.3, 0.8, 0.3, 0.8), slip=0.05, speed=15.0) -> CarSensors:
    """A car whose wheels all slide steadily on roads of these adhesions, straight on."""
    loads = [CAR_DATA.wheel_load(wheel.startswith("f"), 2.0) for wheel in WHEELS]
    torque = tuple(
        force(value, slip, load, CAR_DATA.longitudinal_stiffness_n, 1.0) * CAR_DATA.wheel_radius_m
        for value, load in zip(theta, loads, strict=True)
    )
    omega = speed / CAR_DATA.wheel_radius_m / (1.0 - slip)
    return CarSensors((omega,) * 4, torque, speed, longitudinal_acceleration_m_s2=2.0)


def driven(four: FourWheels, readings: CarSensors, time_s: float, frame=None):
    for index in range(round(time_s / STEP_S)):
        estimate = four.step(STEP_S, readings, frame if index % 50 == 0 else None)
    return estimate


def test_each_wheel_is_estimated_as_by_an_estimator_of_its_own_bit_by_bit():
    four, config = FourWheels(FourWheelsConfig()), FourWheelsConfig()
    alone = [TrpacEstimator(config.of_wheel(name)) for name in WHEELS]
    rng = np.random.default_rng(3)
    for index in range(400):
        omega = tuple(ROLLING / 0.97 + rng.standard_normal(4))
        torque = tuple(200.0 + 50.0 * rng.standard_normal(4))
        accel = 1.5 + 0.1 * rng.standard_normal()
        frame = SPLIT if index % 50 == 0 else None
        estimate = four.step(
            STEP_S, CarSensors(omega, torque, 15.0, longitudinal_acceleration_m_s2=accel), frame
        )
        for i, wheel in enumerate(alone):
            one = Sensors(omega[i], torque[i], 15.0, longitudinal_acceleration_m_s2=accel)
            assert wheel.step(STEP_S, one, frame and frame[i % 2]) == estimate.wheels[i]


def test_each_wheel_finds_its_own_sides_friction():
    estimate = driven(FourWheels(DIFE), sliding(), 1.5)
    assert [wheel.TRPAC for wheel in estimate.wheels] == pytest.approx([0.3, 0.8, 0.3, 0.8], abs=0.01)
    loads = [CAR_DATA.wheel_load(wheel.startswith("f"), 2.0) for wheel in WHEELS]
    expected = (0.3 * loads[0] + 0.8 * loads[1] + 0.3 * (loads[2] + loads[3])) / sum(loads)
    assert estimate.TRPAC == pytest.approx(expected, abs=0.01)


def test_classes_go_to_their_side_and_reach_the_rear_a_wheelbase_later():
    four, seen = FourWheels(FourWheelsConfig()), {}
    for index in range(1000):
        estimate = four.step(STEP_S, sensors(), SPLIT if index % 20 == 0 else None)
        for name, wheel in zip(WHEELS, estimate.wheels, strict=True):
            if wheel.flag:
                seen.setdefault(name, (index * STEP_S * 15.0, wheel.TRPAC_image))
    assert {name: theta for name, (_, theta) in seen.items()} == {"fl": 0.2, "fr": 0.8, "rl": 0.2, "rr": 0.8}
    for front, rear in (("fl", "rl"), ("fr", "rr")):
        assert seen[front][0] == pytest.approx(2.5, abs=0.02)
        assert seen[rear][0] - seen[front][0] == pytest.approx(CAR_DATA.wheelbase_m, abs=0.02)


def test_a_class_on_one_side_alone_leaves_the_other_without():
    estimate = driven(FourWheels(FourWheelsConfig()), sensors(), 0.5, SideClasses(ICE, None))
    assert [wheel.flag for wheel in estimate.wheels] == [True, False, True, False]


def test_one_picture_serves_all_wheels():
    config = FourWheelsConfig(wheel=EstimatorConfig(vision=IfeConfig(camera=CAMERA)))
    masks = Masks()
    four = FourWheels(config, SidesIfe(config.wheel.image_settings, masks, Middle()))
    estimate = driven(four, sensors(), 0.5, split_road())
    assert [wheel.TRPAC_image for wheel in estimate.wheels] == [0.2, 0.8, 0.2, 0.8]
    assert all(wheel.flag for wheel in estimate.wheels)
    assert masks.calls == 10


@pytest.mark.parametrize("name", WHEELS)
@pytest.mark.parametrize("signal", ["wheel_speed_rad_s", "wheel_torque_nm"])
def test_a_broken_sensor_silences_its_own_wheel_alone(name, signal):
    place = WHEELS.index(name)
    healthy, broken = FourWheels(FourWheelsConfig()), FourWheels(FourWheelsConfig())
    good = sliding()
    values = list(getattr(good, signal))
    values[place] = math.nan
    driven(healthy, good, 0.1, SPLIT)
    driven(broken, good, 0.1, SPLIT)
    reference = driven(healthy, good, 0.3, SPLIT)
    estimate = driven(broken, good._replace(**{signal: tuple(values)}), 0.3, SPLIT)
    for i, wheel in enumerate(WHEELS):
        if wheel == name:
            assert not estimate.wheels[i].flag
            assert not estimate.wheels[i].excitation_flag
        else:
            assert estimate.wheels[i] == reference.wheels[i]
    ((who, text),) = estimate.problems
    assert who == name
    assert signal in text
    assert math.isfinite(estimate.TRPAC)
    assert math.isfinite(estimate.TRPAC_std)


def test_a_broken_wheel_leaves_the_car_with_its_partners_knowledge():
    four, good = FourWheels(DIFE), sliding((0.3, 0.3, 0.3, 0.3))
    broken = good._replace(wheel_speed_rad_s=(math.nan, *good.wheel_speed_rad_s[1:]))
    estimate = driven(four, broken, 1.5)
    assert estimate.wheels[0].TRPAC == 0.8
    assert estimate.TRPAC == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize(
    "signal",
    [
        "vehicle_speed_m_s",
        "steering_angle_rad",
        "yaw_rate_rad_s",
        "longitudinal_acceleration_m_s2",
        "lateral_acceleration_m_s2",
    ],
)
@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300])
def test_a_broken_shared_sensor_is_told_once_and_all_wheels_hold(signal, value):
    four = FourWheels(FourWheelsConfig())
    before = driven(four, sliding(), 0.3, SPLIT)
    estimate = driven(four, sliding()._replace(**{signal: value}), 0.1, SPLIT)
    assert [wheel.TRPAC for wheel in estimate.wheels] == [wheel.TRPAC for wheel in before.wheels]
    ((who, text),) = estimate.problems
    assert who == CAR
    assert signal in text
    assert math.isfinite(estimate.TRPAC)
    after = driven(four, sliding(), 0.5, SPLIT)
    assert after.problems == ()


@pytest.mark.parametrize(
    "measured", [{"longitudinal_acceleration_m_s2": None}, {"vertical_load_n": (3500.0,) * 4}]
)
def test_a_broken_lateral_acceleration_is_told_where_it_would_not_count_too(measured):
    # It was ignored there: all flags stayed up beside a signal that no car gives.
    four = FourWheels(FourWheelsConfig())
    good = sliding()._replace(**measured)
    before = driven(four, good, 0.3, SPLIT)
    estimate = driven(four, good._replace(lateral_acceleration_m_s2=1e9), 0.1, SPLIT)
    assert [wheel.TRPAC for wheel in estimate.wheels] == [wheel.TRPAC for wheel in before.wheels]
    assert not any(wheel.flag for wheel in estimate.wheels)
    ((who, text),) = estimate.problems
    assert (who, "lateral_acceleration_m_s2 is 1e+09" in text) == (CAR, True)


def test_lateral_acceleration_moves_load_between_the_sides():
    # In a left turn (a_y > 0) the right wheels bear more: m a_y h / track over the whole car.
    given = sensors(lateral_acceleration_m_s2=3.0)
    loads, told = loads_of(given)
    assert loads == told
    whole = CAR_DATA.mass_kg * 3.0 * CAR_DATA.cog_height_m / CAR_DATA.track_m
    assert (loads[1] + loads[3] - loads[0] - loads[2]) / 2.0 == pytest.approx(whole)
    assert sum(loads) == pytest.approx(CAR_DATA.mass_kg * 9.81)
    front_n = CAR_DATA.wheel_load(True)
    rear_n = CAR_DATA.wheel_load(False)
    straight, _ = loads_of(sensors(longitudinal_acceleration_m_s2=0.0, lateral_acceleration_m_s2=3.0))
    assert (straight[1] - straight[0]) / (straight[3] - straight[2]) == pytest.approx(front_n / rear_n)


def test_without_a_longitudinal_acceleration_a_lateral_one_does_not_count():
    plain = sensors(longitudinal_acceleration_m_s2=None)
    assert loads_of(plain._replace(lateral_acceleration_m_s2=3.0)) == loads_of(plain)


def test_a_measured_load_counts_for_its_wheel():
    loads, told = loads_of(sensors(vertical_load_n=(1000.0, None, None, None)))
    assert loads[0] == told[0] == 1000.0
    assert told[1:] == (None, None, None)


def test_in_a_curve_every_wheel_that_rolls_freely_has_no_slip():
    # A rigid car about the turning centre on the rear axle's line: radii by geometry, not by the code's formula.
    radius_m, speed = 20.0, 10.0
    half, base = CAR_DATA.track_m / 2.0, CAR_DATA.wheelbase_m
    steering, yaw = math.atan(base / radius_m), speed / radius_m
    for known_yaw in (None, yaw):
        fl, fr, rl, rr = local_speeds(CAR_DATA, speed, steering, known_yaw)
        assert (rl, rr) == pytest.approx((yaw * (radius_m - half), yaw * (radius_m + half)))
        middle = math.hypot(radius_m, base) * yaw
        assert (fl + fr) / 2.0 == pytest.approx(middle)
        assert (fr - fl) / 2.0 == pytest.approx(yaw * half * math.cos(steering))


def test_state_repeats_the_run_bit_by_bit_camera_memory_included():
    config = FourWheelsConfig(wheel=EstimatorConfig(vision=IfeConfig(camera=CAMERA)))

    def made() -> FourWheels:
        return FourWheels(config, SidesIfe(config.wheel.image_settings, Masks(), Middle()))

    four, other, picture = made(), made(), split_road()
    driven(four, sensors(), 0.3, picture)
    saved = json.loads(json.dumps(four.state()))
    other.restore(saved)
    assert other.last == four.last
    for index in range(200):
        readings = sensors(wheel_torque_nm=(200.0 + index,) * 4)
        frame = picture if index % 50 == 0 else None
        assert other.step(STEP_S, readings, frame) == four.step(STEP_S, readings, frame)
    assert other.state() == four.state()


def test_reset_forgets():
    four = FourWheels(FourWheelsConfig())
    start = four.state()
    driven(four, sliding(), 0.2, SPLIT)
    four.reset()
    assert four.state() == start


def test_a_failed_picture_takes_the_flag_down_on_both_sides():
    four = FourWheels(FourWheelsConfig())
    assert all(wheel.flag for wheel in driven(four, sensors(), 0.5, SPLIT).wheels)
    estimate = four.step(STEP_S, sensors(), frame_failed=True)
    assert not any(wheel.flag for wheel in estimate.wheels)


def test_settings_of_the_wheels_differ_by_their_place_alone():
    config = FourWheelsConfig()
    places = {name: config.of_wheel(name) for name in WHEELS}
    assert {name: (one.front_axle, one.left_side) for name, one in places.items()} == {
        "fl": (True, True),
        "fr": (True, False),
        "rl": (False, True),
        "rr": (False, False),
    }
    assert {replace(one, front_axle=True, left_side=True) for one in places.values()} == {config.wheel}
