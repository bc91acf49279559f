"""How a text table is written: encoding, separator, decimal mark, and which rows hold names and units."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from sim2real.logs.errors import LogError
from sim2real.logs.mapping import BLANKS, Format
from sim2real.logs.table import MOST_COLUMNS, split_unit
from sim2real.logs.times import is_time
from sim2real.logs.units import quantities
from trpac_core.files import open_file, quoted

MOST_BYTES = 4_000_000_000
"""Larger files are refused unread; what is read of them is in memory as numbers [bytes]."""
EXPECTED = "a text table (CSV)"
MOST_PREAMBLE, HEAD_ROWS = 300, 100
"""Rows above the names, and rows from there on, by which a file is understood."""
LONGEST_LINE = 1_000_000
"""Characters of a row: 20,000 columns of 50."""
UTF_8, MOSTLY = "utf-8", 0.9
"""The plain encoding; share of zeros among every other byte of a text in UTF-16."""
UNITS_SHARE = 0.3
"""Share of known units from which on a row below the names holds units: those of other columns may be unknown."""

SEPARATORS = (",", ";", "\t", "|", BLANKS)
NAMES_OF = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
_NUMBER = {
    mark: re.compile(
        rf"[+-]?(\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?",
        re.ASCII | re.IGNORECASE,
    )
    for mark in ".,"
}
"""A number with this decimal mark."""
_UTF_8 = re.compile(b"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")
"""A character of several bytes in UTF-8, which text in cp1252 has none of but by chance."""
_NOT_CP1252 = re.compile(b"[\x81\x8d\x8f\x90\x9d\x00]")
"""Bytes that no text in cp1252 has."""
_GROUPED = re.compile(r"[+-]?\d{1,3}(,\d{3})+", re.ASCII)
"""A number whose commas may stand between thousands."""


@dataclass(frozen=True)
class Dialect:
    """How a text table is written.

    Attributes
    ----------
    encoding, separator, decimal : str
        As in a mapping file's `format`.
    header_row, first_row : int
        Row of the names and first row of values, as an editor counts.
    names, units : tuple of str
        Names of the columns as they stand, and the units in a row of their own; "" without one.
    notes : tuple of str
        What of this was found out and is not the plain form (UTF-8, commas, decimal points, names in row 1).
    """

    encoding: str
    separator: str
    decimal: str
    header_row: int
    first_row: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    notes: tuple[str, ...]


def find_dialect(path: Path, stated: Format, wanted: Collection[str]) -> Dialect:
    """How a file is written, by its head, by what is stated, and by the names that are wanted of it.

    Raises LogError where it is no table, or where its head leaves doubt; the message says what to state.
    """
    encoding = stated.encoding or _encoding(path)
    lines = _head(path, encoding)
    if not any(line.strip() for line in lines):
        raise LogError(f"{quoted(path)}: is empty; expected a row of column names and rows of numbers.")
    separator, decimal = _marks(path, lines, stated)
    rows = [cells_of(line, separator) for line in lines]
    header, unit, first = _rows(path, rows, decimal, stated, wanted)
    names = rows[header - 1]
    if len(names) > MOST_COLUMNS:
        raise LogError(f"{quoted(path)}: has {len(names)} columns; expected at most {MOST_COLUMNS}.")
    if first <= len(rows) and len(rows[first - 1]) == len(names) + 1 and not rows[first - 1][-1]:
        names = [*names, ""]  # every row but the header's ends with a separator
    units = (rows[unit - 1] if unit else []) + [""] * len(names)
    said = {
        encoding.upper(): encoding != UTF_8,
        NAMES_OF.get(separator, f"separated by {separator!r}"): separator != ",",
        "decimal comma": decimal == ",",
        f"names in row {header}": header != 1,
        f"units in row {unit}": unit > 0,
    }
    notes = tuple(what for what, so in said.items() if so)
    return Dialect(
        encoding, separator, decimal, header, first, tuple(names), tuple(units[: len(names)]), notes
    )


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with this decimal mark."""
    return _NUMBER[decimal].fullmatch(cell) is not None


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of one line without blanks around them; the line as one cell where its quotes do not match."""
    if separator == BLANKS:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, strict=True), [])]
    except csv.Error:
        return [line]


def open_text(path: Path, encoding: str) -> io.TextIOWrapper:
    """A file as text, its line ends as they are; what is no text in this encoding is replaced."""
    raw = open_file(path, MOST_BYTES, EXPECTED)
    return io.TextIOWrapper(raw, "utf-8-sig" if encoding == UTF_8 else encoding, "replace", newline="")


def _head(path: Path, encoding: str) -> list[str]:
    lines: list[str] = []
    with open_text(path, encoding) as file:
        while len(lines) < MOST_PREAMBLE + HEAD_ROWS and (line := file.readline(LONGEST_LINE + 1)):
            if len(line) > LONGEST_LINE:
                raise LogError(
                    f"{quoted(path)}: row {len(lines) + 1} is longer than {LONGEST_LINE} characters; expected one line "
                    "per sample."
                )
            lines.append(line.rstrip("\r\n"))
    return lines


def _encoding(path: Path) -> str:
    """The encoding that all of a file's bytes allow: UTF-16 by its mark or its zeros, else UTF-8, else cp1252."""
    with open_file(path, MOST_BYTES, EXPECTED) as file:
        start = file.read(4096)
        if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return "utf-16"
        for name, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[0::2])):
            if len(zeros) > 1 and zeros.count(0) > MOSTLY * len(zeros):
                return name
        file.seek(0)
        row, wrong, whole = 0, 0, False
        while line := file.readline(LONGEST_LINE + 1):
            row += 1
            if line.isascii():
                continue
            rest, found = _UTF_8.subn(b"", line.removeprefix(codecs.BOM_UTF8))
            whole = whole or found > 0
            wrong = wrong or (0 if rest.isascii() else row)
            if wrong and (whole or _NOT_CP1252.search(line)):
                raise LogError(
                    f"{quoted(path)}: row {wrong} is not UTF-8 text; expected {EXPECTED}. Where it has another "
                    "encoding, a mapping file says so: `format: {encoding: cp1252}`."
                )
    return "cp1252" if wrong else UTF_8


