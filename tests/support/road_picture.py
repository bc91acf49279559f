"""A picture that counts as readable road without the renderer: fine grain below a bright sky."""

import cv2
import numpy as np

GRAIN_PX, GRAIN_LEVELS, ROAD_LEVEL, SKY_LEVEL = 2.5, 5.0, 105.0, 190
TINT_LEVELS = (6.0, 0.0, -4.0)


def road_picture(width_px: int, height_px: int, *, seed: int = 1, colour: bool = False) -> np.ndarray:
    """BGR, uint8; another seed gives other grain and another brightness."""
    sky_px = round(0.42 * height_px)
    grain = np.random.default_rng(seed).standard_normal((height_px - sky_px, width_px))
    grain = cv2.GaussianBlur(grain, (0, 0), GRAIN_PX)[..., None] + np.zeros(3)
    tint = np.array(TINT_LEVELS if colour else (0.0, 0.0, 0.0))
    image = np.full((height_px, width_px, 3), SKY_LEVEL, np.uint8)
    image[sky_px:] = np.clip(
        ROAD_LEVEL + 5.0 * seed + tint + GRAIN_LEVELS * grain / grain.std(), 0, 255
    ).astype(np.uint8)
    return image
