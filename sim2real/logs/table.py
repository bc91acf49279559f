"""What the readers of all file formats hand on: the wanted columns as numbers, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Text = NDArray[np.str_]

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
    """

    names: tuple[str, ...]
    numbers: dict[str, Array]
    text: dict[str, Text]
    rows: NDArray[np.int64]
    findings: tuple[Finding, ...] = field(default=())


def numbered(labels: Iterable[str]) -> Array:
    """Labels as numbers in order of appearance; NaN where there is none."""
    codes: dict[str, int] = {}
    return np.array(
        [codes.setdefault(label, len(codes)) if label else np.nan for label in labels], dtype=np.float64
    )


def and_more(count: int) -> str:
    """A closing bracket for a list that was cut after SHOWN entries."""
    return f" (and {count - SHOWN} more)" if count > SHOWN else ""
