"""The description of a rendered road: surfaces along it, and markings, verge, weather and camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.classes import Surface

Sky = Literal["clear", "broken", "overcast", "low_sun"]
Verge = Literal["grass", "dry_grass", "soil", "gravel"]
CentreLine = Literal["none", "dashed", "solid", "double"]
HOUSE_RISE = (0.4, 2.0)
"""Height of a row of houses over its distance from the road's middle [-]."""


@dataclass(frozen=True)
class SurfaceSegment:
    """A surface from ``start_m`` [m, road coordinate] to the next segment's start."""

    start_m: float
    surface: Surface


@dataclass(frozen=True)
class RenderedFrame:
    """A picture and its exact labels, all of one height and width.

    ``image`` is BGR uint8 (H, W, 3); ``drivable`` and ``shadow`` (shadow on the road only) are bool (H, W);
    ``surface`` is int8 (H, W), the class index on the road and -1 elsewhere.
    """

    image: NDArray[np.uint8]
    drivable: NDArray[np.bool_]
    shadow: NDArray[np.bool_]
    surface: NDArray[np.int8]


@dataclass(frozen=True)
class Scene:
    """All parameters of a rendered world except camera geometry and surface classes.

    The road coordinate's lateral zero is the middle of the own lane, left positive. Shares and strengths lie in
    0..1 where no unit is given; ``white_balance`` is (blue, green, red) gains. The defaults are a plain two-lane
    road under a clear sky.
    """

    seed: int = 0
    # road and markings
    lanes: int = 2
    own_lane: int = 0  # counted from the right
    lane_width_m: float = 3.5
    shoulder_m: float = 0.4
    centre_line: CentreLine = "dashed"
    edge_lines: bool = True
    yellow_lines: bool = False
    marking_wear: float = 0.3
    marking_width_m: float = 0.14
    # asphalt
    asphalt_albedo: float = 0.13
    asphalt_warmth: float = 0.0  # -1 bluish .. 1 brownish
    grain: float = 0.35
    stains: float = 0.3
    wheel_band: float = -0.1  # relative tone of the wheel paths
    oil_band: float = 0.05  # darkening between them
    cracks: float = 0.3
    patches_per_100_m: float = 2.0
    # water
    wet_darkening: float = 0.5
    water_film: float = 0.6
    puddles: float = 0.3
    # snow and ice
    snow_cover: float = 0.85
    snow_albedo: float = 0.75
    snow_blue: float = 0.3
    snow_dirt: float = 0.1
    snow_relief: float = 0.35
    track_clearing: float = 0.3  # cover lost in the wheel tracks
    ice_gloss: float = 0.15
    # beside the road
    verge: Verge = "grass"
    verge_tone: float = 1.0
    verge_snow: float = 0.0  # also beside dry and wet road
    tree_line: float = 0.5
    hills: float = 0.3
    # light
    sky: Sky = "clear"
    cloud_tone: float = 1.0
    sun_azimuth_rad: float = 1.0  # from straight ahead, left positive
    sun_elevation_rad: float = 0.7
    sun_share: float = 0.8  # of the light on open ground that comes from the sun itself
    visibility_m: float = 2000.0
    trees_per_100_m: float = 6.0
    poles_per_100_m: float = 2.0
    walls_per_100_m: float = 0.3
    bridges_per_100_m: float = 0.1
    house_rise: tuple[float, float] = (0.0, 0.0)  # left, right: height of a row over its distance aside
    open_shade: bool = False  # houses keep the sun from the road and beside it: the sky alone lights them
    # camera
    exposure_ev: float = 0.0
    auto_exposure: float = 0.7  # share of a surface's brightness that the camera evens out
    contrast: float = 1.0
    veil: float = 0.0  # stray light
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def road_edges_m(self) -> tuple[float, float]:
        """Right and left end of the paved, drivable surface [m, lateral road coordinate]."""
        right = -(self.own_lane + 0.5) * self.lane_width_m - self.shoulder_m
        left = (self.lanes - self.own_lane - 0.5) * self.lane_width_m + self.shoulder_m
        return right, left

    @property
    def casts_shadows(self) -> bool:
        """Whether the sun is strong enough for visible, and so labelled, shadows."""
        return self.sun_on_road > 0.25

    @property
    def sun_on_road(self) -> float:
        """Direct sunlight on the road, over the light on open ground [-]."""
        return 0.0 if self.open_shade else self.sun_share

    @property
    def ground_light(self) -> float:
        """Light on the road outside of cast shadows, over that on open ground [-]."""
        return 1.0 - self.sun_share if self.open_shade else 1.0

    def in_a_street(self, rng: np.random.Generator) -> Scene:
        """The same scene in the open shade of random houses on one side or on both."""
        left, right = rng.uniform(*HOUSE_RISE, 2) * rng.permutation([1.0, rng.choice([0.0, 1.0])])
        return replace(self, open_shade=True, house_rise=(float(left), float(right)))

    @classmethod
    def random(cls, rng: np.random.Generator, surface: Surface | None = None) -> Scene:
        """A random scene; weather is drawn as likely for ``surface``."""
        kind = Surface(int(rng.integers(3))) if surface is None else surface
        return cls(
            seed=int(rng.integers(2**31)),
            **_random_road(rng),
            **_random_surfaces(rng),
            **_random_surroundings(rng, kind),
            **_random_light(rng, kind),
        )


