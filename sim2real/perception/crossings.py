"""Where the camera saw the surface change: a bracket of stamps about each border of road.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.camera_pitch import seen_distance_m
from scenarios.perception import surfaces_at
from sim2real.perception.frames import LEAST_AHEAD_M, Results

Array = NDArray[np.float64]

AGES_S = np.linspace(0.0, 1.0, 201)
"""Ages of a picture for which the way driven is tabulated; linear between them [s]."""
COARSE_AGES_S = AGES_S[::10]
COARSE_WAYS_M = np.arange(-6.0, 6.1, 0.25)
"""Shifts among which the classes' sequence is first laid over the road's [s], [m]."""
MISMATCH_NATS = 0.5
"""What a picture of another class than the road's costs in that search: neighbouring pictures see the same [nats]."""
COARSE_PRIOR = (0.2, 1.5)
"""Shifts beyond these are not expected; a far one must earn its place by matches [s], [m]."""
WINDOW_M = 15.0
"""Farthest from where a border is expected that its pictures are looked at [m]."""
FEWEST_SIDE = 2
"""Pictures that must show each of the two classes."""
MOST_WRONG = 0.3
"""Share of pictures about a border that may contradict it."""
LEAST_ERROR = 0.02
"""Share of pictures that are taken to be wrong even where none contradicts."""
LIKELY_NATS = 2.0
"""Splits less likely than the best one by no more than this are in the bracket [nats]."""
WAYS = 10
"""Column of the crossings' numbers that is a table."""


