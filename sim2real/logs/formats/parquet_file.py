"""Reading Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sim2real.logs.errors import LogError
from sim2real.logs.table import (
    MOST_COLUMNS,
    MOST_NUMBERS,
    Array,
    Finding,
    Table,
    Text,
    Wanted,
    heads,
    labels_of,
    numbered,
)
from sim2real.logs.times import Times, times_of_stamps, times_of_texts, whole_nanoseconds
from trpac_core.files import quoted


def read_parquet(path: Path, wanted: Wanted) -> Table:
    """Read the wanted columns of a Parquet file; its rows count from 1. Raises LogError where it is damaged."""
    try:
        # Text stays as few different words as it is in the file; numbers are what the rows make of them.
        texts = [name for name in pq.read_schema(path).names if name in wanted.text | wanted.identifiers]
        with pq.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts) as file:
            schema, rows = file.schema_arrow, file.metadata.num_rows
            columns = heads(schema.names, wanted, [_unit(field) for field in schema])
            names = tuple(column.name for column in columns)
            asked = wanted.numbers | wanted.text
            read = [n for n, c in zip(schema.names, columns, strict=True) if c.name in asked]
            if len(names) > MOST_COLUMNS or rows * len(read) > MOST_NUMBERS:
                raise LogError(
                    f"{path}: {rows} rows of {len(read)} columns that are read, of {len(names)}; expected at most "
                    f"{MOST_NUMBERS} samples and {MOST_COLUMNS} columns."
                )
            table = file.read(columns=read)
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        if isinstance(error, LogError):
            raise
        raise LogError(
            f"{path}: cannot be read as Parquet ({quoted(error)}); expected a whole Parquet file."
        ) from error
    if table.num_rows == 0:
        raise LogError(f"{path}: has no rows; expected one row per sample.")
    numbers: dict[str, Array] = {}
    text: dict[str, Text] = {}
    findings, notes = [], []
    units = {column.name: column.unit for column in columns if column.unit}
    called = dict(zip(schema.names, names, strict=True))
    for full in dict.fromkeys(table.column_names):
        name = called[full]
        if names.count(name) > 1:
            findings.append(Finding(f"column {name!r} stands {names.count(name)} times; expected once."))
            continue
        column = table.column(full)
        if name in wanted.text or (name in wanted.identifiers and _is_text(column.type)):
            cells = _cells(column)
            if name in wanted.text:
                text[name] = labels_of(cells)
            else:
                numbers[name] = numbered(cells)
        elif pa.types.is_null(column.type):  # a column without any value
            numbers[name] = np.full(table.num_rows, np.nan)
        elif (times := _times(column, name, wanted)) is not None:
            numbers[name], units[name] = times.time_s, "s"
            notes.append(times.note)
        elif _is_number(column.type):
            numbers[name] = column.cast(pa.float64(), safe=False).to_numpy().astype(np.float64)
        else:
            findings.append(Finding(f"column {name} holds {column.type}; expected numbers."))
    rows_from_1 = np.arange(1, table.num_rows + 1)
    return Table(names, numbers, text, rows_from_1, tuple(findings), units, tuple(notes))


def _unit(field: pa.Field) -> str:
    """The unit in a column's metadata; "" without one."""
    said = field.metadata or {}
    return next(
        (said[key].decode("utf-8", "replace") for key in (b"unit", b"units", b"Unit") if key in said), ""
    )


def _times(column: pa.ChunkedArray, name: str, wanted: Wanted) -> Times | None:
    """Seconds of a column of timestamps, durations, clock times, or of text where it is the time; None of others."""
    kind = column.type
    if pa.types.is_time(kind):
        unit = "ms" if kind.unit == "s" else kind.unit
        whole = column.cast(pa.time32("ms") if kind.unit == "s" else kind)
        column = whole.cast(pa.int32() if pa.types.is_time32(whole.type) else pa.int64()).cast(pa.int64())
        return times_of_stamps(column.cast(pa.duration(unit)).to_numpy())
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        return times_of_stamps(column.to_numpy())
    if name == wanted.time and pa.types.is_int64(kind) and column.null_count == 0:
        return whole_nanoseconds(column.to_numpy())
    if name == wanted.time and _is_text(kind):
        return times_of_texts(_cells(column), wanted.time_form)
    return None


def _cells(column: pa.ChunkedArray) -> list[str]:
    """Text of each row, "" where there is none; what stands in several rows is in memory once."""
    cells: list[str] = []
    for chunk in column.chunks:
        words = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
        told = ["" if word is None else str(word) for word in words.to_pylist()]
        if words is not chunk:
            told = ["" if i is None else told[i] for i in chunk.indices.to_pylist()]
        cells += told
    return cells


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))


def _is_text(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))
