"""The operations that the matrix lists, as clients of the whole FMI run them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fmpy import read_model_description

from .cases import STEP_S, STEPS, Case, Direct, Values, differences, not_finite
from .outcome import expect
from .transports import Answer, Transport
from .typed import TypedValues

OK, WARNING, DISCARD = 0, 1, 2
FEW = 20
UNEQUAL_STEPS_S = (0.001, 0.01, 0.0005, 0.002, 0.1, 0.001)

OPERATIONS = {
    "load": "load, instantiate",
    "real": "set and get Real",
    "integer": "set and get Integer",
    "boolean": "set and get Boolean",
    "text": "set and get String",
    "initialise": "a parameter, then initialise",
    "steps": f"{STEPS} steps",
    "reset": "reset and run again",
    "two": "two instances",
    "state": "save and restore in mid-run",
    "serialised": "serialised state into another instance",
    "terminate": "terminate and free",
    "again": "unload and load again",
    "zero": "a step of length 0 is discarded",
    "step_sizes": "change of step size",
    "logging": "logging on",
    "missing": "a file is missing",
    "nan": "an input is NaN",
}
"""Short name and the row's text."""


class Unit:
    """One instance over a transport, with variables by name and FMI statuses checked."""

    def __init__(self, transport: Transport, folder: Path, slot: int = 0, logging: bool = True) -> None:
        description = read_model_description(str(folder))
        self._transport, self._slot, self.time_s = transport, slot, 0.0
        self.variables = {v.name: v for v in description.modelVariables}
        self.log: list[str] = []
        resources = (folder / "resources").resolve().as_uri()
        self.call("instantiate", f"slot{slot}", description.guid, resources, str(int(logging)))

    def call(self, verb: str, *words: str, allowed: tuple[int, ...] = (OK,)) -> Answer:
        """One FMI call; NotAsExpectedError where its status is another."""
        answer = self._transport.ask(" ".join([verb, str(self._slot), *words]))
        self.log.extend(answer.log)
        expect(answer.status in allowed, f"{verb} gave status {answer.status}: {answer.value or answer.log}")
        return answer

    def set(self, values: Values) -> None:
        """Set variables by name."""
        for name, value in values.items():
            variable = self.variables[name]
            text = float(value).hex() if variable.type == "Real" else str(value)
            if variable.type == "Boolean":
                text = str(int(value))
            self.call("set", variable.type, str(variable.valueReference), text)

    def get(self, name: str) -> Any:
        """Read a variable by name."""
        variable = self.variables[name]
        text = self.call("get", variable.type, str(variable.valueReference)).value
        if variable.type == "Real":
            return float.fromhex(text)
        return text if variable.type == "String" else int(text)

    def initialise(self) -> None:
        """Up to the first step."""
        for verb in ("setup", "enter", "leave"):
            self.call(verb)

    def step(self, inputs: Values | None = None, count: int = STEPS, step_s: float = STEP_S) -> None:
        """Steps under these inputs."""
        self.set(inputs or {})
        for _ in range(count):
            self.call("step", self.time_s.hex(), step_s.hex())
            self.time_s += step_s

    def read(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Several variables."""
        return {name: self.get(name) for name in names}

    def flags(self) -> list[str]:
        """Names of the flags that are up."""
        names = [name for name in self.variables if name.split(".")[0] == "flag"]
        return [name for name in names if self.get(name)]


class Host(TypedValues):
    """Runs the operations of one client on one unit."""

    def __init__(
        self, connect: Callable[[Path], Transport], case: Case, folder: Path, pictures: tuple[Path, Path]
    ) -> None:
        self._connect, self._case, self._folder, self._pictures = connect, case, folder, pictures
        self._inputs = case.inputs(pictures[0])

    def run(self, operation: str) -> None:
        """One operation; raises NotOfferedError, NotAsExpectedError or ConnectionError."""
        getattr(self, f"_{operation}")()

    @contextmanager
    def _client(self) -> Iterator[Transport]:
        library = next((self._folder / "binaries" / "linux64").glob("*.so"))
        transport = self._connect(self._folder)
        expect(transport.ask(f"load {library}").status == OK, "the library does not load")
        yield transport
        expect(transport.ask("unload").status == OK, "the library does not unload")
        transport.close()

    @contextmanager
    def _unit(self, initialise: bool = True, logging: bool = True) -> Iterator[Unit]:
        with self._client() as transport:
            unit = Unit(transport, self._folder, logging=logging)
            if initialise:
                unit.initialise()
            yield unit
            unit.call("free")

    def _same_as_direct(self, unit: Unit, parameters: Values | None = None) -> None:
        unit.step(self._inputs)
        expect(differences(Direct(self._case, parameters).step(self._inputs), unit.read(self._case.watched)))

    def _load(self) -> None:
        with self._unit(initialise=False):
            pass

    def _set_and_get(self, values: Mapping[str, Any]) -> None:
        with self._unit(initialise=False) as unit:
            unit.set(values)
            expect([f"{n} reads {unit.get(n)!r}" for n, value in values.items() if unit.get(n) != value])

    def _initialise(self) -> None:
        name, value = self._case.parameter
        with self._unit(initialise=False) as unit:
            unit.set({name: value})
            unit.initialise()
            expect(
                differences(Direct(self._case, {name: value}).step(count=0), unit.read(self._case.watched))
            )

    def _steps(self) -> None:
        with self._unit() as unit:
            self._same_as_direct(unit)
            expect(unit.log)

    def _reset(self) -> None:
        with self._unit() as unit:
            unit.step(self._inputs, FEW)
            unit.call("reset")
            unit.initialise()
            self._same_as_direct(unit)

    def _two(self) -> None:
        with self._client() as transport:
            units = [Unit(transport, self._folder, slot) for slot in (0, 1)]
            for unit in units:
                unit.initialise()
            units[0].set(self._inputs)
            name = next(iter(self._case.drive))
            units[1].set({**self._inputs, name: 1.02 * self._case.drive[name]})
            for _ in range(STEPS):
                for unit in units:
                    unit.step(count=1)
            expected, found = Direct(self._case).step(self._inputs), units[0].read(self._case.watched)
            expect(differences(expected, found))
            expect(units[1].read(self._case.watched) != found, "the second instance does what the first does")
            units[1].call("free")
            units[0].step(count=1)
            units[0].call("free")

    def _trace(self, unit: Unit) -> list[dict[str, Any]]:
        """What the unit does in mid-run, among it the picture that was set before."""
        trace = []
        name = next(iter(self._case.drive))
        for index in range(60):
            unit.step({name: self._case.drive[name] * (1.0 + 1e-3 * index)}, count=1)
            trace.append(unit.read(self._case.watched))
        return trace

    def _drive_on(self, unit: Unit) -> None:
        unit.step(self._inputs, STEPS // 2)
        if self._case.takes_pictures:
            unit.set({"image_path": str(self._pictures[1])})

    def _state(self) -> None:
        with self._unit() as unit:
            self._drive_on(unit)
            unit.call("save", "0")
            uninterrupted = self._trace(unit)
            for _ in range(2):
                unit.call("restore", "0")
                expect(self._trace(unit) == uninterrupted, "the run from the saved state is another")
            unit.call("drop", "0")

    def _serialised(self) -> None:
        with self._client() as transport:
            first = Unit(transport, self._folder)
            first.initialise()
            self._drive_on(first)
            first.call("save", "0")
            content = first.call("serialise", "0").value
            uninterrupted = self._trace(first)
            second = Unit(transport, self._folder, slot=1)
            second.initialise()
            second.call("deserialise", "1", content)
            second.call("restore", "1")
            expect(self._trace(second) == uninterrupted, "the other instance runs another way")
            second.call("serialise", "1")
            for unit, state in ((first, "0"), (second, "1")):
                unit.call("drop", state)
                unit.call("free")

    def _terminate(self) -> None:
        with self._unit() as unit:
            unit.step(self._inputs, FEW)
            unit.call("terminate")

    def _again(self) -> None:
        for _ in range(3):
            with self._client() as transport:
                for _ in range(2):
                    unit = Unit(transport, self._folder)
                    unit.initialise()
                    self._same_as_direct(unit)
                    unit.call("terminate")
                    unit.call("free")

    def _zero(self) -> None:
        with self._unit() as unit:
            unit.step(self._inputs)
            before = unit.read(self._case.watched)
            unit.call("step", unit.time_s.hex(), "0x0p+0", allowed=(DISCARD,))
            expect(differences(before, unit.read(self._case.watched)))
            unit.step(count=FEW)

    def _step_sizes(self) -> None:
        direct = Direct(self._case)
        with self._unit() as unit:
            unit.set(self._inputs)
            for step_s in UNEQUAL_STEPS_S:
                unit.step(count=FEW, step_s=step_s)
                expected = direct.step(self._inputs, FEW, step_s)
                expect(differences(expected, unit.read(self._case.watched)))

    def _logging(self) -> None:
        for logging in (True, False):
            with self._unit(logging=logging) as unit:
                unit.step({**self._inputs, **self._case.too_much}, FEW)
                name = next(iter(self._case.too_much))
                told = [line for line in unit.log if f" {WARNING}: " in line]
                expect(len(told) == int(logging), f"{name} out of range: {len(told)} warnings: {unit.log}")

    def _missing(self) -> None:
        name, is_parameter = self._case.missing_file()
        gone = {name: str(self._pictures[0].with_name("no such file"))}
        with self._unit(initialise=not is_parameter) as unit:
            unit.set(gone)
            if is_parameter:
                unit.initialise()
                unit.call("step", "0x0p+0", STEP_S.hex(), allowed=(DISCARD,))
            else:
                unit.step(self._case.drive, FEW)
                expect(unit.flags() == [], "a flag is up without a picture")
            expect("no such file" in "".join(unit.log), f"the log does not name the file: {unit.log}")

    def _nan(self) -> None:
        with self._unit() as unit:
            unit.step(self._inputs)
            unit.step(self._case.rubbish, FEW)
            expect(not_finite(unit.read(self._case.watched), self._case.watched))
            expect(unit.flags() == [], "a flag is up")
            unit.step(self._case.drive, FEW)
