"""How bright and how tinted a patch of road is beside the picture that it was cut from.

A patch alone does not tell packed snow at dusk from grey asphalt at noon: both are grey. Beside its picture it does:
snow is nearly as bright as the sky and as the verge, wet asphalt mirrors the sky. A few numbers of the whole picture
say so, and a linear map of them is added to the patch's logits.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.files import parse_json

from .classes import Surface

SCENE_WIDTH_PX, SCENE_HEIGHT_PX = 32, 20
"""Size of the reduced picture that the numbers are of."""
FINE_ENOUGH = 8
"""Pixels to each side behind one of the reduced picture: the mean needs no more of a large one."""
SIDE_ROWS, SIDE_COLUMNS = 8, 6
"""Row from which, and columns from the left and right edge within which, the verges are taken to be."""
GREY_OF_BGR = np.array([0.114, 0.587, 0.299]) / 255.0
"""Luma of a BGR pixel of eight bits (ITU-R BT.601), in [0, 1]."""
DARK, FLAT = 0.03, 0.05
"""Added to what a brightness, and what a picture's deviation, is divided by: below it there is nothing to tell [-]."""
LIMIT = 4.0
"""A number counts up to so many standard deviations of the training scenes [-]."""

NUMBERS = (
    "patch_brightness",
    "scene_deviation",
    "patch_beyond_brightest",
    "patch_beyond_sides",
    "patch_contrast",
    "patch_blue",
    "patch_red",
    "scene_blue",
    "scene_red",
)
"""What a scene tells of a patch [-]: its brightness in [0, 1] and the picture's deviation of it; in units of the latter
how much brighter it is than the picture's brightest part, which is sky wherever there is some to be seen, and than the
sides, and its own deviation; blue and red beyond the mean of the three channels, over it. But for the first two a
camera's gain does not move them, nor exposure by much."""


def scene_of(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A BGR picture of any size, reduced to (20, 32, 3)."""
    height, width = image.shape[:2]
    step = max(min(height // SCENE_HEIGHT_PX, width // SCENE_WIDTH_PX) // FINE_ENOUGH, 1)
    size = (SCENE_WIDTH_PX, SCENE_HEIGHT_PX)
    small = cv2.resize(np.ascontiguousarray(image[::step, ::step]), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def scene_numbers(patches: NDArray[np.uint8], scenes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """`NUMBERS` of patches in their scenes.

    Parameters
    ----------
    patches : uint8, shape (n, h, w, 3)
        BGR.
    scenes : uint8, shape (20, 32, 3) or (n, 20, 32, 3)
        From `scene_of`: one for all, or one for each.

    Returns
    -------
    array, shape (n, 9)
    """
    scenes = scenes if scenes.ndim == 4 else scenes[None]
    patch, scene = patches @ GREY_OF_BGR, scenes @ GREY_OF_BGR
    brightness, deviation = patch.mean(axis=(1, 2)), scene.std(axis=(1, 2))
    verges = scene[:, SIDE_ROWS:]
    sides = 0.5 * (verges[:, :, :SIDE_COLUMNS] + verges[:, :, -SIDE_COLUMNS:])
    columns = [
        brightness,
        deviation,
        (brightness - scene.max(axis=(1, 2))) / (deviation + FLAT),
        (brightness - sides.mean(axis=(1, 2))) / (deviation + FLAT),
        patch.std(axis=(1, 2)) / (deviation + FLAT),
        *_tint(patches),
        *_tint(scenes),
    ]
    return np.column_stack([np.broadcast_to(column, len(patches)) for column in columns])


def _tint(images: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Blue and red beyond the mean of the three channels, over it, of each image [-]."""
    channels = np.reshape([cv2.mean(image)[:3] for image in images], (-1, 3)) / 255.0
    mean = channels.mean(axis=1)
    return (channels[:, 0] - mean) / (mean + DARK), (channels[:, 2] - mean) / (mean + DARK)


@dataclass(frozen=True)
class SceneHead:
    """A linear map from a scene's numbers to what they add to a patch's logits.

    Attributes
    ----------
    mean, deviation : array, shape (9,)
        Of the numbers, in training.
    weights : array, shape (9, 3)
        Logits per standard deviation.
    bias : array, shape (3,)
        Logits at the mean.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    weights: NDArray[np.float64]
    bias: NDArray[np.float64]

    def standardised(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers in standard deviations of the training scenes, within `LIMIT`."""
        return np.clip((numbers - self.mean) / self.deviation, -LIMIT, LIMIT)

    def logits(self, patches: NDArray[np.uint8], scenes: NDArray[np.uint8]) -> NDArray[np.float64]:
        """What the scenes add to the logits of patches, shape (n, 3); see `scene_numbers`."""
        return self.standardised(scene_numbers(patches, scenes)) @ self.weights + self.bias

    def to_text(self) -> str:
        """As a network file's metadata hold it."""
        rows = {name: getattr(self, name).tolist() for name in SHAPES}
        return json.dumps({"numbers": list(NUMBERS)} | rows)

    @classmethod
    def from_text(cls, text: str) -> SceneHead:
        """From `to_text`.

        Raises
        ------
        ValueError
            Not such a text: what was expected.
        """
        given: Any = parse_json(text, "the network's scene")
        if not isinstance(given, Mapping) or given.get("numbers") != list(NUMBERS):
            raise ValueError(f"'numbers' must be {list(NUMBERS)}")
        arrays = {}
        for name, shape in SHAPES.items():
            try:
                arrays[name] = np.array(given.get(name), dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{name!r} must be numbers of shape {shape}") from error
            if arrays[name].shape != shape or not np.isfinite(arrays[name]).all():
                raise ValueError(f"{name!r} must be finite numbers of shape {shape}")
        if not (arrays["deviation"] > 0.0).all():
            raise ValueError("'deviation' must be above 0")
        return cls(**arrays)


SHAPES = {
    "mean": (len(NUMBERS),),
    "deviation": (len(NUMBERS),),
    "weights": (len(NUMBERS), len(Surface)),
    "bias": (len(Surface),),
}
"""Arrays of a head, and their shapes."""
