"""Reading a table that is in memory already."""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd

from sim2real.logs.table import Finding, Table, Wanted, heads, labels_of, numbered
from sim2real.logs.times import Times, times_of_stamps, times_of_texts


def frame_table(frame: pd.DataFrame, wanted: Wanted) -> Table:
    """The wanted columns of a DataFrame; its rows count from 0. An index of times is the time where no column is."""
    if isinstance(frame.index, pd.DatetimeIndex | pd.TimedeltaIndex) and wanted.time not in frame:
        frame = frame.reset_index(names=wanted.time)
    columns = heads([str(name) for name in frame.columns], wanted)
    names = tuple(column.name for column in columns)
    units = {column.name: column.unit for column in columns if column.unit}
    numbers, text, findings, notes = {}, {}, [], []
    for i, name in enumerate(names):
        if name not in wanted.numbers | wanted.text:
            continue
        if names.count(name) > 1:
            findings.append(Finding(f"column {name!r} stands {names.count(name)} times; expected once."))
            continue
        column = frame.iloc[:, i]
        times = _times(column, name, wanted)
        if times is not None:
            numbers[name], units[name] = times.time_s, "s"
            notes.append(times.note)
        elif name in wanted.text:
            text[name] = labels_of(_cells(column))
        elif pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
            numbers[name] = column.to_numpy(dtype=np.float64, na_value=np.nan)
        elif name in wanted.identifiers:
            numbers[name] = numbered(_cells(column))
        else:
            findings.append(Finding(f"column {name} holds {column.dtype}; expected numbers."))
    return Table(names, numbers, text, np.arange(len(frame)), tuple(findings), units, tuple(notes))


def _times(column: pd.Series, name: str, wanted: Wanted) -> Times | None:
    if column.dtype.kind in "mM":
        stamps = column.dt.tz_convert(None) if isinstance(column.dtype, pd.DatetimeTZDtype) else column
        return times_of_stamps(stamps.to_numpy())
    is_text = name == wanted.time and not pd.api.types.is_numeric_dtype(column)
    return times_of_texts(_cells(column), wanted.time_form) if is_text else None


def _cells(column: pd.Series) -> list[str]:
    return ["" if pd.isna(cell) else str(cell) for cell in column]


def frame_sha256(frame: pd.DataFrame) -> str:
    """SHA-256 of a DataFrame's names and values, as hexadecimal text."""
    total = hashlib.sha256(repr(tuple(frame.columns)).encode("utf-8", "surrogatepass"))
    total.update(pd.util.hash_pandas_object(frame, index=False).to_numpy().tobytes())
    return total.hexdigest()
