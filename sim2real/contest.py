"""The contest of the candidates: every effect alone, then pairs, fitted to the fit logs and held to the hold-out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TypeVar

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from scenarios.effects import EFFECTS
from sim2real.fitting import FULL_STEPS, Candidate, Evidence, Fit, fit, loss, robust, robust_weight
from sim2real.observer import Simulation

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
T = TypeVar("T")


def silent(stage: str, done: int, total: int) -> None:
    """No progress shown."""


BEAM = 3
"""Best single effects that pairs are built on."""
PAIRS_PER_MEMBER = 3
"""Pairs that are fitted per single effect of the beam, the most promising by a linear screening."""
COUNTER = "wheel_speed_quantisation"
"""Judged by the mark that it leaves, see `sim2real.lattice`, not by residuals."""
FINALISTS = 6
"""Effects that are fitted to all fit logs with full care, after a first round on one log."""
FIRST_ROUND_STEPS = 4
"""Steps of the first round's fits."""
SWAPS_PER_MEMBER = 3
"""Partners that are tried anew for each member of the best pair."""
LINEAR_PAIRS = 4
"""Further pairs, the most promising by the slopes at the effects' own fits."""


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
    """All entries, best first within each kind."""

    null: Entry
    singles: tuple[Entry, ...]
    pairs: tuple[Entry, ...]


def hold_contest(
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """Fit every effect that acts on the car's motion or its sensors, then pairs of them where one is not enough."""
    null = Entry(
        (), None, fit_to.whitened(fit_to.residuals(model)), holdout.whitened(holdout.residuals(model))
    )
    ids = [
        key
        for key, effect in EFFECTS.items()
        if key not in exclude and effect.stage != "perception" and key != COUNTER
    ]
    one_log = fit_to.longest()
    first = run_all(
        [partial(fit, Candidate(model, (key,)), one_log, None, FIRST_ROUND_STEPS) for key in ids],
        jobs,
        progress,
        "effects, first round",
    )
    order = sorted(first, key=lambda found: found.loss)
    steps = [FULL_STEPS if rank < FINALISTS else 1 for rank in range(len(order))]
    work = [
        partial(enter, found.candidate, fit_to, holdout, found.x, count)
        for found, count in zip(order, steps, strict=True)
    ]
    singles = run_all(work, jobs, progress, "effects")
    return Contest(null, tuple(sorted(singles, key=lambda e: e.loss)), ())


def add_pairs(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with the most promising pairs fitted too."""
    entries = {e.ids[0]: e for e in contest.singles}

    def start(pair: tuple[str, ...]) -> Array:
        return np.concatenate([entries[key].fitted.x for key in pair])

    def fit_pairs(wanted: Sequence[tuple[str, ...]], stage: str) -> list[Entry]:
        work = [
            partial(enter, Candidate(model, pair), fit_to, holdout, start(pair), FULL_STEPS)
            for pair in wanted
        ]
        return run_all(work, jobs, progress, stage)

    pairs = fit_pairs(promising_pairs(contest), "pairs")
    best = min(pairs, key=lambda e: e.loss)
    pairs += fit_pairs(swapped_pairs(contest, best, {e.ids for e in pairs}, model, fit_to), "pairs, swapped")
    return Contest(contest.null, contest.singles, tuple(sorted(pairs, key=lambda e: e.loss)))


def swapped_pairs(
    contest: Contest, best: Entry, tried: Collection[tuple[str, ...]], model: Simulation, fit_to: Evidence
) -> list[tuple[str, ...]]:
    """Pairs that keep one member of the best pair, at its value in the pair, and look for another partner."""
    chosen = []
    for keep in best.ids:
        found = best.fitted
        mine = [i for i, (key, _) in enumerate(found.candidate.parameters) if key == keep]
        alone = Candidate(model, (keep,))
        z = fit_to.whitened(fit_to.residuals(alone.model(found.x[mine])))
        foretold = sorted(
            (_foretold(z, _slopes(other), found.jacobian[:, mine]), _ordered(keep, other.ids[0]))
            for other in contest.singles
            if other.ids[0] not in best.ids
        )
        chosen += [pair for _, pair in foretold if pair not in tried][:SWAPS_PER_MEMBER]
    return list(dict.fromkeys(chosen))


def promising_pairs(contest: Contest) -> list[tuple[str, ...]]:
    """Pairs by the loss that a linear model of both foretells, from the slopes at each single's fit.

    A pair is screened from either member's fit with the other's slopes, as weighted least squares on the residuals.
    """
    beam = contest.singles[:BEAM]
    chosen: list[tuple[str, ...]] = []
    for entry in beam:
        foretold = sorted(
            (_foretold(entry.z_fit, _slopes(entry), _slopes(other)), other.ids[0])
            for other in contest.singles
            if other is not entry
        )
        chosen += [_ordered(entry.ids[0], key) for _, key in foretold[:PAIRS_PER_MEMBER]]
    foretold_pairs = sorted(
        (_foretold(contest.null.z_fit, _slopes(a), _slopes(b)), _ordered(a.ids[0], b.ids[0]))
        for a, b in combinations(contest.singles, 2)
    )
    chosen += [pair for _, pair in foretold_pairs[:LINEAR_PAIRS]]
    return list(dict.fromkeys(chosen))


def _ordered(a: str, b: str) -> tuple[str, ...]:
    order = list(EFFECTS)
    return tuple(sorted((a, b), key=order.index))


def _slopes(entry: Entry) -> Array:
    return entry.fitted.jacobian


def _foretold(z: Array, *slopes: Array) -> float:
    """Loss that is left after a weighted linear fit of z on the slopes."""
    jacobian = np.concatenate(slopes, axis=1)
    weight = np.sqrt(robust_weight(z))
    step, *_ = np.linalg.lstsq(jacobian * weight[:, None], -z * weight, rcond=1e-8)
    return float(np.sum(robust(z + jacobian @ step)))


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
