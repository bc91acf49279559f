"""The units with each method: outputs as of the core, states resume, a wrong description is logged once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from fmu_unit import Unit

from fmu_src.estimate_outputs import OF_ESTIMATE
from fmu_src.interface import TRPAC_ESTIMATOR
from fmu_src.interface_4w import TRPAC_ESTIMATOR_4W
from fmu_src.settings import PARAMETERS
from fmu_src.signals import INPUTS, INTERVAL_OUTPUTS, OUTPUTS
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.four_wheels import CarSensors, FourWheels, FourWheelsConfig, SideClasses
from trpac_core.robust.messages import WRONG_INPUT
from trpac_core.sensors import Sensors
from trpac_core.vehicle import WHEELS
from trpac_core.vision.classes import Surface

Open = Callable[..., Unit]
WARNING = 1
STEP_S = 0.01
RADIUS_M = 0.29


def drive(steps: int, radius_m: float = RADIUS_M) -> Iterator[dict[str, float | int]]:
    """Inputs of a wheel on ice: slip and torque follow a pedal, a class comes every 0.2 s."""
    rng = np.random.default_rng(5)
    for row in range(steps):
        slip = 0.03 * math.sin(0.02 * row)
        used = 0.2 * math.tanh(60.0 * slip)
        yield {
            "wheel_speed": 12.0 / radius_m * (1.0 + slip) + 0.01 * rng.standard_normal(),
            "wheel_torque": used * 3400.0 * radius_m,
            "vehicle_speed": 12.0 + 0.003 * rng.standard_normal(),
            "road_class": int(Surface.SNOW_ICE) if row % 20 == 0 else -1,
            "road_class_confidence": 0.9,
            "vertical_load": 3400.0,
        }


def test_the_new_outputs_move_no_value_reference_of_the_old_ones() -> None:
    assert TRPAC_ESTIMATOR == (*INPUTS, *OUTPUTS, *PARAMETERS, *INTERVAL_OUTPUTS)
    new = {v.name for v in INTERVAL_OUTPUTS}
    names = [v.name.partition(".")[0] for v in TRPAC_ESTIMATOR_4W]
    assert new.isdisjoint(names[: -5 * len(INTERVAL_OUTPUTS)])
    assert set(names[-5 * len(INTERVAL_OUTPUTS) :]) == new


@pytest.mark.e2e
@pytest.mark.parametrize("method", Method)
def test_each_output_is_the_estimators_bit_by_bit(open_unit: Open, method: Method) -> None:
    unit = open_unit(estimator__method=method.value)
    estimator = TrpacEstimator(EstimatorConfig(method=method))
    for values in drive(300):
        unit.step(values, step_s=STEP_S)
        frame = RoadClass(Surface.SNOW_ICE, 0.9) if values["road_class"] >= 0 else None
        readings = (
            values[name] for name in ("wheel_speed", "wheel_torque", "vehicle_speed", "vertical_load")
        )
        estimate = estimator.step(STEP_S, Sensors(*readings), frame)
        assert unit.outputs() == {name: of(estimate) for name, of in OF_ESTIMATE.items()}
    assert unit.get("TRPAC_low") <= unit.get("TRPAC") < unit.get("TRPAC_high")
    assert unit.get("TRPAC_source") == estimate.source > 0
    assert len(unit.log) == len(estimator.messages())


@pytest.mark.e2e
@pytest.mark.parametrize("method", Method)
def test_each_output_of_the_four_is_the_estimators_bit_by_bit(open_4w: Open, method: Method) -> None:
    unit = open_4w(estimator__method=method.value)
    config = FourWheelsConfig(wheel=EstimatorConfig(method=method))
    four = FourWheels(config)
    for values in drive(200):
        by_name, classes = {}, None
        for name, value in values.items():
            of = ("left", "right") if name.startswith("road_class") else WHEELS
            by_name |= {f"{name}.{part}": value for part in (of if name != "vehicle_speed" else ())}
        unit.step(by_name | {"vehicle_speed": values["vehicle_speed"]}, step_s=STEP_S)
        if values["road_class"] >= 0:
            classes = SideClasses(*[RoadClass(Surface.SNOW_ICE, 0.9)] * 2)
        omega, torque, speed, load_n = (
            values[name] for name in ("wheel_speed", "wheel_torque", "vehicle_speed", "vertical_load")
        )
        estimate = four.step(STEP_S, CarSensors((omega,) * 4, (torque,) * 4, speed, (load_n,) * 4), classes)
    shown = unit.outputs()
    for wheel, one in zip(WHEELS, estimate.wheels, strict=True):
        assert {name: shown[f"{name}.{wheel}"] for name in OF_ESTIMATE} == {
            name: of(one) for name, of in OF_ESTIMATE.items()
        }
    for v in INTERVAL_OUTPUTS:
        assert shown[f"{v.name}.vehicle"] == OF_ESTIMATE[v.name](estimate)


@pytest.mark.e2e
@pytest.mark.parametrize("method", [Method.AS_PRINTED, Method.ROBUST])
def test_a_state_saved_in_mid_run_goes_on_bit_by_bit(open_unit: Open, method: Method) -> None:
    settings = {"estimator__method": method.value}
    first, other = open_unit(**settings), open_unit(**settings)
    inputs = list(drive(400))
    for values in inputs[:237]:
        first.step(values, step_s=STEP_S)
    state = first.slave.getFMUstate()
    saved = first.slave.serializeFMUstate(state)
    first.slave.freeFMUstate(state)
    other.slave.setFMUstate(other.slave.deSerializeFMUstate(saved))
    for values in inputs[237:]:
        for unit in (first, other):
            unit.step(values, step_s=STEP_S)
        assert first.outputs() == other.outputs()
    assert all("vehicle.yaml" in line.text for unit in (first, other) for line in unit.log)


@pytest.mark.e2e
def test_readings_that_are_no_numbers_leave_an_interval(open_unit: Open) -> None:
    unit = open_unit(estimator__method=Method.ROBUST.value)
    for row, values in enumerate(drive(200)):
        wrong = {"wheel_speed": math.nan} if 100 <= row < 120 else {}
        unit.step(values | wrong, step_s=STEP_S)
        outputs = unit.outputs()
        assert all(map(math.isfinite, outputs.values()))
        assert 0.0 <= outputs["TRPAC_low"] <= outputs["TRPAC"] <= outputs["TRPAC_high"]
    assert [line.status for line in unit.log] == [WARNING]


@pytest.mark.e2e
def test_a_wheel_of_another_radius_is_logged_once(open_unit: Open) -> None:
    unit = open_unit(estimator__method=Method.ROBUST.value)
    for values in drive(600, radius_m=1.03 * RADIUS_M):
        unit.step(values, step_s=STEP_S)
    about = [line for line in unit.log if "wheel_radius_m" in line.text]
    assert [line.status for line in about] == [WARNING]
    assert "Front wheels do not have the expected radius" in about[0].text


@pytest.mark.e2e
def test_a_slip_that_no_radius_explains_is_said_as_in_python(open_unit: Open) -> None:
    unit = open_unit(estimator__method=Method.ROBUST.value)
    for values in drive(600, radius_m=1.08 * RADIUS_M):
        unit.step(values, step_s=STEP_S)
    said = [line.text for line in unit.log if line.text.endswith(WRONG_INPUT)]
    assert any("Front wheels slip without force, which no radius explains: " in text for text in said)
    assert not any("wheel_radius_m" in line.text for line in unit.log)


@pytest.mark.e2e
@pytest.mark.parametrize("number", [-1, 3])
def test_a_number_of_no_method_is_refused(open_unit: Open, number: int) -> None:
    unit = open_unit(estimator__method=number)
    assert len(unit.log) == 1
    assert f"estimator.method = {number}, expected a number from 0 to 2" in unit.log[0].text
