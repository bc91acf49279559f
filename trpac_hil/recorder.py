"""The recorder: a process beside the loop that writes log, quantiles and terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trpac_hil.figures import Figures
from trpac_hil.helper import Control, helper
from trpac_hil.mdf import MdfLog
from trpac_hil.records import Column
from trpac_hil.shared import Ring

if TYPE_CHECKING:
    from trpac_hil.bus_file import BusFile

EVERY_S = 0.25
"""Time between two readings of the rows, and redraws of the terminal [s]."""
ROWS_KEPT = 30_000
"""Rows that the shared memory holds: 30 s at 1 kHz."""
LOG_FAILED, BUS_FILE_FAILED = "log failed", "recording failed"


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
    ages : mapping
        Columns of the ages of what a quantity is made of, by quantity; for the table.
    bus_file : Path or None
        File for the messages of the bus; None without.
    """

    columns: tuple[Column, ...]
    log: Path | None
    comment: str
    live: bool
    title: str
    core: int | None = None
    ages: Mapping[str, Sequence[str]] = field(default_factory=dict)
    bus_file: Path | None = None


def record(
    job: RecorderJob, ring: Ring, control: Control, event_queue: Any, messages: Ring | None = None
) -> None:
    """Body of the process: read rows until the loop ends, then finish the log and send the quantiles.

    `messages` are those of the bus, as `trpac_hil.bus_relay.packed` makes them.
    """
    with helper(job.core):
        figures, log = (
            Figures(job.columns),
            _open(job.log, control, lambda path: MdfLog(path, job.columns, job.comment)),
        )
        bus_file = _open(job.bus_file, control, _bus_file)
        control.ready()
        started = control.wait_for_start()
        with _screen(job) as screen:
            over = not started
            while not over:
                over = control.stopped
                rows = ring.read()
                figures.add(rows)
                log = _kept(log, rows, control)
                if messages is not None:
                    bus_file = _kept(bus_file, messages.read(), control, BUS_FILE_FAILED)
                screen.show(figures, _new_events(event_queue))
                if not over:
                    time.sleep(EVERY_S)
            screen.show(figures, _new_events(event_queue))
        done = {"figures": figures.summary(), "log_rows": _finished(log, control), "rows_lost": ring.lost}
        if messages is not None:
            written = _finished(bus_file, control, BUS_FILE_FAILED)
            done |= {"messages": written, "messages_lost": messages.lost}
        control.send("done", done)


def _bus_file(path: Path) -> BusFile:
    from trpac_hil.bus_file import BusFile  # python-can's writers take a moment, and few runs need them

    return BusFile(path)


def _new_events(event_queue: Any) -> list[tuple[float, str]]:
    texts = []
    while not event_queue.empty():
        texts.append(event_queue.get())
    return texts


def _open(path: Path | None, control: Control, make: Callable[[Path], Any]) -> Any:
    """A file that `make` opens, None for no path; where it cannot be written the run is refused."""
    if path is None:
        return None
    try:
        return make(path)
    except OSError as error:
        control.refuse(f"{path}: cannot be written ({error}).")
        raise SystemExit(1) from error


def _kept(file: Any, rows: NDArray[np.float64], control: Control, kind: str = LOG_FAILED) -> Any:
    """Add rows to a file; returns it, or None where it could not be written and is given up."""
    if file is None:
        return None
    try:
        file.add(rows)
    except OSError as error:
        file.drop()
        control.send(kind, f"{file.path}: cannot be written ({error}).")
        print(f"trpac hil: {file.path}: cannot be written ({error}).", file=sys.stderr)
        return None
    return file


def _finished(file: Any, control: Control, kind: str = LOG_FAILED) -> int:
    """Finish a file; returns its number of rows."""
    if file is None:
        return 0
    if not file.rows:
        file.drop()
        return 0
    try:
        file.finish()
    except OSError as error:
        control.send(kind, f"{file.path}: cannot be written ({error}).")
        return 0
    return int(file.rows)


def _screen(job: RecorderJob) -> Any:
    from trpac_hil.screen import EventLines, Screen  # rich takes a moment, and tests need it not

    return Screen(job.title, job.ages) if job.live else EventLines()
