"""Panorama of the surroundings at infinity: sky, sun glow, clouds, hills and a line of trees."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .scene import Scene

Float = NDArray[np.float32]

AZIMUTH_RAD = 1.0  # the panorama reaches this far to either side
LOWEST_RAD, HIGHEST_RAD = -0.02, 0.62
HOUSES, HOUSE_LENGTH = 40, 1.0
"""Houses of a row, of which the last has no end, and their length over the row's distance aside [-]."""
ROOFS, FACADES, FACADE_TINTS = (0.7, 1.2), (0.08, 0.5), (0.85, 1.15)
"""Height of a house over its row's, reflectance of its wall, and the tint of each of its channels [-]."""
STOREYS, WINDOWS, GLASS = 4, 3.0, 0.35
"""Storeys, windows per distance aside, and how dark they are beside the wall [-]."""


@dataclass(frozen=True)
class Panorama:
    """Linear BGR light by direction; rows go up from ``LOWEST_RAD``, columns left to right.

    ``sharp`` is the camera's view, ``rough`` the blurred reflection in a wet road; both shape (rows, columns, 3),
    relative to the light from white open ground.
    """

    sharp: Float
    rough: Float
    sharp_pixel_rad: float
    rough_pixel_rad: float
    mean: Float


def _clouds(rng: np.random.Generator, elevation: Float, columns: int) -> Float:
    """Fractal noise, finer and flatter towards the horizon, values about 0..1."""
    rows = len(elevation)
    total = np.zeros((rows, columns), dtype=np.float32)
    squeeze = 1.0 / (np.maximum(elevation, 0.0) + 0.12)
    v = (squeeze * 9.0)[:, None].repeat(columns, axis=1).astype(np.float32)
    u = (np.linspace(-1.0, 1.0, columns)[None, :] * squeeze[:, None] * 2.2).astype(np.float32)
    size = 64
    for octave in range(4):
        noise = rng.random((size, size), dtype=np.float32)
        scale = 2.0**octave
        total += 0.55**octave * cv2.remap(
            noise, (u * scale + 200) % (size - 1), (v * scale) % (size - 1), cv2.INTER_LINEAR
        )
    return total / 2.0


