"""libcosimpy: DNV's Python binding of libcosim, which loads the units in its own process."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmpy import read_model_description

from .capture import said_by_libraries
from .cases import STEP_S, STEPS, Case, Direct, Values, differences, not_finite
from .outcome import NotOfferedError, expect
from .typed import TypedValues

TYPES = {"Real": "real", "Integer": "integer", "Boolean": "boolean", "String": "string"}
TIMES = 1e-12
"""Relative: libcosim hands over step sizes that are differences of times, off in their last digits."""
BY_BLOCKS = "TRPAC_std"
"""Renewed block of time by block of time, of which such step sizes shift the ends by a step: not compared."""
NOT_OFFERED = {
    "reset": "no reset",
    "state": "no states",
    "serialised": "no states",
    "zero": "the step size is above 0",
    "step_sizes": "one step size per execution",
}


class Execution:
    """One execution of libcosim with some instances of a unit."""

    def __init__(self, archive: Path, count: int = 1) -> None:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimManipulator import CosimManipulator
        from libcosimpy.CosimObserver import CosimObserver
        from libcosimpy.CosimSlave import CosimLocalSlave

        self.variables = {v.name: v for v in read_model_description(str(archive)).modelVariables}
        self.execution = CosimExecution.from_step_size(round(STEP_S * 1e9))
        self._slaves = [CosimLocalSlave(str(archive), f"unit{i}") for i in range(count)]
        self.units = [self.execution.add_local_slave(slave) for slave in self._slaves]
        self._manipulator, self._observer = (
            CosimManipulator.create_override(),
            CosimObserver.create_last_value(),
        )
        done = self.execution.add_manipulator(self._manipulator), self.execution.add_observer(self._observer)
        expect(all(done) and min(self.units) >= 0, f"instances {self.units}, manipulator, observer {done}")

    def start(self, values: Values, unit: int = 0) -> None:
        """Values from before the initialisation."""
        for name, value in values.items():
            variable = self.variables[name]
            act = getattr(self.execution, f"{TYPES[variable.type]}_initial_value")
            expect(act(self.units[unit], variable.valueReference, value), f"{name} cannot be set")

    def set(self, values: Values, unit: int = 0) -> None:
        """Values from the next step on."""
        for name, value in values.items():
            variable = self.variables[name]
            act = getattr(self._manipulator, f"slave_{TYPES[variable.type]}_values")
            expect(act(self.units[unit], [variable.valueReference], [value]), f"{name} cannot be set")

    def get(self, name: str, unit: int = 0) -> Any:
        """A value after the last step."""
        variable = self.variables[name]
        act = getattr(self._observer, f"last_{TYPES[variable.type]}_values")
        (value,) = act(self.units[unit], [variable.valueReference])
        return value.decode() if isinstance(value, bytes) else value

    def read(self, names: tuple[str, ...], unit: int = 0) -> dict[str, Any]:
        """Several values."""
        return {name: self.get(name, unit) for name in names}

    def step(self, count: int = STEPS) -> None:
        """Steps; NotAsExpectedError where they fail."""
        expect(self.execution.step(count), "the step failed")


class Cosim(TypedValues):
    """Runs the operations of libcosimpy on one unit."""

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path]) -> None:
        if find_spec("libcosimpy") is None:
            raise NotOfferedError("libcosimpy is not installed")
        self._case, self._archive, self._pictures = case, archive, pictures
        self._inputs = case.inputs(pictures[0])

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError or NotAsExpectedError."""
        if operation in NOT_OFFERED:
            raise NotOfferedError(NOT_OFFERED[operation])
        getattr(self, f"_{operation}")()

    def _load(self) -> None:
        Execution(self._archive)

    def _set_and_get(self, values: Values) -> None:
        execution = Execution(self._archive)
        # Parameters can be set until the initialisation, inputs at any time; both are read after a step.
        inputs = {n: v for n, v in values.items() if execution.variables[n].causality == "input"}
        execution.start({n: v for n, v in values.items() if n not in inputs})
        execution.set(inputs)
        execution.step(1)
        expect(
            [f"{n} reads {execution.get(n)!r}" for n, value in values.items() if execution.get(n) != value]
        )

    def _initialise(self) -> None:
        name, value = self._case.parameter
        execution = Execution(self._archive)
        execution.start({name: value})
        execution.step(1)
        expected = Direct(self._case, {name: value}).step(count=1)
        expect(differences(expected, execution.read(self._case.watched), TIMES))

    def _steps(self) -> None:
        self._same_as_direct(Execution(self._archive))

    def _same_as_direct(self, execution: Execution) -> None:
        execution.set(self._inputs)
        execution.step()
        expected = Direct(self._case).step(self._inputs)
        exact = {n: v for n, v in expected.items() if not n.startswith(BY_BLOCKS)}
        expect(differences(exact, execution.read(self._case.watched), TIMES))

    def _two(self) -> None:
        execution = Execution(self._archive, 2)
        name = next(iter(self._case.drive))
        execution.set({**self._inputs, name: 1.02 * self._case.drive[name]}, 1)
        self._same_as_direct(execution)
        first, second = (execution.read(self._case.watched, unit) for unit in (0, 1))
        expect(first != second, "the second instance does what the first does")

    def _terminate(self) -> None:
        execution = Execution(self._archive)
        execution.step(1)
        del execution

    def _again(self) -> None:
        for _ in range(3):
            self._same_as_direct(Execution(self._archive))

    def _warning(self) -> str:
        with self._said() as text:
            execution = Execution(self._archive)
            execution.set({**self._inputs, **self._case.too_much})
            execution.step(5)
        return text[0]

    @contextmanager
    def _said(self) -> Iterator[list[str]]:
        with said_by_libraries(Path(tempfile.gettempdir())) as text:
            yield text

    def _logging(self) -> None:
        expect(self._warning().count("status=warning") == 1, "the warning is not on libcosim's log")

    def _missing(self) -> None:
        name, is_parameter = self._case.missing
        gone = {name: str(self._pictures[0].with_name("no such file"))}
        execution = Execution(self._archive)
        if is_parameter:
            execution.start(gone)
            expect(not execution.execution.step(1), "libcosim goes on after fmi2Discard")
            return
        execution.set({**self._case.drive, **gone})
        execution.step(20)
        flags = [n for n in execution.variables if n.split(".")[0] == "flag" and execution.get(n)]
        expect(flags == [], "a flag is up without a picture")

    def _nan(self) -> None:
        execution = Execution(self._archive)
        execution.set(self._inputs)
        execution.step()
        execution.set(self._case.rubbish)
        execution.step(20)
        expect(not_finite(execution.read(self._case.watched), self._case.watched))
        name = next(iter(self._case.rubbish))
        expect(math.isnan(execution.get(name)), f"{name} does not read NaN")
