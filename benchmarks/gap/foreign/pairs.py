"""Diagnoses of pairs of logs: the same manoeuvre with a fault and without.

`python -m benchmarks.gap.foreign.pairs FOLDER [--by position] [--without] [CASE ...]`; FOLDER holds truth.json and, for
each case, vehicle.yaml, road_fit.yaml, fit.csv and baseline.csv. The first two thirds of both are fitted to, the last
third is the hold-out.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd

from sim2real.diagnose import diagnose_files

FIT_SHARE = 2.0 / 3.0
"""Share of a log's rows that is fitted to; the rest is the hold-out [-]."""


def main() -> None:
    """Diagnose the pairs of a folder and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--by", choices=("time", "position"), default="time")
    parser.add_argument("--without", action="store_true", help="the same logs without their references")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    truth = json.loads((options.folder / "truth.json").read_text(encoding="utf-8"))
    print("| case | truth | verdict | first (prob.) | second | truth's rank | gap | after | floor | s |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, told in truth.items():
        if (options.folder / name / "baseline.csv").is_file() and name in (options.cases or truth):
            print(_line(options.folder / name, told, options), flush=True)


def _line(case: Path, told: dict[str, Any], options: argparse.Namespace) -> str:
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        logs = {stem: _cut(case / f"{stem}.csv", Path(place)) for stem in ("fit", "baseline")}
        pairs = {} if options.without else {"paired": logs["baseline"], "by": options.by}
        said = diagnose_files(
            case / "vehicle.yaml",
            case / "road_fit.yaml",
            logs["fit"][:1],
            logs["fit"][1],
            jobs=options.jobs,
            **pairs,
        )
    ranked = [cause.effect for cause in said.causes]
    ranks = [ranked.index(effect) + 1 for effect in told["effects"] if effect in ranked]
    first = said.causes[0]
    after = first.gap_after  # of the first effect, whether the verdict adds it or not
    alike = [group for group in said.ambiguous_with if set(told["effects"]) & set(group)]
    return (
        f"| {case.name} | {'+'.join(told['effects'])} | {said.verdict}{' with it' if alike else ''} | {first.effect} "
        f"({first.probability:.2f}) | {ranked[1]} | {ranks} | {said.gap.before.total:.2f} | {after:.2f} | "
        f"{said.gap.noise_floor:.2f} | {time.perf_counter() - begun:.0f} |"
    )


def _cut(path: Path, place: Path) -> list[str]:
    """The log's first part and its rest, as files."""
    table = pd.read_csv(path)
    at = round(FIT_SHARE * len(table))
    parts = []
    for name, rows in (("first", table[:at]), ("last", table[at:])):
        parts.append(str(place / f"{path.stem}_{name}.csv"))
        rows.to_csv(parts[-1], index=False)
    return parts


if __name__ == "__main__":
    main()
