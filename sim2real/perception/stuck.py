"""A camera that repeats an old result: class and confidence stay the same to the last digit while the car goes on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.chain import Oddity
from sim2real.perception.frames import Results

LEAST_REPEATS = 8
"""Results in a row that are alike to the last digit, from which on they are one that is repeated."""
LEAST_TIMES = 2
"""How often it must happen: one time may be the recorder's."""
LEAST_WAY_M = 1.0
"""Way driven meanwhile: a car that stands sees the same [m]."""


def odd_repeats(results: Sequence[Results]) -> Oddity | None:
    """The gap that repeated results are; None where there are none.

    A confidence that other results have too is rounded or at its limit: it may well come several times in a row. So
    does one of a chain that gives each surface its own: elsewhere it has to change from result to result.
    """
    times = [(one, first, last) for one in results for first, last in _repeats(one)]
    if len(times) < LEAST_TIMES:
        return None
    one, first, last = max(times, key=lambda t: t[0].time_s[t[2]] - t[0].time_s[t[1]])
    told = (
        f"The camera repeats a result to the last digit {len(times)} times, the longest in {one.log} from "
        f"{one.time_s[first]:.2f} to {one.time_s[last]:.2f} s. Check whether it freezes."
    )
    return Oddity("image_confidence", told, "time", "the same to the last digit", "at times")


def _repeats(one: Results) -> list[tuple[int, int]]:
    """First and last result of each run that is one result repeated."""
    begins, ends = _runs(one.confidence, one.classes)
    lengths = ends - begins + 1
    long = lengths >= LEAST_REPEATS
    if lengths[~long].sum() < LEAST_REPEATS:
        return []
    driven_m = np.interp(one.time_s, one.drive_time_s, one.drive_position_m)
    return [
        (first, last)
        for first, last in zip(begins[long].tolist(), ends[long].tolist(), strict=True)
        if (one.confidence == one.confidence[first]).sum() == last - first + 1
        and one.confidence[first] < 1.0
        and driven_m[last] - driven_m[first] >= LEAST_WAY_M
    ]


def _runs(
    confidence: NDArray[np.float64], classes: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last index of each run of equal results; one that is not measured equals none."""
    changes = np.flatnonzero((np.diff(confidence) != 0.0) | (np.diff(classes) != 0))
    return np.concatenate(([0], changes + 1)), np.concatenate((changes, [len(classes) - 1]))
