"""Packages of plant, driver and estimator: valid, the same bytes each time, and the same run as units wired by hand."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from fmu_unit import STEP_S, Unit
from foreign_clients import need_client
from long import beyond, long

import build_ssp
from fmu_src.build_command import EXIT_BUILD, EXIT_USAGE
from fmu_src.packaging import BuildError, build_unit
from fmu_src.ssp import (
    ESTIMATOR,
    PLANT,
    SSC,
    SSV,
    SYSTEMS,
    Wiring,
    build_package,
    build_system,
    parameter_set,
    system_structure,
)
from fmu_src.ssp_client import bound_parameters, problems, simulate
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.files import file_sha256
from trpac_core.parameters.variables import Kind

RUN_S = 0.6
OUTPUT = {"one_wheel": "TRPAC", "four_wheels": "TRPAC.rl"}


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("units")
    return {name: build_unit(slave, folder / f"{name}.fmu") for name, slave in UNITS.items()}


@pytest.fixture(scope="module", params=list(SYSTEMS))
def system(
    request: pytest.FixtureRequest, units: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path]:
    """A system's name and its package."""
    wiring = SYSTEMS[request.param]
    return request.param, build_package(wiring, units, tmp_path_factory.mktemp("ssp") / f"{wiring.name}.ssp")


def with_file(package: Path, target: Path, name: str, data: bytes) -> Path:
    with zipfile.ZipFile(package) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.namelist():
            new.writestr(entry, data if entry == name else old.read(entry))
    return target


@pytest.mark.e2e
def test_packages_keep_the_schemas_of_the_standard_and_the_same_units_give_the_same_bytes(
    system: tuple[str, Path], units: dict[str, Path], tmp_path: Path
) -> None:
    name, package = system
    assert problems(package) == []
    assert file_sha256(build_package(SYSTEMS[name], units, tmp_path / "again.ssp")) == file_sha256(package)
    structure = system_structure(SYSTEMS[name])
    wrong = structure.replace(b'kind="input"', b'kind="entrance"', 1)
    assert problems(with_file(package, tmp_path / "wrong.ssp", "SystemStructure.ssd", wrong)) != []
    gone = structure.replace(b"resources/road.ssv", b"resources/away.ssv")
    assert problems(with_file(package, tmp_path / "gone.ssp", "SystemStructure.ssd", gone)) == [
        "SystemStructure.ssd: no 'resources/away.ssv' in the package"
    ]


@pytest.mark.parametrize("name", SYSTEMS)
def test_sets_hold_parameters_that_their_elements_have_at_the_elements_own_starts(name: str) -> None:
    wiring = SYSTEMS[name]
    assert {"car", "road"} <= set(wiring.sets)
    for elements, values in wiring.sets.values():
        for element in elements:
            starts = {
                v.name: v.start
                for v in UNITS[wiring.elements[element]].variables
                if v.causality == "parameter"
            }
            shared = {parameter: starts[parameter] for parameter in values}
            differ = {parameter for parameter in values if shared[parameter] != values[parameter]}
            known = {"tyre.rolling_resistance"} if element == ESTIMATOR else set()
            assert differ == known, "tools that read no sets drive the same car over the same road"
    bound = Counter(p for elements, values in wiring.sets.values() if PLANT in elements for p in values)
    own = [v for v in UNITS["ReferencePlant"].variables if v.causality == "parameter" and v.start is not None]
    assert bound == dict.fromkeys([v.name for v in own if v.kind is not Kind.STRING], 1)


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_input_that_the_systems_wire_is_wired_once(name: str) -> None:
    ends = [(end, given) for _, _, end, given in SYSTEMS[name].connections]
    assert len(ends) == len(set(ends))
    torques = {(PLANT, f"wheel_torque.{wheel}") for wheel in ("fl", "fr", "rl", "rr")}
    assert torques <= set(ends)


