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
DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "conformance.md"
HEAD = """# Which client can do what with the units

Written by `python -m benchmarks.robustness.conformance`; do not edit. It builds the units and lets each client do
everything in the first column, in a process of its own, so that a crash is a cell. `ok` is held to numbers: the
unit's own code, called without FMI, gives the same outputs bit for bit. `-` is not offered by the client or not there
in the unit, `FAILED` what it says; the numbers stand for the reasons below.

libcosim hands over step sizes that are differences of times: it is compared to 1e-12,
without `TRPAC_std`, which is renewed block of time by block of time, one step earlier or later there. fmpy's own
remoting serves units for another platform only (Windows units under wine), so "fmpy, own process" is fmpy behind a
pipe. The C program is ours, on the FMI headers that fmpy ships.

Units with Python are given a picture, native units the road's class by number, the plant neither. The C program runs
native units in an empty environment, proxyfmu with nothing but itself and `unzip` on PATH: neither can find a Python.
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
    for unit in TITLES:
        lines += [f"## {unit}", "", "| | " + " | ".join(c.title for c in CLIENTS.values()) + " |"]
        lines.append("|---" * (len(CLIENTS) + 1) + "|")
        lines += [_numbered(row, reasons) for row in rows(cells, unit)] + [""]
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
        unit, *lines = section.splitlines()
        if unit not in TITLES:
            continue
        for line in lines:
            title, *cells = [part.strip() for part in line.strip("|").split("|")]
            if title in operations:
                for client, cell in zip(CLIENTS, cells, strict=True):
                    if cell != NOT_RUN:
                        outcome, _, number = cell.partition(" ")
                        place = Place(client, unit, operations[title])
                        found[place] = Cell(Outcome(outcome), reasons.get(number, ""))
    return found
