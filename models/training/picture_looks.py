"""Looks at whole pictures, real and rendered: the road in its surroundings, for the picture network."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from trpac_core.vision.picture import look

from .data import Box, Image, Picture
from .patches import PatchSet, patch_set
from .rendered import View, seen_in_worlds

LOOKS_PER_PICTURE = {
    "condition_web": 8,
    "drivable_camvid": 2,
    "drivable_lums": 1,
    "dry_udacity": 8,
    "seq_dry_yolop": 4,
    "seq_extreme": 12,
    "cws8262": 8,
    "bdd_day": 8,
    "bdd_night": 8,
}
"""Training looks at each picture of a family."""
OTHER_LOOKS = 4
"""At one of any other family."""
LOOKS_PER_VIEW = 3
PURE_SHARE = 0.9
"""Least share of one surface on the road of a rendered view [-]: a look has one class."""


EDGES = ((0.0, 0.2), (0.2, 0.5), (0.8, 1.0), (0.9, 1.0))
"""Between which fractions of a picture the left, top, right and bottom edge of a look are drawn: about the looks that a
picture is judged by."""


def training_looks(pictures: Iterable[Picture], seed: int) -> PatchSet:
    """Looks at training pictures, as many as LOOKS_PER_PICTURE says."""
    rng = np.random.default_rng(seed)
    return patch_set((_drawn(rng, picture), int(picture.surface), picture.source) for picture in pictures)


def _drawn(rng: np.random.Generator, picture: Picture) -> list[Image]:
    """Looks at what one would show of the picture, at its parts by turns."""
    parts = picture.clear_parts()
    count = LOOKS_PER_PICTURE.get(picture.family, OTHER_LOOKS)
    return [look(parts[number % len(parts)], _box(rng)) for number in range(count)]


def _box(rng: np.random.Generator) -> Box:
    left, top, right, bottom = (float(rng.uniform(*edge)) for edge in EDGES)
    return left, top, right, bottom


def rendered_looks(seeds: Sequence[int], processes: int, report: Callable[[], None]) -> PatchSet:
    """Looks at views of rendered worlds whose road is of one surface; independent of `processes`."""
    seen = seen_in_worlds(seeds, _looks_at, processes, report)
    return patch_set((looks, label, "rendered") for looks, label in seen if looks)


def _looks_at(view: View) -> tuple[list[Image], int]:
    """Looks at a view with the class index of its road; none where that is mixed."""
    road = view.frame.surface[view.frame.surface >= 0]
    counts = np.bincount(road, minlength=1)
    if counts.max() < PURE_SHARE * max(len(road), 1):
        return [], 0
    rng = np.random.default_rng([view.patch_seed, 2])
    return [look(view.frame.image, _box(rng)) for _ in range(LOOKS_PER_VIEW)], int(counts.argmax())
