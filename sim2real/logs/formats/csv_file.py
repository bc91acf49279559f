"""Reading text tables: strict, in the dialect in which they are written, with the rows that an editor shows."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow

from sim2real.logs.errors import LogError
from sim2real.logs.formats.dialect import (
    EXPECTED,
    LONGEST_LINE,
    MOST_BYTES,
    UTF_8,
    Dialect,
    find_dialect,
    is_number,
    open_text,
)
from sim2real.logs.mapping import BLANKS, Format
from sim2real.logs.table import (
    MISSING,
    MOST_NUMBERS,
    SHOWN,
    Array,
    Finding,
    Table,
    Wanted,
    and_more,
    heads,
    labels_of,
    numbered,
)
from sim2real.logs.times import Times, times_of_texts, whole_nanoseconds
from trpac_core.files import open_file, quoted

BLOCK_BYTES = 4 * LONGEST_LINE
"""What is read at once; a row may be as long [bytes]."""
LARGEST_WHOLE = 2.0**53
"""Greatest number up to which a float64 holds every whole one."""
MOST_BAD = 1000
"""Cells of a column that are no numbers which are kept for messages, in each block."""
Progress = Callable[[int], None]
"""Called with the bytes read so far."""


def read_csv(path: Path, wanted: Wanted, stated: Format, progress: Progress) -> Table:
    """Read the wanted columns of a text table; raises LogError where it has no rows to speak of."""
    asked = wanted.numbers | wanted.text
    dialect = find_dialect(path, stated, asked)
    columns = heads(dialect.names, wanted, dialect.units)
    count = Counter(column.name for column in columns)
    findings = [
        Finding(f"column {name!r} stands {n} times; expected once.")
        for name, n in count.items()
        if n > 1 and name in asked
    ]
    read = {i: c.name for i, c in enumerate(columns) if c.name in asked and count[c.name] == 1}
    as_text = {i for i, name in read.items() if name in wanted.text | wanted.identifiers | {wanted.time}}
    found = _read_blocks(path, dialect, read, as_text, progress)
    if not found.rows and not found.ragged:
        raise LogError(f"{quoted(path)}: has column names and no rows; expected one row per sample.")
    rows, said = _row_numbers(path, dialect, found)
    findings += said
    units = {column.name: column.unit for column in columns if column.unit}
    numbers: dict[str, Array] = {}
    text, notes = {}, list(dialect.notes)
    for i, name in read.items():
        cells = found.texts.pop(i, None)
        if cells is None:
            values, bad = _joined(found.numbers.pop(i))
        elif name in wanted.text:
            text[name] = labels_of(_told(cells))
            continue
        else:
            values, bad = _as_numbers(cells, dialect.decimal)
            if name == wanted.time and (exact := _nanoseconds(cells, values)) is not None:
                values, units[name] = exact.time_s, "s"
                notes.append(exact.note)
            elif name == wanted.time and (bad or wanted.time_form):
                if len(bad) > 0.5 * len(cells) or "%" in wanted.time_form:
                    times = times_of_texts(_told(cells), wanted.time_form)
                    lost = np.flatnonzero(np.isnan(times.time_s))
                    texts = [(int(k), str(cells[int(k)])) for k in lost]
                    values, bad = times.time_s, [one for one in texts if one[1].lower() not in MISSING]
                    units[name] = "s"
                    notes.append(times.note)
            elif bad and name in wanted.identifiers:
                told = _told(cells)
                if len(bad) == sum(map(bool, told)):
                    values, bad = numbered(told), []
        if bad:
            findings.append(_bad_cells(name, bad, rows, name == wanted.time))
        else:
            numbers[name] = values
    if not found.ends and len(rows):
        findings.append(
            Finding(
                f"row {rows[-1]} ends the file without a line break; if the recording was cut off, look at it.",
                fatal=False,
            )
        )
    names = tuple(column.name for column in columns)
    return Table(names, numbers, text, rows, tuple(findings), units, tuple(notes))


class _Source:
    """A file for Arrow to read: it counts bytes and line ends, and puts one tab where there are blanks between."""

    closed = False

    def __init__(self, path: Path, dialect: Dialect, progress: Progress) -> None:
        self.read_bytes = self.line_ends = 0
        self.ends = True
        self._progress = progress
        self._lines = open_text(path, dialect.encoding) if dialect.separator == BLANKS else None
        self._raw = open_file(path, MOST_BYTES, EXPECTED) if self._lines is None else None

    def read(self, size: int = -1) -> bytes:
        """The next bytes, at most `size` of them where the file is not separated by blanks."""
        if self._lines is not None:
            chunk = "".join("\t".join(line.split()) + "\n" for line in self._lines.readlines(size)).encode()
        else:
            chunk = self._raw.read(size)  # type: ignore[union-attr]
        if chunk:
            self.read_bytes += len(chunk)
            self.line_ends += chunk.count(b"\n")
            self.ends = chunk.rstrip(b"\0")[-1:] in (b"\n", b"\r")
            self._progress(self.read_bytes)
        return chunk

    def close(self) -> None:
        """Close the file."""
        for file in (self._lines, self._raw):
            if file is not None:
                file.close()
        self.closed = True


class _Found:
    """What the blocks of a file hold: rows, numbers and texts by column, rows of another length, its line ends."""

    def __init__(self) -> None:
        self.rows = self.ragged = self.line_ends = 0
        self.ends = True
        self.numbers: dict[int, list[tuple[Array, list[tuple[int, str]]]]] = {}
        self.texts: dict[int, pa.ChunkedArray] = {}


def _read_blocks(
    path: Path, dialect: Dialect, read: dict[int, str], as_text: set[int], progress: Progress
) -> _Found:
    found = _Found()
    texts: dict[int, list[pa.Array]] = {i: [] for i in as_text}
    found.numbers = {i: [] for i in read if i not in as_text}

    def skip(_: Any) -> str:
        found.ragged += 1
        return "skip"

    source = _Source(path, dialect, progress)
    blanks = dialect.separator == BLANKS
    try:
        reader = arrow.open_csv(
            pa.PythonFile(source, mode="r"),
            read_options=arrow.ReadOptions(
                use_threads=False,
                block_size=BLOCK_BYTES,
                skip_rows=dialect.first_row - 1,
                column_names=[str(i) for i in range(len(dialect.names))],
                encoding=UTF_8 if blanks else dialect.encoding,
            ),
            parse_options=arrow.ParseOptions(
                delimiter="\t" if blanks else dialect.separator,
                quote_char=False if blanks else '"',
                newlines_in_values=not blanks,
                invalid_row_handler=skip,
            ),
            convert_options=arrow.ConvertOptions(
                include_columns=[str(i) for i in read],
                column_types={str(i): pa.string() for i in read},
                strings_can_be_null=False,
            ),
        )
        for block in reader:
            for i in read:
                cells = pc.utf8_trim_whitespace(block.column(str(i)))
                if i in as_text:
                    texts[i].append(cells)
                else:
                    values, bad = _as_numbers(cells, dialect.decimal)
                    found.numbers[i].append((values, [(found.rows + k, cell) for k, cell in bad[:MOST_BAD]]))
            found.rows += block.num_rows
            if found.rows * max(len(read), 1) > MOST_NUMBERS:
                raise LogError(
                    f"{quoted(path)}: more than {found.rows} rows of {len(read)} columns that are read; expected "
                    f"at most {MOST_NUMBERS} samples."
                )
    except pa.ArrowInvalid as error:
        if "straddl" in str(error):
            raise LogError(
                f"{quoted(path)}: has a row longer than {BLOCK_BYTES} characters, or a quote without its end; "
                "expected one line per sample."
            ) from error
        if not any(said in str(error) for said in ("Empty CSV file", "Could not skip")):
            raise LogError(f"{quoted(path)}: cannot be read as a table ({quoted(error)}).") from error
    except UnicodeDecodeError as error:
        raise LogError(
            f"{quoted(path)}: is no text in {dialect.encoding} ({error.reason}); expected {EXPECTED}."
        ) from error
    finally:
        source.close()
    found.texts = {i: pa.chunked_array(chunks, pa.string()) for i, chunks in texts.items()}
    found.line_ends, found.ends = source.line_ends, source.ends
    return found


def _as_numbers(cells: pa.Array, decimal: str) -> tuple[Array, list[tuple[int, str]]]:
    """Cells as numbers, NaN for lost ones, and the places of those that are neither, with their text."""
    plain = pc.if_else(pc.equal(cells, ""), None, cells)
    if decimal == ",":
        points = pc.any(pc.match_substring(cells, ".")).as_py()
        plain = plain if points else pc.replace_substring(plain, ",", ".")
    try:
        if decimal == "." or not points:
            return pc.cast(plain, pa.float64()).to_numpy(zero_copy_only=False), []
    except pa.ArrowInvalid:
        pass  # some cell needs a closer look
    values, bad = np.full(len(cells), np.nan), []
    for k, cell in enumerate(cells.to_pylist()):
        if is_number(cell, decimal):
            values[k] = float(cell.replace(",", "."))
        elif cell.lower() not in MISSING:
            bad.append((k, cell))
    return values, bad


def _nanoseconds(cells: pa.ChunkedArray, values: Array) -> Times | None:
    if len(values) == 0 or not np.nanmax(values, initial=0.0) > LARGEST_WHOLE:
        return None
    try:
        return whole_nanoseconds(pc.cast(cells, pa.int64()).to_numpy())
    except pa.ArrowInvalid:
        return None


def _joined(blocks: Sequence[tuple[Array, list[tuple[int, str]]]]) -> tuple[Array, list[tuple[int, str]]]:
    if not blocks:
        return np.zeros(0), []
    return np.concatenate([values for values, _ in blocks]), [one for _, bad in blocks for one in bad]


def _told(cells: pa.ChunkedArray) -> list[str]:
    return ["" if cell.lower() in MISSING else cell for cell in cells.to_pylist()]


def _row_numbers(path: Path, dialect: Dialect, found: _Found) -> tuple[NDArray[np.int64], list[Finding]]:
    """The row of each record as an editor shows it, and what is wrong with rows that have too many or too few cells."""
    last = found.line_ends + (not found.ends)
    if not found.ragged and last - dialect.first_row + 1 == found.rows:
        return np.arange(dialect.first_row, last + 1), []
    width, rows, ragged = len(dialect.names), [], []
    with open_text(path, dialect.encoding) as file:
        blanks = dialect.separator == BLANKS
        lines = ("\t".join(line.split()) + "\n" for line in file) if blanks else file
        reader = csv.reader(lines, delimiter="\t" if blanks else dialect.separator, strict=not blanks)
        try:
            for record in reader:
                if not record or reader.line_num < dialect.first_row:
                    continue
                if len(record) == width:
                    rows.append(reader.line_num)
                else:
                    ragged.append((reader.line_num, len(record)))
        except csv.Error as error:
            raise LogError(
                f"{quoted(path)}: row {reader.line_num}: {error}; expected cells without stray quotes, separated as in "
                "the rows above."
            ) from error
    if len(rows) != found.rows:
        raise LogError(
            f"{quoted(path)}: its rows cannot be separated; expected one line per sample without stray quotes."
        )
    findings = []
    if rows and ragged and not found.ends and ragged[-1][0] > rows[-1] and ragged[-1][1] < width:
        findings.append(Finding(f"row {ragged.pop()[0]}, the last, is cut off; it is left out.", fatal=False))
    if ragged:
        shown = ", ".join(f"row {row} ({cells})" for row, cells in ragged[:SHOWN])
        findings.append(
            Finding(
                f"{shown}{and_more(len(ragged))}: not as many cells as row {dialect.header_row} has names ({width}); "
                "expected one cell per column."
            )
        )
    return np.array(rows, dtype=np.int64), findings


def _bad_cells(name: str, bad: list[tuple[int, str]], rows: NDArray[np.int64], is_time: bool) -> Finding:
    shown = ", ".join(f"row {rows[k]} ({cell[:30]!r})" for k, cell in bad[:SHOWN])
    hint = ""
    if is_time:
        hint = (
            f" Where it is a date or a clock, a mapping file says its form: `time: {{column: {name!r}, form: "
            "'%d.%m.%Y %H:%M:%S.%f'}`."
        )
    elif "," in bad[0][1]:
        hint = (
            ' Is that a decimal comma, or one between thousands? A mapping file can say `format: {decimal: ","}`; '
            "marks between thousands are not read."
        )
    return Finding(f"column {name}: {shown}{and_more(len(bad))} is not a number.{hint}")
