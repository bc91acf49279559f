"""Stretches of road on which the camera keeps seeing another surface than road.yaml names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim2real.perception_frames import Results
from trpac_core.vision.classes import Surface

MARGIN_M = 5.0
"""Way after and before a border that is left out: there a shift shows, not a conflict [m]."""
FEWEST = 5
MOSTLY = 0.7
"""Share of a segment's results that name one other class, from which on they are no chance mistakes."""


def class_conflicts(results: Sequence[Results]) -> tuple[str, ...]:
    """One sentence per segment on which most results name another class than road.yaml."""
    sentences = []
    for one in results:
        middle = 0.5 * (one.from_m + one.to_m)
        starts = [-np.inf, *(s.start_m for s in one.road.segments[1:]), np.inf]
        for segment, begin, end in zip(one.road.segments, starts[:-1], starts[1:], strict=True):
            inside = (middle > begin + MARGIN_M) & (middle < end - MARGIN_M)
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
