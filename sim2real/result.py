"""What a diagnosis says, and its JSON form (schema 1)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMAL_95 = 1.96
"""Half width of a normal's 95 % interval [standard deviations]."""


class Verdict(StrEnum):
    """The outcome in a word; `MEANING` has the sentence."""

    IDENTIFIED = "identified"
    PARTIAL = "partial"
    AMBIGUOUS = "ambiguous"
    COMPOUND = "compound"
    UNKNOWN = "unknown"
    NO_GAP = "no_gap"


MEANING = {
    Verdict.IDENTIFIED: "One effect explains the gap down to the noise, and no other effect does.",
    Verdict.PARTIAL: "One effect explains a part of the gap; the rest is a model difference that no effect "
    "describes.",
    Verdict.AMBIGUOUS: "Several effects explain these logs equally well; the next manoeuvre would separate them.",
    Verdict.COMPOUND: "Two or more effects are needed together.",
    Verdict.UNKNOWN: "There is a gap, and no effect of the library explains it.",
    Verdict.NO_GAP: "The difference between simulation and log is sensor noise.",
}


@dataclass(frozen=True)
class Interval:
    """A value and its 95 % interval, in `unit`."""

    value: float
    low: float
    high: float
    unit: str = "-"

    def to_json(self) -> dict[str, float]:
        """Value and bounds."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Measure:
    """Size of the gap in units of the sensor noise: 1 is what noise alone leaves.

    Attributes
    ----------
    total : float
        Root mean square over the signals [-].
    signals : dict
        Per signal: wheel_speed (all four), vehicle_speed, accel_x, position, and the camera's [-].
    si : dict
        The same signals' root mean square residual in their own SI units.
    """

    total: float
    signals: dict[str, float] = field(default_factory=dict)
    si: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Gap:
    """The gap on the hold-out before and after what the verdict adds; the noise floor in the same units."""

    before: Measure
    after: Measure
    noise_floor: float
    measured_on: str = "holdout"


@dataclass(frozen=True)
class Place:
    """A part of the gap: signal, subsystem, regime of driving, time window [s] of a log, share of the whole [-]."""

    signal: str
    subsystem: str
    regime: str
    from_s: float
    to_s: float
    share: float
    log: str = ""


@dataclass(frozen=True)
class Cause:
    """One candidate (an effect, or the pair of a compound) with its evidence.

    Attributes
    ----------
    effect : str
        Its id.
    probability : float
        That it is the cause, given the data and the library [-].
    parameters : dict
        Parameter name to its estimate.
    gap_after : float
        Gap that is left on the hold-out with this effect alone [sensor noises].
    shrink_percent : Interval
        By how much the hold-out's gap shrinks with it alone [%].
    fit_bic : float
        Plain in-sample BIC on the fit logs, for comparison.
    evidence_for, evidence_against : tuple of str
        Sentences.
    excited : bool
        Whether the manoeuvres could have shown it; if not, it cannot be ruled out.
    form : str
        Which of several forms of the effect it is; empty where there is one.
    """

    effect: str
    probability: float
    parameters: dict[str, Interval]
    gap_after: float
    shrink_percent: Interval
    fit_bic: float
    evidence_for: tuple[str, ...] = ()
    evidence_against: tuple[str, ...] = ()
    excited: bool = True
    form: str = ""


@dataclass(frozen=True)
class NextManoeuvre:
    """What to drive next, and which pair of effects it would tell apart.

    Attributes
    ----------
    sentence : str
        For the driver.
    initial_speed_m_s : float
        Speed at the start [m/s].
    time_s, wheel_torque_nm : array, shape (n,) and (n, 4)
        The torque profile per wheel, fl, fr, rl, rr [s, N m].
    separates : tuple of str
        The effects told apart.
    power_sigma : float
        Predicted distance between them after the best refit of the other [standard deviations of the noise].
    power_now_sigma : float
        The same distance on the logs at hand.
    """

    sentence: str
    initial_speed_m_s: float
    time_s: Array
    wheel_torque_nm: Array
    separates: tuple[str, ...]
    power_sigma: float
    power_now_sigma: float


@dataclass(frozen=True)
class Unexplained:
    """What no effect of the library explains: which equation wants a further term, on what it depends, its shape.

    Attributes
    ----------
    subsystem, signal : str
        Where the term belongs, and the signal that shows it most.
    depends_on, unit : str
        The quantity that the term varies with, and the term's own unit.
    sign, shape : str
        In words: "opposes motion", "grows with its square".
    share : float
        How much of the unexplained part this term takes on all logs, to which it is fitted [-]; NaN where none is.
    x, y : array, shape (n,)
        The term over the quantity, to be drawn.
    sentence : str
        All this in a sentence.
    """

    subsystem: str
    signal: str
    depends_on: str
    unit: str
    sign: str
    shape: str
    share: float
    x: Array
    y: Array
    sentence: str


@dataclass(frozen=True)
class Budget:
    """Shares of the squared gap on the hold-out; they sum to 1.

    Attributes
    ----------
    shares : dict
        "effect:" and its id for each effect that the verdict adds, "structure" for the difference between the models
        that no effect takes, "noise" for the sensors: share with its 95 % interval [-].
    """

    shares: dict[str, Interval]

    def to_json(self) -> dict[str, float]:
        """The shares alone."""
        return {name: share.value for name, share in self.shares.items()}

    def intervals(self) -> dict[str, list[float]]:
        """Low and high of each share."""
        return {name: [share.low, share.high] for name, share in self.shares.items()}


@dataclass(frozen=True)
class OwnParameter:
    """A tunable parameter of the user's own model, fitted alone.

    Attributes
    ----------
    name : str
        The unit's variable.
    estimate : Interval
        Its value.
    nominal : float
        What it was [the estimate's unit].
    effect : str
        The library's parameter that it stands for, `effect.parameter`; empty where it stands for none.
    share : float
        What it takes of the fit logs' loss beyond noise, by its linear response [-].
    gap_after : float or None
        Gap on the hold-out with the unit run at the estimate [sensor noises]; None where it was not run.
    """

    name: str
    estimate: Interval
    nominal: float
    effect: str
    share: float
    gap_after: float | None


@dataclass(frozen=True)
class OwnFinding:
    """What the user's own model says of the gap.

    Attributes
    ----------
    model : str
        Name of its file.
    runs : int
        How often it was run over a log.
    parameters : tuple of OwnParameter
        Its tunable parameters, the one that takes most first.
    effect : str
        The library's effect that it was run with; empty where nothing of it stands for the best one.
    gap_after : float or None
        Gap on the hold-out with that effect [sensor noises].
    sentence : str
        All this in words.
    """

    model: str
    runs: int
    parameters: tuple[OwnParameter, ...]
    effect: str
    gap_after: float | None
    sentence: str


@dataclass(frozen=True)
class RmsError:
    """Root mean square error of the estimator's TRPAC on the hold-out, excited time only [-].

    `before` with the simulation's model in the estimator, `after` with the found effect's parameters where they have a
    place in it; `against` says which truth it is held to.
    """

    before: float
    after: float
    against: str
    sentence: str


@dataclass(frozen=True)
class Trace:
    """One signal of the hold-out: measured, simulated before and after [its SI unit], over time [s]."""

    signal: str
    unit: str
    time_s: Array
    measured: Array
    before: Array
    after: Array
    noise: float
    """Standard deviation of its noise."""


NEEDED = {Verdict.IDENTIFIED: 1, Verdict.PARTIAL: 1, Verdict.COMPOUND: 2}
"""How many of the first causes a verdict says to model."""
ADDED = {**NEEDED, Verdict.AMBIGUOUS: 1}
"""How many of the first causes the gap after is measured with."""


@dataclass(frozen=True)
class Diagnosis:
    """Everything that a diagnosis says; `to_json` is the contract's form, the rest is for the report."""

    verdict: Verdict
    sentence: str
    gap: Gap
    where: tuple[Place, ...]
    heat_map: dict[str, dict[str, float]]
    """Subsystem to regime to the share of the gap [-]."""
    causes: tuple[Cause, ...]
    together: tuple[str, ...] = ()
    """Effects of a compound that are needed together, where it is of more than the car's motion alone."""
    ambiguous_with: tuple[tuple[str, ...], ...] = ()
    cannot_rule_out: tuple[str, ...] = ()
    next_manoeuvre: NextManoeuvre | None = None
    unexplained: Unexplained | None = None
    """What is left where no effect explains the gap (`unknown`), or beside the effect (`partial`)."""
    advice: str = ""
    """What to try where no effect is named but one comes near."""
    build: dict[str, float] = field(default_factory=dict)
    """Differences of the car's build beside the effect: change to its size, see docs/theory/diagnosis.md."""
    budget: Budget | None = None
    """None where there is no gap to share out."""
    trpac: RmsError | None = None
    own_model: OwnFinding | None = None
    """None without a model of the user."""
    rating: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    """ISO/TS 18571 rating per signal, before and after; None where it is not defined."""
    traces: tuple[Trace, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    """Files and their SHA-256, versions, seed, rates."""

    def to_json(self) -> dict[str, Any]:
        """The contract's JSON, and further keys."""
        return {
            "schema": 1,
            "verdict": str(self.verdict),
            "sentence": self.sentence,
            "gap": {
                "before": asdict(self.gap.before),
                "after": asdict(self.gap.after),
                "noise_floor": self.gap.noise_floor,
                "measured_on": self.gap.measured_on,
            },
            "where": [asdict(place) for place in self.where],
            "heat_map": self.heat_map,
            "causes": [_cause(cause) for cause in self.causes],
            "together": list(self.together),
            "ambiguous_with": [list(group) for group in self.ambiguous_with],
            "cannot_rule_out": list(self.cannot_rule_out),
            "next_manoeuvre": _profile(self.next_manoeuvre),
            "unexplained": _term(self.unexplained),
            "advice": self.advice,
            "build": self.build,
            "budget": None if self.budget is None else self.budget.to_json(),
            "budget_intervals": None if self.budget is None else self.budget.intervals(),
            "trpac": None if self.trpac is None else asdict(self.trpac),
            "own_model": None if self.own_model is None else asdict(self.own_model),
            "rating": {k: {"before": b, "after": a} for k, (b, a) in self.rating.items()},
            "warnings": list(self.warnings),
            "provenance": self.provenance,
        }


def at_bound_in_words(name: str) -> str:
    """What is said against an estimate that lies at its bound."""
    return f"{name} lies at its bound: larger values are not plausible, so look for another cause."


def needed(diagnosis: Diagnosis) -> tuple[Cause, ...]:
    """The causes that the verdict says to model: none where it names no single set."""
    return diagnosis.causes[: max(NEEDED.get(diagnosis.verdict, 0), len(diagnosis.together))]


def added(diagnosis: Diagnosis) -> tuple[Cause, ...]:
    """The causes that the gap after is measured with; in an ambiguous verdict the likeliest."""
    return diagnosis.causes[: max(ADDED.get(diagnosis.verdict, 0), len(diagnosis.together))]


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        **asdict(cause),
        "shrink_percent": cause.shrink_percent.to_json(),
        "evidence_for": list(cause.evidence_for),
        "evidence_against": list(cause.evidence_against),
    }


def _profile(manoeuvre: NextManoeuvre | None) -> dict[str, Any] | None:
    if manoeuvre is None:
        return None
    return {
        **asdict(manoeuvre),
        "time_s": manoeuvre.time_s.tolist(),
        "wheel_torque_nm": manoeuvre.wheel_torque_nm.tolist(),
        "separates": list(manoeuvre.separates),
    }


def _term(term: Unexplained | None) -> dict[str, Any] | None:
    return None if term is None else {**asdict(term), "x": term.x.tolist(), "y": term.y.tolist()}
