"""The unit without Python: what it gives, tells and remembers is what the unit with Python does."""

from __future__ import annotations

import math
import os
import shutil
import struct
import zipfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from fmu_unit import DRIVING, Unit
from long import beyond
from native_drives import SIGNALS, drive, drive_of_four, pedal, rows
from native_units import ATTRIBUTES, bits, called, compiled_host, driven
from plant_drives import SCENARIOS

from fmu_src.native.build import build_native, fat, sources
from fmu_src.units import UNITS
from scenarios.files import load_scenario
from scenarios.plant.pipeline import drive as drive_of
from trpac_core.estimator_data import Method

pytestmark = pytest.mark.e2e

WARNING, ERROR = 1, 3
STEPS = 1200


@pytest.mark.parametrize("method", list(Method), ids=lambda method: method.label)
@pytest.mark.parametrize(("front", "left"), [(True, True), (False, False)])
def test_it_gives_and_tells_what_the_unit_with_python_does(open_unit, open_native, method, front, left):
    parameters = {"estimator__method": method.value, "wheel__front": front, "wheel__left": left}
    expected, expected_log = driven(open_unit, drive(method.value, STEPS), parameters)
    trace, log = driven(open_native, drive(method.value, STEPS), parameters)
    for step, (there, here) in enumerate(zip(expected, trace, strict=True)):
        assert bits(here) == bits(there), step
    assert log == expected_log
    assert {line.status for line in log} == {WARNING}
    assert len({values["slip"] for values in trace}) > STEPS / 4


