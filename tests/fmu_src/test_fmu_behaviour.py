"""The unit under a real client: inputs good and bad, state, reset, several instances."""

from __future__ import annotations

import ctypes
import json
import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_unit import DRIVING, STEP_S, Unit
from road_picture import road_picture

from trpac_core.estimator import EstimatorConfig, RoadClass
from trpac_core.estimator import TrpacEstimator as Estimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors
from trpac_core.vision.classes import CLASS_THETA, Surface

pytestmark = pytest.mark.e2e

Open = Callable[..., Unit]

REAL_INPUTS = (
    "wheel_speed",
    "wheel_torque",
    "vehicle_speed",
    "road_class_confidence",
    "vertical_load",
    "steering_angle",
    "longitudinal_acceleration",
    "yaw_rate",
)
SLIPPERY = {**DRIVING, "road_class": int(Surface.SNOW_ICE), "road_class_confidence": 0.9}
WARNING, ERROR = 1, 3
TOLD = {"estimator__method": Method.DIFE.value}
"""A method that begins with the estimate that it is told."""


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """A grey road below a bright sky, of the default camera's size."""
    path = tmp_path / "frame.png"
    cv2.imwrite(str(path), road_picture(1920, 1200))
    return path


def flag_up(unit: Unit) -> None:
    """Drive over road that a class from the bus has announced, until the flag is up."""
    unit.step(SLIPPERY, count=250)
    assert unit.get("flag")


def test_unit_and_estimator_agree_bit_by_bit(open_any: Open) -> None:
    unit, estimator = open_any(), Estimator(EstimatorConfig())
    rng = np.random.default_rng(0)
    for _ in range(300):
        wheel, torque, speed = 50.0 + rng.random(), 300.0 * rng.random(), 14.0 + 0.1 * rng.random()
        unit.step({**SLIPPERY, "wheel_speed": wheel, "wheel_torque": torque, "vehicle_speed": speed})
        estimate = estimator.step(STEP_S, Sensors(wheel, torque, speed), RoadClass(Surface.SNOW_ICE, 0.9))
    assert unit.get("TRPAC") == estimate.TRPAC
    assert unit.get("tyre_force") == estimate.tyre_force_n
    assert unit.get("frame_age") == estimate.frame_age_s
    assert unit.get("flag") == estimate.flag
    assert unit.log == []


def test_unconnected_it_runs_and_holds_its_start(open_any: Open) -> None:
    unit = open_any(**TOLD)
    start = unit.outputs()
    unit.step(count=10)
    assert unit.outputs()["TRPAC"] == start["TRPAC"] == 0.8
    assert unit.log == []


def test_parameters_change_the_run(open_any: Open) -> None:
    plain, icy = open_any(**TOLD), open_any(**TOLD, estimator__theta_initial=0.3)
    assert (plain.get("TRPAC"), icy.get("TRPAC")) == (0.8, 0.3)


def test_optional_inputs_count_from_their_first_value_other_than_zero(open_any: Open) -> None:
    static, loaded = open_any(), open_any()
    static.step(DRIVING)
    loaded.step({**DRIVING, "vertical_load": 2000.0})
    assert loaded.get("TRPAC_peak") != static.get("TRPAC_peak")
    loaded.step({"vertical_load": 0.0})
    assert loaded.log[0].status == WARNING
    assert "without load" in loaded.log[0].text


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_optional_input_that_was_no_number_once_is_not_connected_for_it(
    open_any: Open, value: float
) -> None:
    other = open_any()
    other.step({**DRIVING, "vertical_load": 0.0}, count=100)
    unit = open_any()
    unit.step({**DRIVING, "vertical_load": value})
    unit.step({"vertical_load": 0.0}, count=100)
    assert unit.get("TRPAC_peak") == pytest.approx(other.get("TRPAC_peak"), rel=1e-3)
    assert [line.status for line in unit.log] == [WARNING]


