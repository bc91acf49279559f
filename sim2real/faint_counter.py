"""A pulse counter whose steps are lost in noise: what is left of it is its age, which a delay has too.

Where a trace of its lattice is left, see `sim2real.lattice_trace`, late wheel speeds are a counter's. Without one it
differs from a delay by its averaging alone, and may stand beside one as what it is as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.base import parameter
from scenarios.effects.wheel_speed_quantisation import MOST_TEETH
from sim2real.contest import Contest, enter
from sim2real.drive import WHEEL, Drive
from sim2real.evidence import Evidence, all_logs
from sim2real.fitting import FULL_STEPS, Candidate, Fit
from sim2real.lattice import AGE_RANGE, LONGEST_WINDOW_S, Lattice, RunningCounter, SmoothCounter
from sim2real.lattice_trace import common_trace
from sim2real.observer import Simulation

Array = NDArray[np.float64]

DELAY = "wheel_speed_delay"
"""What such a counter passes for."""
HIDDEN = 2.0
"""Steps of up to this many standard deviations of the wheel speeds leave no trace [-]."""
FINEST_TEETH = 5000.0
"""A counter that would need more pulses per revolution to leave no trace is none [-]."""
ODDS = 0.1
"""Of a counter as fine as that against a plain delay, before the logs are looked at [-]."""


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
class HiddenCandidate(Candidate):
    """The counter, of at least so many teeth."""

    least_teeth: float = 1.0
    kind: type[HiddenCounter] = HiddenCounter

    @cached_property
    def kinds(self) -> tuple[type[HiddenCounter], ...]:
        """The one class."""
        return (self.kind,)

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


def with_hidden_counter(contest: Contest, model: Simulation, fit_to: Evidence, holdout: Evidence) -> Contest:
    """The contest with such a counter in it, where a delay could be one."""
    delay = next(e for e in contest.singles if e.ids == (DELAY,))
    sigma = min(float(n.sigma[WHEEL].max()) for n in all_logs(fit_to, holdout)[1])
    age_s = float(delay.fitted.x[0])
    least = 2.0 * np.pi / (HIDDEN * sigma * age_s)
    if least > FINEST_TEETH:
        return contest
    entries = []
    for kind, windows in ((HiddenCounter, 1.0), (HiddenRunningCounter, 2.0)):
        candidate = HiddenCandidate(model, (HiddenCounter.id,), least_teeth=least / windows, kind=kind)
        start = np.array([FINEST_TEETH, windows * age_s])
        entries.append(enter(candidate, fit_to, holdout, start, FULL_STEPS))
    best = min(entries, key=lambda e: e.loss)
    return replace(contest, singles=(*contest.singles, replace(best, odds=ODDS)))
