"""Real roads by day as they would look by night: dim sky, head lights, street lamps and, on wet roads, their mirrors.

Lamps shine on dry asphalt too, and nearly every dry picture that we have is taken by day: a network learns that light
spots on a dark road are water. Shown dry, wet and snowy roads under the same lamps it is left nothing but the road.
"""

from __future__ import annotations

import cv2
import numpy as np

from trpac_core.vision.classes import Surface

from .data import Image, family_of
from .weathered import REDUCED, Light, Range, bytes_of, light_of, mirror_of

SHOWN = "night/"
"""What the origin of a picture shown by night begins with."""

DAY_QUANTILE, DAY_LEVEL, DIMMEST = 0.9, 0.5, 0.05
"""The picture's light is brought to a level at a quantile, and its gain there is limited: albedo, roughly [-]."""
COLOURS: Range = (0.2, 1.0)
"""Share of the colours that is left in dim light [-]."""
AMBIENT: Range = (0.002, 0.05)
"""Light of sky and town, as a share of the day's, log-uniform [-]."""
AMBIENT_TINT = 0.3
"""Most that its blue or red is beyond its green [-]."""
HORIZONS: Range = (0.42, 0.55)
"""Row of the horizon over the picture's height, where no camera is known [-]."""

BEAM: Range = (0.03, 0.5)
"""Light of the car's own lamps on the road, as a share of the day's [-]."""
BEAM_CENTRE, BEAM_WIDTH = (0.42, 0.58), (0.2, 0.5)
"""Its middle column and half its width over the picture's width [-]."""
BEAM_ROW, BEAM_REACH = (0.15, 0.5), (0.16, 0.7)
"""Where it is brightest between horizon (0) and lower edge (1), and how far it falls by 1 / e from there [-]."""
POOLS, POOL_GRID, POOL_LEVEL = (0.0, 0.25), (2, 6), 0.4
"""Light under street lamps, as a share of the day's; most lamps to a side; level above which the field is lit [-]."""

LAMPS = (2, 22)
"""Lamps in view: street lamps, windows, head lights, rear lights, signals."""
LAMP_COLOURS = np.array(
    [
        (0.35, 0.65, 1.0),
        (0.6, 0.85, 1.0),
        (1.0, 1.0, 1.0),
        (0.1, 0.1, 1.0),
        (0.3, 0.9, 0.2),
        (0.9, 0.95, 1.0),
    ],
    np.float32,
)
"""BGR: sodium, warm white, white, rear light, green light, cold white."""
LIGHTING = 3
"""The first colours light the road."""
LAMP_SIZE, LAMP_LIGHT = (0.002, 0.012), (0.5, 6.0)
"""Radius over the picture's width and light over white, both log-uniform [-]."""
LAMP_HEIGHT, LAMP_BELOW = 0.12, (-0.01, 0.04)
"""Deviation of its height above the horizon, and how far it may stand below it, over the picture's height [-]."""
HALOS, FAINT_HALO = (0.008, 0.03), (0.0, 1.0)
"""Deviation of the near and the far halo over the picture's width, and how bright the far one is [-]."""

MIRRORS: dict[Surface, tuple[Range, Range]] = {
    Surface.WET: ((0.03, 0.2), (0.25, 1.2)),
    Surface.DRY: ((0.1, 0.35), (0.0, 0.12)),
}
"""Blur along the look over the picture's height, and share of light that a road sends back like a mirror [-]: worn dry
asphalt shines a little at a flat look, snow does not."""
STREAK = 0.1
"""The blur's width across the look, as a share of that along it: lamps become long streaks [-]."""
WET_KEEPS: Range = (0.1, 0.5)
"""Share of the lamps' light that a wet road scatters back to the camera, next to a dry one [-]."""

WARMTH: Range = (1.0, 2.2)
"""Red of all light over its blue, log-uniform: light of 2700 K has four times the red over blue of daylight (Planck),
of which a camera's white balance leaves the half or so on a logarithmic scale [-]."""
EXPOSURE, VEIL = (0.7, 3.0), (0.0, 0.004)
"""The camera's gain, log-uniform, and light scattered by lens and windscreen, over white [-]."""
SHOT_NOISE, READ_NOISE = (0.0, 4e-4), (1e-6, 4e-5)
"""Variance of the noise over light, and that without light, of white squared [-]."""
BLURRED_SHARE, BLUR_PX = 0.4, (0.4, 1.4)
"""Share of pictures out of focus or moved, and by how much [px]."""


def shown_family(source: str) -> str:
    """Family of an origin, whether the picture is shown by night or as it is."""
    return family_of(source.removeprefix(SHOWN))


