"""The unit of four wheels under a real client."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from fmu_unit import STEP_S, Unit

from fmu_src.interface import TRPAC_ESTIMATOR
from fmu_src.interface_4w import PER_SIDE, PER_WHEEL, SIDES, TRPAC_ESTIMATOR_4W, WHICH_WHEEL
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from trpac_core.estimator import RoadClass
from trpac_core.files import file_sha256
from trpac_core.four_wheels import CarSensors, FourWheels, FourWheelsConfig, SideClasses
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.fields import field_value
from trpac_core.vehicle import WHEELS
from trpac_core.vision.classes import Surface
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.sides import SidesIfe

Open = Callable[..., Unit]

MODELS = Path(__file__).parents[2] / "models"
WARNING = 1
OMEGA, TORQUE = (53.0, 52.8, 53.1, 52.9), (250.0, 260.0, 240.0, 255.0)
SPLIT = {
    "road_class.left": int(Surface.SNOW_ICE),
    "road_class.right": int(Surface.DRY),
    "road_class_confidence.left": 0.9,
    "road_class_confidence.right": 0.8,
}
DRIVING = {
    **{f"wheel_speed.{wheel}": value for wheel, value in zip(WHEELS, OMEGA, strict=True)},
    **{f"wheel_torque.{wheel}": value for wheel, value in zip(WHEELS, TORQUE, strict=True)},
    "vehicle_speed": 15.0,
    "longitudinal_acceleration": 2.0,
}


@pytest.mark.e2e
def test_validation_finds_no_problem_and_the_same_sources_give_the_same_bytes(tmp_path: Path) -> None:
    first, second = (
        build_unit(UNITS["TrpacEstimator4W"], tmp_path / name) for name in ("TrpacEstimator4W.fmu", "b.fmu")
    )
    assert validate_fmu(str(first)) == []
    assert file_sha256(first) == file_sha256(second)


def test_variables_are_those_of_one_wheel_at_each_wheel_and_side() -> None:
    names = {v.name for v in TRPAC_ESTIMATOR_4W}
    assert len(names) == len(TRPAC_ESTIMATOR_4W)
    for v in TRPAC_ESTIMATOR:
        if v.name in PER_WHEEL or v.causality == "output":
            expected = {f"{v.name}.{wheel}" for wheel in WHEELS}
        elif v.name in PER_SIDE:
            expected = {f"{v.name}.{side}" for side in SIDES}
        else:
            expected = set() if v.name in WHICH_WHEEL else {v.name}
        assert expected <= names
        names -= expected
    assert names == {
        "lateral_acceleration",
        "TRPAC.vehicle",
        "TRPAC_std.vehicle",
        "TRPAC_low.vehicle",
        "TRPAC_high.vehicle",
        "TRPAC_expected.vehicle",
        "TRPAC_expected_std.vehicle",
        "TRPAC_source.vehicle",
        "estimator.axle_deviation",
    }


def test_parameters_reach_their_fields() -> None:
    starts = {v.name: v.start for v in TRPAC_ESTIMATOR_4W}
    assert configuration(TRPAC_ESTIMATOR_4W, starts, FourWheelsConfig()) == FourWheelsConfig()
    changed = starts | {"vehicle.mass": 1500.0, "estimator.axle_deviation": 0.2}
    config = configuration(TRPAC_ESTIMATOR_4W, changed, FourWheelsConfig())
    assert field_value(config, "wheel.vehicle.mass_kg") == 1500.0
    assert config.axle_deviation == 0.2


def test_every_setting_of_the_four_is_a_parameter() -> None:
    own = {f.name for f in fields(FourWheelsConfig) if not is_dataclass(getattr(FourWheelsConfig(), f.name))}
    assert own <= {v.source for v in TRPAC_ESTIMATOR_4W}


@pytest.mark.e2e
def test_unit_and_estimators_agree_bit_by_bit_with_classes_and_with_a_picture(
    open_4w: Open, tmp_path: Path
) -> None:
    import cv2
    import numpy as np

    picture = tmp_path / "frame.png"
    noise = np.random.default_rng(1).integers(60, 200, (1200, 1920, 3), dtype=np.uint8)
    cv2.imwrite(str(picture), noise)
    config = FourWheelsConfig()
    networks = (Segmenter(MODELS / "segmenter.onnx"), SurfaceClassifier(MODELS / "surface.onnx"))
    four, unit = FourWheels(config, SidesIfe(config.wheel.image_settings, *networks)), open_4w()
    classes = SideClasses(RoadClass(Surface.SNOW_ICE, 0.9), RoadClass(Surface.DRY, 0.8))
    sensors = CarSensors(OMEGA, TORQUE, 15.0, longitudinal_acceleration_m_s2=2.0)
    for _ in range(200):
        unit.step({**DRIVING, **SPLIT})
        four.step(STEP_S, sensors, classes)
    unit.set({"road_class.left": -1, "road_class.right": -1, "image_path": str(picture)})
    for index in range(200):
        unit.step()
        estimate = four.step(STEP_S, sensors, noise if index == 0 else None)
    for wheel, one in zip(WHEELS, estimate.wheels, strict=True):
        assert unit.get(f"TRPAC.{wheel}") == one.TRPAC
        assert unit.get(f"flag.{wheel}") == one.flag
        assert unit.get(f"tyre_force.{wheel}") == one.tyre_force_n
        assert unit.get(f"image_confidence.{wheel}") == one.image_confidence
    assert (unit.get("TRPAC.vehicle"), unit.get("TRPAC_std.vehicle")) == (estimate.TRPAC, estimate.TRPAC_std)
    assert unit.log == []


@pytest.mark.e2e
def test_a_broken_wheel_sensor_is_told_once_and_leaves_the_others(open_4w: Open) -> None:
    healthy, broken = open_4w(), open_4w()
    for unit in (healthy, broken):
        unit.step({**DRIVING, **SPLIT}, count=200)
    broken.set({"wheel_speed.rl": math.nan})
    for unit in (healthy, broken):
        unit.step(count=50)
    assert [line.status for line in broken.log] == [WARNING]
    assert "rl: wheel_speed_rad_s is nan" in broken.log[0].text
    for name, value in healthy.outputs().items():
        if not name.endswith((".rl", ".vehicle")):
            assert broken.get(name) == value
    assert not broken.get("flag.rl")
    assert broken.get("flag.fl")
    broken.step({"wheel_torque.fr": math.inf}, count=5)
    assert len(broken.log) == 2, "another wheel's fault is told too"


@pytest.mark.e2e
def test_a_broken_shared_sensor_holds_all_wheels_and_is_told_once(open_4w: Open) -> None:
    unit = open_4w()
    unit.step({**DRIVING, **SPLIT}, count=200)
    held = [unit.get(f"TRPAC.{wheel}") for wheel in WHEELS]
    unit.step({"vehicle_speed": math.nan}, count=20)
    assert [unit.get(f"TRPAC.{wheel}") for wheel in WHEELS] == held
    assert [line.status for line in unit.log] == [WARNING]
    assert "car: vehicle_speed_m_s" in unit.log[0].text
    assert all(math.isfinite(value) for value in unit.outputs().values())


@pytest.mark.e2e
@pytest.mark.parametrize("wrong", [{"road_class.left": 7}, {"road_class_confidence.right": math.nan}])
def test_a_wrong_class_takes_both_flags_down_until_a_good_one_comes(
    open_4w: Open, wrong: dict[str, float]
) -> None:
    unit = open_4w()
    unit.step({**DRIVING, **SPLIT}, count=250)
    assert all(unit.get(f"flag.{wheel}") for wheel in ("fl", "fr"))
    unit.step(wrong, count=5)
    assert not any(unit.get(f"flag.{wheel}") for wheel in WHEELS)
    assert next(iter(wrong)) in unit.log[0].text
    unit.step(SPLIT)
    assert all(unit.get(f"flag.{wheel}") for wheel in ("fl", "fr"))


@pytest.mark.e2e
def test_restored_state_repeats_the_run_bit_by_bit_camera_memory_included(
    open_4w: Open, tmp_path: Path
) -> None:
    import cv2
    import numpy as np

    unit, other = open_4w(), open_4w(estimator__gamma=1.0)
    for index in range(2):
        picture = tmp_path / f"{index}.png"
        noise = np.random.default_rng(index).integers(60, 200, (1200, 1920, 3), dtype=np.uint8)
        cv2.imwrite(str(picture), noise)
    unit.step({**DRIVING, "lateral_acceleration": 0.5, "image_path": str(tmp_path / "0.png")}, count=50)
    unit.set({"image_path": str(picture)})
    saved = unit.slave.serializeFMUstate(unit.slave.getFMUstate())
    weights = json.loads(saved)["inner"]["estimator"]["camera"]["left"]["weights"]
    assert (
        weights[0] != pytest.approx([1 / 3] * 3)
        or json.loads(saved)["inner"]["estimator"]["camera"]["left"]["frame_count"]
    )

    def run(one: Unit) -> list[dict[str, float | bool]]:
        trace = []
        for index in range(60):
            one.step({"wheel_torque.fl": 100.0 + index, "lateral_acceleration": 0.01 * index})
            trace.append(one.outputs())
        return trace

    first = run(unit)
    other.slave.setFMUstate(other.slave.deSerializeFMUstate(saved))
    assert run(other) == first
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(saved))
    assert run(unit) == first


@pytest.mark.e2e
def test_bad_parameters_are_all_named(open_4w: Open) -> None:
    unit = open_4w(vehicle__mass=-1.0, estimator__axle_deviation=math.nan)
    assert "vehicle.mass" in unit.log[0].text
    assert "estimator.axle_deviation" in unit.log[0].text
