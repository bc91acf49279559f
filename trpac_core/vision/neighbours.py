"""What patches along the road show together: a surface goes on, and changes at one place.

The road is a chain of cells whose class seldom changes, and each patch has a say in its own cell: a hidden Markov
chain, read forwards and backwards. Road behind and ahead speaks for the road between, and a border lies where it fits
best what is seen on both sides of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

CELL_M = 0.25
"""Length of a cell [m]."""
CHANGES_PER_M = 0.01
"""How often the class changes where no line across the road is seen [1/m]."""
CHANGES_AT_LINE = 0.1
"""How often it changes at a line across the road [-]."""
SAY = 0.3
"""Share of a patch's log probabilities that counts [-]: patches of one road and light are wrong together."""
LEAST_PROBABILITY = 0.02
"""No patch says that a class is less likely [-]."""
OWN_SHARE = 0.5
"""How much of a patch's probabilities stays its own [-]: what all patches of a road agree on may be wrong, and the
chain alone would be sure of it."""


def among_neighbours(
    ahead_m: NDArray[np.float64],
    probabilities: NDArray[np.float64],
    lines_m: NDArray[np.float64] | Sequence[float] = (),
) -> NDArray[np.float64]:
    """Probabilities of each patch, half of them those that its place has by all that is seen of the road.

    Parameters
    ----------
    ahead_m : array, shape (n,)
        Where the patches lie along the way [m].
    probabilities : array, shape (n, 3)
        Calibrated probabilities of each by itself [-].
    lines_m : array, shape (m,)
        Where lines cross the road, ascending: a class is likelier to end there than elsewhere [m].

    Returns
    -------
    array, shape (n, 3)
        Of sum 1 each [-].
    """
    if not len(ahead_m):
        return probabilities
    first, last = np.floor(np.array((ahead_m.min(), ahead_m.max())) / CELL_M)
    crossed = np.array([line for line in lines_m if ahead_m.min() < line <= ahead_m.max()])
    ends = np.union1d(CELL_M * np.arange(first + 1.0, last + 1.0), crossed)
    changes = np.where(np.isin(ends, crossed), CHANGES_AT_LINE, CHANGES_PER_M * CELL_M)
    cells = np.searchsorted(ends, ahead_m, side="right")
    likely = probabilities.clip(LEAST_PROBABILITY)
    likely = np.log(likely / likely.sum(axis=1, keepdims=True))
    seen = np.zeros((len(ends) + 1, probabilities.shape[1]))
    np.add.at(seen, cells, SAY * likely)
    seen = np.exp(seen - seen.max(axis=1, keepdims=True))
    from_behind, from_ahead = _passed_on(seen, changes), _passed_on(seen[::-1], changes[::-1])[::-1]
    known = from_behind * seen * from_ahead
    known /= known.sum(axis=1, keepdims=True)
    return np.asarray(OWN_SHARE * probabilities + (1.0 - OWN_SHARE) * known[cells])


def _passed_on(seen: NDArray[np.float64], changes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probabilities of each cell's class by the cells before it, from their likelihoods, both of shape (m, k).

    `changes`, shape (m - 1,), is how likely the class changes from each cell to the next [-].
    """
    k = seen.shape[1]
    passed = np.full(seen.shape, 1.0 / k)
    for number, change in enumerate(changes / (k - 1), start=1):
        known = passed[number - 1] * seen[number - 1]
        known /= known.sum()
        passed[number] = change + (1.0 - k * change) * known
    return passed
