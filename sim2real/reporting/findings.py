"""From what was found to what is said: sizes, places, causes with intervals and evidence, sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import EFFECTS, Effect
from sim2real.how_far.budget import budget
from sim2real.how_far.gap import measure, noise_floor, shrink
from sim2real.hypotheses.contest import Contest, Entry, Progress
from sim2real.hypotheses.goodness import fitness
from sim2real.hypotheses.selection import Decision
from sim2real.next_manoeuvre import propose
from sim2real.observing.drive import CHANNELS
from sim2real.observing.evidence import Evidence, all_logs, expected
from sim2real.observing.lattice import Lattice
from sim2real.observing.observer import Simulation
from sim2real.observing.orders import Order
from sim2real.observing.orders import characterise as swing_in_words
from sim2real.observing.robust import loss
from sim2real.reporting import sentences
from sim2real.reporting.advice import advice
from sim2real.reporting.estimates import is_excited, joint
from sim2real.result import (
    Cause,
    Diagnosis,
    Gap,
    Interval,
    NextManoeuvre,
    Place,
    Trace,
    Unexplained,
    Verdict,
    at_bound_in_words,
)
from sim2real.where import localise
from sim2real.where.equations import EQUATIONS, OF_THE_MOTION, WHOLE_CAR
from sim2real.where.sensor_isolation import lone_sensor
from sim2real.where.terms import Term, finer, fit_terms, with_refined
from sim2real.where.unknown import characterise, seen_alone, subsystem_of

Array = NDArray[np.float64]

SHOWN = {
    "vehicle_speed_m_s": "m/s",
    "wheel_speed_fl_rad_s": "rad/s",
    "wheel_speed_rl_rad_s": "rad/s",
    "accel_x_m_s2": "m/s^2",
}
"""Channels that are drawn, and their units."""


@dataclass(frozen=True)
class Findings:
    """A decided contest with the evidence that it was held on."""

    model: Simulation
    fit_to: Evidence
    holdout: Evidence
    contest: Contest
    decision: Decision
    lattice: Lattice | None = None
    order: Order | None = None
    """What repeats with the wheels' angle: it was taken off the logs before the contest."""
    only_order: bool = False
    """Whether that is the whole gap."""

    def added(self) -> tuple[Effect, ...]:
        """The effects that the verdict names, to be added to the model."""
        entry = self.decision.winner
        if entry.fit is None or self.decision.verdict is Verdict.UNKNOWN:
            return ()
        return tuple(entry.fit.candidate.effects(entry.fit.x))


def describe(found: Findings, *, seed: int, jobs: int, progress: Progress) -> Diagnosis:
    """Everything that a diagnosis says."""
    decision = found.decision
    held = _final_noise(found).swinging()
    before = held.residuals(found.model)
    added = found.model.with_effects(*found.added())
    after = held.residuals(added)
    gap = Gap(measure(held, before), measure(held, after), noise_floor(added, held, seed))
    causes = _causes(found, held, before, seed)
    swing = _swinging(found) if found.order else None
    terms, unexplained = list[Term](), None
    places: tuple[Place, ...] = ()
    heat: dict[str, dict[str, float]] = {}
    if decision.verdict is not Verdict.NO_GAP:
        progress("equations", 0, 1)
        terms, unexplained, isolated = _terms(found, held, jobs)
        progress("equations", 1, 1)
        if unexplained and decision.verdict is Verdict.UNKNOWN:
            unexplained = _larger(found, unexplained, swing)
            unexplained = unexplained if isolated else seen_alone(unexplained, gap.before)
        missing = _missing(found, held, before)
        if not missing:
            likeliest = subsystem_of(terms[0]) if terms else ""
            missing = {unexplained.subsystem if unexplained else likeliest: before}
        places, heat = _where(found, held, before, after, terms, missing)
    return Diagnosis(
        verdict=decision.verdict,
        sentence=" ".join(
            part
            for part in (
                sentences.verdict(decision, gap, causes),
                unexplained.sentence if unexplained else "",
                ""
                if found.only_order
                else sentences.nearest(decision, found.contest, found.fit_to, found.holdout),
                swing.sentence if swing and unexplained is not swing else "",
            )
            if part
        ),
        gap=gap,
        where=places,
        heat_map=heat,
        causes=causes,
        ambiguous_with=_ambiguous(decision),
        cannot_rule_out=tuple(c.effect for c in causes if not c.excited),
        next_manoeuvre=_next(found, progress),
        unexplained=unexplained,
        advice="" if found.only_order else advice(decision, found.contest),
        build=dict(decision.build),
        budget=None
        if decision.verdict is Verdict.NO_GAP
        else budget(held, found.added(), found.model, gap.noise_floor, seed),
        traces=_traces(found, held, added),
        provenance={"seed": seed},
    )


