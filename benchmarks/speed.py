"""How fast estimator, four wheels and plant are: one command, one line of JSON in benchmarks/history/speed.jsonl.

`make bench` on a machine that does nothing else. Figures compare within a line: each holds its own reference loop.
"""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks import bench_estimator, bench_four_wheels, bench_plant
from benchmarks.ledger import append

HISTORY = Path(__file__).parent / "history" / "speed.jsonl"


def main() -> None:
    line = append(
        HISTORY,
        {
            "one_wheel": bench_estimator.measure(),
            "four_wheels": bench_four_wheels.measure(),
            "plant": bench_plant.measure_all(),
        },
    )
    print(json.dumps(line, indent=2))


if __name__ == "__main__":
    main()