@pytest.mark.parametrize("by", ["yaw_rate", "steering_angle"])
@pytest.mark.parametrize(("front", "left"), [(True, True), (True, False), (False, True), (False, False)])
def test_in_a_curve_a_wheel_that_adheres_shows_no_slip(
    open_any: Open, by: str, front: bool, left: bool
) -> None:
    """Radii about the turning centre on the rear axle's line, by geometry."""
    radius_m, speed, car = 30.0, 10.0, EstimatorConfig().vehicle
    beside = radius_m + (-0.5 if left else 0.5) * car.track_m
    own = beside * speed / radius_m
    steering = math.atan(car.wheelbase_m / radius_m)
    if front:  # the wheels are steered alike, so that only the part along them rolls
        own = own * math.cos(steering) + speed / radius_m * car.wheelbase_m * math.sin(steering)
    told = {"steering_angle": steering} if by == "steering_angle" or front else {}
    told |= {"yaw_rate": speed / radius_m} if by == "yaw_rate" else {}
    unit = open_any(wheel__front=front, wheel__left=left, **TOLD)
    unit.step(
        {"wheel_speed": own / car.wheel_radius_m, "wheel_torque": 0.0, "vehicle_speed": speed, **told},
        count=300,
    )
    assert abs(unit.get("slip")) < 1e-6
    assert unit.get("TRPAC") == pytest.approx(0.8)


# Bad input: the unit goes on, flag down, one log line, fmi2OK


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", REAL_INPUTS)
def test_value_that_is_no_number(open_any: Open, name: str, value: float) -> None:
    unit = open_any()
    flag_up(unit)
    held = unit.get("TRPAC")
    unit.step({name: value}, count=20)
    assert not unit.get("flag")
    assert all(math.isfinite(v) for v in unit.outputs().values())
    assert [line.status for line in unit.log] == [WARNING]
    if name != "road_class_confidence":
        assert unit.get("TRPAC") == held
    unit.step({name: SLIPPERY.get(name, 1e-9 if name != "vertical_load" else 3000.0)}, count=300)
    assert unit.get("flag")
    assert len(unit.log) == 1


@pytest.mark.parametrize("value", [1e300, -1e300])
@pytest.mark.parametrize("name", [name for name in REAL_INPUTS if name != "road_class_confidence"])
def test_absurd_values_leave_finite_outputs_and_the_unit_alive(
    open_any: Open, name: str, value: float
) -> None:
    unit = open_any()
    flag_up(unit)
    unit.step({name: value}, count=5)
    assert all(math.isfinite(v) for v in unit.outputs().values())
    assert len(unit.log) <= 1


@pytest.mark.parametrize(
    "values",
    [
        {"wheel_speed": 0.0, "vehicle_speed": 0.0},
        {"wheel_speed": 0.0},
        {"vehicle_speed": 0.0},
        {"wheel_torque": -400.0, "wheel_speed": 48.0},
        {"wheel_speed": -52.0, "vehicle_speed": -15.0},
        {"wheel_speed": -52.0},
        {"vehicle_speed": -15.0},
        {"wheel_torque": -150.0},
    ],
    ids=str,
)
def test_standstill_locked_wheel_and_reversed_signs(open_any: Open, values: dict[str, float]) -> None:
    unit = open_any()
    flag_up(unit)
    unit.step({**DRIVING, **values}, count=50)
    assert all(math.isfinite(v) for v in unit.outputs().values())
    assert len(unit.log) <= 1
    unit.step(DRIVING, count=50)
    assert 0.0 < unit.get("TRPAC") < 1.2


def test_varying_step_sizes(open_any: Open) -> None:
    unit = open_any()
    flag_up(unit)
    for step_s in (1e-6, 0.01, 0.0005, 0.1, 1.0, 5e-324, 1e-300, 10.0, 1e-9):
        unit.step(step_s=step_s)
        assert all(math.isfinite(v) for v in unit.outputs().values())
    assert unit.log == []


def _no_file(folder: Path, _: Path) -> Path:
    return folder / "missing.png"


def _cut_short(folder: Path, picture: Path) -> Path:
    (folder / "cut.png").write_bytes(picture.read_bytes()[:5000])
    return folder / "cut.png"


def _no_picture(folder: Path, _: Path) -> Path:
    (folder / "text.png").write_text("no picture")
    return folder / "text.png"


def _empty(folder: Path, _: Path) -> Path:
    (folder / "empty.png").write_bytes(b"")
    return folder / "empty.png"


def _folder(folder: Path, _: Path) -> Path:
    return folder


