"""Runs of a unit over logs: in parallel processes, with a time limit, none twice."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.effects import Effect
from scenarios.errors import ScenarioError
from sim2real.hypotheses.contest import Progress, run_all, silent
from sim2real.logs import Log, log_of_frame, with_way
from sim2real.logs.contract import COLUMNS
from sim2real.logs.errors import LogError
from sim2real.own_model.signals import TORQUES, Signals
from sim2real.own_model.unit import OpenedUnit
from trpac_core.files import quoted

Array = NDArray[np.float64]

MOST_RUNS = 60
"""Runs of a unit that a diagnosis may take."""
LIMIT_S = 120.0
"""Longest time that a run may take [s]."""
FINEST_S, COARSEST_S = 0.004, 0.005
"""Shortest and longest communication step: logs are analysed at 125 Hz, and stiff tyres want small steps [s]."""
LEAD_S, USED_S = 3.0, 4.0
"""A unit that drifts from the log begins anew from it: each stretch runs before it counts, three times the observer's
memory of 1 s, and then counts for so long [s]."""
BEGIN_S = 0.1
"""It begins with the line through what was measured for so long before and after [s]."""
LONGEST_WORDS = 300
"""Characters of a unit's own words in a message."""


@dataclass(frozen=True)
class Run:
    """One run that is wanted: over a log's torques, with parameters changed and effects around the unit.

    Attributes
    ----------
    log : Log
        Whose torques and beginning it has.
    changed : mapping
        Parameters of the unit to other values than nominal.
    effect : Effect or None
        Changes the torque before the unit, and what the sensors make of its outputs.
    """

    log: Log
    changed: Mapping[str, float] = field(default_factory=dict)
    effect: Effect | None = None


