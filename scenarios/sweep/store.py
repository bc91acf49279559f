"""Finished runs on disk, one file each, and their table."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import fields
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenarios.errors import ScenarioError
from scenarios.metrics import SegmentScore
from scenarios.sweep.files import Sweep
from scenarios.whole_files import write_whole
from trpac_core.files import FileError, parse_json, quoted, read_bytes, read_text

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("trpac_core", "scenarios")
"""Packages whose code determines the result of a run."""
TEXT = ("parameter", "surface", "estimator")
WHOLE = ("run", "number", "seed", "stretch")
SORT = ["run", "stretch", "estimator"]
SCORES = (
    *(field.name for field in fields(SegmentScore)),
    *("level", "theta_before", "shown_s", "time_s", "shown_convergence_time_s", "band_time_s"),
    *("error_end", "error_mean", "error_shown_late", "std_end", "std_mean"),
    *("covered_share", "covered_share_shown", "covered_end"),
)
"""Numeric columns; null where there is nothing to measure."""
COLUMNS = {*TEXT, *WHOLE, *SCORES}
"""Columns of a run's rows; see `run.rows_of`."""
IDENTITY = "sweep.json"
MOST_BYTES = 64_000_000
"""Largest sweep.json or part that is read [bytes]; a row has about 900, and a run at most 20,000 rows."""


