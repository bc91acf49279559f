"""The native unit for FMI 3.0: what it gives, tells and remembers is what the one for FMI 2.0 does."""

from __future__ import annotations

import math
import shutil
import subprocess
from ctypes import c_size_t
from pathlib import Path

import numpy as np
import pytest
from doctored_units import command, findings
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import fmi3InstanceEnvironment
from fmpy.validation import validate_fmu
from fmu_unit import DRIVING, Unit, Unit3
from long import long
from native_drives import drive, drive_of_four, rows
from native_units import ATTRIBUTES, bits, called, compiled_host, driven

import build_fmu
from fmu_src.model_description import TIME, TYPES_3
from fmu_src.native import build
from fmu_src.native.build import build_native, sources
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.estimator_data import Method
from trpac_core.parameters.variables import Kind

pytestmark = pytest.mark.e2e

DISCARD, ERROR, STEPS = 2, 3, 900


@pytest.fixture(scope="module")
def file_3(native_file, tmp_path_factory) -> Path:
    """The unit TrpacEstimator for FMI 3.0, by this machine's compiler, which `native_file` skips without."""
    target = tmp_path_factory.mktemp("fmi3") / "TrpacEstimator_native_fmi3.fmu"
    return build_native(UNITS["TrpacEstimator"].info, target, fmi=3, everywhere=False)


@pytest.fixture(scope="module")
def folder_3(file_3, tmp_path_factory) -> Path:
    return unpack_unit(file_3, tmp_path_factory.mktemp("unpacked"))


def opener(folder, kind):
    def open_one(initialise=True, **parameters):
        unit = kind(folder)
        unit.set({name.replace("__", "."): value for name, value in parameters.items()})
        if initialise:
            unit.initialise()
        return unit

    return open_one


@pytest.fixture
def both(native_folder, folder_3):
    """Open instances for FMI 2.0, and for 3.0."""
    return opener(native_folder, Unit), opener(folder_3, Unit3)


@pytest.mark.parametrize("method", list(Method), ids=lambda method: method.label)
def test_it_gives_and_tells_what_the_unit_for_fmi_2_does(both, method):
    (expected, expected_log), (trace, log) = (
        driven(open_one, drive(method.value, STEPS), {"estimator__method": method.value}) for open_one in both
    )
    for step, (there, here) in enumerate(zip(expected, trace, strict=True)):
        assert bits(here) == bits(there), step
    assert log == expected_log != []
    assert len({values["slip"] for values in trace}) > STEPS / 4


