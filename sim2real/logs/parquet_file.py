"""Reading Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sim2real.logs.errors import LogError
from sim2real.logs.table import Array, Finding, Table, Text, Wanted, numbered


def read_parquet(path: Path, wanted: Wanted) -> Table:
    """Read the wanted columns of a Parquet file; its rows count from 1. Raises LogError where it is damaged."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            names = tuple(file.schema_arrow.names)
            table = file.read(columns=[n for n in names if n in wanted.numbers | wanted.text])
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise LogError(
            f"{path}: cannot be read as Parquet ({error}); expected a whole Parquet file."
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
            cells = ["" if cell is None else str(cell) for cell in column.to_pylist()]
            if name in wanted.text:
                text[name] = np.array(cells, dtype=np.str_)
            else:
                numbers[name] = numbered(cells)
        elif pa.types.is_null(column.type):  # a column without any value
            numbers[name] = np.full(table.num_rows, np.nan)
        elif _is_number(column.type):
            numbers[name] = column.cast(pa.float64(), safe=False).to_numpy().astype(np.float64)
        else:
            findings.append(Finding(f"column {name} holds {column.type}; expected numbers."))
    return Table(names, numbers, text, np.arange(1, table.num_rows + 1), tuple(findings))


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))


def _is_text(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))