def _terms(found: Findings, held: Evidence, jobs: int) -> tuple[list[Term], Unexplained | None, bool]:
    """Free terms, best first, what they say of a gap that no effect explains, and whether one sensor is isolated."""
    decision = found.decision
    if decision.verdict is Verdict.PARTIAL:
        added = found.model.with_effects(*found.added())
        terms = fit_terms(added, *all_logs(found.fit_to, held), jobs)
        return terms, characterise(terms, of="what is left"), False
    if decision.verdict is not Verdict.UNKNOWN:
        return (
            fit_terms(
                found.model, held.drives, held.noises, jobs, equations=WHOLE_CAR, quantities=OF_THE_MOTION
            ),
            None,
            False,
        )
    drives, noises = all_logs(found.fit_to, held)
    isolated = lone_sensor(found.model, found.fit_to, held)
    if isolated and "time" not in isolated.quantities:  # a sensor may fail for a while
        isolated = replace(isolated, quantities=(*isolated.quantities, "time"))
    terms = fit_terms(found.model, drives, noises, jobs, equations=(isolated,) if isolated else EQUATIONS)
    terms = with_refined(found.model, drives, noises, terms, jobs)
    if not isolated:
        terms = finer(found.model, drives[-1:], noises[-1:], terms, jobs)
    return terms, characterise(terms, isolated), isolated is not None


def _larger(found: Findings, term: Unexplained, swing: Unexplained | None) -> Unexplained:
    """Of a free term and what repeats with the wheels' angle: what takes most of the gap."""
    if swing and (found.only_order or swing.share > term.share):
        return swing
    return term


def _swinging(found: Findings) -> Unexplained:
    """What repeats with the wheels' angle, and what of the misfit it takes."""
    assert found.order is not None
    calm = [found.fit_to, found.holdout]
    left = sum(loss(e.whitened(e.residuals(found.model))) for e in calm)
    whole = sum(loss(e.whitened(e.residuals(found.model))) for e in (part.swinging() for part in calm))
    return swing_in_words(found.order, [d for e in calm for d in e.drives], 1.0 - left / max(whole, 1e-12))


def _final_noise(found: Findings) -> Evidence:
    """The hold-out with its noise read anew from what the winner leaves: a gap may have looked like noise."""
    if not found.added():
        return found.holdout
    return found.holdout.sharpened(found.model.with_effects(*found.added()))


def _causes(found: Findings, held: Evidence, before: Sequence[Array], seed: int) -> tuple[Cause, ...]:
    """All single candidates, ranked; a compound's members first, with their joint parameters."""
    winner = found.decision.winner
    compound = found.decision.verdict is Verdict.COMPOUND
    together = dict(found.decision.intervals)
    if not together and compound:
        together = joint(winner, found.fit_to)
    out = [_cause(found, entry, held, before, seed, together) for entry in found.contest.singles]
    first = winner.ids if found.added() else ()
    return tuple(sorted(out, key=lambda c: (c.effect not in first, -c.probability, c.gap_after)))