@long
def test_so_does_the_unit_of_four_wheels(native_folder_4w, tmp_path):
    file = build_native(UNITS["TrpacEstimator4W"].info, tmp_path / "unit.fmu", fmi=3, everywhere=False)
    assert list(validate_fmu(str(file))) == []
    folders = native_folder_4w, unpack_unit(file, tmp_path / "unit")
    (expected, expected_log), (trace, log) = (
        driven(opener(folder, kind), drive_of_four(2, STEPS // 2), {})
        for folder, kind in zip(folders, (Unit, Unit3), strict=True)
    )
    assert [bits(values) for values in trace] == [bits(values) for values in expected]
    assert log == expected_log != []


def test_fmpy_gets_the_same_bits_and_the_time(native_file, file_3):
    names = ("wheel_speed", "wheel_torque", "vehicle_speed", "road_class_confidence")
    kinds = [("time", float), *((name, float) for name in names), ("road_class", int), ("frame_id", int)]
    made = rows(STEPS)
    signals = np.zeros(STEPS, kinds)
    signals["time"] = np.arange(STEPS) / 1024.0
    for column, name in enumerate((*names, "road_class", "frame_id")):
        signals[name] = made[:, (1, 2, 3, 4, 9, 10)[column]]
    outputs = ["TRPAC", "TRPAC_low", "flag", "TRPAC_source", "K_v", "tyre_force"]
    step_s = 1.0 / 1024.0
    expected, found = (
        simulate_fmu(
            str(file),
            input=signals,
            output=[*outputs, *more],
            step_size=step_s,
            output_interval=step_s,
            stop_time=STEPS * step_s,
            start_values={"estimator.method": Method.ROBUST.value},
        )
        for file, more in ((native_file, []), (file_3, ["time"]))
    )
    assert len(found) == STEPS + 1
    for name in outputs:
        assert np.array_equal(found[name], expected[name]), name
    assert found["TRPAC_source"].any()
    assert np.array_equal(found["time"], np.arange(STEPS + 1) / 1024.0)


# Description


def test_it_validates_and_its_variables_are_those_of_the_unit_for_fmi_2(native_folder, file_3):
    assert list(validate_fmu(str(file_3))) == []
    two, three = read_model_description(str(native_folder)), read_model_description(str(file_3))
    *listed, time = three.modelVariables
    assert (time.name, time.causality, time.valueReference) == (TIME.name, "independent", len(listed))
    types = {kind.value: name for kind, name in TYPES_3.items()}
    for one, other in zip(two.modelVariables, listed, strict=True):
        wanted = {name: getattr(one, name) for name in ATTRIBUTES} | {"type": types[one.type]}
        assert {name: getattr(other, name) for name in ATTRIBUTES} == wanted
    for group in ("outputs", "initialUnknowns"):
        names = [[u.variable.name for u in getattr(description, group)] for description in (two, three)]
        assert names[0] == names[1] != []
    assert not three.coSimulation.needsExecutionTool
    assert three.coSimulation.canSerializeFMUstate


@pytest.mark.parametrize(
    ("fmi", "folders"),
    [
        (2, {"linux64", "win64", "darwin64", "aarch64-linux"}),
        (3, {"x86_64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin", "aarch64-linux"}),
    ],
)
def test_the_folders_of_all_platforms_are_named_by_the_version(monkeypatch, fmi, folders):
    monkeypatch.setattr(build, "_library", lambda _, command, *__: command[-1].encode().ljust(20))
    made = build.libraries("Unit", [], {}, True, fmi)
    assert {path.split("/")[1] for path in made} == folders
    assert {path.rpartition(".")[2] for path in made} == {"so", "dll", "dylib"}


# What cannot be used


def test_bad_parameters_are_told_in_the_same_words(both, capfd):
    bad = {"vehicle__mass": -1.0, "camera__pitch": math.nan, "estimator__method": 7}
    logs = []
    for open_one in both:
        unit = open_one(**bad)
        with pytest.raises(FMICallException) as raised:
            unit.step(DRIVING)
        assert raised.value.status == DISCARD
        logs.append((unit.log, capfd.readouterr().err))
    assert logs[0] == logs[1]
    assert logs[0][0][0].status == ERROR


def odd_calls(unit):
    """What is of no sense: readings, step sizes, references, texts; a parameter that comes too late."""
    real, integer = ("Real", "Integer") if type(unit) is Unit else ("Float64", "Int32")
    slave = unit.slave
    for value in (math.nan, math.inf):
        unit.step({**DRIVING, "wheel_speed": value})
    for step_s in (math.nan, -1.0, 1e9):
        with pytest.raises(FMICallException):
            unit.step(DRIVING, step_s=step_s)
    for reference in (0, 5, 999, 999, 4_000_000_000):
        getattr(slave, f"set{integer}")([reference], [1])
        yield getattr(slave, f"get{integer}")([0, reference, 77_777])
    getattr(slave, f"set{real}")([unit.variables["vehicle.mass"].valueReference], [1.0])
    yield getattr(slave, f"get{real}")([4, 5])
    yield slave.getBoolean([0])
    slave.getString([0])
    unit.set({"image_path": "x" * 5000, "road_class": 9})
    unit.step(count=2)
    yield unit.outputs()


def test_calls_of_no_sense_are_told_in_the_same_words(both, capfd):
    found = []
    for open_one in both:
        unit = open_one()
        answers = list(odd_calls(unit))
        found.append((answers, unit.log, capfd.readouterr().err))
    assert found[0] == found[1]
    assert len(found[0][1]) > 8


def test_what_it_does_not_offer_is_an_error(both):
    unit = both[1](initialise=False)
    slave = unit.slave
    with pytest.raises(FMICallException):
        slave.doStep(0.0, 0.001)
    unit.initialise()
    for call in (
        lambda: slave.getFloat32([0]),
        lambda: slave.setInt64([4], [1]),
        lambda: slave.getBinary([0]),
        lambda: slave.getClock([0]),
        slave.enterEventMode,
        slave.enterStepMode,
        slave.updateDiscreteStates,
        slave.enterConfigurationMode,
        lambda: slave.getDirectionalDerivative([16], [0], [1.0]),
        lambda: slave.getOutputDerivatives([16], [1]),
        lambda: slave.getFloat64([0, 1], nValues=1),
    ):
        with pytest.raises(FMICallException) as raised:
            call()
        assert raised.value.status == ERROR
    assert ["before the initialisation has ended" in line.text for line in unit.log] == [True]


def test_another_kind_of_instance_is_refused_in_a_sentence(both):
    unit = both[1]()
    token, name = unit.description.guid.encode(), b"other"
    call = unit.slave.logMessage
    common = (name, token, b"", False, True)
    assert not unit.slave.fmi3InstantiateModelExchange(*common, fmi3InstanceEnvironment(), call)
    for given, events in ((token, True), (b"another", False)):
        assert not unit.slave.fmi3InstantiateCoSimulation(
            name, given, b"", False, True, events, False, None, c_size_t(0), fmi3InstanceEnvironment(), call,
            unit.slave.intermediateUpdate,
        )  # fmt: skip
    said = [line.text.partition(": ")[2] for line in unit.log]
    assert said == [
        "it is a unit for co-simulation only.",
        "it has no event mode.",
        "its modelDescription.xml is of another build.",
    ]


# States


def test_a_state_is_taken_over_with_its_time_and_a_spoilt_one_refused_in_the_same_words(both):
    logs = []
    for open_one in both:
        first, second = open_one(), open_one(vehicle__mass=1900.0)
        steps = list(drive(2, 500))
        for values, step_s in steps[:300]:
            first.step(values, step_s=step_s)
        saved = first.saved()
        second.restore(saved)
        if open_one is both[1]:
            assert second.get("time") == first.get("time")
        for values, step_s in steps[300:]:
            for unit in (first, second):
                unit.step(values, step_s=step_s)
            assert bits(second.outputs()) == bits(first.outputs())
        before = second.outputs()
        another = saved.replace(second.description.guid.encode(), b"another_unit")
        flipped = saved[:9999] + bytes([saved[9999] ^ 1]) + saved[10000:]
        for spoilt in (b"", b"{}", saved[:-20], another, flipped):
            second.restore(spoilt)
            assert bits(second.outputs()) == bits(before)
        # fmpy's logger for FMI 2.0 gives the messages of all instances to the newest.
        logs.append([line for line in second.log if "the state was not restored" in line.text])
    assert logs[0] == logs[1]
    assert len(logs[0]) == 3


def test_the_states_of_the_two_versions_are_not_mixed_up(both):
    two, three = (open_one() for open_one in both)
    three.restore(two.saved())
    assert "another build" in three.log[0].text


# A host in C


def test_a_host_without_python_gets_the_bits_of_fmi_2_and_hands_the_state_over(
    native_folder, folder_3, tmp_path
):
    rows(STEPS).tofile(tmp_path / "rows.bin")
    for folder, place, options in ((native_folder, "linux64", ()), (folder_3, "x86_64-linux", ("-DFMI_3",))):
        (tmp_path / place).mkdir()
        shutil.copytree(folder / "sources", tmp_path / place / "sources")
        library = folder / "binaries" / place / "TrpacEstimator.so"
        host = compiled_host(tmp_path / place, "host", [library, folder / "sources" / "tables.c"], *options)
        called(host, "run", tmp_path / "rows.bin", tmp_path / f"{place}.bin", Method.ROBUST.value)
        called(host, "threads", tmp_path / "rows.bin")
    expected, found = (np.fromfile(tmp_path / f"{place}.bin") for place in ("linux64", "x86_64-linux"))
    assert np.array_equal(found, expected)
    assert np.isfinite(found).all()
    assert len(found) % STEPS == 0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="the sanitizers of gcc")
def test_the_files_that_it_lists_are_its_code_and_odd_values_and_states_do_it_no_harm(folder_3, tmp_path):
    (configuration,) = read_model_description(str(folder_3)).buildConfigurations
    (files,) = configuration.sourceFileSets
    (tmp_path / "sources").mkdir()
    for name, text in sources(UNITS["TrpacEstimator"].info, "guid", 3).items():
        (tmp_path / "sources" / name).write_text(text)
    options = ("-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-DFMI_3")
    parts = [tmp_path / "sources" / name for name in files.sourceFiles]
    called(compiled_host(tmp_path, "sanitized", parts, *options), "fuzz", 1, 1500)


def test_every_function_of_the_standard_is_exported(folder_3):
    header = (folder_3 / "sources" / "fmi3Functions.h").read_text()
    wanted = {line.split()[-1].rstrip(";") for line in header.splitlines() if line.startswith("FMI3_Export")}
    library = folder_3 / "binaries" / "x86_64-linux" / "TrpacEstimator.so"
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True
    )
    assert {line.split()[-1] for line in listed.stdout.splitlines()} == wanted
    assert len(wanted) > 70


# Commands


def test_the_doctor_tries_it(file_3):
    done = command(file_3, "--json")
    assert done.exit_code == 0, done.output
    assert "FMI 3.0" in findings(done)["python"]["text"]
    assert findings(done)["trial"]["state"] == "ok"


def test_the_build_command_makes_it_beside_the_one_for_fmi_2(file_3, tmp_path, monkeypatch, capsys):
    asked = []

    def build_instead(info, target, **options):
        asked.append((info.name, target.name, options))
        return Path(shutil.copy(file_3, target))

    monkeypatch.setattr(build, "build_native", build_instead)
    assert build_fmu.main(["--kind", "native", "--fmi", "3", "--out", str(tmp_path)]) == 0
    options = {"fmi": 3, "flat": False, "everywhere": None}
    assert asked == [("TrpacEstimator", "TrpacEstimator_native_fmi3.fmu", options)]
    assert "100 steps" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        build_fmu.main(["--fmi", "3"])
    assert "--kind native" in capsys.readouterr().err


def test_kinds_have_one_type_each():
    assert set(TYPES_3) == set(Kind)
