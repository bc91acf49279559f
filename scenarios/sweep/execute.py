"""All runs of a sweep on Dask: local processes, or a running cluster; every finished run is kept at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import dask
from distributed import Client, Future, LocalCluster, as_completed
from joblib import cpu_count

from scenarios.errors import ScenarioError
from scenarios.sweep.draw import RunKey, plan_run, run_keys
from scenarios.sweep.files import Sweep
from scenarios.sweep.run import run_plan
from scenarios.sweep.store import Parts, identity, source_digest

AHEAD = 8
"""Runs handed to Dask per worker thread: enough to keep it busy, few enough to stop quickly."""
DEATHS = 3
"""Workers that one run may take down before it is given up."""
CONNECT_S = 20.0

Progress = Callable[[int, int], None]
"""Told how many of how many runs are done."""


@dataclass(frozen=True)
class Failure:
    """A run that could not be finished, and why."""

    run: int
    why: str


@dataclass(frozen=True)
class _Finished:
    """What comes back from a worker."""

    rows: list[dict[str, Any]]
    cpu_s: float
    source_sha256: str


def run_one(sweep: Sweep, key: RunKey) -> _Finished:
    """One run, where a worker does it."""
    began = time.process_time()
    rows = run_plan(plan_run(sweep, key), sweep.file.estimators, sweep.file.unit)
    return _Finished(rows, time.process_time() - began, source_digest())


def execute(
    sweep: Sweep,
    out: Path,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress = lambda done, total: None,
) -> tuple[Parts, list[Failure]]:
    """Do all runs that are not there yet.

    Parameters
    ----------
    sweep : Sweep
        What to run.
    out : Path
        Folder of the parts.
    scheduler : str, optional
        Address of a running cluster; without it processes of this machine.
    jobs : int, optional
        How many of these; the default is one per core.
    progress : callable
        Told how far it is.

    Returns
    -------
    tuple
        The parts, and the runs that failed.

    Raises
    ------
    ScenarioError
        A folder that holds another sweep; a scheduler that does not answer; workers with other code.
    """
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


@contextmanager
def connected(scheduler: str | None, jobs: int) -> Iterator[Client]:
    """A client of the cluster at an address, or of `jobs` processes of this machine; raises ScenarioError."""
    settings = {"distributed.scheduler.allowed-failures": DEATHS}
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise ScenarioError(
                f"--scheduler {scheduler}: no answer ({error}). Expected the address of a running Dask scheduler, "
                "such as tcp://10.0.0.1:8786."
            ) from error
        with client:
            yield client
        return
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=":0", memory_limit=0
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def _stream(client: Client, sweep: Sweep, todo: list[RunKey]) -> Iterator[tuple[RunKey, Future]]:
    """Runs as they finish; only so many are handed out ahead."""
    # The sweep travels with every task, some kB: scattered data would be lost with the worker that holds it.
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
    return f"{type(error).__name__}: {error}"
