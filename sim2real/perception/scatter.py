"""Changes of class that lie beside road.yaml's borders without a common shift: a gap, or only a careless chain.

A chain that errs at borders, or whose delay jitters, scatters anew at each passing. A border that lies elsewhere is
beside its place every time, and a position that drifts puts neighbouring borders off alike. So scatter is a gap where
it repeats from passing to passing or goes from border to border; where no border is passed again, also where it is
large.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.chain import Oddity
from sim2real.perception.crossings import Crossings

Array = NDArray[np.float64]
Pairs = list[tuple[int, int]]

SIGNAL, BOTH_WAYS = "image_place", "both ways"

FEWEST = 4
"""Crossings from which on scatter is looked at."""
SCATTERED_M, SCATTERED_ALONE_M = 0.7, 2.0
"""Scale of the crossings' errors from which on scatter may be a gap of its own, and where nothing says whether it
comes again [m]."""
OF_BRACKET = 0.5
"""Share of what a crossing's bracket leaves open below which scatter is none [-]."""
FEWEST_PAIRS, NEIGHBOURS_ALIKE, AGAIN_ALIKE = 6, 2.5, 3.2
"""Pairs of crossings that can tell, and the standard score of their products from which on they do: a chain that errs
at borders errs a little alike at one that it passes again."""
CLIPPED = 3.0
"""Errors count up to so many times their median size: one misread border is no pattern [-]."""


def odd_scatter(scale_m: float, rest_m: Array, crossings: Crossings, streak_m: float) -> Oddity | None:
    """The gap that scatter is; None where it is none.

    Parameters
    ----------
    scale_m : float
        Of the crossings' errors [m].
    rest_m : array, shape (k,)
        By how far each lies beside its border, shifted as fits best [m].
    crossings : Crossings
        k of them.
    streak_m : float
        Way over which the camera errs at a stretch: it moves borders by as much [m].
    """
    low, high = crossings.bracket(0.5)
    if len(crossings) < FEWEST:
        return None
    open_m = float(np.median(high - low + crossings.low_length_m))
    if scale_m < max(SCATTERED_M, OF_BRACKET * open_m):
        return None
    again, along = _passed_again(crossings), _neighbours(crossings)
    lies = f"The changes of class are {scale_m:.1f} m away from road.yaml's borders, without a common shift or delay"
    if _alike(rest_m, again) > AGAIN_ALIKE:
        told = f"{lies}, but equal each time that a border is passed. Check the positions of the borders in road.yaml."
        return Oddity(SIGNAL, told, "place", BOTH_WAYS, "equal each time that a border is passed")
    if _alike(rest_m, along) > NEIGHBOURS_ALIKE:
        told = f"{lies}, but similar at neighbouring borders. Check whether position_m or the delay drifts."
        return Oddity(SIGNAL, told, "place or time", BOTH_WAYS, "similar at neighbouring borders")
    if len(again) < FEWEST_PAIRS and scale_m >= max(SCATTERED_ALONE_M, open_m, streak_m):
        told = f"{lies}. Check the positions of the borders in road.yaml, and whether position_m drifts."
        return Oddity(SIGNAL, told, "place or time", BOTH_WAYS, "from border to border")
    return None


def _alike(rest_m: Array, pairs: Pairs) -> float:
    """Standard score of the products of errors in pairs: about normal where they are independent [-]."""
    if len(pairs) < FEWEST_PAIRS:
        return 0.0
    off = rest_m - np.median(rest_m)
    most = CLIPPED * max(float(np.median(np.abs(off))), 1e-9)
    off = np.clip(off, -most, most)
    one, other = np.array(pairs).T
    products = off[one] * off[other]
    return float(products.sum() / max(np.sqrt((products**2).sum()), 1e-12))


def _passed_again(crossings: Crossings) -> Pairs:
    """Pairs of passings of one border."""
    places = np.round(crossings.border_m, 3)
    same: Iterable[NDArray[np.intp]] = (np.flatnonzero(places == place) for place in np.unique(places))
    return [pair for passings in same for pair in combinations(passings.tolist(), 2)]


def _neighbours(crossings: Crossings) -> Pairs:
    """Pairs of borders that one log passes one after the other."""
    pairs = []
    for log in np.unique(crossings.log):
        here = np.flatnonzero(crossings.log == log)
        pairs += list(pairwise(here[np.argsort(crossings.time_s[here])].tolist()))
    return pairs
