"""How all verdicts become one: the whole gap is the sum of what each side sees, and two gaps at once are a compound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sim2real.auxiliary import Side
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

QUIET_SIDE_DOUBT = 0.06
"""Probability that is left to the effects of data that show no gap: some of them would hardly show [-]."""


def merge(main: Diagnosis, side: Side) -> Diagnosis:
    """One diagnosis of two; see the module."""
    if side.asks and main.verdict is not Verdict.NO_GAP:  # a gap is not joined to one that may be none
        side = side.put_off()
    side_quiet, main_quiet = side.verdict is Verdict.NO_GAP, main.verdict is Verdict.NO_GAP
    before = _join(main.gap.before, side.before, side_quiet, main_quiet)
    after = _join(main.gap.after, side.after, side_quiet, main_quiet)
    verdict = _verdict(main, side)
    both = verdict in (Verdict.COMPOUND, Verdict.UNKNOWN) and not (side_quiet or main_quiet)
    main_causes, side_causes = list(main.causes), list(side.causes)
    if side.before and not set(side.before) & set(main.gap.before.signals):
        of_main, of_side = main.gap.before.signals, side.before
        if not main_quiet or side_quiet:
            side_causes = [_alone(c, {} if side_quiet else of_side, of_main) for c in side_causes]
        if not side_quiet:
            main_causes = [_alone(c, {} if main_quiet else of_main, of_side) for c in main_causes]
    if both:
        main_causes = [replace(c, probability=0.5 * c.probability) for c in main_causes]
        side_causes = [replace(c, probability=0.5 * c.probability) for c in side_causes]
    elif side_quiet:
        left = min(max(0.0, 1.0 - sum(c.probability for c in main_causes)), QUIET_SIDE_DOUBT)
        total = max(sum(c.probability for c in side_causes), 1e-12)
        side_causes = [replace(c, probability=c.probability * min(1.0, left / total)) for c in side_causes]
    else:
        left = max(0.0, 1.0 - sum(c.probability for c in side_causes))
        total = max(sum(c.probability for c in main_causes), 1e-12)
        main_causes = [replace(c, probability=c.probability * min(1.0, left / total)) for c in main_causes]
    causes = _ranked(main, side, main_causes, side_causes, verdict)
    misplaced = side.unexplained is not None and side.unexplained.signal == PLACE
    sentence = main.sentence
    if not side_quiet:
        blamed = "" if side.unexplained else " and ".join(side.named)
        told = f"{blamed or 'Something unknown'}: {side.sentence}".strip(": ")
        beside = f"{main.sentence} Beside it, {told}"
        if misplaced:
            beside = f"{told} The car's equations show a gap too, which a road out of place may cause: {main.sentence}"
        sentence = told if main_quiet else beside
    return replace(
        main,
        verdict=verdict,
        sentence=sentence,
        gap=Gap(before, after, 1.0 if "wheel_speed" in side.before else main.gap.noise_floor),
        where=main.where if side_quiet else _where(main, side),
        heat_map=main.heat_map if side_quiet else _heat_map(main, side),
        causes=causes,
        budget=main.budget if side_quiet else _budget(main, side),
        together=_together(main, side) if verdict is Verdict.COMPOUND else (),
        next_manoeuvre=main.next_manoeuvre or side.next_manoeuvre,
        ambiguous_with=(*main.ambiguous_with, *side.ambiguous_with),
        cannot_rule_out=tuple(dict.fromkeys((*main.cannot_rule_out, *side.cannot_rule_out))),
        # A road that lies elsewhere than simulated disturbs the car's equations too, and not the other way round.
        unexplained=side.unexplained if misplaced else main.unexplained or side.unexplained,
        warnings=(*main.warnings, *side.warnings),
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


def _verdict(main: Diagnosis, side: Side) -> Verdict:
    if side.verdict is Verdict.NO_GAP:
        return main.verdict
    if main.verdict is Verdict.NO_GAP:
        return side.verdict
    if main.verdict is side.verdict is Verdict.UNKNOWN:
        return Verdict.UNKNOWN
    if Verdict.UNKNOWN in (main.verdict, side.verdict):
        # what one names stands, with something unknown beside it
        known = side.verdict if main.verdict is Verdict.UNKNOWN else main.verdict
        return Verdict.PARTIAL if known is Verdict.IDENTIFIED else known
    if main.causes and side.named == (main.causes[0].effect,):  # seen twice, still one effect
        return main.verdict
    return Verdict.COMPOUND


def _ranked(
    main: Diagnosis, side: Side, main_causes: list[Cause], side_causes: list[Cause], verdict: Verdict
) -> tuple[Cause, ...]:
    """Best first; in a compound the named ones before all others. An effect that both judged stands once."""
    first = _together(main, side)
    best: dict[str, Cause] = {}
    for cause in (*main_causes, *side_causes):
        if cause.effect not in best or cause.probability > best[cause.effect].probability:
            best[cause.effect] = cause

    def key(cause: Cause) -> tuple[bool, float]:
        named = verdict is Verdict.COMPOUND and cause.effect in first
        return (not named, -cause.probability)

    return tuple(sorted(best.values(), key=key))


def _together(main: Diagnosis, side: Side) -> tuple[str, ...]:
    """Effects that either stands by."""
    return tuple(dict.fromkeys((*(c.effect for c in added(main)), *side.named)))


def _budget(main: Diagnosis, side: Side) -> Budget:
    """Shares of both halves' squared gap: each half has as much as its signals make of the whole."""
    own, other = side.before, {k: g for k, g in main.gap.before.signals.items() if k not in side.before}
    squares = {"side": sum(g * g for g in own.values()), "main": sum(g * g for g in other.values())}
    whole = max(sum(squares.values()), 1e-12)
    of_main = main.budget.shares if main.budget else {"noise": Interval(1.0, 1.0, 1.0)}
    weight = squares["main"] / whole
    shares = {
        name: replace(s, value=weight * s.value, low=weight * s.low, high=weight * s.high)
        for name, s in of_main.items()
    }
    left = sum(g * g for g in side.after.values())
    noise = min(left, float(len(own)))
    parts = {"structure": (left - noise) / whole, "noise": noise / whole}
    parts |= {f"effect:{key}": (squares["side"] - left) / whole / len(side.named) for key in side.named}
    for name, value in parts.items():
        old = shares.get(name, Interval(0.0, 0.0, 0.0))
        shares[name] = Interval(old.value + value, old.low + value, old.high + value)
    return Budget(dict(sorted(shares.items(), key=lambda item: not item[0].startswith("effect:"))))


