"""How fast are estimator, four wheels, plant, native unit? One command, one line of JSON in out/speed.jsonl (`--out`).

`make bench` on a machine that does nothing else; ``python -m benchmarks.speed plant`` measures one and adds no line.
Figures compare within a line: each holds its own reference loop.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.report import append

from . import estimator, four_wheels, native, plant

PARTS = {
    "one_wheel": estimator.measure,
    "four_wheels": four_wheels.measure,
    "plant": plant.measure_all,
    "native": native.measure,
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("only", nargs="?", choices=PARTS, help="measure this alone")
    parser.add_argument(
        "--out", type=Path, default=Path("out/speed.jsonl"), help="file that the line is added to"
    )
    given = parser.parse_args()
    if given.only:
        print(json.dumps(PARTS[given.only](), indent=2))
        return
    print(json.dumps(append(given.out, {name: measure() for name, measure in PARTS.items()}), indent=2))


if __name__ == "__main__":
    main()
