"""Building the unit: bytes, description, command line, unpacking."""

from __future__ import annotations

import ast
import itertools
import re
import subprocess
import sys
import zipfile
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu_unit import Unit
from long import beyond

import build_fmu
from fmu_src import packaging, variable_table
from fmu_src.build_command import EXIT_BUILD, EXIT_INVALID, EXIT_RUN, EXIT_USAGE, Product, run_build
from fmu_src.doctor import State, examine_file
from fmu_src.interface import TRPAC_ESTIMATOR
from fmu_src.model_description import UNITS as SI_UNITS
from fmu_src.model_description import flat_name
from fmu_src.packaging import BuildError, build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.unpacking import require_whole, unpack_unit
from trpac_core.estimator import Estimate, EstimatorConfig
from trpac_core.estimator_data import OUTPUTS
from trpac_core.files import file_sha256
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.fields import field_value
from trpac_core.parameters.variables import Kind, Variable

ROOT = Path(__file__).parents[2]
SLAVE = UNITS["TrpacEstimator"]

INTERFACE = {
    "input": {
        "wheel_speed",
        "wheel_torque",
        "vehicle_speed",
        "image_path",
        "frame_id",
        "image.base.lo",
        "image.base.hi",
        "image.size",
        "image_width",
        "image_height",
        "road_class",
        "road_class_confidence",
        "vertical_load",
        "steering_angle",
        "longitudinal_acceleration",
        "yaw_rate",
    },
    "output": {
        "TRPAC",
        "flag",
        "K_v",
        "excitation_flag",
        "excitation_threshold",
        "slip",
        "tyre_force",
        "TRPAC_image",
        "TRPAC_dynamics",
        "TRPAC_peak",
        "image_confidence",
        "frame_age",
        "TRPAC_std",
        "TRPAC_low",
        "TRPAC_high",
        "TRPAC_expected",
        "TRPAC_expected_std",
        "TRPAC_source",
    },
}


@pytest.mark.e2e
def test_validation_finds_no_problem(unit_file: Path) -> None:
    assert validate_fmu(str(unit_file)) == []


@pytest.mark.e2e
def test_the_same_sources_give_the_same_bytes_whatever_lies_in_the_caches(
    unit_file: Path, tmp_path: Path
) -> None:
    second = build_unit(SLAVE, tmp_path / "again.fmu")
    assert file_sha256(second) == file_sha256(unit_file)


@pytest.mark.e2e
def test_archive_holds_no_cache_and_no_time(unit_file: Path) -> None:
    with zipfile.ZipFile(unit_file) as archive:
        entries = archive.infolist()
    names = [entry.filename for entry in entries]
    assert names == sorted(names)
    assert {entry.date_time for entry in entries} == {packaging.ZIP_TIME}
    assert {oct(entry.external_attr >> 16) for entry in entries} == {"0o644"}, (
        "what unzip makes can be read by all"
    )
    assert {entry.compress_type for entry in entries} == {zipfile.ZIP_STORED}, (
        "zlib versions differ in their bytes"
    )
    assert not [name for name in names if name.endswith(".pyc") or "__pycache__" in name]
    assert "documentation/licenses/pythonfmu.txt" in names


@pytest.mark.e2e
def test_carried_modules_import_only_the_standard_library_their_own_and_three_packages(
    unit_folder: Path,
) -> None:
    allowed = {"numpy", "cv2", "onnxruntime"} | sys.stdlib_module_names
    carried = {path.name for path in (unit_folder / "resources").iterdir() if path.is_dir()}
    for path in (unit_folder / "resources").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            for name in names:
                assert name.split(".")[0] in allowed | carried, f"{path}:{node.lineno} imports {name}"


@pytest.mark.parametrize("causality", ["input", "output"])
def test_interface_has_the_documented_variables(causality: str) -> None:
    assert {v.name for v in TRPAC_ESTIMATOR if v.causality == causality} == INTERFACE[causality]


