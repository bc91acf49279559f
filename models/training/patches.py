"""Road patches for the surface classifier, cut from real pictures, with where each came from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.roi_sampling import LEAST_ROAD, MOST_ASPECT, ROI_ASPECT, cut_box, cut_patch

from .data import SQUASHED, Image, Picture, family_of, pixel_box

CALIBRATION_PER_SOURCE = 240
"""Most validation patches of one source in the calibration, so that no single drive decides T."""

ASPECTS = (ROI_ASPECT, MOST_ASPECT)
"""Width over height of a training patch on the road, squeezed to 3:2 in the end: narrow and wide looks [-]."""

MIN_WIDTH_PX = 48.0
WIDE_SHARE = 0.4
"""Share of the patches that span nearly all of a still's wide road box: water shows over a wide field."""
WIDE_LEAST = 0.6
"""Least share of the wide box's width and height in such a patch [-]."""

PATCHES_PER_PICTURE = {
    "condition_web": 20,
    "drivable_camvid/0006R0": 4,
    "drivable_camvid/0016E5": 4,
    "drivable_lums": 2,
    "dry_udacity": 20,
    "seq_dry_yolop/input1": 8,
    "seq_dry_extreme/Critical_Driving1": 20,
    "seq_wet_extreme/rain": 20,
    "seq_snow_extreme/snow1": 20,
    "cws8262": 8,
    "bdd_day": 8,
    "bdd_night": 8,
}
"""Training patches cut from each picture of a source; others give OTHER_SOURCES."""
OTHER_SOURCES = 2

SOURCE_SHARES = {
    "rendered": 3.0,
    "condition_web": 3.0,
    "seq_extreme": 1.5,
    "drivable_camvid": 1.5,
    "drivable_lums": 0.4,
    "seq_dry_yolop": 0.3,
    "dry_udacity": 0.4,
    "weathered": 1.5,
    "cws8262": 3.0,
    "bdd_day": 2.0,
    "bdd_night": 2.0,
}
"""Relative share of each source among the drawn patches of a class.

Each class is drawn equally often, and its shares are normalised over the sources that it has. So nearly all dash
cameras being dry does not make "dash camera" mean "dry": wet and snowy dash frames, real and rendered, weigh as much.
"""
OTHER_SHARE = 1.0
"""That of any other source."""

LEAST_ROADS = (0.95, LEAST_ROAD)
"""Least share of road in a patch cut by a mask, of one half and the other: some with kerbs and vehicles [-]."""

CAMERA_SPREAD, RENDERED_SPREAD = 0.4, 0.2
"""Gain, gamma and white balance of other undisturbed cameras, as a share [-]; of rendered ones, whose worlds have drawn
theirs already: the brightness of snow and asphalt must not be changed twice."""

WEB_STRETCH = (1.2, 1.5)
"""Width over height that squared pictures had before, roughly [-]."""


@dataclass(frozen=True)
class PatchSet:
    """Patches with their class and origin, aligned along the first axis.

    Attributes
    ----------
    patches : uint8, shape (n, 64, 96, 3), BGR
    labels : int64, shape (n,), class index
    sources : str, shape (n,), camera or clip, or "rendered"
    pictures : int64, shape (n,), number of the picture that the patch was cut from
    """

    patches: Image
    labels: NDArray[np.int64]
    sources: NDArray[np.str_]
    pictures: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.labels)

    def where(self, chosen: NDArray[np.bool_]) -> PatchSet:
        """The chosen patches alone."""
        return PatchSet(
            self.patches[chosen], self.labels[chosen], self.sources[chosen], self.pictures[chosen]
        )


def joined(sets: Sequence[PatchSet]) -> PatchSet:
    """Several patch sets as one, picture numbers kept apart."""
    offsets = np.cumsum([0] + [int(part.pictures.max(initial=-1)) + 1 for part in sets])
    return PatchSet(
        np.concatenate([part.patches for part in sets]),
        np.concatenate([part.labels for part in sets]),
        np.concatenate([part.sources for part in sets]),
        np.concatenate([part.pictures + offset for part, offset in zip(sets, offsets[:-1], strict=True)]),
    )


def unsquashed(picture: Picture, image: Image, stretch: float) -> Image:
    """A squared picture at its likely former aspect; other pictures as they are."""
    if picture.source not in SQUASHED:
        return image
    height, width = image.shape[:2]
    return np.asarray(cv2.resize(image, (round(stretch * width), height)), np.uint8)


def reduced(image: Image, box: tuple[float, float, float, float]) -> Image:
    """A box of a picture (left, top, right, bottom in pixels) as a patch of the network's size."""
    left, top, right, bottom = (round(edge) for edge in box)
    return cut_box(image, (left, top, right, bottom))


def random_patches(rng: np.random.Generator, picture: Picture, count: int) -> list[Image]:
    """Patches at random places, scales and aspects on the road of one picture, each inside its box or mask."""
    return patches_from(rng, picture, picture.image(), count)


def patches_from(rng: np.random.Generator, picture: Picture, image: Image, count: int) -> list[Image]:
    """See `random_patches`; `image` is what the picture shows."""
    stretch = rng.uniform(*WEB_STRETCH)
    image, road = unsquashed(picture, image, stretch), picture.road()
    if road is not None:
        return _patches_in_mask(rng, image, unsquashed(picture, road, stretch), count, ASPECTS, LEAST_ROADS)
    wide = picture.wide_box
    patches = []
    for _ in range(count):
        if wide is not None and rng.random() < WIDE_SHARE:
            x0, y0, x1, y1 = pixel_box(wide, image)
            columns, rows = rng.uniform(WIDE_LEAST, 1.0, 2) * (x1 - x0, y1 - y0)
        else:
            x0, y0, x1, y1 = pixel_box(picture.boxes[rng.integers(len(picture.boxes))], image)
            aspect = rng.uniform(*ASPECTS)
            largest = min(x1 - x0, aspect * (y1 - y0))
            columns = np.exp(rng.uniform(np.log(min(MIN_WIDTH_PX, largest)), np.log(largest)))
            rows = columns / aspect
        left, top = rng.uniform(x0, x1 - columns), rng.uniform(y0, y1 - rows)
        patches.append(reduced(image, (left, top, left + columns, top + rows)))
    return patches


