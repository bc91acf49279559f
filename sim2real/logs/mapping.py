"""Mapping files: how a tool's columns become the columns of the log format."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from scenarios.library import located_in
from scenarios.strict import load_strict
from sim2real.logs.contract import COLUMNS, IMAGE_PATH, TIME
from sim2real.logs.errors import LogError
from sim2real.logs.times import FORMS, SECONDS
from sim2real.logs.units import factor

MAPPINGS = Path(__file__).parents[1] / "mappings"
"""Folder of the shipped mapping files."""
BLANKS = "blanks"
"""The separator of columns that any number of blanks stands between."""
SOURCES = ("column", "constant", "sum", "integrate", "copy")
INTEGRAND_UNIT = {"m": "m/s", "m/s": "m/s2", "rad": "rad/s"}
"""Unit of a column of the log format, and of what it is the integral of."""


Name = Annotated[str, Field(max_length=1_000)]
Factor = Annotated[float, Field(ge=-1e12, le=1e12)]


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Spec(_Strict):
    """Where one column comes from: value = sign * scale * source in the column's unit + offset.

    The source is exactly one of `column` (of the file; with `unit`, and with `radius_m` where it is a wheel's
    circumferential speed), `constant`, `sum` (of such sources), `integrate` (over time, from 0 at the first row) and
    `copy` (of another column of the log format). A bare name in a file is a `column`.
    """

    column: Name | None = None
    constant: Factor | None = None
    sum: Annotated[list[Spec], Field(max_length=100)] = Field(default_factory=list)
    integrate: Spec = Field(default=None)  # type: ignore[assignment]  # absent, but a null in the file is refused
    copy_of: Name | None = Field(default=None, alias="copy")
    unit: Name | None = None
    radius_m: float | None = Field(default=None, ge=0.01, le=10.0)
    sign: Literal[1, -1] = 1
    scale: Factor = 1.0
    offset: Factor = 0.0

    @model_validator(mode="before")
    @classmethod
    def _bare_name(cls, data: object) -> object:
        if isinstance(data, str):
            return {"column": data}
        if not isinstance(data, dict):
            raise ValueError(  # noqa: TRY004  # pydantic collects ValueErrors
                f"is {data!r}; expected a column's name, or one of {{column: NAME, unit: UNIT}}, {{constant: VALUE}}, "
                "{sum: [...]}, {integrate: ...}, {copy: NAME}."
            )
        return data

    @model_validator(mode="after")
    def _one_source(self) -> Spec:
        values = (self.column, self.constant, self.sum or None, self.integrate, self.copy_of)
        given = [name for name, value in zip(SOURCES, values, strict=True) if value is not None]
        if len(given) != 1:
            what = " and ".join(given) or "no source"
            raise ValueError(f"has {what}; expected exactly one of {', '.join(SOURCES)}, and not empty.")
        if given != ["column"] and (self.unit is not None or self.radius_m is not None):
            raise ValueError(f"unit and radius_m belong to a column; expected none beside {given[0]}.")
        return self

    @property
    def terms(self) -> list[Spec]:
        """The sources directly inside this one."""
        return [*self.sum, *([self.integrate] if self.integrate is not None else [])]

    @property
    def derived(self) -> bool:
        """Whether it carries no measurement of its own: a constant, an integral, a copy, a sum of nothing else."""
        return self.column is None and (not self.sum or all(term.derived for term in self.sum))

    @property
    def measured(self) -> bool:
        """Whether it is made of columns of the file alone, row by row."""
        return self.column is not None or (bool(self.sum) and all(term.measured for term in self.sum))

    def factor(self, unit: str) -> float:
        """What the column's raw values are multiplied with to be in `unit`; raises ValueError for a wrong unit."""
        if self.radius_m is not None:
            return factor(self.unit or "m/s", "m/s") / self.radius_m
        return 1.0 if self.unit is None else factor(self.unit, unit)

    def leaves(self) -> Iterator[Spec]:
        """The source itself, or all of those inside it."""
        if not self.terms:
            yield self
        for term in self.terms:
            yield from term.leaves()


