"""Quantiles of timing and ages of a run, for the terminal and summary.json."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trpac_hil.quantile_sketch import QuantileSketch
from trpac_hil.records import Column

TIMING_COLUMNS = {
    "jitter_us": "lateness_us",
    "cycle_us": "work_us",
    "cycle_cpu_us": "cpu_us",
    "unit_step_us": "unit_us",
}
"""Keys of summary.json, and the log column of each; ages have that of their column."""


def sketched_columns(columns: Sequence[Column]) -> dict[str, str]:
    """Keys of the quantiles and the log column of each: the times of a cycle, and all ages."""
    return TIMING_COLUMNS | {c.name: c.name for c in columns if c.name.startswith("age_")}


class Figures:
    """Quantiles of timing and ages over all rows, and the newest row."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self._at = {column.name: index for index, column in enumerate(columns)}
        self._sketched = sketched_columns(columns)
        self.sketches = {name: QuantileSketch() for name in self._sketched}
        self.newest: NDArray[np.float64] | None = None
        self.rows, self.worst_missed_us = 0, 0.0

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add rows, shape (n, columns)."""
        if not len(rows):
            return
        for name, column in self._sketched.items():
            self.sketches[name].add(rows[:, self._at[column]])
        self.worst_missed_us = max(self.worst_missed_us, float(rows[:, self._at["missed_us"]].max()))
        self.newest, self.rows = rows[-1].copy(), self.rows + len(rows)

    def now(self, column: str) -> float:
        """Newest value of a column, NaN before the first row or where there is no such column."""
        if self.newest is None or column not in self._at:
            return float("nan")
        return float(self.newest[self._at[column]])

    def summary(self) -> dict[str, dict[str, float] | None]:
        """Median, p99 and maximum of each."""
        return {name: sketch.summary() for name, sketch in self.sketches.items()}
