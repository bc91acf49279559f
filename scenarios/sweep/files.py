"""The sweep file: scenario, number of runs, drawn values, varied quantities and their levels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenarios.errors import ScenarioError, suggestion
from scenarios.files import Scenario, SurfaceName, load_scenario
from scenarios.library import located, shipped
from scenarios.strict import load_strict
from scenarios.sweep.trackers import ADDRESS, problem_of_address, problem_of_tracker
from trpac_core.files import file_sha256, quoted
from trpac_core.parameters.settings import ESTIMATOR_PARAMETERS

MOST_RUNS = 1_000_000
"""Greatest number of runs over all levels."""
MOST_LISTED = 1000
"""Greatest number of levels of a quantity, or of values to choose from."""
MOST_NAMED = 100
"""Greatest number of estimators, or of varied quantities."""
MOST_ROWS = 20_000
"""Greatest number of rows of a run: stretches of road times estimators."""
LARGEST = 1e6
"""Bound of parameters for which the unit has none, in the parameter's unit."""
MOST_SEED = 2**63 - 1
"""Greatest seed: it is stored in a column of 64 bits."""


class _Section(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Drawn(_Section):
    """Distribution of a number; exactly one of the kinds."""

    uniform: list[float] | None = None
    """Lowest and highest value."""
    normal: list[float] | None = None
    """Mean and standard deviation."""
    choice: Annotated[list[float], Field(min_length=1, max_length=MOST_LISTED)] | None = None
    """Equally likely values."""

    @model_validator(mode="after")
    def _check(self) -> Drawn:
        given = [kind for kind in ("uniform", "normal", "choice") if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(f"names {given or 'no kind'}; expected exactly one of uniform, normal, choice.")
        if self.uniform is not None and not (len(self.uniform) == 2 and self.uniform[0] <= self.uniform[1]):
            raise ValueError(f"uniform is {quoted(self.uniform)}; expected [lowest, highest].")
        if self.normal is not None and not (len(self.normal) == 2 and self.normal[1] >= 0.0):
            raise ValueError(f"normal is {quoted(self.normal)}; expected [mean, standard deviation].")
        return self

    def sample(self, random: np.random.Generator, within: tuple[float, float]) -> float:
        """A drawn value; values of a normal distribution are limited to the range."""
        if self.uniform is not None:
            return float(random.uniform(self.uniform[0], self.uniform[1]))
        if self.normal is not None:
            return float(np.clip(random.normal(self.normal[0], self.normal[1]), *within))
        return float(random.choice(np.array(self.choice)))


Number = float | Drawn
"""A number, or its distribution."""


def extremes(number: Number) -> tuple[float, float]:
    """Lowest and highest value of a number; of a normal distribution its mean."""
    if not isinstance(number, Drawn):
        return number, number
    if number.uniform is not None:
        return number.uniform[0], number.uniform[1]
    if number.normal is not None:
        return number.normal[0], number.normal[0]
    values = number.choice or [0.0]
    return min(values), max(values)


class RoadDraw(_Section):
    """A road per run: one stretch of each surface, with friction drawn within the range of its class."""

    order: Literal["random", "as_listed"] = "random"
    stretch_m: Annotated[float, Field(ge=1.0, le=10_000.0)] = 20.0
    friction: Annotated[dict[SurfaceName, list[float]], Field(min_length=1)]
    """Lowest and highest friction by surface [-]."""

    @model_validator(mode="after")
    def _check(self) -> RoadDraw:
        for surface, span in self.friction.items():
            if not (len(span) == 2 and 0.02 <= span[0] <= span[1] <= 1.2):
                raise ValueError(
                    f"friction.{surface} is {quoted(span)}; expected [lowest, highest] within 0.02 and 1.2."
                )
        return self


class PedalDraw(_Section):
    """A driver of pedal pulses; see `scenarios.sweep.pedal`."""

    grip_use: Number = Field(default_factory=lambda: Drawn(uniform=[0.75, 0.95]))
    """Share of theta F_z that a pulse demands, per pulse [-]."""
    pulse_s: Number = Field(default_factory=lambda: Drawn(uniform=[0.34, 0.5]))
    """Length of a pulse, per pulse [s]."""
    period_s: Annotated[float, Field(ge=0.3, le=5.0)] = 0.58
    light_torque_nm: Annotated[float, Field(ge=0.0, le=100_000.0)] = 60.0
    """Torque on dry road after the launch [N m]."""


class VehicleDraw(_Section):
    """The car of plant and estimator: factors on the scenario's vehicle file [-]."""

    mass_factor: Number = 1.0
    stiffness_factor: Number = 1.0


class Believed(_Section):
    """The estimator's assumptions as factors on the true values [-]."""

    mass_factor: Number = 1.0
    radius_factor: Number = 1.0
    stiffness_factor: Number = 1.0
    torque_factor: Number = 1.0


class SensorDraw(_Section):
    """Errors of the sensors."""

    noise_factor: Number = 1.0
    noise_known_factor: Number | None = None
    """Noise that the estimator assumes, as a factor on the scenario's; by default the true noise."""
    speed_bias_m_s: Number = 0.0
    """Constant error of the vehicle speed [m/s]."""


class CameraDraw(_Section):
    """Disturbances of the camera's classes, in addition to the errors of class process or pictures."""

    source: Literal["class_process", "rendered", "none"] = "class_process"
    wrong_share: Number = 0.0
    """Share of the distance with a wrong class of confidence 0.95, so flag 1 [-]."""
    wrong_length_m: Annotated[float, Field(ge=0.1, le=10_000.0)] = 5.0
    """Mean length of a stretch with a wrong class [m]."""
    lost_share: Number = 0.0
    """Share of lost frames [-]."""
    late_s: Number = 0.0
    """Delay from picture to class on the bus, where it is stamped [s]."""
    class_value_offset: Number = 0.0
    """Added to the adhesion that the estimator assumes for each class [-]."""
    confidence_factor: Number = 1.0
    """Factor on every Q_v; 0: the flag is never set [-]."""


class Axis(_Section):
    """A varied quantity and its levels, with `runs` runs each; all else is drawn alike on every level."""

    parameter: str
    levels: Annotated[list[float], Field(min_length=1, max_length=MOST_LISTED)]


class SweepFile(_Section):
    """The content of sweep.yaml; the scenario is a shipped one's name, or a path relative to the file."""

    schema_: Literal[1] = Field(alias="schema")
    name: Annotated[str, Field(max_length=200)]
    description: Annotated[str, Field(max_length=10_000)] = ""
    scenario: str
    runs: Annotated[int, Field(ge=1, le=MOST_RUNS)]
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 0
    estimators: Annotated[list[str], Field(min_length=1, max_length=MOST_NAMED)] = ["IFE", "DE", "DIFE"]
    road: RoadDraw | None = None
    pedal: PedalDraw | None = None
    vehicle: VehicleDraw = Field(default_factory=VehicleDraw)
    believed: Believed = Field(default_factory=Believed)
    sensors: SensorDraw = Field(default_factory=SensorDraw)
    camera: CameraDraw = Field(default_factory=CameraDraw)
    unit: dict[str, float] = Field(default_factory=dict)
    """Parameters of the estimator by the unit's names, in place of the default ones."""
    vary: Annotated[list[Axis], Field(max_length=MOST_NAMED)] = Field(default_factory=list)

    @property
    def levels(self) -> int:
        """Number of levels of all varied quantities; 1 where none is varied."""
        return sum(len(axis.levels) for axis in self.vary) or 1

    @model_validator(mode="after")
    def _check(self) -> SweepFile:
        known = list(drawn_numbers(self))
        problems = [
            f"vary[{i}].parameter is {quoted(repr(axis.parameter))}; {suggestion(axis.parameter, known)}"
            for i, axis in enumerate(self.vary)
            if axis.parameter not in known
        ]
        problems += _problems_of_unit(self.unit)
        problems += [text for name in self.estimators if (text := problem_of_tracker(name))]
        twice = sorted({name for name in self.estimators if self.estimators.count(name) > 1})
        problems += [f"estimators names {name} twice." for name in twice]
        problems += [text for name, value in _all_numbers(self) if (text := _out_of_range(name, value))]
        runs = self.runs * self.levels
        if runs > MOST_RUNS:
            problems.append(f"runs times levels are {runs}; expected at most {MOST_RUNS}.")
        if problems:
            raise ValueError("\n".join(problems))
        return self


def _problems_of_unit(given: dict[str, float]) -> list[str]:
    """Problems of parameters of the estimator: unknown names, and values out of the unit's bounds."""
    reals = {v.name: v for v in ESTIMATOR_PARAMETERS if v.unit}
    problems = []
    for name, value in given.items():
        if name not in reals:
            problems.append(f"unit.{quoted(name)}: unknown; {suggestion(quoted(name), list(reals))}")
            continue
        low, high = reals[name].minimum, reals[name].maximum
        low, high = -LARGEST if low is None else low, LARGEST if high is None else high
        if not low <= value <= high:
            problems.append(f"unit.{name} is {value:g}; expected within {low:g} and {high:g}.")
    return problems


RANGES = {
    "pedal.grip_use": (0.05, 3.0),
    "pedal.pulse_s": (0.1, 5.0),
    "vehicle.mass_factor": (0.3, 3.0),
    "vehicle.stiffness_factor": (0.2, 5.0),
    "believed.mass_factor": (0.3, 3.0),
    "believed.radius_factor": (0.5, 2.0),
    "believed.stiffness_factor": (0.2, 5.0),
    "believed.torque_factor": (0.1, 5.0),
    "sensors.noise_factor": (0.0, 1000.0),
    "sensors.noise_known_factor": (0.0, 1000.0),
    "sensors.speed_bias_m_s": (-5.0, 5.0),
    "camera.wrong_share": (0.0, 1.0),
    "camera.lost_share": (0.0, 1.0),
    "camera.late_s": (0.0, 10.0),
    "camera.class_value_offset": (-0.4, 0.4),
    "camera.confidence_factor": (0.0, 1.0),
}
"""Range of each drawn number, in the unit of its name."""

PER_PULSE = ("pedal.grip_use", "pedal.pulse_s")
"""Numbers that are drawn for every pulse, not once per run."""


def sample(name: str, number: Number, random: np.random.Generator) -> float:
    """A value of the number of this name."""
    return number.sample(random, RANGES[name]) if isinstance(number, Drawn) else float(number)


def drawn_numbers(file: SweepFile) -> dict[str, Number]:
    """Numbers that are drawn once per run, by their paths in the file."""
    return {name: value for name, value in _numbers(file) if name not in PER_PULSE}


def _numbers(file: SweepFile) -> list[tuple[str, Number]]:
    found: list[tuple[str, Number]] = []
    for path in RANGES:
        section, key = path.split(".")
        owner = getattr(file, section)
        value = None if owner is None else getattr(owner, key)
        if path == "sensors.noise_known_factor" or value is not None:
            found.append((path, 1.0 if value is None else value))
    return found


def _all_numbers(file: SweepFile) -> list[tuple[str, Number]]:
    """The numbers of the file, and the levels that replace them."""
    levels = [(axis.parameter, level) for axis in file.vary for level in axis.levels]
    return [*_numbers(file), *levels]


def _out_of_range(name: str, value: Number) -> str | None:
    if name not in RANGES:
        return None
    low, high = extremes(value)
    least, most = RANGES[name]
    if isinstance(value, Drawn) and value.normal is not None and value.normal[1] > most - least:
        return f"{name} has a deviation of {value.normal[1]:g}; expected at most {most - least:g}."
    if least <= low and high <= most:
        return None
    return f"{name} reaches from {low:g} to {high:g}; expected within {least:g} and {most:g}."


@dataclass(frozen=True)
class Sweep:
    """A sweep file with its scenario."""

    path: Path
    file: SweepFile
    scenario: Scenario
    sha256: str = ""
    """SHA-256 of the file."""


def _with_runs(file: SweepFile, runs: int) -> SweepFile:
    """The file with another number of runs; raises ScenarioError where these are too few or too many."""
    if not 1 <= runs <= MOST_RUNS // file.levels:
        raise ScenarioError(
            f"--runs is {runs}; expected 1 to {MOST_RUNS // file.levels} for {file.levels} levels of the sweep."
        )
    return file.model_copy(update={"runs": runs})


def load_sweep(path: str | Path, *, allow_code: bool = False, runs: int | None = None) -> Sweep:
    """A sweep file with its scenario; raises ScenarioError with all problems.

    Parameters
    ----------
    path : str or Path
        The file.
    allow_code : bool
        Whether estimators may be package.module:function, which is imported and run.
    runs : int, optional
        Number of runs of each level, in place of the file's.
    """
    path = located("sweep", path)
    file = load_strict(path, SweepFile)
    if runs is not None:
        file = _with_runs(file, runs)
    addresses = [name for name in file.estimators if ADDRESS.fullmatch(name)]
    if addresses and not allow_code:
        raise ScenarioError(
            f"{quoted(path)}: estimators names {quoted(repr(addresses[0]))}, which is code that would be run. Where "
            "you trust the file: --allow-code."
        )
    try:
        named = file.scenario in shipped("scenario")
        scenario = load_scenario(file.scenario if named else path.parent / file.scenario)
    except ScenarioError as error:
        raise ScenarioError(f"{quoted(path)}: scenario: {error}") from error
    problems = [f"{quoted(path)}: {text}" for name in addresses if (text := problem_of_address(name))]
    stretches = len(scenario.road.segments if file.road is None else file.road.friction)
    if stretches * len(file.estimators) > MOST_ROWS:
        problems.append(
            f"{quoted(path)}: {stretches} stretches of road times {len(file.estimators)} estimators; expected at most "
            f"{MOST_ROWS} scores of a run."
        )
    if file.camera.source == "rendered" and scenario.camera_path is None:
        problems.append(
            f"{quoted(path)}: camera.source is 'rendered', but {quoted(scenario.path)} names no camera."
        )
    confidence = [file.camera.confidence_factor]
    confidence += [
        x for axis in file.vary if axis.parameter == "camera.confidence_factor" for x in axis.levels
    ]
    if file.camera.source == "rendered" and any(value != 1.0 for value in confidence):
        problems.append(
            f"{quoted(path)}: camera.confidence_factor is not 1, but camera.source is 'rendered': pictures have the "
            "confidence that the networks give them. Expected 'class_process' or a factor of 1."
        )
    if file.road is not None and file.pedal is None:
        problems.append(
            f"{quoted(path)}: road is drawn and pedal is not; expected both, for a pedal trace made for one friction "
            "spins the wheels on a lower one."
        )
    if problems:
        raise ScenarioError("\n".join(problems))
    return Sweep(path, file, scenario, file_sha256(path))
