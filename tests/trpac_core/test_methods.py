"""The three methods of the estimator: bounds on all inputs, state, source, and a wrong description of the car."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from trpac_core import tyre
from trpac_core.car_friction import Friction, car_friction
from trpac_core.errors import TrpacError
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method, Source
from trpac_core.four_wheels import CarSensors, FourWheels, FourWheelsConfig
from trpac_core.robust.messages import LASTING_S, WRONG_INPUT
from trpac_core.sensors import Sensors
from trpac_core.vehicle import Vehicle
from trpac_core.vision.classes import Surface

CAR = Vehicle()
LOAD_N = CAR.wheel_load(True)
SPEED_M_S = 12.0
ICE = RoadClass(Surface.SNOW_ICE, 0.9)
TOLD = "told"


def make(method, **settings):
    return TrpacEstimator(EstimatorConfig(method=method, **settings))


def friction(curve, theta, slip):
    """Used friction of the told tyre, or of a magic formula with an initial slope over the load."""
    if curve == TOLD:
        return tyre.force(theta, slip, LOAD_N, CAR.longitudinal_stiffness_n, 1.0) / LOAD_N
    return theta * math.sin(1.65 * math.atan(curve * slip / (1.65 * theta)))


def pedal_drive(seconds, theta=0.3, curve=TOLD, radius_m=CAR.wheel_radius_m, step_s=0.01, seed=1, most=0.04):
    """Readings of a wheel whose slip follows a pedal that is pressed and braked, with the noise of the sensors."""
    rng = np.random.default_rng(seed)
    for time_s in np.arange(0.0, seconds, step_s):
        slip = most * math.sin(2.0 * time_s)
        used = math.copysign(friction(curve, theta, abs(slip)), slip)
        omega = SPEED_M_S / radius_m * (1.0 / (1.0 - slip) if slip > 0.0 else 1.0 + slip)
        yield Sensors(
            omega + 0.01 * rng.standard_normal(),
            used * LOAD_N * radius_m,
            SPEED_M_S + 0.003 * rng.standard_normal(),
            vertical_load_n=LOAD_N,
        )


def over(estimator, readings, step_s=0.01):
    return [estimator.step(step_s, sensors) for sensors in readings]


def assert_bounded(estimate):
    numbers = [value for value in estimate[:-1] if not isinstance(value, bool)]
    assert all(map(math.isfinite, numbers)), estimate
    assert 0.0 <= estimate.TRPAC_low <= estimate.TRPAC <= estimate.TRPAC_high, estimate
    assert estimate.TRPAC_low <= estimate.TRPAC_expected <= estimate.TRPAC_high
    assert estimate.TRPAC_expected_std >= 0.0
    assert estimate.source in Source


def test_a_wrong_name_is_one_error_with_the_names_there_are():
    assert [Method.of(method.label) for method in Method] == list(Method)
    with pytest.raises(TrpacError, match=r"is 'robbust'; expected one of as_printed, dife, robust\.$"):
        Method.of("robbust")


STEPS = {
    "1 ms": lambda rng: 0.001,
    "10 ms": lambda rng: 0.01,
    "50 ms": lambda rng: 0.05,
    "irregular": lambda rng: float(rng.choice([0.0, 0.0007, 0.004, 0.013, 0.05, 0.2, 9.9])),
}


@pytest.mark.parametrize("front", [True, False])
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("method", Method)
def test_the_interval_holds_the_estimate_at_all_steps(method, step, front):
    estimator, rng = make(method, front_axle=front), np.random.default_rng(3)
    for row, sensors in enumerate(pedal_drive(6.0)):
        frame = RoadClass(Surface(row // 20 % 3), 0.9) if row % 20 == 0 else None
        assert_bounded(estimator.step(STEPS[step](rng), sensors, frame))


NAN, CRUISE = math.nan, Sensors(SPEED_M_S / CAR.wheel_radius_m, 0.0, SPEED_M_S)
STRANGE = {
    "no number": [replace(CRUISE, wheel_speed_rad_s=NAN), replace(CRUISE, vehicle_speed_m_s=math.inf)],
    "standstill": [Sensors(0.0, 0.0, 0.0), Sensors(0.0, -500.0, 0.0)],
    "locked": [Sensors(0.0, -1500.0, SPEED_M_S), Sensors(0.05, -1500.0, SPEED_M_S)],
    "spinning": [Sensors(200.0, 800.0, 2.0)],
    "backwards": [Sensors(-10.0, -100.0, -2.9)],
    "braking": [Sensors(0.95 * SPEED_M_S / CAR.wheel_radius_m, -900.0, SPEED_M_S, vertical_load_n=LOAD_N)],
}


@pytest.mark.parametrize("what", STRANGE)
@pytest.mark.parametrize("method", Method)
def test_strange_readings_leave_numbers_and_an_interval(method, what):
    estimator = make(method)
    over(estimator, pedal_drive(1.0))
    for row in range(300):
        estimate = estimator.step(
            0.01, STRANGE[what][row % len(STRANGE[what])], ICE if row % 50 == 0 else None
        )
        assert_bounded(estimate)
        assert (estimate.problem is not None) == (what in ("no number", "backwards"))
    for estimate in over(estimator, pedal_drive(1.0)):
        assert_bounded(estimate)


@pytest.mark.parametrize("method", Method)
def test_after_a_step_that_nobody_knows_the_way_of_nothing_is_known(method):
    estimator = make(method)
    over(estimator, pedal_drive(3.0))
    estimate = estimator.step(1e9, CRUISE)
    assert_bounded(estimate)
    assert estimate.source is Source.NONE
    begun = make(method).last
    assert estimate.TRPAC_high - estimate.TRPAC_low >= 0.9 * (begun.TRPAC_high - begun.TRPAC_low)


@pytest.mark.parametrize("cut", [1, 150, 237])
@pytest.mark.parametrize("method", Method)
def test_a_state_in_mid_run_repeats_it_bit_by_bit(method, cut):
    frames = {0: ICE, 120: RoadClass(Surface.DRY, 0.8), 200: RoadClass(Surface.WET, 0.3)}

    def steps(estimator, begin, end):
        drive = list(pedal_drive(4.0, curve=20.0, radius_m=1.01 * CAR.wheel_radius_m))
        drive[160] = replace(drive[160], wheel_speed_rad_s=NAN)
        return [
            (estimator.step(0.01, drive[row], frames.get(row)), estimator.messages())
            for row in range(begin, end)
        ]

    whole = make(method)
    steps(whole, 0, cut)
    saved = json.dumps(whole.state(), allow_nan=False)
    rest = steps(whole, cut, 400)
    resumed = make(method)
    resumed.restore(json.loads(saved))
    assert steps(resumed, cut, 400) == rest
    assert resumed.state() == whole.state()


# What an estimate rests on


def under(estimator, road_class, readings):
    """Sources of the estimates over readings under a class."""
    return [
        estimator.step(0.01, sensors, road_class if row % 5 == 0 else None).source
        for row, sensors in enumerate(readings)
    ]


@pytest.mark.parametrize("method", [Method.DIFE, Method.ROBUST])
def test_the_source_is_the_tyre_once_it_slid_until_another_class_stands(method):
    estimator, coasting = make(method), [CRUISE] * 300
    assert estimator.step(0.01, CRUISE).source is Source.NONE
    assert over(estimator, pedal_drive(2.0))[-1].source is Source.TYRE
    assert over(estimator, coasting)[-1].source is Source.TYRE, "nobody has seen another road"
    assert under(estimator, ICE, coasting)[-1] is Source.CAMERA
    assert under(estimator, ICE, pedal_drive(2.0))[-1] is Source.BOTH
    assert under(estimator, ICE, coasting)[-1] is Source.BOTH
    assert under(estimator, RoadClass(Surface.DRY, 0.9), coasting)[-1] is Source.CAMERA
    assert estimator.step(0.01, replace(CRUISE, wheel_speed_rad_s=NAN)).source is Source.NONE


def test_as_printed_it_remembers_no_road():
    estimator = make(Method.AS_PRINTED)
    sources = {estimate.source for estimate in over(estimator, pedal_drive(2.0, most=0.1))}
    assert sources == {Source.NONE, Source.TYRE}
    assert estimator.step(0.01, CRUISE).source is Source.NONE


# A car that differs from its description


def messages_of(seconds=8.0, method=Method.ROBUST, front=True, **drive):
    estimator = make(method, front_axle=front)
    over(estimator, pedal_drive(seconds, **drive))
    return estimator.messages()


@pytest.mark.parametrize("theta", [0.2, 0.3, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_a_car_as_told_is_not_talked_of(theta, seed):
    assert messages_of(theta=theta, seed=seed) == {}


def test_a_tyre_of_another_curve_is_named_with_its_stiffness():
    """A magic formula of a third of the described slope: 22 kN per unit slip."""
    (about, text), *others = messages_of(curve=6.5, theta=0.3, most=0.1).items()
    assert not others
    assert about == "Front tyres"
    learnt = float(text.split("estimated ")[1].split(" kN")[0])
    assert learnt == pytest.approx(6.5 * LOAD_N / 1000.0, rel=0.25)
    assert "expected 64 kN (1.27 C_x)" in text
    assert f"at {LOAD_N / 1000.0:.1f} kN load" in text
    assert "adjust tyre.longitudinal_stiffness_n in vehicle.yaml" in text


@pytest.mark.parametrize("share", [1.08, 1.12])
def test_a_radius_that_no_wheel_has_is_called_a_wrong_reading(share):
    messages = messages_of(radius_m=share * CAR.wheel_radius_m)
    assert (
        messages["Front wheels"]
        == f"Front wheels slip without force, which no radius explains: {WRONG_INPUT}"
    )
    assert not any("djust" in text for text in messages.values())


@pytest.mark.parametrize(("share", "front"), [(1.015, True), (0.985, False)])
def test_a_wheel_of_another_radius_is_named_with_its_radius(share, front):
    messages = messages_of(radius_m=share * CAR.wheel_radius_m, front=front)
    text = messages["Front wheels" if front else "Rear wheels"]
    learnt_m = float(text.split("as of a radius of ")[1].split(" m")[0])
    assert learnt_m == pytest.approx(share * CAR.wheel_radius_m, rel=0.003)
    assert "Adjust wheel_radius_m in vehicle.yaml" in text


def test_no_message_comes_before_its_time_and_none_as_printed():
    assert messages_of(seconds=0.9 * LASTING_S, radius_m=1.02 * CAR.wheel_radius_m, curve=6.5, most=0.1) == {}
    assert messages_of(method=Method.AS_PRINTED, radius_m=1.02 * CAR.wheel_radius_m) == {}


# Four wheels


@pytest.mark.parametrize("method", Method)
def test_the_cars_interval_follows_the_rule_of_its_estimate(method):
    wheel = replace(FourWheelsConfig().wheel, method=method)
    four = FourWheels(replace(FourWheelsConfig(), wheel=wheel))
    left, right = pedal_drive(2.0, theta=0.2), pedal_drive(2.0, theta=0.6, seed=2)
    for one, other in zip(left, right, strict=True):
        omega = tuple(w.wheel_speed_rad_s for w in (one, other, one, other))
        torque = tuple(w.wheel_torque_nm for w in (one, other, one, other))
        said = four.step(0.01, CarSensors(omega, torque, SPEED_M_S, (LOAD_N,) * 4))
        assert 0.0 <= said.TRPAC_low <= said.TRPAC <= said.TRPAC_high
    fl, fr, rl, rr = said.wheels
    for bound in ("TRPAC_low", "TRPAC_high"):
        wheels = [Friction(getattr(w, bound), w.TRPAC_std) for w in (fl, fr, rl, rr)]
        assert getattr(said, bound) == car_friction(tuple(wheels), (LOAD_N,) * 4, 0.08).theta
    wheels = [Friction(w.TRPAC_expected, w.TRPAC_expected_std) for w in (fl, fr, rl, rr)]
    expected = car_friction(tuple(wheels), (LOAD_N,) * 4, 0.08)
    assert (said.TRPAC_expected, said.TRPAC_expected_std) == expected
    assert said.source == fl.source | fr.source | rl.source | rr.source
    again = FourWheels(replace(FourWheelsConfig(), wheel=wheel))
    again.restore(json.loads(json.dumps(four.state())))
    assert again.last == said


def test_each_axle_is_talked_of_once():
    four = FourWheels(
        replace(FourWheelsConfig(), wheel=replace(FourWheelsConfig().wheel, method=Method.ROBUST))
    )
    for one in pedal_drive(6.0, radius_m=1.02 * CAR.wheel_radius_m):
        four.step(
            0.01,
            CarSensors((one.wheel_speed_rad_s,) * 4, (one.wheel_torque_nm,) * 4, SPEED_M_S, (LOAD_N,) * 4),
        )
    assert {"Front wheels", "Rear wheels"} <= set(four.messages())
