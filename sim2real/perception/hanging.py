"""A camera that hangs at times: at some borders the class changes far too late, at the others on time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.chain import Oddity
from sim2real.perception.crossings import Crossings

Array = NDArray[np.float64]

LATE_M = 3.0
"""By how much a change of class lies beyond all that its bracket and stamps leave open, to be far too late [m]."""
FEWEST, LEAST_SHARE = 4, 0.08
"""Borders with a late change, and their share of all, from which on they are no chance mistakes."""
EARLY_SHARE = 0.2
"""As many that are too early, by the same measure, against those that are late: mistakes err both ways [-]."""


def odd_hanging(rest_m: Array, crossings: Crossings) -> Oddity | None:
    """The gap that a camera is which hands out old pictures now and then; None where it does not.

    Parameters
    ----------
    rest_m : array, shape (k,)
        By how far each change of class lies beyond its border, shifted as fits best [m].
    crossings : Crossings
        k of them.
    """
    low, high = crossings.bracket(0.5)
    open_m = 0.5 * (high - low) + 0.25 * (crossings.low_length_m + crossings.high_length_m)
    late, early = rest_m - open_m > LATE_M, -rest_m - open_m > LATE_M
    if late.sum() < max(FEWEST, LEAST_SHARE * len(crossings)) or early.sum() > EARLY_SHARE * late.sum():
        return None
    told = (
        f"At {late.sum()} of {len(crossings)} borders the class changes late, by up to {rest_m.max():.0f} m, and at "
        "the others on time: does the camera hand out old pictures now and then?"
    )
    return Oddity("image_place", told, "time", "late", "now and then")
