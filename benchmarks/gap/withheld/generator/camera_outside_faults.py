"""How the deviations outside the library come about, but for the simplest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera_road import CameraRoad, Passage, Whole
from .camera_system import Chain, Fault

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

SWINGS_S = ((9.0, 14.0), (18.0, 30.0))
"""Periods of a receiver's error, a faster and a slower one."""
SPRAY_S, CLEAR_S = (1.5, 4.0), (2.5, 7.0)
"""How long a car ahead throws up water, and until the next does."""
RAIN_S, DRY_S = (2.0, 5.0), (2.0, 5.0)
"""How long drops stand on the glass, and until the next do."""
SURE_M_S, SURER = 10.0, 4
"""Speed at which half of what slow pictures lack is there, and the power of the speed that it goes with."""
PUSH_M_S2, MOST_PUSH = 3.0, 1.5
"""Acceleration that a friction's reference is off by the stated share at, and the most that counts over it."""
ROOM = 0.4
"""Share of a stretch that a border may move by."""


def in_spells(
    chain: Chain,
    taken: Array,
    log: str,
    aspect: int,
    lasts_s: tuple[float, float],
    until_s: tuple[float, float],
) -> Flags:
    """Whether a picture is in one of the spells that come and go over a drive."""
    rng, inside = chain.rng(log, aspect), np.zeros(taken.size, bool)
    at = taken[0] + rng.uniform(0.0, until_s[1])
    while at < taken[-1]:
        end = at + rng.uniform(*lasts_s)
        inside |= (taken >= at) & (taken < end)
        at = end + rng.uniform(*until_s)
    return inside


def set_clock_s(chain: Chain, fault: Fault, taken: Array, log: str) -> Array:
    """By how much a clock that is set once or twice is off in each picture, about none in the mean [s]."""
    rng = chain.rng(log, 50)
    moments = taken[0] + np.sort(rng.uniform(0.25, 0.75, rng.integers(1, 3))) * (taken[-1] - taken[0])
    before = rng.random() < 0.5
    ahead = (np.searchsorted(moments, taken) + before) % 2
    return np.asarray(fault.clock_set_s * (ahead - ahead.mean()))


def extrapolated_m(passage: Passage, taken: Array, age_s: float) -> Array:
    """By how much a place is off that goes on from where the car was, at the speed that it had then [m]."""
    old = taken - age_s
    return np.asarray(passage.at(old) + passage.speed(old) * age_s - passage.at(taken))


def wandered_m(chain: Chain, fault: Fault, time_s: Array, log: str) -> Array:
    """By how far positions are off at a time, as satellites rise and houses pass, about none in the mean [m]."""
    rng = chain.rng(log, 51)
    swings = (np.sin(2.0 * np.pi * (time_s / rng.uniform(*period) + rng.random())) for period in SWINGS_S)
    return np.asarray(fault.wandered_m * sum(swings))


def rained_on(chain: Chain, fault: Fault, true: Whole, taken: Array, log: str) -> tuple[Whole, Flags]:
    """Classes with drops on the glass, that look like a wet road, and which of them are not the road's."""
    rain = in_spells(chain, taken, log, 52, RAIN_S, DRY_S)
    taken_for_wet = rain & (chain.rng(log, 53).random(true.size) < fault.rained) & (true != 1)
    return np.where(taken_for_wet, 1, true), taken_for_wet


def weather_kept(chain: Chain, fault: Fault, passage: Passage, taken: Array, log: str) -> Array | float:
    """What spray, or a car that is too slow to see the road move, leaves of the confidence [-]."""
    kept: Array | float = 1.0
    if fault.spray > 0.0:
        kept = kept * (1.0 - fault.spray * in_spells(chain, taken, log, 54, SPRAY_S, CLEAR_S))
    if fault.slow_unsure > 0.0:
        kept = kept * (1.0 - fault.slow_unsure / (1.0 + (passage.speed(taken) / SURE_M_S) ** SURER))
    return kept


def pushed_share(fault: Fault, push_m_s2: Array) -> Array:
    """What a friction's reference reads over what is there, as the car accelerates and brakes [-]."""
    push = np.clip(push_m_s2 / PUSH_M_S2, -MOST_PUSH, MOST_PUSH)
    return np.asarray(1.0 - fault.measured_push * (push - push.mean()))


def shrunk(road: CameraRoad, by_m: float) -> CameraRoad:
    """The road as it was when its water and snow reached farther, by as much at each edge."""
    borders, surface = road.borders, np.array(road.surface)
    room = ROOM * np.diff(np.concatenate([[0.0], borders, [borders[-1] + 50.0]]))
    outwards = np.where(surface[1:] > surface[:-1], -by_m, by_m)
    return road.with_borders(borders + np.clip(outwards, -room[:-1], room[1:]))
