"""From the contest to a verdict: probabilities, what cannot be told apart, the gates of `unknown`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim2real.observing.evidence import Evidence
from sim2real.result import Interval, Verdict
from sim2real.which.contest import Contest, Entry, Varied
from sim2real.which.goodness import Fitness, fitness, inflation, loss_beyond_noise, noise_margin
from sim2real.which.quiet import NO_GAP_MISFIT, is_noise, rare_share

Array = NDArray[np.float64]

NO_GAP_DOUBT = 0.03
"""Probability that something is left of the candidates where the misfit says there is no gap [-]."""
EXPLAINED_MISFIT = 1.5
"""Up to this misfit an entry explains everything [-]."""
EXPLAINED_SHARE = 0.125
"""Where the gap is large, an entry explains it if it leaves this share of the misfit: no form is exact [-]."""
EXPLAINED_MOST = 3.0
"""Beyond this misfit nothing is explained, whatever the gap was [-]."""
FURTHER_BELIEF = 0.8
"""Probability that one effect is the cause though something beside it is left [-]."""
LIBRARY_BELIEF = 0.93
"""Probability that what explains all by itself is the cause, not the like of one that no library holds [-]."""
PAIR_LEAVES = 0.5
"""A pair is taken in place of one effect only where it at least halves the misfit, or the loss beyond noise [-]."""
ALONE = 0.05
"""Share of what a pair takes off the loss that the better of its effects takes alone, at least [-]."""
PAIR_LOSS = 0.7
"""Share of the best effect's loss that a pair may leave in its place [-]."""
PAIR_MISFIT = 1.4
"""Up to this misfit a pair explains everything: two effects bend to much, so that more is asked of them [-]."""
PAIR_SHARE, PAIR_MOST = 0.06, 6.0
"""As `EXPLAINED_SHARE` and `EXPLAINED_MOST`, for a pair: two inexact forms leave more than one [-]."""
MAJOR = 0.5
"""An effect that a structural difference stands beside takes alone at least this share of what both take [-]."""
RIVAL = 0.1
"""An entry with more than this share of the winner's probability is not told apart from it [-]."""
RIVAL_ALONE = 0.005
"""The same of two effects that each explain the gap alone: their forms differ from nature's by more than that. On
withheld cases those that are told apart rightly have a share of 1.4e-4 or less, look-alikes have 0.01 and more."""
SOFTNESS = 4.0
"""Tempering of the quasi-likelihood: evidence counts for less than noise alone would say [-]."""
FORM = 3e-4
"""Share of what the best entry explains that no entry is held to: the library's forms are not nature's [-]."""
MOTION_SHARE = 0.95
"""A term of a few values over the car's motion that takes this share of what a varying effect does is the cause [-]."""
INSTEAD_SHARE = 0.8
"""One without any effect that does this much of it, too: the effect was never needed [-]."""
LONE_BELIEF = 0.2
"""Probability that an effect of the library is the cause though a fault outside it explains more [-]."""
RARE_LEFT = 0.5
"""Share of the blocks far beyond noise that an effect may leave where nothing else speaks of a gap [-]."""
FLOOR_MISFIT = 1.5
"""Above this misfit an entry is worth a second effect's try [-]."""


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


def explains(after: Fitness, before: Fitness) -> bool:
    """Whether what is left is noise, or small against the gap."""
    return after.misfit <= allowed(before)


def pair_explains(after: Fitness, before: Fitness) -> bool:
    """The same of two effects."""
    return after.misfit < max(PAIR_MISFIT, min(PAIR_SHARE * before.misfit, PAIR_MOST))


def allowed(before: Fitness) -> float:
    """The greatest misfit that an entry may leave and still explain the gap [-]."""
    return max(EXPLAINED_MISFIT, min(EXPLAINED_SHARE * before.misfit, EXPLAINED_MOST))


