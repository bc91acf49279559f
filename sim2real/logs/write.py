"""Writing a log in any format that can be read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
from numpy.typing import NDArray

from scenarios.plant.sensors import write_log as write_csv
from sim2real.logs.contract import TIME
from sim2real.logs.errors import LogError
from sim2real.logs.log import Log

MASTER = (TIME, 1)
"""Name of the master channel, and MDF's number for one that is time."""


def write_log(log: Log | pd.DataFrame, path: str | Path) -> None:
    """Write a log, or a table with the log format's columns; the name's ending says the format.

    Numbers are read back unchanged from all three formats.

    Raises
    ------
    LogError
        The ending is none of .csv, .parquet, .mf4.
    """
    path = Path(path)
    table = log.to_frame() if isinstance(log, Log) else log
    path.parent.mkdir(parents=True, exist_ok=True)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        write_csv(table, path)
    elif suffix == ".parquet":
        table.to_parquet(path, index=False, write_page_checksum=True)
    elif suffix == ".mf4":
        _write_mdf(table, path)
    else:
        raise LogError(
            f"{path}: cannot tell the format; expected a name that ends with .csv, .parquet or .mf4."
        )


def _write_mdf(table: pd.DataFrame, path: Path) -> None:
    from asammdf import MDF, Signal  # takes a second to import, and most logs are not MDF

    time_s = table[TIME].to_numpy()
    with MDF(version="4.10") as mdf:
        signals = [
            Signal(_samples(table[name]), time_s, name=str(name), encoding="utf-8", master_metadata=MASTER)
            for name in table.columns.drop(TIME)
        ]
        mdf.append(signals, common_timebase=True)
        mdf.save(path, overwrite=True)


def _samples(column: pd.Series) -> NDArray[Any]:
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy()
    return column.fillna("").str.encode("utf-8").to_numpy().astype("S")
