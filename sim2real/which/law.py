"""Is the effect needed for what it is: else the cause may be another one that looks like it.

An effect is believed since its equation, with one or two values, foretells what a curve of many values in the wrong
place cannot. Where a free curve over the car's motion does as well in its place, and beside it still finds what is no
noise, the law is not the car's: a load that the library lacks passes for a torque's gain that way.

A form with a further parameter is believed for its own one. Where that may stay at rest, and the further one does all,
it is not that effect: torque that moves from axle to axle is no gain, though gains by axle say it.
"""

from __future__ import annotations

from scenarios.effects import FORMS
from sim2real.observing.evidence import Evidence, all_logs
from sim2real.observing.observer import Simulation
from sim2real.result import Verdict
from sim2real.where.equations import OF_THE_MOTION, WHOLE_CAR
from sim2real.where.terms import Term, fit_terms, with_refined
from sim2real.which.contest import Contest, as_it_is
from sim2real.which.goodness import noise_margin
from sim2real.which.selection import Decision, doubted

MORE_BESIDE = 0.0075
"""Share of what the effect takes off the loss that a curve beside it takes, too: less is how its form differs [-]."""
AS_WELL = 4.0
"""A curve does as well as two effects where it leaves no more than this many times what noise may beyond them: wrong
pairs were within 2, right ones beyond 20 [-]."""
OWN_SHARE = 0.03
"""Share of what an effect takes off the loss that its own parameter takes, at least [-]."""
LAWLESS_BELIEF = 0.2
"""Probability that an effect is the cause though a curve does its work, or only what its form adds is needed [-]."""


def held_to_curves(
    decision: Decision,
    contest: Contest,
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    jobs: int = 1,
) -> Decision:
    """The decision, `unknown` where free curves do the work of what it blames, and more.

    Of one effect a curve has to leave less; two together do in several equations what no single curve does, or nearly
    so, unless they are a third thing that stands in one. An effect that varies was held to a curve beside it already,
    see `sim2real.which.varying`; where several are named none is blamed alone.
    """
    paired = decision.verdict is Verdict.COMPOUND
    if not (paired or decision.verdict is Verdict.IDENTIFIED) or decision.varied:
        return decision
    winner = decision.winner
    found = winner.fitted
    more = winner.loss - _curves(found.candidate.model(found.x), fit_to, holdout, jobs)[0].loss
    noise = noise_margin(winner, fit_to, holdout)
    differs = 0.0 if paired else MORE_BESIDE * (contest.null.loss - winner.loss)
    if more < max(noise, differs):
        return decision
    drives, noises = all_logs(fit_to, holdout)
    instead = with_refined(model, drives, noises, _curves(model, fit_to, holdout, jobs), jobs)[0]
    if instead.loss > winner.loss + (AS_WELL * noise if paired else 0.0):
        return decision
    return doubted(decision, LAWLESS_BELIEF, curve=f"{instead.equation.key} over {instead.quantity}")


def held_to_itself(decision: Decision, contest: Contest, fit_to: Evidence, holdout: Evidence) -> Decision:
    """The decision, `unknown` where the one effect that it blames is needed for what its form adds alone."""
    winner = decision.winner
    if decision.verdict is not Verdict.IDENTIFIED:
        return decision
    found = winner.fitted
    own = len(FORMS[winner.ids[0]][0].parameters())
    if len(found.candidate.kinds[0].parameters()) == own:
        return decision
    at_rest = found.x.copy()
    at_rest[:own] = found.candidate.neutral[:own]
    more = as_it_is(found.candidate.model(at_rest), fit_to, holdout).loss - winner.loss
    noise = noise_margin(winner, fit_to, holdout)
    if more > max(noise, OWN_SHARE * (contest.null.loss - winner.loss)):
        return decision
    return doubted(decision, LAWLESS_BELIEF, varied=None, further=True)


def _curves(model: Simulation, fit_to: Evidence, holdout: Evidence, jobs: int) -> list[Term]:
    """Free curves over the car's motion in each equation of a model, best first."""
    drives, noises = all_logs(fit_to, holdout)
    return fit_terms(model, drives, noises, jobs, equations=WHOLE_CAR, quantities=OF_THE_MOTION)
