"""ecospy: the engine in this process, the unit in this process or behind its proxyfmu."""

from __future__ import annotations

import ctypes.util
import os
import shutil
import stat
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .cases import STEP_S, Case, Values
from .engines import FEW, TYPES, Engine
from .outcome import NotOfferedError, expect
from .transports import with_python


def need() -> Path:
    """Folder of ecospy's programs; raises NotOfferedError where it cannot run."""
    found = find_spec("ecospy")
    if found is None or not found.submodule_search_locations:
        raise NotOfferedError("ecospy is not installed")
    if ctypes.util.find_library("tbb") is None:
        raise NotOfferedError("needs the system library libtbb.so.12 (Debian: libtbb12)")
    return Path(found.submodule_search_locations[0]) / "binaries"


def proxy() -> Path:
    """A folder with `proxyfmu`, made executable, which it is not in the wheel, and `unzip`, which ecos calls."""
    folder = Path(tempfile.mkdtemp(prefix="trpac-ecos-"))
    program = Path(shutil.copy(need() / "proxyfmu", folder))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    unzip = shutil.which("unzip")
    if unzip is None:
        raise NotOfferedError("needs the program unzip")
    (folder / "unzip").symlink_to(unzip)
    return folder


class EcosRun:
    """One simulation of ecos with some instances of a unit."""

    def __init__(self, uri: str, variables: dict[str, Any], count: int, start: Values) -> None:
        from ecospy import EcosSimulation, EcosSimulationStructure

        self._types = {n: {**TYPES, "Boolean": "bool"}[v.type] for n, v in variables.items()}
        self._structure = EcosSimulationStructure()
        for i in range(count):
            self._structure.add_model(f"unit{i}", uri)
        if start:
            self._structure.add_parameter_set("start", {f"unit0::{n}": v for n, v in start.items()})
        self.simulation = EcosSimulation(structure=self._structure, step_size=STEP_S)
        self._start = "start" if start else None

    def initialise(self) -> None:
        """Up to the first step."""
        expect(self.simulation.init(parameter_set=self._start), "the initialisation failed")

    def set(self, values: Values, unit: int = 0) -> None:
        """Values from the next step on."""
        for name, value in values.items():
            getattr(self.simulation, f"set_{self._types[name]}")(f"unit{unit}::{name}", value)

    def get(self, name: str, unit: int = 0) -> Any:
        """A value after the last step."""
        return getattr(self.simulation, f"get_{self._types[name]}")(f"unit{unit}::{name}")

    def step(self, count: int) -> None:
        """Steps."""
        self.simulation.step(count)

    def end(self) -> None:
        """Terminate and free."""
        self.simulation.terminate()
        self.simulation.free()


class Ecos(Engine):
    """Runs the operations of ecospy on one unit, in this process or behind proxyfmu."""

    not_offered = {  # noqa: RUF012 - a table
        "state": "no states",
        "serialised": "no states",
        "zero": "the step size is above 0",
        "step_sizes": "one step size per simulation",
        "logging": "instantiates with logging off",
    }

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path], apart: bool = False) -> None:
        super().__init__(case, archive, pictures)
        self._uri = f"proxyfmu://localhost?file={archive}" if apart else str(archive)
        if apart and case.native:
            for name in [name for name in os.environ if name.startswith(("PYTHON", "LD_"))]:
                del os.environ[name]
            os.environ["PATH"] = str(proxy())
        elif apart:
            os.environ["PATH"] = os.pathsep.join([str(proxy()), with_python()["PATH"]])
            os.environ["LD_PRELOAD"] = with_python()["LD_PRELOAD"]
        else:
            need()

    def _new(self, count: int = 1, start: Values | None = None) -> EcosRun:
        return EcosRun(self._uri, self._variables, count, start or {})

    def _load(self) -> None:
        self._new().simulation.free()

    def _reset(self) -> None:
        run = self._new()
        run.initialise()
        run.set(self._inputs)
        run.step(FEW)
        run.simulation.reset()
        run.initialise()
        self._same_as_direct(run)
        run.end()

    def _missing_parameter(self, gone: Values) -> None:
        run = self._open(start=gone)
        run.step(1)
        expect(run.get(self._case.watched[0]) == 0.0, "the outputs are not at their start")
        run.end()
