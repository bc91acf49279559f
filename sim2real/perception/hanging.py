"""A camera that hangs at times: at some borders the class changes far too late, at the others on time."""

from __future__ import annotations

import numpy as np

from sim2real.perception.crossings import Crossings

LATE_M = 3.0
"""By how much a change of class lies beyond all that its bracket and stamps leave open, to be far too late [m]."""
FEWEST, LEAST_SHARE = 4, 0.08
"""Borders with a late change, and their share of all, from which on they are no chance mistakes."""
EARLY_SHARE = 0.2
"""As many that are too early, by the same measure, against those that are late: mistakes err both ways [-]."""


def hanging_in_words(crossings: Crossings) -> str:
    """The gap that a camera is which hands out old pictures now and then, in a sentence; empty where it does not."""
    if len(crossings) < FEWEST:
        return ""
    low, high = crossings.bracket(0.5)
    off = 0.5 * (low + high)
    off = off - np.median(off)
    open_m = 0.5 * (high - low) + 0.25 * (crossings.low_length_m + crossings.high_length_m)
    late, early = off - open_m > LATE_M, -off - open_m > LATE_M
    if late.sum() < max(FEWEST, LEAST_SHARE * len(crossings)) or early.sum() > EARLY_SHARE * late.sum():
        return ""
    return (
        f"At {late.sum()} of {len(crossings)} borders the class changes late, by up to {off.max():.0f} m, and at the "
        "others on time: does the camera hand out old pictures now and then?"
    )
