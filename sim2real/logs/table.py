"""What the readers of all file formats hand on: the wanted columns as numbers, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Text = NDArray[np.str_]

MOST_NUMBERS = 60_000_000
"""Samples that are read of a file, all its columns together: 16 signals for an hour at 1 kHz, 480 MB."""
MOST_COLUMNS = 20_000
"""Columns of a table that is not MDF."""
LONGEST_TEXT = 1_000
"""Characters of one sample of text: a picture's path."""
MOST_TEXT = 120_000_000
"""Characters of a column of text, each sample as long as the longest: 480 MB."""

SHOWN = 3
"""Cells or rows of one kind that an error lists; the rest is counted."""


@dataclass(frozen=True)
class Finding:
    """Something about a log worth a sentence; a fatal one makes it unusable."""

    text: str
    fatal: bool = True


@dataclass(frozen=True)
class Wanted:
    """Which columns of a file to read.

    Attributes
    ----------
    numbers, text : frozenset of str
        Columns that hold numbers, and those that hold text.
    identifiers : frozenset of str
        Those of `numbers` that may hold text throughout; it is then numbered in order of appearance.
    held : frozenset of str
        Columns whose value holds until the next one.
    base : tuple of str
        Columns whose time base is the log's, the first that is there counts; only files with several rasters need it.
    """

    numbers: frozenset[str]
    text: frozenset[str] = frozenset()
    identifiers: frozenset[str] = frozenset()
    held: frozenset[str] = frozenset()
    base: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """The wanted columns of a file.

    Attributes
    ----------
    names : tuple of str
        All columns of the file.
    numbers, text : dict
        The wanted columns that could be read, shape (n,); NaN and "" are lost samples.
    rows : array, shape (n,)
        Number of each row as an editor shows it.
    findings : tuple of Finding
        What the reader met.
    units : dict
        Units as the file states them, by column.
    notes : tuple of str
        How the file was understood, each in a few words: "decimal comma".
    """

    names: tuple[str, ...]
    numbers: dict[str, Array]
    text: dict[str, Text]
    rows: NDArray[np.int64]
    findings: tuple[Finding, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def numbered(labels: Iterable[str]) -> Array:
    """Labels as numbers in order of appearance; NaN where there is none."""
    codes: dict[str, int] = {}
    return np.array(
        [codes.setdefault(label, len(codes)) if label else np.nan for label in labels], dtype=np.float64
    )


def labels_of(cells: Sequence[str]) -> Text:
    """Text samples as an array, shape (n,); raises ValueError where one is too long for a picture's path."""
    longest = max(map(len, cells), default=0)
    if longest > LONGEST_TEXT or longest * len(cells) > MOST_TEXT:
        raise ValueError(
            f"holds text of {longest} characters in {len(cells)} rows; expected names of pictures."
        )
    return np.array(cells, dtype=np.str_)


def and_more(count: int) -> str:
    """A closing bracket for a list that was cut after SHOWN entries."""
    return f" (and {count - SHOWN} more)" if count > SHOWN else ""