def _marks(path: Path, lines: list[str], stated: Format) -> tuple[str, str]:
    """Separator and decimal mark with which the most cells of the most rows are numbers."""
    separators = (stated.separator,) if stated.separator else SEPARATORS
    best, chosen, numbers = (0, 0), (separators[0], stated.decimal or "."), [""]
    for separator in separators:
        rows = [cells_of(line, separator) for line in lines]
        for decimal in (stated.decimal,) if stated.decimal else (".", ","):
            found = [[cell for cell in row if is_number(cell, decimal)] for row in rows]
            lengths = Counter(len(row) for row, some in zip(rows, found, strict=True) if some)
            if not lengths:
                continue
            (length, _), *_ = lengths.most_common(1)
            table = [
                (row, some) for row, some in zip(rows, found, strict=True) if some and len(row) == length
            ]
            many = sum(len(some) for _, some in table)
            score = (many, many - sum(sum(map(bool, row)) for row, _ in table))
            if score > best:
                best, chosen, numbers = (
                    score,
                    (separator, decimal),
                    [cell for _, some in table for cell in some],
                )
    if chosen[1] == "," and stated.decimal is None:
        commas = [cell for cell in numbers if "," in cell]
        if all(_GROUPED.fullmatch(cell) for cell in commas):
            raise LogError(
                f"{quoted(path)}: {quoted(commas[0])} may be a decimal comma or one between thousands; a mapping file "
                'says which: `format: {decimal: ","}`. Numbers with marks between thousands are not read.'
            )
    return chosen


def _rows(
    path: Path, rows: list[list[str]], decimal: str, stated: Format, wanted: Collection[str]
) -> tuple[int, int, int]:
    """Rows of the names, of the units (0 for none), and of the first values, as an editor counts."""
    counts = [sum(is_number(cell, decimal) or is_time(cell) for cell in row) for row in rows]
    filled = [i for i, count in enumerate(counts) if count]
    width = Counter(len(rows[i]) for i in filled).most_common(1)[0][0] if filled else 0
    usual = sorted(counts[i] for i in filled if len(rows[i]) == width)
    least = max(1, usual[len(usual) // 2] // 2) if usual else 1
    above = max(stated.header_row or 0, stated.unit_row or 0)
    full = (i for i in filled if i >= above and len(rows[i]) == width and counts[i] >= least)
    first = next(full, len(rows))
    if above > len(rows):
        raise LogError(
            f"{quoted(path)}: has {len(rows)} rows in its head; the mapping's format has row {above}."
        )
    if stated.header_row is not None:
        headers = [stated.header_row - 1]
    else:
        headers = [i for i in range(first) if rows[i] and (not width or len(rows[i]) in (width, width - 1))]
    if not headers:
        raise LogError(
            f"{quoted(path)}: row {first + 1} holds numbers in {width} columns, and no row above it as many names; "
            "expected a row of column names. A mapping file says which it is: `format: {header_row: 1}`."
        )
    between = [i for i in headers if _are_units(rows[i], decimal)] if len(headers) > 1 else []
    known = {
        i: sum(key in wanted for name in rows[i] for key in (name, split_unit(name)[0])) for i in headers
    }
    named = [i for i in headers if i not in between] or headers[:1]
    header = max(named, key=lambda i: (known[i], i))
    below = [i for i in range(header + 1, len(rows)) if rows[i]]
    if stated.unit_row is not None:
        unit, described = stated.unit_row, []
    else:
        unit = next((i + 1 for i in below if i < first and _are_units(rows[i], decimal)), 0)
        described = [i for i in below if i < first and not counts[i] and len(rows[i]) == width]
    values = next((i for i in below if i >= max(header + 1, unit) and i not in described), len(rows))
    return header + 1, unit, values + 1


def _are_units(cells: list[str], decimal: str) -> bool:
    filled = [cell for cell in cells if cell and not is_number(cell, decimal)]
    known = sum(bool(quantities(cell)) for cell in filled)
    return bool(filled) and known >= UNITS_SHARE * len(filled)
