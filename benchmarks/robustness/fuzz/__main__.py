"""Run the fuzzing, each kind in child processes with a time limit; findings go to standard output and into one line.

``python -m benchmarks.robustness.fuzz [--seed N] [--vectors N] [--files N] [--kind NAME ...] [--out FILE]``
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from benchmarks.report import append

from .run import KIND_NAMES, RESULTS, UNIT_NAMES, child, run_kind


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness.fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--vectors", type=int, default=10_000, help="acts on each unit")
    parser.add_argument("--files", type=int, default=1000, help="damaged files of each kind")
    parser.add_argument("--kind", action="append", choices=[*UNIT_NAMES, *KIND_NAMES], help="only this one")
    parser.add_argument("--out", type=Path, default=RESULTS, help="file that the line is added to")
    parser.add_argument("--child", nargs=5, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        name, seed, start, stop, folder = options.child
        child(name, int(seed), range(int(start), int(stop)), Path(folder))
        os._exit(0)  # see "Limits" in docs/reference/unit.md
    results = {}
    for name in options.kind or (*UNIT_NAMES, *KIND_NAMES):
        count = options.vectors if name in UNIT_NAMES else options.files
        results[name] = run_kind(name, options.seed, count)
        print(name, json.dumps(results[name]), flush=True)
    append(options.out, {"seed": options.seed, "results": results})
    return int(any(result["findings"] for result in results.values()))


if __name__ == "__main__":
    sys.exit(main())
