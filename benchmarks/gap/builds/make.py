"""Draws cars that are built otherwise, three quarters of them with a fault, and writes them as cases.

python -m benchmarks.gap.builds.make out/builds --cases 60 --seed 5000
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rich.progress import track

from benchmarks.gap.builds.draw import COURSES, SIZES, write_case

NO_FAULT = 4
"""Every so many cases one is without a fault."""


def main() -> None:
    """Write the cases and their truth.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=5000)
    asked = parser.parse_args()
    effects, truth = list(SIZES), {}
    for i in track(range(asked.cases), "cases"):
        # of every NO_FAULT cases one has none; courses and effects go on at paces that have no common factor
        effect = "" if i % NO_FAULT == 0 else effects[(7 * i) % len(effects)]
        course = COURSES[(i // NO_FAULT + i) % len(COURSES)]
        name = f"build_{i:03d}"
        truth[name] = write_case(asked.out / name, asked.seed + i, effect, course)
    (asked.out / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