class Format(_Strict):
    """How a text table is written; rows count as in an editor. What is not stated is found out.

    `separator` is one character, or "blanks" for any number of them; `unit_row` 0 says that there is none.
    """

    encoding: Annotated[str, Field(max_length=40)] | None = None
    separator: Annotated[str, Field(min_length=1, max_length=6)] | None = None
    decimal: Literal[".", ","] | None = None
    header_row: int | None = Field(default=None, ge=1, le=10_000)
    unit_row: int | None = Field(default=None, ge=0, le=10_000)

    @model_validator(mode="after")
    def _check(self) -> Format:
        problems = []
        if self.encoding is not None and not _is_encoding(self.encoding):
            problems.append(
                f"encoding: {self.encoding!r} is not known; expected a name such as utf-8, utf-16 or cp1252."
            )
        if self.separator is not None and len(self.separator) > 1 and self.separator != BLANKS:
            problems.append(f"separator: {self.separator!r}; expected one character, or {BLANKS}.")
        if self.unit_row and self.unit_row <= (self.header_row or 0):
            problems.append("unit_row: expected a row below header_row, or 0 for none.")
        if problems:
            raise ValueError("\n".join(problems))
        return self


class TimeSource(_Strict):
    """The column of time, its form (see `times.FORMS`, or a strptime pattern), and its unit where it is a number."""

    column: Name
    form: Annotated[str, Field(max_length=100)] = SECONDS
    unit: Name | None = None

    @model_validator(mode="after")
    def _check(self) -> TimeSource:
        if self.form not in FORMS and "%" not in self.form:
            raise ValueError(
                f"form: {self.form!r}; expected {', '.join(FORMS)}, or a pattern of strptime such as "
                "'%d.%m.%Y %H:%M:%S.%f'."
            )
        if self.unit is not None and self.form != SECONDS:
            raise ValueError(f"unit: belongs to form {SECONDS}; expected none beside {self.form}.")
        if self.unit is not None:
            factor(self.unit, "s")
        return self


@dataclass(frozen=True)
class Mapping:
    """How a tool's columns become those of the log format; what is not in it is read under its own name.

    Attributes
    ----------
    path : Path
        Its file.
    columns : dict
        Column of the log format to its source.
    format : Format
        How a text table is written.
    time_form : str
        Form of the time column; empty where it is to be found out.
    invalid : dict
        Values that say "no value", by column of the file; "*" is every column.
    counters : dict
        Message of a bus to the signal that counts it; no column, and of use on a live bus alone.
    """

    path: Path
    columns: dict[str, Spec]
    format: Format = field(default_factory=Format)
    time_form: str = ""
    invalid: dict[str, tuple[float, ...]] = field(default_factory=dict)
    counters: dict[str, str] = field(default_factory=dict)

    def spec(self, column: str) -> Spec:
        """The source of a column of the log format."""
        return self.columns.get(column) or Spec(column=column)

    def sources(self, column: str) -> list[str]:
        """Columns of the file that a column of the log format is made of."""
        return [leaf.column for leaf in self.spec(column).leaves() if leaf.column is not None]


NO_MAPPING = Mapping(Path(), {})
"""Every column has its own name and unit."""


class _MappingBase(_Strict):
    @model_validator(mode="before")
    @classmethod
    def _columns_to_top(cls, data: Any) -> Any:
        """The form `columns: {...}` as the bare form."""
        if isinstance(data, dict) and "columns" in data:
            columns = data["columns"]
            rest = {key: value for key, value in data.items() if key != "columns"}
            both = sorted(str(key) for key in set(rest) - {"schema", "format", "time", "invalid", "counters"})
            if not isinstance(columns, dict) or both:
                raise ValueError(
                    f"columns: stands beside {', '.join(both)}; expected all columns in one place."
                    if both
                    else "columns: expected one line `name: source` per column."
                )
            return {**rest, **columns}
        return data

    @model_validator(mode="after")
    def _check(self) -> _MappingBase:
        specs = specs_of(self)
        problems = [text for name, spec in specs.items() for text in _problems(name, spec, specs)]
        if self.time is not None and TIME in specs:  # type: ignore[attr-defined]
            problems.append(f"time: stands beside {TIME}; expected one of them.")
        if self.model_fields_set <= {"schema_"}:
            problems.append(
                "maps nothing; expected lines such as vehicle_speed_m_s: {column: VehSpd, unit: km/h}."
            )
        if problems:
            raise ValueError("\n".join(problems))
        return self