def needs_pairs(contest: Contest, fit_to: Evidence, holdout: Evidence) -> bool:
    """Whether one effect is not enough; of a contest with partners."""
    if len(contest.singles) < 2:
        return False
    best = contest.singles[0]
    if fitness(best, fit_to, holdout).misfit > FLOOR_MISFIT:
        return True
    least = min((loss for loss, _ in contest.partners), default=best.loss_fit)
    return best.loss_fit - least > noise_margin(best, fit_to, holdout)


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
    varied : Varied or None
        How the winner's parameters vary, where they do.
    left_open : float
        Share of the hold-out's gap that the winner leaves, where that is why it is not blamed, see
        `sim2real.which.closure`.
    curve : str
        The free curve that does the winner's work as well, where that is why it is not blamed, see
        `sim2real.which.law`.
    further : bool
        Whether only what the winner's form adds to its effect is needed, and that is why it is not blamed.
    rare : float
        Share of the logs' time that lies far beyond noise, where the rest does not [-].
    fast : bool
        Whether the gap is one of rows alone, which averages out within a block.
    slight : str
        What was found and is not blamed, as every log's residual is at its noise floor.
    wandering : tuple of str
        Signals whose sensors wander by themselves, where that is all the gap there is, see `sim2real.which.wander`.
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
    varied: Varied | None = None
    left_open: float = 0.0
    curve: str = ""
    further: bool = False
    rare: float = 0.0
    fast: bool = False
    slight: str = ""
    wandering: tuple[str, ...] = ()
    intervals: Mapping[tuple[str, str], Interval] = field(default_factory=dict)
    build: Mapping[str, float] = field(default_factory=dict)


def decide(contest: Contest, fit_to: Evidence, holdout: Evidence) -> Decision:
    """Verdict of a contest; what one wheel alone explains better is no effect of the whole car.

    Nor is an effect blamed that leaves most of what is rare where nothing else speaks of a gap.
    """
    said = _decide(contest, fit_to, holdout)
    if said.before.misfit <= NO_GAP_MISFIT:
        said = replace(said, rare=rare_share(contest.null, fit_to, holdout))
    if said.verdict in (Verdict.NO_GAP, Verdict.UNKNOWN):
        return said
    if said.rare and rare_share(said.winner, fit_to, holdout) > RARE_LEFT * said.rare:
        return doubted(said, LONE_BELIEF)
    margin = noise_margin(said.winner, fit_to, holdout)
    if contest.lone > said.winner.loss - margin:
        return said
    return doubted(said, LONE_BELIEF)


def doubted(decision: Decision, belief: float, **why: Any) -> Decision:
    """The decision as `unknown`, with this share of its probabilities; `why` are its fields that tell the reason."""
    probability = _scaled(decision.probability, belief)
    return replace(decision, verdict=Verdict.UNKNOWN, rivals=(), probability=probability, **why)


def _decide(contest: Contest, fit_to: Evidence, holdout: Evidence) -> Decision:
    before = fitness(contest.null, fit_to, holdout)
    singles = list(contest.singles)
    weight = probabilities(contest, singles, fit_to, holdout)
    share = dict(zip((e.ids[0] for e in singles), weight[1:], strict=True))
    if is_noise(contest, fit_to, holdout):
        return Decision(Verdict.NO_GAP, contest.null, (), _scaled(share, NO_GAP_DOUBT), before, before)
    if not singles:
        return Decision(Verdict.UNKNOWN, contest.null, (), {}, before, before)
    best = max(singles, key=lambda e: share[e.ids[0]])
    after = fitness(best, fit_to, holdout)
    compound = _of_two(contest, best, after, before, fit_to, holdout)
    if compound:
        return compound
    structured = _structured(contest, before, fit_to, holdout)
    if structured:
        return structured
    if not explains(after, before):
        varied = _varying(contest, before, fit_to, holdout)
        if varied:
            return varied
        return Decision(Verdict.UNKNOWN, best, (), _scaled(share, _belief(after, before)), before, after)
    rivals = [e for e in singles if e is not best and share[e.ids[0]] > RIVAL_ALONE * share[best.ids[0]]]
    belief = _belief(after, before)
    further = _further(contest, best, fit_to, holdout)
    rivals += further
    belief *= FURTHER_BELIEF if further else LIBRARY_BELIEF
    verdict = Verdict.AMBIGUOUS if rivals else Verdict.IDENTIFIED
    return Decision(verdict, best, tuple(rivals), _scaled(share, belief), before, after)


