"""Scores the diagnosis on cases of other simulators or drawn builds: folders with a truth.json beside them.

A case holds vehicle.yaml, road_fit.yaml, road_holdout.yaml, fit.csv and holdout.csv, some also baseline.csv (the same
car without the fault). truth.json has the true effects of each, "unknown" where no effect of the library is it.

python -m benchmarks.gap.foreign CASES --half odd --jobs 2 --out out/foreign
python -m benchmarks.gap.builds.make out/builds --cases 60 && python -m benchmarks.gap.foreign out/builds
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from joblib import Parallel, delayed
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import beta

from sim2real.diagnose import diagnose_files

NAMING = ("identified", "partial", "ambiguous", "compound")
SURE = ("identified", "partial", "compound")
LEAST_SHARE = 0.3
"""An effect that makes a lesser share of the gap beside the structure is not asked for [-]."""


@dataclass(frozen=True)
class Answer:
    """What was true of a case and what was said."""

    case: str
    effects: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    """Effects of a set that cannot be told apart, or the first ones that the verdict names."""
    ranked: tuple[str, ...]
    probability: float
    seconds: float

    @property
    def outside(self) -> bool:
        """Whether the library lacks the fault."""
        return "unknown" in self.effects

    @property
    def names(self) -> bool:
        """Whether an effect is blamed."""
        return self.verdict in NAMING

    def within(self, places: int) -> bool:
        """Whether the true effect is named among the first ones."""
        return self.names and self.effects[0] in self.ranked[:places]

    @property
    def found(self) -> bool:
        """Whether the true effect is first, or in the set that cannot be told apart."""
        return self.within(1) or (self.verdict == "ambiguous" and self.effects[0] in self.named)

    @property
    def names_both(self) -> bool:
        """Whether effects are blamed, and all that are there stand among the first three."""
        return self.names and set(self.effects) <= set(self.ranked[:3])

    @property
    def surely_wrong(self) -> bool:
        """Whether one effect is named without a doubt, and it is not there."""
        return self.verdict in SURE and self.ranked[0] not in self.effects


def answer(folder: Path, truth: Mapping[str, object], baseline: bool) -> Answer:
    """What the diagnosis says of a case."""
    began = time.perf_counter()
    said = diagnose_files(
        folder / "vehicle.yaml",
        folder / "road_fit.yaml",
        [str(folder / "fit.csv")],
        f"{folder / 'holdout.csv'}@{folder / 'road_holdout.yaml'}",
        baseline=[str(folder / "baseline.csv")] if baseline else (),
    )
    named = said.ambiguous_with[0] if said.ambiguous_with else tuple(c.effect for c in said.causes[:2])
    effects = tuple(map(str, truth["effects"]))  # type: ignore[call-overload]
    return Answer(
        folder.name,
        effects,
        str(said.verdict),
        tuple(named),
        tuple(c.effect for c in said.causes),
        max((c.probability for c in said.causes), default=0.0),
        time.perf_counter() - began,
    )


def score(answers: Iterable[Answer]) -> list[tuple[str, int, int, str]]:
    """Lines of the score: what, hits, cases, bar."""
    every = list(answers)
    inside = [a for a in every if len(a.effects) == 1 and not a.outside]
    calm = [a for a in every if not a.effects]
    outside = [a for a in every if a.outside]
    pairs = [a for a in every if len(a.effects) == 2]
    sure = [a for a in every if a.probability >= 0.9 and a.verdict in SURE]
    blamed = sum(a.names and a.verdict != "ambiguous" for a in outside)
    return [
        ("true effect first or in the set", sum(a.found for a in inside), len(inside), ">= 75 %"),
        ("true effect in the first two", sum(a.within(2) or a.found for a in inside), len(inside), ">= 85 %"),
        ("surely wrong", sum(a.surely_wrong for a in every), len(every), "<= 5 %"),
        ("no fault: an effect blamed", sum(a.names for a in calm), len(calm), "none"),
        ("outside the library: blamed surely", blamed, len(outside), "<= 10 %"),
        ("two effects: both in the first three", sum(a.names_both for a in pairs), len(pairs), ""),
        ("told with 0.9 and more: right", sum(a.ranked[0] in a.effects for a in sure), len(sure), ">= 90 %"),
    ]  # fmt: skip


def interval(hits: int, cases: int) -> tuple[float, float]:
    """The 95 % interval of a share by Clopper and Pearson [-]."""
    low = float(beta.ppf(0.025, hits, cases - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, cases - hits)) if hits < cases else 1.0
    return low, high


def main() -> None:
    """Run the cases and print the score."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path)
    parser.add_argument("--half", choices=("even", "odd", "all"), default="all")
    parser.add_argument("--with-baseline", action="store_true", help="give baseline.csv where there is one")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/foreign"))
    asked = parser.parse_args()
    truth = json.loads((asked.cases / "truth.json").read_text(encoding="utf-8"))
    names = [name for i, name in enumerate(truth) if asked.half in ("all", ("even", "odd")[i % 2])]
    work = (
        delayed(answer)(
            asked.cases / name,
            truth[name],
            asked.with_baseline and (asked.cases / name / "baseline.csv").exists(),
        )
        for name in names
    )
    console, answers = Console(), []
    for found in track(Parallel(n_jobs=asked.jobs, return_as="generator")(work), "cases", total=len(names)):
        answers.append(found)
        console.print(
            f"{found.case}: {', '.join(found.effects) or 'no fault'} -> {found.verdict} {', '.join(found.named)}"
        )
    asked.out.mkdir(parents=True, exist_ok=True)
    (asked.out / "answers.json").write_text(
        json.dumps([asdict(a) for a in answers], indent=1), encoding="utf-8"
    )
    table = Table("what", "hits", "cases", "share", "95 % interval", "bar")
    for what, hits, cases, bar in score(answers):
        if cases:
            low, high = interval(hits, cases)
            table.add_row(what, str(hits), str(cases), f"{hits / cases:.0%}", f"{low:.0%} to {high:.0%}", bar)
    console.print(table)


if __name__ == "__main__":
    main()
