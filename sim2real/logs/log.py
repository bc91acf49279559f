"""A recorded drive in the units and names of the log format."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sim2real.logs.contract import COLUMNS, IMAGE_PATH, TIME
from sim2real.logs.errors import LogError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """A log as `read_log` gives it; all arrays have one entry per row.

    Attributes
    ----------
    path, name : Path, str
        Its file, and the file's name.
    time_s : array, shape (n,)
        Ascending, as in the file [s].
    signals : dict
        The columns of the log format that are there, in their SI units, without time_s and image_path. NaN is a lost
        sample; a column that is not there was not measured.
    image_path : array of str, shape (n,), or None
        Picture of each row relative to `image_folder`, "" for none; None where not recorded.
    rate_hz : float
        From the median step [Hz].
    gaps : tuple of (float, float)
        Pieces of time without rows, longer than 0.25 s [s].
    derived : frozenset of str
        Signals that the mapping computed rather than measured.
    ignored : tuple of str
        Columns of the file that nothing was made of.
    warnings : tuple of str
        What is odd about it, in sentences.
    sha256 : str
        Of the file.
    notes : tuple of str
        How the file was understood, each in a few words.
    """

    path: Path
    name: str
    time_s: Array
    signals: dict[str, Array]
    image_path: NDArray[np.str_] | None
    rate_hz: float
    gaps: tuple[tuple[float, float], ...]
    derived: frozenset[str]
    ignored: tuple[str, ...]
    warnings: tuple[str, ...]
    sha256: str
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def image_folder(self) -> Path:
        """The folder that `image_path` is relative to."""
        return self.path.parent

    def warned(self, text: str) -> Log:
        """The log with one more warning."""
        return replace(self, warnings=(*self.warnings, text))

    def window(self, from_s: float, to_s: float) -> Log:
        """The rows from one time up to, not including, another [s]; raises LogError where there are fewer than two."""
        inside = (self.time_s >= from_s) & (self.time_s < to_s)
        if np.count_nonzero(inside) < 2:
            raise LogError(
                f"{self.path}: has fewer than two rows from {from_s:g} to {to_s:g} s; expected a window within "
                f"{self.time_s[0]:g} to {self.time_s[-1]:g} s."
            )
        return replace(
            self,
            time_s=self.time_s[inside],
            signals={name: values[inside] for name, values in self.signals.items()},
            image_path=None if self.image_path is None else self.image_path[inside],
            gaps=tuple(
                (start, end)
                for start, end in self.gaps
                if start >= self.time_s[inside][0] and end <= self.time_s[inside][-1]
            ),
        )

    def to_frame(self) -> pd.DataFrame:
        """The log as a table with the log format's columns in its order."""
        every = {TIME: self.time_s, **self.signals}
        if self.image_path is not None:
            every[IMAGE_PATH] = self.image_path.astype(object)
        return pd.DataFrame({name: every[name] for name in COLUMNS if name in every})
