"""libcosimpy: DNV's Python binding of libcosim, which loads the units in its own process."""

from __future__ import annotations

import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .capture import said_by_libraries
from .cases import STEP_S, Case, Values
from .engines import TYPES, Engine, Simulation
from .outcome import NotOfferedError, expect

BY_BLOCKS = "TRPAC_std"
"""Renewed block of time by block of time, of which libcosim's step sizes shift the ends by a step: not compared."""


class Execution:
    """One execution of libcosim with some instances of a unit."""

    def __init__(self, archive: Path, variables: dict[str, Any], count: int = 1) -> None:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimManipulator import CosimManipulator
        from libcosimpy.CosimObserver import CosimObserver
        from libcosimpy.CosimSlave import CosimLocalSlave

        self._variables = variables
        self.execution = CosimExecution.from_step_size(round(STEP_S * 1e9))
        self._slaves = [CosimLocalSlave(str(archive), f"unit{i}") for i in range(count)]
        self._units = [self.execution.add_local_slave(slave) for slave in self._slaves]
        self._manipulator = CosimManipulator.create_override()
        self._observer = CosimObserver.create_last_value()
        done = self.execution.add_manipulator(self._manipulator), self.execution.add_observer(self._observer)
        expect(all(done) and min(self._units) >= 0, f"instances {self._units}, manipulator, observer {done}")

    def start(self, values: Values) -> None:
        """Values from before the initialisation."""
        for name, value in values.items():
            variable = self._variables[name]
            act = getattr(self.execution, f"{TYPES[variable.type]}_initial_value")
            expect(act(self._units[0], variable.valueReference, value), f"{name} cannot be set")

    def initialise(self) -> None:
        """Nothing: the first step does it."""

    def set(self, values: Values, unit: int = 0) -> None:
        """Values from the next step on."""
        for name, value in values.items():
            variable = self._variables[name]
            act = getattr(self._manipulator, f"slave_{TYPES[variable.type]}_values")
            expect(act(self._units[unit], [variable.valueReference], [value]), f"{name} cannot be set")

    def get(self, name: str, unit: int = 0) -> Any:
        """A value after the last step."""
        variable = self._variables[name]
        act = getattr(self._observer, f"last_{TYPES[variable.type]}_values")
        (value,) = act(self._units[unit], [variable.valueReference])
        return value.decode() if isinstance(value, bytes) else value

    def step(self, count: int) -> None:
        """Steps; NotAsExpectedError where they fail."""
        expect(self.execution.step(count), "the step failed")

    def end(self) -> None:
        """Nothing: it ends with its last reference."""


class Cosim(Engine):
    """Runs the operations of libcosimpy on one unit."""

    not_offered = {  # noqa: RUF012 - a table
        "reset": "no reset",
        "state": "no states",
        "serialised": "no states",
        "zero": "the step size is above 0",
        "step_sizes": "one step size per execution",
    }
    tolerance = 1e-12
    """libcosim hands over step sizes that are differences of times, off in their last digits."""

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path]) -> None:
        if find_spec("libcosimpy") is None:
            raise NotOfferedError("libcosimpy is not installed")
        super().__init__(case, archive, pictures)

    def _new(self, count: int = 1, start: Values | None = None) -> Execution:
        execution = Execution(self._archive, self._variables, count)
        execution.start(start or {})
        return execution

    def _same(self, expected: Values, simulation: Simulation) -> None:
        super()._same({n: v for n, v in expected.items() if not n.startswith(BY_BLOCKS)}, simulation)

    def _logging(self) -> None:
        with said_by_libraries(Path(tempfile.gettempdir())) as text:
            execution = self._new()
            execution.set({**self._inputs, **self._case.too_much})
            execution.step(5)
            del execution
        expect(text[0].count("status=warning") == 1, "the warning is not on libcosim's log")

    def _missing_parameter(self, gone: Values) -> None:
        expect(not self._new(start=gone).execution.step(1), "libcosim goes on after fmi2Discard")
