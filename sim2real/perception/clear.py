"""What a chain says of clear road: borders and mistakes lower the confidence of some pictures, an exposure that of all.

How low the mean lies goes with how many borders a road has and with how a chain takes them: on patches of a few metres
a sound one is as unsure in the mean as an ill exposed one is everywhere. What chains are alike in is the road far from
borders.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenarios.perception import surfaces_at
from sim2real.perception.blocks import LEAST_CONFIDENCE, make_blocks
from sim2real.perception.conflicts import places_of
from sim2real.perception.frames import Results

Array = NDArray[np.float64]

FARTHEST = 0.25
"""Share of the results, those farthest from a border, that tell what is said of clear road."""
FEWEST = 40
"""Results of the right class that are needed for it."""


def taken_by_borders(results: Sequence[Results]) -> float:
    """By how much the blocks' loss of the confidence's logarithm is more in the mean than on clear road [-].

    Results lie over the road as they fit best, each class is held to its own level, and what goes with speed counts
    for nothing: slow and fast road may have borders of its own. None is 0, as where too few results tell.
    """
    parts = [np.empty((0, 4))]
    for one, place_m in places_of(results):
        starts = np.array([segment.start_m for segment in one.road.segments[1:]])
        apart_m = np.abs(place_m[:, None] - starts).min(axis=1) if len(starts) else np.full(len(one), np.inf)
        right = (one.classes == surfaces_at(one.road, place_m)) & (one.confidence > 0.0)
        loss = -np.log(np.maximum(one.confidence, LEAST_CONFIDENCE))
        parts.append(np.column_stack([loss, one.speed_m_s, apart_m, one.classes])[right])
    loss, speed, apart_m, classes = np.concatenate(parts).T
    if len(loss) < FEWEST:
        return 0.0
    known = np.unique(classes)
    design = np.column_stack([speed, *(classes == c for c in known)])
    (slope, *levels), *_ = np.linalg.lstsq(design, loss, rcond=None)
    far = apart_m >= np.quantile(apart_m, 1.0 - FARTHEST, method="lower")
    clear = float(np.median((loss - design @ [slope, *levels])[far]))
    blocks = make_blocks(results)
    rest = [
        blocks.loss[blocks.classes == c] - level - slope * blocks.speed_m_s[blocks.classes == c]
        for c, level in zip(known, levels, strict=True)
    ]
    return max(float(np.concatenate(rest).mean()) - clear, 0.0)