ALL_VARIABLES = [v for unit in UNITS.values() for v in unit.variables]


def test_every_variable_has_a_description_and_every_real_a_known_unit() -> None:
    for v in ALL_VARIABLES:
        assert v.description
        assert (v.unit in SI_UNITS) == (v.kind is Kind.REAL), v.name


@pytest.mark.parametrize("v", ALL_VARIABLES, ids=lambda v: v.name)
def test_start_lies_within_the_range(v: Variable) -> None:
    if isinstance(v.start, (int, float)):
        assert v.minimum is None or v.minimum <= v.start
        assert v.maximum is None or v.start <= v.maximum


def test_outputs_are_the_fields_of_the_estimate() -> None:
    named = {name.removesuffix("_n").removesuffix("_s") for name in OUTPUTS} - {"source"}
    assert named | {"TRPAC_source"} == INTERFACE["output"]
    shown = {*Estimate._fields, "TRPAC_peak"} - {"problem", "load_n", "longitudinal_stiffness_n"}
    assert set(OUTPUTS) == shown


def plain(value: object) -> object:
    return value.value if isinstance(value, Enum) else value


def test_parameters_start_at_the_estimators_defaults() -> None:
    for v in TRPAC_ESTIMATOR:
        if v.source:
            assert v.start == plain(field_value(EstimatorConfig(), v.source))


def test_untouched_parameters_give_the_default_configuration() -> None:
    starts = {v.name: v.start for v in TRPAC_ESTIMATOR}
    assert configuration(TRPAC_ESTIMATOR, starts, EstimatorConfig()) == EstimatorConfig()


DERIVED = {
    "vision.track_m",
    "vision.wheelbase_m",
    "vision.side",
    "vision.groups_looked_at",
    "preview.behind_m",
}
"""Settings that follow from others."""

NOT_OFFERED = {
    "vehicle.motor_peak_torque_nm",
    "vision.strip_half_width_m",
    "vision.use_trajectory",
    "vision.remove_shadow",
    "vision.calibrate",
    "vision.weight_evidence",
    "vision.use_foresight",
    "vision.use_lines",
    "vision.use_scene",
}
"""What the estimator of one wheel does not use, and switches for ablation studies."""


def leaves(owner: object, path: str = "") -> list[str]:
    if is_dataclass(owner):
        told = [f.name for f in fields(owner) if f.init]
        return [leaf for name in told for leaf in leaves(getattr(owner, name), f"{path}.{name}")]
    if isinstance(owner, tuple):
        return [leaf for place, item in enumerate(owner) for leaf in leaves(item, f"{path}.{place}")]
    return [path.removeprefix(".")]


def test_every_setting_of_the_estimator_is_a_parameter_or_left_out_on_purpose() -> None:
    offered = [v.source for v in TRPAC_ESTIMATOR if v.source]
    assert sorted(leaves(EstimatorConfig())) == sorted([*offered, *DERIVED, *NOT_OFFERED])


@pytest.mark.parametrize("v", [v for v in TRPAC_ESTIMATOR if v.source], ids=lambda v: v.name)
def test_each_parameter_reaches_its_field(v: Variable) -> None:
    values = {v.name: v.start for v in TRPAC_ESTIMATOR}
    changed = not v.start if v.kind is Kind.BOOLEAN else v.start + (1 if v.kind is Kind.INTEGER else 1e-6)
    if v.maximum == v.start:
        changed = v.minimum
    configured = configuration(TRPAC_ESTIMATOR, values | {v.name: changed}, EstimatorConfig())
    assert plain(field_value(configured, v.source)) == changed
    others = {
        w.source: plain(field_value(configured, w.source)) for w in TRPAC_ESTIMATOR if w.source and w is not v
    }
    assert others == {w.source: w.start for w in TRPAC_ESTIMATOR if w.source and w is not v}


