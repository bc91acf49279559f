"""Random inputs and calls in orders that the standard allows, and what must hold after each.

Rubbish is: a sensor's value that is not finite or beyond what any road car gives (`PLAUSIBLE`), a class or a confidence
out of its range, a picture that is none. A unit that is given any in a step must not raise the flag of a wheel that it
concerns; after a stretch of good input, whatever came before, a unit with a camera must raise one. Outputs are always
finite and within the bounds that the model description states.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.robustness.conformance.cases import CASES
from benchmarks.robustness.conformance.operations import DISCARD, OK, STEP_S, Unit
from benchmarks.robustness.conformance.outcome import NotAsExpectedError
from benchmarks.robustness.conformance.transports import Fmpy
from trpac_core.sensors import LONGEST_STEP_S, PLAUSIBLE

from .mutations import Rng

ODD = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308, -0.0, 0.0, 1e9, -1e9, 2.0**31, 5e-324)
ODD_STEPS_S = (0.0, -0.001, math.nan, math.inf, 1e-9, 1e-12, 1.0, 100.0, 1e300)
JUMPS_S = (math.nan, math.inf, -1e-3, 2.0, -1.0, 1e9)
ODD_INTEGERS = (-(2**31), 2**31 - 1, -2, -1, 0, 1, 2, 3, 255)
SHARE = {
    "step": 0.82,
    "stretch": 0.04,
    "odd_step": 0.04,
    "restart": 0.03,
    "state": 0.07,
}
"""How often each act is."""
GOOD_SHARE = 0.6
"""How often a step begins with all inputs good, so that rubbish meets a unit whose flag is up."""
STRETCH, STRETCH_STEP_S = 60, 0.02
"""Good steps after which the announced road is under the wheels [-], [s]."""
GOOD_LOAD_N = 3500.0
LIMITS = {
    "wheel_speed": PLAUSIBLE["wheel_speed_rad_s"],
    "wheel_torque": PLAUSIBLE["wheel_torque_nm"],
    "vehicle_speed": PLAUSIBLE["vehicle_speed_m_s"],
    "vertical_load": PLAUSIBLE["vertical_load_n"],
    "steering_angle": PLAUSIBLE["steering_angle_rad"],
    "longitudinal_acceleration": PLAUSIBLE["longitudinal_acceleration_m_s2"],
    "lateral_acceleration": PLAUSIBLE["longitudinal_acceleration_m_s2"],
    "yaw_rate": PLAUSIBLE["yaw_rate_rad_s"],
}


def inputs_of(unit: Unit) -> dict[str, Any]:
    """Inputs without the address of a picture in memory: no unit can tell a wrong one."""
    return {n: v for n, v in unit.variables.items() if v.causality == "input" and not n.startswith("image.")}


def odd_value(variable: Any, rng: Rng, paths: list[str]) -> Any:
    """Any value of the variable's type."""
    if variable.type == "Real":
        if rng.random() < 0.5:
            return float(ODD[int(rng.integers(len(ODD)))])
        return float(rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-12.0, 12.0))
    if variable.type == "Integer":
        if rng.random() < 0.7:
            return int(ODD_INTEGERS[int(rng.integers(len(ODD_INTEGERS)))])
        return int(rng.integers(-(2**31), 2**31))
    if variable.type == "Boolean":
        return bool(rng.integers(2))
    return paths[int(rng.integers(len(paths)))]


def good_class(variables: Collection[str], rng: Rng) -> dict[str, Any]:
    """A class of the road or of each of its sides, as a bus gives it; nothing where the unit takes none."""
    surface = int(rng.integers(3))
    values: dict[str, Any] = {name: surface for name in variables if _kind(name) == "road_class"}
    return values | {
        n: float(rng.uniform(0.8, 1.0)) for n in variables if _kind(n) == "road_class_confidence"
    }