def _other_shape(folder: Path, _: Path) -> Path:
    cv2.imwrite(str(folder / "square.png"), np.zeros((400, 400, 3), np.uint8))
    return folder / "square.png"


@pytest.mark.parametrize("spoil", [_no_file, _cut_short, _no_picture, _empty, _folder, _other_shape])
def test_picture_that_cannot_be_used(
    open_unit: Open, tmp_path: Path, picture: Path, spoil: Callable[[Path, Path], Path]
) -> None:
    unit = open_unit()
    flag_up(unit)
    unit.step({"road_class": -1, "image_path": str(spoil(tmp_path, picture))}, count=20)
    assert not unit.get("flag")
    unit.step({"frame_id": 1}, count=20)
    assert not unit.get("flag")
    assert [line.status for line in unit.log] == [WARNING]
    unit.step(SLIPPERY, count=1)
    assert unit.get("flag"), "a good frame lifts the flag again"


@pytest.mark.parametrize("road_class", [-2, 3, 2**31 - 1])
def test_class_out_of_range(open_any: Open, road_class: int) -> None:
    unit = open_any()
    flag_up(unit)
    unit.step({"road_class": road_class}, count=20)
    assert not unit.get("flag")
    assert [line.status for line in unit.log] == [WARNING]


def test_bad_parameters_are_all_named_and_every_step_is_discarded(
    open_any: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    unit = open_any(vehicle__mass=-1.0, camera__pitch=math.nan)
    assert "vehicle.mass" in capfd.readouterr().err, "a host without a log must see it as well"
    assert unit.log[0].status == ERROR
    assert "vehicle.mass" in unit.log[0].text
    assert "camera.pitch" in unit.log[0].text
    with pytest.raises(Exception, match=r"fmi2DoStep.*status 2"):
        unit.step(DRIVING)
    assert not unit.get("flag")


def test_parameters_that_contradict_each_other_are_refused(open_unit: Open) -> None:
    unit = open_unit(image__k1=0.005, image__k2=0.001)
    assert "k1 < k2" in unit.log[0].text


def test_parameter_set_too_late_and_output_set_are_refused_with_a_log_line(open_any: Open) -> None:
    unit = open_any()
    unit.set({"vehicle.mass": 1.0})
    unit.set({"TRPAC": 0.1})
    unit.step(DRIVING)
    assert [line.status for line in unit.log] == [ERROR, ERROR]
    assert unit.get("TRPAC") > 0.5


def test_unknown_value_references_are_survived(open_any: Open) -> None:
    unit = open_any()
    for reference in (9999, 2**32 - 1):
        assert unit.slave.getReal([reference]) == [0.0]
        unit.slave.setReal([reference], [1.0])
    assert unit.slave.getString([0]) == [b""]
    unit.step(DRIVING)
    assert {line.status for line in unit.log} == {ERROR}


# Frames


def test_a_picture_is_taken_once_and_again_with_a_new_number(open_unit: Open, picture: Path) -> None:
    unit = open_unit()
    unit.step({**DRIVING, "image_path": str(picture)}, count=3)
    assert _frames_seen(unit) == 1
    unit.step({"image_path": str(picture)}, count=3)
    assert _frames_seen(unit) == 1
    unit.step({"frame_id": 7}, count=3)
    assert _frames_seen(unit) == 2
    unit.step({"image_path": ""}, count=3)
    unit.step({"image_path": str(picture)}, count=3)
    assert _frames_seen(unit) == 3


def _frames_seen(unit: Unit) -> int:
    return _state(unit)["inner"]["estimator"]["state"]["ife"]["frame_count"]


def _state(unit: Unit) -> dict:
    state = unit.slave.getFMUstate()
    text = unit.slave.serializeFMUstate(state)
    unit.slave.freeFMUstate(state)
    return json.loads(text)


def test_numbered_classes_count_once_each(open_unit: Open) -> None:
    unit = open_unit()
    unit.step({**SLIPPERY, "frame_id": 1}, count=250)
    first = len(_state(unit)["inner"]["estimator"]["state"]["preview"]["stamps"])
    unit.step({"frame_id": 2})
    assert (first, len(_state(unit)["inner"]["estimator"]["state"]["preview"]["stamps"])) == (1, 2)


def test_the_class_by_bus_reaches_the_outputs(open_any: Open) -> None:
    unit = open_any()
    flag_up(unit)
    assert unit.get("TRPAC_image") == CLASS_THETA[Surface.SNOW_ICE]
    assert unit.get("image_confidence") == 0.9


# Pictures in memory


class Memory:
    """Bytes at an address, and the inputs that point there."""

    def __init__(self, content: bytes) -> None:
        self.buffer = ctypes.create_string_buffer(content, len(content))
        address = ctypes.addressof(self.buffer)
        self.inputs = {
            "image.base.lo": ctypes.c_int32(address & 0xFFFFFFFF).value,
            "image.base.hi": ctypes.c_int32(address >> 32).value,
            "image.size": len(content),
        }


@pytest.mark.parametrize("form", ["png", "raw"])
def test_picture_in_memory_counts_as_the_same_file_does(open_unit: Open, picture: Path, form: str) -> None:
    by_path, by_address = open_unit(), open_unit()
    raw = cv2.imread(str(picture))
    memory = Memory(picture.read_bytes() if form == "png" else raw.tobytes())
    size = {"image_width": 1920, "image_height": 1200} if form == "raw" else {}
    by_path.step({**DRIVING, "image_path": str(picture)})
    by_address.step({**DRIVING, **memory.inputs, **size})
    ctypes.memset(memory.buffer, 0, len(memory.buffer))
    for unit in (by_path, by_address):
        unit.step(count=300)
        assert unit.log == []
    assert _frames_seen(by_address) == 1
    assert by_address.outputs() == by_path.outputs()
    assert by_address.get("image_confidence") > 0.0


def test_an_address_is_forgotten_after_the_step_and_never_saved(open_unit: Open, picture: Path) -> None:
    unit = open_unit()
    memory = Memory(picture.read_bytes())
    unit.set(memory.inputs)
    saved = _state(unit)["values"]
    assert {name: saved[name] for name in memory.inputs} == dict.fromkeys(memory.inputs, 0)
    unit.step(DRIVING)
    assert [unit.get(name) for name in memory.inputs] == [0, 0, 0]


def test_numbered_pictures_in_memory_count_once_each_and_others_each_time(
    open_unit: Open, picture: Path
) -> None:
    unit, memory = open_unit(), Memory(picture.read_bytes())
    for frame_id, seen in ((1, 1), (1, 1), (2, 2), (0, 3), (0, 4)):
        unit.step({**memory.inputs, "frame_id": frame_id})
        unit.step()
        assert _frames_seen(unit) == seen


@pytest.mark.parametrize("missing", ["address", "size"])
def test_address_or_size_of_zero_is_no_picture(open_unit: Open, picture: Path, missing: str) -> None:
    unit, inputs = open_unit(), Memory(picture.read_bytes()).inputs
    zero = ["image.size"] if missing == "size" else ["image.base.lo", "image.base.hi"]
    unit.step({**inputs, **dict.fromkeys(zero, 0)})
    assert _frames_seen(unit) == 0
    assert unit.log == []


@pytest.mark.parametrize(
    ("content", "more"),
    [
        (b"no picture at all", {}),
        (b"1234567890", {"image_width": 1920, "image_height": 1200}),
        (b"1234567890", {"image_width": 1920}),
        (b"1234567890", {"image.size": -5}),
        (b"1234567890", {"image.size": 2**31 - 1}),
    ],
)
def test_memory_that_holds_no_picture(open_unit: Open, content: bytes, more: dict[str, int]) -> None:
    unit, memory = open_unit(), Memory(content)
    flag_up(unit)
    unit.step({"road_class": -1, **memory.inputs, **more})
    unit.step(count=5)
    assert not unit.get("flag")
    assert [line.status for line in unit.log] == [WARNING]


# State, reset, instances


def test_restored_state_repeats_the_run_bit_by_bit_with_a_frame_pending(
    open_unit: Open, picture: Path
) -> None:
    unit, other = open_unit(), open_unit(estimator__gamma=1.0)
    unit.step({**SLIPPERY, "vertical_load": 2900.0}, count=200)
    unit.step({"road_class": -1, "image_path": str(picture)}, count=50)
    unit.set({"frame_id": 5})
    state = unit.slave.getFMUstate()
    saved = unit.slave.serializeFMUstate(state)

    def run(one: Unit) -> list[dict[str, float | bool]]:
        trace = []
        for index in range(60):
            one.step({"wheel_torque": 100.0 + index, "wheel_speed": 52.0 + 0.01 * index})
            trace.append(one.outputs())
        return trace

    first = run(unit)
    unit.slave.setFMUstate(state)
    assert run(unit) == first
    unit.slave.setFMUstate(state)
    assert run(unit) == first, "a state can be restored more than once"
    unit.slave.freeFMUstate(state)
    restored = other.slave.deSerializeFMUstate(saved)
    other.slave.setFMUstate(restored)
    assert run(other) == first, "another instance, with other parameters, takes the whole state over"
    assert other.slave.serializeFMUstate(restored) == saved


def test_restored_instance_knows_the_frame_that_was_taken(open_unit: Open, picture: Path) -> None:
    unit, other = open_unit(), open_unit()
    unit.step({**DRIVING, "image_path": str(picture), "frame_id": 3})
    _hand_over(unit, other)
    other.step(count=5)
    assert _frames_seen(other) == 1


def test_restored_instance_knows_which_inputs_are_connected(open_any: Open) -> None:
    unit, other = open_any(), open_any()
    unit.step({**DRIVING, "longitudinal_acceleration": 1.0})
    unit.set({"longitudinal_acceleration": 0.0})
    _hand_over(unit, other)
    for one in (unit, other):
        for index in range(50):
            one.step({"vehicle_speed": 15.0 + 0.01 * index})
    assert other.outputs() == unit.outputs()


def test_a_frame_that_failed_before_the_state_was_saved_keeps_the_flag_down(open_unit: Open) -> None:
    unit, other = open_unit(), open_unit()
    flag_up(unit)
    unit.step({"road_class": -1, "image_path": "missing.png"})
    _hand_over(unit, other)
    other.step(count=5)
    assert not other.get("flag")


def _hand_over(unit: Unit, other: Unit) -> None:
    state = unit.slave.getFMUstate()
    other.slave.setFMUstate(other.slave.deSerializeFMUstate(unit.slave.serializeFMUstate(state)))
    unit.slave.freeFMUstate(state)


def test_a_state_from_before_the_initialisation_unlocks_the_parameters(open_any: Open) -> None:
    expected = open_any(vehicle__mass=1900.0)
    unit = open_any(initialise=False, vehicle__mass=1300.0)
    state = unit.slave.getFMUstate()
    unit.initialise()
    flag_up(unit)
    unit.slave.setFMUstate(state)
    unit.set({"vehicle.mass": 1900.0})
    unit.initialise()
    assert unit.log == []
    assert unit.get("vehicle.mass") == 1900.0
    for one in (unit, expected):
        flag_up(one)
    assert unit.outputs() == expected.outputs()
    unit.set({"vehicle.mass": 1.0})
    assert [line.status for line in unit.log] == [ERROR], "and the initialisation locks them again"


def test_a_state_from_after_the_initialisation_locks_the_parameters(open_any: Open) -> None:
    run = open_any(vehicle__mass=1900.0)
    fresh = open_any(initialise=False)
    saved = run.slave.serializeFMUstate(run.slave.getFMUstate())
    fresh.slave.setFMUstate(fresh.slave.deSerializeFMUstate(saved))
    fresh.set({"vehicle.mass": 1.0})
    assert fresh.get("vehicle.mass") == 1900.0
    assert [line.status for line in fresh.log] == [ERROR]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda _: b"",
        lambda _: b"{}",
        lambda _: b"\xff\x00",
        lambda saved: saved[:-20],
        lambda saved: saved.replace(b"fmu_src_", b"fmu_src_another_"),
        lambda saved: saved.replace(b'"wheel_speed"', b'"another_name"'),
        lambda saved: saved.replace(b'"schema": 1', b'"schema": 0'),
    ],
)
def test_state_of_something_else_is_refused(open_unit: Open, spoil: Callable[[bytes], bytes]) -> None:
    unit = open_unit()
    content = spoil(unit.slave.serializeFMUstate(unit.slave.getFMUstate()))
    unit.step(DRIVING)
    before = unit.outputs()
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(content))
    assert unit.outputs() == before
    assert [line.status for line in unit.log] == [ERROR]


