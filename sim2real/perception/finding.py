"""What the camera chain's part of the diagnosis says: its candidates, and the verdict of them all."""

from __future__ import annotations

from dataclasses import dataclass

from sim2real.perception.chain import Oddity
from sim2real.result import Interval, Measure, Place, Verdict


@dataclass(frozen=True)
class CameraCandidate:
    """One or two effects of the camera chain with their evidence.

    Attributes
    ----------
    effects : tuple of str
        Ids. friction_offset is the dynamics' own: its gain here is what the friction reference adds to it.
    signal : str
        What it was judged by.
    gain_fit, gain_holdout : float
        Quasi-log-likelihood over "as simulated", fitted, and on the hold-out at the same parameters [nats].
    size : int
        Number of parameters.
    observations : int
        Pictures or rows behind it.
    effective : float
        Observations that err independently: borders passed, seconds of confidence, stretches of road.
    score : float
        Both gains less half the logarithm of `effective` per parameter [nats].
    parameters : dict
        Estimates with 95 % intervals.
    after : Measure
        Gap that is left on the hold-out with it [noise floors].
    shrink_percent : Interval
        By how much it shrinks the camera's gap on the hold-out [%].
    evidence_for, evidence_against : tuple of str
        Sentences.
    excited : bool
        Whether the logs could have shown it.
    """

    effects: tuple[str, ...]
    signal: str
    gain_fit: float
    gain_holdout: float
    size: int
    observations: int
    effective: float
    score: float
    parameters: dict[str, Interval]
    after: Measure
    shrink_percent: Interval
    evidence_for: tuple[str, ...]
    evidence_against: tuple[str, ...]
    excited: bool


@dataclass(frozen=True)
class PerceptionFinding:
    """What the camera's columns say, to be merged with what the dynamics say.

    Attributes
    ----------
    verdict : Verdict
        Of the camera chain alone.
    causes : tuple of str
        Effects that it stands by: one, several of a compound, or the best of an ambiguous set.
    candidates : tuple of CameraCandidate
        Every one tried, best score first.
    before, after : Measure
        Gap on the hold-out as simulated, and with the causes, of which an unknown gap has none [noise floors]; the
        floor is 1 per signal. NaN where the hold-out has nothing of the camera.
    ambiguous_with : tuple of tuple of str
        Sets that these logs cannot tell apart.
    cannot_rule_out : dict
        Effect to the reason why these logs could not show it.
    places : tuple of Place
        Where the hold-out shows the gap most.
    next_step : str
        What to drive to tell apart what is ambiguous; empty where nothing is.
    odd : tuple of Oddity
        What no effect of the library explains.
    warnings : tuple of str
        Damage of the columns, and conflicts of class with road.yaml.
    """

    verdict: Verdict
    causes: tuple[str, ...]
    candidates: tuple[CameraCandidate, ...]
    before: Measure
    after: Measure
    ambiguous_with: tuple[tuple[str, ...], ...]
    cannot_rule_out: dict[str, str]
    places: tuple[Place, ...]
    next_step: str
    odd: tuple[Oddity, ...]
    warnings: tuple[str, ...]

    @property
    def unexplained(self) -> tuple[str, ...]:
        """What no effect of the library explains, in sentences."""
        return tuple(one.sentence for one in self.odd)
