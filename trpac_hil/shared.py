"""Memory that the loop shares with the processes beside it, without locks, system calls or waiting.

One process writes and one reads. Numbers of 8 bytes are written atomically on all machines that run Python 3.11; a row
is announced after it is written and holds its own number, by which a reader detects that it was overwritten.
"""

from __future__ import annotations

from collections.abc import Sequence
from multiprocessing.sharedctypes import RawArray
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Ring:
    """A ring of rows of numbers; a reader that is too slow loses the oldest rows, which `lost` counts."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._memory: Any = RawArray("d", (columns + 1) * rows)
        self._head: Any = RawArray("q", 1)
        self._view: Array | None = None
        self._read = 0
        self.lost = 0

    def __getstate__(self) -> tuple[Any, ...]:
        return self.columns, self.rows, self._memory, self._head

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.columns, self.rows, self._memory, self._head = state
        self._view, self._read, self.lost = None, 0, 0

    def _rows(self) -> Array:
        if self._view is None:
            self._view = np.frombuffer(self._memory, dtype=np.float64).reshape(self.rows, self.columns + 1)
        return self._view

    def write(self, values: Sequence[float]) -> None:
        """Append a row."""
        number = self._head[0]
        row = self._rows()[number % self.rows]
        row[0] = -1.0
        row[1:] = values
        row[0] = number
        self._head[0] = number + 1

    @property
    def waiting(self) -> bool:
        """Whether there are unread rows."""
        return bool(self._head[0] > self._read)

    @property
    def written(self) -> int:
        """Number of rows written since the start."""
        return int(self._head[0])

    def read(self) -> Array:
        """Rows since the last call that were not overwritten, shape (n, columns)."""
        head = self._head[0]
        first = max(self._read, head - self.rows)
        numbers = np.arange(first, head)
        rows = self._rows()[numbers % self.rows]
        whole = rows[:, 0] == numbers
        self.lost += int(first - self._read + np.count_nonzero(~whole))
        self._read = head
        return rows[whole, 1:]


class Numbers:
    """A few numbers that one process sets and others read."""

    def __init__(self, size: int) -> None:
        self._memory: Any = RawArray("d", size)

    def set(self, values: Sequence[float]) -> None:
        """Set all numbers."""
        self._memory[:] = values

    def get(self) -> list[float]:
        """All numbers."""
        return list(self._memory)
