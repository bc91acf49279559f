"""Real dry roads as they would look wet or under snow: the same street, by the same camera.

Nearly every picture of a dash camera that we have is dry, so a network learns that dash cameras see dry roads. Shown
the same street in all three classes it is left nothing but the road to tell them by.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.camera.disturbances import DISPLAY_GAMMA
from scenarios.camera.renderer import fresnel_reflectance
from trpac_core.vision.classes import Surface

from .data import Image, Picture, pixel_box

Light = NDArray[np.float32]
Range = tuple[float, float]

DARKENING: Range = (0.35, 0.8)
"""Share of its light that a wet road still scatters [-]."""
DEEPENING: Range = (1.0, 1.5)
"""Power of the light that it scatters: water makes what is dark darker still [-]."""
SUNK = 0.4
"""Share of the scattered light that a puddle takes besides [-]."""
FILM, PUDDLES = (0.1, 1.0), (0.0, 0.45)
"""Share of the mirrored light that a rough wet road sends to the camera; share of the road under standing water [-]."""
SKY_GAIN: Range = (1.0, 2.5)
"""How much brighter than white an overexposed sky is [-]."""
BLURS: tuple[Range, Range] = ((0.02, 0.12), (0.004, 0.02))
"""Vertical blur of the film's and of the puddles' mirror, as a share of the picture's height [-]."""
GLINTS: Range = (0.0, 2.0)
"""Power of the road's own grain with which wet stones mirror more or less than the film around them [-]."""
SQUEEZE = 0.25
"""That blur's width across the look, as a share of that along it [-]."""
GREYING, WET_EXPOSURE = (0.0, 0.6), (0.8, 1.5)
"""How far the picture's colours are lost under a rain sky; the camera's exposure there [-]."""

COVER: Range = (0.85, 1.0)
"""Share of a snowy road that snow covers [-]."""
SNOW_ALBEDO, SNOW_EXPOSURE = (0.35, 0.95), (0.5, 1.1)
"""Light that snow sends back, of dirty and of fresh; the camera's exposure there [-]."""
LUMPS, RELIEF = (0.0, 0.4), (0.0, 0.8)
"""Unevenness of its brightness, in lumps, and the power of the road's own grain that is left of it [-]."""
TINT: Range = (-0.06, 0.1)
"""Its blue over its red [-]."""
SHADE_BLUR, SHADE_POWER = (0.005, 0.05), (0.5, 1.0)
"""Blur, as a share of the picture's height, and power that leave light and shadow of the road's brightness [-]."""

TEXELS, TEXEL_M = 256, 0.12
"""Side of the maps of water and snow, and length of a texel [m]."""
ACROSS, ALONG, EDGE = (0.7, 6.0), (1.5, 15.0), (0.2, 1.0)
"""Size of their patches across and along the road [texel], and softness of their edges in deviations [-]."""
GRAIN_PX, GRAIN = 3.0, (0.5, 2.0)
"""Blur without which the road's grain is left [px], and its limits [-]. Nothing is sown that the picture has not got: a
noise of our own would be learned as the mark of water and snow."""
REDUCED = 4
"""Mirrors and halos are computed in a picture this much smaller: they are blurred anyway."""


@dataclass(frozen=True)
class Standpoint:
    """How a camera looks at the road: its horizon's row, its focal length and its height."""

    horizon_px: float
    focal_px: float
    height_m: float = 1.3


STANDPOINTS: dict[str, tuple[float, float]] = {
    "drivable_camvid": (170 / 360, 423 / 480),
    "drivable_lums": (190 / 480, 549 / 480),
    "dry_udacity": (0.56, 0.9),
    "seq_dry_yolop": (122 / 240, 234 / 320),
}
"""Horizon as a share of the height and focal length as a share of the width, per family of dash cameras, read off the
pictures. The clips with text and paths drawn on the road are left as they are, and so are web stills, of which there
are enough of each class."""


