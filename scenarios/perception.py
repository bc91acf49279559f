"""The camera chain of a simulated drive: perception columns for a plant log.

Each picture gives the class of a stretch of road ahead, as long as the distance driven since the picture before, and is
stamped with it, Eq. (11) of Tian et al. 2022 (doi:10.3390/rs14215583). Without effects the stamp is exact, the class is
the road's except for rare errors and a blend at borders, and the logit of the confidence is a first-order
autoregression around its normal level.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from scenarios.effects.frames import Frames
from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant.pipeline import PlantTrajectory
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import CLASS_THETA, Surface
from trpac_core.vision.preview import PreviewConfig

Array = NDArray[np.float64]
Columns = dict[str, NDArray]

NORMAL_CONFIDENCE = 0.95
"""Median Q_v of undisturbed pictures: 0.97 of our networks on rendered roads, a little less for a real one [-]."""
CONFIDENCE_DEVIATION = 0.8
"""Standard deviation of the confidence's logit; with the median above 90 % of the pictures lie above 0.86 [-]."""
CONFIDENCE_MEMORY_S = 0.15
"""Correlation time of the confidence: successive pictures show nearly the same road [s]."""
WRONG_SHARE = 0.02
"""Share of undisturbed pictures with a wrong class: the paper's 1.5 of 100, rounded up; our
networks are wrong in 12 on rendered roads (lab/2026-11-29_camera_scores.md), in runs, as in
benchmarks/accuracy/random_drives.py [-]."""
BORDER_BLEND_M = 0.1
"""Standard deviation of the position of a border between classes, which is not sharp [m]."""
REFERENCE_NOISE = 0.01
"""Standard deviation of the friction reference [-]."""


def perceive(
    trajectory: PlantTrajectory,
    road: RoadFile,
    vehicle: VehicleFile,
    fps: float = 20.0,
    camera: Camera | None = None,
    seed: int = 0,
) -> Columns:
    """Perception columns of a drive, with the vehicle's perception effects in them.

    Parameters
    ----------
    trajectory : PlantTrajectory
        The motion.
    road, vehicle : RoadFile, VehicleFile
        Its surfaces, and the car with its effects.
    fps : float
        Pictures per second [Hz].
    camera : Camera
        Height and position of the lens; the default is that of scenarios/cameras/paper.yaml.
    seed : int
        Seed of errors and noise.

    Returns
    -------
    dict
        frame_id, image_class, image_confidence, image_from_m, image_to_m, each held from result to result and NaN
        (class -1) before the first, and mu_reference, the class's friction under the front axle; shape (rows,) each.

    Raises
    ------
    ScenarioError
        A frame rate that is not positive.
    """
    if not fps > 0.0:
        raise ScenarioError(f"fps is {fps}; expected a positive number of pictures per second.")
    random = np.random.default_rng([seed, 0x0CA3])
    frames = plain_frames(trajectory, vehicle, fps, Camera() if camera is None else camera, random)
    for effect in vehicle.make_effects():
        frames = effect.perceive(frames)
    seen = frames.camera_m[:, None] + frames.seen_m
    classes = _judged(road, seen, frames.wrong_share, random)
    columns = _held(trajectory.time_s, frames, classes)
    front_m = trajectory.position_m + vehicle.to_core().cog_to_front_axle_m
    friction = frames.class_friction[surfaces_at(road, front_m)]
    columns["mu_reference"] = friction + REFERENCE_NOISE * random.standard_normal(len(front_m))
    return columns


def plain_frames(
    trajectory: PlantTrajectory, vehicle: VehicleFile, fps: float, camera: Camera, random: np.random.Generator
) -> Frames:
    """The frames of the chain without effects."""
    to_camera_m = vehicle.to_core().cog_to_front_axle_m + camera.x_from_front_axle_m
    drive_camera_m = trajectory.position_m + to_camera_m
    begin, end = trajectory.time_s[0], trajectory.time_s[-1]
    time_s = np.arange(begin + random.uniform(0.0, 1.0 / fps), end, 1.0 / fps)
    camera_m = np.interp(time_s, trajectory.time_s, drive_camera_m)
    speed = np.interp(time_s, trajectory.time_s, trajectory.speed_m_s)
    way = np.diff(camera_m, prepend=camera_m[:1] - speed[:1] / fps)
    begin_m = np.full(len(time_s), PreviewConfig().P_0_m - camera.x_from_front_axle_m)
    ahead = np.column_stack((begin_m, begin_m + way))
    return Frames(
        time_s=time_s,
        arrival_s=time_s,
        speed_m_s=speed,
        camera_m=camera_m,
        stamp_camera_m=camera_m,
        stamped_m=ahead,
        seen_m=ahead,
        confidence=expit(
            logit(NORMAL_CONFIDENCE) + CONFIDENCE_DEVIATION * _autoregression(len(time_s), fps, random)
        ),
        wrong_share=np.full(len(time_s), WRONG_SHARE),
        camera_height_m=camera.height_m,
        class_friction=np.array([CLASS_THETA[s] for s in Surface]),
        drive_time_s=trajectory.time_s,
        drive_camera_m=drive_camera_m,
    )


def surfaces_at(road: RoadFile, position_m: Array) -> NDArray[np.intp]:
    """Class index of the road's surface at positions, same shape; the first segment also holds before its start."""
    starts = np.array([s.start_m for s in road.segments[1:]])
    classes = np.array([int(s.surface_class) for s in road.segments])
    return classes[np.searchsorted(starts, position_m, side="right")]


def _autoregression(count: int, fps: float, random: np.random.Generator) -> Array:
    """A first-order autoregression of unit variance, shape (count,)."""
    from scipy.signal import lfilter  # here, since its import is slow

    keep = np.exp(-1.0 / (fps * CONFIDENCE_MEMORY_S))
    white = np.sqrt(1.0 - keep**2) * random.standard_normal(count)
    white[:1] /= np.sqrt(1.0 - keep**2)
    return lfilter([1.0], [1.0, -keep], white)


def _judged(
    road: RoadFile, seen_m: Array, wrong_share: Array, random: np.random.Generator
) -> NDArray[np.intp]:
    """Class index of each picture: that of the middle of its stretch, with blended borders and random errors."""
    count = len(seen_m)
    middle = seen_m.mean(axis=1) + BORDER_BLEND_M * random.standard_normal(count)
    classes = surfaces_at(road, middle)
    wrong = random.uniform(size=count) < wrong_share
    others = (classes + random.integers(1, len(Surface), count)) % len(Surface)
    return np.where(wrong, others, classes)


def _held(time_s: Array, frames: Frames, classes: NDArray[np.intp]) -> Columns:
    """Perception columns: each result holds from its arrival until the next one's."""
    stamps = frames.stamp_camera_m[:, None] + frames.stamped_m
    newest = np.searchsorted(frames.arrival_s, time_s, side="right") - 1
    none = newest < 0
    row = np.maximum(newest, 0)

    def column(values: NDArray) -> Array:
        return np.where(none, np.nan, values[row])

    return {
        "frame_id": np.where(none, np.nan, row + 1.0),
        "image_class": np.where(none, -1, classes[row]).astype(np.float64),
        "image_confidence": column(frames.confidence),
        "image_from_m": column(stamps[:, 0]),
        "image_to_m": column(stamps[:, 1]),
    }
