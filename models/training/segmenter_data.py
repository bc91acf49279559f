"""Pictures and labels for the segmenter: real with painted shadows, and rendered with exact labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from trpac_core.vision.classes import Surface

from .augment import camera_look, disturbed_look, paint_shadow, random_view, shadow_depth, shadow_label
from .data import IGNORE, Image, Picture, pixel_box

SIZE = (256, 160)
"""Width and height of the segmenter's input [px]."""

SHARES = {"masked": 0.40, "campus": 0.12, "weak": 0.16, "rendered": 0.32}
"""Share of each kind of picture in training; a kind that is not there leaves its share to the others."""

CAMPUS = "drivable_lums"
PAINTED_SHARE = 0.7
"""Share of the real training views that get a painted shadow [-]."""

SKY_SHARE = 0.18
"""Top share of a still that holds no road [-]; holds for the stills at hand."""


@dataclass(frozen=True)
class Sample:
    """One picture with labels: uint8, 0 no, 1 yes, 255 unknown; `shadow` may be all unknown."""

    image: Image
    drivable: Image
    shadow: Image
    kind: str


def brighter_half_lit(image: Image, road: Image) -> Image:
    """Shadow label of a real picture: the brighter half of its road counts as lit, the rest is unknown.

    A shadow is the darker part of a road; without this a plain dark road is learned as one great shadow.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)
    known = road == 1
    middle = np.median(grey[known]) if known.any() else 0.0
    return np.where(known & (grey >= middle), 0, IGNORE).astype(np.uint8)


def masked_sample(picture: Picture) -> Sample:
    """A real picture with its road mask; where its real shadows lie is unknown, see `brighter_half_lit`."""
    image, road = picture.image(), picture.road_mask()
    kind = "campus" if picture.source == CAMPUS else "masked"
    return Sample(image, road, brighter_half_lit(image, road), kind)


def weak_sample(picture: Picture) -> Sample:
    """A real picture with a surface label only: its road box narrowed is road, the sky is not, the rest unknown.

    The only real pictures of wet and snowy roads that the segmenter learns from. A wet road's box counts as lit: rain
    clouds leave no sun for shadows, and a dark gloss must not pass for one.
    """
    image = picture.image()
    road = np.full(image.shape[:2], IGNORE, np.uint8)
    overlaid = "extreme" in picture.source
    if not overlaid:
        road[: round(SKY_SHARE * image.shape[0])] = 0
    for left, top, right, bottom in picture.boxes:
        inset = 0.0 if overlaid else 0.3 * (right - left)
        x0, y0, x1, y1 = pixel_box((left + inset, top, right - inset, bottom), image)
        road[y0 + (0 if overlaid else (y1 - y0) // 3) : y1, x0:x1] = 1
    lit = brighter_half_lit(image, road)
    if picture.surface == Surface.WET:
        lit[road == 1] = 0
    return Sample(image, road, lit, "weak")


def training_view(rng: np.random.Generator, sample: Sample) -> Sample:
    """A random view of a sample at the network's input size, as training sees it."""
    zoom = 1.25 if sample.kind == "rendered" else 1.6
    image, drivable, shadow = random_view(rng, [sample.image, sample.drivable, sample.shadow], SIZE, zoom)
    if sample.kind != "rendered" and rng.random() < PAINTED_SHARE:
        depth = shadow_depth(rng, SIZE[1], SIZE[0])
        image = paint_shadow(rng, image, depth)
        shadow = shadow_label(depth, drivable, shadow)
    image = disturbed_look(rng, camera_look(rng, image, spread=0.5))
    return Sample(image, drivable, shadow, sample.kind)


def plain_view(sample: Sample) -> Sample:
    """The whole picture at the network's input size, as at run time."""
    drivable, shadow = (
        np.asarray(cv2.resize(plane, SIZE, interpolation=cv2.INTER_NEAREST), np.uint8)
        for plane in (sample.drivable, sample.shadow)
    )
    image = cv2.resize(sample.image, SIZE, interpolation=cv2.INTER_AREA)
    return Sample(np.asarray(image, np.uint8), drivable, shadow, sample.kind)


def painted_views(samples: Sequence[Sample], seed: int) -> list[Sample]:
    """Whole real pictures, each with one painted shadow: the real-picture test of the shadow task."""
    rng = np.random.default_rng(seed)
    views = []
    for sample in map(plain_view, samples):
        depth = shadow_depth(rng, SIZE[1], SIZE[0])
        painted = paint_shadow(rng, sample.image, depth)
        views.append(
            Sample(painted, sample.drivable, shadow_label(depth, sample.drivable, sample.shadow), sample.kind)
        )
    return views


def draw_batch(rng: np.random.Generator, pools: dict[str, list[Sample]], count: int) -> list[Sample]:
    """A batch of training views whose kinds are mixed by SHARES."""
    kinds = [kind for kind in SHARES if pools.get(kind)]
    shares = np.array([SHARES[kind] for kind in kinds])
    chosen = rng.choice(len(kinds), size=count, p=shares / shares.sum())
    return [
        training_view(rng, pools[kinds[index]][rng.integers(len(pools[kinds[index]]))]) for index in chosen
    ]
