"""When a camera's system takes pictures, when it tells their results, and which of them get lost."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera_forms import function
from .camera_road import Passage
from .camera_system import Chain

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

PACE = (0.5, 1.8)
"""Least and most rate of pictures that go with the way, over the usual one [-]."""
BUS_S = (0.01, 0.02)
"""From one message to the next."""
LATE_S = (1.5, 5.0)
"""How long after the log's begin a late camera begins."""
PAUSE_S, PAUSE_EVERY_S = (0.6, 2.0), 15.0
"""Duration of a pause, and from one to the next in the mean."""
RUN = (3, 9)
"""Results of a run of lost ones, at the ends of which others are told."""
GATEWAY_S = 0.006
"""Mean time that a gateway adds."""
SLOW_M_S, SLOW_SHARE = (1.5, 4.0), 0.5
"""Speeds below which a system may not work, at most that share of a drive's mean speed."""
LEAST_LOST = 0.03
"""Share of results lost where that is the point [-]."""


def timing(chain: Chain, passage: Passage, log: str) -> tuple[Array, Array]:
    """When each picture was taken, and when its result was ready [s]."""
    begins, end_s = -1.0 if chain.forms["begins"] == "before" else 0.0, passage.end_s
    rng = chain.rng(log, 1)
    if chain.forms["captures"] == "by_way":
        taken = _by_way(chain, passage, begins, rng.random())
    else:
        cycle, n = 1.0 / chain.rate_hz, int((end_s - begins) * chain.rate_hz * 1.1) + 2
        first = begins + rng.uniform(0.0, cycle)
        taken = first + np.cumsum(function(chain.forms, "captures")(cycle, n, rng)) - cycle
    work = function(chain.forms, "work")(chain.work_s, taken.size, chain.rng(log, 2))
    ready = np.maximum.accumulate(taken + work)
    if chain.forms["sent"] == "on_a_bus":
        message = chain.rng("", 20).choice(BUS_S)
        ready = np.ceil(ready / message) * message
    elif chain.forms["sent"] == "through_gateway":
        ready = np.maximum.accumulate(ready + chain.rng(log, 40).gamma(2.0, GATEWAY_S / 2.0, ready.size))
    there = (taken < end_s) & _awake(chain, passage, taken, log)
    return taken[there], ready[there]


def _by_way(chain: Chain, passage: Passage, begins: float, phase: float) -> Array:
    """As far apart along the road as at the drive's mean speed, within what the camera can do."""
    clock = np.arange(begins, passage.end_s, 1e-3)
    pace = np.clip(passage.speed(clock) / passage.speed_m_s.mean(), *PACE)
    count = phase + np.cumsum(pace) * chain.rate_hz * 1e-3
    return np.interp(np.arange(1, int(count[-1]) + 1), count, clock)


def _awake(chain: Chain, passage: Passage, taken: Array, log: str) -> Flags:
    """Whether the camera runs; a short log has no time for it to be late."""
    awake, end_s = np.ones(taken.size, bool), passage.end_s
    if chain.forms["begins"] == "late":
        awake &= taken >= chain.rng(log, 21).uniform(*LATE_S)
    elif chain.forms["begins"] == "ends_early":
        awake &= taken < end_s - chain.rng(log, 21).uniform(*LATE_S)
    if chain.forms["pauses"] == "when_slow":
        least = min(chain.rng("", 41).uniform(*SLOW_M_S), SLOW_SHARE * float(passage.speed_m_s.mean()))
        awake &= passage.speed(taken) >= least
    if chain.forms["pauses"] == "some":
        rng, at = chain.rng(log, 22), 0.0
        while (at := at + rng.exponential(PAUSE_EVERY_S)) < end_s - PAUSE_S[1]:
            until = at + rng.uniform(*PAUSE_S)
            awake &= (taken < at) | (taken >= until)
            at = until
    return awake


def delivered(chain: Chain, n: int, log: str) -> tuple[NDArray[np.integer[Any]], Flags]:
    """Which result is told in each one's place, and whether any is."""
    rng, itself, kind = chain.rng(log, 3), np.arange(n), chain.forms["lost"]
    if kind == "one_by_one":
        return itself, rng.random(n) >= chain.dropped
    share = max(chain.dropped, LEAST_LOST)
    if kind == "repeated":
        again = rng.random(n) < share
        return np.where(again, np.maximum(itself - 1, 0), itself), np.ones(n, bool)
    there = np.ones(n, bool)
    for at in np.flatnonzero(rng.random(n) < share / np.mean(RUN)):
        there[at : at + rng.integers(RUN[0], RUN[1] + 1)] = False
    return itself, there


def numbers(chain: Chain, taken: Array, there: Flags) -> NDArray[np.integer[Any]]:
    """`frame_id` of each result that is told."""
    kind, counted = chain.forms["numbering"], chain.first_id + np.arange(taken.size)
    if kind == "dense":
        return chain.first_id + np.arange(np.count_nonzero(there))
    if kind == "four_bits":  # of a message, not of a picture
        return (chain.first_id + np.arange(np.count_nonzero(there))) % 16
    if kind == "strided":
        return (chain.first_id + 3 * np.arange(taken.size))[there]
    if kind == "wraps":
        return counted[there] % 256
    if kind == "clock":  # a picture's time in milliseconds, no two the same
        return (chain.first_id + 2000 + np.round(1000.0 * taken).astype(int))[there]
    return counted[there]
