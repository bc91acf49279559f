"""Writes the units' variable tables to docs: `python -m fmu_src.variable_table`.

Variables that differ in one part of their names only, such as the wheel, are one row: `wheel_speed.{fl,fr,rl,rr}`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from trpac_core.parameters.variables import Kind, Variable

from .units import UNITS

DOCS = Path(__file__).parent.parent / "docs" / "reference"
TARGETS = {
    "TrpacEstimator": DOCS / "fmu_variables.md",
    "TrpacEstimator4W": DOCS / "fmu_variables_4w.md",
    "ReferencePlant": DOCS / "fmu_variables_plant.md",
    "TorquePulses": DOCS / "fmu_variables_pulses.md",
}
SHARED = {"TrpacEstimator4W": "TrpacEstimator"}
"""Units whose table leaves out parameters that are the same in another unit's table."""
HEAD = """# Variables of the unit {unit}

Written by `python -m fmu_src.variable_table`; do not edit. `name.{{a,b}}` means `name.a` and `name.b`. Start values
that differ are listed in the order of the braces. The column "unit" has the type where a variable is not Real; unit 1
means dimensionless. A flat unit has `_` for each dot.
"""
SHARED_HEAD = (
    """All parameters of [{other}]({file}) except {without}, with the same ranges and start values, and:"""
)
ALTERNATIVES = (
    ("fl", "fr", "rl", "rr"),
    ("left", "right"),
    ("1", "2", "3", "4", "5"),
    ("near", "middle", "far"),
    ("small", "medium", "big"),
    ("dry", "wet", "snow_ice"),
    ("k1", "k2", "p1", "p2", "k3"),
    ("width", "height"),
)
"""Parts of names whose variables can share a row."""
OWNER = re.compile(r"^((Front|Rear) (left|right) wheel|(Left|Right) track|Segment \d): ")
"""Beginning of a description that says to which part a variable belongs."""


def table(unit: str, variables: Sequence[Variable]) -> str:
    """The variables of a unit as a Markdown document."""
    lines = [HEAD.format(unit=unit)]
    for causality in ("input", "output", "parameter"):
        listed = [v for v in variables if v.causality == causality]
        if not listed:
            continue
        lines += [f"## {causality.capitalize()}s", ""]
        if causality == "parameter" and unit in SHARED:
            lines.append(_reference(SHARED[unit], listed) + "\n")
            listed = [v for v in listed if v.name not in _names(_parameters(SHARED[unit]))]
        lines += ["| name | unit | range | start | meaning |", "|---|---|---|---|---|"]
        lines += [_row(*row) for row in _rows(listed)]
        lines.append("")
    return "\n".join(lines)


def _reference(other: str, own: Sequence[Variable]) -> str:
    """A sentence in place of the rows of parameters that another unit has, too; ValueError where they differ."""
    ours = {v.name: replace(v, source="") for v in own}
    theirs = {v.name: replace(v, source="") for v in _parameters(other)}
    if differ := [name for name in ours.keys() & theirs.keys() if ours[name] != theirs[name]]:
        raise ValueError(f"parameters that differ from those of {other}: {', '.join(sorted(differ))}")
    without = " and ".join(f"`{name}`" for name in theirs if name not in ours)
    return SHARED_HEAD.format(other=other, file=TARGETS[other].name, without=without)


def _parameters(unit: str) -> list[Variable]:
    return [v for v in UNITS[unit].variables if v.causality == "parameter"]


def _names(variables: Iterable[Variable]) -> set[str]:
    return {v.name for v in variables}


def _rows(variables: Sequence[Variable]) -> list[tuple[str, list[Variable]]]:
    """Rows: the pattern of their names, and their variables, which differ in that part and in their starts only."""
    rows = [(v.name, [replace(v, description=OWNER.sub("", v.description))]) for v in variables]
    for parts in ALTERNATIVES:
        rows = _merged(rows, parts)
    return rows


def _merged(
    rows: Sequence[tuple[str, list[Variable]]], parts: Sequence[str]
) -> list[tuple[str, list[Variable]]]:
    """Rows of which those that differ in one of these parts are one, at the place of the first."""
    patterns = dict(rows)
    braces = "{" + ",".join(parts) + "}"
    done: list[tuple[str, list[Variable]]] = []
    gone: set[str] = set()
    for pattern, members in rows:
        if pattern in gone:
            continue
        found = re.split(rf"(?<![A-Za-z0-9{{,])({parts[0]})(?![A-Za-z0-9}},])", pattern, maxsplit=1)
        names = [f"{found[0]}{part}{found[-1]}" for part in parts] if len(found) == 3 else []
        if names and all(name in patterns and _alike(members[0], patterns[name][0]) for name in names):
            gone.update(names)
            joined = [v for name in names for v in patterns[name]]
            done.append((f"{found[0]}{braces}{found[2]}", joined))
        else:
            done.append((pattern, members))
    return done


def _alike(one: Variable, other: Variable) -> bool:
    def compared(v: Variable) -> Variable:
        return replace(v, name="", description="", start=None, source="")

    ours, theirs = one.description.split(), other.description.split()
    differ = len(ours) != len(theirs) or sum(a != b for a, b in zip(ours, theirs, strict=True)) > 1
    return compared(one) == compared(other) and not differ


def _row(pattern: str, members: Sequence[Variable]) -> str:
    v = members[0]
    unit = v.unit or "" if v.kind is Kind.REAL else v.kind.value
    starts = list(dict.fromkeys(_start(v) for v in members))
    start = ", ".join(starts if len(starts) == 1 else (_start(v) for v in members))
    words = zip(*(v.description.split() for v in members), strict=True)
    meaning = " ".join("/".join(dict.fromkeys(word)) for word in words)
    meaning = meaning[0].upper() + meaning[1:]
    return f"| `{pattern}` | {unit} | {_range(v)} | {start} | {meaning} |"


def _start(v: Variable) -> str:
    if v.start is None:
        return ""
    if isinstance(v.start, str):
        return v.start or "empty"
    return str(v.start).lower() if isinstance(v.start, bool) else f"{v.start:g}"


def _range(v: Variable) -> str:
    if v.minimum is None and v.maximum is None:
        return ""
    if v.maximum is None:
        return f"≥ {v.minimum:g}"
    return f"≤ {v.maximum:g}" if v.minimum is None else f"{v.minimum:g} to {v.maximum:g}"


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    for name, target in TARGETS.items():
        target.write_text(table(name, UNITS[name].variables), encoding="utf-8")
        print(target)