@dataclass(frozen=True)
class Crossings:
    """Borders that the camera's classes show, one row each.

    The border lies between the last picture of the old class and the first of the new one. What of a picture's stamp
    its class is for is not known; at share s of the stamp the bracket is `low_m` + s `low_length_m` to the like.

    Attributes
    ----------
    log : array of str, shape (k,)
        Where it was seen.
    time_s, speed_m_s, border_m : array, shape (k,)
        When and how fast it was passed in the stamps, and where road.yaml has it [s], [m/s], [m].
    accel_m_s2 : array, shape (k,)
        By how much the car had become faster in the second before [m/s²].
    since_s, since_m : array, shape (k,)
        Time and way since the log's begin [s], [m].
    low_m, high_m : array, shape (k,)
        Begin of the stamps of the last old and the first new picture, minus the border [m].
    low_length_m, high_length_m : array, shape (k,)
        Lengths of these stamps [m].
    way_m : array, shape (k, 201)
        Way driven during each of `AGES_S` before [m].
    ahead_m : array, shape (k,)
        Distance of the stamps' middle from the lens [m].
    """

    log: NDArray[np.str_]
    time_s: Array
    speed_m_s: Array
    border_m: Array
    accel_m_s2: Array
    since_s: Array
    since_m: Array
    low_m: Array
    high_m: Array
    low_length_m: Array
    high_length_m: Array
    way_m: Array
    ahead_m: Array

    def __len__(self) -> int:
        return len(self.time_s)

    def joined(self, other: Crossings) -> Crossings:
        """Both together."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Crossings(*(np.concatenate(pair) for pair in pairs))

    def shift_by_age(self, delay_s: Array) -> Array:
        """Way driven during delays, shape (len(delay_s), k) [m]."""
        place = np.clip(delay_s / AGES_S[1], 0.0, len(AGES_S) - 1.000001)
        left = place.astype(np.intp)
        rest = (place - left)[:, None]
        return (1.0 - rest) * self.way_m.T[left] + rest * self.way_m.T[left + 1]

    def shift_by_pitch(self, pitch_rad: Array, height_m: float) -> Array:
        """How far stamps lie beyond what a pitched camera saw, shape (len(pitch_rad), k) [m]."""
        return self.ahead_m - seen_distance_m(self.ahead_m, height_m, pitch_rad[:, None])

    def bracket(self, share: float) -> tuple[Array, Array]:
        """Where the border was seen to lie beyond its place, if a class is for this share of its stamp [m]."""
        return self.low_m + share * self.low_length_m, self.high_m + share * self.high_length_m


def find_crossings(results: Sequence[Results]) -> Crossings:
    """All borders between surfaces that the results of some drives show."""
    age_s, way_m = rough_shift(results)
    rows = [row for one in results for row in _of_one(one, age_s, way_m)]
    names, *columns = zip(*rows, strict=True) if rows else [()] * len(fields(Crossings))
    numbers = [np.array(column, dtype=np.float64) for column in columns]
    numbers[WAYS] = numbers[WAYS].reshape(len(rows), len(AGES_S))
    return Crossings(np.array(names, dtype=np.str_), *numbers)


def rough_shift(results: Sequence[Results]) -> tuple[float, float]:
    """The age and the distance at which the classes' sequence lies best over the road's [s], [m]."""
    age, way = np.meshgrid(COARSE_AGES_S, COARSE_WAYS_M, indexing="ij")
    cost = np.hypot(age / COARSE_PRIOR[0], way / COARSE_PRIOR[1])
    cost += MISMATCH_NATS * sum(_wrong(one) for one in results)
    best = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return float(age[best]), float(way[best])


@lru_cache(maxsize=16)
def _wrong(one: Results) -> NDArray[np.intp]:
    """How many pictures of a log show another class than the road has, shape (ages, ways)."""
    middle = 0.5 * (one.from_m + one.to_m)
    driven = one.driven_m(one.time_s, COARSE_AGES_S)
    places = ((middle - late)[None, :] - COARSE_WAYS_M[:, None] for late in driven.T)
    return np.array([(surfaces_at(one.road, place) != one.classes).sum(axis=1) for place in places])


def _of_one(one: Results, age_s: float, way_m: float) -> list[tuple]:
    """Rows of the crossings of one drive, looked for about where a rough shift puts them."""
    middle, length = 0.5 * (one.from_m + one.to_m), one.to_m - one.from_m
    usual_m = np.median(length)
    shift = one.driven_m(one.time_s, np.array([age_s]))[:, 0] + way_m
    rows = []
    segments = one.road.segments
    borders = [
        (b.start_m, int(a.surface_class), int(b.surface_class))
        for a, b in pairwise(segments)
        if a.surface != b.surface
    ]
    edges = [-np.inf, *(b[0] for b in borders), np.inf]
    for k, (border, old, new) in enumerate(borders):
        reach = np.minimum(WINDOW_M, 0.5 * np.array([border - edges[k], edges[k + 2] - border]))
        beyond = middle - shift - border
        near = np.flatnonzero((beyond > -reach[0]) & (beyond < reach[1]))
        near = near[np.argsort(middle[near], kind="stable")]
        found = _bracket(one.classes[near], old, new)
        if found is None:
            continue
        i, j = near[found[0]], near[found[1]]
        at = i if abs(beyond[i]) < abs(beyond[j]) else j
        rows.append(
            (
                one.log,
                one.time_s[at],
                one.speed_m_s[at],
                border,
                one.speed_m_s[at] - np.interp(one.time_s[at] - 1.0, one.time_s, one.speed_m_s),
                one.time_s[at] - one.begin_s,
                border - one.begin_m,
                one.from_m[i] - border,
                one.from_m[j] - border,
                length[i],
                length[j],
                one.driven_m(one.time_s[[at]], AGES_S)[0],
                # stamps begin at one distance: the longer they are, the farther ahead is their middle
                max(one.ahead_m + 0.5 * (0.5 * (length[i] + length[j]) - usual_m), LEAST_AHEAD_M),
            )
        )
    return rows


def _bracket(classes: NDArray[np.intp], old: int, new: int) -> tuple[int, int] | None:
    """Last picture before and first after a change of class, by the split that fewest pictures contradict.

    The bracket covers all splits that are nearly as likely, given how often the pictures err. None where too few show
    either class, or too many contradict.
    """
    is_old, is_new = classes == old, classes == new
    # wrong[s]: pictures that contradict a change between picture s - 1 and picture s
    wrong = np.concatenate(([0], np.cumsum(is_new))) + np.concatenate((np.cumsum(is_old[::-1])[::-1], [0]))
    error = max(wrong.min() / max(is_old.sum() + is_new.sum(), 1), LEAST_ERROR)
    if error > MOST_WRONG:
        return None
    likely = np.flatnonzero((wrong - wrong.min()) * np.log((1.0 - error) / error) < LIKELY_NATS)
    first, last = int(likely[0]), int(likely[-1])
    if is_old[:first].sum() < FEWEST_SIDE or is_new[last:].sum() < FEWEST_SIDE:
        return None
    return first - 1, last
