"""Slopes of values along a drive, several by one run: what is far apart does not meet in the observer's memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FORGOTTEN_S = 4.0
"""Bumps of which one begins this long after the other's end are probed at once: the observer's memory is 1 s [s]."""


def sets_apart(weights: Sequence[Array], spacing_s: float) -> list[list[int]]:
    """Bumps along a drive, in order, `spacing_s` apart and twice as long, in sets that one run each can probe [1]_.

    Bumps that are nowhere above 0 are in no set.

    References
    ----------
    .. [1] Curtis, Powell, Reid (1974), IMA J. Appl. Math. 13, 117-119, doi:10.1093/imamat/13.1.117.
    """
    alive = [i for i, weight in enumerate(weights) if np.any(weight > 0.0)]
    count = max(round((2.0 * spacing_s + FORGOTTEN_S) / spacing_s), 1)
    return [alive[at::count] for at in range(min(count, len(alive)))]


def windows(weights: Sequence[Array]) -> list[slice]:
    """Rows that answer to each bump of a set: from where it begins to where the next one does."""
    begins = [int(np.argmax(weight > 0.0)) for weight in weights]
    return [slice(a, b) for a, b in zip(begins, [*begins[1:], len(weights[0])], strict=True)]
