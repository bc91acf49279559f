"""The recorder: a process beside the loop that writes log, quantiles and terminal."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trpac_hil.figures import Figures
from trpac_hil.helper import Control, helper
from trpac_hil.mdf import MdfLog
from trpac_hil.records import Column
from trpac_hil.shared import Ring

EVERY_S = 0.25
"""Time between two readings of the rows, and redraws of the terminal [s]."""
ROWS_KEPT = 30_000
"""Rows that the shared memory holds: 30 s at 1 kHz."""
LOG_FAILED = "log failed"


@dataclass(frozen=True)
class RecorderJob:
    """Settings of the recorder.

    Attributes
    ----------
    columns : tuple of Column
        Columns of the rows.
    log : Path or None
        The MDF4 file; None without log.
    comment : str
        Comment of the log.
    live : bool
        Whether to draw the table on the terminal while the loop runs.
    title : str
        Title of that table.
    core : int or None
        The loop's core, which this process does not use.
    """

    columns: tuple[Column, ...]
    log: Path | None
    comment: str
    live: bool
    title: str
    core: int | None = None


def record(job: RecorderJob, ring: Ring, control: Control, event_queue: Any) -> None:
    """Body of the process: read rows until the loop ends, then finish the log and send the quantiles."""
    with helper(job.core):
        figures, log = Figures(job.columns), _open(job, control)
        control.ready()
        with _screen(job) as screen:
            if control.wait_for_start():
                over = False
                while not over:
                    over = control.stopped
                    rows = ring.read()
                    figures.add(rows)
                    log = _kept(log, rows, control)
                    screen.show(figures, _new_events(event_queue))
                    if not over:
                        time.sleep(EVERY_S)
            screen.show(figures, _new_events(event_queue))
        written = _finished(log, control)
        control.send("done", {"figures": figures.summary(), "log_rows": written, "rows_lost": ring.lost})


def _new_events(event_queue: Any) -> list[tuple[float, str]]:
    texts = []
    while not event_queue.empty():
        texts.append(event_queue.get())
    return texts


def _open(job: RecorderJob, control: Control) -> MdfLog | None:
    if job.log is None:
        return None
    try:
        return MdfLog(job.log, job.columns, job.comment)
    except OSError as error:
        control.refuse(f"{job.log}: the log cannot be written ({error}).")
        raise SystemExit(1) from error


def _kept(log: MdfLog | None, rows: NDArray[np.float64], control: Control) -> MdfLog | None:
    """Add rows to the log; returns it, or None where it could not be written and is given up."""
    if log is None:
        return None
    try:
        log.add(rows)
    except OSError as error:
        log.drop()
        control.send(LOG_FAILED, f"{log.path}: the log cannot be written ({error}).")
        print(f"trpac hil: {log.path}: the log cannot be written ({error}).", file=sys.stderr)
        return None
    return log


def _finished(log: MdfLog | None, control: Control) -> int:
    """Finish the log; returns its number of rows."""
    if log is None:
        return 0
    if not log.rows:
        log.drop()
        return 0
    try:
        log.finish()
    except OSError as error:
        control.send(LOG_FAILED, f"{log.path}: the log cannot be written ({error}).")
        return 0
    return log.rows


def _screen(job: RecorderJob) -> Any:
    from trpac_hil.screen import EventLines, Screen  # rich takes a moment, and tests need it not

    return Screen(job.title) if job.live else EventLines()
