"""Street pictures with the road that the segmenter finds in them, for patches of all classes alike."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import cv2
import numpy as np

from trpac_core.vision.networks import RoadSegmenter

from .data import Image, Picture

LEAST_DRIVABLE = 0.5
"""Probability from which a pixel counts as road [-]."""


@dataclass(frozen=True)
class FoundRoad(Picture):
    """A picture whose road, uint8 of the masks' size (160, 256), was found."""

    found: Image = field(kw_only=True)

    def road(self) -> Image:
        """See `Picture.road`."""
        return self.road_in(self.image())

    def road_in(self, image: Image) -> Image:
        """The road at the size of an image that the picture gives."""
        height, width = image.shape[:2]
        return np.asarray(cv2.resize(self.found, (width, height), interpolation=cv2.INTER_NEAREST), np.uint8)


def with_found_roads(pictures: Iterable[Picture], segmenter: RoadSegmenter) -> list[Picture]:
    """The pictures, those whose road is to be found as `FoundRoad`."""
    return [found_road(p, segmenter) if p.road_is_found else p for p in pictures]


def found_road(picture: Picture, segmenter: RoadSegmenter) -> FoundRoad:
    """A picture with the road that the segmenter finds, in place of a mask of its own."""
    drivable = segmenter.segment(picture.image()).drivable >= LEAST_DRIVABLE
    return FoundRoad(**vars(picture) | {"mask": None, "found": drivable.astype(np.uint8)})
