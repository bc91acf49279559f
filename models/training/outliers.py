"""Patches that show no road that could be read: what the network must own up to instead of naming a surface.

Outlier exposure (Hendrycks, Mazeika and Dietterich 2019): known kinds of such pictures teach a head of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.roi_sampling import PATCH_HEIGHT_PX, PATCH_WIDTH_PX

from .data import Image, Picture
from .patches import MIN_WIDTH_PX, reduced
from .textures import KINDS

UPPER_SHARE = 0.45
"""Upper share of a forward camera's picture that holds sky, trees and houses, and hardly ever road [-]."""

SIZE = (PATCH_WIDTH_PX, PATCH_HEIGHT_PX)


def outlier_patches(rng: np.random.Generator, pictures: Sequence[Picture], road: Image, count: int) -> Image:
    """Patches without readable road, shape (count, 64, 96, 3).

    Half are drawn (`textures.KINDS`), a quarter real surroundings, a quarter covered or spoilt looks.

    `pictures` give the surroundings, `road` (n, 64, 96, 3) the roads that are spoilt.
    """
    drawn = list(KINDS.values())
    spoilt: list[Callable[[np.random.Generator, Image], Image]] = [
        _cloud, _noise, _dark, _bright, _defocused, _stripes
    ]  # fmt: skip
    patches = []
    for number in range(count):
        if number % 2:
            patches.append(drawn[number // 2 % len(drawn)](rng))
        elif number % 4:
            patches.append(_upper_part(rng, pictures[rng.integers(len(pictures))]))
        else:
            patches.append(spoilt[number // 4 % len(spoilt)](rng, road[rng.integers(len(road))]))
    return np.stack(patches)


def _upper_part(rng: np.random.Generator, picture: Picture) -> Image:
    image = picture.image()
    height, width = round(UPPER_SHARE * image.shape[0]), image.shape[1]
    top = _text_rows(picture, image)
    columns = np.exp(rng.uniform(np.log(MIN_WIDTH_PX), np.log(0.9 * width)))
    rows = min(columns / rng.uniform(1.5, 3.0), height - top - 1)
    left, upper = rng.uniform(0, width - columns), rng.uniform(top, height - rows)
    return reduced(image, (left, upper, left + columns, upper + max(rows, 8)))


def _text_rows(picture: Picture, image: Image) -> int:
    """Rows of burnt-in text at the top of the overlaid clips, which are no scenery."""
    return round(0.42 * image.shape[0]) if "extreme" in picture.source else 0


def _cloud(rng: np.random.Generator, road: Image) -> Image:
    """Smooth patches of light and dark, as through a covered or smeared lens; spectrum 1 / f^a."""
    noise = np.fft.rfft2(rng.standard_normal(SIZE[::-1]))
    fy, fx = np.fft.fftfreq(SIZE[1])[:, None], np.fft.rfftfreq(SIZE[0])[None]
    spectrum = np.maximum(np.hypot(fx, fy), 1.0 / SIZE[0]) ** -rng.uniform(1.5, 4.0)
    plane = np.fft.irfft2(noise * spectrum, SIZE[::-1])
    plane = (plane - plane.mean()) / (plane.std() + 1e-9)
    tint = np.exp(rng.normal(0.0, 0.15, 3))
    return _eight_bit(
        (rng.uniform(10, 230) + rng.uniform(2, 50) * plane)[..., None] * tint + _grain(rng, 4.0)
    )


def _noise(rng: np.random.Generator, road: Image) -> Image:
    """Noise alone: uniform, grey or coloured, at any grain."""
    channels = 3 if rng.random() < 0.6 else 1
    scale = int(rng.integers(1, 6))
    shape = (SIZE[1] // scale + 1, SIZE[0] // scale + 1, channels)
    noise = np.repeat(rng.uniform(0, 1, shape), 3 // channels, axis=2).astype(np.float32)
    noise = cv2.resize(noise, SIZE, interpolation=int(rng.choice([cv2.INTER_NEAREST, cv2.INTER_CUBIC])))
    return _eight_bit(rng.uniform(0, 160) + rng.uniform(40, 255) * noise)


def _dark(rng: np.random.Generator, road: Image) -> Image:
    """A road at night beyond the headlights: a few grey levels under sensor noise."""
    light = road.astype(np.float32) / 255.0 * rng.uniform(2.0, 22.0)
    return _eight_bit(light + np.abs(_grain(rng, rng.uniform(1.0, 9.0))))


def _bright(rng: np.random.Generator, road: Image) -> Image:
    """A road driven into saturation: only its darkest parts are left."""
    return _eight_bit(road.astype(np.float32) * rng.uniform(2.5, 9.0) + rng.uniform(60, 200))


def _defocused(rng: np.random.Generator, road: Image) -> Image:
    """A road far out of focus, or behind water on the lens."""
    smooth = cv2.GaussianBlur(road, (0, 0), rng.uniform(7.0, 25.0)).astype(np.float32)
    return _eight_bit(smooth + _grain(rng, rng.uniform(0.0, 5.0)))


def _stripes(rng: np.random.Generator, road: Image) -> Image:
    """Regular structure: bricks, slats, grilles, test pictures."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    turn, period = rng.uniform(0, np.pi), rng.uniform(4, 30)
    along = x * np.cos(turn) + y * np.sin(turn)
    across = (y * np.cos(turn) - x * np.sin(turn)) + (along // period % 2) * rng.uniform(0, period)
    gap = rng.uniform(0.05, 0.4)
    lines = (along % period < gap * period) | (across % (period * rng.uniform(0.7, 4.0)) < gap * period)
    first, second = rng.uniform(0, 255, (2, 3))
    return _eight_bit(np.where(lines[..., None], first, second) + _grain(rng, rng.uniform(0.0, 15.0)))


def _grain(rng: np.random.Generator, deviation: float) -> NDArray[np.float64]:
    return rng.normal(0.0, deviation, (*SIZE[::-1], 3))


def _eight_bit(values: NDArray) -> Image:
    return np.clip(values + 0.5, 0, 255).astype(np.uint8)
