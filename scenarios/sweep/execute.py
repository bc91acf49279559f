"""Runs a sweep on Dask, in local processes or on a running cluster; every finished run is stored at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from distributed import Client, Future, as_completed
from joblib import cpu_count

from scenarios.errors import ScenarioError
from scenarios.progress import Progress, silent
from scenarios.sweep.cluster import connected, security_of
from scenarios.sweep.draw import RunKey, plan_run, run_keys
from scenarios.sweep.files import Sweep
from scenarios.sweep.run import run_plan
from scenarios.sweep.store import Parts, identity, source_digest
from trpac_core.files import quoted

AHEAD = 8
"""Runs that are submitted per worker thread: enough to keep it busy, few enough to stop quickly."""


@dataclass(frozen=True)
class Failure:
    """A run that failed, and the reason."""

    run: int
    why: str


@dataclass(frozen=True)
class _Finished:
    """The result of a worker."""

    rows: list[dict[str, Any]]
    cpu_s: float
    source_sha256: str


def run_one(sweep: Sweep, key: RunKey) -> _Finished:
    """The result of one run; called on a worker."""
    began = time.process_time()
    rows = run_plan(plan_run(sweep, key), sweep.file.estimators, sweep.file.unit)
    return _Finished(rows, time.process_time() - began, source_digest())


def execute(
    sweep: Sweep,
    out: Path,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress = silent,
) -> tuple[Parts, list[Failure]]:
    """Run all runs that are not stored yet; returns the stored parts and the failures.

    Returns
    -------
    tuple
        Stored parts, and failed runs.

    Raises
    ------
    ScenarioError
        A folder with another sweep or a damaged part; a scheduler that does not answer or is not secure; workers with
        other code.
    """
    if scheduler is not None:
        security_of(scheduler)  # refused before anything is written
    parts = Parts(out, identity(sweep))
    keys = run_keys(sweep)
    done = parts.open()
    todo = [key for key in keys if key.index not in done]
    progress(len(keys) - len(todo), len(keys))
    if not todo:
        return parts, []
    failures: list[Failure] = []
    finished = len(keys) - len(todo)
    with connected(scheduler, min(jobs or cpu_count(), len(todo))) as client:
        for key, future in _stream(client, sweep, todo):
            if future.status == "finished":
                result = future.result()
                _same_code(result.source_sha256)
                parts.keep(key.index, result.rows, result.cpu_s)
            else:
                failures.append(Failure(key.index, _why(future)))
            finished += 1
            progress(finished, len(keys))
    return parts, sorted(failures, key=lambda failure: failure.run)


def _stream(client: Client, sweep: Sweep, todo: list[RunKey]) -> Iterator[tuple[RunKey, Future]]:
    """Runs as they finish; at most `AHEAD` per thread are submitted at a time."""
    # The sweep, some kB, is sent with every task: scattered data would be lost with the worker that holds them.
    waiting = iter(todo)
    threads = sum(client.nthreads().values()) or 1

    def submit(key: RunKey) -> Future:
        future = client.submit(run_one, sweep, key, key=f"run-{key.index}-{id(todo)}", pure=False)
        running[future.key] = key
        return future

    running: dict[Any, RunKey] = {}
    first = [submit(key) for key in islice(waiting, AHEAD * threads)]
    completed = as_completed(first)
    for future in completed:
        yield running.pop(future.key), future
        following = next(waiting, None)
        if following is not None:
            completed.add(submit(following))


def _same_code(digest: str) -> None:
    if digest != source_digest():
        raise ScenarioError(
            "A worker of the cluster runs other code than this checkout. Expected the same files on both; update the "
            "workers' checkout, restart them and run the sweep again."
        )


def _why(future: Future) -> str:
    error = future.exception()
    return quoted(f"{type(error).__name__}: {error}")
