"""What commands on files share: progress bars, the check of the output folder, refusals on one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

EXIT_INPUT = 2
"""Unusable input: one line on standard error, and nothing written."""
MOST_NAMED = 10
"""Problems that the line names; the rest are counted."""

Told = Callable[[str, int, int], None]


@contextmanager
def bars() -> Iterator[Told]:
    """A progress bar per stage, and what to tell them."""
    columns = (TextColumn("{task.description:>20}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns) as shown:
        tasks: dict[str, TaskID] = {}

        def told(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = shown.add_task(stage, total=total)
            shown.update(tasks[stage], completed=done, total=total)

        yield told


def require_folder(command: str, out: Path) -> None:
    """Refuse before the work what would fail after it."""
    try:
        there = next(p for p in (out, *out.absolute().parents) if p.exists())
    except OSError as error:  # a name that is too long, a folder that may not be entered
        refuse(command, error)
    if not there.is_dir():
        refuse(command, f"{there}: a file. Expected a folder to write into.")
    if not os.access(there, os.W_OK | os.X_OK):
        refuse(command, f"{there}: no permission to write there. Expected a folder of your own.")


def refuse(command: str, problem: str | Exception) -> NoReturn:
    """All problems in one line on standard error."""
    lines = [line.strip() for line in str(problem).splitlines() if line.strip()]
    more = [f"And {len(lines) - MOST_NAMED} more problems."] if len(lines) > MOST_NAMED else []
    print(f"{command}: {' '.join([*lines[:MOST_NAMED], *more])}", file=sys.stderr)
    raise typer.Exit(EXIT_INPUT)
