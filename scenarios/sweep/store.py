"""Finished runs on disk: one part file each, written whole or not at all, and the table that they make."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenarios.errors import ScenarioError
from scenarios.sweep.files import Sweep, content

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("trpac_core", "fmu_src", "scenarios")
"""Packages whose code decides what a run gives."""
TEXT = ("parameter", "surface", "estimator")
WHOLE = ("run", "number", "seed", "stretch")
SORT = ["run", "stretch", "estimator"]
IDENTITY = "sweep.json"


@lru_cache(maxsize=1)
def source_digest() -> str:
    """SHA-256 over the code that a run rests on, its networks and its camera records."""
    digest = hashlib.sha256()
    files = sorted(p for name in SOURCES for p in (ROOT / name).rglob("*.py"))
    files += sorted((ROOT / "models").glob("*.onnx"))
    files.append(Path(__file__).with_name("camera_process.yaml"))
    for path in files:
        digest.update(str(path.relative_to(ROOT)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def identity(sweep: Sweep) -> dict[str, Any]:
    """What parts of a folder must agree in: the sweep, the scenario with its files, the code."""
    scenario = sweep.scenario
    described = {
        "sweep": content(sweep.file),
        "vehicle": scenario.vehicle.model_dump(by_alias=True),
        "road": scenario.road.model_dump(by_alias=True),
        "manoeuvre": scenario.manoeuvre.model_dump(by_alias=True),
        "sensors": scenario.sensors.model_dump(by_alias=True),
        "pictures": scenario.pictures.model_dump(by_alias=True),
        "end": scenario.end.model_dump(by_alias=True),
        "camera": "" if scenario.camera_path is None else scenario.camera_path.read_text(encoding="utf-8"),
        "step_s": scenario.step_s,
        "wheel": scenario.wheel,
        "source_sha256": source_digest(),
    }
    plain: dict[str, Any] = json.loads(json.dumps(described))
    return plain


class Parts:
    """The part files of a sweep's folder.

    Parameters
    ----------
    out : Path
        The sweep's folder; it is made when the first part is kept.
    described : dict
        See `identity`.
    """

    def __init__(self, out: Path, described: dict[str, Any]) -> None:
        self._out, self._identity = out, described
        self._folder = out / "parts"

    def open(self) -> set[int]:
        """Numbers of the runs that are there; raises ScenarioError where the folder holds another sweep."""
        known = self._out / IDENTITY
        if self._out.exists() and not self._out.is_dir():
            raise ScenarioError(f"{self._out}: a file. Expected a folder to write into.")
        if known.is_file():
            before = _read(known)
            if not isinstance(before, dict):
                raise ScenarioError(f"{known}: is no sweep's identity; delete it and run the sweep again.")
            differs = sorted(k for k in self._identity if before.get(k) != self._identity[k])
            if differs:
                raise ScenarioError(
                    f"{self._out}: holds runs of another sweep (differs in {', '.join(differs)}). "
                    "Expected the same sweep, to go on with, or an empty folder; choose another --out."
                )
        elif self._folder.exists():
            raise ScenarioError(f"{self._out}: holds parts but no {IDENTITY}; choose another --out.")
        self._folder.mkdir(parents=True, exist_ok=True)
        write_whole(known, json.dumps(self._identity, indent=1).encode())
        strange = sorted(path.name for path in self._folder.glob("*.json") if not path.stem.isdecimal())
        if strange:
            raise ScenarioError(f"{self._folder / strange[0]}: is no run of a sweep; move it elsewhere.")
        return {int(path.stem) for path in self._folder.glob("*.json")}

    def keep(self, index: int, rows: list[dict[str, Any]], cpu_s: float) -> None:
        """Write one run's rows and the processor time that it took [s]."""
        part = {"cpu_s": cpu_s, "rows": rows}
        write_whole(self._folder / f"{index:07d}.json", json.dumps(part).encode())

    def empty(self) -> bool:
        """Whether no run is there."""
        return not any(self._folder.glob("*.json"))

    def table(self) -> pd.DataFrame:
        """All runs kept, sorted, with the same columns and types whatever the order of work."""
        return as_table(row for part in self._all() for row in part["rows"])

    def cpu_s(self) -> list[float]:
        """Processor time of each run, in the order of their numbers [s]."""
        return [float(part["cpu_s"]) for part in self._all()]

    def _all(self) -> Iterator[dict[str, Any]]:
        for path in sorted(self._folder.glob("*.json")):
            part = _read(path)
            if not _is_part(part):
                raise ScenarioError(
                    f"{path}: damaged, expected 'cpu_s' and the 'rows' of a run; delete it and run the sweep again."
                )
            yield part


def _is_part(part: Any) -> bool:
    """Whether this is what `Parts.keep` writes."""
    if not isinstance(part, dict) or part.keys() != {"cpu_s", "rows"} or not isinstance(part["rows"], list):
        return False
    return _is_number(part["cpu_s"]) and all(
        isinstance(row, dict) and {*TEXT, *WHOLE} <= row.keys() and all(_fits(*item) for item in row.items())
        for row in part["rows"]
    )


def _fits(column: str, value: Any) -> bool:
    if column in TEXT:
        return isinstance(value, str)
    if column in WHOLE:
        return isinstance(value, int) and _is_number(value)
    return value is None or _is_number(value)


def _is_number(value: Any) -> bool:
    """Whether it goes into a column of 64 bits."""
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 1 << 63)


def as_table(rows: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """Rows of runs as a table; what a row does not have is NaN."""
    frame = pd.DataFrame(list(rows))
    numbers = [c for c in frame.columns if c not in TEXT + WHOLE]
    frame = frame.astype({**dict.fromkeys(WHOLE, np.int64), **dict.fromkeys(numbers, np.float64)})
    return frame.sort_values(SORT, kind="stable", ignore_index=True)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write runs.parquet; the same table gives the same bytes."""
    scratch = path.with_name(path.name + ".part")
    table.to_parquet(scratch, index=False)
    os.replace(scratch, path)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all."""
    scratch = path.with_name(path.name + ".part")
    with scratch.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(scratch, path)


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}; delete it and run the sweep again.") from error