@pytest.mark.parametrize(
    "connection",
    [
        (PLANT, "nowhere", ESTIMATOR, "vehicle_speed"),
        (PLANT, "vehicle_speed", ESTIMATOR, "TRPAC"),
        (PLANT, "vehicle_speed", ESTIMATOR, "road_class"),
    ],
)
def test_a_connection_that_does_not_fit_is_refused(connection: tuple[str, str, str, str]) -> None:
    wiring = replace(SYSTEMS["one_wheel"], connections=(connection,))
    with pytest.raises(ValueError, match="trpac_one_wheel"):
        system_structure(wiring)


def test_missing_units_are_named(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"TorquePulses, ReferencePlant, TrpacEstimator4W"):
        build_package(SYSTEMS["four_wheels"], {}, tmp_path / "x.ssp")
    assert not (tmp_path / "x.ssp").exists()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("five_wheels",), "'five_wheels' is not a system. Known: four_wheels, one_wheel."),
        (("one_wheel", "rust"), "kind is 'rust'"),
    ],
)
def test_another_system_or_kind_is_refused(given: tuple[str, ...], said: str, tmp_path: Path) -> None:
    name, *kind = given
    with pytest.raises(BuildError, match=said):
        build_system(name, tmp_path / "dist", *kind)
    assert not (tmp_path / "dist").exists()


def wired_by_hand(
    wiring: Wiring, units: dict[str, Path], folder: Path, stop_s: float
) -> Iterator[dict[str, Unit]]:
    """The system's units after each step: all are stepped, then their outputs are handed on."""
    opened = {e: Unit(unpack_unit(units[u], folder / u), name=e) for e, u in wiring.elements.items()}
    for elements, values in wiring.sets.values():
        for element in elements:
            opened[element].set(values)
    for unit in opened.values():
        unit.initialise()
    kinds = {v.name: v.kind for u in wiring.elements.values() for v in UNITS[u].variables}
    for end, given in {(end, given) for _, _, end, given in wiring.connections}:
        opened[end].set({given: 0 if kinds[given] is Kind.INTEGER else 0.0})
    for _ in range(round(stop_s / STEP_S)):
        for unit in opened.values():
            unit.step()
        for start, output, end, given in wiring.connections:
            opened[end].set({given: opened[start].get(output)})
        yield opened
    for unit in opened.values():
        unit.free()


def onto_ice(wiring: Wiring) -> Wiring:
    """The system with a car that rolls, on a road of one icy segment."""
    changes = {
        "plant": {"initial.vehicle_speed": 10.0},
        "road": {"road.segments": 1, "road.segment_1.class_left": 2, "road.segment_1.class_right": 2}
        | {f"road.segment_1.theta_{side}": 0.3 for side in ("left", "right")},
    }
    sets = {name: (to, {**values, **changes.get(name, {})}) for name, (to, values) in wiring.sets.items()}
    return replace(wiring, sets=sets)


@pytest.mark.e2e
@pytest.mark.parametrize("name", beyond(1, SYSTEMS))
def test_the_package_runs_as_the_units_wired_by_hand(
    name: str, units: dict[str, Path], tmp_path: Path
) -> None:
    wiring = onto_ice(SYSTEMS[name])
    expected = []
    for opened in wired_by_hand(wiring, units, tmp_path, RUN_S):
        expected.append((opened[PLANT].get("vehicle_speed"), opened[ESTIMATOR].get(OUTPUT[name])))
    package = build_package(wiring, units, tmp_path / "ice.ssp")
    result = simulate(package, RUN_S - STEP_S / 2.0)
    watch = f"{ESTIMATOR}.{OUTPUT[name]}"
    seen = list(zip(result[f"{PLANT}.vehicle_speed"], result[watch], strict=True))
    assert seen == expected
    assert expected[0][1] > 0.6
    assert expected[-1][1] == pytest.approx(0.3, abs=0.05), "the estimate has come down to the ice"


