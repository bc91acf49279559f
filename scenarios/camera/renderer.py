"""Renders the road ahead through the camera geometry, with exact labels for every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface

from .decals import LENGTH_M, LEVELS, SHAPE, TEXEL_M, decal_map
from .scene import RenderedFrame, Scene, SurfaceSegment
from .shading import TONE_RANGE, TONE_STEPS_PER_UNIT, CarPose, Maps, Pixels, SceneScalars, shade
from .sky import AZIMUTH_RAD, LOWEST_RAD, Panorama, build_panorama
from .textures import (
    FINE_LEVELS,
    FINE_SHAPE,
    FINE_TEXEL_M,
    MACRO_LEVELS,
    MACRO_SHAPE,
    MACRO_TEXEL_M,
    fine_texture,
    macro_texture,
)

PROFILE_STEP_M = 0.02
"""Step of the lateral profile of wheel tracks [m]."""
MARKING_REPEAT_M = 144.0
"""A multiple of every period of dashed markings [m]."""
WATER_INDEX = 1.33
"""Refractive index of water [-]."""
FINEST_SKY_PIXEL_RAD = 0.0009
"""Least pixel of the panorama [rad]."""
METERED_M = (3.0, 30.0)
"""Begin and end of the road ahead that the automatic exposure meters [m]."""
SHARPNESS = 0.5
"""Levels by which textures are sampled finer than the pixel, as by a camera that sharpens its pictures [-]."""
VERGE_END_M = 130.0
"""Distance from which a line of trees hides the verge [m]."""
GREY = 0.20
"""Light that the automatic exposure maps to mid grey, relative to white open ground [-]."""

_VERGES = {
    "grass": ((0.035, 0.13, 0.085), 0.9),
    "dry_grass": ((0.11, 0.21, 0.26), 0.8),
    "soil": ((0.08, 0.12, 0.17), 0.6),
    "gravel": ((0.19, 0.21, 0.23), 0.7),
}


class Renderer:
    """A camera in one fixed world: a point of the road is the same in all pictures.

    Parameters
    ----------
    camera : Camera
        Geometry and size of the picture.
    segments : sequence of SurfaceSegment
        Ascending starts [m]; the first surface also holds before its start.
    scene : Scene
        Everything else; two renderers of one scene render the same world.

    Raises
    ------
    ValueError
        When there are no segments or their starts do not ascend.
    """

    def __init__(self, camera: Camera, segments: Sequence[SurfaceSegment], scene: Scene) -> None:
        starts = [segment.start_m for segment in segments]
        if not starts or any(b <= a for a, b in pairwise(starts)):
            raise ValueError(
                f"segments: starts {starts} m; expected at least one, each beyond the one before"
            )
        self.camera, self.segments, self.scene = camera, tuple(segments), scene
        self._build()

    def __reduce__(self) -> tuple:
        return Renderer, (self.camera, self.segments, self.scene)

    def _build(self) -> None:
        scene, camera = self.scene, self.camera
        self._pixels = _pixels(camera)
        sky = build_panorama(scene, max(FINEST_SKY_PIXEL_RAD, 1.0 / camera.fx_px))
        macro, fine, decal = macro_texture(), fine_texture(), decal_map(scene)
        distance = self._pixels.distance
        self._maps = Maps(
            macro=macro.texels,
            macro_at=macro.offsets,
            fine=fine.texels,
            fine_at=fine.offsets,
            decal=decal.texels,
            decal_at=decal.offsets,
            sharp=sky.sharp,
            rough=sky.rough,
            tone=_tone_table(scene.contrast),
            lines=_markings(scene),
            profile=_profile(scene),
            clear=np.exp(-np.maximum(distance, 0.0) / np.float32(scene.visibility_m)),
        )
        horizon = sky.sharp[int((0.05 - LOWEST_RAD) / sky.sharp_pixel_rad)].mean(axis=0)
        self._scalars = _scalars_of(scene, horizon, sky)
        self._sky_mean = float(sky.mean.mean())
        self._starts = np.array([segment.start_m for segment in self.segments])
        self._surfaces = np.array([int(segment.surface) for segment in self.segments], dtype=np.int8)
        self._origin = np.random.default_rng([scene.seed, 41]).uniform(0.0, 40.0, 4)

    def frame(
        self, front_axle_position_m: float, lateral_m: float = 0.0, heading_rad: float = 0.0
    ) -> RenderedFrame:
        """The picture and labels at one position on the road.

        Parameters
        ----------
        front_axle_position_m : float
            Road coordinate of the front axle's centre [m].
        lateral_m : float
            Its distance to the left of the own lane's middle [m].
        heading_rad : float
            Vehicle heading against the road, left positive [rad].
        """
        size = (self.camera.height_px, self.camera.width_px)
        image = np.empty((*size, 3), dtype=np.uint8)
        drivable, shadow = np.empty(size, dtype=np.bool_), np.empty(size, dtype=np.bool_)
        surface = np.empty(size, dtype=np.int8)
        starts = (self._starts - front_axle_position_m).astype(np.float32)
        pose = self._pose(front_axle_position_m, lateral_m, heading_rad)
        shade(
            self._pixels,
            self._maps,
            self._scalars,
            pose,
            starts,
            self._surfaces,
            image,
            drivable,
            shadow,
            surface,
        )
        return RenderedFrame(image, drivable, shadow, surface)

    def _pose(self, position_m: float, lateral_m: float, heading_rad: float) -> CarPose:
        macro_s, macro_t, fine_s, fine_t = self._origin
        gains = self._gains(position_m)
        values = CarPose(
            cos_heading=np.cos(heading_rad),
            sin_heading=np.sin(heading_rad),
            heading=heading_rad,
            t=lateral_m,
            macro_s=(position_m + macro_s) % (MACRO_SHAPE[0] * MACRO_TEXEL_M),
            macro_t=(lateral_m + macro_t) % (MACRO_SHAPE[1] * MACRO_TEXEL_M),
            fine_s=(position_m + fine_s) % (FINE_SHAPE[0] * FINE_TEXEL_M),
            fine_t=(lateral_m + fine_t) % (FINE_SHAPE[1] * FINE_TEXEL_M),
            decal_s=position_m % LENGTH_M,
            decal_t=lateral_m + SHAPE[1] * TEXEL_M / 2,
            lines_s=position_m % MARKING_REPEAT_M,
            gain_b=gains[0],
            gain_g=gains[1],
            gain_r=gains[2],
        )
        return CarPose(*(np.float32(value) for value in values))

    def surface_at(self, position_m: float) -> Surface:
        """Surface at a road coordinate [m]."""
        index = int(np.searchsorted(self._starts, position_m, side="right")) - 1
        return self.segments[max(index, 0)].surface

    def _gains(self, position_m: float) -> NDArray[np.float32]:
        """Exposure times white balance, in steps of the tone table per unit of light."""
        scene = self.scene
        brightness = {
            Surface.DRY: scene.asphalt_albedo,
            Surface.WET: 0.5 * scene.asphalt_albedo * scene.wet_darkening + 0.08,
            Surface.SNOW_ICE: scene.snow_albedo * (1 - 0.5 * scene.snow_dirt) * min(1.0, scene.snow_cover),
        }
        ahead = np.linspace(*METERED_M, 36) + position_m
        # the quadratic mean protects bright surfaces from clipping
        road = float(np.sqrt(np.mean([brightness[self.surface_at(ahead_m)] ** 2 for ahead_m in ahead])))
        metered = 0.6 * scene.ground_light * road + 0.4 * max(0.12, 0.5 * self._sky_mean)
        exposure = 2.0**scene.exposure_ev * (GREY / 0.25) * (0.25 / metered) ** scene.auto_exposure
        return (exposure * TONE_STEPS_PER_UNIT * np.array(scene.white_balance)).astype(np.float32)


def ground_beside(camera: Camera) -> NDArray[np.float32]:
    """Lateral position of each pixel's ground, left positive, shape (height, width) [m]; -1 above the horizon."""
    return _pixels(camera).y


