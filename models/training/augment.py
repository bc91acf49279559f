"""Painted shadows and changes of view and light, all driven by a numpy generator."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .data import IGNORE, Image, pixel_box

LIT_DEPTH, SHADOW_DEPTH = 0.2, 0.6
"""Share of a painted shadow's full depth up to which a pixel is labelled lit, and from which shadow [-]."""

SURROUNDINGS_PX = 15
"""Pixels around a painted shadow, in the network's input, that count as known to be unshadowed.

Farther away a real shadow may lie unlabelled, so nothing is learned there.
"""


def shadow_depth(rng: np.random.Generator, height: int, width: int) -> NDArray[np.float32]:
    """Depth of a painted shadow over a picture, 0 to 1, shape (height, width).

    Half are straight-edged (buildings, vehicles, poles), half are tree shade: blobs with holes of light.
    """
    depth = np.zeros((height, width), np.float32)
    rows = rng.uniform(0.35, 1.05, 2) * height
    if rng.random() < 0.5:
        for _ in range(rng.integers(1, 4)):
            centre = np.array([rng.uniform(0, width), rng.uniform(0.5, 1.0) * height])
            angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 7)))
            reach = rng.uniform(0.3, 1.0, len(angles))[:, None]
            size = np.array([rng.uniform(0.08, 0.6) * width, rng.uniform(0.04, 0.3) * height])
            corners = centre + reach * size * np.column_stack((np.cos(angles), np.sin(angles)))
            cv2.fillPoly(depth, [np.round(corners).astype(np.int32)], 1.0)
    else:
        noise = rng.standard_normal((height, width)).astype(np.float32)
        stretch = rng.uniform(1.0, 3.5)
        sigma = rng.uniform(2.0, 7.0)
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigmaX=sigma * stretch, sigmaY=sigma), np.float32)
        noise /= noise.std() + 1e-6
        depth = (noise > rng.uniform(-0.3, 0.8)).astype(np.float32)
        band = np.zeros((height, 1), np.float32)
        top, bottom = sorted(rows)
        band[int(top) : int(max(bottom, top + 0.15 * height))] = 1.0
        depth *= cv2.GaussianBlur(band, (0, 0), 3.0).reshape(height, 1)
    return np.asarray(cv2.GaussianBlur(depth, (0, 0), rng.uniform(0.4, 2.0)), np.float32)


def paint_shadow(rng: np.random.Generator, image: Image, depth: NDArray[np.float32]) -> Image:
    """The picture darkened by a shadow: sky light only, hence bluer than the lit road."""
    strength = rng.uniform(0.35, 0.75)
    blue_keeps = rng.uniform(0.0, 0.12)
    kept = 1.0 - strength * np.array([1.0 - 2.0 * blue_keeps, 1.0 - blue_keeps, 1.0])
    factor = 1.0 - depth[..., None] * (1.0 - kept)
    gamma = rng.uniform(1.0, 2.2)
    linear = (image.astype(np.float32) / 255.0) ** gamma * factor
    return np.clip(255.0 * linear ** (1.0 / gamma) + 0.5, 0, 255).astype(np.uint8)


def shadow_label(depth: NDArray[np.float32], road: Image, before: Image) -> Image:
    """Label after a shadow was painted: 1 shadow, 0 lit and close to it, half shadow and off the road 255.

    Farther away the label stays as it was before.
    """
    kernel = np.ones((2 * SURROUNDINGS_PX + 1, 2 * SURROUNDINGS_PX + 1), np.uint8)
    near = cv2.dilate((depth > 0.5).astype(np.uint8), kernel) > 0
    label = np.where(near, 0, before)
    label[depth > LIT_DEPTH] = IGNORE
    label[depth > SHADOW_DEPTH] = 1
    label[road != 1] = IGNORE
    return label.astype(np.uint8)


