"""What is judged beside the contest of the car's effects, and how all verdicts become one.

The camera chain and a pulse counter's lattice are seen in data that the other effects do not touch. Each brings its own
verdict, and the whole is their sum: two gaps at once are a compound.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scenarios.effects import EFFECTS
from scenarios.effects.base import Parameter
from scenarios.files import RoadFile, VehicleFile
from sim2real.next_manoeuvre import BRAKING, STEADY_SPEEDS, torque_of
from sim2real.observing.lattice import Lattice
from sim2real.perception.chain import DECISIVE
from sim2real.perception.finding import CameraCandidate, PerceptionFinding
from sim2real.perception.friction import OFFSET
from sim2real.perception.shift import SIGNAL as PLACE
from sim2real.result import (
    Cause,
    Diagnosis,
    Gap,
    Interval,
    Measure,
    NextManoeuvre,
    Place,
    Unexplained,
    Verdict,
    added,
    at_bound_in_words,
)

QUIET_SIDE_DOUBT = 0.06
"""Probability that is left to the effects of data that show no gap: some of them would hardly show [-]."""
UNKNOWN_BELIEF = 0.05
"""Share of the camera's effects in the belief where what they leave says that it is none of them, or not all [-]."""
CERTAIN = 0.97
"""Probability of what a mark that nothing else leaves has shown [-]."""


@dataclass(frozen=True)
class Side:
    """A verdict on data of its own.

    Attributes
    ----------
    verdict : Verdict
        Of these data alone.
    named : tuple of str
        Effects that it stands by.
    causes : tuple of Cause
        Candidates with probabilities, best first.
    before, after : dict
        Gap per signal in noise floors; an empty one leaves the signal to the rest.
    """

    verdict: Verdict
    named: tuple[str, ...]
    causes: tuple[Cause, ...]
    before: dict[str, float]
    after: dict[str, float]
    ambiguous_with: tuple[tuple[str, ...], ...] = ()
    cannot_rule_out: tuple[str, ...] = ()
    places: tuple[Place, ...] = ()
    unexplained: Unexplained | None = None
    sentence: str = ""
    warnings: tuple[str, ...] = ()
    next_manoeuvre: NextManoeuvre | None = None

    @property
    def asks(self) -> bool:
        """Whether it only asks: an effect that may as well be none."""
        alone = {(effect,) for effect in self.named}
        return self.verdict is Verdict.AMBIGUOUS and set(self.ambiguous_with) == alone

    def put_off(self) -> Side:
        """The side without its question, which is left as a warning."""
        return replace(
            self,
            verdict=Verdict.NO_GAP,
            named=(),
            after=self.before,
            ambiguous_with=(),
            cannot_rule_out=tuple(dict.fromkeys((*self.cannot_rule_out, *self.named))),
            places=(),
            sentence="",
            warnings=(*self.warnings, f"{' and '.join(self.named)}? {self.sentence}"),
        )


def camera_side(
    found: PerceptionFinding, vehicle: VehicleFile | None = None, road: RoadFile | None = None
) -> Side:
    """The camera chain's verdict as a side; for a car on a road with what to drive next."""
    alone = {c.effects[0]: c for c in found.candidates if len(c.effects) == 1}
    told: dict[str, CameraCandidate] = {}
    blamed = [c for c in found.candidates if set(c.effects) == set(found.causes)]
    for candidate in (*blamed, *alone.values(), *found.candidates):
        for effect in candidate.effects:
            told.setdefault(effect, candidate)
    share = _shares(found)
    causes = [
        _cause(effect, share.get(effect, 0.0), candidate, alone.get(effect, candidate))
        for effect, candidate in told.items()
    ]
    term = None
    if found.verdict is Verdict.UNKNOWN and found.odd:
        odd, none = found.odd[0], np.array([])
        term = Unexplained(
            "camera", odd.signal, odd.depends_on, "-", odd.sign, odd.shape, np.nan, none, none, odd.sentence
        )
    return Side(
        verdict=found.verdict,
        named=found.causes,
        causes=tuple(sorted(causes, key=lambda c: -c.probability)),
        before=found.before.signals,
        after=found.after.signals,
        ambiguous_with=found.ambiguous_with,
        cannot_rule_out=tuple(found.cannot_rule_out),
        places=found.places,
        unexplained=term,
        sentence=f"{_in_numbers(found)} {found.next_step}".strip() if term is None else term.sentence,
        warnings=(*found.warnings, *found.unexplained),
        next_manoeuvre=None if vehicle is None or road is None else _next(found, vehicle, road),
    )


def _cause(effect: str, probability: float, told: CameraCandidate, alone: CameraCandidate) -> Cause:
    """An effect as a cause: as the candidate tells it that stands, or it alone, with the gap that it alone leaves."""
    return Cause(
        effect=effect,
        probability=probability,
        parameters=_own(effect, told),
        gap_after=alone.after.total,
        shrink_percent=alone.shrink_percent,
        fit_bic=-2.0 * alone.gain_fit + alone.size * float(np.log(max(alone.effective, 2.0))),
        evidence_for=told.evidence_for,
        evidence_against=(*told.evidence_against, *_at_bound(effect, told)),
        excited=told.excited,
    )


def _next(found: PerceptionFinding, vehicle: VehicleFile, road: RoadFile) -> NextManoeuvre | None:
    """Two speeds over the same borders, or braking on each surface where class values are in doubt."""
    if found.verdict is not Verdict.AMBIGUOUS:
        return None
    # one effect or none is for no drive to tell
    groups = [group for group in found.ambiguous_with if len(group) > 1]
    told = tuple(dict.fromkeys(effect for group in groups for effect in group))
    if not told:
        return None
    profile = BRAKING if OFFSET in told else STEADY_SPEEDS
    time_s, torque_nm = torque_of(profile, vehicle, road)
    sentence = found.next_step or profile.sentence
    return NextManoeuvre(sentence, profile.initial_speed_m_s, time_s, torque_nm, told, np.nan, np.nan)


