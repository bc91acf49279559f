"""Reading CSV: strict, with the rows that an editor shows."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sim2real.logs.errors import LogError
from sim2real.logs.table import (
    MOST_COLUMNS,
    SHOWN,
    Array,
    Finding,
    Table,
    Wanted,
    and_more,
    labels_of,
    numbered,
)
from trpac_core.files import open_file, read_text

MISSING = frozenset({"", "nan", "+nan", "-nan", "na", "n/a", "null"})
"""Cells that say that a sample was lost, in lower case."""

MOST_BYTES = 500_000_000
"""Larger files are refused unread; in memory a file takes several times its size [bytes]."""
EXPECTED = "a CSV file saved as UTF-8"
LONGEST_LINE = 1_000_000
"""Characters of a row: 20,000 columns of 50."""
MOST_ROWS = 10_000_000
"""Rows of a file: 83 minutes at 2 kHz."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


def read_csv(path: Path, wanted: Wanted) -> Table:
    """Read the wanted columns of a CSV file; raises LogError where it has no rows to speak of."""
    try:
        with (
            open_file(path, MOST_BYTES, EXPECTED) as raw,
            io.TextIOWrapper(raw, encoding="utf-8-sig", newline="") as file,
        ):
            lines = _Lines(path, file)
            header, records, rows, findings = _records(path, lines)
    except UnicodeDecodeError:
        read_text(path, MOST_BYTES, EXPECTED)  # says in which row
        raise
    count = Counter(header)
    findings += [
        Finding(f"column {name!r} stands {n} times; expected once.")
        for name, n in count.items()
        if n > 1 and name in wanted.numbers | wanted.text
    ]
    numbers, labels = {}, {}
    for i, name in enumerate(header):
        if count[name] > 1:
            continue
        cells = [record[i].strip() for record in records] if name in wanted.numbers | wanted.text else []
        if name in wanted.text:
            told = ["" if cell.lower() in MISSING else cell for cell in cells]
            labels[name] = labels_of(told)
        elif name in wanted.numbers:
            values, bad = _numbers(cells, name in wanted.identifiers)
            findings += _bad_cells(name, cells, rows, bad)
            if not bad:
                numbers[name] = values
    if rows and lines.last[-1] not in "\r\n":
        findings.append(
            Finding(
                f"row {rows[-1]} ends the file without a line break; if the recording was cut off, look at it.",
                fatal=False,
            )
        )
    return Table(tuple(header), numbers, labels, np.array(rows, dtype=np.int64), tuple(findings))


def _records(path: Path, lines: _Lines) -> tuple[list[str], list[list[str]], list[int], list[Finding]]:
    """Header, rows that have as many cells as it, their row numbers, and what is wrong with the others."""
    reader = csv.reader(lines, strict=True)
    header: list[str] = []
    records, rows, ragged = [], [], []
    try:
        for record in reader:
            if not record:
                continue
            if not header:
                header = [name.strip() for name in record]
                if len(header) > MOST_COLUMNS:
                    raise LogError(f"{path}: has {len(header)} columns; expected at most {MOST_COLUMNS}.")
            elif len(record) == len(header):
                records.append(record)
                rows.append(reader.line_num)
            else:
                ragged.append(f"row {reader.line_num} ({len(record)})")
    except csv.Error as error:
        raise LogError(
            f"{path}: row {reader.line_num}: {error}; expected comma-separated cells without stray quotes."
        ) from error
    if not header:
        raise LogError(f"{path}: is empty; expected a row of column names and rows of numbers.")
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise LogError(
            f"{path}: row 1 is separated by semicolons or tabs; expected commas, and decimal points."
        )
    if not records and not ragged:
        raise LogError(f"{path}: has column names and no rows; expected one row per sample.")
    if ragged:
        text = f"{', '.join(ragged[:SHOWN])}{and_more(len(ragged))}: not as many cells as row 1 has names "
        return header, records, rows, [Finding(f"{text}({len(header)}); expected one cell per column.")]
    return header, records, rows, []


class _Lines:
    """A file's lines, none of them endless, and not more of them than a log has; `last` is the last one."""

    def __init__(self, path: Path, file: io.TextIOBase) -> None:
        self.last = ""
        self._path, self._file, self._row = path, file, 0

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = self._file.readline(LONGEST_LINE + 1)
        if not line:
            raise StopIteration
        self.last, self._row = line, self._row + 1
        if len(line) > LONGEST_LINE or self._row > MOST_ROWS:
            raise LogError(
                f"{self._path}: row {self._row} is longer than {LONGEST_LINE} characters, or one of more than "
                f"{MOST_ROWS}; expected one line per sample."
            )
        return line


def _numbers(cells: list[str], identifiers: bool) -> tuple[Array, list[int]]:
    """Cells as numbers, and the indices of those that are none."""
    joined = "".join(cells)
    if joined.isascii() and "_" not in joined:  # float() would also read 1_000 and digits of other scripts
        try:
            return np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64), []
        except ValueError:
            pass  # some cell needs a closer look
    kinds = [_NUMBER.fullmatch(cell) is not None for cell in cells]
    bad = [i for i, number in enumerate(kinds) if not number and cells[i].lower() not in MISSING]
    if bad and identifiers and not any(kinds):
        return numbered("" if cell.lower() in MISSING else cell for cell in cells), []
    values = [float(cell) if number else np.nan for cell, number in zip(cells, kinds, strict=True)]
    return np.array(values, dtype=np.float64), bad


def _bad_cells(name: str, cells: list[str], rows: list[int], bad: list[int]) -> list[Finding]:
    if not bad:
        return []
    shown = ", ".join(f"row {rows[i]} ({cells[i][:30]!r})" for i in bad[:SHOWN])
    hint = ""
    if "," in cells[bad[0]]:
        hint = " Is that a decimal comma? A decimal point is expected."
    elif bad[0] == 0:
        hint = f" If row {rows[0]} holds units, delete it: a mapping file says them."
    return [Finding(f"column {name}: {shown}{and_more(len(bad))} is not a number.{hint}")]
