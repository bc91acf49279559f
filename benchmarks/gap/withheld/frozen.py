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

from .generator.camera_forms import OF_EFFECT
from .generator.forms import Edition
from .generator.table import Group, Spec, table
from .outcome import Outcome, outcome_of
from .runner import RunError, result_path, run_case

LIST = Path(__file__).with_name("frozen.csv")
COLUMNS = ("size", "car", "camera", "seed", "case", "forms", "expected", "verdict", "first", "right")


@dataclass(frozen=True)
class Frozen:
    """A case of the list.

    Attributes
    ----------
    spec : Spec
    edition : Edition
    seed : int
    forms : str
        Of what is hidden, as the seal tells them.
    expected : str
        The right answer.
    verdict, first, right : str
        What was said when it was frozen: the verdict, the first cause, and "yes" or "no"; empty where it was not run.
    size : str
        Table that the case stands in.
    """

    spec: Spec
    edition: Edition
    seed: int
    forms: str
    expected: str
    verdict: str
    first: str
    right: str
    size: str

    def row(self) -> dict[str, str]:
        """Of the list."""
        own = {name: str(getattr(self, name)) for name in COLUMNS if hasattr(self, name)}
        numbers = {"car": str(self.edition.car), "camera": str(self.edition.camera)}
        return {name: ({"case": self.spec.name} | numbers | own)[name] for name in COLUMNS}


def frozen() -> list[Frozen]:
    """The list."""
    with LIST.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    cases = []
    for row in rows:
        edition = Edition(int(row["car"]), int(row["camera"]))
        spec = next(s for s in table(row["size"], edition) if s.name == row["case"])
        said = {name: row[name] for name in ("forms", "expected", "verdict", "first", "right", "size")}
        cases.append(Frozen(spec, edition, int(row["seed"]), **said))
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
    problem = run_case(case.spec, case.seed, case.edition, folder, False)["error"]
    path = result_path(folder, case.spec)
    if not path.exists():
        raise RunError(f"{case.spec.name}: {problem}")
    return case, answered(case, json.loads(path.read_text(encoding="utf-8")))


def answered(case: Frozen, result: dict[str, Any]) -> Frozen:
    """A case with what a result of `run_case` says of it."""
    seal, outcome = result["seal"], outcome_of(result)
    forms = seal["camera"]["chain"]["forms"] if case.spec.camera else seal["forms"]
    aspects = OF_EFFECT if case.spec.camera else {}
    told = [forms[a] for e in case.spec.effects for a in aspects.get(e, (e,)) if a in forms]
    told += [forms["foreign_tyre"]] if case.spec.group is Group.TYRE else []
    first = outcome.causes[0][0] if outcome.blames and outcome.causes else ""
    right = "yes" if is_right(outcome) else "no"
    return replace(case, forms=" ".join(told), verdict=outcome.verdict, first=first, right=right)


def write_list(cases: list[Frozen]) -> None:
    """Freeze the list anew."""
    with LIST.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(case.row() for case in cases)