MappingFile = create_model(
    "MappingFile",
    __base__=_MappingBase,
    schema_=(Literal[1], Field(default=1, alias="schema")),
    format=(Format, Field(default_factory=Format)),
    time=(TimeSource | None, Field(default=None)),
    invalid=(dict[Name, Annotated[list[Factor], Field(max_length=100)]], Field(default_factory=dict)),
    counters=(dict[Name, Name], Field(default_factory=dict, max_length=1_000)),
    **{name: (Spec, Field(default=None)) for name in COLUMNS},  # type: ignore[call-overload]
)


def load_mapping(given: str | Path) -> Mapping:
    """Read a mapping file, or the shipped one of this name; all of its problems in one LogError."""
    try:
        path = located_in(MAPPINGS, "mapping", given)
        file = load_strict(path, MappingFile)
    except LogError:
        raise
    except ValueError as error:
        raise LogError(str(error)) from error
    return mapping_of(file, path)


def mapping_of(file: BaseModel, path: Path) -> Mapping:
    """The mapping that a `MappingFile` says; `path` is what messages call it."""
    specs = specs_of(file)
    time: TimeSource | None = getattr(file, "time")  # noqa: B009 - the model is made from `COLUMNS`
    if time is not None:
        specs[TIME] = Spec(column=time.column, unit=time.unit)
    invalid = {name: tuple(values) for name, values in getattr(file, "invalid").items()}  # noqa: B009
    counters: dict[str, str] = getattr(file, "counters")  # noqa: B009
    return Mapping(path, specs, getattr(file, "format"), time.form if time else "", invalid, counters)  # noqa: B009


def specs_of(file: BaseModel) -> dict[str, Spec]:
    """Column of the log format to its source, of a `MappingFile`."""
    return {name: getattr(file, name) for name in COLUMNS if name in file.model_fields_set}


def _is_encoding(name: str) -> bool:
    try:
        return codecs.lookup(name)._is_text_encoding
    except (LookupError, ValueError):
        return False


def _problems(name: str, spec: Spec, specs: dict[str, Spec]) -> list[str]:
    if name == IMAGE_PATH and (spec.column is None or spec.model_fields_set != {"column"}):
        return [f"{name}: holds text; expected the bare name of a column."]
    if name == TIME and not spec.measured:
        return [f"{name}: expected measured columns only, since all else is read against it."]
    if _copies_itself(name, specs):
        return [f"{name}: is copied from itself in a circle; expected a column of the file at its end."]
    return [f"{name}: {text}" for text in _unit_problems(spec, COLUMNS[name].unit)]


def _unit_problems(spec: Spec, unit: str) -> list[str]:
    """What is wrong with the units of a source that must end up in `unit` of the log format."""
    if spec.integrate is not None:
        if unit not in INTEGRAND_UNIT:
            return [f"integrate gives no [{unit}]; expected it for positions, speeds and angles only."]
        return _unit_problems(spec.integrate, INTEGRAND_UNIT[unit])
    if spec.copy_of is not None:
        found = COLUMNS[spec.copy_of].unit if spec.copy_of in COLUMNS else None
        if found != unit:
            what = "no column of the log format" if found is None else f"in [{found}]"
            return [f"copy: {spec.copy_of!r} is {what}; expected the name of one in [{unit}]."]
    if spec.radius_m is not None and unit != "rad/s":
        return ["radius_m turns a circumferential speed into a wheel speed; expected it there only."]
    try:
        spec.factor(unit)
    except ValueError as error:
        return [str(error)]
    return [text for term in spec.sum for text in _unit_problems(term, unit)]


def _copies_itself(name: str, specs: dict[str, Spec]) -> bool:
    seen, open_names = set(), [name]
    while open_names:
        for leaf in specs[open_names.pop()].leaves():
            target = leaf.copy_of
            if target == name:
                return True
            if target in specs and target not in seen:
                seen.add(target)
                open_names.append(target)
    return False
