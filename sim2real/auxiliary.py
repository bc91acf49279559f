"""Auxiliary verdicts, on data that the effects of the car's motion do not change: camera chain and pulse counter."""

from __future__ import annotations

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
from sim2real.result import (
    Cause,
    Interval,
    Measure,
    NextManoeuvre,
    Place,
    Unexplained,
    Verdict,
    at_bound_in_words,
)

UNKNOWN_BELIEF = 0.05
"""Probability of the camera's effects together if the gap is not explained by them [-]."""
CERTAIN = 0.97
"""Probability of what a mark that nothing else leaves has shown [-]."""


@dataclass(frozen=True)
class AuxiliaryVerdict:
    """A verdict on data of its own.

    Attributes
    ----------
    verdict : Verdict
        Of these data alone.
    named : tuple of str
        Effects that it names.
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

    def put_off(self) -> AuxiliaryVerdict:
        """The verdict without its question, which becomes a warning."""
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


def camera_verdict(
    found: PerceptionFinding, vehicle: VehicleFile | None = None, road: RoadFile | None = None
) -> AuxiliaryVerdict:
    """The camera chain's auxiliary verdict; with vehicle and road also the next manoeuvre."""
    alone = {c.effects[0]: c for c in found.candidates if len(c.effects) == 1}
    told: dict[str, CameraCandidate] = {}
    named = [c for c in found.candidates if set(c.effects) == set(found.causes)]
    for candidate in (*named, *alone.values(), *found.candidates):
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
    return AuxiliaryVerdict(
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
    """What the causes do to the camera's gap, and at which values; empty where nothing is named."""
    named = next((c for c in found.candidates if set(c.effects) == set(found.causes)), None)
    if named is None:
        return ""
    values = ", ".join(
        f"{name} {value.value:.3g} {value.unit}".removesuffix(" -")
        for effect in named.effects
        for name, value in _own(effect, named).items()
    )
    if not np.isfinite(named.after.total):
        return f"with {values}; the hold-out does not show by how much the camera's gap decreases."
    return (
        f"with {values} the camera's gap decreases from {found.before.total:.1f} to {found.after.total:.1f} times "
        "the noise "
        "floor."
    )


def _shares(found: PerceptionFinding) -> dict[str, float]:
    """Probability per effect from the scores of what was tried; "as simulated" scores 0.

    A further effect has to earn what it takes for one to stand beside another. Where effects are named, those of
    signals that stand by none, as too small to matter, are no likelier than that all is as simulated.
    """
    named = {*found.causes, *(effect for group in found.ambiguous_with for effect in group)}
    named_signals = {c.signal for c in found.candidates if named.issuperset(c.effects)}
    scores = np.array([0.0, *(c.score - DECISIVE * (len(c.effects) - 1) for c in found.candidates)])
    idle = np.array([False, *(c.signal not in named_signals for c in found.candidates)])
    if named_signals and idle.any():
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


def counter_verdict(lattice: Lattice, before: Measure, after: Measure, excluded: bool) -> AuxiliaryVerdict:
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
        return AuxiliaryVerdict(
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
            "A simulated counter scatters as much; the phase of its first pulse is not known.",
        ),
    )
    return AuxiliaryVerdict(
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