def test_the_unit_of_four_wheels_gives_and_tells_what_the_one_with_python_does(open_4w, open_native_4w):
    for method in Method:
        parameters = {"estimator__method": method.value}
        expected, expected_log = driven(open_4w, drive_of_four(method.value, STEPS // 2), parameters)
        trace, log = driven(open_native_4w, drive_of_four(method.value, STEPS // 2), parameters)
        for step, (there, here) in enumerate(zip(expected, trace, strict=True)):
            assert bits(here) == bits(there), (method, step)
        assert log == expected_log != []


def test_a_state_of_four_wheels_is_taken_over(open_native_4w):
    first, second = open_native_4w(), open_native_4w(vehicle__mass=1900.0)
    steps = list(drive_of_four(1, 300))
    for values, step_s in steps[:200]:
        first.step(values, step_s=step_s)
    saved = bytes(first.slave.serializeFMUstate(first.slave.getFMUstate()))
    second.slave.setFMUstate(second.slave.deSerializeFMUstate(saved))
    for values, step_s in steps[200:]:
        for unit in (first, second):
            unit.step(values, step_s=step_s)
        assert bits(second.outputs()) == bits(first.outputs())


def test_parameters_out_of_bounds_are_told_in_the_same_words(open_unit, open_native, capfd):
    bad = {
        "vehicle__mass": -1.0,
        "camera__pitch": math.nan,
        "estimator__method": 7,
        "preview__hold": 1e300,
        "estimator__floor_speed": 1.23456789e-7,
    }
    logs = []
    for open_one in (open_unit, open_native):
        unit = open_one(**bad)
        logs.append((unit.log, capfd.readouterr().err))
    assert logs[0] == logs[1]
    assert logs[0][0][0].status == ERROR


@pytest.mark.parametrize(
    "bad",
    [
        {"vehicle__cog_to_rear_axle": 3.0},
        {"scheduler__difference_small": 0.5, "scheduler__difference_medium": 0.3},
    ],
)
def test_parameters_that_contradict_each_other_are_told_in_the_same_words(open_unit, open_native, bad):
    assert open_native(**bad).log == open_unit(**bad).log != []


def test_a_picture_is_told_of_once_and_keeps_the_flag_down_until_a_class_comes(open_native):
    unit = open_native()
    ice = {**DRIVING, "road_class": 2, "road_class_confidence": 0.9}
    unit.step(ice, count=250)
    assert unit.get("flag")
    for path in ("frame_1.png", "frame_2.png"):
        unit.step({"road_class": -1, "image_path": path}, count=5)
        assert not unit.get("flag")
    assert [(line.status, "road_class" in line.text) for line in unit.log] == [(WARNING, True)]
    unit.step(ice)
    assert unit.get("flag")


def test_a_picture_in_memory_is_never_followed(open_native):
    unit = open_native()
    unit.step({**DRIVING, "image.base.lo": 8, "image.size": 1000}, count=2)
    assert [line.status for line in unit.log] == [WARNING]
    assert unit.get("image.size") == 0


def test_a_text_that_is_too_long_is_cut_and_told(open_native):
    unit = open_native()
    unit.set({"image_path": "x" * 5000})
    assert len(unit.slave.getString([unit.variables["image_path"].valueReference])[0]) < 1100
    assert [line.status for line in unit.log] == [ERROR]


def test_a_state_of_something_else_is_refused(open_native):
    unit = open_native()
    unit.step(DRIVING, count=20)
    state = unit.slave.getFMUstate()
    saved = bytes(unit.slave.serializeFMUstate(state))
    before = unit.outputs()
    another = saved.replace(unit.description.guid.encode(), b"another_unit")
    flipped = saved[:9999] + bytes([saved[9999] ^ 1]) + saved[10000:]
    for spoilt in (b"", b"{}", saved[:-20], another, flipped):
        unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(spoilt))
        assert unit.outputs() == before
    told = [(line.status, line.text.partition(": the state was not restored: ")[2]) for line in unit.log]
    assert told == [
        (ERROR, "it is not a state of this unit."),
        (ERROR, "it is damaged."),
        (ERROR, "it was saved by another build of the unit."),
    ]
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(saved))
    assert unit.outputs() == before


def test_it_validates_and_the_same_sources_give_the_same_bytes(native_file, tmp_path):
    assert list(validate_fmu(str(native_file))) == []
    again = build_native(UNITS["TrpacEstimator"].info, tmp_path / "again.fmu", everywhere=False)
    assert again.read_bytes() == native_file.read_bytes()


def test_its_variables_are_those_of_the_unit_with_python(native_folder, unit_folder):
    native, python = Unit(native_folder), Unit(unit_folder)
    try:
        for one, other in zip(
            native.description.modelVariables, python.description.modelVariables, strict=True
        ):
            assert [getattr(one, name) for name in ATTRIBUTES] == [
                getattr(other, name) for name in ATTRIBUTES
            ]
    finally:
        native.free()
        python.free()


# A host in C


@pytest.fixture(scope="module")
def host_folder(native_file, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("host")
    with zipfile.ZipFile(native_file) as archive:
        archive.extractall(folder)
    rows(STEPS).tofile(folder / "rows.bin")
    return folder


@pytest.fixture(scope="module")
def host(host_folder) -> Path:
    library = host_folder / "binaries" / "linux64" / "TrpacEstimator.so"
    return compiled_host(host_folder, "host", [library, host_folder / "sources" / "tables.c"])


@pytest.mark.parametrize("method", list(Method), ids=lambda method: method.label)
def test_a_host_without_python_gets_the_same_bits_and_hands_the_state_over(
    host, host_folder, open_unit, method
):
    called(host, "run", host_folder / "rows.bin", host_folder / "out.bin", method.value)
    found = np.fromfile(host_folder / "out.bin").reshape(STEPS, -1)
    unit = open_unit(estimator__method=method.value)
    names = [v.name for v in unit.description.modelVariables if v.causality == "output" and v.type == "Real"]
    inputs = (
        *("wheel_speed", "wheel_torque", "vehicle_speed", "road_class_confidence", "vertical_load"),
        *("steering_angle", "longitudinal_acceleration", "yaw_rate", "road_class", "frame_id"),
    )
    for row, values in zip(rows(STEPS).tolist(), found.tolist(), strict=True):
        given = dict(zip(inputs, row[1:], strict=True))
        given |= {name: int(given[name]) for name in ("road_class", "frame_id")}
        unit.step(given, step_s=row[0])
        assert values == [unit.get(name) for name in names]


def test_eight_threads_do_not_touch_each_other(host, host_folder):
    called(host, "threads", host_folder / "rows.bin")


def test_no_memory_is_allocated_after_the_instantiation(host_folder):
    parts = sorted((host_folder / "sources").glob("*.c"))
    options = ("-DCOUNT_ALLOCATIONS", "-Wl,--wrap=malloc,--wrap=calloc")
    called(compiled_host(host_folder, "counting", parts, *options), "run", host_folder / "rows.bin")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="the sanitizers of gcc")
@pytest.mark.parametrize(
    ("unit", "more"), beyond(1, [("TrpacEstimator4W", ("-DFOUR_WHEELS",)), ("TrpacEstimator", ())])
)
def test_values_and_states_of_no_sense_do_no_harm(tmp_path, unit, more):
    (tmp_path / "sources").mkdir()
    for name, text in sources(UNITS[unit].info, "guid").items():
        (tmp_path / "sources" / name).write_text(text)
    options = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", *more)
    parts = sorted((tmp_path / "sources").glob("*.c"))
    sanitized = compiled_host(tmp_path, "sanitized", parts, *options)
    for seed in range(int(os.environ.get("NATIVE_FUZZ_SEEDS", "3"))):
        called(sanitized, "fuzz", seed, 4000 if unit == "TrpacEstimator" else 1000)


# Drives of the plant


def test_over_the_papers_road_fmpy_gets_the_same_bits_from_both(native_file, unit_file):
    path = drive_of(load_scenario(SCENARIOS / "paper_simulation.yaml"))
    surface = np.select([path.theta[:, 0] > 0.7, path.theta[:, 0] > 0.4], [0, 1], 2)
    kinds = [("time", float), *((name, float) for name in SIGNALS), ("road_class", int), ("frame_id", int)]
    signals = np.zeros(len(path), kinds)
    signals["time"], signals["vehicle_speed"] = path.time_s, path.speed_m_s
    signals["wheel_speed"], signals["wheel_torque"] = path.wheel_speed_rad_s[:, 0], path.wheel_torque_nm[:, 0]
    signals["road_class"], signals["road_class_confidence"] = surface, 0.9
    signals["frame_id"] = 1 + np.arange(len(path)) // 33
    outputs = ["TRPAC", "TRPAC_low", "TRPAC_high", "TRPAC_dynamics", "K_v", "tyre_force", "TRPAC_std"]
    results = [
        simulate_fmu(
            str(unit),
            input=signals,
            output=outputs,
            step_size=0.001,
            output_interval=0.001,
            stop_time=float(path.time_s[-1]),
        )
        for unit in (unit_file, native_file)
    ]
    assert len(results[0]) > 5000
    for name in outputs:
        assert np.array_equal(results[0][name], results[1][name]), name
    assert np.ptp(results[1]["TRPAC"]) > 0.3


@pytest.mark.parametrize("radius_m", [0.29, 0.2987])
def test_a_car_that_is_not_as_told_is_told_in_the_same_words(open_unit, open_native, radius_m):
    logs = []
    for open_one in (open_unit, open_native):
        unit = open_one(estimator__method=Method.ROBUST.value)
        for values in pedal(900, radius_m):
            unit.step(values, step_s=0.01)
        logs.append(unit.log)
    assert logs[0] == logs[1] != []


# Libraries of other platforms


def test_a_library_for_two_processors_holds_both_where_its_head_says():
    parts = [
        struct.pack("<III", 0xFEEDFACF, processor, 3) + bytes([processor & 0xFF]) * size
        for processor, size in ((0x01000007, 70_000), (0x0100000C, 5))
    ]
    made = fat(parts)
    assert struct.unpack(">II", made[:8]) == (0xCAFEBABE, 2)
    for number, part in enumerate(parts):
        processor, _, begin, size, power = struct.unpack(">IIIII", made[8 + 20 * number : 28 + 20 * number])
        assert made[begin : begin + size] == part
        assert begin % (1 << power) == 0
        assert processor == struct.unpack("<I", part[4:8])[0]


@pytest.mark.long
@pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang: pip install ziglang")
def test_the_libraries_of_all_platforms_are_the_same_bytes_each_time(tmp_path):
    info = UNITS["TrpacEstimator"].info
    first, second = (
        build_native(info, tmp_path / name, everywhere=True).read_bytes() for name in ("a.fmu", "b.fmu")
    )
    assert first == second
    assert list(validate_fmu(str(tmp_path / "a.fmu"))) == []