def rubbish(values: Mapping[str, Any], pictures: Collection[str]) -> set[str]:
    """Names among a unit's present inputs that no car gives; `pictures` are the paths of good ones."""
    bad = {name for name, value in values.items() if not abs_within(value, LIMITS.get(_kind(name)))}
    classes = [name for name in values if _kind(name) == "road_class"]
    if all(values[name] == -1 for name in classes) and values.get("image_path", "") not in ("", *pictures):
        bad.add("image_path")
    if values.get("frame_id", 0) != 0:
        return bad  # a class that comes with a number is read once, and then is no matter what it is
    for name in classes:
        confidence = f"road_class_confidence{name[len('road_class') :]}"
        if not (-1 <= values[name] <= 2):
            bad.add(name)
        if values[name] != -1 and not 0.0 <= values[confidence] <= 1.0:
            bad.add(confidence)
    return bad


def abs_within(value: Any, limit: float | None) -> bool:
    """Whether a value is a number within its limit, if it has one."""
    return limit is None or abs(value) <= limit


def _kind(name: str) -> str:
    return name.partition(".")[0]


def concerned(flag: str, bad: set[str]) -> set[str]:
    """Of the rubbish, what concerns this flag's wheel: its own and what the car or the camera share."""
    wheel = flag.partition(".")[2]
    own = (f".{wheel}",) if wheel else ()
    other = tuple(f".{w}" for w in ("fl", "fr", "rl", "rr") if w != wheel)
    return {name for name in bad if name.endswith(own) or not name.endswith(other)}


