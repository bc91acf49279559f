"""A case: a car as published, windows of its logs, and the steps by which its simulation was improved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scenarios.errors import ScenarioError
from scenarios.files import VehicleFile, load_road, load_vehicle
from scenarios.strict import load_strict
from sim2real.how_far.gap import measure
from sim2real.logs import load_mapping, read_log
from sim2real.logs.mapping import MAPPINGS
from sim2real.observing.drive import Drive, awake
from sim2real.observing.evidence import Evidence, gather
from sim2real.observing.observer import Simulation
from sim2real.result import Measure
from sim2real.sources import drive_of, on_grid

FOLDER = Path(__file__).parent


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Window(_Part):
    """A piece of a log, from one time up to another in the log's own clock [s]."""

    log: str
    road: str = "road.yaml"
    from_s: float = 0.0
    to_s: float = math.inf


class Step(_Part):
    """What is changed on top of the steps before: values of vehicle.yaml by name, effects, the mapping."""

    name: str
    vehicle: dict[str, float] = Field(default_factory=dict)
    effects: dict[str, dict[str, float]] = Field(default_factory=dict)
    mapping: str | None = None


class Case(_Part):
    """case.yaml."""

    schema_: Literal[1] = Field(alias="schema")
    mapping: str
    fit: Annotated[list[Window], Field(min_length=1)]
    holdout: Window
    steps: Annotated[list[Step], Field(min_length=1)]


@dataclass(frozen=True)
class Stage:
    """A case after one of its steps: the simulation, and the drives that it is held against."""

    name: str
    model: Simulation
    fit: tuple[Drive, ...]
    holdout: Drive


def case_names() -> tuple[str, ...]:
    """All cases, in alphabetical order."""
    return tuple(sorted(path.parent.name for path in FOLDER.glob("*/case.yaml")))


def load_case(name: str) -> Case:
    """Read a case by name.

    Raises
    ------
    ScenarioError
        There is none, or its file is wrong.
    """
    if name not in case_names():
        raise ScenarioError(f"{name!r} is no case. Known: {', '.join(case_names())}.")
    return load_strict(FOLDER / name / "case.yaml", Case)


def stages(name: str, data: Path) -> list[Stage]:
    """A case after each of its steps, on the logs below a folder.

    Raises
    ------
    ScenarioError
        Unusable files.
    """
    case = load_case(name)
    values: dict[str, Any] = load_vehicle(FOLDER / name / "vehicle.yaml").model_dump(by_alias=True)
    mapping, out = case.mapping, []
    for step in case.steps:
        mapping = step.mapping or mapping
        for key, value in step.vehicle.items():
            (values["tyre"] if key in values["tyre"] else values)[key] = value
        values["effects"] = {**values["effects"], **step.effects}
        try:
            car = VehicleFile.model_validate(values)
        except ValidationError as error:
            raise ScenarioError(f"{name}, step {step.name!r}: {error}") from error
        *fit, holdout = (_drive(name, mapping, window, data) for window in (*case.fit, case.holdout))
        out.append(Stage(step.name, Simulation(car), tuple(fit), holdout))
    return out


def _drive(name: str, mapping: str, window: Window, data: Path) -> Drive:
    own = FOLDER / name / mapping
    columns = load_mapping(own if own.exists() else MAPPINGS / mapping)
    log = read_log(data / window.log, columns).window(window.from_s, window.to_s)
    return awake(drive_of(log, load_road(FOLDER / name / window.road), on_grid(log)))


def budget(found: list[Stage]) -> list[Measure]:
    """The hold-out's gap after each step, all in units of one noise: the one read off the last step's residuals.

    A diagnosis reads the noise anew with the model that it ends with: its totals do not compare between steps.
    """
    noise = gather(found[-1].model, [found[-1].holdout]).noises
    out = []
    for stage in found:
        held = Evidence((stage.holdout,), noise)
        out.append(measure(held, held.residuals(stage.model)))
    return out
