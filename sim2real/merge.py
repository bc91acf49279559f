"""Merges the verdicts on the car's motion and on other data: the gap is their sum, and two gaps are a compound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sim2real.auxiliary import AuxiliaryVerdict
from sim2real.perception.shift import SIGNAL as PLACE
from sim2real.result import (
    Budget,
    Cause,
    Diagnosis,
    Gap,
    Interval,
    Measure,
    Place,
    Verdict,
    added,
)

HIDDEN_DOUBT = 0.06
"""Probability that is left to the effects of data that show no gap: some of them would hardly show [-]."""


def merge(main: Diagnosis, aux: AuxiliaryVerdict) -> Diagnosis:
    """The diagnosis of the car's motion with an auxiliary verdict; see the module."""
    if aux.asks and main.verdict is not Verdict.NO_GAP:  # a gap is not joined to one that may be none
        aux = aux.put_off()
    aux_no_gap, main_no_gap = aux.verdict is Verdict.NO_GAP, main.verdict is Verdict.NO_GAP
    before = _join(main.gap.before, aux.before, aux_no_gap, main_no_gap)
    after = _join(main.gap.after, aux.after, aux_no_gap, main_no_gap)
    verdict = _verdict(main, aux)
    both = verdict in (Verdict.COMPOUND, Verdict.UNKNOWN) and not (aux_no_gap or main_no_gap)
    main_causes, aux_causes = list(main.causes), list(aux.causes)
    if aux.before and not set(aux.before) & set(main.gap.before.signals):
        of_main, of_aux = main.gap.before.signals, aux.before
        if not main_no_gap or aux_no_gap:
            aux_causes = [_alone(c, {} if aux_no_gap else of_aux, of_main) for c in aux_causes]
        if not aux_no_gap:
            main_causes = [_alone(c, {} if main_no_gap else of_main, of_aux) for c in main_causes]
    if both:
        main_causes = [replace(c, probability=0.5 * c.probability) for c in main_causes]
        aux_causes = [replace(c, probability=0.5 * c.probability) for c in aux_causes]
    elif aux_no_gap:
        left = min(max(0.0, 1.0 - sum(c.probability for c in main_causes)), HIDDEN_DOUBT)
        total = max(sum(c.probability for c in aux_causes), 1e-12)
        aux_causes = [replace(c, probability=c.probability * min(1.0, left / total)) for c in aux_causes]
    else:
        left = max(0.0, 1.0 - sum(c.probability for c in aux_causes))
        total = max(sum(c.probability for c in main_causes), 1e-12)
        main_causes = [replace(c, probability=c.probability * min(1.0, left / total)) for c in main_causes]
    causes = _ranked(main, aux, main_causes, aux_causes, verdict)
    misplaced = aux.unexplained is not None and aux.unexplained.signal == PLACE
    sentence = main.sentence
    if not aux_no_gap:
        named = "" if aux.unexplained else " and ".join(aux.named)
        told = f"{named or 'Unknown cause'}: {aux.sentence}".strip(": ")
        beside = f"{main.sentence} In addition: {told}"
        if misplaced:
            beside = (
                f"{told} The equations of the car show a gap too, which a wrong position of the road's surfaces may "
                f"cause: {main.sentence}"
            )
        sentence = told if main_no_gap else beside
    return replace(
        main,
        verdict=verdict,
        sentence=sentence,
        gap=Gap(before, after, 1.0 if "wheel_speed" in aux.before else main.gap.noise_floor),
        where=main.where if aux_no_gap else _where(main, aux),
        heat_map=main.heat_map if aux_no_gap else _heat_map(main, aux),
        causes=causes,
        budget=main.budget if aux_no_gap else _budget(main, aux),
        together=_together(main, aux) if verdict is Verdict.COMPOUND else (),
        next_manoeuvre=main.next_manoeuvre or aux.next_manoeuvre,
        ambiguous_with=(*main.ambiguous_with, *aux.ambiguous_with),
        cannot_rule_out=tuple(dict.fromkeys((*main.cannot_rule_out, *aux.cannot_rule_out))),
        # A road that lies elsewhere than simulated disturbs the car's equations too, and not the other way round.
        unexplained=aux.unexplained if misplaced else main.unexplained or aux.unexplained,
        warnings=(*main.warnings, *aux.warnings),
    )


def _alone(cause: Cause, own: Mapping[str, float], other: Mapping[str, float]) -> Cause:
    """A cause with the gap that it alone leaves of both halves' signals; without any of its own that of the other."""
    rest, count = sum(g * g for g in other.values()), len(own) + len(other)
    mine = sum(g * g for g in own.values())
    before = float(np.sqrt((mine + rest) / count))

    def shrink(own_percent: float) -> float:
        left = mine * (1.0 - own_percent / 100.0) ** 2 + rest
        return 100.0 * (1.0 - float(np.sqrt(left / count)) / before)

    alone = float(np.sqrt((cause.gap_after**2 * len(own) + rest) / count)) if own else before
    value, of_own = 100.0 * (1.0 - alone / before), cause.shrink_percent
    low, high = min(shrink(of_own.low), value), max(shrink(of_own.high), value)
    return replace(cause, gap_after=alone, shrink_percent=Interval(value, low, high, "%"))