class OwnModel:
    """A unit with its signals file, run over logs.

    Parameters
    ----------
    unit : OpenedUnit
        The unit.
    signals : Signals
        Its signals file.
    jobs : int
        Processes at a time.
    progress : callable
        Told how many of how many runs are done.
    """

    def __init__(
        self, unit: OpenedUnit, signals: Signals, jobs: int = 1, progress: Progress = silent
    ) -> None:
        self.unit, self.signals = unit, signals
        self._jobs, self._progress = jobs, progress
        self._known: dict[str, Array] = {}

    @property
    def runs(self) -> int:
        """Runs that were taken so far."""
        return len(self._known)

    def nominal(self, name: str) -> float:
        """Nominal value of a tunable parameter, in its unit."""
        nominal = self.signals.parameters[name].nominal
        if nominal is not None:
            return nominal
        return float(self.signals.start[name]) if name in self.signals.start else self.unit.start_of(name)

    def simulate(self, runs: Sequence[Run]) -> list[tuple[Stretch, ...]]:
        """What the unit records over these runs, in order, each in stretches that follow each other.

        Raises
        ------
        ScenarioError
            A run fails, takes too long or gives no numbers, or there are more than `MOST_RUNS`.
        """
        jobs = [self._job(run) for run in runs]
        new = {key: job for key, job in jobs if key not in self._known}
        self.require(self.runs + len(new))
        work: list[Callable[[], Array]] = [partial(self._run, job) for job in new.values()]
        self._known |= zip(new, run_all(work, self._jobs, self._progress, "your model"), strict=True)
        pairs = zip(runs, jobs, strict=True)
        return [self._recorded(run, job, self._known[key]) for run, (key, job) in pairs]

    def require(self, count: int) -> None:
        """Raise ScenarioError where so many runs are too many."""
        if count > MOST_RUNS:
            raise ScenarioError(
                f"{quoted(self.signals.path)}: {count} runs of {quoted(self.unit.path.name)} are needed; expected at "
                f"most {MOST_RUNS}: one per log, one per log and parameter, a few to confirm. Leave out some of them."
            )

    def _job(self, run: Run) -> tuple[str, _Job]:
        log = run.log
        step_s = max(1.0 / log.rate_hz, FINEST_S)
        step_s /= np.ceil(step_s / COARSEST_S - 1e-9)
        count = int((log.time_s[-1] - log.time_s[0]) / step_s + 1e-6) + 1
        time_s = log.time_s[0] + step_s * np.arange(count)
        torque = np.column_stack([_filled(log.time_s, log.signals[name], time_s) for name in TORQUES])
        driven = torque if run.effect is None else run.effect.actuate(time_s, torque)
        held = np.concatenate((0.5 * (driven[1:] + driven[:-1]), driven[-1:]))  # the mean over each step
        inputs = np.column_stack([given.of(held) for given in self.signals.inputs.values()])
        job = _Job(log, time_s, torque, step_s, inputs, self._stretches(run, time_s))
        told = [[(p.rows.start, p.rows.stop, sorted(p.start.items())) for p in job.parts], self.signals.read]
        said = json.dumps([told, step_s], default=str).encode()
        return hashlib.sha256(self.unit.sha256.encode() + said + inputs.tobytes()).hexdigest(), job

    def _stretches(self, run: Run, time_s: Array) -> tuple[_Part, ...]:
        """Where the unit begins anew from the log: once where it cannot be told how fast the car is."""
        log, columns = run.log, run.log.signals
        if run.effect is not None:
            columns = run.effect.correct(log.time_s, columns)
        fixed = {**self.signals.start, **self._nominal()}
        known = {initial.signal for initial in self.signals.initial.values()}
        borders = [float(time_s[0])]
        if "vehicle_speed_m_s" in known:
            borders += list(np.arange(time_s[0] + LEAD_S + USED_S, time_s[-1] - 0.5 * USED_S, USED_S))
        found: list[tuple[float, float, dict[str, float]]] = []
        for from_s in borders:
            at_s = max(from_s - LEAD_S, float(time_s[0]))
            begun = self._begin(log, columns, at_s)
            if begun is not None:
                found.append((from_s, at_s, begun))
            elif not found:
                raise LogError(
                    f"{log.path}: {', '.join(sorted(known))} have no values in the first {BEGIN_S:g} s, and your "
                    "model starts with them; expected a log that starts with them, or values under `start`."
                )
        ends = [from_s for from_s, _, _ in found[1:]] + [np.inf]
        return tuple(
            _Part(
                slice(*np.searchsorted(time_s, (at_s - 1e-9, end + 1e-9)).tolist()),
                from_s,
                {**fixed, **begun, **run.changed},
            )
            for (from_s, at_s, begun), end in zip(found, ends, strict=True)
        )

    def _nominal(self) -> dict[str, float]:
        return {k: p.nominal for k, p in self.signals.parameters.items() if p.nominal is not None}

    def _begin(self, log: Log, columns: Mapping[str, Array], at_s: float) -> dict[str, float] | None:
        """Variables that begin with what the log says at a time; None where it does not say all of it."""
        begun = {}
        for name, initial in self.signals.initial.items():
            known = _at(log.time_s, columns[initial.signal], at_s) if initial.signal in columns else None
            if known is None:
                return None
            begun[name] = float(initial.scaled(np.array(known), COLUMNS[initial.signal].unit))
        return begun

    def _run(self, job: _Job) -> Array:
        """Outputs of a run, shape (n, outputs); raises ScenarioError."""
        with tempfile.TemporaryDirectory(prefix="trpac-own-") as place:
            folder, outputs = Path(place), self.signals.read
            np.save(folder / "inputs.npy", np.concatenate([job.inputs[p.rows] for p in job.parts]))
            told: dict[str, object] = {"unit": str(self.unit.folder), "inputs": list(self.signals.inputs)}
            told |= {"outputs": outputs, "step_s": job.step_s}
            told["stretches"] = [{"rows": p.rows.stop - p.rows.start, "start": p.start} for p in job.parts]
            (folder / "job.json").write_text(json.dumps(told), encoding="utf-8")
            command = [sys.executable, "-m", "sim2real.own_model.worker", place]
            try:
                done = subprocess.run(command, capture_output=True, timeout=LIMIT_S, check=False)
            except subprocess.TimeoutExpired:
                raise self._error(
                    job, f"a run takes more than {LIMIT_S:g} s. Give a faster unit or shorter logs"
                ) from None
            failed, result = folder / "error.json", folder / "outputs.npy"
            if failed.is_file():
                why = json.loads(failed.read_text(encoding="utf-8"))
                at = f"{job.at_s[min(why['row'], len(job.at_s) - 1)]:.4g} s"
                raise self._error(job, f"it fails after {at}: {quoted(why['text'], LONGEST_WORDS)}", done)
            if not result.is_file():
                raise self._error(job, f"its process ended with code {done.returncode}", done)
            values = np.asarray(np.load(result), dtype=np.float64)
        if not np.isfinite(values).all():
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise self._error(job, f"{outputs[int(column)]} is no number from {job.at_s[row]:.4g} s on")
        return values

    def _error(
        self, job: _Job, what: str, done: subprocess.CompletedProcess[bytes] | None = None
    ) -> ScenarioError:
        said = b"" if done is None else done.stderr or done.stdout
        words = quoted(" ".join(said.decode(errors="replace").split())[-LONGEST_WORDS:])
        return ScenarioError(
            f"{quoted(self.unit.path)} over {job.log.name}: {what}; expected outputs over the whole log. Run it over "
            "the log's torques in your own tool first." + (f" Its own words: {words}" if words else "")
        )

    def _recorded(self, run: Run, job: _Job, outputs: Array) -> tuple[Stretch, ...]:
        """What a run recorded, in the log format, as the log's sensors would have."""
        found, at = [], 0
        for part in job.parts:
            count = part.rows.stop - part.rows.start
            columns = {"time_s": job.time_s[part.rows]}
            columns |= dict(zip(TORQUES, job.torque_nm[part.rows].T, strict=True))
            columns |= dict(zip(self.signals.read, outputs[at : at + count].T, strict=True))
            name = f"{self.unit.path.name} over {job.log.name}"
            made = with_way(log_of_frame(pd.DataFrame(columns), self.signals.outputs, name))
            if run.effect is not None:
                made = replace(made, signals=run.effect.sense(made.time_s, made.signals))
            found.append(Stretch(made, part.from_s))
            at += count
        return tuple(found)