def _patches_in_mask(
    rng: np.random.Generator,
    image: Image,
    mask: Image,
    count: int,
    aspects: tuple[float, float],
    least_roads: tuple[float, float],
) -> list[Image]:
    road = mask == 1
    counts = cv2.integral(road.astype(np.uint8))
    rows, columns = np.nonzero(road)
    patches: list[Image] = []
    for _ in range(60 * count):
        if len(patches) == count or not len(rows):
            break
        index = rng.integers(len(rows))
        width = np.exp(rng.uniform(np.log(MIN_WIDTH_PX), np.log(0.6 * image.shape[1])))
        height = width / rng.uniform(*aspects)
        x0, y0 = int(columns[index] - width / 2), int(rows[index] - height / 2)
        x1, y1 = int(x0 + width), int(y0 + height)
        if x0 < 0 or y0 < 0 or x1 > image.shape[1] or y1 > image.shape[0]:
            continue
        inside = counts[y1, x1] - counts[y0, x1] - counts[y1, x0] + counts[y0, x0]
        if inside >= least_roads[len(patches) % 2] * (x1 - x0) * (y1 - y0):
            patches.append(reduced(image, (x0, y0, x1, y1)))
    return patches


def fixed_patches(picture: Picture) -> list[Image]:
    """The patches on which a picture is judged: each road box whole, the wide one too, and four parts of each."""
    stretch = float(np.mean(WEB_STRETCH))
    image, road = unsquashed(picture, picture.image(), stretch), picture.road()
    if road is not None:
        mask, rng = unsquashed(picture, road, stretch), np.random.default_rng(0)
        return _patches_in_mask(rng, image, mask, 4, (ROI_ASPECT,) * 2, LEAST_ROADS[:1] * 2)
    wide = picture.wide_box
    patches = [] if wide is None else [reduced(image, pixel_box(wide, image))]
    for box in picture.boxes:
        x0, y0, x1, y1 = pixel_box(box, image)
        patches.append(reduced(image, (x0, y0, x1, y1)))
        width = 0.55 * min(x1 - x0, ROI_ASPECT * (y1 - y0))
        for column in (x0 + width / 2, x1 - width / 2):
            for row in (y0 + width / ROI_ASPECT / 2, y1 - width / ROI_ASPECT / 2):
                patches.append(cut_patch(image, (column, row), width))
    return patches


def patch_set(groups: Iterable[tuple[Sequence[Image], int, str]]) -> PatchSet:
    """A patch set from (patches, class index, source) of each picture."""
    patches: list[Image] = []
    labels: list[int] = []
    sources: list[str] = []
    numbers: list[int] = []
    for number, (cut, label, source) in enumerate(groups):
        patches += cut
        labels += [label] * len(cut)
        sources += [source] * len(cut)
        numbers += [number] * len(cut)
    stacked = np.stack(patches) if patches else np.empty((0, 64, 96, 3), np.uint8)
    return PatchSet(
        stacked, np.array(labels, np.int64), np.array(sources, np.str_), np.array(numbers, np.int64)
    )


def training_patches(pictures: Iterable[Picture], seed: int) -> PatchSet:
    """Random patches of training pictures, as many per picture as PATCHES_PER_PICTURE says."""
    rng = np.random.default_rng(seed)
    return patch_set(
        (
            random_patches(rng, picture, PATCHES_PER_PICTURE.get(picture.source, OTHER_SOURCES)),
            int(picture.surface),
            picture.origin,
        )
        for picture in pictures
    )


def judged_patches(pictures: Iterable[Picture]) -> PatchSet:
    """The fixed patches of validation or test pictures."""
    return patch_set((fixed_patches(picture), int(picture.surface), picture.source) for picture in pictures)


def thinned(count: int, seed: int) -> NDArray[np.bool_]:
    """Which of a source's `count` validation patches calibrate."""
    keep = np.zeros(count, np.bool_)
    keep[np.random.default_rng(seed).permutation(count)[:CALIBRATION_PER_SOURCE]] = True
    return keep


class Drawn(Protocol):
    """What is drawn by class and source: `labels` int64 (n,), `sources` str (n,)."""

    @property
    def labels(self) -> NDArray[np.int64]:
        """Class indices, shape (n,)."""
        ...

    @property
    def sources(self) -> NDArray[np.str_]:
        """Cameras or clips, shape (n,)."""
        ...


def draw_weights(patches: Drawn) -> NDArray[np.float64]:
    """Probability of each patch to be drawn: classes equal, sources within a class by SOURCE_SHARES."""
    groups = np.array([family_of(str(source)) for source in patches.sources])
    weights = np.zeros(len(patches.labels))
    for label in np.unique(patches.labels):
        of_class = patches.labels == label
        for group in np.unique(groups[of_class]):
            chosen = of_class & (groups == group)
            weights[chosen] = SOURCE_SHARES.get(group, OTHER_SHARE) / chosen.sum()
        weights[of_class] /= weights[of_class].sum()
    return weights / weights.sum()


def camera_spreads(patches: PatchSet) -> NDArray[np.float64]:
    """How far the cameras of each patch may differ, shape (n,) [-]."""
    return np.where(patches.sources == "rendered", RENDERED_SPREAD, CAMERA_SPREAD)
