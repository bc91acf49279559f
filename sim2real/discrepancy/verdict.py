"""From the posterior over hypotheses beside another build to a decision with entries that a report can tell of."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sim2real.discrepancy.beside import (
    FREE,
    TEMPER,
    Hypothesis,
    Stack,
    fit_beside,
    fit_pairs,
    hypotheses,
    other_faults,
    scale_of_build,
    stack_of,
    with_tyre,
)
from sim2real.discrepancy.posterior import Judged, judge
from sim2real.discrepancy.ridge import Scale, solve, weighed
from sim2real.hypotheses.contest import Contest, Entry, Progress, silent
from sim2real.hypotheses.fitting import Fit, slopes
from sim2real.hypotheses.goodness import fitness
from sim2real.hypotheses.selection import LIBRARY_BELIEF, Decision
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import loss
from sim2real.result import NORMAL_95, Interval, Verdict

Array = NDArray[np.float64]


def beside_another_build(
    decision: Decision,
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    baseline: Evidence | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> tuple[Contest, Decision]:
    """Contest and decision with the car's build free; unchanged if no effect is named then.

    Parameters
    ----------
    decision, contest : Decision, Contest
        What the effects alone say.
    model : Simulation
        The car as simulated.
    fit_to, holdout : Evidence
        The logs.
    baseline : Evidence, optional
        Logs of the same car without the fault.
    jobs, progress : int, callable
        Threads; told the stage and how much of how much is done.
    """
    stack = stack_of(model, fit_to, holdout, baseline)
    scale = scale_of_build(stack)
    singles = hypotheses(stack, contest.singles, scale, jobs, progress)
    stack = with_tyre(stack, singles)
    singles = [h for h in singles if h.candidate.is_proper(h.x)]
    if not singles:
        return contest, decision
    found = judge(
        stack,
        scale,
        singles,
        partial(fit_pairs, stack, singles, scale, jobs, progress),
        partial(other_faults, stack),
    )
    if found.verdict is Verdict.UNKNOWN:
        return contest, decision
    fit_logs = stack.of_fit_logs(len(fit_to.drives))
    own_scale = scale_of_build(fit_logs)
    told = [_told(fit_logs, own_scale, h) for h in found.named]
    entries = [_entry(h, fit_to, holdout) for h, _ in told]
    after = fitness(entries[0], fit_to, holdout)
    first = entries[0].fitted
    if after.misfit >= decision.before.misfit or first.candidate.at_bound(first.x):
        return contest, decision  # it only bends what the build does
    names = {entry.ids for entry in entries}
    others = tuple(e for e in contest.singles if e.ids not in names)
    alone = tuple(e for e in entries if len(e.ids) == 1)
    contest = replace(contest, singles=(*alone, *others))
    share = dict.fromkeys((e.ids[0] for e in contest.singles), 0.0)
    for key, value in _believed(found).items():
        share[key] = LIBRARY_BELIEF * value
    return contest, Decision(
        found.verdict,
        entries[0],
        tuple(entries[1:]),
        share,
        decision.before,
        after,
        intervals={name: interval for _, of_one in told for name, interval in of_one.items()},
        build=dict(found.structure),
    )


def _believed(found: Judged) -> dict[str, float]:
    """Probabilities of the effects; those that cannot be told apart have equal ones, as the two of a compound."""
    if found.verdict is Verdict.COMPOUND:
        return dict.fromkeys(found.named[0].ids, 0.5)
    alike = [h.ids[0] for h in found.named]
    mean = sum(found.probability[key] for key in alike) / len(alike)
    return {**found.probability, **dict.fromkeys(alike, mean)}


def _told(stack: Stack, scale: Scale, h: Hypothesis) -> tuple[Hypothesis, dict[tuple[str, str], Interval]]:
    """A hypothesis fitted to the fit logs alone, and the intervals of its parameters with the build free."""
    found = fit_beside(stack, h.candidate, [h.x], scale)
    both = np.concatenate([stack.build, found.slopes], axis=-1)
    temper, count = scale.memory * TEMPER, len(found.x)
    precision = np.r_[stack.one, np.full(count, FREE)]
    _, b = solve(found.z, both, scale.size, temper, precision)
    rows = weighed(both, found.z + both @ b, scale.size, temper)
    spread = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows + np.diag(precision)))[-count:])
    half = NORMAL_95 * spread * h.candidate.scale
    low, high = h.candidate.bounds
    return found, {
        (key, p.name): Interval(float(x), float(max(x - w, a)), float(min(x + w, z)), p.unit)
        for (key, p), x, w, a, z in zip(h.candidate.parameters, found.x, half, low, high, strict=True)
    }


def _entry(h: Hypothesis, fit_to: Evidence, holdout: Evidence) -> Entry:
    """The entry of a hypothesis as fitted."""
    model = h.candidate.model(h.x)

    def left(x: Array) -> Array:
        return fit_to.whitened(fit_to.residuals(h.candidate.model(x)))

    z = left(h.x)
    found = Fit(h.candidate, h.x, z, loss(z), slopes(left, h.x, z, h.candidate), 0)
    return Entry(h.candidate.ids, found, z, holdout.whitened(holdout.residuals(model)))
