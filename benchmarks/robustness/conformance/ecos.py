"""ecospy: the engine in this process, the unit in this process or behind its proxyfmu, and the program `ecos`."""

from __future__ import annotations

import csv
import ctypes.util
import os
import shutil
import stat
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from fmpy import read_model_description

from .cases import STEP_S, STEPS, Case, Direct, Values, differences, not_finite
from .outcome import NotOfferedError, expect
from .transports import with_python
from .typed import TypedValues

TYPES = {"Real": "real", "Integer": "integer", "Boolean": "bool", "String": "string"}
NO_LOG = "instantiates with logging off"
NOT_OFFERED = {
    "state": "no states",
    "serialised": "no states",
    "zero": "the step size is above 0",
    "step_sizes": "one step size per simulation",
    "logging": NO_LOG,
}
FEW = 20
"""Steps of a short run: under ten of them the program divides by zero in its own progress report."""
DIGITS = 1e-5
"""Relative, of the numbers in the program's CSV file: it writes six digits."""


def need() -> Path:
    """Folder of ecospy's programs; raises NotOfferedError where it cannot run."""
    found = find_spec("ecospy")
    if found is None or not found.submodule_search_locations:
        raise NotOfferedError("ecospy is not installed")
    if ctypes.util.find_library("tbb") is None:
        raise NotOfferedError("needs the system library libtbb.so.12 (Debian: libtbb12)")
    return Path(found.submodule_search_locations[0]) / "binaries"


def programs() -> Path:
    """A folder with `ecos` and `proxyfmu` that can be run: the wheel brings them without that permission."""
    source, folder = need(), Path(tempfile.mkdtemp(prefix="trpac-ecos-"))
    for name in ("ecos", "proxyfmu"):
        shutil.copy(source / name, folder / name)
        (folder / name).chmod((folder / name).stat().st_mode | stat.S_IXUSR)
    return folder


class Simulation:
    """One simulation of ecos with some instances of a unit."""

    def __init__(
        self, archive: Path, count: int = 1, apart: bool = False, start: Values | None = None
    ) -> None:
        from ecospy import EcosSimulation, EcosSimulationStructure

        self.variables = {v.name: v for v in read_model_description(str(archive)).modelVariables}
        uri = f"proxyfmu://localhost?file={archive}" if apart else str(archive)
        with_values = {f"unit0::{name}": value for name, value in (start or {}).items()}
        self._structure = EcosSimulationStructure()
        for i in range(count):
            self._structure.add_model(f"unit{i}", uri)
        if with_values:
            self._structure.add_parameter_set("start", with_values)
        self.simulation = EcosSimulation(structure=self._structure, step_size=STEP_S)
        self._start = "start" if with_values else None

    def initialise(self) -> None:
        """Up to the first step."""
        expect(self.simulation.init(parameter_set=self._start), "the initialisation failed")

    def set(self, values: Values, unit: int = 0) -> None:
        """Values from the next step on."""
        for name, value in values.items():
            kind = TYPES[self.variables[name].type]
            getattr(self.simulation, f"set_{kind}")(f"unit{unit}::{name}", value)

    def get(self, name: str, unit: int = 0) -> Any:
        """A value after the last step."""
        return getattr(self.simulation, f"get_{TYPES[self.variables[name].type]}")(f"unit{unit}::{name}")

    def read(self, names: tuple[str, ...], unit: int = 0) -> dict[str, Any]:
        """Several values."""
        return {name: self.get(name, unit) for name in names}

    def flags(self) -> list[str]:
        """Names of the flags that are up."""
        return [name for name in self.variables if name.split(".")[0] == "flag" and self.get(name)]

    def end(self) -> None:
        """Terminate and free."""
        self.simulation.terminate()
        self.simulation.free()


