"""A diagnosis put into the simulation: the vehicle file with the effects that it names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field

from scenarios.car_and_road import Vehicle
from scenarios.effects import EFFECTS, FORMS, Effect, form_of
from scenarios.errors import ScenarioError, suggestion
from scenarios.files import VehicleFile, load_vehicle
from scenarios.strict import MOST_BYTES, made
from scenarios.whole_files import written_whole
from scenarios.yaml_text import parse_yaml, to_yaml
from sim2real.result import (
    MEANING,
    Budget,
    Cause,
    Diagnosis,
    Gap,
    Interval,
    Measure,
    Verdict,
    added,
    needed,
)
from trpac_core.files import file_sha256, parse_json, quoted, read_text

MOST_JSON_BYTES = 50_000_000
"""Largest diagnosis.json that is read; one with a torque profile has 100,000 [bytes]."""


class _Estimate(BaseModel):
    value: float
    low: float | None = None
    high: float | None = None

    def interval(self) -> Interval:
        """The estimate; bounds that are not known are the value."""
        low, high = (self.value if bound is None else bound for bound in (self.low, self.high))
        return Interval(self.value, low, high)


class _SavedCause(BaseModel):
    effect: str
    form: str = ""
    probability: float
    parameters: dict[str, _Estimate]
    gap_after: float | None = None

    def cause(self) -> Cause:
        """The cause, as far as a vehicle file needs it."""
        return Cause(
            effect=self.effect,
            probability=self.probability,
            parameters=_intervals(self.parameters),
            gap_after=math.nan if self.gap_after is None else self.gap_after,
            shrink_percent=Interval(math.nan, math.nan, math.nan, "%"),
            fit_bic=math.nan,
            form=self.form,
        )


class _SavedMeasure(BaseModel):
    total: float


class _SavedGap(BaseModel):
    before: _SavedMeasure
    after: _SavedMeasure
    noise_floor: float


class _SavedDiagnosis(BaseModel):
    """The parts of diagnosis.json that a vehicle file needs; further keys are left aside."""

    schema_: Literal[1] = Field(alias="schema")
    verdict: Verdict
    sentence: str = ""
    gap: _SavedGap
    causes: tuple[_SavedCause, ...]
    together: tuple[str, ...] = ()
    ambiguous_with: tuple[tuple[str, ...], ...] = ()
    budget: dict[str, float] | None = None
    budget_intervals: dict[str, tuple[float, float]] | None = None
    provenance: dict[str, Any] = Field(default_factory=dict)

    def diagnosis(self) -> Diagnosis:
        """The diagnosis without places, pictures and what is unexplained."""
        gap = self.gap
        return Diagnosis(
            verdict=self.verdict,
            sentence=self.sentence,
            gap=Gap(Measure(gap.before.total), Measure(gap.after.total), gap.noise_floor),
            where=(),
            heat_map={},
            causes=tuple(cause.cause() for cause in self.causes),
            together=self.together,
            ambiguous_with=self.ambiguous_with,
            budget=_budget(self.budget or {}, self.budget_intervals or {}),
            provenance=self.provenance,
        )


def _intervals(estimates: dict[str, _Estimate]) -> dict[str, Interval]:
    return {name: estimate.interval() for name, estimate in estimates.items()}


def _budget(shares: dict[str, float], intervals: dict[str, tuple[float, float]]) -> Budget | None:
    """The gap budget; None where the file holds none."""
    told = {name: Interval(value, *intervals.get(name, (value, value))) for name, value in shares.items()}
    return Budget(told) if told else None


def load_diagnosis(path: str | Path) -> Diagnosis:
    """The diagnosis of a diagnosis.json, as far as a vehicle file needs it; raises ScenarioError or FileError."""
    name = quoted(path)
    data = parse_json(read_text(path, MOST_JSON_BYTES, "the diagnosis.json of a diagnosis"), name)
    if not isinstance(data, dict):
        raise ScenarioError(f"{name}: is no diagnosis; expected the diagnosis.json of trpac gap diagnose.")
    return made(partial(_SavedDiagnosis.model_validate, data), _SavedDiagnosis, name).diagnosis()


def choices(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Ids of the effects that may be put into the car: those that the verdict names or cannot tell apart."""
    if diagnosis.verdict is not Verdict.AMBIGUOUS:
        return tuple(cause.effect for cause in needed(diagnosis))
    tried = [cause.effect for cause in diagnosis.causes]
    alike = [effect for group in diagnosis.ambiguous_with for name in group for effect in name.split("+")]
    return tuple(effect for effect in dict.fromkeys([*tried[:1], *alike]) if effect in tried)