def test_all_bad_parameters_are_named_in_one_error() -> None:
    values = {v.name: v.start for v in TRPAC_ESTIMATOR}
    with pytest.raises(ValueError, match=r"vehicle\.mass.*camera\.pitch"):
        configuration(
            TRPAC_ESTIMATOR,
            values | {"vehicle.mass": -1.0, "camera.pitch": float("nan")},
            EstimatorConfig(),
        )


@pytest.mark.e2e
def test_description_says_units_ranges_and_abilities(unit_file: Path) -> None:
    description = read_model_description(str(unit_file))
    by_name = {v.name: v for v in description.modelVariables}
    assert by_name["wheel_speed"].unit == "rad/s"
    assert by_name["wheel_torque"].unit == "N.m"
    assert by_name["road_class"].min == "-1"
    assert by_name["image_path"].variability == "discrete"
    assert description.variableNamingConvention == "structured"
    ability = description.coSimulation
    assert ability.canGetAndSetFMUstate
    assert ability.canSerializeFMUstate
    assert ability.canHandleVariableCommunicationStepSize
    torque = next(unit for unit in description.unitDefinitions if unit.name == "N.m").baseUnit
    assert (torque.kg, torque.m, torque.s) == (1, 2, -2)
    assert by_name["K_v"].unit == by_name["scheduler.K_v_big"].unit == "1/s"
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    assert [unknown.variable.name for unknown in description.outputs] == outputs
    assert all(unknown.dependencies == [] for unknown in description.outputs), (
        "no input reaches an output at once"
    )
    assert all(unknown.dependencies is None for unknown in description.initialUnknowns)


@pytest.mark.e2e
def test_picture_in_memory_is_annotated_as_the_sensor_model_packaging_has_it(unit_folder: Path) -> None:
    root = ElementTree.parse(unit_folder / "modelDescription.xml").getroot()
    osmp = "{http://xsd.pmsf.net/OSISensorModelPackaging}"
    assert root.find(f"VendorAnnotations/Tool[@name='net.pmsf.osmp']/{osmp}osmp") is not None
    parts = {
        (scalar.attrib["name"], binary.attrib["name"], binary.attrib["role"])
        for scalar in root.iter("ScalarVariable")
        for binary in scalar.iter(f"{osmp}osmp-binary-variable")
    }
    assert parts == {(f"image.{role}", "image", role) for role in ("base.lo", "base.hi", "size")}


@pytest.mark.e2e
def test_guid_follows_the_content(unit_file: Path, tmp_path: Path) -> None:
    other = replace(SLAVE, info=replace(SLAVE.info, description="another text"))
    changed = build_unit(other, tmp_path / "other.fmu")
    assert _guid(changed) != _guid(unit_file)


def _guid(path: Path) -> str:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml")).attrib["guid"]


def test_missing_network_files_are_all_named(tmp_path: Path) -> None:
    slave = replace(SLAVE, resources=(tmp_path / "a.onnx", tmp_path / "b.onnx"))
    with pytest.raises(BuildError, match=r"a\.onnx.*b\.onnx"):
        build_unit(slave, tmp_path / "x.fmu")
    assert not (tmp_path / "x.fmu").exists()


@pytest.mark.e2e
@pytest.mark.parametrize("name", ["Prüfstand", "a#b", "a+b", "a%b", "a(b)"])
def test_unpacking_refuses_what_crashes_the_wrapper(unit_file: Path, tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="crashes on the characters"):
        unpack_unit(unit_file, tmp_path / name)