def random_view(
    rng: np.random.Generator, planes: list[Image], size: tuple[int, int], zoom: float
) -> list[Image]:
    """The same random crop and mirror of a picture (first) and its labels, resized to (width, height).

    The crop keeps the aspect of `size` within 15 % and is at least 1 / zoom of the picture.
    """
    height, width = planes[0].shape[:2]
    aspect = size[0] / size[1] * np.exp(rng.uniform(-0.15, 0.15))
    largest = min(width, height * aspect)
    crop_w = largest / rng.uniform(1.0, zoom)
    crop_h = min(crop_w / aspect, height)
    left = rng.uniform(0, width - crop_w)
    top = rng.uniform(0.3, 1.0) * (height - crop_h)
    box = (left / width, top / height, (left + crop_w) / width, (top + crop_h) / height)
    x0, y0, x1, y1 = pixel_box(box, planes[0])
    mirror = rng.random() < 0.5
    views = []
    for index, plane in enumerate(planes):
        view = cv2.resize(
            plane[y0:y1, x0:x1], size, interpolation=cv2.INTER_AREA if index == 0 else cv2.INTER_NEAREST
        )
        views.append(np.ascontiguousarray(view[:, ::-1] if mirror else view, dtype=np.uint8))
    return views


def camera_look(rng: np.random.Generator, image: Image, spread: float) -> Image:
    """Gain, gamma and white balance of a BGR picture as they differ between cameras, within `spread` [-] of neutral."""
    gain = np.exp(rng.uniform(-spread, spread) + rng.uniform(-0.3 * spread, 0.3 * spread, 3))
    gamma = np.exp(rng.uniform(-spread, spread))
    levels = np.arange(256) / 255.0
    table = np.clip(255.0 * np.clip(levels[:, None] ** gamma * gain, 0.0, 1.0) + 0.5, 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table[None]), np.uint8)


def disturbed_look(rng: np.random.Generator, image: Image) -> Image:
    """Blur, sensor noise or haze on some pictures; for the segmenter only, the classifier never sees it."""
    if rng.random() < 0.25:
        length = int(rng.integers(3, 8))
        kernel = np.zeros((length, length), np.float32)
        kernel[length // 2] = 1.0 / length
        turn = cv2.getRotationMatrix2D((length / 2 - 0.5, length / 2 - 0.5), rng.uniform(0, 180), 1.0)
        kernel = np.asarray(cv2.warpAffine(kernel, turn, (length, length)), np.float32)
        image = cv2.filter2D(image, -1, kernel / max(float(kernel.sum()), 1e-6)).astype(np.uint8)
    if rng.random() < 0.25:
        noisy = image + rng.normal(0.0, rng.uniform(2.0, 10.0), image.shape)
        image = np.clip(noisy, 0, 255).astype(np.uint8)
    if rng.random() < 0.3:
        contrast, shift = rng.uniform(0.6, 1.4), rng.uniform(-40, 40)
        image = np.clip(128 + contrast * (image.astype(np.float32) - 128) + shift, 0, 255).astype(np.uint8)
    return image


BONNET_TOP, BONNET_BULGE = (0.72, 0.97), (0.0, 0.12)
"""Row where a bonnet or dashboard begins, and how much higher its middle is, over the picture's height [-]."""
BONNET_LEVELS, BONNET_TINT, BONNET_GLOSS = (6.0, 200.0), 0.25, (0.0, 0.6)
"""Its paint, log-uniform, its channels apart, and the share of it that mirrors the picture [8-bit levels], [-], [-]."""


def bonnet(rng: np.random.Generator, image: Image) -> tuple[Image, NDArray[np.bool_]]:
    """A picture over the bonnet or the dashboard of the car that takes it, and where that hides it."""
    height, width = image.shape[:2]
    across = np.linspace(-1.0, 1.0, width) - rng.uniform(-0.4, 0.4)
    arch = 1.0 - across**2 * rng.uniform(0.3, 1.2)
    top = (rng.uniform(*BONNET_TOP) - rng.uniform(*BONNET_BULGE) * arch) * height
    depth = np.clip((np.arange(height)[:, None] - top) / rng.uniform(1.0, 3.0) + 0.5, 0.0, 1.0)
    paint = np.exp(rng.uniform(*np.log(BONNET_LEVELS)) + rng.uniform(-BONNET_TINT, BONNET_TINT, 3))
    shade = np.linspace(rng.uniform(0.6, 1.6), rng.uniform(0.6, 1.4), height)[:, None, None]
    mirrored = cv2.GaussianBlur(np.ascontiguousarray(image[::-1]), (0, 0), rng.uniform(1.0, 8.0))
    gloss = rng.uniform(*BONNET_GLOSS)
    body = (1.0 - gloss) * paint * shade + gloss * mirrored
    seen = image + depth[..., None] * (body - image)
    return np.clip(seen + 0.5, 0, 255).astype(np.uint8), depth > 0.5
