"""The log as MDF4, written to a scratch file that becomes the log at the end."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trpac_hil.records import Column

SCRATCH_PREFIX = ".hil_"
MASTER = ("time_s", 1)
"""Name of the master channel, and MDF's number for one that is time."""


class MdfLog:
    """A log whose rows go to a scratch file on the same disk; `finish` makes it the log.

    Every method raises OSError where the disk is full or the folder is gone.
    """

    def __init__(self, path: Path, columns: Sequence[Column], comment: str) -> None:
        from asammdf import MDF  # takes a second to import, which only the recorder has to pay

        self.path, self._columns = path, columns
        self._scratch = Path(tempfile.mkdtemp(dir=path.parent, prefix=SCRATCH_PREFIX))
        self._mdf: Any = MDF(version="4.10", temporary_folder=str(self._scratch))
        self._mdf.header.comment = comment
        self.rows = 0

    def add(self, rows: NDArray[np.float64]) -> None:
        """Append rows, shape (n, columns)."""
        from asammdf import Signal

        if not len(rows):
            return
        samples = [_stored(rows[:, i], c.kind) for i, c in enumerate(self._columns)]
        if self.rows:
            self._mdf.extend(0, [(part, None) for part in samples])
        else:
            signals = [
                Signal(part, samples[0], unit=c.unit, name=c.name, comment=c.meaning, master_metadata=MASTER)
                for c, part in zip(self._columns[1:], samples[1:], strict=True)
            ]
            self._mdf.append(signals, common_timebase=True)
        self.rows += len(rows)

    def finish(self) -> None:
        """Write the file under another name, then rename it."""
        try:
            whole = Path(self._mdf.save(self._scratch / self.path.name, overwrite=True))
            self._mdf.close()
            whole.replace(self.path)
        finally:
            self.drop()

    def drop(self) -> None:
        """Remove the scratch file."""
        shutil.rmtree(self._scratch, ignore_errors=True)


def _stored(values: NDArray[np.float64], kind: str) -> NDArray[Any]:
    dtype = np.dtype(kind)
    if dtype.kind == "f":
        return values.astype(dtype)
    return np.nan_to_num(values).astype(dtype)
