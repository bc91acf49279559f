"""`python -m sim2real.cases DATA [CASE]`: the gap budgets of all cases or one.

With `CASE --step N --out DIR` a diagnosis of what remains after step N, from 0.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scenarios.errors import ScenarioError
from sim2real.cases.case import Stage, budget, case_names, stages
from sim2real.diagnose import diagnose
from sim2real.reporting.report import rated, write_diagnosis


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m sim2real.cases", description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the vehicle logs")
    parser.add_argument("case", nargs="?", choices=case_names(), help="without it all")
    parser.add_argument("--step", type=int, help="diagnose what remains after this step, from 0")
    parser.add_argument("--out", type=Path, help="folder for diagnosis.json and report.html")
    asked = parser.parse_args()
    if (asked.step is None) != (asked.out is None) or (asked.step is not None and asked.case is None):
        parser.error("--step, --out and CASE go together")
    try:
        for name in [asked.case] if asked.case else case_names():
            found = stages(name, asked.data)
            if asked.step is None:
                _print(name, found)
            elif 0 <= asked.step < len(found):
                _diagnose(found[asked.step], asked.out)
            else:
                steps = ", ".join(f"{index} ({stage.name})" for index, stage in enumerate(found))
                parser.error(f"argument --step: {name} has no step {asked.step}; it has {steps}")
    except (ScenarioError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _print(name: str, found: list[Stage]) -> None:
    print(f"\n{name}")
    for stage, gap in zip(found, budget(found), strict=True):
        si = "  ".join(f"{key} {value:.3g}" for key, value in gap.si.items())
        print(f"  {gap.total:8.2f}  {stage.name:44s} {si}")


def _diagnose(stage: Stage, out: Path) -> None:
    said = diagnose(stage.model, stage.fit, stage.holdout)
    written = write_diagnosis(rated(said), out)
    print(said.sentence, *written, sep="\n")


if __name__ == "__main__":
    sys.exit(main())
