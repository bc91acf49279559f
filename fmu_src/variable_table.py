"""Writes docs/fmu_variables.md: `python -m fmu_src.variable_table`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .interface import TRPAC_ESTIMATOR
from .variables import Variable

TARGET = Path(__file__).parent.parent / "docs" / "fmu_variables.md"


def table(variables: Sequence[Variable]) -> str:
    """The variables as a Markdown document."""
    lines = [
        "# Variables of the unit TrpacEstimator",
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
    TARGET.write_text(table(TRPAC_ESTIMATOR), encoding="utf-8")
    print(TARGET)
