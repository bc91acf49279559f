"""Shadows of trees, poles, walls and bridges, and repairs of the asphalt, as a map that repeats along the road."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from .scene import Scene
from .textures import RipMap, build_ripmap

TEXEL_M = 0.06  # side of a texel
SHAPE = (4096, 512)  # along, across: 245.76 m x 30.72 m
LEVELS = (6, 6)  # levels of detail along and across
LENGTH_M = SHAPE[0] * TEXEL_M
LABEL_BLUR_M = 0.35  # length over which shade is averaged for the label
LABEL_SHADE = 0.4  # averaged shade from which the ground is labelled as shadow [-]
LONGEST_SHADOW = 7.0  # greatest shadow length over height [-]

Points = NDArray[np.float64]
Image = NDArray[np.uint8]


def decal_map(scene: Scene) -> RipMap:
    """The map; channels are shade (255 is dark), shade for the label (128: threshold), tone and gloss of repairs."""
    rng = np.random.default_rng([scene.seed, 11])
    if scene.casts_shadows:
        shade = _shade(scene, rng)
        label = _label(shade)
    else:
        shade = label = np.zeros(SHAPE, dtype=np.uint8)
    tone, gloss = _repairs(scene, rng)
    return build_ripmap(np.dstack((shade, label, tone, gloss)), LEVELS)


def _label(shade: Image) -> Image:
    """Shade averaged over LABEL_BLUR_M, scaled so that 128 is the threshold of the label."""
    small = cv2.resize(shade, (SHAPE[1] // 4, SHAPE[0] // 4), interpolation=cv2.INTER_AREA)
    mean = _blurred(np.asarray(small), LABEL_BLUR_M / TEXEL_M / 4.0).astype(np.float32)
    label = np.clip(128.0 + (mean / 255.0 - LABEL_SHADE) * 400.0, 0, 255).astype(np.uint8)
    return np.asarray(cv2.resize(label, (SHAPE[1], SHAPE[0]), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


_WRAP = 64


def _blurred(image: Image, sigma: float) -> Image:
    """Gaussian blur, periodic along the road."""
    wrapped = np.vstack((image[-_WRAP:], image, image[:_WRAP]))
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), sigma)[_WRAP:-_WRAP], dtype=np.uint8)


def _fill(canvas: Image, points_m: Points, value: int) -> None:
    """Fill a polygon given as (along, across from the map's right rim) [m], with its repeats along the road."""
    pixels = points_m[:, ::-1] / TEXEL_M
    for turn in (-1, 0, 1):
        shifted = pixels + np.array([0.0, turn * SHAPE[0]])
        if shifted[:, 1].max() >= 0 and shifted[:, 1].min() < SHAPE[0]:
            cv2.fillPoly(canvas, [np.round(shifted * 8).astype(np.int32)], value, cv2.LINE_AA, 3)


def _count(rng: np.random.Generator, per_100_m: float) -> int:
    return int(rng.poisson(per_100_m * LENGTH_M / 100.0))


def _beside(scene: Scene, rng: np.random.Generator, nearest_m: float, farthest_m: float) -> Points:
    """A random point beside the road, in map coordinates [m]."""
    right, left = scene.road_edges_m
    away = rng.uniform(nearest_m, farthest_m)
    across = left + away if rng.random() < 0.5 else right - away
    return np.array([rng.uniform(0, LENGTH_M), across + SHAPE[1] * TEXEL_M / 2])


def _shade(scene: Scene, rng: np.random.Generator) -> Image:
    reach = min(1.0 / np.tan(scene.sun_elevation_rad), LONGEST_SHADOW)
    per_metre = -reach * np.array([np.cos(scene.sun_azimuth_rad), np.sin(scene.sun_azimuth_rad)])
    soft = np.zeros(SHAPE, dtype=np.uint8)
    for _ in range(_count(rng, scene.trees_per_100_m)):
        _tree(soft, _beside(scene, rng, 1.5, 9.0), per_metre, rng)
    hard = np.zeros(SHAPE, dtype=np.uint8)
    for _ in range(_count(rng, scene.poles_per_100_m)):
        _pole(hard, _beside(scene, rng, 0.5, 3.0), per_metre, rng)
    for _ in range(_count(rng, scene.walls_per_100_m)):
        _block(hard, _beside(scene, rng, 3.0, 14.0), per_metre, rng)
    for _ in range(_count(rng, scene.bridges_per_100_m)):
        _bridge(hard, per_metre, rng)
    return np.maximum(_blurred(soft, 1.8), _blurred(hard, 0.9))


def _tree(canvas: Image, foot: Points, per_metre: Points, rng: np.random.Generator) -> None:
    """Draw the shadow of a trunk and a crown of leaf clusters with light between them."""
    height = rng.uniform(4.0, 14.0)
    radius = height * rng.uniform(0.18, 0.35)
    _strip(canvas, foot, foot + per_metre * height * 0.6, height * 0.03, 255)
    leaves = int(rng.uniform(25, 110))
    for _ in range(leaves):
        up = height * rng.uniform(0.4, 1.0)
        bulge = radius * np.sqrt(max(0.1, 1.0 - (up / height / 0.62 - 1.08) ** 2))
        middle = foot + per_metre * up + rng.normal(0.0, 0.5 * bulge, 2)
        size = radius * rng.uniform(0.1, 0.35)
        stretch = size * rng.uniform(0.3, 0.8) * per_metre
        angles = np.linspace(0.0, 2 * np.pi, 9)[:-1]
        ring = size * rng.uniform(0.6, 1.2, (8, 1)) * np.column_stack((np.cos(angles), np.sin(angles)))
        _fill(canvas, middle + ring + np.outer(np.cos(angles), stretch), int(rng.integers(190, 256)))


def _strip(canvas: Image, start: Points, end: Points, width_m: float, value: int) -> None:
    along = end - start
    side = np.array([-along[1], along[0]]) / max(np.hypot(*along), 1e-6) * width_m / 2
    _fill(canvas, np.array([start + side, end + side, end - side, start - side]), value)


def _pole(canvas: Image, foot: Points, per_metre: Points, rng: np.random.Generator) -> None:
    tip = foot + per_metre * rng.uniform(4.0, 10.0)
    _strip(canvas, foot, tip, rng.uniform(0.12, 0.35), 255)
    if rng.random() < 0.5:
        _strip(canvas, tip, tip + np.array([0.0, rng.uniform(-2.5, 2.5)]), 0.3, 255)


def _block(canvas: Image, foot: Points, per_metre: Points, rng: np.random.Generator) -> None:
    """Draw the shadow of a box, such as a house, a wall or a lorry: the hull of its base and its projected roof."""
    size = rng.uniform((2.0, 1.0), (18.0, 8.0))
    corners = foot + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
    outline = np.vstack((corners, corners + per_metre * rng.uniform(2.0, 9.0)))
    hull = cv2.convexHull(outline.astype(np.float32)).reshape(-1, 2).astype(np.float64)
    _fill(canvas, hull, 255)


def _bridge(canvas: Image, per_metre: Points, rng: np.random.Generator) -> None:
    width, slant = rng.uniform(3.0, 14.0), rng.normal(0.0, 3.0)
    start = rng.uniform(0, LENGTH_M) + per_metre[0] * 6.0
    rim = SHAPE[1] * TEXEL_M
    _fill(
        canvas,
        np.array([[start, 0], [start + width, 0], [start + width + slant, rim], [start + slant, rim]]),
        255,
    )


def _repairs(scene: Scene, rng: np.random.Generator) -> tuple[Image, Image]:
    """Tone (128 is the road's own) and gloss (bitumen) of patches, sealed seams, skid marks and covers."""
    tone = np.full(SHAPE, 128, dtype=np.uint8)
    gloss = np.zeros(SHAPE, dtype=np.uint8)
    right, left = (edge + SHAPE[1] * TEXEL_M / 2 for edge in scene.road_edges_m)
    for _ in range(_count(rng, scene.patches_per_100_m)):
        corner = np.array([rng.uniform(0, LENGTH_M), rng.uniform(right, left)])
        size = np.exp(rng.uniform((-0.7, -1.0), (2.8, 1.3)))
        size[1] = min(size[1], left - corner[1])
        skew = rng.normal(0.0, 0.05)
        corners = corner + np.array([[0, 0], [1, skew], [1, 1 + skew], [0, 1]]) * size
        value = int(np.clip(rng.normal(112, 22), 60, 175))
        _fill(tone, corners, value)
        if rng.random() < 0.4:
            for start, end in pairwise(np.vstack((corners, corners[:1]))):
                _strip(tone, start, end, 0.08, 70)
                _strip(gloss, start, end, 0.08, 160)
    for _ in range(_count(rng, 6.0 * scene.cracks**2)):
        point = np.array([rng.uniform(0, LENGTH_M), rng.uniform(right, left)])
        heading = rng.choice([0.0, np.pi / 2]) + rng.normal(0.0, 0.2)
        for _ in range(int(rng.integers(4, 14))):
            heading += rng.normal(0.0, 0.3)
            end = point + 0.7 * np.array([np.cos(heading), np.sin(heading)])
            if right < end[1] < left:
                _strip(tone, point, end, 0.1, 75)
                _strip(gloss, point, end, 0.1, 170)
            point = end
    for _ in range(_count(rng, 0.8)):
        foot = np.array([rng.uniform(0, LENGTH_M), rng.uniform(-1.2, -0.5) + SHAPE[1] * TEXEL_M / 2])
        run = np.array([rng.uniform(4, 25), rng.normal(0.0, 0.4)])
        for offset in (0.0, 1.5):
            start = foot + np.array([0.0, offset])
            _strip(tone, start, start + run, 0.2, 105)
    return tone, gloss