def _where(main: Diagnosis, side: Side) -> tuple[Place, ...]:
    """Places of both, each share by how much of the whole gap is its side's."""
    of_side = _share_of(main, side)
    if not main.where or not np.isfinite(of_side):
        return (*side.places, *main.where)
    joined = [replace(p, share=of_side * p.share) for p in side.places]
    joined += [replace(p, share=(1.0 - of_side) * p.share) for p in main.where]
    return tuple(sorted(joined, key=lambda place: -place.share))


def _heat_map(main: Diagnosis, side: Side) -> dict[str, dict[str, float]]:
    """The car's, each share of the whole gap; what is left to 1 is the other side's."""
    of_side = _share_of(main, side)
    if not np.isfinite(of_side):
        return main.heat_map
    return {
        part: {regime: (1.0 - of_side) * share for regime, share in row.items()}
        for part, row in main.heat_map.items()
    }


def _share_of(main: Diagnosis, side: Side) -> float:
    """The side's share of the squares of both beyond noise [-]; NaN where neither has any."""
    of_side, of_main = (
        sum(max(g * g - 1.0, 0.0) for g in gaps.values()) for gaps in (side.before, main.gap.before.signals)
    )
    return of_side / (of_side + of_main) if of_side + of_main else float("nan")


def _join(measure: Measure, signals: dict[str, float], side_quiet: bool, main_quiet: bool) -> Measure:
    """All signals; in the total those of a quiet camera, or of a quiet car beside one that is not, do not count."""
    if not signals:
        return measure
    joined = {**measure.signals, **signals}
    counted = joined
    if not set(measure.signals) & set(signals):
        counted = measure.signals if side_quiet else signals if main_quiet else joined
    return Measure(float(np.sqrt(np.mean(np.square(list(counted.values()))))), joined, measure.si)