@dataclass(frozen=True)
class Stretch:
    """A part of a run: its log, which begins before the time from which on it counts [s]."""

    log: Log
    from_s: float


@dataclass(frozen=True)
class _Part:
    """Rows of a job in which the unit runs on from a beginning, and from when on they count [s]."""

    rows: slice
    from_s: float
    start: dict[str, bool | int | float | str]


@dataclass(frozen=True)
class _Job:
    """A run as the unit sees it, on its communication steps."""

    log: Log
    time_s: Array
    torque_nm: Array
    step_s: float
    inputs: Array
    parts: tuple[_Part, ...]

    @property
    def at_s(self) -> Array:
        """Times of the parts' rows behind each other [s]."""
        return np.concatenate([self.time_s[p.rows] for p in self.parts])


def _filled(time_s: Array, values: Array, at_s: Array) -> Array:
    known = np.isfinite(values)
    return np.interp(at_s, time_s[known], values[known])


def _at(time_s: Array, values: Array, at_s: float) -> float | None:
    """A signal at a time by the line through the samples around it; None where there are too few."""
    rows = np.isfinite(values) & (np.abs(time_s - at_s) <= BEGIN_S)
    if rows.sum() < 3:
        return None
    return float(np.polyfit(time_s[rows] - at_s, values[rows], 1)[1])
