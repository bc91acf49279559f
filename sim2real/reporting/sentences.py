"""A verdict in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim2real.hypotheses.contest import Contest, Entry
from sim2real.hypotheses.goodness import fitness, loss_beyond_noise
from sim2real.hypotheses.selection import EXPLAINED_MISFIT, EXPLAINED_SHARE, PAIR_MISFIT, Decision
from sim2real.observing.evidence import Evidence
from sim2real.result import Cause, Gap, Verdict

NEAR = 0.8
"""Share of the loss beyond noise from which on what comes nearest to an explanation is worth a sentence [-]."""

SHOWN = 3
"""How many effects a sentence lists; the report and the JSON have all."""


def verdict(decision: Decision, gap: Gap, causes: Sequence[Cause]) -> str:
    """The verdict itself."""
    size = f"{gap.before.total:.1f} times the sensor noise"
    if decision.verdict is Verdict.NO_GAP:
        return "Simulation and logs agree within the sensor noise: no effect is needed."
    if decision.verdict is Verdict.UNKNOWN:
        return f"There is a gap of {size}, and no effect of the library explains it."
    top = causes[0]
    digits = 1 if gap.before.total > 1.1 else 2
    before, after = (f"{side.total:.{digits}f}" for side in (gap.before, gap.after))
    cut = f"the gap decreases from {before} to {after} times the sensor noise"
    if decision.verdict is Verdict.COMPOUND:
        return f"{' and '.join(decision.winner.ids)} are needed together: {cut}."
    if decision.verdict is Verdict.AMBIGUOUS:
        return f"The gap of {size} is explained by {top.effect}{_rivals(decision)}: these logs do not separate them."
    values = ", ".join(f"{name} {_with_unit(v.value, v.unit)}" for name, v in top.parameters.items())
    if decision.verdict is Verdict.PARTIAL:
        return (
            f"A part of the gap of {size} is explained by {top.effect} ({values}): {cut}. The rest is a model "
            f"difference that no effect describes{_build(decision)}."
        )
    return f"The gap of {size} is explained by {top.effect} ({values}): {cut}."


def _rivals(decision: Decision) -> str:
    """What else it may be, and what may stand beside it."""
    key = decision.winner.name
    others = [e.name.replace("+", " with ") for e in decision.rivals if key not in e.ids]
    partners = [k for e in decision.rivals if key in e.ids for k in e.name.split("+") if k != key]
    beside = f", possibly together with {_some(partners)}" if partners else ""
    return (f" or equally by {_some(others)}" if others else "") + beside


def _some(names: Sequence[str]) -> str:
    more = len(names) - SHOWN
    return " or ".join([*names[:SHOWN], *([f"{more} others"] if more > 0 else [])])


def _build(decision: Decision) -> str:
    """The least expected changes of the car's build."""
    told = [f"{name} {value:+.2g}" for name, value in list(decision.build.items())[:SHOWN]]
    return f" (the car's build: {', '.join(told)})" if told else ""


def closest(decision: Decision, contest: Contest) -> tuple[Entry, float] | None:
    """What comes nearest where nothing explains the gap, and its share of the misfit; None if nothing is near."""
    entries = [*contest.singles, *contest.pairs]
    if decision.verdict is not Verdict.UNKNOWN or not entries:
        return None
    best, null = min(entries, key=lambda e: e.loss), contest.null
    if loss_beyond_noise(best) > (1.0 - NEAR) * loss_beyond_noise(null):
        return None
    return best, 1.0 - best.loss / max(null.loss, 1e-12)


def nearest(decision: Decision, contest: Contest, fit_to: Evidence, holdout: Evidence) -> str:
    """What comes nearest where nothing explains the gap, if that is near, and why it is not named."""
    if (near := closest(decision, contest)) is None:
        return ""
    best, share = near
    found = best.fitted
    values = ", ".join(
        f"{p.name} {_with_unit(value, p.unit)}"
        for (_, p), value in zip(found.candidate.parameters, found.x, strict=True)
    )
    misfit = fitness(best, fit_to, holdout).misfit
    return (
        f"The closest explanation is {best.name.replace('+', ' with ')} ({values}): it removes "
        f"{100.0 * share:.0f} % of the misfit. It is not named as the cause, since "
        f"{why_not(misfit, decision.before.misfit, len(best.ids))}."
    )


def why_not(misfit: float, before: float, count: int) -> str:
    """Why an entry of `count` effects is not named that leaves this misfit of the one before."""
    most = EXPLAINED_MISFIT if count == 1 else PAIR_MISFIT
    if misfit > max(most, EXPLAINED_SHARE * before):
        return f"what it leaves is not noise ({misfit:.1f} times what noise gives)"
    if count > 1:
        return "one of its effects alone explains nearly as much, or the two only cancel each other"
    return "another fault explains the gap better"


def _with_unit(value: float, unit: str) -> str:
    """A value in four digits with its unit, if it has one."""
    return number(value) if unit == "-" else f"{number(value)} {unit}"


def number(value: float, digits: int = 4) -> str:
    """A value in so many digits, without zeros at its end."""
    return np.format_float_positional(value, precision=digits, fractional=False, trim="-")
