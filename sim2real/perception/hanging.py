"""A camera that hangs at times: at some borders the class changes far too late, at the others on time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from sim2real.perception.chain import Oddity
from sim2real.perception.conflicts import CHANCE, class_error
from sim2real.perception.crossings import LEAST_ERROR, Crossings
from sim2real.perception.frames import Results

Array = NDArray[np.float64]

LATE_M = 3.0
"""By how much a change of class lies beyond all that its bracket and stamps leave open, to be far too late [m]."""
LEAST_SHARE = 0.08
"""Share of all borders whose change is late from which on they matter [-]."""


def odd_hanging(rest_m: Array, crossings: Crossings, results: Sequence[Results]) -> Oddity | None:
    """The gap that a camera is which hands out old pictures now and then; None where it does not.

    Parameters
    ----------
    rest_m : array, shape (k,)
        By how far each change of class lies beyond its border, shifted as fits best [m].
    crossings : Crossings
        k of them.
    results : sequence of Results
        All that show them, for how often the camera errs away from borders.
    """
    low, high = crossings.bracket(0.5)
    open_m = 0.5 * (high - low) + 0.25 * (crossings.low_length_m + crossings.high_length_m)
    beside_m = np.sign(rest_m) * np.maximum(np.abs(rest_m) - open_m, 0.0)
    far = int((beside_m > LATE_M).sum())
    if far < max(1.0, LEAST_SHARE * len(crossings)) or not _mostly_late(beside_m[beside_m != 0.0]):
        return None
    mistaken = max(np.nan_to_num(class_error(results, later=True)), LEAST_ERROR)
    if bdtrc(far - 1, len(crossings), mistaken) > CHANCE:
        return None
    told = (
        f"At {far} of {len(crossings)} borders the class changes late, by up to {rest_m.max():.0f} m, and at the "
        "others in time. Check whether the camera sometimes sends old pictures."
    )
    return Oddity("image_place", told, "time", "late", "now and then")


def _mostly_late(beside_m: Array) -> bool:
    """Whether errors that are as often early would hardly come out so late, by Wilcoxon's signed ranks."""
    from scipy.stats import wilcoxon  # here, since its import is slow

    return bool(wilcoxon(beside_m, alternative="greater").pvalue < CHANCE)
