"""The estimator as a whole: odometry and road ahead, bad readings, state."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from trpac_core import tyre
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors
from trpac_core.vehicle import Vehicle
from trpac_core.vision.classes import Surface

CAR = Vehicle()
DIFE = EstimatorConfig(method=Method.DIFE)
"""Its TRPAC is the observer's, from readings that no car gives too: at one point of the curve from the start."""
CRUISE = Sensors(10.0 / 0.29, 0.0, 10.0)
NAN, INF = math.nan, math.inf


def sliding(theta=0.3, slip=0.04, speed_m_s=10.0):
    """Steady readings of a front wheel on a road, with the load told."""
    load_n = CAR.wheel_load(True)
    force = tyre.force(theta, slip, load_n, CAR.longitudinal_stiffness_n, 1.0)
    omega = speed_m_s / CAR.wheel_radius_m / (1.0 - slip)
    return Sensors(omega, force * CAR.wheel_radius_m, speed_m_s, vertical_load_n=load_n)


def driven(estimator, sensors, seconds, frame=None):
    for _ in range(round(seconds / 0.001)):
        estimate = estimator.step(0.001, sensors, frame)
        frame = None
    return estimate


def test_a_class_seen_ahead_counts_when_the_wheel_gets_there_and_not_before():
    estimator = TrpacEstimator(DIFE)
    before = driven(estimator, CRUISE, 0.249, RoadClass(Surface.SNOW_ICE, 0.9))
    assert not before.flag
    assert before.image_confidence == 0.0
    there = driven(estimator, CRUISE, 0.003)
    assert there.flag
    assert there.TRPAC_image == 0.2
    assert there.frame_age_s == pytest.approx(0.252, abs=2e-3)


def test_a_rear_wheel_gets_there_a_wheelbase_later():
    rear = TrpacEstimator(EstimatorConfig(front_axle=False))
    assert not driven(rear, CRUISE, 0.25 + CAR.wheelbase_m / 10.0 - 0.005, RoadClass(Surface.WET, 0.9)).flag
    assert driven(rear, CRUISE, 0.01).flag


def test_low_confidence_keeps_the_flag_down_but_is_shown():
    estimator = TrpacEstimator(DIFE)
    estimate = driven(estimator, CRUISE, 0.26, RoadClass(Surface.WET, 0.4))
    assert not estimate.flag
    assert estimate.image_confidence == 0.4
    assert estimate.TRPAC_image == 0.6


def test_with_the_flag_down_fusion_is_the_dynamics_estimator():
    estimator = TrpacEstimator(DIFE)
    estimate = driven(estimator, sliding(), 1.0, RoadClass(Surface.DRY, 0.1))
    assert estimate.TRPAC == estimate.TRPAC_dynamics
    assert estimate.TRPAC == pytest.approx(0.3, abs=0.003)


def test_never_flagged_the_fusion_is_the_dynamics_estimator_bit_for_bit():
    """Frames of all classes, none of them sure: as if there were no camera."""
    seen, blind = (TrpacEstimator(DIFE) for _ in range(2))
    rng = np.random.default_rng(4)
    for row in range(3000):
        road = sliding(theta=0.3 if row < 1500 else 0.6, slip=0.001 + 0.05 * abs(math.sin(0.004 * row)))
        sensors = replace(road, vehicle_speed_m_s=10.0 + 0.003 * rng.standard_normal())
        frame = RoadClass(Surface(rng.integers(3)), 0.5 * rng.random()) if row % 50 == 0 else None
        with_frames, without = seen.step(0.001, sensors, frame), blind.step(0.001, sensors)
        assert with_frames.TRPAC == with_frames.TRPAC_dynamics == without.TRPAC
        assert with_frames.TRPAC_std == without.TRPAC_std