@dataclass(frozen=True)
class Weathered(Picture):
    """A dry picture shown with another class; the drawing depends on `seed`."""

    seed: tuple[int, ...] = ()

    @property
    def origin(self) -> str:
        """See `Picture.origin`."""
        return f"weathered/{self.source}"

    def image(self) -> Image:
        """The picture with its road wet or under snow."""
        image = super().image()
        height, width = image.shape[:2]
        horizon, focal = STANDPOINTS[self.family]
        shown = {Surface.WET: wetted, Surface.SNOW_ICE: snowed}[self.surface]
        road = cv2.GaussianBlur(self._road(image), (0, 0), 1.5)
        seen = Standpoint(horizon * height, focal * width)
        return shown(np.random.default_rng(self.seed), image, np.asarray(road, np.float32), seen)

    def _road(self, image: Image) -> Light:
        """Where road is known to be: by the mask, else all of the box that patches are cut from."""
        if self.mask is not None:
            return (self.road_mask() == 1).astype(np.float32)
        road = np.zeros(image.shape[:2], np.float32)
        for box in (*self.boxes, *filter(None, [self.wide_box])):
            left, top, right, bottom = pixel_box(box, image)
            road[top:bottom, left:right] = 1.0
        return road


def weathered(pictures: Iterable[Picture], seed: int) -> list[Picture]:
    """The dry pictures among these whose standpoint is known, each wet and each under snow."""
    dry = [p for p in pictures if p.surface == Surface.DRY and p.family in STANDPOINTS]
    return [
        Weathered(**{**vars(picture), "surface": surface}, seed=(seed, number, int(surface)))
        for number, picture in enumerate(dry)
        for surface in (Surface.WET, Surface.SNOW_ICE)
    ]


def wetted(rng: np.random.Generator, image: Image, road: Light, seen: Standpoint) -> Image:
    """A picture of a dry road as it would look after rain: darker, with what stands above the horizon mirrored in it.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws how wet, how rough and how lit.
    image : Image
        The picture, BGR.
    road : array, shape (height, width)
        Share of road in each pixel [-].
    seen : Standpoint
        The camera's.
    """
    light = light_of(image)
    shine = _shine(_below_px(image, seen) / np.float32(seen.focal_px))[:, None, None]
    water = _on_ground(rng, image, seen, rng.uniform(*PUDDLES))
    film, sharp = (mirror_of(light, seen.horizon_px, rng.uniform(*blur)) for blur in BLURS)
    film = rng.uniform(*FILM) * _grain(light) ** np.float32(rng.uniform(*GLINTS)) * film
    mirrored = (water * sharp + (1.0 - water) * film) * rng.uniform(*SKY_GAIN)
    scattered = rng.uniform(*DARKENING) * (1.0 - SUNK * water) * light ** np.float32(rng.uniform(*DEEPENING))
    light = light + road[..., None] * ((1.0 - shine) * scattered + shine * mirrored - light)
    grey = light.mean(axis=2, keepdims=True)
    return bytes_of((light + rng.uniform(*GREYING) * (grey - light)) * rng.uniform(*WET_EXPOSURE))


def snowed(rng: np.random.Generator, image: Image, road: Light, seen: Standpoint) -> Image:
    """A picture of a dry road as it would look under packed snow, in the same light; parameters as of `wetted`."""
    light = light_of(image)
    cover = _on_ground(rng, image, seen, rng.uniform(*COVER))
    lumps = _on_ground(rng, image, seen, 0.5) - np.float32(0.5)
    uneven = (1.0 + rng.uniform(*LUMPS) * lumps) * _grain(light) ** np.float32(rng.uniform(*RELIEF))
    tint = 1.0 + rng.uniform(*TINT) * np.array([1.0, 0.0, -1.0], np.float32)
    snow = rng.uniform(*SNOW_ALBEDO) * _shade(rng, light, road)[..., None] * uneven * tint
    light = light + road[..., None] * cover * (snow - light)
    return bytes_of(light * rng.uniform(*SNOW_EXPOSURE))


