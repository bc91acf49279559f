"""Reading a log of any format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from sim2real.logs.checks import check_held, check_motion, check_time, check_values, check_wheels
from sim2real.logs.csv_file import read_csv
from sim2real.logs.errors import LogError
from sim2real.logs.frame_table import frame_sha256, frame_table
from sim2real.logs.kinds import KINDS, kind_of
from sim2real.logs.log import Log
from sim2real.logs.mapping import NO_MAPPING, Mapping
from sim2real.logs.mat_file import read_mat
from sim2real.logs.mdf_file import needs_dbc, read_mdf
from sim2real.logs.resampling import median_step
from sim2real.logs.table import Finding, Table, Wanted
from sim2real.logs.translate import (
    ignored_columns,
    missing_columns,
    picture_source,
    read_time,
    translate,
    wanted_columns,
)
from trpac_core.files import FileError, file_sha256, open_file, quoted

MOST_BYTES = 4_000_000_000
"""Larger logs are refused unread [bytes]."""
LONGEST_FINDING = 600
"""Characters of one sentence about a log."""
MAGIC = {b"PAR1": "Parquet", b"MDF ": "MDF", b"UnFi": "MDF"}
"""First four bytes of the files that are not text; UnFi is an MDF that its recorder did not close."""
SUFFIXES = {".csv": "CSV", ".parquet": "Parquet", ".mf4": "MDF", ".mdf": "MDF", ".dat": "MDF"} | {
    ".blf": "BLF",
    ".trc": "TRC",
    ".mat": "MAT",
}
BUS_SUFFIXES = {".asc": "ASC", ".log": "candump"}
"""Names that tables have, too: with a DBC file they must be bus logs."""
START_BYTES = 4096
"""So many bytes tell what a file is."""


DbcFiles = str | Path | Sequence[str | Path] | None
"""One or several DBC files."""


def read_log(path: str | Path, mapping: Mapping | None = None, dbc: DbcFiles = None) -> Log:
    """Read a log strictly: a table, MDF, a MAT-file, or raw frames of a bus, told apart by their content.

    Parameters
    ----------
    path : str or Path
        The file.
    mapping : Mapping, optional
        How its columns become those of the log format; columns that it does not name are read under their own names.
    dbc : path or sequence of paths, optional
        DBC files that say what the frames of a bus mean: needed for BLF, ASC, candump, TRC, and MDF with raw frames.

    Raises
    ------
    LogError
        With all problems of the file, one a line.
    """
    path, mapping = Path(path), mapping or NO_MAPPING
    files = [dbc] if isinstance(dbc, str | Path) else list(dbc or ())
    try:
        row_word, table = _read_table(path, wanted_columns(mapping), files)
    except LogError:
        raise
    except (FileError, ValueError) as error:  # the latter of text that is no picture's path
        raise LogError(f"{quoted(path)}: {error}" if type(error) is ValueError else str(error)) from error
    return _log(table, mapping, path, row_word, lambda: file_sha256(path))


def log_of_frame(frame: pd.DataFrame, mapping: Mapping | None = None, name: str = "frame") -> Log:
    """The log that a table holds, checked as one of a file is; its rows count from 0.

    Parameters
    ----------
    frame : DataFrame
        Columns of the log format, or those that the mapping names.
    mapping : Mapping, optional
        How its columns become those of the log format.
    name : str
        What messages call it.

    Raises
    ------
    LogError
        With all problems of the table, one a line.
    """
    mapping = mapping or NO_MAPPING
    table = frame_table(frame, wanted_columns(mapping))
    return _log(table, mapping, Path(name), "row", lambda: frame_sha256(frame))


def _log(table: Table, mapping: Mapping, path: Path, row_word: str, sha256: Callable[[], str]) -> Log:
    """The log that a table makes under a mapping; raises LogError with all problems."""

    def row(i: int) -> str:
        return f"{row_word} {table.rows[i]}"

    findings = [*table.findings, *missing_columns(table, mapping)]
    time_s = read_time(table, mapping)
    if time_s is None or len(time_s) == 0:
        raise _error(path, findings)
    clock = check_time(time_s, row)
    made = translate(table, mapping, time_s if clock.usable else None)
    findings += [
        *clock.findings,
        *made.findings,
        *check_values(time_s if clock.usable else None, made.signals, row),
        *check_wheels(made.signals),
    ]
    if clock.usable:
        findings += [*check_motion(time_s, made.signals), *check_held(time_s, made.signals)]
    if any(finding.fatal for finding in findings):
        raise _error(path, findings)
    return Log(
        path=path,
        name=path.name,
        time_s=time_s,
        signals={name: values for name, values in made.signals.items() if not np.isnan(values).all()},
        image_path=table.text.get(picture_source(mapping)),
        rate_hz=1.0 / median_step(time_s),
        gaps=clock.gaps,
        derived=made.derived,
        ignored=ignored_columns(table, mapping),
        warnings=tuple(quoted(finding.text, LONGEST_FINDING) for finding in findings),
        sha256=sha256(),
    )


def _read_table(path: Path, wanted: Wanted, dbc: Sequence[str | Path]) -> tuple[str, Table]:
    """The file's columns, and what one of its rows is called; the content tells the format, the name must agree."""
    with open_file(path, MOST_BYTES, "a log") as file:
        start = file.read(START_BYTES)
    kind = MAGIC.get(start[:4]) or kind_of(start) or "CSV"
    suffix = path.suffix.lower()
    named = SUFFIXES.get(suffix) or (BUS_SUFFIXES.get(suffix) if dbc and kind == "CSV" else None) or kind
    if kind != named:
        raise LogError(
            f"{path}: is named like {named} and does not start like it; expected a whole {named} file."
        )
    if kind in KINDS or (kind == "MDF" and dbc):
        if not dbc:
            raise needs_dbc(path, kind)
        from sim2real.logs.bus_file import read_bus  # cantools is an extra

        return "sample", read_bus(path, kind, wanted, dbc)
    row_word, table = _read_named(path, kind, wanted)
    if dbc:
        told = Finding(f"is a {kind} file, whose columns have names: the DBC file is not used.", fatal=False)
        table = replace(table, findings=(*table.findings, told))
    return row_word, table


def _read_named(path: Path, kind: str, wanted: Wanted) -> tuple[str, Table]:
    """The columns of a file that names them."""
    if kind == "Parquet":
        from sim2real.logs.parquet_file import read_parquet  # pyarrow is an extra

        return "row", read_parquet(path, wanted)
    if kind == "MDF":
        return "sample", read_mdf(path, wanted)
    if kind == "MAT":
        return "sample", read_mat(path, wanted)
    return "row", read_csv(path, wanted)


def _error(path: Path, findings: list[Finding]) -> LogError:
    fatal = [quoted(finding.text, LONGEST_FINDING) for finding in findings if finding.fatal]
    return LogError("\n".join(f"{quoted(path)}: {text}" for text in fatal))
