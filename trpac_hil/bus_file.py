"""A recording of the bus in a format of python-can, written to a scratch file that becomes the recording at the end."""

from __future__ import annotations

import os
from pathlib import Path

import can
import numpy as np
from numpy.typing import NDArray

from trpac_hil.bus_relay import unpacked

FORMATS = (".blf", ".asc", ".log", ".mf4")
"""Endings of the recordings that can be written; python-can's .trc leaves out CAN FD."""


def scratch(path: Path) -> Path:
    """The file that becomes a recording at its end."""
    return path.with_name(f".{path.stem}.part{path.suffix}")


class BusFile:
    """A recording; every method raises OSError where the disk is full or the folder is gone."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.rows = path, 0
        self._scratch = scratch(path)
        self._writer = can.Logger(str(self._scratch))

    def add(self, rows: NDArray[np.float64]) -> None:
        """Append messages, rows of `trpac_hil.bus_relay.packed`."""
        for row in rows.tolist():
            self._writer(unpacked(row))
        self.rows += len(rows)

    def finish(self) -> None:
        """Write the end of the recording and give it its name."""
        self._writer.stop()
        os.replace(self._scratch, self.path)

    def drop(self) -> None:
        """Remove what was written."""
        try:
            self._writer.stop()
        finally:
            self._scratch.unlink(missing_ok=True)
