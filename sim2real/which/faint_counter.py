"""A pulse counter whose steps are lost in noise: what is left of it is its age, which a delay has too.

Where a trace of its lattice is left, see `sim2real.observing.lattice_trace`, late wheel speeds are a counter's. Without
one it differs from a delay by its averaging alone, which other things do too: it stands beside the delay as its rival.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.base import parameter
from scenarios.effects.wheel_speed_quantisation import MOST_TEETH
from sim2real.observing.drive import WHEEL, Drive
from sim2real.observing.evidence import Evidence, all_logs
from sim2real.observing.lattice import AGE_RANGE, LONGEST_WINDOW_S, Lattice, RunningCounter, SmoothCounter
from sim2real.observing.lattice_trace import common_trace
from sim2real.observing.observer import Simulation
from sim2real.result import Verdict
from sim2real.which.contest import Contest, Entry, enter
from sim2real.which.fitting import FULL_STEPS, Fit, OutsideCandidate
from sim2real.which.selection import Decision, probabilities

Array = NDArray[np.float64]

DELAY = "wheel_speed_delay"
"""What such a counter passes for."""
HIDDEN = 2.0
"""Steps of up to this many standard deviations of the wheel speeds as logged leave no trace [-]."""
FINEST_TEETH = 5000.0
"""A counter that would need more pulses per revolution to leave no trace is none [-]."""
MOST_BELIEF = 0.4
"""Share of the belief in both that is the counter's at most: late messages average alike, and have no teeth [-]."""


@dataclass(frozen=True)
class HiddenCounter(SmoothCounter):
    """A counter of so many teeth that noise hides its steps; how many they are nothing tells."""

    teeth: float = parameter(
        "-",
        "pulses per revolution, at least",
        neutral=FINEST_TEETH,
        low=1.0,
        high=MOST_TEETH,
        starts=(2.0 * FINEST_TEETH,),
        open_share=np.inf,
    )
    window_s: float = parameter(
        "s",
        "counting time, as far as the age tells it",
        neutral=0.0,
        low=0.0,
        high=LONGEST_WINDOW_S,
        starts=(0.01, 0.02, 0.05),
        open_share=AGE_RANGE - 1.0,
    )

    @property
    def step_rad_s(self) -> float:
        """None that a prediction could take into account."""
        return 0.0


class HiddenRunningCounter(HiddenCounter):
    """One that reports at every row what it counted over the last window."""

    held = RunningCounter.held


@dataclass(frozen=True)
class HiddenCandidate(OutsideCandidate):
    """The counter, of at least so many teeth."""

    least_teeth: float = 1.0

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """As elsewhere, but for the teeth."""
        low, high = super().bounds
        return np.array([self.least_teeth, *low[1:]]), high


def traced(drives: Sequence[Drive], first: Sequence[Fit]) -> Lattice | None:
    """The lattice of a counter that leaves a trace in most logs, and whose age shows best of all effects."""
    trace = common_trace([d.trace for d in drives])
    if trace is None or not first or first[0].candidate.ids != (DELAY,):
        return None
    return trace.aged(float(first[0].x[0]))


def for_a_delay(decision: Decision) -> bool:
    """Whether late wheel speeds are what a decision blames, alone or beside another tyre."""
    one = decision.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
    return one and decision.winner.ids[:1] == (DELAY,)


def beside_a_counter(
    contest: Contest, decision: Decision, model: Simulation, fit_to: Evidence, holdout: Evidence
) -> tuple[Contest, Decision]:
    """Contest and decision with such a counter beside the delay that the decision is for, where it could be one.

    A counter as fine as that is rare, so it has to do better than the delay. And however well it averages, it does not
    come before the delay: many things do that are no counter.
    """
    delay = next(e for e in contest.singles if e.ids == (DELAY,))
    counter = _counter_as_late(delay, model, fit_to, holdout)
    if counter is None:
        return contest, decision
    contest = replace(contest, singles=(*contest.singles, counter))
    ours, its = probabilities(contest, [delay, counter], fit_to, holdout)[1:]
    if its <= ours:
        return contest, decision
    share = min(float(its / (ours + its)), MOST_BELIEF)
    both = decision.probability[DELAY]
    belief = {**decision.probability, DELAY: (1.0 - share) * both, counter.ids[0]: share * both}
    rivals = (counter, *decision.rivals)
    return contest, replace(decision, verdict=Verdict.AMBIGUOUS, rivals=rivals, probability=belief)


def _counter_as_late(delay: Entry, model: Simulation, fit_to: Evidence, holdout: Evidence) -> Entry | None:
    """The counter that does best, fitted from a delay's age; None where it would have to be finer than any is."""
    # steps leave their trace in the rows as logged: on the grid of the diagnosis these are averaged, noise and all
    seen = zip(*all_logs(fit_to, holdout), strict=True)
    sigma = min(float(np.fmax(drive.spread_rad_s, noise.sigma[WHEEL].max())) for drive, noise in seen)
    age_s = float(delay.fitted.x[0])
    if HIDDEN * sigma * age_s * FINEST_TEETH < 2.0 * np.pi:
        return None
    least = 2.0 * np.pi / (HIDDEN * sigma * age_s)
    entries = []
    for kind, windows in ((HiddenCounter, 1.0), (HiddenRunningCounter, 2.0)):
        candidate = HiddenCandidate(model, (HiddenCounter.id,), least_teeth=least / windows, kind=kind)
        start = np.array([FINEST_TEETH, windows * age_s])
        entries.append(enter(candidate, fit_to, holdout, start, FULL_STEPS))
    return min(entries, key=lambda e: e.loss)