def test_reset_goes_back_to_the_start(open_any: Open) -> None:
    unit = open_any()
    start = unit.outputs()
    flag_up(unit)
    first = unit.outputs()
    unit.reset()
    unit.initialise()
    assert unit.outputs() == start
    flag_up(unit)
    assert unit.outputs() == first


def test_two_instances_do_not_touch_each_other(open_any: Open) -> None:
    alone = open_any()
    flag_up(alone)
    first, second = open_any(), open_any()
    for _ in range(250):
        first.step(SLIPPERY)
        second.step({**DRIVING, "wheel_speed": 60.0})
    assert first.outputs() == alone.outputs()
    assert second.outputs() != alone.outputs()
    second.free()
    first.step(SLIPPERY)
    assert first.get("flag")


def test_outputs_can_be_read_while_the_host_initialises(open_any: Open) -> None:
    """A master hands them on before the first step: a controller must not take a friction of 0 from it."""
    unit = open_any()
    unit.reset()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    unit.set({"estimator.method": Method.DIFE.value})
    for initial in (0.5, 0.7):
        unit.set({"estimator.theta_initial": initial})
        early = unit.outputs()
        assert early["TRPAC"] == initial
        assert early["frame_age"] == -1.0
    unit.slave.exitInitializationMode()
    assert unit.outputs() == early
    assert unit.log == []


