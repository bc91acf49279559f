"""Writes the units' variable tables to docs: `python -m fmu_src.variable_table`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from trpac_core.parameters.variables import Variable

from .units import UNITS

DOCS = Path(__file__).parent.parent / "docs" / "reference"
TARGETS = {
    "TrpacEstimator": DOCS / "fmu_variables.md",
    "TrpacEstimator4W": DOCS / "fmu_variables_4w.md",
    "ReferencePlant": DOCS / "fmu_variables_plant.md",
    "TorquePulses": DOCS / "fmu_variables_pulses.md",
}


def table(unit: str, variables: Sequence[Variable]) -> str:
    """The variables of a unit as a Markdown document."""
    lines = [
        f"# Variables of the unit {unit}",
        "",
        "Written by `python -m fmu_src.variable_table`; do not edit.",
    ]
    for causality in ("input", "output", "parameter"):
        lines += ["", f"## {causality.capitalize()}s", "", "| name | type | unit | range | start | meaning |"]
        lines.append("|---|---|---|---|---|---|")
        lines += [_row(v) for v in variables if v.causality == causality]
    return "\n".join(lines) + "\n"


def _row(v: Variable) -> str:
    bounds = ["" if bound is None else f"{bound:g}" for bound in (v.minimum, v.maximum)]
    start = "" if v.start is None else f"`{str(v.start).lower()}`" if v.start != "" else "empty"
    limits = f"{bounds[0]} ... {bounds[1]}".strip() if any(bounds) else ""
    return f"| `{v.name}` | {v.kind.value} | {v.unit or ''} | {limits} | {start} | {v.description} |"


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    for name, target in TARGETS.items():
        target.write_text(table(name, UNITS[name].variables), encoding="utf-8")
        print(target)