def _further(contest: Contest, best: Entry, fit_to: Evidence, holdout: Evidence) -> list[Entry]:
    """Pairs that say that the best single effect may not be all, or not be it.

    One that fits so much better, or ones of its plain form that fit about as well as its form with a further parameter.
    """
    margin = noise_margin(best, fit_to, holdout)
    better = [pair for pair in contest.pairs[:1] if best.loss - pair.loss > margin]
    return better + [pair for pair in contest.twins if pair.loss - best.loss < margin]


def _of_two(
    contest: Contest, best: Entry, alone: Fitness, before: Fitness, fit_to: Evidence, holdout: Evidence
) -> Decision | None:
    """The verdict on the best pair; None where it does not explain the gap, or one effect does as well.

    `alone` is what the best single effect leaves.
    """
    if not contest.pairs:
        return None
    weight = probabilities(contest, list(contest.pairs), fit_to, holdout)[1:]
    pair = contest.pairs[int(weight.argmax())]  # of equals, the one that needs fewer parameters
    after = fitness(pair, fit_to, holdout)
    if not pair_explains(after, before) or _cancel(contest, pair):
        return None
    if not takes_two(best, pair, alone, after, explains(alone, before)):
        return None
    if _a_curve_does(contest, pair, fit_to, holdout):
        return None
    weighed = list(zip(contest.pairs, weight, strict=True))
    rivals = tuple(e for e, w in weighed if e is not pair and w > RIVAL * weight.max())
    share: dict[str, float] = {e.ids[0]: 0.0 for e in contest.singles}
    for entry, w in weighed:
        for key in entry.ids:
            share[key] += w / len(entry.ids)
    return Decision(Verdict.COMPOUND, pair, rivals, _scaled(share, _belief(after, before)), before, after)


def _structured(contest: Contest, before: Fitness, fit_to: Evidence, holdout: Evidence) -> Decision | None:
    """The verdict on an effect beside a structural difference; None where that is not needed, or not enough."""
    if not contest.structured:
        return None
    entries = [*contest.structured, *contest.pairs]
    weight = probabilities(contest, entries, fit_to, holdout)[1:]
    of = dict(zip((e.ids for e in entries), map(float, weight), strict=True))
    best = max(contest.structured, key=lambda e: of[e.ids])
    beside = fitness(best, fit_to, holdout)
    alone = next(e for e in contest.singles if e.ids[0] == best.ids[0])
    needed = alone.loss - best.loss > noise_margin(best, fit_to, holdout)
    among = sum(of[e.ids] for e in contest.structured)  # 0 where pairs fit better beyond measure
    outdone = any(of[e.ids] * RIVAL > of[best.ids] and two_are_needed(contest, e) for e in contest.pairs)
    if not (among and needed and _is_needed(contest, best) and explains(beside, before)) or outdone:
        return None
    rivals = tuple(e for e in entries if e is not best and of[e.ids] > RIVAL * of[best.ids])
    share = {e.ids[0]: 0.0 for e in contest.singles}
    share |= {e.ids[0]: of[e.ids] / among for e in contest.structured}
    verdict = Verdict.AMBIGUOUS if rivals else Verdict.IDENTIFIED
    belief = _belief(beside, before) * FURTHER_BELIEF
    return Decision(verdict, best, rivals, _scaled(share, belief), before, beside)


