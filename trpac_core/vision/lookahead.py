"""Memory of road seen ahead: patches from the range of the middle group count again when their ground is near.

Water shows in its reflections, which are stronger at a flat angle: a wet road is distinguished from a dry one better
at 6 m than at 3 m. The distance driven gives the present position of a remembered patch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .classes import Surface
from .surface_hmm import Passed, passed_by

LOOK_EVERY_M = 0.4
"""Distance between remembered frames: closer ones show the same road, and a standing car must not add any [m]."""

BEHIND_M = 2.0
"""Road nearer than the near group on which a remembered patch still counts [m]."""


@dataclass(frozen=True)
class Look:
    """Patches of one frame on road that was not near yet (a look).

    Attributes
    ----------
    at_m : float
        Distance driven by the front wheels at the frame [m].
    ways_m : tuple of n floats
        Distance driven at which the front wheels reach each patch [m].
    probabilities : tuple of n triples
        Calibrated probabilities of dry, wet, snow and ice [-].
    """

    at_m: float
    ways_m: tuple[float, ...]
    probabilities: tuple[tuple[float, float, float], ...]

    @classmethod
    def of(cls, at_m: float, ahead_m: NDArray[np.float64], probabilities: NDArray[np.float64]) -> Look:
        """A look at patches so far ahead of the front wheels, shapes (n,) and (n, 3)."""
        triples = tuple((dry, wet, snow_ice) for dry, wet, snow_ice in probabilities.tolist())
        return cls(at_m, tuple((at_m + ahead_m).tolist()), triples)

    def to_json(self) -> list[Any]:
        """The look as JSON-able values, exact."""
        return [self.at_m, list(self.ways_m), [list(triple) for triple in self.probabilities]]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Look:
        """The look that `to_json` wrote."""
        at_m, ways_m, triples = data
        return cls(at_m, tuple(ways_m), tuple((dry, wet, snow_ice) for dry, wet, snow_ice in triples))


def due(looks: Sequence[Look], at_m: float) -> bool:
    """Whether a frame at a distance driven is far enough from all remembered ones to be remembered."""
    return all(abs(look.at_m - at_m) >= LOOK_EVERY_M for look in looks)


def recalled(
    looks: Sequence[Look], at_m: float, reach_m: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions ahead of the front wheels and probabilities of the remembered patches within [from, to) now.

    Returns
    -------
    array, shape (n,)
        [m]
    array, shape (n, 3)
        Probabilities [-].
    """
    low, high = reach_m
    found = [
        (way_m - at_m, *triple)
        for look in looks
        for way_m, triple in zip(look.ways_m, look.probabilities, strict=True)
        if low <= way_m - at_m < high
    ]
    table = np.reshape(np.array(found, np.float64), (len(found), 1 + len(Surface)))
    return table[:, 0], table[:, 1:]


def within_reach(looks: Sequence[Look], at_m: float, reach_m: tuple[float, float]) -> tuple[Look, ...]:
    """The looks of which a patch lies in [from, to) ahead of the front wheels now: the others do not count."""
    low, high = reach_m
    return tuple(look for look in looks if any(low <= way_m - at_m < high for way_m in look.ways_m))


def road_passed(
    passed: Passed | None,
    looks: Sequence[Look],
    lines_m: Sequence[float],
    at_m: float,
    end_m: float,
    near_m: float,
) -> Passed | None:
    """Class probabilities at the end of the road whose patches are no longer stored.

    Parameters
    ----------
    passed : Passed, optional
        As of the frame before.
    looks : sequence of Look
        Remembered since: those of their patches that are passed now are included.
    lines_m : sequence of float
        Distances driven at lines across the road [m].
    at_m : float
        Distance driven now [m].
    end_m, near_m : float
        How far ahead patches begin to count themselves, and the near group begins [m].

    Returns
    -------
    Passed, optional
        It ends there, or farther ahead where the car has rolled back; nothing where nothing is passed, or where the car
        has rolled back so far that it would end in the near group.
    """
    known = None if passed is None else passed.seen_from(at_m)
    if known is not None and known.end_m > end_m:
        return passed if known.end_m <= near_m else None
    places_m, probabilities = recalled(looks, at_m, (-np.inf if known is None else known.end_m, end_m))
    if known is None and not len(places_m):
        return None
    return passed_by(known, places_m, probabilities, np.array(lines_m) - at_m, end_m).seen_from(-at_m)
