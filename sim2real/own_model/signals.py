"""The file that says which variable of a unit is which signal of a log, and what may be tuned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenarios.effects import EFFECTS
from scenarios.errors import suggestion
from scenarios.strict import load_strict, made
from sim2real.logs.contract import COLUMNS
from sim2real.logs.mapping import Mapping, MappingFile, mapping_of
from sim2real.logs.units import factor
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]
TORQUES = tuple(f"wheel_torque_{w}_nm" for w in WHEELS)
BEGINS = ("vehicle_speed_m_s", "position_m", *(f"wheel_speed_{w}_rad_s" for w in WHEELS))
"""Signals whose first value a unit may be begun with."""

Number = Annotated[float, Field(ge=-1e12, le=1e12)]
Name = Annotated[str, Field(min_length=1, max_length=1_000)]


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class _Scaled(_Strict):
    """A value of the unit: sign * scale * (signal in `unit`) + offset."""

    unit: Name | None = None
    sign: Literal[1, -1] = 1
    scale: Number = 1.0
    offset: Number = 0.0

    def scaled(self, values: Array, of: str) -> Array:
        """What the unit is given for values in the log format's unit `of`."""
        by = self.sign * self.scale / (1.0 if self.unit is None else factor(self.unit, of))
        return np.asarray(by * values + self.offset)

    def unit_problems(self, of: str) -> list[str]:
        """What is wrong with `unit`, empty without anything."""
        try:
            factor(self.unit or of.replace(" ", ""), of)
        except ValueError as error:
            return [str(error)]
        return []


class Input(_Scaled):
    """An input of the unit: a wheel's torque, or the sum of several.

    `part` takes what drives (`positive`), or what brakes (`negative`), with 0 elsewhere.
    """

    signal: Name | None = None
    sum: Annotated[list[Name], Field(max_length=4)] = Field(default_factory=list)
    part: Literal["all", "positive", "negative"] = "all"

    @model_validator(mode="after")
    def _check(self) -> Input:
        problems = self.unit_problems("N m")
        if (self.signal is None) == (not self.sum):
            problems.append("expected `signal: wheel_torque_fl_nm`, or `sum: [...]` of such names.")
        problems += [
            f"{name!r} is no torque of a log; {suggestion(name, TORQUES)}"
            for name in self.signals
            if name not in TORQUES
        ]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    @property
    def signals(self) -> list[str]:
        """The torques that it is made of."""
        return [*([self.signal] if self.signal is not None else []), *self.sum]

    def of(self, torque_nm: Array) -> Array:
        """The input's values for the wheels' torque, shape (n, 4) [N m]."""
        columns = [torque_nm[:, TORQUES.index(name)] for name in self.signals]
        parts = {"all": (-np.inf, np.inf), "positive": (0.0, np.inf), "negative": (-np.inf, 0.0)}
        return self.scaled(np.sum([np.clip(c, *parts[self.part]) for c in columns], axis=0), "N m")


class Initial(_Scaled):
    """A parameter, or an input at the start: what the log begins with."""

    signal: Name

    @model_validator(mode="after")
    def _check(self) -> Initial:
        if self.signal not in BEGINS:
            raise ValueError(f"signal: {self.signal!r} is not among these; {suggestion(self.signal, BEGINS)}")
        problems = self.unit_problems(COLUMNS[self.signal].unit)
        if problems:
            raise ValueError("\n".join(problems))
        return self


class Tunable(_Strict):
    """A parameter of the unit that may be wrong: its range, and the library's parameter that it stands for."""

    unit: Annotated[str, Field(max_length=40)] = "-"
    nominal: Number | None = None
    low: Number
    high: Number
    effect: Name | None = None

    @model_validator(mode="after")
    def _check(self) -> Tunable:
        problems = []
        if self.low >= self.high:
            problems.append(f"low {self.low:g} is not below high {self.high:g}.")
        if self.nominal is not None and not self.low <= self.nominal <= self.high:
            problems.append(f"nominal {self.nominal:g} is not from low {self.low:g} to high {self.high:g}.")
        known = [f"{key}.{p.name}" for key, kind in EFFECTS.items() for p in kind.parameters()]
        if self.effect is not None and self.effect not in known:
            problems.append(
                f"effect: {self.effect!r} is no effect's parameter; {suggestion(self.effect, known)}"
            )
        if problems:
            raise ValueError("\n".join(problems))
        return self


class _SignalsFile(_Strict):
    schema_: Literal[1] = Field(default=1, alias="schema")
    inputs: dict[Name, Input]
    outputs: dict[Name, Any]
    initial: dict[Name, Initial] = Field(default_factory=dict)
    start: dict[Name, bool | int | float | str] = Field(default_factory=dict)
    parameters: dict[Name, Tunable] = Field(default_factory=dict)


@dataclass(frozen=True)
class Signals:
    """What a signals file says.

    Attributes
    ----------
    path : Path
        Its file.
    inputs : dict
        Input of the unit to the torque that it is given.
    outputs : Mapping
        Columns of the log format to the unit's variables.
    initial : dict
        Variable to the signal whose first value it begins with.
    start : dict
        Variable to its value in all runs.
    parameters : dict
        Variable to the range in which it is tuned.
    """

    path: Path
    inputs: dict[str, Input]
    outputs: Mapping
    initial: dict[str, Initial]
    start: dict[str, bool | int | float | str]
    parameters: dict[str, Tunable]

    @property
    def read(self) -> tuple[str, ...]:
        """The variables that the outputs are made of, each once."""
        columns = self.outputs.columns
        return tuple(dict.fromkeys(name for column in columns for name in self.outputs.sources(column)))


def load_signals(path: str | Path) -> Signals:
    """The content of a signals file; raises ScenarioError with all problems.

    A text under `start` that names a file beside the signals file is given to the unit as that file's full path.
    """
    file = load_strict(path, _SignalsFile)
    outputs = made(partial(MappingFile.model_validate, file.outputs), MappingFile, f"{path}: outputs")
    folder = Path(path).resolve().parent
    start = {
        name: str(folder / value)
        if isinstance(value, str) and value and (folder / value).is_file()
        else value
        for name, value in file.start.items()
    }
    columns = mapping_of(outputs, Path(path))
    return Signals(Path(path), file.inputs, columns, file.initial, start, file.parameters)
