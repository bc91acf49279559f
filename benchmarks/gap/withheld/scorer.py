"""Opens the seal: every threshold's line with counts and intervals, and where the misses are."""

from __future__ import annotations

import json
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .generator.camera_library import CAMERA_LIBRARY
from .generator.forms import Edition
from .generator.library import LIBRARY
from .generator.table import Group, table
from .outcome import Outcome, ResultError, read_outcomes
from .runner import THRESHOLDS, digest
from .statistics import calibration_error, reliability, wilson

SINGLE_RICH = (Group.RICH, Group.TYRE)
LABELLED = (*SINGLE_RICH, Group.NO_GAP, Group.OUTSIDE, Group.REMOVED)
SEVERITIES = ((5.0, 10.0), (10.0, 20.0), (20.0, math.inf))


@dataclass(frozen=True)
class Line:
    """One threshold: what was counted or measured, and whether it holds; `value` is NaN where nothing was counted."""

    name: str
    text: str
    value: float
    n: int
    hits: int | None
    low: float | None
    high: float | None
    limits: dict[str, float]

    @property
    def holds(self) -> bool:
        """Whether the value keeps its limits; not where nothing was counted."""
        above = self.value >= self.limits.get("at_least", -math.inf)
        return above and self.value <= self.limits.get("at_most", math.inf)


@dataclass(frozen=True)
class Scores:
    """Everything that is printed and written."""

    lines: list[Line]
    asides: list[Line]
    by_effect: dict[str, dict[str, int]]
    confusion: dict[str, dict[str, int]]
    bins: list[dict[str, float]]
    baselines: dict[str, dict[str, float]]
    verdicts: dict[str, dict[str, int]]
    errors: dict[str, str]
    pending: list[str]

    def to_json(self) -> dict[str, Any]:
        """Plain data; the lines say whether they hold."""
        plain = asdict(self)
        for key in ("lines", "asides"):
            plain[key] = [
                asdict(line) | ({"holds": line.holds} if line.limits else {}) for line in getattr(self, key)
            ]
        return plain


def load_thresholds(run: Path) -> dict[str, Any]:
    """The thresholds, which must be those that the run was sealed with.

    Raises
    ------
    ResultError
        No run there, or the thresholds were changed since.
    """
    path = run / "run.json"
    if not path.exists():
        raise ResultError(
            f"{path}: not there; `python -m benchmarks.gap.withheld run --out {run}` begins a run"
        )
    sealed = json.loads(path.read_text(encoding="utf-8"))
    if sealed["thresholds_sha256"] != digest(THRESHOLDS):
        raise ResultError(
            f"{THRESHOLDS.name} is not the one that {path} was sealed with: a run is judged by its own"
        )
    return dict(yaml.safe_load(THRESHOLDS.read_text(encoding="utf-8")))


def score_run(folder: Path) -> Scores:
    """Scores of a run's folder, with what is still pending."""
    limits = load_thresholds(folder)
    outcomes = read_outcomes(folder)
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    specs = table(run["size"], Edition(**run["edition"]))
    done = {o.name for o in outcomes}
    return score(outcomes, limits, [spec.name for spec in specs if spec.name not in done])


