"""The common part of the commands: terminal, progress bars, check of the folder, error messages."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from fmu_src.kinds import KINDS, PYTHON
from scenarios.progress import StageProgress
from trpac_core.files import quoted

EXIT_INPUT = 2
"""Exit code of unusable input, with one line on standard error and no file written."""
LONGEST_LINE = 900
"""Characters of that line: problems that fit are named, further ones are counted."""
LONGEST_SHOWN = 10_000
"""Greatest number of characters of a line on the terminal."""
MethodOption = Annotated[
    str,
    typer.Option(
        "--method",
        help="Estimator:\n\nas_printed: the equations of the paper, unchanged.\n\ndife: the paper's fusion with guards "
        "against noise and wrong classes.\n\nrobust: for a car or a tyre that is not known exactly, with an interval.",
    ),
]

UnitOption = Annotated[
    str | None,
    typer.Option(
        "--unit",
        metavar="|".join(KINDS),
        help="Kind of FMU to build if --fmu is not given:\n\npython: contains the networks; the default."
        "\n\nnative: in C, without Python; pictures are classified outside the FMU.",
    ),
]


class Terminal(Console):
    """A console for text from files: brackets are no markup, control characters are shown as codes.

    Text with markup is printed by `print(..., markup=True)`, with text from files escaped.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """The text with control characters as codes."""
        plain = "\n".join(quoted(line, LONGEST_SHOWN) for line in text.split("\n"))
        return super().render_str(plain, **options)


@contextmanager
def bars() -> Iterator[StageProgress]:
    """Show a progress bar per stage; the context's value is what the work calls."""
    named = TextColumn("{task.description:>20}", markup=False)
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(named, BarColumn(), MofNCompleteColumn(), *times, console=Terminal()) as shown:
        tasks: dict[str, TaskID] = {}

        def progress(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = shown.add_task(stage, total=total)
            shown.update(tasks[stage], completed=done, total=total)

        yield progress


def require_folder(command: str, out: Path) -> None:
    """Refuse a folder that cannot be written to, before the work begins."""
    try:
        there = next(p for p in (out, *out.absolute().parents) if p.exists())
    except OSError as error:  # a name that is too long, a folder that may not be entered
        refuse(command, error)
    if not there.is_dir():
        refuse(command, f"{there}: a file. Expected a folder to write into.")
    if not os.access(there, os.W_OK | os.X_OK):
        refuse(command, f"{there}: no permission to write there. Expected a folder of your own.")


def kind_to_build(command: str, fmu: Path | None, unit: str | None) -> str:
    """Kind of the unit to build; another word, and both options at once, are refused."""
    if unit not in (None, *KINDS):
        refuse(command, f"--unit {unit}: expected {' or '.join(KINDS)}.")
    if fmu is not None and unit is not None:
        refuse(command, "--unit is for a unit that is built, and --fmu names one: leave one of them out.")
    return unit or PYTHON


def refuse(command: str, problem: str | Exception) -> NoReturn:
    """Print all problems as one line on standard error and exit with `EXIT_INPUT`."""
    complain(command, problem)
    raise typer.Exit(EXIT_INPUT)


def complain(command: str, problem: str | Exception) -> None:
    """Print problems, one per line of the text, as one line on standard error, as far as they fit."""
    lines = [line.strip() for line in str(problem).splitlines() if line.strip()]
    shown: list[str] = []
    room = LONGEST_LINE
    for line in lines:
        text = quoted(line, LONGEST_LINE)
        if shown and len(text) > room:
            break
        shown.append(text)
        room -= len(text) + 1
    more = [f"And {len(lines) - len(shown)} more problems."] if len(lines) > len(shown) else []
    print(f"{command}: {' '.join([*shown, *more])}", file=sys.stderr)
