"""The frozen cases: opened ones that stay, to see what a change of the diagnosis or of the generator does to them.

`frozen.csv` lists them: chosen by coverage of effects, forms, kinds of cases, and not by outcome. `verdict`, `first`
and `right` are the outcome when they were frozen, right or wrong; they are empty where a case has not been run.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config

from .generator.cases import Forms
from .generator.table import Group, Spec, table
from .outcome import Outcome, outcome_of
from .runner import RunError, result_path, run_case

LIST = Path(__file__).with_name("frozen.csv")
COLUMNS = ("size", "seed", "case", "attempt", "forms", "expected", "verdict", "first", "right")


@dataclass(frozen=True)
class Frozen:
    """A case of the list.

    Attributes
    ----------
    spec : Spec
    seed, attempt : int
        Of the generator, and which of its draws could be driven.
    forms : mapping
        Of all that matters to the case.
    expected : str
        The right answer.
    verdict, first, right : str
        What was said when it was frozen: the verdict, the first cause, and "yes" or "no"; empty where it was not run.
    """

    spec: Spec
    seed: int
    attempt: int
    forms: Forms
    expected: str
    verdict: str
    first: str
    right: str

    def row(self) -> dict[str, str]:
        """Of the list."""
        written = {
            "size": "camera" if self.spec.camera else "full",
            "case": self.spec.name,
            "forms": " ".join(f"{aspect}={form}" for aspect, form in self.forms.items()),
        }
        return {name: str(written[name] if name in written else getattr(self, name)) for name in COLUMNS}


def frozen() -> list[Frozen]:
    """The list."""
    with LIST.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    specs = {(size, spec.name): spec for size in ("full", "camera") for spec in table(size)}
    cases = []
    for row in rows:
        forms = dict(pair.split("=") for pair in row["forms"].split())
        said = (row[name] for name in ("expected", "verdict", "first", "right"))
        spec = specs[row["size"], row["case"]]
        cases.append(Frozen(spec, int(row["seed"]), int(row["attempt"]), forms, *said))
    return cases


def expected_of(spec: Spec) -> str:
    """The right answer in words of the list."""
    if spec.group is Group.REMOVED:
        return "unknown or a wider set"
    if spec.group is Group.OUTSIDE:
        return "unknown"
    return "+".join(spec.effects) or "no_gap"


def is_right(outcome: Outcome) -> bool:
    """Whether the answer is the right one, as the thresholds count it; of a rich case the first cause."""
    if outcome.group is Group.NO_GAP:
        return outcome.verdict == "no_gap"
    if outcome.group is Group.OUTSIDE:
        return outcome.verdict == "unknown"
    if outcome.group is Group.REMOVED:
        return outcome.unsure
    if outcome.group is Group.PAIR:
        return outcome.both_named
    return outcome.right_within(1) or (outcome.group is Group.MILD and outcome.flagged)


def run_frozen(out: Path, jobs: int, only: str = "") -> Iterator[tuple[Frozen, Frozen]]:
    """Make and diagnose those with `only` in their names: each as it was frozen, and as it is now.

    Raises
    ------
    RunError
        A case cannot be made any more.
    """
    chosen = [case for case in frozen() if only in case.spec.name]
    with parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
        yield from Parallel(return_as="generator")(delayed(_judged)(case, out) for case in chosen)


def _judged(case: Frozen, out: Path) -> tuple[Frozen, Frozen]:
    folder = out / ("camera" if case.spec.camera else "car")
    problem = run_case(case.spec, case.seed, folder, False, case.forms, case.attempt)["error"]
    path = result_path(folder, case.spec)
    if not path.exists():
        raise RunError(f"{case.spec.name}: {problem}")
    return case, answered(case, json.loads(path.read_text(encoding="utf-8")))


def answered(case: Frozen, result: dict[str, Any]) -> Frozen:
    """A case with what a result of `run_case` says of it."""
    outcome = outcome_of(result)
    first = outcome.causes[0][0] if outcome.blames and outcome.causes else ""
    return replace(case, verdict=outcome.verdict, first=first, right="yes" if is_right(outcome) else "no")


def write_list(cases: list[Frozen]) -> None:
    """Freeze the list anew."""
    with LIST.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(case.row() for case in cases)