def score(outcomes: Sequence[Outcome], limits: dict[str, Any], pending: Sequence[str] = ()) -> Scores:
    """Hold outcomes to the limits."""
    seen = [o for o in outcomes if o.group is Group.NO_GAP or o.gap >= limits["gap"]]
    of = _by_group(seen)
    rich = [o for group in SINGLE_RICH for o in of[group]]
    right = [o for o in rich if o.right_within(1)]
    labelled = [o for o in seen if o.group in LABELLED and o.verdict != "error"]
    bins = reliability([o.most_probable[1] for o in labelled], [o.believed_right for o in labelled])
    inside = [
        low <= o.parameters[k] <= high
        for o in right
        for k, (low, high) in o.intervals.items()
        if k in o.parameters
    ]
    shrinks = [
        abs(o.predicted_shrink - o.achieved_shrink) for o in rich if o.verdict in ("identified", "ambiguous")
    ]
    timed = [o for o in outcomes if o.group is Group.TIMING]

    def share(name: str, text: str, of_these: Iterable[Outcome], hit: Callable[[Outcome], bool]) -> Line:
        return _share(name, text, [hit(o) for o in of_these], limits.get(name, {}))

    def value(name: str, text: str, numbers: Sequence[float], total: Callable[[Any], float]) -> Line:
        finite = [x for x in numbers if math.isfinite(x)]
        return Line(
            name,
            text,
            float(total(finite)) if finite else math.nan,
            len(finite),
            None,
            None,
            None,
            limits[name],
        )

    lines = [
        share("right_first", "rich: the true effect blamed first", rich, lambda o: o.right_within(1)),
        share(
            "right_in_first_two",
            "rich: the true effect blamed, first or second",
            rich,
            lambda o: o.right_within(2),
        ),
        share(
            "mild_right_or_flagged",
            "mild: right first, or ambiguous with the truth in the set",
            of[Group.MILD],
            lambda o: o.right_within(1) or o.flagged,
        ),
        share(
            "false_alarm", "no gap: any verdict but no_gap", of[Group.NO_GAP], lambda o: o.verdict != "no_gap"
        ),
        share(
            "outside_unknown", "out of library: unknown", of[Group.OUTSIDE], lambda o: o.verdict == "unknown"
        ),
        share(
            "outside_subsystem",
            "out of library: the right subsystem named",
            of[Group.OUTSIDE],
            lambda o: o.named_subsystem in o.subsystems,
        ),
        share(
            "removed_unknown_or_wider",
            "effect removed: unknown or a wider set",
            of[Group.REMOVED],
            lambda o: o.unsure,
        ),
        share("pair_both_named", "pairs: compound of just the two", of[Group.PAIR], lambda o: o.both_named),
        _share(
            "parameter_in_interval",
            "true parameters in their interval, right first",
            inside,
            limits["parameter_in_interval"],
        ),
        value(
            "shrink_difference_points", "predicted less achieved shrink, median [points]", shrinks, np.median
        ),
        Line(
            "calibration_error",
            "expected calibration error",
            calibration_error(bins),
            len(labelled),
            None,
            None,
            None,
            limits["calibration_error"],
        ),
        value("seconds", "60 s log at 1 kHz, two cores: slowest [s]", [o.seconds for o in timed], max),
        value("memory_gib", "the same: most memory [GiB]", [o.memory_gib for o in timed], max),
    ]
    return Scores(
        lines=lines,
        asides=_asides(outcomes, of, rich, shrinks),
        by_effect=_by_effect(outcomes, limits["gap"]),
        confusion=_confusion(seen),
        bins=[asdict(b) for b in bins],
        baselines=_baselines(of[Group.RICH]),
        verdicts={
            str(group): dict(Counter(o.verdict for o in members)) for group, members in sorted(of.items())
        },
        errors={o.name: o.error for o in outcomes if o.error},
        pending=list(pending),
    )


