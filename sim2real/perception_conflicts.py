"""Away from borders: how often the camera's class is not road.yaml's, and where it keeps being another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenarios.files import RoadSegment
from sim2real.perception_frames import Results
from trpac_core.vision.classes import Surface

MARGIN_M = 5.0
"""Way after and before a border that is left out: there a shift shows, not a conflict [m]."""
FEWEST = 5
MOSTLY = 0.7
"""Share of a segment's results that name one other class, from which on they are no chance mistakes."""


def class_error(results: Sequence[Results]) -> float:
    """Share of the results away from borders that name another class than road.yaml; NaN where there are none [-]."""
    wrong = [
        one.classes[inside] != segment.surface_class for one in results for segment, inside in _inside(one)
    ]
    every = np.concatenate(wrong) if wrong else np.empty(0)
    return float(every.mean()) if len(every) else float("nan")


def class_conflicts(results: Sequence[Results]) -> tuple[str, ...]:
    """One sentence per segment on which most results name another class than road.yaml."""
    sentences = []
    for one in results:
        for segment, inside in _inside(one):
            seen = np.bincount(one.classes[inside], minlength=len(Surface))
            most = Surface(int(seen.argmax()))
            if (
                inside.sum() >= FEWEST
                and most != segment.surface_class
                and seen[most] >= MOSTLY * inside.sum()
            ):
                sentences.append(
                    f"{one.log}: from {segment.start_m:g} m on the camera sees {most.label} in "
                    f"{100.0 * seen[most] / inside.sum():.0f} % of its results where road.yaml has {segment.surface}."
                )
    return tuple(sentences)


def _inside(one: Results) -> Iterator[tuple[RoadSegment, NDArray[np.bool_]]]:
    """Each stretch of one surface, and which results are stamped well within it."""
    middle = 0.5 * (one.from_m + one.to_m)
    segments = one.road.segments
    heads = [segments[0], *(b for a, b in pairwise(segments) if a.surface != b.surface)]
    starts = [-np.inf, *(s.start_m for s in heads[1:]), np.inf]
    for head, begin, end in zip(heads, starts[:-1], starts[1:], strict=True):
        yield head, (middle > begin + MARGIN_M) & (middle < end - MARGIN_M)