def _verdict(main: Diagnosis, aux: AuxiliaryVerdict) -> Verdict:
    if aux.verdict is Verdict.NO_GAP:
        return main.verdict
    if main.verdict is Verdict.NO_GAP:
        return aux.verdict
    if main.verdict is aux.verdict is Verdict.UNKNOWN:
        return Verdict.UNKNOWN
    if Verdict.UNKNOWN in (main.verdict, aux.verdict):
        # what one names stands, with something unknown beside it
        known = aux.verdict if main.verdict is Verdict.UNKNOWN else main.verdict
        return Verdict.PARTIAL if known is Verdict.IDENTIFIED else known
    if main.causes and aux.named == (main.causes[0].effect,):  # seen twice, still one effect
        return main.verdict
    return Verdict.COMPOUND


def _ranked(
    main: Diagnosis,
    aux: AuxiliaryVerdict,
    main_causes: list[Cause],
    aux_causes: list[Cause],
    verdict: Verdict,
) -> tuple[Cause, ...]:
    """Best first; in a compound the named ones before all others. An effect that both judged stands once."""
    first = _together(main, aux)
    best: dict[str, Cause] = {}
    for cause in (*main_causes, *aux_causes):
        if cause.effect not in best or cause.probability > best[cause.effect].probability:
            best[cause.effect] = cause

    def key(cause: Cause) -> tuple[bool, float]:
        named = verdict is Verdict.COMPOUND and cause.effect in first
        return (not named, -cause.probability)

    return tuple(sorted(best.values(), key=key))


def _together(main: Diagnosis, aux: AuxiliaryVerdict) -> tuple[str, ...]:
    """Effects that either stands by."""
    return tuple(dict.fromkeys((*(c.effect for c in added(main)), *aux.named)))


def _budget(main: Diagnosis, aux: AuxiliaryVerdict) -> Budget:
    """Shares of both halves' squared gap: each half has as much as its signals make of the whole."""
    own, other = aux.before, {k: g for k, g in main.gap.before.signals.items() if k not in aux.before}
    squares = {"aux": sum(g * g for g in own.values()), "main": sum(g * g for g in other.values())}
    whole = max(sum(squares.values()), 1e-12)
    of_main = main.budget.shares if main.budget else {"noise": Interval(1.0, 1.0, 1.0)}
    weight = squares["main"] / whole
    shares = {
        name: replace(s, value=weight * s.value, low=weight * s.low, high=weight * s.high)
        for name, s in of_main.items()
    }
    left = sum(g * g for g in aux.after.values())
    noise = min(left, float(len(own)))
    parts = {"structure": (left - noise) / whole, "noise": noise / whole}
    parts |= {f"effect:{key}": (squares["aux"] - left) / whole / len(aux.named) for key in aux.named}
    for name, value in parts.items():
        old = shares.get(name, Interval(0.0, 0.0, 0.0))
        shares[name] = Interval(old.value + value, old.low + value, old.high + value)
    return Budget(dict(sorted(shares.items(), key=lambda item: not item[0].startswith("effect:"))))


def _where(main: Diagnosis, aux: AuxiliaryVerdict) -> tuple[Place, ...]:
    """Places of both, each with its share of the whole gap."""
    of_aux = _share_of(main, aux)
    if not main.where or not np.isfinite(of_aux):
        return (*aux.places, *main.where)
    joined = [replace(p, share=of_aux * p.share) for p in aux.places]
    joined += [replace(p, share=(1.0 - of_aux) * p.share) for p in main.where]
    return tuple(sorted(joined, key=lambda place: -place.share))


def _heat_map(main: Diagnosis, aux: AuxiliaryVerdict) -> dict[str, dict[str, float]]:
    """The car's shares of the whole gap; the rest to 1 is that of the auxiliary verdict."""
    of_aux = _share_of(main, aux)
    if not np.isfinite(of_aux):
        return main.heat_map
    return {
        part: {regime: (1.0 - of_aux) * share for regime, share in row.items()}
        for part, row in main.heat_map.items()
    }


def _share_of(main: Diagnosis, aux: AuxiliaryVerdict) -> float:
    """The auxiliary verdict's share of the squares of both beyond noise [-]; NaN where neither has any."""
    of_aux, of_main = (
        sum(max(g * g - 1.0, 0.0) for g in gaps.values()) for gaps in (aux.before, main.gap.before.signals)
    )
    return of_aux / (of_aux + of_main) if of_aux + of_main else float("nan")


def _join(measure: Measure, signals: dict[str, float], aux_no_gap: bool, main_no_gap: bool) -> Measure:
    """All signals; in the total those without a gap do not count: the camera's, or the car's beside a camera gap."""
    if not signals:
        return measure
    joined = {**measure.signals, **signals}
    counted = joined
    if not set(measure.signals) & set(signals):
        counted = measure.signals if aux_no_gap else signals if main_no_gap else joined
    return Measure(float(np.sqrt(np.mean(np.square(list(counted.values()))))), joined, measure.si)