class Driven:
    """A unit under rubbish.

    Attributes
    ----------
    seen_up : int
        Steps after which a flag was up.
    taken_down : int
        Steps in which rubbish met a flag that was up and concerned it.
    """

    def __init__(self, folder: Path, pictures: tuple[Path, Path], broken: list[str]) -> None:
        self._case = CASES[folder.name]
        self._transport, self._folder, self._pictures = Fmpy(folder), folder, tuple(map(str, pictures))
        self._paths = [*self._pictures, *broken, "", "%s%n", "x" * 5000, "\t", "ü#+%()"]
        self._unit = self._fresh({})
        self._saved = False
        self.seen_up, self.taken_down = 0, 0

    def _fresh(self, parameters: Mapping[str, Any]) -> Unit:
        unit = Unit(self._transport, self._folder)
        unit.set(parameters)
        for verb in ("setup", "enter", "leave"):
            unit.call(verb)
        self._start = {n: _started(v, v.start) for n, v in inputs_of(unit).items()}
        self._now = dict(self._start)
        self._flags: list[str] = []
        self._discards, self._clocked = bool(parameters), False
        return unit

    def act(self, rng: Rng) -> list[str]:
        """One random act and what is wrong after it."""
        act = str(rng.choice(list(SHARE), p=list(SHARE.values())))
        try:
            problems: list[str] = getattr(self, f"_{act}")(rng)
        except NotAsExpectedError as error:
            return [f"{act}: {error}"]
        return [f"{act}: {problem}" for problem in [*problems, *self._bounds()]]

    def _good(self, rng: Rng) -> dict[str, Any]:
        # Once a load has come, none at all is a fault.
        loads = {name: GOOD_LOAD_N for name in self._start if _kind(name) == "vertical_load"}
        return {**self._start, **loads, **self._case.drive, **good_class(self._start, rng)}

    def _set_some(self, rng: Rng) -> None:
        variables = inputs_of(self._unit)
        values = self._good(rng) if rng.random() < GOOD_SHARE else dict(self._case.drive)
        for name in rng.permutation(list(variables))[: int(rng.integers(0, 4))]:
            values[str(name)] = odd_value(variables[str(name)], rng, self._paths)
        self._unit.set(values)
        self._now |= values

    def _step(self, rng: Rng, step_s: float = STEP_S, off_s: float = 0.0) -> list[str]:
        self._set_some(rng)
        before, bad = self._flags, rubbish(self._now, self._pictures)
        if not self._step_on(step_s, off_s=off_s):
            return []  # nothing has changed
        self.taken_down += any(concerned(flag, bad) for flag in before)
        return [
            f"{flag} is up with rubbish on {', '.join(sorted(concerned(flag, bad)))}"
            for flag in self._flags
            if concerned(flag, bad)
        ]

    def _step_on(self, step_s: float, count: int = 1, off_s: float = 0.0) -> bool:
        """Steps, which begin this much away from where the last one ended; whether they can be taken."""
        good = 0.0 < step_s <= LONGEST_STEP_S and off_s == 0.0
        allowed = ((OK, DISCARD) if self._discards else (OK,)) if good else (DISCARD,)
        for _ in range(count):
            begin_s = self._unit.time_s + off_s
            if self._unit.call("step", begin_s.hex(), step_s.hex(), allowed=allowed).status == OK:
                self._clocked, self._unit.time_s = True, self._unit.time_s + step_s
        self._flags = self._unit.flags()
        self.seen_up += bool(self._flags)
        return good

    def _stretch(self, rng: Rng) -> list[str]:
        """Good input for more than a second: whatever there was before, the road ahead is known again."""
        values = self._good(rng)
        self._unit.set(values)
        self._now |= values
        self._step_on(STRETCH_STEP_S, STRETCH)
        if self._case.takes_pictures and not self._discards and not self._flags:
            return [f"no flag is up after {STRETCH * STRETCH_STEP_S:g} s of good input"]
        return []

    def _odd_step(self, rng: Rng) -> list[str]:
        step_s = float(rng.choice(ODD_STEPS_S))
        # The first step, and that after a restored state, begin anywhere.
        off_s = float(rng.choice(JUMPS_S)) if self._clocked and rng.random() < 0.5 else 0.0
        return self._step(rng, step_s, off_s)

    def _restart(self, rng: Rng) -> list[str]:
        """Reset, or free and instantiate, with odd parameters at times."""
        if self._saved:
            self._unit.call("drop", "0")
            self._saved = False
        if rng.random() < 0.5:
            self._unit.call("terminate")
        self._unit.call("free")
        parameters: dict[str, Any] = {}
        if rng.random() < 0.5:
            described = Unit(self._transport, self._folder, slot=1)
            described.call("free")
            names = [n for n, v in described.variables.items() if v.causality == "parameter"]
            for name in rng.permutation(names)[: int(rng.integers(1, 3))]:
                parameters[str(name)] = odd_value(described.variables[str(name)], rng, self._paths)
        self._unit = self._fresh(parameters)
        return []

    def _state(self, _: Rng) -> list[str]:
        if self._saved:
            self._unit.call("restore", "0")
            self._clocked = False
            self._unit.call("drop", "0")
            self._look()
        else:
            self._unit.call("save", "0")
        self._saved = not self._saved
        return []

    def _look(self) -> None:
        """The inputs and flags that a state has brought."""
        self._now, self._flags = {n: self._unit.get(n) for n in self._now}, self._unit.flags()

    def _bounds(self) -> list[str]:
        problems = []
        for name, variable in self._unit.variables.items():
            if variable.causality != "output" or variable.type != "Real":
                continue
            value = self._unit.get(name)
            low = float(variable.min) if variable.min is not None else -math.inf
            high = float(variable.max) if variable.max is not None else math.inf
            if not (math.isfinite(value) and low <= value <= high):
                problems.append(f"{name} is {value!r}, stated {low:g} to {high:g}")
        return problems


def _started(variable: Any, start: Any) -> Any:
    if variable.type == "String":
        return str(start or "")
    return float(start or 0.0) if variable.type == "Real" else int(start or 0)


def write_broken(folder: Path) -> list[str]:
    """Files that are no pictures."""
    (folder / "text.png").write_text("no picture")
    (folder / "empty.jpg").write_bytes(b"")
    (folder / "start.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(200))
    return [*(str(folder / name) for name in ("text.png", "empty.jpg", "start.jpg", "none.png")), str(folder)]


def fuzzed(
    folder: Path, work: Path, seed: int, numbers: range
) -> Iterator[tuple[int, str | None, dict[str, int]]]:
    """Number, finding and counts so far of each act on the unit unpacked in `folder`."""
    from benchmarks.robustness.conformance.cases import write_pictures

    driven = Driven(folder, write_pictures(work), write_broken(work))
    for number in numbers:
        counts = {"seen_up": driven.seen_up, "taken_down": driven.taken_down}
        yield number, None, counts
        for problem in driven.act(np.random.default_rng([seed, number])):
            yield number, problem, counts
