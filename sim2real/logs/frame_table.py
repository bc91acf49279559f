"""Reading a table that is in memory already."""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd

from sim2real.logs.table import Finding, Table, Wanted, labels_of, numbered


def frame_table(frame: pd.DataFrame, wanted: Wanted) -> Table:
    """The wanted columns of a DataFrame; its rows count from 0."""
    names = tuple(map(str, frame.columns))
    numbers, text, findings = {}, {}, []
    for i, name in enumerate(names):
        if name not in wanted.numbers | wanted.text:
            continue
        if names.count(name) > 1:
            findings.append(Finding(f"column {name!r} stands {names.count(name)} times; expected once."))
            continue
        column = frame.iloc[:, i]
        numeric = pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)
        if name in wanted.text:
            text[name] = labels_of(["" if pd.isna(cell) else str(cell) for cell in column])
        elif numeric:
            numbers[name] = column.to_numpy(dtype=np.float64, na_value=np.nan)
        elif name in wanted.identifiers:
            numbers[name] = numbered("" if pd.isna(cell) else str(cell) for cell in column)
        else:
            findings.append(Finding(f"column {name} holds {column.dtype}; expected numbers."))
    return Table(names, numbers, text, np.arange(len(frame)), tuple(findings))


def frame_sha256(frame: pd.DataFrame) -> str:
    """SHA-256 of a DataFrame's names and values, as hexadecimal text."""
    total = hashlib.sha256(repr(tuple(frame.columns)).encode("utf-8", "surrogatepass"))
    total.update(pd.util.hash_pandas_object(frame, index=False).to_numpy().tobytes())
    return total.hexdigest()
