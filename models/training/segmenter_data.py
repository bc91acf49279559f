"""What the road network learns from: views of pictures, real and rendered, by day and by night, with their labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from trpac_core.vision.classes import Surface

from .augment import (
    bonnet,
    camera_look,
    disturbed_look,
    paint_shadow,
    random_view,
    shadow_depth,
    shadow_label,
)
from .data import CLEAR_PARTS, IGNORE, ROAD_IS_FOUND, Image, Picture, pixel_box
from .night import SHOWN, darkened

SIZE = (256, 160)
"""Width and height of the road network's input [px]."""

CAMPUS = "drivable_lums"
VIEWS = {"masked": 3, "street": 3, "campus": 1, "weak": 3, "rendered": 1}
"""Training views of a picture by its kind."""
RENDERED_BONNETS = 2
"""Of so many rendered pictures one is also seen over a bonnet; of others whose road is known each."""
PAINTED_SHARE = 0.7
"""Share of the real training views that get a painted shadow [-]."""
BY_NIGHT = ("masked", "street", "campus", "weak")
"""Kinds of pictures that are also seen by night."""
NIGHT_WIDTH_PX = 640
"""Most that a picture is wide as it is shown by night [px]."""
ZOOM, RENDERED_ZOOM = 1.6, 1.25
"""Most that a view is smaller than the picture [-]."""

SKY_SHARE, STREET_SKY_SHARE = 0.18, 0.3
"""Top share of a still, and of a street picture whose road is unknown, that holds no road [-]."""


@dataclass(frozen=True)
class Sample:
    """One picture with labels.

    Attributes
    ----------
    image : BGR
    drivable, shadow : 0 no, 1 yes, 255 unknown; `shadow` may be all unknown
    kind : key of `VIEWS`
    surface : class index of its road, -1 where that is of several
    source : see `Picture.origin`
    """

    image: Image
    drivable: Image
    shadow: Image
    kind: str
    surface: int
    source: str


def brighter_half_lit(image: Image, road: Image) -> Image:
    """Shadow label of a real picture: the brighter half of its road counts as lit, the rest is unknown.

    A shadow is the darker part of a road; without this a plain dark road is learned as one great shadow.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 2.0)
    known = road == 1
    middle = np.median(grey[known]) if known.any() else 0.0
    return np.where(known & (grey >= middle), 0, IGNORE).astype(np.uint8)


def sample_of(picture: Picture) -> Sample:
    """A real picture with what is known of its road."""
    if picture.mask is not None:
        return masked_sample(picture)
    return street_sample(picture) if picture.road_is_found else weak_sample(picture)


def masked_sample(picture: Picture) -> Sample:
    """A real picture with its road mask; where its real shadows lie is unknown, see `brighter_half_lit`."""
    image, road = picture.image(), picture.road_mask()
    kind = {CAMPUS: "campus"}.get(picture.source, "street" if picture.family in ROAD_IS_FOUND else "masked")
    return Sample(image, road, brighter_half_lit(image, road), kind, int(picture.surface), picture.origin)


def street_sample(picture: Picture) -> Sample:
    """A street picture of which no more is known than that its sky holds no road."""
    image = picture.image()
    road = np.full(image.shape[:2], IGNORE, np.uint8)
    road[: round(STREET_SKY_SHARE * len(road))] = 0
    unknown = np.full_like(road, IGNORE)
    return Sample(image, road, unknown, "street", int(picture.surface), picture.origin)


def weak_sample(picture: Picture) -> Sample:
    """A real picture with a surface label only: its road box narrowed is road, the sky is not, the rest unknown.

    A wet road's box counts as lit: rain clouds leave no sun for shadows, and a dark gloss must not pass for one.
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
    return Sample(image, road, lit, "weak", int(picture.surface), picture.origin)


