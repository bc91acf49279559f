"""The matrix as a Markdown document, and its cells read back from there."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from .cases import TITLES
from .clients import CLIENTS
from .matrix import Place
from .operations import OPERATIONS
from .outcome import Cell, Outcome

NOT_RUN = "not run"
JOIN = ", "
"""Between the units of one table."""
DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "conformance.md"
HEAD = """# Conformance: which client can do what

Written by `python -m benchmarks.robustness.conformance`; do not edit. Every client does every operation of the first
column with every unit, each in a process of its own. Units with equal tables are listed together.

| cell | meaning |
|---|---|
| `ok` | done, and the outputs equal those of the unit's own code without FMI, bit for bit |
| `-` | the client does not offer it, or the unit does not have it |
| `FAILED` | not done, or other outputs; the reason is the client's message |

Numbers refer to the reasons at the end of the page.

- libcosim is compared to 1e-12 and without `TRPAC_std`: its step sizes are differences of times.
- "fmpy, own process" is fmpy in a second process. fmpy's own remoting is for units of another platform only.
- "C program" is a program of this project with the FMI headers of fmpy. "ecospy, proxyfmu" runs the unit in the
  process `proxyfmu`.
- Units of kind python get a picture, native units the road class as a number, and the plant neither.
- Native units run without any Python in the C program (empty environment) and in proxyfmu.
"""


def rows(cells: Mapping[Place, Cell], unit: str) -> list[str]:
    """The lines of one unit's table, without its head."""
    return [
        f"| {text} | "
        + " | ".join(_cell(cells.get(Place(client, unit, operation))) for client in CLIENTS)
        + " |"
        for operation, text in OPERATIONS.items()
    ]


def _cell(cell: Cell | None) -> str:
    if cell is None:
        return NOT_RUN
    return cell.outcome.value if cell.outcome is Outcome.OK else f"{cell.outcome.value} [{cell.reason}]"


def document(cells: Mapping[Place, Cell], versions: Mapping[str, str]) -> str:
    """The whole document."""
    reasons: dict[str, int] = {}
    lines = [HEAD, "Run on " + ", ".join(f"{name} {number}" for name, number in versions.items()) + ".", ""]
    alike: dict[tuple[str, ...], list[str]] = {}
    for unit in TITLES:
        alike.setdefault(tuple(rows(cells, unit)), []).append(unit)
    for found, units in alike.items():
        lines += [f"## {JOIN.join(units)}", "", "| | " + " | ".join(c.title for c in CLIENTS.values()) + " |"]
        lines.append("|---" * (len(CLIENTS) + 1) + "|")
        lines += [_numbered(row, reasons) for row in found] + [""]
    lines += ["## Reasons", ""]
    lines += [f"{number}. {reason}" for reason, number in reasons.items()]
    return "\n".join(lines) + "\n"


def _numbered(row: str, reasons: dict[str, int]) -> str:
    """The row with its reasons as numbers, those that are new added."""
    return re.sub(
        r" \[([^\]]*)\](?= \|)", lambda found: f" {reasons.setdefault(found[1], len(reasons) + 1)}", row
    )


def read_cells(text: str) -> dict[Place, Cell]:
    """The cells that a document holds."""
    reasons = dict(re.findall(r"^(\d+)\. (.*)$", text, re.MULTILINE))
    operations = {title: name for name, title in OPERATIONS.items()}
    found: dict[Place, Cell] = {}
    for section in text.split("\n## ")[1:]:
        heading, *lines = section.splitlines()
        units = [unit for unit in heading.split(JOIN) if unit in TITLES]
        for line in lines:
            title, *cells = [part.strip() for part in line.strip("|").split("|")]
            if title in operations:
                for client, cell in zip(CLIENTS, cells, strict=True):
                    if cell != NOT_RUN:
                        outcome, _, number = cell.partition(" ")
                        for unit in units:
                            place = Place(client, unit, operations[title])
                            found[place] = Cell(Outcome(outcome), reasons.get(number, ""))
    return found