def _ridge(rng: np.random.Generator, columns: int, roughness: float) -> Float:
    """A periodic outline of heights, values about 0..1."""
    frequency = np.arange(columns // 2 + 1, dtype=np.float64)
    amplitude = np.where(frequency > 1.5, np.maximum(frequency, 1.0) ** -roughness, 0.0)
    line = np.fft.irfft(amplitude * np.fft.rfft(rng.standard_normal(columns)), columns)
    return (0.5 + 0.2 * line / line.std()).astype(np.float32)


def build_panorama(scene: Scene, pixel_rad: float) -> Panorama:
    """The panorama of a scene with pixels of ``pixel_rad`` [rad]."""
    rng = np.random.default_rng([scene.seed, 23])
    columns = int(2 * AZIMUTH_RAD / pixel_rad)
    rows = int((HIGHEST_RAD - LOWEST_RAD) / pixel_rad)
    elevation = (LOWEST_RAD + (np.arange(rows) + 0.5) * pixel_rad).astype(np.float32)
    azimuth = (AZIMUTH_RAD - (np.arange(columns) + 0.5) * pixel_rad).astype(np.float32)
    light = _sky(scene, rng, elevation, azimuth)
    haze = light[int(0.06 / pixel_rad)].mean(axis=0)
    _land(scene, rng, light, elevation, haze)
    _houses(scene, light, elevation, azimuth)
    rough_pixel_rad = max(pixel_rad, 0.006)
    factor = pixel_rad / rough_pixel_rad
    small = cv2.resize(light, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    rough = np.asarray(
        cv2.GaussianBlur(small, (0, 0), sigmaX=2.5, sigmaY=14.0, borderType=cv2.BORDER_REPLICATE),
        dtype=np.float32,
    )
    mean = light.mean(axis=(0, 1)).astype(np.float32)
    return Panorama(light, rough, pixel_rad, HIGHEST_RAD / rough.shape[0] * 1.03, mean)


def _sky(scene: Scene, rng: np.random.Generator, elevation: Float, azimuth: Float) -> Float:
    up = np.clip(elevation / HIGHEST_RAD, 0.0, 1.0)[:, None, None]
    if scene.sky == "overcast":
        zenith, horizon = np.array([0.95, 0.93, 0.9]), np.array([0.72, 0.71, 0.7])
    elif scene.sky == "low_sun":
        zenith, horizon = np.array([0.55, 0.42, 0.32]), np.array([0.55, 0.75, 1.0])
    else:
        zenith, horizon = np.array([0.62, 0.38, 0.2]), np.array([0.85, 0.75, 0.62])
    tone = rng.uniform(0.7, 1.15)
    light = (tone * (horizon + (zenith - horizon) * up**0.6)).astype(np.float32)
    light = np.repeat(light, len(azimuth), axis=1)
    if scene.sky != "clear":
        cover = {"broken": 0.5, "overcast": 0.0, "low_sun": 0.45}[scene.sky]
        field = _clouds(rng, elevation, len(azimuth))
        share = np.clip((field - cover) * 4.0, 0.0, 1.0)[..., None]
        if scene.sky == "overcast":
            share = share * 0.55
        bright = scene.cloud_tone * (0.55 + 0.5 * field[..., None]) * np.array([1.0, 0.99, 0.97])
        light = light * (1 - share) + bright.astype(np.float32) * share
    if scene.sun_on_road > 0.0:
        apart = np.arccos(
            np.clip(
                np.sin(elevation)[:, None] * np.sin(scene.sun_elevation_rad)
                + np.cos(elevation)[:, None]
                * np.cos(scene.sun_elevation_rad)
                * np.cos(azimuth - scene.sun_azimuth_rad)[None, :],
                -1.0,
                1.0,
            )
        )[..., None]
        glow = 0.6 * np.exp(-apart / 0.25) + 3.0 * np.exp(-apart / 0.06)
        light = light + scene.sun_on_road * glow * np.array([0.75, 0.9, 1.0])
    return light.astype(np.float32)


def _land(scene: Scene, rng: np.random.Generator, light: Float, elevation: Float, haze: Float) -> None:
    columns = light.shape[1]
    snow = min(scene.verge_snow, 1.0)
    rows = elevation[:, None]
    if scene.hills > 0.05:
        outline = 0.08 * scene.hills * _ridge(rng, columns, 1.4)[None, :]
        base = np.array([0.14, 0.12, 0.09]) * scene.verge_tone * (1 - 0.7 * snow) + 0.45 * snow
        far = 0.35 * base + 0.65 * haze
        light[rows < outline] = far.astype(np.float32)
    if scene.tree_line > 0.0:
        tall = scene.tree_line * 0.14
        outline = (
            tall
            * (0.4 + 0.6 * _ridge(rng, columns, 0.75))
            * np.clip(_ridge(rng, columns, 1.2) * 2.2, 0.15, 1)
        )
        middle = np.abs(np.linspace(-1, 1, columns))
        outline = outline * np.clip(0.15 + 2.5 * middle, 0, 1)
        inside = rows < outline[None, :]
        leaf = cv2.resize(
            rng.random((light.shape[0] // 3 + 1, columns // 3 + 1), dtype=np.float32),
            (columns, light.shape[0]),
        )
        trunk = cv2.resize(rng.random((2, columns // 2), dtype=np.float32), (columns, light.shape[0]))
        texture = 0.35 + 0.9 * leaf * (0.5 + 0.5 * trunk)
        green = {
            "grass": (0.035, 0.075, 0.05),
            "dry_grass": (0.04, 0.075, 0.08),
            "soil": (0.045, 0.06, 0.065),
            "gravel": (0.05, 0.06, 0.06),
        }[scene.verge]
        colour = texture[..., None] * np.array(green, dtype=np.float32) * scene.verge_tone
        white = np.clip(leaf * 2.2 - 1.35 + 0.5 * snow, 0, 1)[..., None] * snow * 0.55
        colour = colour * (1 - white) + white * np.array([0.8, 0.76, 0.72], dtype=np.float32)
        share = 1.0 - np.exp(-120.0 / scene.visibility_m)
        light[inside] = (colour * (1 - share) + haze * share)[inside]
    light[elevation < 0] = light[np.searchsorted(elevation, 0.0)] * 0.8


def _houses(scene: Scene, light: Float, elevation: Float, azimuth: Float) -> None:
    """Draw a row of houses along each side into `light`."""
    for side, rise in zip((1.0, -1.0), scene.house_rise, strict=True):
        if rise == 0.0:
            continue
        rng = np.random.default_rng([scene.seed, 29, int(side > 0.0)])
        aside = np.maximum(np.sin(side * azimuth), 0.0)
        along = np.cos(azimuth) / np.maximum(aside, 1e-3)  # of each column's wall, over its distance aside
        house = np.minimum(along / HOUSE_LENGTH, HOUSES - 1).astype(int)
        roof = np.arctan(rise * rng.uniform(*ROOFS, HOUSES)[house] * aside)
        facade = rng.uniform(*FACADES, HOUSES)[house] * rng.uniform(scene.ground_light, 1.0)
        tint = rng.uniform(*FACADE_TINTS, (HOUSES, 3))[house]
        storey = np.tan(elevation)[:, None] / np.maximum(rise * aside, 1e-3) * STOREYS % 1.0
        window = (abs(storey - 0.5) < 0.25) & (along * WINDOWS % 1.0 < 0.5)
        wall = facade[:, None] * tint * np.where(window, GLASS, 1.0)[..., None]
        inside = (elevation[:, None] > 0.0) & (elevation[:, None] < roof)
        light[inside] = wall[inside]