@lru_cache(maxsize=3)
def _pixels(camera: Camera) -> Pixels:
    """Ground point, footprint on the ground and direction of each pixel of a camera."""
    height, width = camera.height_px, camera.width_px
    grid = (
        np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(np.float64)
    )
    ground = camera.image_to_ground(grid).reshape(height, width, 2)
    x, y = ground[..., 0], ground[..., 1]
    behind = (x < camera.x_from_front_axle_m) | (x > 5000.0)
    x[behind], y[behind] = np.nan, np.nan
    azimuth, elevation = _directions(camera, grid, (height, width))
    foot_x = np.maximum(np.abs(np.gradient(x, axis=0)), np.abs(np.gradient(x, axis=1)))
    foot_y = np.maximum(np.abs(np.gradient(y, axis=0)), np.abs(np.gradient(y, axis=1)))
    away = np.hypot(x - camera.position_m[0], y - camera.position_m[1])
    cosine = camera.height_m / np.hypot(away, camera.height_m)
    foot_x, foot_y = (np.maximum(np.nan_to_num(foot, nan=100.0), 1e-4) for foot in (foot_x, foot_y))

    def packed(array: NDArray[np.float64]) -> NDArray[np.float32]:
        return np.ascontiguousarray(np.nan_to_num(array, nan=-1.0), dtype=np.float32)

    return Pixels(
        x=packed(x),
        y=packed(y),
        foot_x=packed(foot_x),
        foot_y=packed(foot_y),
        levels=_levels(foot_x, foot_y),
        azimuth=packed(azimuth),
        elevation=packed(elevation),
        shine=packed(fresnel_reflectance(cosine)),
        distance=packed(away),
    )