@pytest.mark.parametrize("theta", [0.3, 0.5])
@pytest.mark.parametrize("wrong", list(Surface))
def test_a_wrong_class_with_its_flag_up_is_undone_by_excitation(theta, wrong):
    """From 1 s of pedal off under a wrong class on: back within 0.05 after at most 0.3 s of a sliding tyre."""
    estimator = TrpacEstimator(DIFE)
    driven(estimator, sliding(theta), 1.0)
    right = Surface.SNOW_ICE if theta < 0.4 else Surface.WET
    for row in range(1300):
        frame = RoadClass(right if row < 50 else wrong, 0.9) if row % 50 == 0 else None
        estimator.step(0.001, CRUISE, frame)
    off = []
    for row in range(1000):
        frame = RoadClass(wrong, 0.9) if row % 50 == 0 else None
        off.append(abs(estimator.step(0.001, sliding(theta), frame).TRPAC - theta))
    assert max(off) < 0.6
    assert max(off[300:]) < 0.05


def locking(estimator, brake_nm, seconds, theta=0.5, speed_m_s=20.0, noise_seed=1):
    """A brake that asks for more than the road gives: the wheel stands within 0.1 s."""
    load_n, rng, omega = (
        CAR.wheel_load(True),
        np.random.default_rng(noise_seed),
        speed_m_s / CAR.wheel_radius_m,
    )
    for _ in range(round(seconds / 0.001)):
        slip = min(max(1.0 - omega * CAR.wheel_radius_m / speed_m_s, 0.0), 0.999)
        force = tyre.force(theta, slip, load_n, CAR.longitudinal_stiffness_n, -1.0)
        omega = max(0.0, omega + 0.001 * (brake_nm - force * CAR.wheel_radius_m) / CAR.wheel_inertia_kg_m2)
        sensors = Sensors(omega + 0.01 * rng.standard_normal(), brake_nm, speed_m_s, vertical_load_n=load_n)
        estimate = estimator.step(0.001, sensors)
    return estimate


@pytest.mark.parametrize("brake_nm", [-900.0, -1500.0])
def test_a_locked_wheels_commanded_torque_does_not_move_the_estimate(brake_nm):
    """Fed with it, the estimate once went to 1.2 on a road of 0.5."""
    estimator = TrpacEstimator(DIFE)
    before = locking(estimator, brake_nm, 0.3)
    after = locking(estimator, brake_nm, 2.0)
    assert abs(after.TRPAC - 0.5) <= max(2.0 * after.TRPAC_std, 0.05)
    assert not after.excitation_flag
    assert after.TRPAC_std >= before.TRPAC_std


def test_on_a_grippy_road_the_estimator_says_that_it_knows_only_a_lower_bound():
    estimator = TrpacEstimator(DIFE)
    load_n = CAR.wheel_load(True)
    force = tyre.force(1.0, 0.015, load_n, CAR.longitudinal_stiffness_n, 1.0)
    omega = 10.0 / CAR.wheel_radius_m / (1.0 - 0.015)
    start = estimator.last.TRPAC_std
    estimate = driven(estimator, Sensors(omega, force * CAR.wheel_radius_m, 10.0, load_n), 1.0)
    assert 0.12 < estimate.TRPAC_std < start
    assert abs(estimate.TRPAC - 1.0) < 2.0 * estimate.TRPAC_std


def test_peak_is_the_curves_maximum_not_theta():
    estimate = driven(TrpacEstimator(DIFE), sliding(), 2.0)
    expected = tyre.peak_friction(estimate.TRPAC, CAR.wheel_load(True), CAR.longitudinal_stiffness_n)
    assert estimate.TRPAC_peak == pytest.approx(expected)
    assert estimate.TRPAC_peak > 1.05 * estimate.TRPAC


def test_knowing_grows_with_excitation_and_fades_with_the_way_driven():
    estimator = TrpacEstimator(DIFE)
    unknown = estimator.last.TRPAC_std
    pulses = (sliding(slip=0.05 * abs(math.sin(0.01 * row))) for row in range(1500))
    for readings in pulses:
        sure = estimator.step(0.001, readings).TRPAC_std
    later = driven(estimator, CRUISE, 2.0).TRPAC_std
    assert sure < 0.3 * unknown
    assert sure < later <= unknown