def _varying(contest: Contest, before: Fitness, fit_to: Evidence, holdout: Evidence) -> Decision | None:
    """The verdict on an effect that is not the same everywhere; None where that does not explain the gap either.

    A term over the car's motion that does as well beside a constant, or nearly so in its place, says that it is another
    effect.
    """
    able = [v for v in contest.varied if explains(fitness(v.entry, fit_to, holdout), before)]
    if not able:
        return None
    best = able[0]
    every = (*contest.singles, *contest.structured, *contest.pairs)
    winner = next(e for e in every if e.ids == best.entry.ids)
    if not _is_needed(contest, winner):
        return None
    gained = winner.loss - best.entry.loss
    if winner.loss - contest.motion > MOTION_SHARE * gained:
        return None
    if winner.loss - contest.instead > INSTEAD_SHARE * gained:
        return None
    tempered = SOFTNESS * inflation(best.entry, fit_to, holdout) + FORM * (
        contest.null.loss - best.entry.loss
    )
    weight: dict[str, float] = {e.ids[0]: 0.0 for e in contest.singles}
    for v in contest.varied:
        key = v.entry.ids[0]
        weight[key] = max(weight[key], float(np.exp(0.5 * (best.cost - v.cost) / tempered)))
    total = sum(weight.values())
    after = fitness(best.entry, fit_to, holdout)
    belief = _belief(after, before) * FURTHER_BELIEF
    if winner in contest.pairs:
        share = {key: 0.5 * belief if key in winner.ids else 0.0 for key in weight}
        return Decision(Verdict.COMPOUND, winner, (), share, before, after, best)
    rivals = tuple(e for e in contest.singles if e.ids[0] != winner.ids[0] and weight[e.ids[0]] > RIVAL)
    share = {key: belief * value / total for key, value in weight.items()}
    verdict = Verdict.AMBIGUOUS if rivals else Verdict.IDENTIFIED
    return Decision(verdict, winner, rivals, share, before, after, best)


def two_are_needed(contest: Contest, pair: Entry, leaves: float = PAIR_LEAVES) -> bool:
    """Whether a pair leaves at most this share of the loss that the best effect leaves, and does not only cancel."""
    return pair.loss <= leaves * min(e.loss for e in contest.singles) and not _cancel(contest, pair)


def _cancel(contest: Contest, pair: Entry) -> bool:
    """Whether neither of two effects does anything alone: together they only undo each other in most signals."""
    null = contest.null.loss
    alone = min(e.loss for e in contest.singles if e.ids[0] in pair.ids)
    return null - alone < ALONE * (null - pair.loss)


def _a_curve_does(contest: Contest, pair: Entry, fit_to: Evidence, holdout: Evidence) -> bool:
    """Whether one of two effects leaves clearly less beside another curve of the tyres than beside the other."""
    margin = noise_margin(pair, fit_to, holdout)
    return any(e.ids[0] in pair.ids and e.loss < pair.loss - margin for e in contest.structured)


def takes_two(best: Entry, pair: Entry, after: Fitness, paired: Fitness, explained: bool) -> bool:
    """Whether a pair does so much better than the best single effect that it is taken in its place.

    It halves the misfit or the loss beyond noise, or takes a fair share of all loss, which may be noise that was read
    too small; where one explains all by itself it does both, as the second may be no more than how the first differs
    from the library's form.
    """
    halves = paired.misfit < PAIR_LEAVES * after.misfit
    halves |= loss_beyond_noise(pair) <= PAIR_LEAVES * loss_beyond_noise(best)
    less = pair.loss <= PAIR_LOSS * best.loss
    return halves and less if explained else halves or less


def _is_needed(contest: Contest, entry: Entry) -> bool:
    """Whether the effect beside a structural one does most of the work, and the second of two is worth its place."""
    if entry in contest.pairs:
        return two_are_needed(contest, entry, PAIR_LOSS)
    if entry in contest.structured:
        alone = next(e for e in contest.singles if e.ids[0] == entry.ids[0])
        return contest.null.loss - alone.loss >= MAJOR * (contest.null.loss - entry.loss)
    return True


def _belief(after: Fitness, before: Fitness) -> float:
    """Probability that the cause is in the library at all, from how well the best entry does [-]."""
    return float(1.0 / (1.0 + (after.misfit / allowed(before)) ** 6))


def _scaled(share: dict[str, float], factor: float) -> dict[str, float]:
    return {key: float(value * factor) for key, value in share.items()}
