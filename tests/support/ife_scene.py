"""Pictures of road whose class is known at every pixel, and stand-ins for the networks that read them."""

from functools import lru_cache

import numpy as np

from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.networks import PatchVerdicts, RoadMasks

DRY, WET, SNOW = Surface.DRY, Surface.WET, Surface.SNOW_ICE
PAINT = np.array([60, 130, 220])
CAMERA = Camera()
ALL_ROAD = np.ones((160, 256), np.float32)
NONE = np.zeros((160, 256), np.float32)


class Masks:
    """A segmenter that knows."""

    def __init__(self, drivable=ALL_ROAD, shadow=NONE, surface=(0.0, 0.0, 0.0)):
        self.masks = RoadMasks(drivable, shadow, np.array(surface))
        self.calls = 0

    def segment(self, image):
        self.calls += 1
        return self.masks


class Middle:
    """A classifier that reads the paint in the middle of a patch."""

    def __init__(self, temperature=1.0, certainty=3.0):
        self.temperature, self.certainty = temperature, certainty
        self.patches = np.empty((0, 64, 96, 3), np.uint8)

    def verdicts(self, patches):
        self.patches = patches
        grey = patches[:, 30:34, 46:50].mean(axis=(1, 2, 3))
        logits = self.certainty * np.eye(3)[np.abs(grey[:, None] - PAINT).argmin(axis=1)]
        return PatchVerdicts(logits, self.readable(grey))

    def readable(self, grey):
        return np.ones(len(grey))


@lru_cache
def ground(camera) -> np.ndarray:
    """Ground point of every second pixel."""
    rows, columns = np.mgrid[0 : camera.height_px : 2, 0 : camera.width_px : 2]
    return camera.image_to_ground(np.column_stack((columns.ravel(), rows.ravel())) + 0.5)


def paint(surface_at, camera=CAMERA) -> np.ndarray:
    """A picture of road whose class is a function of the ground point."""
    labels = surface_at(*ground(camera).T).astype(int)
    grey = PAINT.astype(np.uint8)[labels].reshape(camera.height_px // 2, camera.width_px // 2)
    return grained(np.repeat(grey.repeat(2, axis=0).repeat(2, axis=1)[..., None], 3, axis=2))


def grained(image) -> np.ndarray:
    """With stripes of 40 pixels: a picture without any contrast shows no road."""
    stripes = 6.0 * np.sin(2.0 * np.pi * np.arange(image.shape[1]) / 40.0)
    return np.clip(image + stripes[:, None], 0, 255).astype(np.uint8)


def plain(surface) -> np.ndarray:
    return grained(np.full((1200, 1920, 3), PAINT[surface]))


def half(left: bool) -> np.ndarray:
    mask = NONE.copy()
    mask[:, :128] = left
    mask[:, 128:] = not left
    return mask


SPLIT = np.array([int(DRY), int(SNOW)])


def split_road(border_y_m: float = 0.0):
    """Snow on the left of a line along the road, dry on the right."""
    return paint(lambda x, y: SPLIT[(y > border_y_m).astype(int)])