def _random_road(rng: np.random.Generator) -> dict:
    lanes = int(rng.choice([1, 2, 3, 4], p=[0.1, 0.55, 0.2, 0.15]))
    return {
        "lanes": lanes,
        "own_lane": int(rng.integers(lanes)),
        "lane_width_m": rng.uniform(2.8, 3.9),
        "shoulder_m": rng.choice([0.15, 0.4, 1.5, 2.5]) * rng.uniform(0.8, 1.2),
        "centre_line": str(rng.choice(["none", "dashed", "solid", "double"], p=[0.2, 0.45, 0.15, 0.2])),
        "edge_lines": bool(rng.random() < 0.7),
        "yellow_lines": bool(rng.random() < 0.3),
        "marking_wear": rng.beta(1.2, 1.5),
        "marking_width_m": rng.uniform(0.09, 0.2),
        "patches_per_100_m": rng.choice([0.0, rng.uniform(0, 5), rng.uniform(0, 15)]),
    }


def _random_surfaces(rng: np.random.Generator) -> dict:
    return {
        "asphalt_albedo": float(np.exp(rng.uniform(np.log(0.05), np.log(0.30)))),
        "asphalt_warmth": float(np.clip(rng.normal(0.1, 0.4), -1, 1)),
        "grain": rng.uniform(0.15, 0.9),
        "stains": rng.uniform(0.1, 0.8),
        "wheel_band": rng.normal(-0.03, 0.12),
        "oil_band": rng.uniform(0.0, 0.25),
        "cracks": rng.beta(0.7, 1.2),
        "wet_darkening": rng.uniform(0.38, 0.72),
        "water_film": rng.uniform(0.25, 1.0),
        "puddles": float(rng.choice([0.0, rng.uniform(0, 0.5), rng.uniform(0, 1)])),
        "snow_cover": rng.uniform(0.6, 1.2),
        "snow_albedo": rng.uniform(0.42, 0.9),
        "snow_blue": rng.uniform(-0.1, 0.7),
        "snow_dirt": rng.beta(0.8, 2.5),
        "snow_relief": rng.uniform(0.1, 0.9),
        "track_clearing": rng.choice([0.0, rng.uniform(0, 0.3), rng.uniform(0.2, 0.5)]),
        "ice_gloss": rng.choice([0.0, rng.uniform(0, 0.5)]),
    }


def _random_surroundings(rng: np.random.Generator, kind: Surface) -> dict:
    snowy = kind is Surface.SNOW_ICE or rng.random() < 0.06
    return {
        "verge": str(rng.choice(["grass", "dry_grass", "soil", "gravel"], p=[0.45, 0.25, 0.15, 0.15])),
        "verge_tone": rng.uniform(0.5, 1.5),
        "verge_snow": rng.uniform(0.6, 1.2) if snowy else 0.0,
        "tree_line": rng.choice([0.05, rng.uniform(0.1, 1.0)], p=[0.2, 0.8]),
        "hills": rng.uniform(0.0, 1.0),
        "trees_per_100_m": rng.choice([0.0, rng.uniform(0, 25)], p=[0.2, 0.8]),
        "poles_per_100_m": rng.choice([0.0, rng.uniform(1, 6)]),
        "walls_per_100_m": rng.choice([0.0, rng.uniform(0.2, 3)], p=[0.6, 0.4]),
        "bridges_per_100_m": rng.choice([0.0, rng.uniform(0.2, 1.2)], p=[0.6, 0.4]),
    }


_SKY_ODDS = {
    Surface.DRY: [0.40, 0.25, 0.2, 0.15],
    Surface.WET: [0.08, 0.2, 0.62, 0.1],
    Surface.SNOW_ICE: [0.3, 0.2, 0.4, 0.1],
}


def _random_light(rng: np.random.Generator, kind: Surface) -> dict:
    sky = str(rng.choice(["clear", "broken", "overcast", "low_sun"], p=_SKY_ODDS[kind]))
    elevation = rng.uniform(0.06, 0.25) if sky == "low_sun" else rng.uniform(0.3, 1.2)
    share = {
        "clear": rng.uniform(0.65, 0.88),
        "broken": rng.uniform(0.3, 0.8),
        "overcast": 0.0,
        "low_sun": rng.uniform(0.3, 0.75),
    }[sky]
    near, far = (150.0, 1500.0) if kind is Surface.WET else (400.0, 6000.0)
    cast = rng.normal(0.0, 0.07)
    return {
        "sky": sky,
        "cloud_tone": rng.uniform(0.45, 1.2),
        "sun_azimuth_rad": rng.uniform(-np.pi, np.pi),
        "sun_elevation_rad": elevation,
        "sun_share": share,
        "visibility_m": float(np.exp(rng.uniform(np.log(near), np.log(far)))),
        "exposure_ev": rng.normal(-0.1 if kind is not Surface.WET else -0.4, 0.6),
        "auto_exposure": rng.uniform(0.45, 0.95),
        "contrast": rng.uniform(0.85, 1.25),
        "veil": rng.choice([0.0, rng.uniform(0, 0.06)]),
        "white_balance": (float(np.exp(cast)), float(np.exp(rng.normal(0, 0.03))), float(np.exp(-cast))),
    }
