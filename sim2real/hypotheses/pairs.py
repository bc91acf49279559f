"""Pairs of effects: which are worth a fit, and their fits.

There are hundreds of pairs, and each fit takes long. So pairs are screened by linear models: how much would a second
effect take off what a first one leaves?
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import EFFECTS
from sim2real.hypotheses.contest import Contest, Entry, Progress, enter, run_all, silent
from sim2real.hypotheses.fitting import FULL_STEPS, Candidate
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import robust, robust_weight

Array = NDArray[np.float64]

PARTNERS, LINEAR_PAIRS = 4, 4
"""Pairs that are fitted: the best effect with its most promising partners, and any two by their slopes."""


def add_pairs(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with the most promising pairs fitted, too, best first."""
    entries = {e.ids[0]: e for e in contest.singles}
    best, *others = contest.singles
    if not others:
        return contest

    found = best.fitted
    partners = beside(found.candidate, found.x, found.jacobian, others, fit_to, jobs, progress)
    wanted = [_ordered(best.ids[0], key) for _, key in partners[:PARTNERS]]
    wanted = list(dict.fromkeys([*wanted, *_by_slopes(contest)]))
    work = [_fit_of_pair(pair, entries, model, fit_to, holdout) for pair in wanted]
    pairs = run_all(work, jobs, progress, "pairs")
    return replace(contest, pairs=tuple(sorted(pairs, key=lambda e: e.loss)))


def _by_slopes(contest: Contest) -> list[tuple[str, ...]]:
    """Pairs that leave least by a linear model of both."""
    null = contest.null.z_fit
    foretold = sorted(
        (_foretold(null, a.fitted.jacobian, b.fitted.jacobian), _ordered(a.ids[0], b.ids[0]))
        for a, b in combinations(contest.singles, 2)
    )
    return [pair for _, pair in foretold[:LINEAR_PAIRS]]


def beside(
    first: Candidate,
    x: Array,
    slopes: Array,
    others: Sequence[Entry],
    fit_to: Evidence,
    jobs: int,
    progress: Progress,
) -> tuple[tuple[float, str], ...]:
    """Loss that each of `others` promises to leave beside a first effect at x, and its id, best first.

    What an effect does beside another is tried at its starting values and at its own best; a weighted linear fit of
    these and of the first effect's slopes foretells the loss. Its own slopes would not do: fitted to what another
    effect has caused, it stands far from where it belongs. Nor would the ends of its starting values: a shaft that
    swings shows nothing of one that swings half as fast.
    """
    z = fit_to.whitened(fit_to.residuals(first.model(x)))

    def promise(other: Entry) -> tuple[float, str]:
        second = other.fitted.candidate
        both = Candidate(first.base, (*first.ids, *second.ids), (*first.forms, *second.forms))
        tried = (*second.starts, other.fitted.x)
        models = [both.model(np.concatenate([x, values])) for values in tried]
        secants = np.column_stack([fit_to.whitened(fit_to.residuals(m)) - z for m in models])
        return _foretold(z, slopes, secants), second.ids[0]

    return tuple(sorted(run_all([partial(promise, other) for other in others], jobs, progress, "partners")))


def _fit_of_pair(
    pair: tuple[str, ...], entries: dict[str, Entry], model: Simulation, fit_to: Evidence, holdout: Evidence
) -> Callable[[], Entry]:
    """The work of fitting two effects together, from where each stands alone."""
    a, b = (entries[key].fitted for key in pair)
    both = Candidate(model, pair, (*a.candidate.forms, *b.candidate.forms))
    return partial(enter, both, fit_to, holdout, _starts(entries, pair), FULL_STEPS)


def _starts(entries: dict[str, Entry], pair: tuple[str, ...]) -> Array:
    """Points to start a pair from: both as they are alone, and each so with the other at rest or on its coarse grid.

    So a pair leaves no more than its members.
    """
    a, b = (entries[key].fitted for key in pair)
    points = [(a.x, b.x), (a.x, b.candidate.neutral), (a.candidate.neutral, b.x)]
    points += [(a.x, values) for values in b.candidate.starts]
    points += [(values, b.x) for values in a.candidate.starts]
    return np.array([np.concatenate(point) for point in points])


def _ordered(a: str, b: str) -> tuple[str, ...]:
    order = list(EFFECTS)
    return tuple(sorted((a, b), key=order.index))


def _foretold(z: Array, *slopes: Array) -> float:
    """Loss that is left after a weighted linear fit of z on the slopes."""
    jacobian = np.concatenate(slopes, axis=1)
    weight = np.sqrt(robust_weight(z))
    step, *_ = np.linalg.lstsq(jacobian * weight[:, None], -z * weight, rcond=1e-8)
    return float(np.sum(robust(z + jacobian @ step)))