def test_rolling_resistance_is_taken_off_the_torque():
    """Without it the force would be read 30 N too high, and theta with it."""
    told = TrpacEstimator(replace(DIFE, vehicle=replace(CAR, rolling_resistance=0.01)))
    readings = sliding()
    torque = readings.wheel_torque_nm + 0.01 * CAR.wheel_load(True) * CAR.wheel_radius_m
    assert driven(told, replace(readings, wheel_torque_nm=torque), 2.0).TRPAC == pytest.approx(0.3, abs=0.003)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"wheel_speed_rad_s": NAN}, "wheel_speed_rad_s"),
        ({"wheel_torque_nm": INF}, "wheel_torque_nm"),
        ({"vehicle_speed_m_s": -INF}, "vehicle_speed_m_s"),
        ({"vertical_load_n": NAN}, "vertical_load_n"),
        ({"vertical_load_n": -100.0}, "vertical_load_n"),
        ({"longitudinal_acceleration_m_s2": 1e300}, "longitudinal_acceleration_m_s2"),
        ({"yaw_rate_rad_s": NAN}, "yaw_rate_rad_s"),
        ({"steering_angle_rad": 400.0}, "steering_angle_rad"),
        ({"vehicle_speed_m_s": -5.0, "wheel_speed_rad_s": -17.0}, "backwards"),
        ({"wheel_speed_rad_s": -30.0}, "wheel_speed_rad_s"),
    ],
)
def test_unusable_readings_hold_the_last_estimate_and_say_why(change, named):
    estimator = TrpacEstimator(DIFE)
    good = driven(estimator, sliding(), 0.5, RoadClass(Surface.SNOW_ICE, 0.9))
    held = estimator.step(0.001, replace(sliding(), **change))
    assert named in held.problem
    assert held.TRPAC == good.TRPAC
    assert not held.flag
    assert not held.excitation_flag
    back = driven(estimator, sliding(), 0.5)
    assert back.problem is None
    assert back.TRPAC == pytest.approx(0.3, abs=0.003)


@pytest.mark.parametrize("step_s", [NAN, INF, -0.001])
def test_an_impossible_step_size_is_said_and_held(step_s):
    estimator = TrpacEstimator(DIFE)
    assert "Step size" in estimator.step(step_s, CRUISE).problem
    assert estimator.step(0.001, CRUISE).problem is None


def test_the_road_goes_on_under_a_gap_in_the_readings():
    """A class 2.5 m ahead arrives on time although the readings fail on the way."""
    estimator = TrpacEstimator(DIFE)
    driven(estimator, CRUISE, 0.1, RoadClass(Surface.WET, 0.9))
    for _ in range(100):
        estimator.step(0.001, replace(CRUISE, wheel_torque_nm=NAN))
    assert driven(estimator, CRUISE, 0.06).flag


def test_zero_step_lets_no_time_pass():
    estimator = TrpacEstimator(DIFE)
    driven(estimator, sliding(), 0.2)
    before = estimator.step(0.0, sliding())
    for _ in range(50):
        again = estimator.step(0.0, sliding())
    assert again == before


def test_a_failed_frame_lowers_the_flag_until_a_good_one_comes():
    estimator = TrpacEstimator(DIFE)
    driven(estimator, CRUISE, 0.26, RoadClass(Surface.WET, 0.9))
    assert estimator.last.flag
    estimator.step(0.001, CRUISE, frame_failed=True)
    assert not driven(estimator, CRUISE, 0.05).flag
    assert estimator.step(0.001, CRUISE, RoadClass(Surface.WET, 0.9)).flag


def test_standstill_and_launch_raise_no_alarm():
    estimator = TrpacEstimator(DIFE)
    estimate = driven(estimator, Sensors(0.0, 200.0, 0.0), 1.0)
    assert not estimate.excitation_flag
    assert estimate.TRPAC == EstimatorConfig().theta_initial
    assert estimate.problem is None


def test_state_survives_json_bit_by_bit():
    first, second = (TrpacEstimator(DIFE) for _ in range(2))
    driven(first, sliding(), 0.123, RoadClass(Surface.SNOW_ICE, 0.77))
    second.restore(json.loads(json.dumps(first.state())))
    noise = np.random.default_rng(3)
    for _ in range(300):
        readings = replace(sliding(), vehicle_speed_m_s=10.0 + 0.01 * noise.standard_normal())
        assert first.step(0.001, readings) == second.step(0.001, readings)


