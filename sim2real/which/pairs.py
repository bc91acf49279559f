"""Pairs of effects: which are worth a fit, and their fits.

There are hundreds of pairs, and each fit takes long. So pairs are screened by linear models: how much would a second
effect take off what a first one leaves?
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import EFFECTS, FORMS
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import robust, robust_weight
from sim2real.which.contest import Contest, Entry, Progress, enter, is_proper, priced, run_all, silent
from sim2real.which.fitting import FULL_STEPS, Candidate

Array = NDArray[np.float64]
Kind = tuple[tuple[str, ...], tuple[int, ...]]
"""Ids and forms of a pair."""

BEAM = 3
"""Best single effects that pairs are built on."""
PAIRS_PER_MEMBER = 3
"""Pairs that are fitted per single effect of the beam, the most promising ones."""
SWAPS_PER_MEMBER = 3
"""Partners that are tried anew for each member of the best pair."""
REFORMED, REFORMINGS = 3, 2
"""Best pairs that are fitted with one of their effects in another form, and how often: both may be of another."""
TWINS = 3
"""Partners of a plain form that are tried against one with a further parameter."""
DEEPER = 4
"""Pairs, the best ones, from whose values the best single effect is fitted again."""
LINEAR_PAIRS = 4
"""Further pairs, the most promising by the slopes at the effects' own fits."""


def add_partners(contest: Contest, fit_to: Evidence, jobs: int = 1, progress: Progress = silent) -> Contest:
    """The contest with what each other effect promises beside the best one."""
    best, *others = contest.singles
    found = best.fitted
    return replace(
        contest, partners=beside(found.candidate, found.x, found.jacobian, others, fit_to, jobs, progress)
    )


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


