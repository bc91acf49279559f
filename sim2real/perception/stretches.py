"""Stretches of road that have a friction reference, and what such a reference means by friction.

A class's value is a theta. A reference may tell theta, or the maximum of the tyre's curve at it, which is what a brake
test or a friction tester measures and up to a sixth more: which one no log says, so both are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import Effect
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import make_setup
from sim2real.logs import Log
from sim2real.perception.late_reference import Answer
from trpac_core.tyre import peak_friction

Array = NDArray[np.float64]

BORDER_M = 1.5
"""Rows closer to a border are left out: either side may be under the wheels, and references average [m]."""
FEWEST_ROWS = 5
TOLERANCE = 0.02
"""Standard deviation with which a reference gives a friction that is exactly known: testers repeat that well [-]."""
SIMULATED = (
    "road.yaml's friction",
    "the tyre's peak on road.yaml's friction",
    "the friction that the dynamics show",
    "the tyre's peak on the friction that the dynamics show",
)
"""Frictions that the simulation has already."""
OF_ROAD_FILE = 2
"""The first of them are those that it has without the dynamics' findings."""
MOST_THETA, THETAS = 2.0, 201
"""Range of the tables from theta to its peak, and their points."""


@dataclass(frozen=True)
class Reading:
    """What a reference means by friction: a rising table from theta to what it tells.

    Attributes
    ----------
    what : str
        In words, of a class's value.
    theta, told : array, shape (k,)
        The table [-].
    """

    what: str
    theta: Array
    told: Array

    def of(self, theta: Array) -> Array:
        """What the reference tells of a theta, same shape [-]."""
        return np.interp(theta, self.theta, self.told)

    def theta_of(self, told: Array) -> Array:
        """The theta behind what the reference tells, same shape [-]."""
        return np.interp(told, self.told, self.theta)


def readings(vehicle: VehicleFile) -> tuple[Reading, Reading]:
    """Theta itself, and the tyre's peak at it under the front wheel's load."""
    theta = np.linspace(0.0, MOST_THETA, THETAS)
    return Reading("the class's value", theta, theta), Reading(
        "the tyre's peak at the class's value", theta, _peaks(theta, vehicle)
    )


def _peaks(theta: Array, vehicle: VehicleFile) -> Array:
    """Maximum of the tyre's curve at thetas, same shape [-]."""
    core = vehicle.to_core()
    load_n = core.wheel_load(front=True)
    return np.array([peak_friction(t, load_n, core.longitudinal_stiffness_n) for t in theta.flat]).reshape(
        theta.shape
    )


@dataclass(frozen=True)
class Stretches:
    """Pieces of road within one segment, one row each.

    Attributes
    ----------
    log : array of str, shape (n,)
        Where.
    from_s, to_s : array, shape (n,)
        When the front axle was on it [s].
    classes : array of int, shape (n,)
        Surface.
    reference, deviation : array, shape (n,)
        Mean mu_reference and its standard deviation, tolerance included [-].
    simulated : array, shape (n, 4)
        Frictions that the simulation has there, mean of left and right, in the order of `SIMULATED` [-].
    """

    log: NDArray[np.str_]
    from_s: Array
    to_s: Array
    classes: NDArray[np.intp]
    reference: Array
    deviation: Array
    simulated: Array

    def __len__(self) -> int:
        return len(self.classes)


def find_stretches(
    logs: Sequence[Log],
    roads: Sequence[RoadFile],
    vehicle: VehicleFile,
    answer: Answer,
    found: Sequence[Effect] = (),
) -> Stretches:
    """Stretches of some drives that have a friction reference, where it has settled.

    `answer` is how the reference answers a change of road; `found` are effects that the dynamics show.
    """
    rows = [
        row
        for log, road in zip(logs, roads, strict=True)
        if "mu_reference" in log.signals
        for row in _of_one(log, road, vehicle, answer, found)
    ]
    columns = list(zip(*rows, strict=True)) if rows else [()] * 7
    numbers = [np.array(c, dtype=np.float64) for c in columns[1:]]
    return Stretches(
        np.array(columns[0], dtype=np.str_),
        numbers[0],
        numbers[1],
        numbers[2].astype(np.intp),
        numbers[3],
        numbers[4],
        numbers[5].reshape(len(rows), len(SIMULATED)),
    )


def _of_one(
    log: Log, road: RoadFile, vehicle: VehicleFile, answer: Answer, found: Sequence[Effect]
) -> list[tuple]:
    core = vehicle.to_core()
    simulated = _simulated(road, vehicle, found)
    front_m = log.signals["position_m"] + core.cog_to_front_axle_m
    starts = [-np.inf, *(s.start_m for s in road.segments[1:]), np.inf]
    rows = []
    for segment, begin, end, friction in zip(road.segments, starts[:-1], starts[1:], simulated, strict=True):
        inside = (front_m > begin + BORDER_M) & (front_m < end - BORDER_M)
        inside &= log.time_s >= _settled_from(log.time_s, front_m, begin, answer)
        inside &= np.isfinite(log.signals["mu_reference"])
        if np.count_nonzero(inside) < FEWEST_ROWS:
            continue
        values = log.signals["mu_reference"][inside]
        # It may settle more slowly than all logs together say: what still moves in a stretch counts as its error.
        settled, newest = values[len(values) // 2 :], values[3 * len(values) // 4 :]
        scatter = float(settled.std() / np.sqrt(min(len(settled), 10)))
        moving = abs(float(np.median(newest) - np.median(settled)))
        rows.append(
            (
                log.name,
                log.time_s[inside][0],
                log.time_s[inside][-1],
                int(segment.surface_class),
                float(np.median(settled)),
                float(np.hypot(TOLERANCE, np.hypot(scatter, moving))),
                friction,
            )
        )
    return rows


def _settled_from(time_s: Array, front_m: Array, begin_m: float, answer: Answer) -> float:
    """When the reference tells of a segment; of the one that a log begins in it does so at once [s]."""
    ahead = np.flatnonzero(front_m > begin_m)
    if not len(ahead) or np.isnan(front_m[: ahead[0]]).all():
        return float(-np.inf)
    return float(time_s[ahead[0]] + answer.settles_s)


def _simulated(road: RoadFile, vehicle: VehicleFile, found: Sequence[Effect]) -> Array:
    """Frictions per segment, shape (segments, 4), in the order of `SIMULATED`."""
    table = make_setup(vehicle, road).road
    with_found = table
    for effect in found:
        with_found = effect.road(with_found)
    columns = [
        values.mean(axis=1)
        for each in (table, with_found)
        for values in (each.theta, _peaks(each.theta, vehicle))
    ]
    return np.column_stack(columns)