def _cause(
    found: Findings,
    entry: Entry,
    held: Evidence,
    before: Sequence[Array],
    seed: int,
    together: dict[tuple[str, str], Interval],
) -> Cause:
    key, best = entry.ids[0], entry.fitted
    after = held.residuals(best.candidate.model(best.x))
    size = measure(held, after).total
    alone = joint(entry, found.fit_to)
    values = {name: value for (effect, name), value in together.items() if effect == key}
    told = found.decision.winner if values and key in found.decision.winner.ids else entry
    values = values or {name: value for (_, name), value in alone.items()}
    excited = is_excited(entry, _stands(found))
    fit_ok = fitness(entry, found.fit_to, found.holdout)
    worst = max(fit_ok.signals, key=lambda name: fit_ok.signals[name])
    shrunk = shrink(held, before, after, seed)
    pro, contra = [], []
    if shrunk.low > 0.0:
        pro.append(f"Reduces the gap on the hold-out, to which it was not fitted, by {shrunk.value:.0f} %.")
    if fit_ok.misfit <= 1.5:
        pro.append("The remaining residuals average out like noise.")
    else:
        contra.append(
            f"The remaining residuals of {worst} average to {fit_ok.signals[worst]:.1f} times what "
            "noise gives."
        )
    if not excited:
        contra.append(
            f"Hardly excited by these logs, so it cannot be ruled out. Excitation: {EFFECTS[key].excited_by}."
        )
    for name in best.candidate.at_bound(best.x):
        contra.append(at_bound_in_words(name))
    if shrunk.high <= 1.0:
        contra.append("Does not reduce the gap on the hold-out.")
    return Cause(
        effect=key,
        probability=round(found.decision.probability.get(key, 0.0), 6),
        parameters=values,
        gap_after=size,
        shrink_percent=shrunk,
        fit_bic=float(entry.loss_fit + entry.size * np.log(max(int(np.count_nonzero(entry.z_fit)), 2))),
        evidence_for=tuple(pro),
        evidence_against=tuple(contra),
        excited=excited,
        form=told.fitted.candidate.kinds[told.ids.index(key)].form,
    )


def _stands(found: Findings) -> Entry:
    """The account that stands: the winner, or the model as it is."""
    decision = found.decision
    if decision.verdict is Verdict.UNKNOWN or decision.winner.fit is None:
        return found.contest.null
    return decision.winner


def _missing(found: Findings, held: Evidence, before: Sequence[Array]) -> dict[str, Sequence[Array]]:
    """Residuals per subsystem without the named effects in it; empty if no effect is named."""
    parts = dict.fromkeys(EFFECTS[effect.id].subsystem for effect in found.added())
    if len(parts) == 1:
        return dict.fromkeys(parts, before)
    return {
        part: held.residuals(
            found.model.with_effects(*(e for e in found.added() if EFFECTS[e.id].subsystem != part))
        )
        for part in parts
    }


def _where(
    found: Findings,
    held: Evidence,
    before: Sequence[Array],
    after: Sequence[Array],
    terms: Sequence[Term],
    missing: Mapping[str, Sequence[Array]],
) -> tuple[tuple[Place, ...], dict[str, dict[str, float]]]:
    """Places and heat map; what the verdict adds is a term of its subsystem too, by what is missed without it."""

    def of_logs(rests: Sequence[Array]) -> list[localise.Blocks]:
        each = zip(held.drives, held.noises, rests, strict=True)
        return [
            localise.blocks(drive, noise, found.model.predict(drive), rest) for drive, noise, rest in each
        ]

    null, left = sum(term.null_loss for term in terms[:1]), loss(held.whitened(after))
    taken = [(part, loss(held.whitened(rests)) - left) for part, rests in missing.items()]
    shares = localise.equation_shares([*taken, *((subsystem_of(t), null - t.loss) for t in terms)])
    parts, without = of_logs(before), {part: of_logs(rests) for part, rests in missing.items()}
    places = tuple(
        place
        for i, (drive, part) in enumerate(zip(held.drives, parts, strict=True))
        for place in localise.places(drive, part, {name: logs[i] for name, logs in without.items()})
    )
    return places, localise.heat_map(parts, shares)


def _ambiguous(decision: Decision) -> tuple[tuple[str, ...], ...]:
    if not decision.rivals:
        return ()
    members = [decision.winner, *decision.rivals]
    return (tuple(dict.fromkeys(key for entry in members for key in entry.ids)),)


def _next(found: Findings, progress: Progress) -> NextManoeuvre | None:
    decision = found.decision
    if decision.verdict is not Verdict.AMBIGUOUS:
        return None
    a, b = decision.winner, decision.rivals[0]
    now = float(np.sqrt(abs(b.loss - a.loss)))
    drive, noise = found.holdout.drives[0], found.holdout.noises[0]
    return propose(found.model, a, b, drive.road, noise, now, drive.step_s, progress)


def _traces(found: Findings, held: Evidence, added: Simulation) -> tuple[Trace, ...]:
    drive, noise = held.drives[0], held.noises[0]
    before, after = (expected(drive, m.predict(drive).channels) for m in (found.model, added))
    return tuple(
        Trace(
            name, unit, drive.time_s, drive.measured[:, i], before[:, i], after[:, i], float(noise.sigma[i])
        )
        for name, unit in SHOWN.items()
        for i in [CHANNELS.index(name)]
    )