def test_outputs_read_under_parameters_that_cannot_be_are_told_at_the_end_alone(open_any: Open) -> None:
    unit = open_any()
    unit.reset()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    unit.set({"vehicle.mass": -1.0})
    unit.outputs()
    assert unit.log == []
    unit.slave.exitInitializationMode()
    assert [line.status for line in unit.log] == [ERROR]


def test_after_an_initialisation_that_failed_the_outputs_are_those_of_before_it(open_any: Open) -> None:
    unit = open_any(initialise=False, **TOLD)
    before = unit.outputs()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    unit.set({"estimator.theta_initial": 0.7})
    assert unit.get("TRPAC") == 0.7
    unit.set({"vehicle.mass": -1.0})
    unit.slave.exitInitializationMode()
    assert unit.outputs() == before


def test_each_signal_is_told_of_once_and_hides_no_other(open_unit: Open) -> None:
    unit = open_unit()
    flag_up(unit)
    for bad in (
        {"vehicle_speed": -5.0},
        {"vehicle_speed": 1e9},
        {"vehicle_speed": 15.0, "wheel_speed": math.nan},
        {"wheel_speed": 52.0, "road_class": 7},
        {"road_class": -1, "image_path": "/nowhere.png", "frame_id": 5},
    ):
        unit.step(bad, count=3)
    told = [line.text for line in unit.log]
    words = (
        "rolls backwards",
        "vehicle_speed_m_s is 1e+09",
        "wheel_speed_rad_s is nan",
        "road_class is 7",
        "nowhere",
    )
    assert len(told) == len(words), told
    for word, text in zip(words, told, strict=True):
        assert word in text


def test_a_step_before_the_initialisation_is_told(open_any: Open) -> None:
    unit = open_any()
    unit.reset()
    with pytest.raises(FMICallException):
        unit.step()
    assert "before the initialisation has ended" in unit.log[0].text


def test_a_state_restored_while_the_host_initialises_is_what_is_read(open_any: Open) -> None:
    """And one that was saved there is read by what is set from then on, not by where the unit had come."""
    unit = open_any()
    flag_up(unit)
    driven, state = unit.outputs(), unit.slave.getFMUstate()
    unit.reset()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    early = unit.slave.getFMUstate()
    unit.slave.setFMUstate(state)
    assert unit.outputs() == driven
    unit.step(SLIPPERY)
    later = unit.outputs()
    unit.step(SLIPPERY, count=50)
    unit.slave.setFMUstate(early)
    unit.set({"estimator.theta_initial": 0.6, "estimator.method": Method.DIFE.value})
    assert unit.get("TRPAC") == 0.6
    assert later["flag"]