def darkened(rng: np.random.Generator, image: Image, road: Light, surface: Surface) -> Image:
    """A picture by day as it would look by night, between lamps.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws lamps, light and camera.
    image : Image
        The picture, BGR.
    road : array, shape (height, width)
        Share of road in each pixel [-].
    surface : Surface
        Of the road: a wet one mirrors the lamps and scatters less of their light.
    """
    height, width = image.shape[:2]
    on_road = road[..., None]
    horizon = rng.uniform(*HORIZONS) * height
    below = np.maximum(np.arange(height, dtype=np.float32) - np.float32(horizon), 0.0) / (height - horizon)
    light = _albedo(rng, image) * (_ambient(rng) + _pools(rng, height, width) + _beam(rng, below, width))
    if surface == Surface.WET:
        light *= 1.0 - on_road * (1.0 - rng.uniform(*WET_KEEPS))
    lamps = _lamps(rng, horizon, height, width)
    if surface in MIRRORS:
        blurs, gains = MIRRORS[surface]
        above = lamps + light * (below == 0.0)[:, None, None]
        mirrored = mirror_of(above, horizon, rng.uniform(*blurs), STREAK)
        light += on_road * rng.uniform(*gains) * np.clip(1.0 - below, 0.1, 1.0)[:, None, None] * mirrored
    light += lamps * (1.0 - on_road * (below > 0.0)[:, None, None])
    return bytes_of(_taken(rng, light))


def _albedo(rng: np.random.Generator, image: Image) -> Light:
    light = light_of(image)
    light *= np.float32(DAY_LEVEL / max(float(np.quantile(light, DAY_QUANTILE)), DIMMEST))
    grey = light.mean(axis=2, keepdims=True)
    return grey + np.float32(rng.uniform(*COLOURS)) * (light - grey)


def _ambient(rng: np.random.Generator) -> Light:
    """Light of the sky, shape (3,)."""
    blue, red = 1.0 + rng.uniform(-AMBIENT_TINT, AMBIENT_TINT, 2)
    return (_log_uniform(rng, AMBIENT) * np.array([blue, 1.0, red])).astype(np.float32)


def _pools(rng: np.random.Generator, height: int, width: int) -> Light:
    """Light of street lamps on the ground, shape (height, width, 3)."""
    grid = rng.random(rng.integers(*POOL_GRID, 2)).astype(np.float32)
    field_ = cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC)
    pools = np.clip(field_ - POOL_LEVEL, 0.0, None) * np.float32(rng.uniform(*POOLS))
    return pools[..., None] * LAMP_COLOURS[rng.integers(LIGHTING)]


def _beam(rng: np.random.Generator, below: Light, width: int) -> Light:
    """Light of the car's own lamps below the horizon, shape (height, width, 1)."""
    across = (np.arange(width) / width - rng.uniform(*BEAM_CENTRE)) / rng.uniform(*BEAM_WIDTH)
    along = np.abs(below - rng.uniform(*BEAM_ROW)) / rng.uniform(*BEAM_REACH)
    beam = np.exp(-(across**2)) * (np.exp(-along) * (below > 0.0))[:, None]
    return (rng.uniform(*BEAM) * beam).astype(np.float32)[..., None]


def _lamps(rng: np.random.Generator, horizon: float, height: int, width: int) -> Light:
    """Lamps and their halos, shape (height, width, 3)."""
    lamps = np.zeros((height, width, 3), np.float32)
    for _ in range(rng.integers(*LAMPS)):
        row = horizon - abs(rng.normal(0.0, LAMP_HEIGHT)) * height + rng.uniform(*LAMP_BELOW) * height
        radius = max(1, round(_log_uniform(rng, LAMP_SIZE) * width))
        colour = LAMP_COLOURS[rng.integers(len(LAMP_COLOURS))] * _log_uniform(rng, LAMP_LIGHT)
        cv2.circle(lamps, (int(rng.uniform(0, width)), int(row)), radius, colour.tolist(), -1)
    small = cv2.resize(lamps, None, fx=1.0 / REDUCED, fy=1.0 / REDUCED, interpolation=cv2.INTER_AREA)
    near, far = (cv2.GaussianBlur(small, (0, 0), size * width / REDUCED) for size in HALOS)
    halo = near + np.float32(rng.uniform(*FAINT_HALO)) * far
    return lamps + cv2.resize(halo, (width, height), interpolation=cv2.INTER_LINEAR)


def _taken(rng: np.random.Generator, light: Light) -> Light:
    """What a camera makes of light: gain, white balance, veil, noise, blur."""
    warm = np.sqrt(_log_uniform(rng, WARMTH))
    gains = _log_uniform(rng, EXPOSURE) * np.array([1.0 / warm, 1.0, warm])
    light = light * gains.astype(np.float32) + np.float32(rng.uniform(*VEIL))
    variance = np.clip(light, 0.0, 1.0) * rng.uniform(*SHOT_NOISE) + rng.uniform(*READ_NOISE)
    light = light + rng.standard_normal(light.shape, np.float32) * np.sqrt(variance.astype(np.float32))
    if rng.random() < BLURRED_SHARE:
        light = cv2.GaussianBlur(light, (0, 0), rng.uniform(*BLUR_PX))
    return np.asarray(light, np.float32)


def _log_uniform(rng: np.random.Generator, limits: Range) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))
