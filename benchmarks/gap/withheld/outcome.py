"""One case's answer held to its truth."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .generator.table import Group

NONE = "none of these"
BLAMES = ("identified", "partial", "ambiguous", "compound")


class ResultError(ValueError):
    """Results that cannot be scored."""


@dataclass(frozen=True)
class Outcome:
    """What was hidden and what was said.

    Attributes
    ----------
    truth : tuple of str
        Effects that were there.
    subsystems : tuple of str
        Right answers to where.
    gap : float
        Of the hold-out, by the generator [noise floors].
    verdict : str
        "error" where the diagnosis failed.
    causes : tuple of (str, float)
        Effects and their probabilities as ranked; a cause of several effects gives them in a row.
    """

    name: str
    group: Group
    truth: tuple[str, ...]
    parameters: Mapping[str, float]
    subsystems: tuple[str, ...]
    gap: float
    verdict: str
    causes: tuple[tuple[str, float], ...]
    intervals: Mapping[str, tuple[float, float]]
    groups: tuple[frozenset[str], ...]
    named_subsystem: str | None
    predicted_shrink: float
    achieved_shrink: float
    seconds: float
    memory_gib: float
    error: str | None

    @property
    def blames(self) -> bool:
        """Whether it names a cause at all."""
        return self.verdict in BLAMES

    def right_within(self, places: int) -> bool:
        """The true effect is blamed, among the first `places`."""
        return self.blames and self.ranked_within(places)

    def ranked_within(self, places: int) -> bool:
        """The true effect is ranked so, whatever the verdict."""
        return self.truth[0] in [effect for effect, _ in self.causes[:places]]

    @property
    def flagged(self) -> bool:
        """The verdict is ambiguous, and the truth in a set that it names."""
        return self.verdict == "ambiguous" and any(self.truth[0] in group for group in self.groups)

    @property
    def unsure(self) -> bool:
        """Unknown, or a set of two or more instead of one effect."""
        return self.verdict == "unknown" or (
            self.verdict == "ambiguous" and any(len(g) > 1 for g in self.groups)
        )

    @property
    def both_named(self) -> bool:
        """A compound of just the two that were there."""
        return self.verdict == "compound" and set(self.truth) == {effect for effect, _ in self.causes[:2]}

    @property
    def most_probable(self) -> tuple[str, float]:
        """Of the effects and "none of these" the likeliest, and its probability."""
        rest = max(1.0 - sum(p for _, p in self.causes), 0.0)
        return max([*self.causes, (NONE, rest)], key=lambda pair: pair[1])

    @property
    def believed_right(self) -> bool:
        """Whether that is the truth; in a case whose effect the library lacks it is "none of these"."""
        inside = self.group in (Group.RICH, Group.TYRE, Group.MILD)
        return self.most_probable[0] == (self.truth[0] if inside else NONE)


def read_outcomes(folder: Path) -> list[Outcome]:
    """All results of a run.

    Raises
    ------
    ResultError
        There are none, or a file is no result.
    """
    paths = sorted((folder / "results").glob("*.json"))
    if not paths:
        raise ResultError(
            f"{folder / 'results'}: no results; `python -m benchmarks.gap.withheld run --out {folder}` makes them"
        )
    outcomes, problems = [], []
    for path in paths:
        try:
            outcomes.append(outcome_of(json.loads(path.read_text(encoding="utf-8"))))
        except (KeyError, TypeError, ValueError) as problem:
            problems.append(f"{path}: {type(problem).__name__}: {problem}")
    if problems:
        raise ResultError("\n".join(problems))
    return outcomes


def outcome_of(result: Mapping[str, Any]) -> Outcome:
    """From a result's JSON."""
    seal, said = (
        result["seal"],
        result["diagnosis"] or {"verdict": "error", "causes": [], "ambiguous_with": []},
    )
    truth = tuple(seal["effects"])
    first = said["causes"][0] if said["causes"] else {"parameters": {}}
    unexplained = said.get("unexplained")
    usage = result.get("usage", {})
    return Outcome(
        name=result["case"],
        group=Group(seal["group"]),
        truth=truth,
        parameters=seal["effects"][truth[0]] if truth else {},
        subsystems=tuple(seal["subsystems"]),
        gap=float(seal["gap"]),
        verdict=said["verdict"],
        causes=tuple(_single(said["causes"])),
        intervals={name: (i["low"], i["high"]) for name, i in first["parameters"].items()},
        groups=tuple(frozenset(group) for group in said["ambiguous_with"]),
        named_subsystem=unexplained.get("subsystem") if isinstance(unexplained, dict) else None,
        predicted_shrink=_number(first.get("shrink_percent", {}).get("value")),
        achieved_shrink=_number(result.get("achieved_shrink_percent")),
        seconds=_number(usage.get("seconds", result.get("wall_s"))),
        memory_gib=_number(usage.get("peak_bytes")) / 2**30,
        error=result["error"],
    )


def _single(causes: Iterable[Mapping[str, Any]]) -> Iterable[tuple[str, float]]:
    """A joint cause, written a+b, as its effects: the first carries the probability."""
    for cause in causes:
        first, *others = cause["effect"].split("+")
        yield first.strip(), float(cause["probability"])
        yield from ((other.strip(), 0.0) for other in others)


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
