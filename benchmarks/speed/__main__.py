"""How fast are estimator, four wheels and plant? One command, one line of JSON added to out/speed.jsonl (`--out`).

`make bench` on a machine that does nothing else. Figures compare within a line: each holds its own reference loop.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.report import append

from . import estimator, four_wheels, plant


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=Path("out/speed.jsonl"), help="file that the line is added to"
    )
    out = parser.parse_args().out
    figures = {
        "one_wheel": estimator.measure(),
        "four_wheels": four_wheels.measure(),
        "plant": plant.measure_all(),
    }
    print(json.dumps(append(out, figures), indent=2))


if __name__ == "__main__":
    main()