def light_of(image: Image) -> Light:
    """Linear light of a picture, 1 at white [-]."""
    return ((np.arange(256, dtype=np.float32) / 255.0) ** np.float32(DISPLAY_GAMMA))[image]


def bytes_of(light: Light) -> Image:
    """A picture of linear light; what is brighter than white is white."""
    return (255.0 * np.clip(light, 0.0, 1.0) ** np.float32(1.0 / DISPLAY_GAMMA) + 0.5).astype(np.uint8)


def _below_px(image: Image, seen: Standpoint) -> Light:
    """How far each row lies below the horizon, at least 1 [px]."""
    return np.maximum(np.arange(len(image), dtype=np.float32) - np.float32(seen.horizon_px), 1.0)


def _shine(slope: Light) -> Light:
    """Share of light that water mirrors where the look falls by a slope."""
    return fresnel_reflectance(slope / np.sqrt(1.0 + slope * slope)).astype(np.float32)


def mirror_of(light: Light, horizon_px: float, blur: float, squeeze: float = SQUEEZE) -> Light:
    """The picture upside down about its horizon, blurred mostly along the look."""
    height, width = light.shape[:2]
    rows = np.clip(np.round(2.0 * horizon_px - np.arange(height)), 0, height - 1).astype(int)
    small = cv2.resize(light[rows], None, fx=1.0 / REDUCED, fy=1.0 / REDUCED, interpolation=cv2.INTER_AREA)
    sigma = max(blur * height / REDUCED, 0.3)
    soft = cv2.GaussianBlur(small, (0, 0), sigmaX=max(squeeze * sigma, 0.3), sigmaY=sigma)
    return np.asarray(cv2.resize(soft, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _grain(light: Light) -> Light:
    """The picture's finest structure, 1 on the average, shape (height, width, 1)."""
    grey = light.mean(axis=2) + np.float32(1e-3)
    return np.clip(grey / cv2.GaussianBlur(grey, (0, 0), GRAIN_PX), *GRAIN).astype(np.float32)[..., None]


def _shade(rng: np.random.Generator, light: Light, road: Light) -> Light:
    """Light and shadow on the road, 1 where it is lit, shape (height, width)."""
    soft = cv2.GaussianBlur(light.mean(axis=2), (0, 0), rng.uniform(*SHADE_BLUR) * len(light))
    on_road = soft[road > 0.5]
    lit = float(np.quantile(on_road, 0.9)) if len(on_road) else 1.0
    return np.clip(soft / max(lit, 1e-3), 0.0, 1.3) ** np.float32(rng.uniform(*SHADE_POWER))


def _on_ground(rng: np.random.Generator, image: Image, seen: Standpoint, share: float) -> Light:
    """Patches that cover a share of the ground, as each pixel shows them, 0 to 1, shape (height, width, 1)."""
    noise = rng.standard_normal((TEXELS, TEXELS)).astype(np.float32)
    across, along = (float(np.exp(rng.uniform(*np.log(size)))) for size in (ACROSS, ALONG))
    field = cv2.GaussianBlur(noise, (0, 0), sigmaX=across, sigmaY=along, borderType=cv2.BORDER_REFLECT)
    level, soft = np.quantile(field, 1.0 - share), rng.uniform(*EDGE) * (field.std() + 1e-6)
    field = np.clip((field - level) / soft + 0.5, 0.0, 1.0).astype(np.float32)
    width = image.shape[1]
    ahead_m = np.float32(seen.focal_px * seen.height_m) / _below_px(image, seen)
    aside = (np.arange(width, dtype=np.float32) - np.float32(width / 2.0)) / np.float32(seen.focal_px)
    columns = np.mod(aside * ahead_m[:, None] / np.float32(TEXEL_M) + np.float32(TEXELS / 2), TEXELS)
    rows = np.repeat(np.mod(ahead_m / np.float32(TEXEL_M), TEXELS)[:, None], width, axis=1)
    shown = cv2.remap(field, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return np.asarray(shown, np.float32)[..., None]
