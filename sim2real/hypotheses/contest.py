"""The contest of the candidates: every effect alone, fitted to the fit logs and held to the hold-out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from scenarios.effects import FORMS
from sim2real.hypotheses.fitting import FULL_STEPS, Candidate, Fit, fit
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import loss

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
T = TypeVar("T")


def silent(stage: str, done: int, total: int) -> None:
    """No progress shown."""


COUNTER = "wheel_speed_quantisation"
"""Judged by the mark that it leaves, see `sim2real.observing.lattice`, not by residuals."""
FINALISTS = 6
"""Effects that are fitted to all fit logs with full care, after a first round on one log."""
NEAR = 0.2
"""Share of the distance from an effect's absence to its nearest start, at which a fit begins too [-]."""
FIRST_ROUND_STEPS = 4
"""Steps of the first round's fits."""
LARGER_LOSS = 3.0
"""The first round is held on the longest log, unless the model as it is leaves so many times its loss on another: the
gap then lies there, and what the longest does not excite would never be fitted [-]."""


@dataclass(frozen=True)
class Entry:
    """A candidate with its fit and what it leaves on the hold-out.

    Attributes
    ----------
    ids : tuple of str
        Its effects; empty for the model as it is.
    fit : Fit or None
        None for the model as it is.
    z_fit, z_hold : array
        Whitened residuals on the fit logs and on the hold-out.
    loss_fit, loss_hold : float
        Their losses.
    """

    ids: tuple[str, ...]
    fit: Fit | None
    z_fit: Array
    z_hold: Array

    @property
    def name(self) -> str:
        """Its effects in a word."""
        return "+".join(self.ids)

    @property
    def loss_fit(self) -> float:
        """Loss on the fit logs."""
        return loss(self.z_fit)

    @property
    def loss_hold(self) -> float:
        """Loss on the hold-out."""
        return loss(self.z_hold)

    @property
    def loss(self) -> float:
        """Loss on all logs."""
        return self.loss_fit + self.loss_hold

    @property
    def fitted(self) -> Fit:
        """The fit, of an entry that has one."""
        assert self.fit is not None, "the model as it is has no fit"
        return self.fit

    @property
    def size(self) -> int:
        """Number of parameters that logs can tell."""
        return 0 if self.fit is None else sum(np.isfinite(self.fit.candidate.open_share))


@dataclass(frozen=True)
class Contest:
    """All entries, best first within each kind: the model as it is, single effects, pairs of them."""

    null: Entry
    singles: tuple[Entry, ...]
    pairs: tuple[Entry, ...] = ()


def hold_contest(
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    first: Sequence[Fit],
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """Every effect alone, fitted to all fit logs from where its first round ended; each in its best form."""
    null = as_it_is(model, fit_to, holdout)
    finalists = list(dict.fromkeys(found.candidate.ids for found in first))[:FINALISTS]
    work = [
        partial(
            enter,
            found.candidate,
            fit_to,
            holdout,
            found.x,
            FULL_STEPS if found.candidate.ids in finalists else 1,
        )
        for found in first
    ]
    best: dict[tuple[str, ...], Entry] = {}
    for entry in sorted(run_all(work, jobs, progress, "effects"), key=lambda e: e.loss):
        if entry.fitted.candidate.is_proper(entry.fitted.x):
            best.setdefault(entry.ids, entry)
    return Contest(null, tuple(best.values()))


def first_round(
    model: Simulation,
    fit_to: Evidence,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> list[Fit]:
    """Effects of motion and sensors, in forms of no more parameters than the first, fitted roughly to one log."""
    one_log = _log_of_first_round(model, fit_to)
    candidates = [
        Candidate(model, (key,), (form,))
        for key, kinds in FORMS.items()
        if key not in {*exclude, COUNTER} and kinds[0].stage != "perception" and not kinds[0].structural
        for form, kind in enumerate(kinds)
        if len(kind.parameters()) == len(kinds[0].parameters())
    ]
    work = [partial(fit, c, one_log, _near_and_far(c), FIRST_ROUND_STEPS) for c in candidates]
    return sorted(run_all(work, jobs, progress, "effects, first round"), key=lambda found: found.loss)


def _log_of_first_round(model: Simulation, fit_to: Evidence) -> Evidence:
    """The log that the first round is held on."""
    logs = fit_to.each()
    longest = max(range(len(logs)), key=lambda i: len(logs[i].drives[0]))
    losses = [loss(log.whitened(log.residuals(model))) for log in logs]
    most = int(np.argmax(losses))
    return logs[most if losses[most] > LARGER_LOSS * losses[longest] else longest]


def _near_and_far(candidate: Candidate) -> Array:
    """A candidate's coarse grid and, of a single parameter, points nearer to its absence: small gaps need them."""
    far = candidate.starts
    if far.shape[1] > 1:
        return far
    offsets = far[:, 0] - candidate.neutral[0]
    sides = [side for side in (offsets[offsets > 0.0], offsets[offsets < 0.0]) if len(side)]
    near = [candidate.neutral[0] + NEAR * side[np.argmin(np.abs(side))] for side in sides]
    return np.concatenate([np.reshape(near, (-1, 1)), far])


def as_it_is(model: Simulation, fit_to: Evidence, holdout: Evidence) -> Entry:
    """The entry of a model to which nothing is fitted."""
    left_fit, left_hold = (e.whitened(e.residuals(model)) for e in (fit_to, holdout))
    return Entry((), None, left_fit, left_hold)


def enter(candidate: Candidate, fit_to: Evidence, holdout: Evidence, start: Array, steps: int) -> Entry:
    """Fit a candidate from a start, and hold it to the hold-out."""
    found = fit(candidate, fit_to, start, steps)
    return Entry(candidate.ids, found, found.z, holdout.whitened(holdout.residuals(candidate.model(found.x))))


def run_all(work: Sequence[Callable[[], T]], jobs: int, progress: Progress, stage: str) -> list[T]:
    """Results in order; the compiled step releases the interpreter's lock, so threads do."""
    results = []
    for result in Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(
        delayed(job)() for job in work
    ):
        results.append(result)
        progress(stage, len(results), len(work))
    return results
