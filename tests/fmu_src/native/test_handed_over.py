"""A state that Python has brought so far goes on in C, and back, as if nobody had changed."""

import dataclasses
import json

import numpy as np
import pytest
from long import beyond
from native_calls import bits, build
from native_drives import IMPOSSIBLE_STEPS_S, ODD_STEPS_S, SIDES, WHEELS, drive

from fmu_src.native.build import NATIVE_UNITS
from fmu_src.native.estimator import estimator_program
from trpac_core import estimator, four_wheels
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import EstimatorState, Method, RoadClass
from trpac_core.four_wheels import CarSensors, FourWheels, FourWheelsConfig, SideClasses
from trpac_core.sensors import Sensors
from trpac_core.vision.classes import Surface

IN_C = {
    estimator: ("unusable_input", "rates_of", "outcome_of", "stepped", "held"),
    four_wheels: ("wheel_speeds", "car_loads", "car_claim"),
}
"""Functions that the native units call in C, by the module that calls them in Python."""
STEPS, TURN = 900, 30
"""Steps of a drive, and how many of them are a turn; C, which is handed the state at each step, has every third."""
UNKNOWN_CLASSES = (7, -5)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    program = estimator_program()
    for unit in NATIVE_UNITS.values():
        for function in unit.functions:
            program.require(function)
    return build(program, tmp_path_factory.mktemp("c"))


@pytest.fixture
def in_c(library, monkeypatch):
    """Has the estimators call C from now on, or Python again."""
    python = {(module, name): getattr(module, name) for module, names in IN_C.items() for name in names}

    def called(function):
        def call(*arguments):
            returned = library.call(function, *arguments)
            if isinstance(arguments[0], EstimatorState):
                preview = arguments[0].preview
                for name in (field.name for field in dataclasses.fields(preview)):
                    value = getattr(preview, name)
                    if isinstance(value, np.ndarray):  # a list goes to C and comes back as an array
                        setattr(preview, name, value.tolist())
            return returned

        return call

    def turn(c):
        for (module, name), function in python.items():
            monkeypatch.setattr(module, name, called(function) if c else function)

    return turn


def one_wheel(method):
    return TrpacEstimator(EstimatorConfig(method=method))


def four(method):
    return FourWheels(FourWheelsConfig(EstimatorConfig(method=method)))


def road_class(values, side=""):
    surface = values.get(f"road_class{side}")
    known = surface in list(Surface)
    return RoadClass(Surface(surface), values[f"road_class_confidence{side}"]) if known else None


def inputs_of_one(held, values):
    return Sensors(
        *(held[name] for name in ("wheel_speed", "wheel_torque", "vehicle_speed")),
        held.get("vertical_load"),
        held.get("steering_angle", 0.0),
        held.get("longitudinal_acceleration"),
        held.get("yaw_rate"),
    ), road_class(values)


def inputs_of_four(held, values):
    speeds, torques, loads = (
        tuple(held.get(f"{name}{wheel}") for wheel in WHEELS)
        for name in ("wheel_speed", "wheel_torque", "vertical_load")
    )
    sensors = CarSensors(
        speeds,
        torques,
        held["vehicle_speed"],
        loads,
        held.get("steering_angle", 0.0),
        held.get("longitudinal_acceleration"),
        held.get("lateral_acceleration"),
        held.get("yaw_rate"),
    )
    classes = [road_class(held if f"road_class{side}" in values else {}, side) for side in SIDES]
    return sensors, SideClasses(*classes) if any(classes) else None


@pytest.mark.parametrize("method", list(Method), ids=lambda method: method.label)
@pytest.mark.parametrize(
    ("made", "inputs", "ends"),
    beyond(1, [(one_wheel, inputs_of_one, ()), (four, inputs_of_four, (WHEELS, SIDES))]),
)
def test_python_and_c_by_turns_give_what_python_alone_does(in_c, made, inputs, ends, method):
    alone, by_turns, held = made(method), made(method), {}
    seen = []
    for step, (values, step_s) in enumerate(
        drive(method.value + 1, STEPS, *ends, odd_steps_s=(*ODD_STEPS_S, *IMPOSSIBLE_STEPS_S))
    ):
        held |= values
        if step % TURN == 0:  # as a unit that is saved, and one that goes on from there
            saved = json.dumps(by_turns.state())
            assert saved == json.dumps(alone.state()), step
            by_turns = made(method)
            by_turns.restore(json.loads(saved))
        sensors, frame = inputs(held, values)
        failed = any(values.get(f"road_class{side}") in UNKNOWN_CLASSES for side in ("", *SIDES))
        expected = alone.step(step_s, sensors, frame, frame_failed=failed)
        in_c(step // TURN % 3 == 1)
        said = by_turns.step(step_s, sensors, frame, frame_failed=failed)
        in_c(False)
        assert bits(said) == bits(expected), step
        seen += [expected] if made is one_wheel else expected.wheels
    assert len({one.slip for one in seen}) > STEPS / 4
    assert {one.flag for one in seen} == {False, True}
    assert len({one.TRPAC for one in seen}) > 1
