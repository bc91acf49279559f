"""The verdict where effects alone explain the gap down to the noise: probabilities, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim2real.hypotheses.contest import Contest, Entry
from sim2real.hypotheses.goodness import Fitness, fitness, inflation
from sim2real.hypotheses.no_gap import is_noise
from sim2real.observing.evidence import Evidence
from sim2real.result import Interval, Verdict

Array = NDArray[np.float64]

NO_GAP_DOUBT = 0.03
"""Probability that something is left of the candidates where the misfit says there is no gap [-]."""
EXPLAINED_MISFIT = 1.5
"""Up to this misfit an entry explains everything [-]."""
PAIR_MISFIT = 1.4
"""The same of a pair: two effects bend to much, so that more is asked of them [-]."""
EXPLAINED_SHARE = 0.02
"""Where the gap is large, this share of its misfit may be left, too: no form of an effect is exact [-]."""
LIBRARY_BELIEF = 0.93
"""Probability that what explains all by itself is the cause, not the like of one that no library holds [-]."""
PAIR_LOSS = 0.7
"""Share of the best effect's loss that a pair may leave in its place [-]."""
ALONE = 0.05
"""Share of what a pair takes off the loss that the better of its effects takes alone, or they only cancel [-]."""
RIVAL = 0.1
"""A pair with more than this share of the winner's probability is not told apart from it [-]."""
RIVAL_ALONE = 0.005
"""The same of two effects that each explain the gap alone: their forms differ from nature's by more than that. On
withheld cases those that are rightly separated have a share of 1.4e-4 or less, confounders have 0.01 and more."""
SOFTNESS = 4.0
"""Tempering of the quasi-likelihood: evidence counts for less than noise alone would say [-]."""
FORM = 3e-4
"""Share of what the best entry explains that no entry is held to: the library's forms are not nature's [-]."""


def probabilities(contest: Contest, entries: list[Entry], fit_to: Evidence, holdout: Evidence) -> Array:
    """Probability of each entry, the null first: quasi-BIC on the fit logs and quasi-likelihood on the hold-out."""
    everyone = [contest.null, *entries]
    best = min(everyone, key=lambda e: e.loss)
    factor = inflation(best, fit_to, holdout)
    samples = max(np.count_nonzero(best.z_fit) / factor, 2.0)
    tempered = SOFTNESS * factor + FORM * (contest.null.loss - best.loss)
    score = np.array([-0.5 * e.loss / tempered - 0.5 * e.size * np.log(samples) for e in everyone])
    weight = np.exp(score - score.max())
    return weight / weight.sum()


@dataclass(frozen=True)
class Decision:
    """The verdict and what it rests on.

    Attributes
    ----------
    verdict : Verdict
        The outcome.
    winner : Entry
        The entry that the verdict adds; the null where it adds none.
    rivals : tuple of Entry
        Entries that cannot be told apart from the winner.
    probability : dict
        Of each single effect; what is left to 1 is "none of these".
    before, after : Fitness
        Of the null and of the best entry.
    intervals : dict
        Effect id and parameter to its interval, where the car's build was free beside the effects.
    build : dict
        How the car's build differs then, see `sim2real.discrepancy`; empty where it does not.
    """

    verdict: Verdict
    winner: Entry
    rivals: tuple[Entry, ...]
    probability: dict[str, float]
    before: Fitness
    after: Fitness
    intervals: Mapping[tuple[str, str], Interval] = field(default_factory=dict)
    build: Mapping[str, float] = field(default_factory=dict)


def decide(contest: Contest, fit_to: Evidence, holdout: Evidence) -> Decision:
    """The verdict on effects that explain the gap to the noise by themselves; `unknown` where none does."""
    before = fitness(contest.null, fit_to, holdout)
    singles = list(contest.singles)
    none, *weight = probabilities(contest, singles, fit_to, holdout)
    share = dict(zip((e.ids[0] for e in singles), weight, strict=True))
    if is_noise(contest, fit_to, holdout):
        return Decision(Verdict.NO_GAP, contest.null, (), _scaled(share, NO_GAP_DOUBT), before, before)
    if not singles:
        return Decision(Verdict.UNKNOWN, contest.null, (), {}, before, before)
    best = max(singles, key=lambda e: share[e.ids[0]])
    after = fitness(best, fit_to, holdout)
    if (
        after.misfit <= max(EXPLAINED_MISFIT, EXPLAINED_SHARE * before.misfit) and share[best.ids[0]] > none
    ):  # what is rare hardly moves the misfit
        rivals = tuple(
            e for e in singles if e is not best and share[e.ids[0]] > RIVAL_ALONE * share[best.ids[0]]
        )
        verdict = Verdict.AMBIGUOUS if rivals else Verdict.IDENTIFIED
        return Decision(verdict, best, rivals, _scaled(share, LIBRARY_BELIEF), before, after)
    return _of_two(contest, before, fit_to, holdout) or Decision(
        Verdict.UNKNOWN, best, (), _scaled(share, _belief(after)), before, after
    )


def _of_two(contest: Contest, before: Fitness, fit_to: Evidence, holdout: Evidence) -> Decision | None:
    """The verdict on the best pair; None where it does not explain the gap."""
    if not contest.pairs:
        return None
    weight = probabilities(contest, list(contest.pairs), fit_to, holdout)[1:]
    pair = contest.pairs[int(weight.argmax())]  # of equals, the one that needs fewer parameters
    after = fitness(pair, fit_to, holdout)
    if after.misfit > max(PAIR_MISFIT, EXPLAINED_SHARE * before.misfit) or not _two_are_needed(contest, pair):
        return None
    weighed = list(zip(contest.pairs, weight, strict=True))
    rivals = tuple(e for e, w in weighed if e is not pair and w > RIVAL * weight.max())
    share: dict[str, float] = {e.ids[0]: 0.0 for e in contest.singles}
    for entry, w in weighed:
        for key in entry.ids:
            share[key] += w / len(entry.ids)
    return Decision(Verdict.COMPOUND, pair, rivals, _scaled(share, LIBRARY_BELIEF), before, after)


def _two_are_needed(contest: Contest, pair: Entry) -> bool:
    """Whether a pair leaves clearly less than the best effect, and its effects do not only cancel each other."""
    null = contest.null.loss
    alone = min(e.loss for e in contest.singles if e.ids[0] in pair.ids)
    useful = null - alone >= ALONE * (null - pair.loss)
    return useful and pair.loss <= PAIR_LOSS * min(e.loss for e in contest.singles)


def _belief(after: Fitness) -> float:
    """Probability that the cause is in the library at all, from how well the best entry does [-]."""
    return float(1.0 / (1.0 + (after.misfit / EXPLAINED_MISFIT) ** 6))


def _scaled(share: dict[str, float], factor: float) -> dict[str, float]:
    return {key: float(value * factor) for key, value in share.items()}
