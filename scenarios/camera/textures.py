"""Periodic ground textures, made once per process, with anisotropic levels of detail."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
Texture = NDArray[np.uint8]

MACRO_TEXEL_M = 0.02  # side of a texel
MACRO_SHAPE = (2048, 1024)  # along the road, across: 40.96 m x 20.48 m
MACRO_LEVELS = (9, 8)  # levels of detail along and across
FINE_TEXEL_M = 0.004  # side of a texel
FINE_SHAPE = (1024, 1024)  # 4.096 m x 4.096 m
FINE_LEVELS = (9, 9)
BANK_SEED = 20220901  # of both textures


@dataclass(frozen=True)
class RipMap:
    """A texture with levels of detail that are halved independently along and across the road.

    ``texels`` holds every level one after another, shape (n,), a word of four byte channels each;
    ``offsets[i, j]`` is where the level with ``i`` halvings along and ``j`` halvings across begins.
    """

    texels: NDArray[np.uint32]
    offsets: NDArray[np.int64]


def build_ripmap(texture: Texture, levels: tuple[int, int]) -> RipMap:
    """All levels of a texture of shape (along, across, 4); both sizes must be divisible by their halvings."""
    parts: list[Texture] = []
    offsets = np.zeros(levels, dtype=np.int64)
    total = 0
    row = texture
    for i in range(levels[0]):
        level = row
        for j in range(levels[1]):
            offsets[i, j] = total
            parts.append(level.reshape(-1, 4))
            total += level.shape[0] * level.shape[1]
            level = _halved(level, 1) if j + 1 < levels[1] else level
        row = _halved(row, 0) if i + 1 < levels[0] else row
    return RipMap(np.concatenate(parts).view(np.uint32)[:, 0], offsets)


def _halved(level: Texture, axis: int) -> Texture:
    """Means of pairs along one axis; linear interpolation at half the size is that mean."""
    along, across = level.shape[:2]
    size = (across, along // 2) if axis == 0 else (across // 2, along)
    return np.asarray(cv2.resize(level, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _spectrum_noise(
    rng: np.random.Generator,
    shape: tuple[int, int],
    wavelengths: tuple[float, float],
    slope: float,
    stretch: float,
) -> Float:
    """Periodic Gaussian noise with a power-law amplitude between two wavelengths [texels], normalised.

    ``stretch`` > 1 draws the pattern out along the road (first axis).
    """
    along = np.fft.fftfreq(shape[0])[:, None] * stretch
    across = np.fft.rfftfreq(shape[1])[None, :]
    frequency = np.hypot(along, across)
    long_wave, short_wave = wavelengths
    with np.errstate(divide="ignore"):
        amplitude = np.where(frequency > 0, frequency ** (-slope), 0.0)
    amplitude *= 1.0 - np.exp(-((frequency * long_wave) ** 2))
    amplitude *= np.exp(-((frequency * short_wave) ** 2))
    white = np.fft.rfft2(rng.standard_normal(shape))
    noise = np.fft.irfft2(white * amplitude, s=shape)
    return (noise / noise.std()).astype(np.float32)


def _to_bytes(noise: Float, bytes_per_deviation: float = 42.0) -> Texture:
    """Normalised noise as bytes around 127.5, ``bytes_per_deviation`` per standard deviation."""
    return np.clip(127.5 + bytes_per_deviation * noise, 0, 255).astype(np.uint8)


def _cracks(rng: np.random.Generator, shape: tuple[int, int]) -> Texture:
    """Periodic net of cracks: long ones along and across the road, and small branching ones."""
    along, across = shape
    canvas = np.zeros((along * 2, across * 2), dtype=np.uint8)

    def draw_crack(start: NDArray[np.float64], heading: float, steps: int, turn: float) -> None:
        points = [start]
        for _ in range(steps):
            heading += rng.normal(0.0, turn)
            points.append(points[-1] + 8.0 * np.array([np.cos(heading), np.sin(heading)]))
        path = np.round(np.array(points)[:, ::-1]).astype(np.int32)
        for row in (0, along, -along):
            for column in (0, across, -across):
                shifted = path + np.array([across // 2 + column, along // 2 + row], dtype=np.int32)
                cv2.polylines(canvas, [shifted], False, int(rng.integers(120, 256)), 1, cv2.LINE_AA)

    for _ in range(5):
        draw_crack(rng.uniform((0, 0), shape), rng.normal(0.0, 0.15), 150, 0.18)
    for _ in range(7):
        draw_crack(rng.uniform((0, 0), shape), np.pi / 2 + rng.normal(0.0, 0.2), 60, 0.25)
    for _ in range(12):
        centre = rng.uniform((0, 0), shape)
        for _ in range(10):
            draw_crack(centre + rng.normal(0.0, 40.0, 2), rng.uniform(0, 2 * np.pi), 10, 0.6)
    top, left = along // 2, across // 2
    return canvas[top : top + along, left : left + across]


@lru_cache(maxsize=1)
def macro_texture() -> RipMap:
    """Stains drawn out along the road, blotches, cracks, and hollows where water stands."""
    rng = np.random.default_rng(BANK_SEED)
    stains = _spectrum_noise(rng, MACRO_SHAPE, (600.0, 1.0), 0.7, 5.0)
    blotches = _spectrum_noise(rng, MACRO_SHAPE, (250.0, 0.5), 0.8, 1.2)
    hollows = _spectrum_noise(rng, MACRO_SHAPE, (350.0, 12.0), 1.6, 1.8)
    channels = [
        _to_bytes(stains),
        _to_bytes(blotches),
        _cracks(rng, MACRO_SHAPE),
        _to_bytes(hollows),
    ]
    return build_ripmap(np.dstack(channels), MACRO_LEVELS)


@lru_cache(maxsize=1)
def fine_texture() -> RipMap:
    """Stone grain of asphalt, crumbs of snow, ripples of a water film, and blades of the verge."""
    rng = np.random.default_rng(BANK_SEED + 1)
    stones = _spectrum_noise(rng, FINE_SHAPE, (160.0, 1.0), 0.5, 1.0)
    stones += 0.5 * np.maximum(_spectrum_noise(rng, FINE_SHAPE, (16.0, 1.5), 0.0, 1.0) - 1.2, 0.0)
    crumbs = _spectrum_noise(rng, FINE_SHAPE, (250.0, 2.0), 0.9, 1.4)
    crumbs = 0.8 * crumbs + 0.6 * np.roll(crumbs, 6, axis=0) - 0.6 * np.roll(crumbs, -6, axis=0)
    ripples = _spectrum_noise(rng, FINE_SHAPE, (200.0, 8.0), 1.0, 1.0)
    blades = _spectrum_noise(rng, FINE_SHAPE, (200.0, 1.0), 0.6, 1.0)
    channels = [_to_bytes(layer / layer.std()) for layer in (stones, crumbs, ripples, blades)]
    return build_ripmap(np.dstack(channels), FINE_LEVELS)
