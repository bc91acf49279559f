"""Class probabilities of patches along the road, read together by a hidden Markov model.

The road is a chain of cells whose class seldom changes, and each patch is an observation of its own cell. Forward and
backward passes combine the observations, so that a border lies where it fits best the patches on both sides of it. Road
passed is not kept patch by patch, but as the probability of each class at the place where it ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .classes import Surface

CELL_M = 0.25
"""Length of a cell [m]."""
CHANGES_PER_M = 0.003
"""How often the class changes where no line across the road is seen [1/m]."""
CHANGES_AT_LINE = 0.1
"""How often it changes at a line across the road [-]."""
SAY = 0.3
"""Weight of the log probabilities of a patch [-]: patches of one road and light have correlated errors."""
SAY_BEFORE = 0.15
"""The same for a remembered patch [-]: six share one picture, and their errors are correlated."""
LEAST_PROBABILITY = 0.02
"""Lower bound of the probability of a class, of a patch and of the road passed [-]."""
OWN_SHARE = 0.5
"""Share of the own probabilities of a patch in the result [-]: all patches of a road may be wrong together, and the
chain alone would be overconfident."""
EVEN = np.full(len(Surface), 1.0 / len(Surface))
"""Probabilities without any information [-]."""


@dataclass(frozen=True)
class Passed:
    """Probabilities of the class at a place, from all of the road up to it.

    Attributes
    ----------
    end_m : float
        The place on the path [m].
    probabilities : tuple of 3 floats
        Of dry, wet, snow and ice [-].
    """

    end_m: float
    probabilities: tuple[float, float, float]

    def seen_from(self, way_m: float) -> Passed:
        """The same, measured from a place on the path."""
        return replace(self, end_m=self.end_m - way_m)

    def to_json(self) -> list[Any]:
        """It as JSON-able values, exact."""
        return [self.end_m, list(self.probabilities)]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Passed:
        """What `to_json` wrote."""
        end_m, (dry, wet, snow_ice) = data
        return cls(end_m, (dry, wet, snow_ice))


def among_neighbours(
    ahead_m: NDArray[np.float64],
    probabilities: NDArray[np.float64],
    lines_m: NDArray[np.float64] | Sequence[float] = (),
    passed: Passed | None = None,
    before: int = 0,
) -> NDArray[np.float64]:
    """Probabilities of each patch: half its own, half those of its cell by all patches of the road.

    Parameters
    ----------
    ahead_m : array, shape (n,)
        Positions of the patches along the path [m].
    probabilities : array, shape (n, 3)
        Calibrated probabilities of each by itself [-].
    lines_m : array, shape (m,)
        Where lines cross the road, ascending: a class is likelier to end there than elsewhere [m].
    passed : Passed, optional
        The road before the patches, on the same path.
    before : int
        How many of them, the last, were seen in frames before.

    Returns
    -------
    array, shape (n, 3)
        Of sum 1 each [-].
    """
    if not len(ahead_m):
        return probabilities
    say = np.full(len(ahead_m), SAY)
    say[len(say) - before :] = SAY_BEFORE
    seen, changes, cells = _chain(ahead_m, probabilities, say, lines_m)
    from_behind = _passed_on(seen, changes, _told(passed, float(ahead_m.min()), lines_m))
    from_ahead = _passed_on(seen[::-1], changes[::-1], EVEN)[::-1]
    known = from_behind * seen * from_ahead
    known /= known.sum(axis=1, keepdims=True)
    return np.asarray(OWN_SHARE * probabilities + (1.0 - OWN_SHARE) * known[cells])


def passed_by(
    passed: Passed | None,
    ahead_m: NDArray[np.float64],
    probabilities: NDArray[np.float64],
    lines_m: NDArray[np.float64] | Sequence[float],
    end_m: float,
) -> Passed:
    """The road up to a later place, with these patches, seen before; arguments as of `among_neighbours`."""
    if len(ahead_m):
        say = np.full(len(ahead_m), SAY_BEFORE)
        seen, changes, _ = _chain(ahead_m, probabilities, say, lines_m)
        last = _passed_on(seen, changes, _told(passed, float(ahead_m.min()), lines_m))[-1] * seen[-1]
        passed = _as_passed(float(ahead_m.max()), last / last.sum())
    return _as_passed(end_m, _told(passed, end_m, lines_m).clip(LEAST_PROBABILITY))


def _as_passed(end_m: float, probabilities: NDArray[np.float64]) -> Passed:
    dry, wet, snow_ice = (probabilities / probabilities.sum()).tolist()
    return Passed(end_m, (dry, wet, snow_ice))


def _told(
    passed: Passed | None, place_m: float, lines_m: NDArray[np.float64] | Sequence[float]
) -> NDArray[np.float64]:
    """Class probabilities at a place by the road passed, which fade with the distance and the lines between [-]."""
    if passed is None:
        return EVEN
    k = len(EVEN)
    crossed = sum(passed.end_m < line <= place_m for line in lines_m)
    goes_on = np.exp(-k / (k - 1) * CHANGES_PER_M * max(place_m - passed.end_m, 0.0))
    goes_on *= (1.0 - k / (k - 1) * CHANGES_AT_LINE) ** crossed
    return np.asarray(EVEN + goes_on * (np.array(passed.probabilities) - EVEN))


def _chain(
    ahead_m: NDArray[np.float64],
    probabilities: NDArray[np.float64],
    say: NDArray[np.float64],
    lines_m: NDArray[np.float64] | Sequence[float],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Likelihoods of the cells' classes, shape (m, k), changes from each cell to the next, and the patches' cells."""
    first, last = np.floor(np.array((ahead_m.min(), ahead_m.max())) / CELL_M)
    crossed = np.array([line for line in lines_m if ahead_m.min() < line <= ahead_m.max()])
    ends = np.union1d(CELL_M * np.arange(first + 1.0, last + 1.0), crossed)
    changes = np.where(np.isin(ends, crossed), CHANGES_AT_LINE, CHANGES_PER_M * CELL_M)
    cells = np.searchsorted(ends, ahead_m, side="right")
    likely = probabilities.clip(LEAST_PROBABILITY)
    likely = np.log(likely / likely.sum(axis=1, keepdims=True))
    seen = np.zeros((len(ends) + 1, probabilities.shape[1]))
    np.add.at(seen, cells, say[:, None] * likely)
    return np.exp(seen - seen.max(axis=1, keepdims=True)), changes, cells


def _passed_on(
    seen: NDArray[np.float64], changes: NDArray[np.float64], first: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Probabilities of each cell's class by the cells before it, from their likelihoods, both of shape (m, k).

    `changes`, shape (m - 1,), is how likely the class changes from each cell to the next, `first`, shape (k,), how
    likely each is in the first [-].
    """
    k = seen.shape[1]
    passed = np.tile(first, (len(seen), 1))
    for number, change in enumerate(changes / (k - 1), start=1):
        known = passed[number - 1] * seen[number - 1]
        known /= known.sum()
        passed[number] = change + (1.0 - k * change) * known
    return passed
