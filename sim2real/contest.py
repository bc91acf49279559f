"""The contest of the candidates: every effect alone, fitted to the fit logs and held to the hold-out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from scenarios.effects import EFFECTS, FORMS
from sim2real.evidence import Evidence
from sim2real.fitting import FULL_STEPS, Candidate, Fit, fit, loss
from sim2real.observer import Simulation

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
T = TypeVar("T")


def silent(stage: str, done: int, total: int) -> None:
    """No progress shown."""


COUNTER = "wheel_speed_quantisation"
"""Judged by the mark that it leaves, see `sim2real.lattice`, not by residuals."""
FINALISTS = 6
"""Effects that are fitted to all fit logs with full care, after a first round on one log."""
FIRST_ROUND_STEPS = 4
"""Steps of the first round's fits."""


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
        """Its effects in a word; structural ones are not blamed, and left out."""
        return "+".join(key for key in self.ids if not EFFECTS[key].structural)

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
        """Number of parameters."""
        return 0 if self.fit is None else len(self.fit.x)


@dataclass(frozen=True)
class Contest:
    """All entries, best first within each kind.

    Attributes
    ----------
    null : Entry
        The model as it is.
    singles, pairs : tuple of Entry
        See `sim2real.pairs` for the latter.
    partners : tuple of (float, str)
        What a second effect beside the best single one promises to leave of the fit logs [loss], best first.
    structured : tuple of Entry
        Single effects with a structural one beside them, see `sim2real.structure`.
    """

    null: Entry
    singles: tuple[Entry, ...]
    pairs: tuple[Entry, ...] = ()
    partners: tuple[tuple[float, str], ...] = ()
    structured: tuple[Entry, ...] = ()


def hold_contest(
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    first: Sequence[Fit],
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """Every effect alone, fitted to all fit logs from where its first round ended; each in its best form."""
    null = Entry(
        (), None, fit_to.whitened(fit_to.residuals(model)), holdout.whitened(holdout.residuals(model))
    )
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
        best.setdefault(entry.ids, entry)
    return Contest(null, tuple(entry for entry in best.values() if is_proper(entry)))


def is_proper(entry: Entry) -> bool:
    """Whether every effect of an entry is itself at its values, see `Effect.is_itself`."""
    found = entry.fitted
    return all(effect.is_itself() for effect in found.candidate.effects(found.x))


def first_round(
    model: Simulation,
    fit_to: Evidence,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> list[Fit]:
    """Every form of every effect that acts on the car's motion or its sensors, fitted roughly to one log."""
    candidates = [
        Candidate(model, (key,), (form,))
        for key, kinds in FORMS.items()
        if key not in {*exclude, COUNTER} and kinds[0].stage != "perception" and not kinds[0].structural
        for form in range(len(kinds))
    ]
    one_log = fit_to.longest()
    found = run_all(
        [partial(fit, candidate, one_log, None, FIRST_ROUND_STEPS) for candidate in candidates],
        jobs,
        progress,
        "effects, first round",
    )
    return sorted(found, key=lambda fit: fit.loss)


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
