"""The diagnosis as a whole: from files, or from drives, to what it says."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from sim2real.contest import add_pairs, hold_contest
from sim2real.drive import Drive
from sim2real.findings import Findings, describe
from sim2real.fitting import Evidence, residuals
from sim2real.noise import read_noise
from sim2real.observer import Simulation
from sim2real.result import Diagnosis
from sim2real.selection import decide, needs_pairs
from sim2real.sources import Sources, read_sources

Progress = Callable[[str, int, int], None]
PACKAGES = ("trpac-fmu", "numpy", "numba", "scipy", "pandas")


def _silent(stage: str, done: int, total: int) -> None:
    """No progress shown."""


def diagnose_files(
    vehicle: Path,
    road: Path | None,
    fit: Sequence[str],
    holdout: str,
    *,
    mapping: Path | None = None,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = _silent,
) -> Diagnosis:
    """Diagnose recorded logs against the simulation of a vehicle.

    Parameters
    ----------
    vehicle, road : Path
        vehicle.yaml, and the road of the logs that name none.
    fit, holdout : sequence of str, str
        Logs that parameters are fitted to, and the one that the gap is measured on; `log.csv` or `log.csv@road.yaml`.
    mapping : Path, optional
        How the logs' columns become the contract's.
    seed : int
        Of the resampling behind the intervals; the same seed gives the same diagnosis.
    exclude : collection of str
        Effects that are left out of the library.
    jobs : int
        Threads.
    progress : callable
        Told the stage, and how much of how much is done.

    Raises
    ------
    ScenarioError
        Unusable input, with everything that is wrong with it.
    """
    progress("reading", 0, 1)
    sources = read_sources(vehicle, road, fit, holdout, mapping)
    progress("reading", 1, 1)
    drives = [s.drive for s in sources.all]
    said = diagnose(
        Simulation(sources.vehicle),
        drives[:-1],
        drives[-1],
        seed=seed,
        exclude=exclude,
        jobs=jobs,
        progress=progress,
    )
    return replace(
        said,
        warnings=(*(f"{s.log.name}: {text}" for s in sources.all for text in s.log.warnings), *said.warnings),
        provenance={**_provenance(sources, road), **said.provenance},
    )


def diagnose(
    model: Simulation,
    fit: Sequence[Drive],
    holdout: Drive,
    *,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = _silent,
) -> Diagnosis:
    """Diagnose drives against a simulation; see `diagnose_files`."""
    findings = find(model, fit, holdout, exclude=exclude, jobs=jobs, progress=progress)
    return describe(findings, seed=seed, jobs=jobs, progress=progress)


def find(
    model: Simulation,
    fit: Sequence[Drive],
    holdout: Drive,
    *,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = _silent,
) -> Findings:
    """Hold the contest and decide it."""
    fit_to, held = evidence(model, fit), evidence(model, [holdout])
    contest = hold_contest(model, fit_to, held, exclude, jobs, progress)
    if needs_pairs(contest, fit_to, held):
        contest = add_pairs(contest, model, fit_to, held, jobs, progress)
    return Findings(model, fit_to, held, contest, decide(contest, fit_to, held))


def evidence(model: Simulation, drives: Sequence[Drive]) -> Evidence:
    """Drives with their noise, read from what the model leaves."""
    return Evidence(tuple(drives), tuple(read_noise(d, residuals(model, d)) for d in drives))


def _provenance(sources: Sources, road: Path | None) -> dict[str, object]:
    return {
        "vehicle": _file(sources.vehicle_path),
        "fit": [
            {**_file(s.log.path), "road": _file(s.road_path), "rate_hz": s.log.rate_hz} for s in sources.fit
        ],
        "holdout": {
            **_file(sources.holdout.log.path),
            "road": _file(sources.holdout.road_path),
            "rate_hz": sources.holdout.log.rate_hz,
        },
        "versions": {name: version(name) for name in PACKAGES},
    }


def _file(path: Path) -> dict[str, str]:
    return {"path": str(path), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