def _by_group(outcomes: Iterable[Outcome]) -> dict[Group, list[Outcome]]:
    of: dict[Group, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        of[o.group].append(o)
    return of


def _share(name: str, text: str, hits: Sequence[bool], limits: dict[str, float]) -> Line:
    n, hit = len(hits), sum(hits)
    low, high = wilson(hit, n)
    return Line(name, text, hit / n if n else math.nan, n, hit, low, high, limits)


def _asides(
    outcomes: Sequence[Outcome], of: dict[Group, list[Outcome]], rich: list[Outcome], shrinks: list[float]
) -> list[Line]:
    """What explains the lines: the same by severity, by tyre, by rank alone; without limits."""
    asides = []

    def aside(text: str, members: Iterable[Outcome], hit: Callable[[Outcome], bool]) -> None:
        asides.append(_share("", text, [hit(o) for o in members], {}))

    for low, high in SEVERITIES:
        inside = [o for o in rich if low <= o.gap < high]
        aside(f"rich, gap {low:g} to {high:g}: right first", inside, lambda o: o.right_within(1))
    aside("rich, the simulation's tyre: right first", of[Group.RICH], lambda o: o.right_within(1))
    aside("rich, another tyre: right first", of[Group.TYRE], lambda o: o.right_within(1))
    aside("rich: ranked first, whatever the verdict", rich, lambda o: o.ranked_within(1))
    aside("rich: ranked first or second, whatever the verdict", rich, lambda o: o.ranked_within(2))
    aside("rich: called compound though one effect", rich, lambda o: o.verdict == "compound")
    small = [o for o in outcomes if o.group is Group.MILD and o not in of[Group.MILD]]
    aside(
        "mild, gap below the limit: right, flagged or no_gap",
        small,
        lambda o: o.right_within(1) or o.flagged or o.verdict == "no_gap",
    )
    aside(
        "pairs: both in the first three, whatever the verdict",
        of[Group.PAIR],
        lambda o: set(o.truth) <= {e for e, _ in o.causes[:3]},
    )
    aside(
        "pairs: at least one blamed first", of[Group.PAIR], lambda o: o.blames and o.causes[0][0] in o.truth
    )
    asides.append(_share("", "shrink within 10 points", [s <= 10.0 for s in shrinks if math.isfinite(s)], {}))
    return asides


def _by_effect(outcomes: Iterable[Outcome], gap: float) -> dict[str, dict[str, int]]:
    """Per effect over rich driving: cases, those large enough, right first, right in the first two."""
    counts: dict[str, dict[str, int]] = {}
    for o in outcomes:
        if o.group in SINGLE_RICH:
            row = counts.setdefault(o.truth[0], {"cases": 0, "counted": 0, "first": 0, "two": 0})
            counted = o.gap >= gap
            row["cases"] += 1
            row["counted"] += counted
            row["first"] += counted and o.right_within(1)
            row["two"] += counted and o.right_within(2)
    return dict(sorted(counts.items()))


def _confusion(outcomes: Iterable[Outcome]) -> dict[str, dict[str, int]]:
    """Truth, or kind of case, to answer to number."""
    cells: dict[str, Counter[str]] = defaultdict(Counter)
    for o in outcomes:
        if o.group in SINGLE_RICH:
            cells[o.truth[0]][o.answer] += 1
        elif o.group in (Group.NO_GAP, Group.OUTSIDE):
            cells[f"({o.group})"][o.answer] += 1
    order = [*LIBRARY, *sorted(set(cells) - set(LIBRARY))]
    return {truth: dict(cells[truth]) for truth in order if truth in cells}


def _baselines(rich: Sequence[Outcome]) -> dict[str, dict[str, float]]:
    """Right first and in the first two of the simple rankers, over the rich cases with the simulation's tyre."""
    ranks: dict[str, Callable[[Outcome], tuple[str, ...]]] = {
        "cosine": lambda o: o.cosine,
        "in-sample BIC": lambda o: o.bic,
        "closure only": lambda o: o.closure,
    }
    known = len(LIBRARY) + len(CAMERA_LIBRARY) * any(o.camera for o in rich)
    shares: dict[str, dict[str, float]] = {"random": {"first": 1 / known, "two": 2 / known, "n": len(rich)}}
    for name, rank in ranks.items():
        answered = [o for o in rich if rank(o)]
        n = len(answered)
        first, two = (sum(o.truth[0] in rank(o)[:k] for o in answered) for k in (1, 2))
        shares[name] = {"first": first / n if n else math.nan, "two": two / n if n else math.nan, "n": n}
    return shares
