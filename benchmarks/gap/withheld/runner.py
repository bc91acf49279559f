"""Makes the cases, shows them to the diagnosis, keeps what it says next to what was hidden.

A case's result is one file; a run that was stopped goes on where it stopped. The folder that a case's logs lie in bears
no word of the truth, and the seal is written only once the diagnosis has spoken.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import time
import traceback
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config

from .command import arguments, watch
from .generator.camera_case import make_case
from .generator.cases import Case, Forms, UndrivableError
from .generator.table import Group, Spec, table

HERE = Path(__file__).resolve().parent
THRESHOLDS = HERE / "thresholds.yaml"


class RunError(ValueError):
    """The run's folder belongs to another run, or a result cannot be read."""


def digest(*paths: Path) -> str:
    """SHA-256 over files, in order of their names."""
    total = hashlib.sha256()
    for path in sorted(paths):
        total.update(path.name.encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def seal_run(out: Path, size: str, seed: int) -> None:
    """Write what the run is before any case is made; refuse a folder that holds another one.

    Raises
    ------
    RunError
        `out` holds a run of another seed, size, generator or thresholds.
    """
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False
    )
    run = {
        "seed": seed,
        "size": size,
        "generator_sha256": digest(*(HERE / "generator").glob("*.py")),
        "thresholds_sha256": digest(THRESHOLDS),
    }
    path = out / "run.json"
    if path.exists():
        known = {key: json.loads(path.read_text(encoding="utf-8")).get(key) for key in run}
        if known != run:
            off = ", ".join(
                f"{key}: {known[key]} there, {run[key]} now" for key in run if known[key] != run[key]
            )
            raise RunError(f"{path}: another run ({off}); choose another --out or remove the folder")
        return
    out.mkdir(parents=True, exist_ok=True)
    _write(path, run | {"commit": commit.stdout.strip() or None})


def pending(out: Path, size: str) -> tuple[list[Spec], int]:
    """Cases without a result, and how many there are in all; in mixed order, so that a stopped run is a fair sample."""
    specs = sorted(
        table(size),
        key=lambda spec: (spec.group is Group.TIMING, zlib.crc32(spec.name.encode())),
    )
    return [spec for spec in specs if not result_path(out, spec).exists()], len(specs)


def result_path(out: Path, spec: Spec) -> Path:
    """Where a case's result lies."""
    return out / "results" / f"{spec.name}.json"


def run(out: Path, size: str, seed: int, jobs: int, keep: bool) -> Iterator[dict[str, Any]]:
    """Run what is pending; results come as they are done, the timed cases last and alone."""
    specs, _ = pending(out, size)
    side_by_side = [spec for spec in specs if spec.group is not Group.TIMING]
    with parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
        yield from Parallel(return_as="generator_unordered")(
            delayed(run_case)(spec, seed, out, keep) for spec in side_by_side
        )
    for spec in specs:
        if spec.group is Group.TIMING:
            yield run_case(spec, seed, out, keep)


def run_case(
    spec: Spec, seed: int, out: Path, keep: bool, forms: Forms | None = None, attempt: int | None = None
) -> dict[str, Any]:
    """Make one case, have it diagnosed, write the result; a case that cannot be made stays pending."""
    try:
        case = make_case(spec, seed, forms, attempt)
    except UndrivableError as problem:
        return {"case": spec.name, "error": f"not made: {problem}"}
    folder = write_case(case, seed, out)
    said = _timed(folder) if spec.group is Group.TIMING else _in_process(case, folder, seed)
    result = {"case": spec.name, **said}
    _write(result_path(out, spec), result | {"seal": case.seal()})
    if not keep:
        shutil.rmtree(folder)
    return result


def write_case(case: Case, seed: int, out: Path) -> Path:
    """Files of a case in a folder whose name tells nothing."""
    folder = out / "cases" / f"{zlib.crc32(f'{seed}/{case.spec.name}'.encode()):08x}"
    case.write(folder)
    return folder


def _in_process(case: Case, folder: Path, seed: int) -> dict[str, Any]:
    from sim2real.diagnose import diagnose_files, shrink_on

    began, wall = time.process_time(), time.perf_counter()
    road, holdout = folder / "road.yaml", folder / "road_holdout.yaml"

    def diagnose() -> dict[str, Any]:
        diagnosis = diagnose_files(
            folder / "vehicle.yaml",
            road,
            [str(folder / "fit_1.csv"), str(folder / "fit_2.csv")],
            f"{folder / 'holdout.csv'}@{holdout}",
            seed=seed,
            exclude=case.spec.exclude,
            jobs=1,
        )
        took = {"cpu_s": time.process_time() - began, "wall_s": time.perf_counter() - wall}
        achieved = float(shrink_on(diagnosis, folder / "fresh.csv", holdout))
        return {"diagnosis": diagnosis.to_json(), "achieved_shrink_percent": achieved, **took}

    return _guarded(diagnose)


def _timed(folder: Path) -> dict[str, Any]:
    """By the command, one log to fit and one held out, two cores."""

    def diagnose() -> dict[str, Any]:
        out = folder / "out"
        usage = watch(arguments(folder, out, ("fit_1",), jobs=2))
        if usage.code != 0:
            raise RunError(f"the command ended with {usage.code}: {usage.errors}")
        return {
            "diagnosis": json.loads((out / "diagnosis.json").read_text(encoding="utf-8")),
            "usage": asdict(usage),
        }

    return _guarded(diagnose)


def _guarded(diagnose: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """A diagnosis that fails is a result too: a wrong one."""
    try:
        return {"error": None, **diagnose()}
    except ImportError:
        raise
    except Exception as problem:  # noqa: BLE001 - whatever ends a diagnosis is counted against it, and the run goes on
        return {
            "error": f"{type(problem).__name__}: {problem}",
            "traceback": traceback.format_exc(),
            "diagnosis": None,
        }


def _write(path: Path, content: dict[str, Any]) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content, indent=1), encoding="utf-8")
    part.replace(path)
