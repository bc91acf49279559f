"""A friction reference that comes late: its level changes a dead time after the front axle passed the border.

A filter answers a change at once, if slowly; a reference that is computed afterwards, or stamped when it was sent, does
nothing for a while. Both are fitted: levels per class, seen through a first-order filter, after a dead time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from scenarios.files import RoadFile, VehicleFile
from sim2real.logs import Log
from sim2real.perception.chain import Oddity
from trpac_core.vision.classes import Surface

Array = NDArray[np.float64]

STEP_S = 0.02
DEAD_TIMES_S = np.arange(0.0, 1.55, 0.1)
FILTERS_S = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
"""Dead times and time constants that are tried [s]."""
LATE_S = 0.45
"""Dead time from which on a reference is late: held values and moving means look like up to 0.3 s [s]."""
SETTLED_LAGS = 3.0
"""Time constants after which a filtered reference has settled, to a twentieth of the change [-]."""
EXPLAINS = 0.5
"""Share of what filters alone leave that a dead time may leave."""
MOST_OFF = 0.3
"""Errors beyond it count as this much: references fail at times [-]."""
FEWEST = 50
"""Steps of the grid with a reference that can tell."""


@dataclass(frozen=True)
class Course:
    """A log's reference and the class under the front axle, on an even clock; shapes (n,), and (n, 3) as indicators."""

    reference: Array
    on: Array


@dataclass(frozen=True)
class Answer:
    """How a reference answers a change of road: after a dead time, then through a first-order filter.

    Attributes
    ----------
    dead_s, lag_s : float
        Dead time and time constant [s].
    is_late : bool
        Whether the dead time is one that no filter, mean or held value looks like.
    """

    dead_s: float = 0.0
    lag_s: float = 0.0
    is_late: bool = False

    @property
    def settles_s(self) -> float:
        """Time after a border until it tells of the road after it [s]."""
        return self.dead_s + SETTLED_LAGS * self.lag_s


def answer_of(logs: Sequence[Log], roads: Sequence[RoadFile], vehicle: VehicleFile) -> Answer:
    """The answer that all logs' references show; an immediate one where there is nothing to answer to."""
    courses = list(_courses(logs, roads, vehicle))
    if sum(len(c.reference) for c in courses) < FEWEST or not any(_changes(c) for c in courses):
        return Answer()
    left = {(dead, lag): _left(courses, dead, lag) for dead, lag in product(DEAD_TIMES_S, FILTERS_S)}
    dead, lag = min(left, key=lambda key: left[key])
    at_once = min(left[0.0, one] for one in FILTERS_S)
    return Answer(float(dead), lag, dead >= max(LATE_S, lag) and left[dead, lag] <= EXPLAINS * at_once)


def odd_lateness(answer: Answer) -> Oddity | None:
    """The gap that a late reference is; None where it is in time."""
    if not answer.is_late:
        return None
    told = (
        f"mu_reference follows the road {answer.dead_s:.1f} s late: it does not react before, unlike a filter. "
        "Check when it is calculated and which time stamp it gets."
    )
    return Oddity("mu_reference", told, "time", "late", "a dead time")


def _courses(logs: Sequence[Log], roads: Sequence[RoadFile], vehicle: VehicleFile) -> Iterator[Course]:
    ahead_m = vehicle.to_core().cog_to_front_axle_m
    for log, road in zip(logs, roads, strict=True):
        if "mu_reference" not in log.signals:
            continue
        position = log.signals["position_m"]
        there = np.isfinite(position)
        clock = np.arange(log.time_s[0], log.time_s[-1], STEP_S)
        front_m = np.interp(clock, log.time_s[there], position[there]) + ahead_m
        starts = [segment.start_m for segment in road.segments[1:]]
        classes = np.array([int(segment.surface_class) for segment in road.segments])
        on = classes[np.searchsorted(starts, front_m, side="right")][:, None] == np.arange(len(Surface))
        newest = np.maximum(np.searchsorted(log.time_s, clock, side="right") - 1, 0)
        yield Course(log.signals["mu_reference"][newest], on.astype(np.float64))


def _changes(course: Course) -> bool:
    return bool((np.isfinite(course.reference) & (np.ptp(course.on, axis=0).max() > 0.0)).any())


def _left(courses: Sequence[Course], dead_s: float, lag_s: float) -> float:
    """Mean square that the best levels leave [-]."""
    seen = np.vstack([_seen(c.on, dead_s, lag_s) for c in courses])
    reference = np.concatenate([c.reference for c in courses])
    known = np.isfinite(reference)
    seen, reference = seen[known], reference[known]
    weight = off = np.ones(len(reference))
    for _ in range(3):
        weighted = seen * np.square(weight)[:, None]
        levels = np.linalg.lstsq(weighted.T @ seen, weighted.T @ reference, rcond=None)[0]
        off = np.abs(reference - seen @ levels)
        weight = 1.0 / np.sqrt(np.maximum(1.0, off / (2.0 * np.median(off) + 1e-3)))
    return float(np.mean(np.minimum(off, MOST_OFF) ** 2))


def _seen(on: Array, dead_s: float, lag_s: float) -> Array:
    """Classes as a reference that is late and filtered has them."""
    steps = round(dead_s / STEP_S)
    late = np.vstack((np.repeat(on[:1], steps, axis=0), on[: len(on) - steps]))
    if not lag_s:
        return late
    from scipy.signal import lfilter  # here, since its import is slow

    share = 1.0 - np.exp(-STEP_S / lag_s)
    begun = (1.0 - share) * late[:1]
    return np.asarray(lfilter([share], [1.0, share - 1.0], late, axis=0, zi=begun)[0])
