"""What the readers of all file formats hand on: the wanted columns as numbers, and what is wrong with them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.units import plain_unit, quantities

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

MISSING = frozenset({"", "nan", "+nan", "-nan", "na", "n/a", "null"})
"""Cells that say that a sample was lost, in lower case."""
_BRACKETED = re.compile(r"(?P<name>.*\S)\s*(?P<mark>[\[(])(?P<unit>[^\[\]()]*)[\])]\s*")

MOST_OUT_OF_ORDER = 0.01
"""Share of rows or frames without a time of their own up to which a log is mended [-]."""

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
    time, time_form : str
        The column that alone holds the time, "" where it is made of several; its form, "" to find it out.
    """

    numbers: frozenset[str]
    text: frozenset[str] = frozenset()
    identifiers: frozenset[str] = frozenset()
    held: frozenset[str] = frozenset()
    base: tuple[str, ...] = ()
    time: str = ""
    time_form: str = ""


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

    def with_numbers(
        self, numbers: dict[str, Array], notes: Iterable[str], findings: Iterable[Finding] = ()
    ) -> Table:
        """The table with other numbers and notes, and with further findings."""
        return replace(self, numbers=numbers, notes=tuple(notes), findings=(*self.findings, *findings))

    def kept(self, rows: NDArray[np.bool_]) -> Table:
        """The table with some of its rows."""
        if rows.all():
            return self
        return replace(
            self,
            numbers={name: values[rows] for name, values in self.numbers.items()},
            text={name: cells[rows] for name, cells in self.text.items()},
            rows=self.rows[rows],
        )


@dataclass(frozen=True)
class Head:
    """A column of a file: the name that it goes by, and its unit as stated, "" without one."""

    name: str
    unit: str


def heads(names: Sequence[str], wanted: Wanted, units: Sequence[str] = ()) -> list[Head]:
    """The columns of a file by their names as they stand, or without their units where they are wanted so.

    Parameters
    ----------
    names : sequence of str
        As they stand in the file.
    wanted : Wanted
        What of the file is read.
    units : sequence of str
        Units that stand elsewhere than in the names, "" without one.

    Raises
    ------
    ValueError
        A wanted column states two units.
    """
    asked = wanted.numbers | wanted.text
    parts = [split_unit(name) for name in names]
    bare = Counter(part for part, _ in parts)
    made = []
    for i, (name, (part, unit)) in enumerate(zip(names, parts, strict=True)):
        key = part if name not in asked and part in asked and bare[part] == 1 and part not in names else name
        own = units[i].strip("[](){} ") if i < len(units) else ""
        if own and unit and plain_unit(own) != plain_unit(unit) and key in asked:
            raise ValueError(
                f"column {name!r} states two units, {unit!r} in its name and {own!r}; expected one."
            )
        made.append(Head(key, own or unit))
    return made


def split_unit(name: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit: of "Speed [km/h]", "n_fl (1/min)" or "a_x/m/s^2"."""
    if found := _BRACKETED.fullmatch(name):
        part, mark, unit = found["name"], found["mark"], found["unit"].strip()
        if quantities(unit) or (mark == "[" and unit and not unit.isdigit()):
            return part, unit
    part, slash, unit = name.partition("/")
    if slash and part and quantities(unit):
        return part.strip(), unit.strip()
    return name, ""


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


def read_as(notes: Sequence[str]) -> str:
    """How a file was understood, in one line."""
    return "; ".join(notes) or "plain table"


def and_more(count: int) -> str:
    """A closing bracket for a list that was cut after SHOWN entries."""
    return f" (and {count - SHOWN} more)" if count > SHOWN else ""
