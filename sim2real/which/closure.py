"""The gap itself, doubtful rows included: whether there is one, and whether the cause closes it.

The misfit averages over blocks and lets rows count less where even the right model cannot foretell, near the grip
limit above all. So a wrong effect may pass it, where most of the gap lies just there. The gap itself is of single rows,
each in its own standard deviation, doubts of the prediction included: what a cause leaves of it beyond the noise floor,
as energy, has to be the lesser part by far.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim2real.how_far.gap import measure, noise_floor
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.result import Verdict
from sim2real.which.contest import COUNTER, Contest, Entry
from sim2real.which.quiet import rare_share
from sim2real.which.selection import NO_GAP_DOUBT, Decision, doubted

MOST_LEFT = 1.0 / 6.0
"""Share of the gap's energy beyond the floor that a cause may leave on the hold-out [-]."""
FLOOR_DOUBT = 4.0 / 3.0
"""Up to this many times the noise floor what is left may be the noise's own: where it wanders or flickers, its level on
one log is known no better [-]."""
MOST_NEAR_FLOOR = 0.5
"""Share that a cause may leave there: it takes the better part [-]."""
AT_FLOOR = 1.03
"""Up to this many times its noise floor a log's residual is at it: chance moves either by a hundredth or more [-]."""
LOUD = 2.1
"""From this many times the floor on in every log there is a gap, however well it averages out: noise in bursts reaches
1.8 [-]."""
OPEN_BELIEF = 0.2
"""Probability that an effect is the cause though it leaves more [-]."""


def left_open(model: Simulation, entry: Entry, holdout: Evidence, seed: int = 0) -> tuple[float, float]:
    """What an entry leaves of the hold-out's gap: as a share of its energy beyond the noise floor, and in floors [-].

    The share is 0 where the model as it is leaves no more than the floor; the noise is read anew from what the entry
    leaves.
    """
    added = entry.fitted.candidate.model(entry.fitted.x)
    held = holdout.sharpened(added)
    before = measure(held, held.residuals(model)).total ** 2
    after = measure(held, held.residuals(added)).total ** 2
    floor = noise_floor(added, held, seed) ** 2
    share = max(after - floor, 0.0) / (before - floor) if before > floor else 0.0
    return share, float(np.sqrt(after / floor))


def at_the_floor(decision: Decision, contest: Contest, model: Simulation, *evidence: Evidence) -> Decision:
    """The decision, `no_gap` where something is blamed though every log's residual is at its noise floor.

    Blocks average so much noise out that an effect may be found which no row shows. The noise is read anew from what
    the effect leaves; where nothing explains the gap it may be the gap that was read as noise.
    """
    if decision.verdict in (Verdict.NO_GAP, Verdict.UNKNOWN) or rare_share(contest.null, *evidence):
        return decision
    found = decision.winner.fitted
    added = found.candidate.model(found.x)
    logs = [log for part in evidence for log in part.sharpened(added).each()]
    if any(floors(model, added, log) > AT_FLOOR for log in logs):
        return decision
    nothing = doubted(decision, NO_GAP_DOUBT, winner=contest.null, after=decision.before, varied=None)
    return replace(nothing, verdict=Verdict.NO_GAP, slight=decision.winner.name)


def loud(decision: Decision, model: Simulation, *evidence: Evidence) -> Decision:
    """The decision, `unknown` instead of `no_gap` where the rows of every log are far above the floor.

    What is over within a block, as the knock of a backlash, averages out in it. Flanks of a counter do so, too.
    """
    if decision.verdict is not Verdict.NO_GAP or model.has(COUNTER):
        return decision
    quiet = any(floors(model, model, log) <= LOUD for part in evidence for log in part.each())
    return decision if quiet else replace(decision, verdict=Verdict.UNKNOWN, fast=True)


def floors(model: Simulation, added: Simulation, log: Evidence) -> float:
    """What the model leaves of a log, in noise floors."""
    return measure(log, log.residuals(model)).total / noise_floor(added, log, 0)


def closing(decision: Decision, model: Simulation, holdout: Evidence) -> Decision:
    """The decision, `unknown` where the one effect that it blames leaves the gap open.

    A pair has stricter gates already.
    """
    if decision.verdict not in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS):
        return decision
    left, floors = left_open(model, decision.winner, holdout)
    if left <= (MOST_NEAR_FLOOR if floors <= FLOOR_DOUBT else MOST_LEFT):
        return decision
    return doubted(decision, OPEN_BELIEF, varied=None, left_open=left)
