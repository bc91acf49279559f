"""Progress bars of the training run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import numpy as np
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

Report = Callable[[int, float], None]
"""Receives the step and the loss, which may be NaN."""
Steps = Callable[[str, int], AbstractContextManager[Report]]
"""Opens a bar of so many steps."""


def bars() -> Progress:
    """Progress bars, each with its own text."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )


@contextmanager
def steps_of(progress: Progress, description: str, steps: int) -> Iterator[Report]:
    """A bar of a number of steps; it yields a function that receives the step and the loss, which may be NaN."""
    task = progress.add_task(description, total=steps, note="")
    smooth: list[float] = []

    def report(step: int, loss: float) -> None:
        smooth.append(loss)
        note = f"loss {np.mean(smooth[-50:]):.3f}" if np.isfinite(loss) else ""
        progress.update(task, completed=step, note=note)

    yield report