class Ecos(TypedValues):
    """Runs the operations of ecospy on one unit, in this process or behind proxyfmu."""

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path], apart: bool = False) -> None:
        self._case, self._archive, self._pictures, self._apart = case, archive, pictures, apart
        self._inputs = case.inputs(pictures[0])
        if apart:
            os.environ["PATH"] = os.pathsep.join([str(programs()), with_python()["PATH"]])
            os.environ["LD_PRELOAD"] = with_python()["LD_PRELOAD"]
        else:
            need()

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError or NotAsExpectedError."""
        if operation in NOT_OFFERED:
            raise NotOfferedError(NOT_OFFERED[operation])
        getattr(self, f"_{operation}")()

    def _open(self, count: int = 1, start: Values | None = None) -> Simulation:
        simulation = Simulation(self._archive, count, self._apart, start)
        simulation.initialise()
        return simulation

    def _load(self) -> None:
        Simulation(self._archive, 1, self._apart).simulation.free()

    def _set_and_get(self, values: Values) -> None:
        causality = {v.name: v.causality for v in read_model_description(str(self._archive)).modelVariables}
        inputs = {n: v for n, v in values.items() if causality[n] == "input"}
        simulation = self._open(start={n: v for n, v in values.items() if n not in inputs})
        simulation.set(inputs)
        simulation.simulation.step(1)
        expect([f"{n} reads {simulation.get(n)!r}" for n, v in values.items() if simulation.get(n) != v])
        simulation.end()

    def _initialise(self) -> None:
        name, value = self._case.parameter
        simulation = self._open(start={name: value})
        expect(
            differences(Direct(self._case, {name: value}).step(count=0), simulation.read(self._case.watched))
        )
        simulation.end()

    def _same_as_direct(self, simulation: Simulation) -> None:
        simulation.set(self._inputs)
        simulation.simulation.step(STEPS)
        expected = Direct(self._case).step(self._inputs)
        expect(differences(expected, simulation.read(self._case.watched)))

    def _steps(self) -> None:
        simulation = self._open()
        self._same_as_direct(simulation)
        simulation.end()

    def _reset(self) -> None:
        simulation = self._open()
        simulation.set(self._inputs)
        simulation.simulation.step(20)
        simulation.simulation.reset()
        simulation.initialise()
        self._same_as_direct(simulation)
        simulation.end()

    def _two(self) -> None:
        simulation = self._open(2)
        name = next(iter(self._case.drive))
        simulation.set({**self._inputs, name: 1.02 * self._case.drive[name]}, 1)
        self._same_as_direct(simulation)
        first, second = (simulation.read(self._case.watched, unit) for unit in (0, 1))
        expect(first != second, "the second instance does what the first does")
        simulation.end()

    def _terminate(self) -> None:
        simulation = self._open()
        simulation.simulation.step(20)
        simulation.end()

    def _again(self) -> None:
        for _ in range(3):
            simulation = self._open()
            self._same_as_direct(simulation)
            simulation.end()

    def _missing(self) -> None:
        name, is_parameter = self._case.missing
        gone = {name: str(self._pictures[0].with_name("no such file"))}
        simulation = self._open(start=gone if is_parameter else None)
        if is_parameter:
            simulation.simulation.step(1)
            expect(simulation.get(self._case.watched[0]) == 0.0, "the outputs are not at their start")
        else:
            simulation.set({**self._case.drive, **gone})
            simulation.simulation.step(20)
            expect(simulation.flags() == [], "a flag is up without a picture")
        simulation.end()

    def _nan(self) -> None:
        simulation = self._open()
        simulation.set(self._inputs)
        simulation.simulation.step(STEPS)
        simulation.set(self._case.rubbish)
        simulation.simulation.step(20)
        expect(not_finite(simulation.read(self._case.watched), self._case.watched))
        simulation.end()


PROGRAM_RUNS = ("load", "initialise", "steps", "terminate", "missing", "nan")
"""What the program `ecos` can do from its command line, on one unit at a time."""


class EcosProgram:
    """Runs the operations of the program `ecos` on one unit."""

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path]) -> None:
        self._case, self._archive, self._pictures = case, archive, pictures
        self._variables = {v.name: v for v in read_model_description(str(archive)).modelVariables}
        self._program = programs() / "ecos"

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError or NotAsExpectedError."""
        if operation not in PROGRAM_RUNS:
            raise NotOfferedError("not on its command line")
        getattr(self, f"_{operation}")()

    def _simulate(self, values: Values, steps: int = STEPS) -> dict[str, float]:
        """The last row of the CSV file that a run writes; values act from time 0 on."""
        with tempfile.TemporaryDirectory(prefix="trpac-ecos-run-") as name:
            scenario = Path(name) / "scenario.xml"
            scenario.write_text(self._scenario(values))
            command = [self._program, "simulate", "--path", self._archive, "--stepSize", str(STEP_S)]
            command += ["--stopTime", str((steps + 0.5) * STEP_S), "--scenarioConfig", scenario]
            done = subprocess.run(
                command, cwd=name, env=with_python(), capture_output=True, text=True, timeout=120, check=False
            )
            expect(done.returncode == 0, f"exit code {done.returncode}: {(done.stdout + done.stderr)[-300:]}")
            with (Path(name) / f"{self._archive.stem}.csv").open() as file:
                *_, last = csv.DictReader(file, skipinitialspace=True)
        values_of_run = {key.split("::")[-1].split("[")[0]: text for key, text in last.items() if "::" in key}
        expect(int(last["iterations"]) == steps, f"{last['iterations']} steps, expected {steps}")
        return {n: float(values_of_run[n]) for n in self._case.watched}

    def _scenario(self, values: Values) -> str:
        space = "http://github.com/Ecos-platform/libecos/resources/schema/ScenarioConfig"
        kinds = {**TYPES, "Boolean": "boolean"}
        lines = [
            f"<ecos:variable id={quoteattr(f'instance::{name}')}>"
            f"<ecos:{kinds[self._variables[name].type]} value={quoteattr(str(value))}/></ecos:variable>"
            for name, value in values.items()
        ]
        return (
            f'<?xml version="1.0" encoding="UTF-8"?>\n<ecos:Scenario xmlns:ecos="{space}">'
            f'<ecos:action t="0" eps="0.0001">{"".join(lines)}</ecos:action></ecos:Scenario>\n'
        )

    def _load(self) -> None:
        self._simulate(self._case.drive, FEW)

    _terminate = _load

    def _initialise(self) -> None:
        raise NotOfferedError("parameters only by an SSP package")

    def _steps(self) -> None:
        inputs = self._case.inputs(self._pictures[0])
        expect(differences(Direct(self._case).step(inputs), self._simulate(inputs), DIGITS))

    def _missing(self) -> None:
        name, is_parameter = self._case.missing
        if is_parameter:
            raise NotOfferedError("parameters only by an SSP package")
        self._simulate({**self._case.drive, name: str(self._pictures[0].with_name("no such file"))})

    def _nan(self) -> None:
        values = self._simulate({**self._case.inputs(self._pictures[0]), **self._case.rubbish})
        expect(not_finite(values, self._case.watched))
