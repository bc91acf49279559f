"""Reading a log of any format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from sim2real.logs.agreement import check_agreement, check_wheels
from sim2real.logs.checks import Clock, check_held, check_time, check_values
from sim2real.logs.errors import LogError
from sim2real.logs.formats.csv_file import read_csv
from sim2real.logs.formats.frame_table import frame_sha256, frame_table
from sim2real.logs.formats.kinds import KINDS, kind_of
from sim2real.logs.formats.mat_file import read_mat
from sim2real.logs.formats.mdf_file import needs_dbc, read_mdf
from sim2real.logs.formats.parquet_file import read_parquet
from sim2real.logs.log import Log
from sim2real.logs.mapping import NO_MAPPING, Format, Mapping
from sim2real.logs.plausible import lost_samples, without_codes, without_stuck_codes
from sim2real.logs.resampling import median_step
from sim2real.logs.rows import in_order, one_per_message
from sim2real.logs.table import Array, Finding, Table, Wanted
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


def read_log(
    path: str | Path,
    mapping: Mapping | None = None,
    dbc: DbcFiles = None,
    *,
    progress: Callable[[int], None] = lambda _: None,
) -> Log:
    """Read a log strictly: a table, MDF, a MAT-file, or raw frames of a bus, told apart by their content.

    Parameters
    ----------
    path : str or Path
        The file.
    mapping : Mapping, optional
        How its columns become those of the log format; columns that it does not name are read under their own names.
    dbc : path or sequence of paths, optional
        DBC files that say what the frames of a bus mean: needed for BLF, ASC, candump, TRC, and MDF with raw frames.
    progress : callable
        Called with the bytes of a text table that were read so far.

    Raises
    ------
    LogError
        With all problems of the file, one a line.
    """
    path = Path(path)
    return understood(path, mapping, dbc, progress=progress).log(lambda: file_sha256(path))


def understood(
    path: str | Path,
    mapping: Mapping | None = None,
    dbc: DbcFiles = None,
    *,
    progress: Callable[[int], None] = lambda _: None,
) -> Understood:
    """What a file is understood to hold, usable or not; parameters as of `read_log`.

    Raises
    ------
    LogError
        It cannot be read at all.
    """
    path, mapping = Path(path), mapping or NO_MAPPING
    files = [dbc] if isinstance(dbc, str | Path) else list(dbc or ())
    try:
        wanted = wanted_columns(mapping)
        row_word, table = _read_table(path, wanted, mapping.format, files, progress)
    except LogError:
        raise
    except (FileError, ValueError) as error:  # the latter of text that is no picture's path
        raise LogError(f"{quoted(path)}: {error}" if type(error) is ValueError else str(error)) from error
    return _understand(table, mapping, path, row_word)


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
    return _understand(table, mapping, Path(name), "row").log(lambda: frame_sha256(frame))


@dataclass(frozen=True)
class Understood:
    """A table under a mapping, with all that is odd about it.

    Attributes
    ----------
    path : Path
        Its file.
    mapping : Mapping
        How its columns become those of the log format.
    table : Table
        The file's columns, in the rows that are kept.
    time_s : array, shape (n,)
        Ascending [s]; empty where the file has no time.
    signals : dict
        The columns of the log format that could be made, shape (n,).
    derived : frozenset of str
        Those of them that were computed rather than measured.
    gaps : tuple of (float, float)
        Pieces of time without rows [s].
    findings : tuple of Finding
        What is odd; a fatal one keeps it from being a log.
    """

    path: Path
    mapping: Mapping
    table: Table
    time_s: Array
    signals: dict[str, Array]
    derived: frozenset[str]
    gaps: tuple[tuple[float, float], ...]
    findings: tuple[Finding, ...]

    @property
    def problems(self) -> tuple[str, ...]:
        """What keeps it from being a log, in sentences."""
        return tuple(quoted(finding.text, LONGEST_FINDING) for finding in self.findings if finding.fatal)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else is odd, in sentences."""
        return tuple(quoted(finding.text, LONGEST_FINDING) for finding in self.findings if not finding.fatal)

    def log(self, sha256: Callable[[], str]) -> Log:
        """The log, with what `sha256` returns; raises LogError with all problems."""
        if self.problems:
            raise LogError("\n".join(f"{quoted(self.path)}: {text}" for text in self.problems))
        return Log(
            path=self.path,
            name=self.path.name,
            time_s=self.time_s,
            signals={name: values for name, values in self.signals.items() if not np.isnan(values).all()},
            image_path=self.table.text.get(picture_source(self.mapping)),
            rate_hz=1.0 / median_step(self.time_s),
            gaps=self.gaps,
            derived=self.derived,
            ignored=ignored_columns(self.table, self.mapping),
            warnings=self.warnings,
            sha256=sha256(),
            notes=self.table.notes,
        )


def _understand(table: Table, mapping: Mapping, path: Path, row_word: str) -> Understood:
    def row(i: int) -> str:
        return f"{row_word} {table.rows[i]}"

    wanted = wanted_columns(mapping)
    table = without_codes(table, mapping.invalid)
    table = without_stuck_codes(table, wanted.numbers - wanted.held - {wanted.time})
    time_s, table = read_time(table, mapping)
    findings = [*table.findings, *missing_columns(table, mapping)]
    if time_s is None or len(time_s) == 0:
        if not any(finding.fatal for finding in findings):
            findings.append(Finding("has no rows; expected one row per sample."))
        made = translate(table, mapping, None)
        return Understood(path, mapping, table, np.zeros(0), made.signals, made.derived, (), tuple(findings))
    if wanted.time and (apart := one_per_message(path, table, time_s, wanted)) is not None:
        table, time_s = apart, apart.numbers[wanted.time]
        findings = [*table.findings, *missing_columns(table, mapping)]
    kept, said = in_order(time_s, row)
    table, time_s = table.kept(kept), time_s[kept]
    clock = Clock() if any(finding.fatal for finding in said) else check_time(time_s, row)
    usable = clock.usable and kept.any() and not any(finding.fatal for finding in said)
    made = translate(table, mapping, time_s if usable else None)
    signals, lost = lost_samples(time_s, made.signals) if usable else (made.signals, [])
    findings += [*said, *clock.findings, *made.findings, *lost]
    findings += [*check_values(time_s if usable else None, signals, row), *check_wheels(signals)]
    if usable:
        findings += [*check_agreement(time_s, signals, made.derived), *check_held(time_s, signals)]
    return Understood(path, mapping, table, time_s, signals, made.derived, clock.gaps, tuple(findings))


def _read_table(
    path: Path, wanted: Wanted, stated: Format, dbc: Sequence[str | Path], progress: Callable[[int], None]
) -> tuple[str, Table]:
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
        from sim2real.logs.formats.bus_file import read_bus  # cantools is an extra

        return "sample", read_bus(path, kind, wanted, dbc)
    row_word, table = _read_named(path, kind, wanted, stated, progress)
    if dbc:
        told = Finding(f"is a {kind} file, whose columns have names: the DBC file is not used.", fatal=False)
        table = replace(table, findings=(*table.findings, told))
    return row_word, table


def _read_named(
    path: Path, kind: str, wanted: Wanted, stated: Format, progress: Callable[[int], None]
) -> tuple[str, Table]:
    """The columns of a file that names them."""
    if kind == "Parquet":
        return "row", read_parquet(path, wanted)
    if kind == "MDF":
        return "sample", read_mdf(path, wanted)
    if kind == "MAT":
        return "sample", read_mat(path, wanted)
    return "row", read_csv(path, wanted, stated, progress)