@settings(max_examples=40)
@example([(0.0, 0.0, 0.0, step_s, None) for step_s in (*(0.0,) * 10, 0.002, 0.002)])
@given(
    st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True),
            st.floats(allow_nan=True, allow_infinity=True),
            st.floats(allow_nan=True, allow_infinity=True),
            st.floats(-1.0, 10.0),
            st.one_of(st.none(), st.floats(-1e9, 1e9)),
        ),
        max_size=12,
    )
)
def test_nothing_that_arrives_raises_or_spoils_the_estimate(readings):
    estimator = TrpacEstimator(DIFE)
    for omega, torque, speed, step_s, load in readings:
        estimate = estimator.step(step_s, Sensors(omega, torque, speed, vertical_load_n=load))
        assert 0.0 < estimate.TRPAC <= 1.2
        assert math.isfinite(estimate.TRPAC_std)
        assert math.isfinite(estimate.tyre_force_n)
    assert driven(estimator, sliding(), 3.0).TRPAC == pytest.approx(0.3, abs=0.01)


def test_a_locked_wheel_is_not_a_fault():
    """Its speed reads 0 give or take the sensor's noise."""
    estimator = TrpacEstimator(DIFE)
    noise = np.random.default_rng(2).normal(0.0, 0.01, 500)
    for omega in noise:
        load_n = CAR.wheel_load(True)
        torque = -0.79 * 0.3 * load_n * CAR.wheel_radius_m
        assert estimator.step(0.001, Sensors(float(omega), torque, 20.0, load_n)).problem is None


@pytest.mark.parametrize("hold", [1, 10, 50])
def test_load_follows_a_speed_that_is_updated_more_rarely_than_the_unit_steps(hold):
    """A bus of 100 or 20 Hz under a host of 1 kHz: differentiated, it must still give the mean acceleration."""
    estimator = TrpacEstimator(DIFE)
    found = []
    for row in range(2000):
        speed = 5.0 + 3.0 * (row // hold * hold) * 1e-3
        estimator.step(0.001, Sensors(speed / 0.29, 100.0, speed))
        found.append(estimator.state()["state"]["acceleration_m_s2"])
    assert np.mean(found[1000:]) == pytest.approx(3.0, abs=0.2)


def test_a_frame_that_comes_with_unusable_readings_is_not_lost():
    estimator = TrpacEstimator(DIFE)
    driven(estimator, CRUISE, 0.05)
    estimator.step(0.001, replace(CRUISE, wheel_torque_nm=NAN), RoadClass(Surface.WET, 0.9))
    assert driven(estimator, CRUISE, 0.26).flag


def test_under_a_gap_the_speed_that_can_be_read_counts():
    """Braking from 20 to 5 m/s while the torque is missing: the way driven is that of the speed."""
    estimator = TrpacEstimator(DIFE)
    driven(estimator, Sensors(20.0 / 0.29, 0.0, 20.0), 0.01)
    before = estimator.state()["state"]["position_m"]
    unknown = estimator.last.TRPAC_std
    speeds = np.linspace(20.0, 5.0, 2000)
    for speed in speeds:
        held = estimator.step(0.001, Sensors(speed / 0.29, NAN, speed))
    assert estimator.state()["state"]["position_m"] - before == pytest.approx(speeds.sum() * 0.001)
    assert held.TRPAC_std >= unknown


def test_a_failed_frames_own_road_has_no_flag_either():
    """The next good frame speaks of the road beyond its own stamp, not of what the failed one would have shown."""
    estimator = TrpacEstimator(DIFE)
    driven(estimator, CRUISE, 0.2, RoadClass(Surface.WET, 0.9))
    estimator.step(0.001, CRUISE, frame_failed=True)
    driven(estimator, CRUISE, 0.099)
    assert driven(estimator, CRUISE, 0.1, RoadClass(Surface.WET, 0.9)).flag
    flags = [estimator.step(0.001, CRUISE).flag for _ in range(300)]
    # 2.5 m at 10 m/s after the failed frame, 0.1 m before the next one's stamp
    assert flags.index(False) == pytest.approx(50, abs=5)
    assert flags[60:140] == [False] * 80
    assert flags[170]


def test_zero_step_keeps_the_guards_against_noise():
    estimator = TrpacEstimator(DIFE)
    ordinary = driven(estimator, CRUISE, 0.1)
    assert estimator.step(0.0, CRUISE).excitation_threshold == pytest.approx(ordinary.excitation_threshold)
