"""The operations of the matrix as co-simulation engines run them, which load, step and end units themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from fmpy import read_model_description

from .cases import STEPS, Case, Direct, Values, differences, not_finite
from .outcome import NotOfferedError, expect
from .typed import TypedValues

FEW = 20
TYPES = {"Real": "real", "Integer": "integer", "Boolean": "boolean", "String": "string"}


class Simulation(Protocol):
    """One simulation of an engine with some instances of a unit."""

    def initialise(self) -> None:
        """Up to the first step."""

    def set(self, values: Values, unit: int = 0) -> None:
        """Values from the next step on."""

    def get(self, name: str, unit: int = 0) -> Any:
        """A value after the last step."""

    def step(self, count: int) -> None:
        """Steps; NotAsExpectedError where they fail."""

    def end(self) -> None:
        """Terminate and free."""


class Engine(TypedValues):
    """Runs the operations of an engine on one unit.

    Attributes
    ----------
    not_offered : dict
        Operations that the engine lacks, and why.
    tolerance : float
        Relative, where the engine rounds.
    """

    not_offered: dict[str, str]
    tolerance = 0.0

    def __init__(self, case: Case, archive: Path, pictures: tuple[Path, Path]) -> None:
        self._case, self._archive, self._pictures = case, archive, pictures
        self._inputs = case.inputs(pictures[0])
        self._variables = {v.name: v for v in read_model_description(str(archive)).modelVariables}

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError or NotAsExpectedError."""
        if operation in self.not_offered:
            raise NotOfferedError(self.not_offered[operation])
        getattr(self, f"_{operation}")()

    def _new(self, count: int = 1, start: Values | None = None) -> Simulation:
        """A simulation with some instances; `start` are values from before the initialisation."""
        raise NotImplementedError

    def _open(self, count: int = 1, start: Values | None = None) -> Simulation:
        simulation = self._new(count, start)
        simulation.initialise()
        return simulation

    def _read(self, simulation: Simulation, unit: int = 0) -> dict[str, Any]:
        return {name: simulation.get(name, unit) for name in self._case.watched}

    def _same(self, expected: Values, simulation: Simulation) -> None:
        expect(differences(expected, self._read(simulation), self.tolerance))

    def _same_as_direct(self, simulation: Simulation) -> None:
        simulation.set(self._inputs)
        simulation.step(STEPS)
        self._same(Direct(self._case).step(self._inputs), simulation)

    def _load(self) -> None:
        self._new()

    def _set_and_get(self, values: Values) -> None:
        # Parameters can be set until the initialisation, inputs at any time; both are read after a step.
        inputs = {n: v for n, v in values.items() if self._variables[n].causality == "input"}
        simulation = self._open(start={n: v for n, v in values.items() if n not in inputs})
        simulation.set(inputs)
        simulation.step(1)
        expect([f"{n} reads {simulation.get(n)!r}" for n, v in values.items() if simulation.get(n) != v])
        simulation.end()

    def _initialise(self) -> None:
        name, value = self._case.parameter
        simulation = self._open(start={name: value})
        simulation.step(1)
        self._same(Direct(self._case, {name: value}).step(count=1), simulation)
        simulation.end()

    def _steps(self) -> None:
        simulation = self._open()
        self._same_as_direct(simulation)
        simulation.end()

    def _two(self) -> None:
        simulation = self._open(2)
        name = next(iter(self._case.drive))
        simulation.set({**self._inputs, name: 1.02 * self._case.drive[name]}, 1)
        self._same_as_direct(simulation)
        first, second = (self._read(simulation, unit) for unit in (0, 1))
        expect(first != second, "the second instance does what the first does")
        simulation.end()

    def _terminate(self) -> None:
        simulation = self._open()
        simulation.step(FEW)
        simulation.end()

    def _again(self) -> None:
        for _ in range(3):
            self._steps()

    def _missing(self) -> None:
        name, is_parameter = self._case.missing_file()
        gone = {name: str(self._pictures[0].with_name("no such file"))}
        if is_parameter:
            return self._missing_parameter(gone)
        simulation = self._open()
        simulation.set({**self._case.drive, **gone})
        simulation.step(FEW)
        flags = [n for n in self._variables if n.split(".")[0] == "flag" and simulation.get(n)]
        expect(flags == [], "a flag is up without a picture")
        return simulation.end()

    def _missing_parameter(self, gone: Values) -> None:
        """What a parameter does that names a file which is not there."""
        raise NotImplementedError

    def _nan(self) -> None:
        simulation = self._open()
        simulation.set(self._inputs)
        simulation.step(STEPS)
        simulation.set(self._case.rubbish)
        simulation.step(FEW)
        expect(not_finite(self._read(simulation), self._case.watched))
        simulation.end()
