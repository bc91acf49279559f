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
from rich.console import Console
from rich.markup import escape
from rich.table import Table

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
    bins: list[dict[str, float]]
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
    done = {o.name for o in outcomes}
    return score(outcomes, limits, [spec.name for spec in table(run["size"]) if spec.name not in done])


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
        abs(o.predicted_shrink - o.achieved_shrink)
        for o in rich
        if o.verdict in ("identified", "partial", "ambiguous")
    ]
    timed = [o for o in outcomes if o.group is Group.TIMING]

    def share(name: str, text: str, of_these: Iterable[Outcome], hit: Callable[[Outcome], bool]) -> Line:
        return _share(name, text, [hit(o) for o in of_these], limits.get(name, {}))

    def value(name: str, text: str, numbers: Sequence[float], total: Callable[[Any], float]) -> Line:
        finite = [x for x in numbers if math.isfinite(x)]
        return _value(name, text, float(total(finite)) if finite else math.nan, len(finite), limits[name])

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
        _value(
            "calibration_error",
            "expected calibration error",
            calibration_error(bins),
            len(labelled),
            limits["calibration_error"],
        ),
        value("seconds", "60 s log at 1 kHz, two cores: slowest [s]", [o.seconds for o in timed], max),
        value("memory_gib", "the same: most memory [GiB]", [o.memory_gib for o in timed], max),
    ]
    return Scores(
        lines=lines,
        asides=_asides(outcomes, of, rich, shrinks),
        bins=[asdict(b) for b in bins],
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


def _value(name: str, text: str, value: float, n: int, limits: dict[str, float]) -> Line:
    return Line(name, text, value, n, None, None, None, limits)


def _asides(
    outcomes: Sequence[Outcome], of: dict[Group, list[Outcome]], rich: list[Outcome], shrinks: list[float]
) -> list[Line]:
    """What explains the lines: the same by severity, by tyre, by rank alone; without limits."""
    small = [o for o in outcomes if o.group is Group.MILD and o not in of[Group.MILD]]
    asides = [
        (
            f"rich, gap {low:g} to {high:g}: right first",
            [o.right_within(1) for o in rich if low <= o.gap < high],
        )
        for low, high in SEVERITIES
    ]
    asides += [
        ("rich, the simulation's tyre: right first", [o.right_within(1) for o in of[Group.RICH]]),
        ("rich, another tyre: right first", [o.right_within(1) for o in of[Group.TYRE]]),
        ("rich: ranked first, whatever the verdict", [o.ranked_within(1) for o in rich]),
        ("rich: ranked first or second, whatever the verdict", [o.ranked_within(2) for o in rich]),
        ("rich: called compound though one effect", [o.verdict == "compound" for o in rich]),
        (
            "mild, gap below the limit: right, flagged or no_gap",
            [o.right_within(1) or o.flagged or o.verdict == "no_gap" for o in small],
        ),
        (
            "pairs: both in the first three, whatever the verdict",
            [set(o.truth) <= {e for e, _ in o.causes[:3]} for o in of[Group.PAIR]],
        ),
        ("shrink within 10 points", [s <= 10.0 for s in shrinks if math.isfinite(s)]),
    ]
    return [_share("", text, hits, {}) for text, hits in asides]


def print_scores(scores: Scores, console: Console) -> None:
    """Thresholds first, then what explains them."""
    console.print(_lines(scores.lines, "Thresholds (frozen before the cases were opened)"))
    console.print(_lines(scores.asides, "Asides"))
    table = Table(
        "probability", "cases", "believed", "right", title="Reliability of the most probable answer"
    )
    for b in scores.bins:
        between = f"{b['low']:.1f} to {b['high']:.1f}"
        table.add_row(between, str(b["n"]), _percent(b["believed"]), _percent(b["right"]))
    console.print(table)
    table = Table("kind", "verdicts", title="Verdicts")
    for group, verdicts in scores.verdicts.items():
        table.add_row(group, ", ".join(f"{n} {verdict}" for verdict, n in sorted(verdicts.items())))
    console.print(table)
    for name, error in scores.errors.items():
        console.print(f"[red]{name}[/red]: {escape(error)}", highlight=False)
    if scores.pending:
        console.print(f"{len(scores.pending)} cases have no result yet: the figures are not the run's.")


def _lines(lines: list[Line], title: str) -> Table:
    table = Table("line", "value", "hits", "95 %", "limit", "", title=title)
    for line in lines:
        counted = line.hits is not None
        value = _percent(line.value) if counted else f"{line.value:.3g}"
        between = f"{_percent(line.low)} to {_percent(line.high)}" if line.low is not None else ""
        limit = " and ".join(
            f"{'>=' if key == 'at_least' else '<='} {_percent(x) if counted else f'{x:g}'}"
            for key, x in line.limits.items()
        )
        mark = (
            "" if not line.limits else "-" if line.n == 0 else "holds" if line.holds else "[red]missed[/red]"
        )
        hits = f"{line.hits}/{line.n}" if counted else f"n = {line.n}"
        table.add_row(escape(line.text), value, hits, between, limit, mark)
    return table


def _percent(share: float | None) -> str:
    return "-" if share is None or math.isnan(share) else f"{100 * share:.1f} %"