def chosen(diagnosis: Diagnosis, effect: str | None = None) -> tuple[Cause, ...]:
    """The causes to put into the car: those that the verdict names, or `effect` alone.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    effect : str, optional
        Id of one of `choices`; needed where the verdict is ambiguous.

    Raises
    ------
    ScenarioError
        The verdict names no effect, cannot tell several apart and none is chosen, or `effect` is not among them.
    """
    known = choices(diagnosis)
    if not known:
        meaning = MEANING[diagnosis.verdict]
        raise ScenarioError(
            f"the verdict is {diagnosis.verdict}, which names no effect to put into the car. {meaning}"
        )
    if effect is not None and effect not in known:
        raise ScenarioError(
            f"{quoted(effect)!r} is not an effect that the diagnosis names; {suggestion(effect, known)}"
        )
    if effect is not None:
        return tuple(cause for cause in diagnosis.causes if cause.effect == effect)[:1]
    if diagnosis.verdict is Verdict.AMBIGUOUS:
        raise ScenarioError(
            f"the verdict is ambiguous: the logs do not separate {' and '.join(known)}. Choose the effect to put "
            f"into the car: --effect {' or --effect '.join(known)}."
        )
    return needed(diagnosis)


def with_causes(vehicle: VehicleFile, causes: Sequence[Cause]) -> Vehicle:
    """The car with the effects of these causes, in place of its own of the same ids; raises ScenarioError."""
    car = Vehicle(**vehicle.model_dump(by_alias=True))
    return car.with_effects([_effect(cause) for cause in causes])


def _effect(cause: Cause) -> Effect:
    """The effect of a cause; raises ScenarioError where there is no such effect, form or parameter."""
    if cause.effect not in EFFECTS:
        raise ScenarioError(
            f"{quoted(cause.effect)!r} is not an effect; {suggestion(cause.effect, list(EFFECTS))}"
        )
    forms = [kind.form for kind in FORMS[cause.effect]]
    if cause.form and cause.form not in forms:
        raise ScenarioError(
            f"{cause.effect} has no form {quoted(cause.form)!r}; {suggestion(cause.form, forms)}"
        )
    kind = form_of(cause.effect, cause.form)
    names = [p.name for p in kind.parameters()]
    if sorted(names) != sorted(cause.parameters):
        given = ", ".join(map(quoted, cause.parameters))
        raise ScenarioError(f"{cause.effect} has the parameters {given}; expected {', '.join(names)}.")
    return kind(**{name: estimate.value for name, estimate in cause.parameters.items()})


def gap_left(diagnosis: Diagnosis, causes: Sequence[Cause]) -> float:
    """The gap on the hold-out with these causes of `chosen` [sensor noises]."""
    return diagnosis.gap.after.total if tuple(causes) == added(diagnosis) else causes[0].gap_after


def apply_file(
    diagnosis: Diagnosis, vehicle: Path, out: Path, effect: str | None = None
) -> tuple[Cause, ...]:
    """Write the vehicle file with the effects of a diagnosis; returns their causes.

    The new file holds all values of the old one; comments are lost.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of `load_diagnosis`.
    vehicle, out : Path
        The vehicle file that the diagnosis was made with, and the new one.
    effect : str, optional
        See `chosen`.

    Raises
    ------
    ScenarioError
        Nothing to apply, another vehicle file, or values that the car does not take.
    OSError
        The new file cannot be written.
    """
    causes = chosen(diagnosis, effect)
    car = load_vehicle(vehicle)
    _require_same(diagnosis, vehicle)
    better = with_causes(car, causes)
    if out.exists() and out.samefile(vehicle):
        raise ScenarioError(f"{quoted(out)}: is the vehicle file itself; expected another file to write.")
    values = parse_yaml(read_text(vehicle, MOST_BYTES, "a YAML file"))
    values |= {key: part for key in ("effects", "forms") if (part := better.model_dump()[key])}
    names = " and ".join(cause.effect for cause in causes)
    head = f"# {vehicle.name} with {names}, as trpac gap apply put it in from a diagnosis.\n"
    with written_whole(out.parent) as made_in:
        (made_in / out.name).write_text(head + to_yaml(values), encoding="utf-8")
    return causes


def _require_same(diagnosis: Diagnosis, vehicle: Path) -> None:
    """Raise ScenarioError where the diagnosis was made with another vehicle file."""
    made_with = diagnosis.provenance.get("vehicle") or {}
    wanted = made_with.get("sha256") if isinstance(made_with, dict) else None
    if wanted is not None and file_sha256(vehicle) != wanted:
        raise ScenarioError(
            f"{quoted(vehicle)}: is not the vehicle file that the diagnosis was made with, or was changed since. "
            f"Expected {quoted(made_with.get('path'))} with SHA-256 {quoted(wanted, 12)}; its values hold for that "
            "car alone. Diagnose again with this file."
        )