def night_view(rng: np.random.Generator, sample: Sample) -> Sample:
    """A random view of a sample by day as it would look by night, by its road."""
    height, width = sample.image.shape[:2]
    factor = min(NIGHT_WIDTH_PX / width, 1.0)
    size = (round(factor * width), round(factor * height))
    day = np.asarray(cv2.resize(sample.image, size, interpolation=cv2.INTER_AREA), np.uint8)
    drivable = np.asarray(cv2.resize(sample.drivable, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    road = np.asarray(cv2.GaussianBlur((drivable == 1).astype(np.float32), (0, 0), 2.0), np.float32)
    night = darkened(rng, day, road, Surface(sample.surface))
    image, drivable = random_view(rng, [night, drivable], SIZE, ZOOM)
    unknown = np.full_like(drivable, IGNORE)
    source = f"{SHOWN}{sample.source}"
    return Sample(image, drivable, unknown, "night", sample.surface, source)


def training_view(rng: np.random.Generator, sample: Sample) -> Sample:
    """A random view of a sample at the network's input size, as training sees it."""
    zoom = RENDERED_ZOOM if sample.kind == "rendered" else ZOOM
    image, drivable, shadow = random_view(rng, [sample.image, sample.drivable, sample.shadow], SIZE, zoom)
    if sample.kind != "rendered" and rng.random() < PAINTED_SHARE:
        depth = shadow_depth(rng, SIZE[1], SIZE[0])
        image = paint_shadow(rng, image, depth)
        shadow = shadow_label(depth, drivable, shadow)
    image = disturbed_look(rng, camera_look(rng, image, spread=0.5))
    return replace(sample, image=image, drivable=drivable, shadow=shadow)


def over_a_bonnet(rng: np.random.Generator, sample: Sample) -> Sample:
    """A view with the bonnet or the dashboard of the car that takes it, which is no road."""
    image, hidden = bonnet(rng, sample.image)
    drivable = np.where(hidden, 0, sample.drivable).astype(np.uint8)
    shadow = np.where(hidden, IGNORE, sample.shadow).astype(np.uint8)
    return replace(sample, image=image, drivable=drivable, shadow=shadow)


def training_views(samples: Iterable[Sample], seed: int) -> list[Sample]:
    """Random views of samples, by `VIEWS`; where a road is known one over a bonnet and one by night too."""
    rng = np.random.default_rng(seed)
    views: list[Sample] = []
    for number, sample in enumerate(samples):
        views += [training_view(rng, sample) for _ in range(VIEWS[sample.kind])]
        if not (sample.drivable == 1).any():
            continue
        if sample.kind != "rendered" or number % RENDERED_BONNETS == 0:
            views.append(over_a_bonnet(rng, training_view(rng, sample)))
        if sample.kind in BY_NIGHT:
            views.append(night_view(rng, sample))
    return views


def plain_view(sample: Sample) -> Sample:
    """The whole picture at the network's input size, as at run time."""
    drivable, shadow = (
        np.asarray(cv2.resize(plane, SIZE, interpolation=cv2.INTER_NEAREST), np.uint8)
        for plane in (sample.drivable, sample.shadow)
    )
    image = np.asarray(cv2.resize(sample.image, SIZE, interpolation=cv2.INTER_AREA), np.uint8)
    return replace(sample, image=image, drivable=drivable, shadow=shadow)


def plain_views(picture: Picture, sample: Sample) -> list[Sample]:
    """The picture's sample as at run time, or the parts of it without what an instrument has written into it."""
    if picture.family not in CLEAR_PARTS:
        return [plain_view(sample)]
    parts = picture.clear_parts()
    unknown = [np.full(part.shape[:2], IGNORE, np.uint8) for part in parts]
    return [
        plain_view(replace(sample, image=part, drivable=road, shadow=road))
        for part, road in zip(parts, unknown, strict=True)
    ]


def painted_views(samples: Sequence[Sample], seed: int) -> list[Sample]:
    """Whole real pictures, each with one painted shadow: the real-picture test of the shadow task."""
    rng = np.random.default_rng(seed)
    views = []
    for sample in map(plain_view, samples):
        depth = shadow_depth(rng, SIZE[1], SIZE[0])
        painted = paint_shadow(rng, sample.image, depth)
        shadow = shadow_label(depth, sample.drivable, sample.shadow)
        views.append(replace(sample, image=painted, shadow=shadow))
    return views