@pytest.mark.e2e
def test_a_changed_set_changes_the_run(units: dict[str, Path], tmp_path: Path) -> None:
    wiring = SYSTEMS["one_wheel"]
    package = build_package(wiring, units, tmp_path / "whole.ssp")
    _, values = wiring.sets["plant"]
    fast = parameter_set("plant", {**values, "initial.vehicle_speed": 12.5})
    _, values = wiring.sets["road"]
    icy = parameter_set("road", {**values, "road.segments": 1, "road.segment_1.theta_left": 0.25})
    once = with_file(package, tmp_path / "fast.ssp", "resources/plant.ssv", fast)
    changed = with_file(once, tmp_path / "icy.ssp", "resources/road.ssv", icy)
    assert problems(changed) == []
    result = simulate(changed, 0.01)
    assert result[f"{PLANT}.vehicle_speed"][0] == pytest.approx(12.5, abs=0.01)
    assert result[f"{PLANT}.theta.fl"][-1] == 0.25
    bound = {parameter.name: parameter.value for parameter in bound_parameters(changed).parameters}
    assert bound["plant.initial.vehicle_speed"] == 12.5
    assert bound["estimator.vehicle.mass"] == bound["plant.vehicle.mass"]


@pytest.mark.e2e
def test_a_set_of_the_system_in_km_h_wins_over_those_of_its_elements(
    units: dict[str, Path], tmp_path: Path
) -> None:
    package = build_package(SYSTEMS["one_wheel"], units, tmp_path / "whole.ssp")
    given = (
        f'<ParameterSet xmlns="{SSV}" xmlns:ssc="{SSC}" version="1.0" name="fast"><Parameters>'
        '<Parameter name="initial.vehicle_speed"><Real value="45" unit="km/h"/></Parameter></Parameters><Units>'
        '<ssc:Unit name="km/h"><ssc:BaseUnit m="1" s="-1" factor="0.2777777777777778"/></ssc:Unit></Units>'
        "</ParameterSet>"
    )
    binding = (
        f'<ssd:ParameterBindings><ssd:ParameterBinding prefix="{PLANT}."><ssd:ParameterValues>{given}'
        "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    with zipfile.ZipFile(package) as archive:
        structure = archive.read("SystemStructure.ssd").decode()
    changed = structure.replace("<ssd:Elements>", f"{binding}<ssd:Elements>", 1)
    fast = with_file(package, tmp_path / "fast.ssp", "SystemStructure.ssd", changed.encode())
    assert problems(fast) == []
    result = simulate(fast, 0.01)
    assert result[f"{PLANT}.vehicle_speed"][0] == pytest.approx(12.5, abs=0.01)


LIBCOSIM = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
log_output_level(CosimLogLevel.FATAL)
execution = CosimExecution.from_ssp_file(sys.argv[1], 1_000_000)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
assert execution.step(int(sys.argv[2]))
values = {}
for slave in execution.slave_infos():
    for variable in execution.slave_variables(slave.index):
        name = f"{slave.name.decode()}.{variable.name.decode()}"
        if name in sys.argv[3:]:
            values[name] = observer.last_real_values(slave.index, [variable.reference])[0]
print(*(values[name] for name in sys.argv[3:]))
"""
ECOS = """
import sys
from ecospy import EcosSimulation
simulation = EcosSimulation(ssp_path=sys.argv[1], step_size=0.001)
assert simulation.init()
simulation.step(int(sys.argv[2]))
print(*(simulation.get_real(name.replace(".", "::", 1)) for name in sys.argv[3:]))
simulation.terminate()
"""


@pytest.fixture(scope="module")
def drive(
    units: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, int, dict[str, float]]:
    """A package, the steps that it was run in fmpy, and what it came to."""
    package = build_package(
        SYSTEMS["four_wheels"], units, tmp_path_factory.mktemp("drive") / "four_wheels.ssp"
    )
    result = simulate(package, 0.4 - STEP_S / 2.0)
    names = (
        f"{PLANT}.vehicle_speed",
        f"{PLANT}.position",
        f"{ESTIMATOR}.TRPAC.rl",
        f"{ESTIMATOR}.tyre_force.rl",
    )
    return package, len(result), {name: result[name][-1] for name in names}


@pytest.mark.e2e
@pytest.mark.parametrize(("client", "code"), [("libcosimpy", LIBCOSIM), ("ecospy", ECOS)])
def test_other_tools_run_the_package_to_the_same_end(
    drive: tuple[Path, int, dict[str, float]], client: str, code: str
) -> None:
    need_client(client)
    package, steps, reached = drive
    done = subprocess.run(
        [sys.executable, "-c", code, package, str(steps), *reached],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    theirs = np.array(done.stdout.splitlines()[-1].split(), float)
    # Their masters hand outputs on in another order: fmpy's estimator begins with a step on zeros.
    *ours, our_force = reached.values()
    assert theirs[:-1] == pytest.approx(ours, abs=0.001)
    assert theirs[-1] == pytest.approx(our_force, rel=0.05)
    assert theirs[-1] > 100.0, "the estimator has been given the car's signals"


@pytest.mark.e2e
def test_with_the_native_estimator_the_package_runs_to_the_same_bits(
    units: dict[str, Path], native_file: Path, tmp_path: Path
) -> None:
    wiring = onto_ice(SYSTEMS["one_wheel"])
    both = [
        build_package(wiring, units | chosen, tmp_path / name)
        for name, chosen in (("python.ssp", {}), ("native.ssp", {"TrpacEstimator": native_file}))
    ]
    assert problems(both[1]) == []
    expected, result = (simulate(package, RUN_S) for package in both)
    assert expected.dtype == result.dtype
    assert all(np.array_equal(expected[name], result[name]) for name in expected.dtype.names)
    assert result[f"{ESTIMATOR}.TRPAC"][-1] == pytest.approx(0.3, abs=0.05), (
        "the estimate came down to the ice"
    )


@pytest.mark.e2e
@pytest.mark.parametrize(("client", "code"), beyond(1, [("ecospy", ECOS), ("libcosimpy", LIBCOSIM)]))
def test_in_other_tools_the_native_estimator_gives_the_same_bits(
    units: dict[str, Path], native_file: Path, tmp_path: Path, client: str, code: str
) -> None:
    need_client(client)
    watch = [f"{ESTIMATOR}.{name}" for name in ("TRPAC", "tyre_force", "slip", "K_v")]
    ends = []
    for name, chosen in (("python.ssp", {}), ("native.ssp", {"TrpacEstimator": native_file})):
        package = build_package(SYSTEMS["one_wheel"], units | chosen, tmp_path / name)
        done = subprocess.run(
            [sys.executable, "-c", code, package, "700", *watch],
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
        ends.append(done.stdout.splitlines()[-1])
    assert ends[1] == ends[0]
    assert float(ends[1].split()[1]) > 100.0, "the estimator has been given the car's signals"


@pytest.mark.e2e
def test_command_line_builds_validates_runs_and_prints_the_hash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build_ssp, "RUN_S", 0.005)
    assert build_ssp.main(["--system", "one_wheel", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert file_sha256(tmp_path / "trpac_one_wheel.ssp") in printed
    assert "against the schemas of SSP 1.0" in printed
    assert build_ssp.main(["--system", "five_wheels"]) == EXIT_USAGE
    assert "four_wheels, one_wheel" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert build_ssp.main(["--out", str(tmp_path / "file")]) == EXIT_BUILD


@pytest.mark.e2e
@pytest.mark.skipif(find_spec("ziglang") is not None, reason="builds for all platforms, which takes minutes")
@long
def test_command_line_builds_with_the_native_estimator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, native_file: Path
) -> None:
    monkeypatch.setattr(build_ssp, "RUN_S", 0.005)
    assert build_ssp.main(["--system", "one_wheel", "--kind", "native", "--out", str(tmp_path)]) == 0
    package = tmp_path / "trpac_one_wheel_native.ssp"
    assert file_sha256(package) in capsys.readouterr().out
    with zipfile.ZipFile(package) as archive:
        assert archive.read("resources/TrpacEstimator.fmu") == native_file.read_bytes()
