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
    labels_of,
    numbered,
)
from trpac_core.files import quoted


def read_parquet(path: Path, wanted: Wanted) -> Table:
    """Read the wanted columns of a Parquet file; its rows count from 1. Raises LogError where it is damaged."""
    try:
        # Text stays as few different words as it is in the file; numbers are what the rows make of them.
        texts = [name for name in pq.read_schema(path).names if name in wanted.text | wanted.identifiers]
        with pq.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts) as file:
            names, rows = tuple(file.schema_arrow.names), file.metadata.num_rows
            read = [name for name in names if name in wanted.numbers | wanted.text]
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
    findings = []
    for name in dict.fromkeys(table.column_names):
        if names.count(name) > 1:
            findings.append(Finding(f"column {name!r} stands {names.count(name)} times; expected once."))
            continue
        column = table.column(name)
        if name in wanted.text or (name in wanted.identifiers and _is_text(column.type)):
            cells = _cells(column)
            if name in wanted.text:
                text[name] = labels_of(cells)
            else:
                numbers[name] = numbered(cells)
        elif pa.types.is_null(column.type):  # a column without any value
            numbers[name] = np.full(table.num_rows, np.nan)
        elif _is_number(column.type):
            numbers[name] = column.cast(pa.float64(), safe=False).to_numpy().astype(np.float64)
        else:
            findings.append(Finding(f"column {name} holds {column.type}; expected numbers."))
    return Table(names, numbers, text, np.arange(1, table.num_rows + 1), tuple(findings))


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