def _levels(foot_x: NDArray[np.float64], foot_y: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Ripmap levels of each pixel for the three textures, dithered to avoid visible seams."""
    dither = np.random.default_rng(7).uniform(-0.35, 0.35, (2, *foot_x.shape))
    packed = np.zeros(foot_x.shape, dtype=np.uint32)
    along, across = np.log2(foot_x) + dither[0], np.log2(foot_y) + dither[1]
    textures = ((MACRO_TEXEL_M, MACRO_LEVELS), (FINE_TEXEL_M, FINE_LEVELS), (TEXEL_M, LEVELS))
    for k, (texel, counts) in enumerate(textures):
        for m, (logarithm, count) in enumerate(zip((along, across), counts, strict=True)):
            level = np.clip(np.round(logarithm - np.log2(texel) - SHARPNESS), 0, count - 1).astype(np.uint32)
            packed |= level << np.uint32(8 * k + 4 * m)
    return packed


def _directions(
    camera: Camera, grid: NDArray[np.float64], shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuth (left positive) and elevation of every pixel's ray against the level road [rad]."""
    undistorted = cv2.undistortPoints(grid.reshape(-1, 1, 2), camera.matrix, np.array(camera.distortion))
    rays = np.ones((len(grid), 3))
    rays[:, :2] = undistorted.reshape(-1, 2)
    rays = rays @ camera.rotation
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    elevation = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
    return azimuth.reshape(shape), elevation.reshape(shape)


def fresnel_reflectance(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fresnel reflectance of smooth water at the cosine of an angle of incidence, by Schlick (1994) [-]."""
    at_right_angle = ((WATER_INDEX - 1.0) / (WATER_INDEX + 1.0)) ** 2
    return at_right_angle + (1.0 - at_right_angle) * (1.0 - cosine) ** 5


def _tone_table(contrast: float) -> NDArray[np.uint8]:
    """Table from linear light to display bytes: sRGB curve, soft shoulder, contrast about mid grey."""
    light = np.arange(int(TONE_STEPS_PER_UNIT * TONE_RANGE)) / TONE_STEPS_PER_UNIT
    shoulder = np.where(light < 0.6, light, 0.6 + 0.4 * np.tanh((light - 0.6) / 0.4 * 0.8))
    display = np.where(shoulder < 0.0031308, 12.92 * shoulder, 1.055 * shoulder ** (1 / 2.4) - 0.055)
    display = 0.45 + contrast * (display - 0.45)
    return np.clip(255.0 * display + 0.5, 0, 255).astype(np.uint8)


def _markings(scene: Scene) -> NDArray[np.float32]:
    """Markings: lateral middle, width, period (0 is unbroken), painted length, phase [m]."""
    rng = np.random.default_rng([scene.seed, 31])
    right, left = scene.road_edges_m
    width = scene.marking_width_m
    dash = float(rng.choice([1.0, 3.0, 4.0, 6.0]))
    period = dash * float(rng.choice([2.0, 3.0, 4.0]))
    phase = rng.uniform(0, period)
    rows: list[tuple[float, float, float, float, float]] = []
    if scene.edge_lines:
        rows += [
            (right + scene.shoulder_m, width, 0.0, 0.0, 0.0),
            (left - scene.shoulder_m, width, 0.0, 0.0, 0.0),
        ]
    for boundary in range(1, scene.lanes):
        middle = right + scene.shoulder_m + boundary * scene.lane_width_m
        if scene.centre_line in ("dashed", "solid"):
            rows.append((middle, width, period if scene.centre_line == "dashed" else 0.0, dash, phase))
        elif scene.centre_line == "double":
            rows += [(middle + side * width, width, 0.0, 0.0, 0.0) for side in (-1, 1)]
    return np.array(rows, dtype=np.float32).reshape(-1, 5)


def _profile(scene: Scene) -> NDArray[np.float32]:
    """Wheel tracks and the oil band between them, 0..1, over the lateral coordinate from the right edge."""
    rng = np.random.default_rng([scene.seed, 37])
    right, left = scene.road_edges_m
    across = np.arange(right, left + 2 * PROFILE_STEP_M, PROFILE_STEP_M)
    track, oil = np.zeros_like(across), np.zeros_like(across)
    sharpness = rng.uniform(0.12, 0.32)
    for lane in range(scene.lanes):
        middle = (lane - scene.own_lane) * scene.lane_width_m + rng.normal(0.0, 0.15)
        for side in (-0.75, 0.75):
            flat = np.maximum(np.abs(across - middle - side) - 0.12, 0.0)
            track = np.maximum(track, np.exp(-0.5 * (flat / sharpness) ** 2))
        oil = np.maximum(oil, np.exp(-0.5 * ((across - middle) / 0.35) ** 2))
    return np.column_stack((track, oil)).astype(np.float32)


def _scalars_of(scene: Scene, horizon: NDArray[np.float32], sky: Panorama) -> SceneScalars:
    right, left = scene.road_edges_m
    warm = 0.12 * scene.asphalt_warmth
    asphalt = scene.asphalt_albedo * np.array([1 - warm, 1.0, 1 + warm])
    snow = scene.snow_albedo * np.array([1 + 0.12 * scene.snow_blue, 1.0, 1 - 0.12 * scene.snow_blue])
    paint = np.array([0.08, 0.4, 0.62]) if scene.yellow_lines else np.array([0.66, 0.68, 0.68])
    colour, verge_grain = _VERGES[scene.verge]
    verge = np.array(colour) * scene.verge_tone
    low = scene.sky == "low_sun"
    sun = scene.sun_on_road * (np.array([0.62, 0.85, 1.12]) if low else np.array([0.9, 1.0, 1.06]))
    fill_tint = np.array([1.22, 1.0, 0.86]) if scene.sky in ("clear", "low_sun") else np.ones(3)
    fill = (1.0 - scene.sun_share) * fill_tint

    def bgr(name: str, values: NDArray[np.floating]) -> dict[str, float]:
        return {f"{name}_{channel}": float(value) for channel, value in zip("bgr", values, strict=True)}

    values = SceneScalars(
        right=right,
        left=left,
        **bgr("asphalt", asphalt),
        grain=scene.grain,
        stains=scene.stains,
        wheel_band=scene.wheel_band,
        oil_band=scene.oil_band,
        cracks=scene.cracks,
        wet_darkening=scene.wet_darkening,
        water_film=scene.water_film,
        puddles=scene.puddles,
        cover=scene.snow_cover,
        **bgr("snow", snow),
        dirt=scene.snow_dirt,
        relief=scene.snow_relief,
        clearing=scene.track_clearing,
        ice_gloss=scene.ice_gloss,
        wear=scene.marking_wear,
        **bgr("paint", paint),
        **bgr("verge", verge),
        verge_grain=verge_grain,
        verge_snow=scene.verge_snow,
        verge_end=VERGE_END_M if scene.tree_line > 0.1 else 1e9,
        **bgr("sun", sun),
        **bgr("fill", fill),
        **bgr("haze", horizon),
        veil=scene.veil,
        reach=AZIMUTH_RAD,
        lowest=LOWEST_RAD,
        sharp_px=sky.sharp_pixel_rad,
        rough_px=sky.rough_pixel_rad,
    )
    return SceneScalars(*(np.float32(value) for value in values))
