"""Looks at a picture as a whole, for single pictures of cameras of which nothing is known.

Patches of road leave out what a person sees first: a winter wood, a street that mirrors its houses, spray behind cars.
A network of its own looks at most of the picture. It is not for driving: where the class changes ahead, the picture's
is not that of the road under the wheel.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

LOOK_WIDTH_PX, LOOK_HEIGHT_PX = 192, 128
LOOKS = ((0.1, 0.4, 0.9, 1.0), (0.0, 0.35, 1.0, 1.0), (0.1, 0.25, 0.9, 0.95))
"""Parts of the picture that are looked at, each mirrored too: left, top, right, bottom [of its size]. The upper quarter
is sky, or what an instrument has written there."""


def look(image: NDArray[np.uint8], box: tuple[float, float, float, float]) -> NDArray[np.uint8]:
    """A part of a BGR picture squeezed to (128, 192, 3); the box as fractions: left, top, right, bottom."""
    height, width = image.shape[:2]
    left, top, right, bottom = box
    part = image[round(top * height) : round(bottom * height), round(left * width) : round(right * width)]
    size = (LOOK_WIDTH_PX, LOOK_HEIGHT_PX)
    return np.asarray(cv2.resize(np.ascontiguousarray(part), size, interpolation=cv2.INTER_AREA), np.uint8)


def picture_looks(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The looks by which a BGR picture is judged, shape (6, 128, 192, 3)."""
    seen = np.stack([look(image, box) for box in LOOKS])
    return np.concatenate([seen, seen[:, :, ::-1]])