def add_pairs(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with the most promising pairs fitted too; needs its partners."""
    entries = {e.ids[0]: e for e in contest.singles}

    def fit_pairs(wanted: Sequence[tuple[str, ...]], stage: str) -> list[Entry]:
        work = [_fit_of_pair(pair, entries, model, fit_to, holdout) for pair in wanted]
        return run_all(work, jobs, progress, stage)

    pairs = fit_pairs(promising_pairs(contest), "pairs")
    best = min(pairs, key=lambda e: e.loss)
    again = _swapped_pairs(contest, best, {e.ids for e in pairs}, model, fit_to, jobs, progress)
    pairs += fit_pairs(again, "pairs, swapped")
    kept = _of_each(pairs)
    tried = {_kind(pair) for pair in pairs}
    for _ in range(REFORMINGS):
        others = [other for pair in kept[:REFORMED] for other in _in_other_forms(pair, tried)]
        tried |= {(candidate.ids, candidate.forms) for candidate, _ in others}
        work = [partial(enter, other, fit_to, holdout, start, FULL_STEPS) for other, start in others]
        kept = _of_each([*kept, *run_all(work, jobs, progress, "pairs, other forms")])
    return replace(contest, pairs=tuple(kept))


def _of_each(pairs: Sequence[Entry]) -> list[Entry]:
    """Each pair in the best of the forms that it was fitted in, best first."""
    kept: dict[tuple[str, ...], Entry] = {}
    for pair in sorted(filter(is_proper, pairs), key=priced):
        kept.setdefault(pair.ids, pair)
    return sorted(kept.values(), key=lambda e: e.loss)


def _kind(pair: Entry) -> Kind:
    return pair.ids, pair.fitted.candidate.forms


def _in_other_forms(pair: Entry, tried: Collection[Kind]) -> list[tuple[Candidate, Array]]:
    """A pair with one of its effects in another form that was not tried, and where its fit starts.

    The form that does best alone has bent to what the other effect causes.
    """
    found = pair.fitted
    forms = found.candidate.forms
    known = {(key, p.name): x for (key, p), x in zip(found.candidate.parameters, found.x, strict=True)}
    others = [
        Candidate(found.candidate.base, pair.ids, (*forms[:at], form, *forms[at + 1 :]))
        for at, key in enumerate(pair.ids)
        for form in range(len(FORMS[key]))
    ]

    def start(other: Candidate) -> Array:
        rest = zip(other.parameters, other.neutral, strict=True)
        return np.array([known.get((key, p.name), neutral) for (key, p), neutral in rest])

    return [(other, start(other)) for other in others if (other.ids, other.forms) not in tried]


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


def _swapped_pairs(
    contest: Contest,
    best: Entry,
    tried: Collection[tuple[str, ...]],
    model: Simulation,
    fit_to: Evidence,
    jobs: int,
    progress: Progress,
) -> list[tuple[str, ...]]:
    """Pairs that keep one member of the best pair, at its value in the pair, and look for another partner."""
    chosen = []
    found = best.fitted
    others = [e for e in contest.singles if e.ids[0] not in best.ids]
    for at, keep in enumerate(best.ids):
        mine = [i for i, (key, _) in enumerate(found.candidate.parameters) if key == keep]
        alone = Candidate(model, (keep,), (found.candidate.forms[at],))
        ranked = beside(alone, found.x[mine], found.jacobian[:, mine], others, fit_to, jobs, progress)
        pairs = [_ordered(keep, key) for _, key in ranked]
        chosen += [pair for pair in pairs if pair not in tried][:SWAPS_PER_MEMBER]
    return list(dict.fromkeys(chosen))


def promising_pairs(contest: Contest) -> list[tuple[str, ...]]:
    """Pairs by the loss that a linear model of both foretells.

    The best effect with its partners; the next ones with the slopes at the others' own fits; any two from the model as
    it is.
    """
    best, *beam = contest.singles[:BEAM]
    chosen = [_ordered(best.ids[0], key) for _, key in contest.partners[:PAIRS_PER_MEMBER]]
    for entry in beam:
        foretold = sorted(
            (_foretold(entry.z_fit, entry.fitted.jacobian, other.fitted.jacobian), other.ids[0])
            for other in contest.singles
            if other is not entry
        )
        chosen += [_ordered(entry.ids[0], key) for _, key in foretold[:PAIRS_PER_MEMBER]]
    foretold_pairs = sorted(
        (
            _foretold(contest.null.z_fit, a.fitted.jacobian, b.fitted.jacobian),
            _ordered(a.ids[0], b.ids[0]),
        )
        for a, b in combinations(contest.singles, 2)
    )
    chosen += [pair for _, pair in foretold_pairs[:LINEAR_PAIRS]]
    return list(dict.fromkeys(chosen))


def add_twins(
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """The contest with rivals of a best effect whose form has a further parameter: its plain form in pairs.

    A free difference of the axles bends as far as a second effect does, and passes for one.
    """
    best, *others = contest.singles
    key = best.ids[0]
    plain = Candidate(model, best.ids, (0,))
    count = len(plain.parameters)
    if best.size <= count or not others:
        return contest
    entry = enter(plain, fit_to, holdout, best.fitted.x[:count], FULL_STEPS)
    found = entry.fitted
    ranked = beside(plain, found.x, found.jacobian, others, fit_to, jobs, progress)
    entries = {e.ids[0]: e for e in (entry, *others)}
    work = [
        _fit_of_pair(_ordered(key, other), entries, model, fit_to, holdout) for _, other in ranked[:TWINS]
    ]
    twins = [pair for pair in run_all(work, jobs, progress, "twins") if is_proper(pair)]
    return replace(contest, twins=tuple(sorted(twins, key=lambda e: e.loss)))


def deepened(contest: Contest, fit_to: Evidence, holdout: Evidence) -> Contest:
    """The contest with the best single effect fitted again from where it stands beside others that leave less.

    A wheel that just locks, or just does not, makes steps in the loss near the limit of grip. A fit may stop at one,
    and then anything that stands beside the effect seems to be needed.
    """
    best, *others = contest.singles
    candidate = best.fitted.candidate
    ends = [
        x
        for entry in sorted((*contest.pairs, *contest.structured), key=lambda e: e.loss)
        if entry.loss < best.loss and (x := _values_of(candidate, entry)) is not None
    ]
    if not ends:
        return contest
    again = enter(candidate, fit_to, holdout, np.array([best.fitted.x, *ends[:DEEPER]]), FULL_STEPS)
    if again.loss >= best.loss:
        return contest
    return replace(contest, singles=tuple(sorted((again, *others), key=priced)))


def _values_of(candidate: Candidate, entry: Entry) -> Array | None:
    """The parameters of a single effect in an entry that holds it in the same form; None of any other."""
    other = entry.fitted.candidate
    if candidate.kinds[0] not in other.kinds:
        return None
    mine = [i for i, (key, _) in enumerate(other.parameters) if key == candidate.ids[0]]
    return np.asarray(entry.fitted.x[mine])


def _ordered(a: str, b: str) -> tuple[str, ...]:
    order = list(EFFECTS)
    return tuple(sorted((a, b), key=order.index))


def _foretold(z: Array, *slopes: Array) -> float:
    """Loss that is left after a weighted linear fit of z on the slopes."""
    jacobian = np.concatenate(slopes, axis=1)
    weight = np.sqrt(robust_weight(z))
    step, *_ = np.linalg.lstsq(jacobian * weight[:, None], -z * weight, rcond=1e-8)
    return float(np.sum(robust(z + jacobian @ step)))
