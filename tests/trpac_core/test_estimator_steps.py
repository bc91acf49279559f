"""What the estimator says does not depend on how a host cuts time into steps, nor on gaps in its readings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from trpac_core import tyre, wheel_step
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import EstimatorState, Method, Rates
from trpac_core.observer import seen_at
from trpac_core.preprocessing import RELEASED, preprocess
from trpac_core.sensors import Sensors
from trpac_core.stationary_mean import NO_MEAN, StationaryMean
from trpac_core.vehicle import EXACT_CAR, CarTolerance, Vehicle
from trpac_core.vision.classes import Surface

NAN = math.nan
SMOOTH = Vehicle(rolling_resistance=0.0)
LOAD_N = SMOOTH.wheel_load(True)
C_X, RADIUS_M, INERTIA = SMOOTH.longitudinal_stiffness_n, SMOOTH.wheel_radius_m, SMOOTH.wheel_inertia_kg_m2
DIFE = EstimatorConfig(vehicle=SMOOTH, method=Method.DIFE)
UNFILTERED = replace(DIFE, sensor_filter_s=1e-6, tolerance=EXACT_CAR)
STEPS_S = [0.001, 0.01, 0.02, 0.05, 0.1]


@pytest.mark.parametrize("x", [1e-6, 1e-3, 0.06, 1.0, 30.0])
def test_the_observer_sees_an_even_change_where_its_memory_lies(x):
    weight = quad(lambda u: math.exp(-x * (1.0 - u)), 0.0, 1.0)[0]
    assert seen_at(x) == pytest.approx(
        quad(lambda u: u * math.exp(-x * (1.0 - u)), 0.0, 1.0)[0] / weight, rel=1e-9
    )


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_wheel_that_gains_speed_shows_the_force_of_its_tyre(step_s):
    """At a held slip under an even acceleration; what turns the wheel itself is no force on the road."""
    slip, a_m_s2, theta = 0.03, 4.0, 0.4
    force_n = tyre.force(theta, slip, LOAD_N, C_X, 1.0)
    spin_up = a_m_s2 / RADIUS_M / (1.0 - slip)
    torque_nm = force_n * RADIUS_M + INERTIA * spin_up
    estimator = TrpacEstimator(replace(UNFILTERED, theta_initial=theta))
    for time_s in np.arange(0.0, 3.0, step_s):
        v = 8.0 + a_m_s2 * time_s
        said = estimator.step(step_s, Sensors(v / RADIUS_M / (1.0 - slip), torque_nm, v, LOAD_N, 0.0, a_m_s2))
    assert INERTIA * spin_up / RADIUS_M > 0.03 * force_n
    assert said.tyre_force_n == pytest.approx(force_n, rel=2e-3)
    assert said.TRPAC == pytest.approx(theta, rel=5e-3)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_torque_that_rises_evenly_is_followed_by_the_observers_time_constant(step_s):
    estimator, gain = TrpacEstimator(UNFILTERED), UNFILTERED.gains.K
    slope_nm_s = 100.0
    for time_s in np.arange(0.0, 3.0, step_s):
        torque_nm = slope_nm_s * time_s
        said = estimator.step(step_s, Sensors(10.0 / RADIUS_M, torque_nm, 10.0, LOAD_N))
    assert said.tyre_force_n == pytest.approx((torque_nm - slope_nm_s / gain) / RADIUS_M, abs=0.05)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_differentiated_speed_gives_the_load_of_its_acceleration(step_s):
    told, found = TrpacEstimator(EstimatorConfig()), TrpacEstimator(EstimatorConfig())
    for time_s in np.arange(0.0, 2.0, step_s):
        v = 5.0 + 4.0 * time_s
        at = Sensors(v / RADIUS_M, 0.0, v)
        loads = [
            one.step(step_s, sensors).load_n
            for one, sensors in ((told, replace(at, longitudinal_acceleration_m_s2=4.0)), (found, at))
        ]
    assert loads[1] == pytest.approx(loads[0], abs=1.0)


@pytest.mark.parametrize("step_s", [0.001, 0.02, 0.05])
def test_a_step_of_no_time_has_the_acceleration_of_those_about_it(step_s):
    estimator = TrpacEstimator(EstimatorConfig())
    for time_s in np.arange(0.0, 2.0, step_s):
        v = 5.0 + 4.0 * time_s
        last = estimator.step(step_s, Sensors(v / RADIUS_M, 0.0, v))
    again = estimator.step(0.0, Sensors((v + 4.0 * step_s) / RADIUS_M, 0.0, v + 4.0 * step_s))
    assert again.load_n == pytest.approx(last.load_n, abs=1.0)


# --- gaps


def sliding(theta, slip=0.04):
    force_n = tyre.force(theta, slip, LOAD_N, C_X, 1.0)
    return Sensors(10.0 / RADIUS_M / (1.0 - slip), force_n * RADIUS_M, 10.0, LOAD_N)


def driven(estimator, sensors, seconds, frame=None):
    for _ in range(round(seconds / 0.001)):
        said = estimator.step(0.001, sensors, frame)
        frame = None
    return said


def test_what_was_read_before_a_gap_does_not_speak_for_the_road_behind_it():
    after_gap, fresh = (TrpacEstimator(DIFE) for _ in range(2))
    driven(after_gap, sliding(0.5), 1.5)
    driven(after_gap, replace(sliding(0.5), wheel_torque_nm=NAN), 3.0)
    start = after_gap.state()["state"]["fusion"]["theta_hat"]
    fresh = TrpacEstimator(replace(DIFE, theta_initial=start))
    for part_s in (0.05, 0.05, 0.1):
        found, expected = (driven(one, sliding(0.3), part_s).TRPAC for one in (after_gap, fresh))
        assert found == pytest.approx(expected, abs=0.01)


def test_a_step_over_which_nobody_knows_the_way_leaves_nothing_known():
    estimator = TrpacEstimator(DIFE)
    sure = driven(estimator, sliding(0.3), 1.5)
    lost = estimator.step(60.0, sliding(0.3))
    assert lost.TRPAC == sure.TRPAC
    unknown = TrpacEstimator(DIFE).last.TRPAC_expected_std
    assert sure.TRPAC_expected_std < 0.8 * unknown
    assert lost.TRPAC_expected_std == unknown
    assert driven(estimator, Sensors(10.0 / RADIUS_M, 0.0, 10.0), 0.01).TRPAC_std > 0.9 * unknown


# --- the camera's gate


@pytest.mark.parametrize(("confidence", "flag"), [(0.5, False), (math.nextafter(0.5, 1.0), True)])
def test_a_class_counts_above_the_threshold_only(confidence, flag):
    estimator = TrpacEstimator(EstimatorConfig())
    cruise = Sensors(10.0 / RADIUS_M, 0.0, 10.0)
    assert driven(estimator, cruise, 0.26, RoadClass(Surface.WET, confidence)).flag is flag


def test_a_camera_that_pulls_the_estimate_leaves_the_observed_force_alone():
    """Last term of Eq. (15): the tyre model's force goes with theta_hat, the road's does not."""
    estimator = TrpacEstimator(replace(UNFILTERED, tolerance=CarTolerance(), theta_initial=0.8))
    force_n = tyre.force(0.9, 0.0235, LOAD_N, C_X, 1.0)
    steady = Sensors(10.0 / RADIUS_M / (1.0 - 0.0235), force_n * RADIUS_M, 10.0, LOAD_N)
    told = [estimator.step(0.001, steady, RoadClass(Surface.SNOW_ICE, 0.95)) for _ in range(2000)]
    assert told[-1].TRPAC < 0.75
    assert max(abs(said.tyre_force_n - force_n) for said in told) < 1e-6


@pytest.mark.parametrize("front", [True, False])
def test_braking_loads_the_front_axle_and_relieves_the_rear(front):
    car, a_m_s2 = Vehicle(), -5.0
    estimator = TrpacEstimator(EstimatorConfig(vehicle=car, front_axle=front))
    at = Sensors(10.0 / car.wheel_radius_m, 0.0, 10.0, longitudinal_acceleration_m_s2=a_m_s2)
    said = [estimator.step(0.01, at) for _ in range(100)][-1]
    lever_m = car.cog_to_rear_axle_m if front else car.cog_to_front_axle_m
    share = 1.0 if front else -1.0
    moment_nm = car.mass_kg * (9.81 * lever_m - share * a_m_s2 * car.cog_height_m)
    assert said.load_n == pytest.approx(moment_nm / (2.0 * car.wheelbase_m), rel=1e-6)


def test_a_tyre_that_goes_with_its_load_is_told_its_stiffness_at_the_mean_load_of_the_car():
    """Both axles of a car have the same tyres, of C_x at a quarter of its weight."""
    car = Vehicle()
    for front in (True, False):
        config = EstimatorConfig(vehicle=car, front_axle=front)
        known = wheel_step.wheel_setup(config)
        assert known.robust.wheel.mean_load_n == pytest.approx(car.mass_kg * 9.81 / 4.0)


def test_a_frame_is_as_old_as_the_time_since_it_was_taken():
    estimator = TrpacEstimator(EstimatorConfig())
    at = Sensors(10.0 / RADIUS_M, 0.0, 10.0)
    ages = []
    for step in range(60):
        taken = RoadClass(Surface.WET, 0.9) if step == 10 else None
        said = estimator.step(0.01, at, taken)
        if said.frame_age_s >= 0.0:
            ages.append((said.frame_age_s, 0.01 * (step + 1) - 0.01 * 10))
    assert len(ages) > 10
    assert [age for age, _ in ages] == pytest.approx([passed for _, passed in ages], abs=1e-9)


def test_behind_a_locked_wheel_the_torque_counts_once_the_filter_has_forgotten_it():
    config = EstimatorConfig()
    state = first(config)
    known_torque = []
    for omega in (0.0, *[10.0 / RADIUS_M] * 100):
        rates = Rates.at(config, 0.001, state.step_s)
        prepared = preprocess(config, rates, state, Sensors(omega, 0.0, 10.0), 0.001, LOAD_N)
        state.locked_s, state.step_s = prepared.locked_s, 0.001
        known_torque.append(prepared.inputs.torque_known)
    forgotten = RELEASED * config.sensor_filter_s
    assert known_torque.index(True) * 0.001 == pytest.approx(forgotten, abs=0.0015)
    assert all(known_torque[known_torque.index(True) :])


def test_a_wheel_counts_as_locked_by_its_rim_not_by_its_turns():
    config = EstimatorConfig()
    state, rates = first(config), Rates.at(config, 0.001, 0.001)
    for rim_m_s, locked in ((0.4, True), (0.6, False)):
        omega = rim_m_s / config.vehicle.wheel_radius_m
        prepared = preprocess(config, rates, state, Sensors(omega, -500.0, 10.0), 0.001, LOAD_N)
        assert (prepared.locked_s == 0.0) == locked


def test_slip_that_rises_is_seen_by_its_distance_from_its_filter():
    config = EstimatorConfig()
    state, rates = first(config), Rates.at(config, 0.001, 0.001)
    rises = []
    for slip in np.linspace(0.0, 0.1, 100):
        omega = 10.0 / RADIUS_M / (1.0 - slip)
        prepared = preprocess(config, rates, state, Sensors(omega, 0.0, 10.0), 0.001, LOAD_N)
        state.readings, state.lagged_slip, state.settled = prepared.readings, prepared.lagged_slip, True
        rises.append(prepared.inputs.slip_rise)
    # An even rise lags by its slope times the filter's time.
    slope_1_s = 0.1 / 0.099
    assert rises[-1] == pytest.approx(slope_1_s * config.sensor_filter_s, rel=0.1)


@pytest.mark.parametrize("step_s", [-1.0, 20.0])
def test_readings_before_a_step_of_no_use_do_not_stay_in_the_means(step_s):
    estimator = TrpacEstimator(EstimatorConfig())
    for _ in range(300):
        estimator.step(0.001, Sensors(10.2 / RADIUS_M, 300.0, 10.0))
    assert means(estimator)["dynamics"].duration_s > 0.1
    estimator.step(step_s, Sensors(10.2 / RADIUS_M, 300.0, 10.0))
    assert set(means(estimator).values()) == {NO_MEAN}


def means(estimator: TrpacEstimator) -> dict[str, StationaryMean]:
    """Means of both observers, by the field of the state."""
    state = EstimatorState.from_json(estimator.state()["state"])
    return {"dynamics": state.dynamics.mean, "fusion": state.fusion.mean}


def first(config: EstimatorConfig) -> EstimatorState:
    """The state before the first step."""
    return wheel_step.first_state(config, wheel_step.wheel_setup(config))