def test_unpacking_refuses_entries_that_leave_the_folder(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bad.fmu", "w") as archive:
        archive.writestr("../escaped.txt", "x")
    with pytest.raises(ValueError, match="outside"):
        unpack_unit(tmp_path / "bad.fmu", tmp_path / "inside")
    assert not (tmp_path / "escaped.txt").exists()


def damaged_unit(unit_file: Path, target: Path, what: str) -> Path:
    """A unit with wrong bytes where its directory of entries says something of the first one."""
    data = bytearray(unit_file.read_bytes())
    entry = data.index(b"PK\x01\x02")
    if what == "version":
        data[entry + 6 : entry + 8] = (139).to_bytes(2, "little")
    elif what == "length of a name":
        data[entry + 28 : entry + 30] = (65535).to_bytes(2, "little")
    else:
        data[data.index(b"<fmiModelDescription") + 3] ^= 1
    target.write_bytes(data)
    return target


@pytest.mark.e2e
@pytest.mark.parametrize("what", beyond(1, ["content", "version", "length of a name"]))
def test_a_damaged_unit_is_one_short_sentence_to_every_user_of_it(
    unit_file: Path, tmp_path: Path, what: str
) -> None:
    path = damaged_unit(unit_file, tmp_path / "damaged.fmu", what)
    with pytest.raises(ValueError, match=r"damaged\.fmu: cannot be unpacked: .*Copy or build") as told:
        unpack_unit(path, tmp_path / "inside")
    assert len(str(told.value)) < 400 + len(str(tmp_path))
    trpac, out = str(Path(sys.executable).with_name("trpac")), str(tmp_path / "out")
    for command in (
        [trpac, "run", "scenarios/paper_simulation.yaml", "--fmu", str(path), "--out", out],
        [trpac, "fmu", "doctor", str(path)],
    ):
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        assert ended.returncode != 0
        assert "Traceback" not in ended.stderr + ended.stdout
        assert len(ended.stderr + ended.stdout) < 5000


@pytest.mark.e2e
def test_a_wrong_checksum_is_found_before_the_unit_is_used(unit_file: Path, tmp_path: Path) -> None:
    require_whole(unit_file)
    path = damaged_unit(unit_file, tmp_path / "damaged.fmu", "content")
    with pytest.raises(
        UnitFileError, match=r"damaged\.fmu: damaged at modelDescription\.xml\. Copy or build"
    ):
        require_whole(path)
    found = {finding.what: finding for finding in examine_file(path)[1]}
    assert found["archive"].state is State.PROBLEM
    assert found["archive"].text == "damaged at modelDescription.xml"


@pytest.mark.e2e
def test_a_path_with_spaces_runs(unit_file: Path, tmp_path: Path) -> None:
    unit = Unit(unpack_unit(unit_file, tmp_path / "with a space"))
    unit.initialise()
    unit.step()
    unit.free()


@pytest.mark.e2e
def test_command_line_builds_validates_and_prints_the_hash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert build_fmu.main(["--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert file_sha256(tmp_path / "TrpacEstimator.fmu") in printed
    assert "no problems found" in printed


@pytest.mark.e2e
def test_flat_names_have_no_dots_and_run_the_same(
    unit_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A flat unit differs in names alone; doctor and validation find nothing in it."""
    assert build_fmu.main(["--flat", "--out", str(tmp_path)]) == 0
    path = tmp_path / "TrpacEstimator_flat.fmu"
    assert str(path) in capsys.readouterr().out
    assert [found.text for found in examine_file(path)[1] if found.state is not State.OK] == []
    description, dotted = read_model_description(str(path)), read_model_description(str(unit_file))
    assert description.variableNamingConvention == "flat"
    assert description.guid != dotted.guid
    names, usual = ([v.name for v in d.modelVariables] for d in (description, dotted))
    assert names == [name.replace(".", "_") for name in usual]
    drive = {"wheel_speed": 52.0, "wheel_torque": 150.0, "vehicle_speed": 15.0, "road_class": 1}
    flat, other = (
        Unit(unpack_unit(path, tmp_path / "flat")),
        Unit(unpack_unit(unit_file, tmp_path / "dotted")),
    )
    flat.set({"estimator_theta_initial": 0.4})
    other.set({"estimator.theta_initial": 0.4})
    for unit in (flat, other):
        unit.initialise()
        unit.step({**drive, "road_class_confidence": 0.9}, step_s=0.01, count=100)
    assert flat.get("flag")
    assert list(flat.outputs().values()) == list(other.outputs().values())
    for unit in (flat, other):
        unit.free()


@pytest.mark.parametrize("unit", UNITS)
def test_flat_names_are_names_of_one_variable_each(unit: str) -> None:
    names = [flat_name(v.name) for v in UNITS[unit].variables]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) for name in names)


def test_command_line_suggests_units(capsys: pytest.CaptureFixture[str]) -> None:
    assert build_fmu.main(["--slave", "TrpacEstimater"]) == EXIT_USAGE
    assert "TrpacEstimator" in capsys.readouterr().err


def raises(error: Exception) -> Any:
    def call(*_: object) -> None:
        raise error

    return call


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({}, 0, "SHA-256"),
        ({"known": ("other",)}, EXIT_USAGE, "'thing' is not a kind. Known: other."),
        ({"build": raises(BuildError("lacks a part"))}, EXIT_BUILD, "lacks a part"),
        ({"build": raises(OSError("disk full"))}, EXIT_BUILD, "disk full"),
        ({"validate": lambda path: ["one", "two"]}, EXIT_INVALID, "does not validate:\none\ntwo"),
        ({"run": raises(Exception("step refused"))}, EXIT_RUN, "the unit does not run: step refused"),
    ],
)
def test_each_way_to_fail_has_its_exit_code_and_says_why(
    changes: dict[str, Any], code: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = tmp_path / "thing"
    made.write_bytes(b"content")
    fine = Product(
        "unit", "kind", ("thing",), lambda name: made, lambda path: [], "fine", lambda path: "a step"
    )
    assert run_build("build.py", lambda: replace(fine, **changes), "thing") == code
    said = capsys.readouterr()
    assert words in (said.err if code else said.out)
    assert ("SHA-256" in said.out) == (code == 0)


def test_another_interpreter_than_the_projects_is_told_which_to_use(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_build("build.py", raises(ImportError("no module named fmpy")), "thing") == EXIT_BUILD
    assert ".venv/bin/python build.py" in capsys.readouterr().err


@pytest.mark.e2e
def test_command_line_says_which_folder_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert build_fmu.main(["--out", str(blocked)]) == EXIT_BUILD
    assert str(blocked) in capsys.readouterr().err


@pytest.mark.parametrize("unit", UNITS)
def test_variable_table_is_current(unit: str) -> None:
    written = variable_table.TARGETS[unit].read_text(encoding="utf-8")
    expected = variable_table.table(unit, UNITS[unit].variables)
    assert written == expected, "run: python -m fmu_src.variable_table"


@pytest.mark.parametrize("unit", UNITS)
def test_variable_table_has_every_variable_once(unit: str) -> None:
    names: list[str] = []
    text = variable_table.table(unit, UNITS[unit].variables)
    for pattern in re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE):
        pieces = re.split(r"\{([^}]*)\}", pattern)
        names += map("".join, itertools.product(*(piece.split(",") for piece in pieces)))
    other = UNITS[variable_table.SHARED.get(unit, unit)].variables
    left_out = {v.name for v in other if v.causality == "parameter"} - set(names)
    expected = {v.name for v in UNITS[unit].variables}
    assert len(names) == len(set(names))
    assert set(names) | (left_out & expected) == expected


@pytest.mark.e2e
def test_missing_packages_are_named_with_interpreter_and_command(unit_folder: Path) -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(unit_folder / 'resources')!r})\n"
        "sys.modules['cv2'] = None\nsys.modules['onnxruntime'] = None\n"
        f"from fmu_src_{_folder_guid(unit_folder)}.host import require_packages\n"
        f"require_packages('TrpacEstimator', {dict(SLAVE.packages)!r})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    first_line = done.stderr.splitlines()[0]
    assert "opencv-python-headless" in first_line
    assert f"{sys.executable} -m pip install opencv-python-headless onnxruntime" in first_line


def _folder_guid(folder: Path) -> str:
    return ElementTree.parse(folder / "modelDescription.xml").getroot().attrib["guid"]
