"""Put small faults into a copy of the code, one at a time, and say which the tests do not find.

``python -m benchmarks.robustness.mutants FOLDER ... --tests PATH ... [--count N] [--seed N] [--again FILE]``
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from .faults import Mutant, every, files_of, prefix_of, sample
from .run import Bench

ROOT = Path(__file__).parents[3]
RESULTS = Path("out") / "mutants.jsonl"
FOUND = ("killed", "hangs")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness.mutants", description=__doc__)
    parser.add_argument("folders", nargs="+", help="folders and files of the code, from the root")
    parser.add_argument("--tests", nargs="+", required=True, help="folders and files of the tests")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--marks", default="not long", help="which tests, as pytest's -m has it")
    parser.add_argument("--hangs-s", type=float, default=60.0, help="tests of a mutant that work longer hang")
    parser.add_argument(
        "--tests-s", type=float, default=40.0, help="as many tests of a mutant as take so long"
    )
    parser.add_argument("--again", type=Path, help="file of results: only the mutants that survived there")
    parser.add_argument("--root", type=Path, default=ROOT, help="of the git tree")
    parser.add_argument("--work", type=Path, help="folder to keep, while neither code nor tests change")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    try:
        files_of(options.root, options.folders)
    except ValueError as error:
        parser.error(str(error))
    with tempfile.TemporaryDirectory(prefix="trpac-mutants-") as place:
        work = (options.work or Path(place)).absolute()
        work.mkdir(parents=True, exist_ok=True)
        limits = {"marks": options.marks, "tests_s": options.tests_s, "hangs_s": options.hangs_s}
        bench = Bench(options.root.absolute(), work, options.folders, options.tests, **limits)
        mutants = _chosen(bench.copy, options)
        bench.watch()
        print(
            f"{len(bench.took)} tests pass, {len(bench.failed)} are skipped or fail",
            *bench.failed,
            sep="\n  ",
        )
        bench.load()
        options.out.parent.mkdir(parents=True, exist_ok=True)
        with options.out.absolute().open("w", encoding="utf-8") as out:
            results = [_one(bench, mutant, i, out) for i, mutant in enumerate(mutants)]
        wrong = bench.confirm(r["by"] for r in results if r["by"])
        for result in results:
            if result["by"] in wrong:
                result["outcome"] = "unsure"
    print("tests that fail without a fault, too:", *wrong, sep="\n  ")
    _tell(options.folders, results)
    return 0


def _chosen(root: Path, options: argparse.Namespace) -> list[Mutant]:
    """A sample, or what was not found of an earlier one."""
    if options.again is None:
        return sample(root, options.folders, options.count, options.seed)
    told = [json.loads(line) for line in options.again.read_text(encoding="utf-8").splitlines()]
    wanted = [tuple(r["identity"]) for r in told if r["outcome"] not in FOUND]
    files = sorted({identity[0] for identity in wanted})
    there = {m.identity: m for m in every(root, [f for f in files if (root / f).exists()])}
    for identity in wanted:
        if identity not in there:
            print("gone:", *identity)
    return [there[identity] for identity in wanted if identity in there]


def _one(bench: Bench, mutant: Mutant, number: int, out: Any) -> dict[str, Any]:
    result = {"name": mutant.name, **bench.judge(mutant, bench.tests_of(mutant), number)}
    result["identity"] = mutant.identity
    print(json.dumps(result), file=out, flush=True)
    print(number, result["outcome"], f"{result['seconds']:.1f}", result["name"], result["by"], flush=True)
    return result


def _tell(folders: list[str], results: list[dict[str, Any]]) -> None:
    for folder in folders:
        counts = Counter(r["outcome"] for r in results if r["name"].startswith(prefix_of(folder)))
        found = sum(counts[outcome] for outcome in FOUND)
        print(f"{folder}: {found} of {counts.total()} found ({dict(counts)})")
    for result in results:
        if result["outcome"] != "killed":
            print(result["outcome"], result["name"])


if __name__ == "__main__":
    sys.exit(main())
