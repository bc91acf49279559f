"""Disturbances of the camera's pictures: the paper's set, with the library that the paper used [25].

Section 5.1 of Tian et al. 2022: motion blur on every frame, random brightness and random contrast on 70 % of them;
abnormal exposure and road shadows are the other degradations that it names (Figure 3).
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("NO_ALBUMENTATIONS_UPDATE", "1")  # read on import: no look-up of newer versions
import albumentations

REFERENCE_WIDTH_PX = 1920
"""Picture width for which blur lengths are given; they scale with the picture [px]."""
SHORTEST_BLUR_PX = 3
"""Least kernel of albumentations [px]."""
DISPLAY_GAMMA = 2.2
"""Exponent from pixel values to light, of sRGB [-]."""


@dataclass(frozen=True)
class Disturbance:
    """Probabilities 0..1 and limits of disturbances; without any probability pictures are unchanged.

    ``motion_blur_limit_px`` is the longest smear in a picture 1920 px wide; the brightness and contrast limits are
    shares as albumentations counts them; exposures are drawn from ± ``exposure_limit_ev`` [EV] of light;
    ``shadow_probability`` throws up to ``shadow_count`` polygons on the lower half (for real pictures: rendered
    ones have shadows of their own, with labels).
    """

    motion_blur_probability: float = 0.0
    motion_blur_limit_px: float = 15.0
    brightness_contrast_probability: float = 0.0
    brightness_limit: float = 0.2
    contrast_limit: float = 0.2
    exposure_probability: float = 0.0
    exposure_limit_ev: float = 1.5
    shadow_probability: float = 0.0
    shadow_count: int = 2


NONE = Disturbance()
PAPER = Disturbance(motion_blur_probability=1.0, brightness_contrast_probability=0.7)


def blur_length_px(limit_px: float, width_px: int) -> int:
    """Longest smear for a picture of this width, odd and at least 3 [px]."""
    length = round(limit_px * width_px / REFERENCE_WIDTH_PX)
    return max(SHORTEST_BLUR_PX, length | 1)


def disturb(image: NDArray[np.uint8], disturbance: Disturbance, rng_seed: int) -> NDArray[np.uint8]:
    """A disturbed copy of a picture; the same seed gives the same bytes.

    Parameters
    ----------
    image : uint8 array, shape (H, W, 3)
        Any channel order.
    disturbance : Disturbance
        Its probabilities and limits.
    rng_seed : int
        Seed of this picture, such as the scenario's seed plus the frame number.
    """
    steps = _steps(disturbance, image.shape[1])
    if not steps:
        return image.copy()
    return albumentations.Compose(steps, seed=rng_seed)(image=image)["image"]


def _steps(disturbance: Disturbance, width_px: int) -> list[albumentations.BasicTransform]:
    """The library's transforms in the order of a camera: road, exposure, motion, development."""
    steps: list[albumentations.BasicTransform] = []
    if disturbance.shadow_probability > 0.0:
        steps.append(
            albumentations.RandomShadow(
                shadow_roi=(0.0, 0.5, 1.0, 1.0),
                num_shadows_limit=(1, disturbance.shadow_count),
                shadow_intensity_range=(0.35, 0.65),
                p=disturbance.shadow_probability,
            )
        )
    if disturbance.exposure_probability > 0.0:
        gain = 2.0 ** (disturbance.exposure_limit_ev / DISPLAY_GAMMA)
        steps.append(
            albumentations.MultiplicativeNoise(
                multiplier=(1.0 / gain, gain), p=disturbance.exposure_probability
            )
        )
    if disturbance.motion_blur_probability > 0.0:
        longest = blur_length_px(disturbance.motion_blur_limit_px, width_px)
        steps.append(
            albumentations.MotionBlur(
                blur_limit=(SHORTEST_BLUR_PX, longest), p=disturbance.motion_blur_probability
            )
        )
    if disturbance.brightness_contrast_probability > 0.0:
        steps.append(
            albumentations.RandomBrightnessContrast(
                brightness_limit=disturbance.brightness_limit,
                contrast_limit=disturbance.contrast_limit,
                p=disturbance.brightness_contrast_probability,
            )
        )
    return steps