def _in_numbers(found: PerceptionFinding) -> str:
    """What the causes do to the camera's gap, and at which values; empty where nothing is blamed."""
    blamed = next((c for c in found.candidates if set(c.effects) == set(found.causes)), None)
    if blamed is None:
        return ""
    values = ", ".join(
        f"{name} {value.value:.3g} {value.unit}".removesuffix(" -")
        for effect in blamed.effects
        for name, value in _own(effect, blamed).items()
    )
    if not np.isfinite(blamed.after.total):
        return f"with {values}; the hold-out does not tell how far the camera's gap shrinks."
    return (
        f"with {values} the camera's gap goes from {found.before.total:.1f} to {found.after.total:.1f} times the noise "
        "floor."
    )


def _shares(found: PerceptionFinding) -> dict[str, float]:
    """Probability per effect from the scores of what was tried; "as simulated" scores 0.

    A further effect has to earn what it takes for one to stand beside another. Where effects are named, those of
    signals that stand by none, as too small to matter, are no likelier than that all is as simulated.
    """
    named = {*found.causes, *(effect for group in found.ambiguous_with for effect in group)}
    telling = {c.signal for c in found.candidates if named.issuperset(c.effects)}
    scores = np.array([0.0, *(c.score - DECISIVE * (len(c.effects) - 1) for c in found.candidates)])
    idle = np.array([False, *(c.signal not in telling for c in found.candidates)])
    if telling and idle.any():
        scores[idle] -= max(scores[idle].max(), 0.0)
    weight = np.exp(scores - scores.max())
    weight /= weight.sum()
    belief = UNKNOWN_BELIEF if found.verdict is Verdict.UNKNOWN else CERTAIN
    share: dict[str, float] = {}
    for candidate, w in zip(found.candidates, weight[1:], strict=True):
        for effect in candidate.effects:
            share[effect] = share.get(effect, 0.0) + belief * float(w) / len(candidate.effects)
    return share


def _own(effect: str, candidate: CameraCandidate) -> dict[str, Interval]:
    """Its own of a candidate's parameters, within what vehicle.yaml takes."""
    return {
        p.name: _within(candidate.parameters[p.name], p)
        for p in EFFECTS[effect].parameters()
        if p.name in candidate.parameters
    }


def _at_bound(effect: str, candidate: CameraCandidate) -> tuple[str, ...]:
    """Which of its parameters were found beyond what vehicle.yaml takes."""
    return tuple(
        at_bound_in_words(name)
        for name, value in _own(effect, candidate).items()
        if value.value != candidate.parameters[name].value
    )


def _within(estimate: Interval, parameter: Parameter) -> Interval:
    if callable(parameter.low) or callable(parameter.high):
        return estimate
    value, low, high = np.clip((estimate.value, estimate.low, estimate.high), parameter.low, parameter.high)
    return Interval(float(value), float(low), float(high), estimate.unit)


def counter_side(lattice: Lattice, before: Measure, after: Measure, excluded: bool) -> Side:
    """The verdict on wheel speeds that lie on a lattice.

    Parameters
    ----------
    lattice : Lattice
        What was found.
    before, after : Measure
        The hold-out's gap against the noise beside the rounding, and against noise and rounding.
    excluded : bool
        Whether the effect was left out of the library.
    """
    old, new = before.signals["wheel_speed"], after.signals["wheel_speed"]
    what = lattice.sentence
    if excluded:
        term = Unexplained(
            "wheel_speed_sensor", "wheel_speed", "value", "rad/s", "has no sign", "a staircase", 1.0,
            np.array([]), np.array([]), what,
        )  # fmt: skip
        return Side(
            Verdict.UNKNOWN,
            (),
            (),
            {"wheel_speed": old},
            {"wheel_speed": old},
            unexplained=term,
            sentence=what,
        )
    teeth = float(lattice.teeth)
    cause = Cause(
        effect="wheel_speed_quantisation",
        probability=CERTAIN,
        parameters={
            "teeth": Interval(teeth, *lattice.teeth_range, "-"),
            "window_s": Interval(lattice.window_s, *lattice.window_range_s, "s"),
        },
        gap_after=after.total,
        shrink_percent=_percent(before.total, after.total),
        fit_bic=float("-inf"),
        evidence_for=(
            what,
            "A simulated counter scatters as much; where in a tooth it began cannot be known.",
        ),
    )
    return Side(
        Verdict.IDENTIFIED,
        ("wheel_speed_quantisation",),
        (cause,),
        {"wheel_speed": old},
        {"wheel_speed": new},
        sentence=what,
    )


def _percent(before: float, after: float) -> Interval:
    value = 100.0 * (1.0 - after / before)
    return Interval(value, value - 5.0, min(value + 5.0, 100.0), "%")


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
    if Verdict.UNKNOWN in (main.verdict, side.verdict):
        return Verdict.UNKNOWN
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

    def key(cause: Cause) -> tuple[bool, float, float]:
        named = verdict is Verdict.COMPOUND and cause.effect in first
        return (not named, -cause.probability, cause.gap_after)

    return tuple(sorted(best.values(), key=key))


def _together(main: Diagnosis, side: Side) -> tuple[str, ...]:
    """Effects that either stands by."""
    return tuple(dict.fromkeys((*(c.effect for c in added(main)), *side.named)))


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