@lru_cache(maxsize=1)
def source_digest() -> str:
    """SHA-256 over the code of a run, the networks and the camera records."""
    digest = hashlib.sha256()
    files = sorted(p for name in SOURCES for p in (ROOT / name).rglob("*.py"))
    files += sorted((ROOT / "models").glob("*.onnx"))
    files.append(Path(__file__).with_name("camera_process.yaml"))
    for path in files:
        digest.update(str(path.relative_to(ROOT)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def identity(sweep: Sweep) -> dict[str, Any]:
    """The identity of a sweep's parts: sweep file, scenario with its files, and code; raises FileError."""
    scenario = sweep.scenario
    described = {
        "sweep": sweep.file.model_dump(by_alias=True),
        "vehicle": scenario.vehicle.model_dump(by_alias=True),
        "road": scenario.road.model_dump(by_alias=True),
        "manoeuvre": scenario.manoeuvre.model_dump(by_alias=True),
        "sensors": scenario.sensors.model_dump(by_alias=True),
        "pictures": scenario.pictures.model_dump(by_alias=True),
        "end": scenario.end.model_dump(by_alias=True),
        "camera": ""
        if scenario.camera_path is None
        else read_text(scenario.camera_path, MOST_BYTES, "the camera's YAML file"),
        "step_s": scenario.step_s,
        "wheel": scenario.wheel,
        "source_sha256": source_digest(),
    }
    plain: dict[str, Any] = json.loads(json.dumps(described))
    return plain


class Parts:
    """The part files of a sweep's folder, each with its run, a hash of the sweep and a hash of its content.

    Parameters
    ----------
    out : Path
        The sweep's folder; `open` creates it.
    described : dict
        The identity, see `identity`; without a sweep in it parts are checked by their own hashes alone.
    """

    def __init__(self, out: Path, described: dict[str, Any]) -> None:
        self._out, self._identity = out, described
        self._folder = out / "parts"
        self._sha256 = _digest(described)

    def open(self) -> set[int]:
        """Numbers of the stored runs; raises ScenarioError where the folder holds anything else."""
        known = self._out / IDENTITY
        for folder in (self._out, self._folder):
            if os.path.lexists(folder) and not folder.is_dir():
                raise ScenarioError(f"{quoted(folder)}: a file. Expected a folder to write into.")
        if os.path.lexists(known):
            before = _read(known, "what identifies the folder's sweep")
            if not isinstance(before, dict):
                raise ScenarioError(
                    f"{quoted(known)}: is no sweep's identity; delete it and run the sweep again."
                )
            differs = sorted(k for k in self._identity if before.get(k) != self._identity[k])
            if differs:
                raise ScenarioError(
                    f"{quoted(self._out)}: holds runs of another sweep (differs in {', '.join(differs)}). "
                    "Expected the same sweep, to go on with, or an empty folder; choose another --out."
                )
        elif self._folder.exists():
            raise ScenarioError(f"{quoted(self._out)}: holds parts but no {IDENTITY}; choose another --out.")
        self._folder.mkdir(parents=True, exist_ok=True)
        write_whole(known, json.dumps(self._identity, indent=1).encode())
        return {part["run"] for part in self._all()}

    def keep(self, index: int, rows: list[dict[str, Any]], cpu_s: float) -> None:
        """Store a run's rows and its processor time [s]."""
        part = {"run": index, "sweep": self._sha256, "cpu_s": cpu_s, "rows": rows}
        part["sha256"] = _digest(part)
        write_whole(self._folder / _name(index), json.dumps(part).encode())

    def empty(self) -> bool:
        """Whether no run is stored."""
        return not any(self._folder.glob("*.json"))

    def table(self) -> pd.DataFrame:
        """All stored runs, sorted, with fixed columns and types."""
        return as_table(row for part in self._all() for row in part["rows"])

    def cpu_s(self) -> list[float]:
        """Processor time of each run, in the order of their numbers [s]."""
        return [float(part["cpu_s"]) for part in self._all()]

    def _all(self) -> Iterator[dict[str, Any]]:
        asked = self._identity.get("sweep")
        names = None if asked is None else {_name(index) for index in range(_count(asked))}
        for path in sorted(self._folder.glob("*.json")):
            if names is not None and path.name not in names:
                raise ScenarioError(
                    f"{quoted(path)}: is no run of this sweep; delete it and run the sweep again."
                )
            part = _read(path, "a finished run")
            written = _is_part(part) and (part["sweep"], _name(part["run"])) == (self._sha256, path.name)
            if not written or not (asked is None or _is_complete(part["rows"], asked["estimators"])):
                raise ScenarioError(
                    f"{quoted(path)}: damaged, or of another run or sweep; delete it and run the sweep again."
                )
            yield part


def _count(asked: dict[str, Any]) -> int:
    """Number of runs of a sweep over all levels."""
    return int(asked["runs"]) * (sum(len(axis["levels"]) for axis in asked["vary"]) or 1)


def _name(index: int) -> str:
    return f"{index:07d}.json"


def _digest(value: dict[str, Any]) -> str:
    """SHA-256 of a JSON value; raises ValueError where a number is not finite."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, allow_nan=False).encode()).hexdigest()


def _is_part(part: Any) -> bool:
    """Whether this is content that `Parts.keep` writes."""
    return (
        isinstance(part, dict)
        and part.keys() == {"run", "sweep", "cpu_s", "rows", "sha256"}
        and isinstance(part["sweep"], str)
        and _fits("run", part["run"])
        and _is_number(part["cpu_s"])
        and isinstance(part["rows"], list)
        and all(_is_row(row) and row["run"] == part["run"] for row in part["rows"])
        and part["sha256"] == _digest({key: value for key, value in part.items() if key != "sha256"})
    )


def _is_row(row: Any) -> bool:
    return (
        isinstance(row, dict) and {*TEXT, *WHOLE} <= row.keys() and all(_fits(*item) for item in row.items())
    )


def _fits(column: str, value: Any) -> bool:
    if column in TEXT:
        return isinstance(value, str)
    if column in WHOLE:
        return isinstance(value, int) and _is_number(value)
    return value is None or _is_number(value)


def _is_number(value: Any) -> bool:
    """Whether it is finite and fits a column of 64 bits."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 63


def _is_complete(rows: list[dict[str, Any]], estimators: list[str]) -> bool:
    """Whether each estimator has one row on each stretch."""
    pairs = [(row["stretch"], row["estimator"]) for row in rows]
    wanted = product({stretch for stretch, _ in pairs}, estimators)
    return bool(rows) and sorted(pairs) == sorted(wanted) and all(row.keys() == COLUMNS for row in rows)


def as_table(rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """Rows of runs as a table; missing values are NaN."""
    frame = pd.DataFrame(list(rows))
    numbers = [c for c in frame.columns if c not in TEXT + WHOLE]
    frame = frame.astype({**dict.fromkeys(WHOLE, np.int64), **dict.fromkeys(numbers, np.float64)})
    return frame.sort_values(SORT, kind="stable", ignore_index=True)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write runs.parquet; the same table gives the same bytes."""
    table.to_parquet(path, index=False)


def _read(path: Path, expected: str) -> Any:
    try:
        return parse_json(read_bytes(path, MOST_BYTES, expected), quoted(path))
    except FileError as error:
        raise ScenarioError(f"{str(error).rstrip('.')}; delete it and run the sweep again.") from error
