"""The camera's pictures of a scenario: rendered, disturbed and written as JPEG."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from scenarios.camera.disturbances import NONE, PAPER, disturb
from scenarios.camera.files import load_camera
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from scenarios.errors import ScenarioError
from scenarios.files import Scenario
from scenarios.plant.pipeline import PlantTrajectory
from scenarios.progress import Progress, silent

WORKERS = 2
"""Rendering processes, of about 100 MB each."""
DISTURBANCES = {"none": NONE, "paper": PAPER}
SCENE_STREAM = 101
"""Random stream of the scenario's world, apart from those of sensors and disturbances."""


@dataclass(frozen=True)
class PictureJob:
    """Frames to render in one process."""

    scenario: Scenario
    frames: tuple[tuple[int, float], ...]
    """Number and front axle's position of each frame [m]."""
    folder: Path


def scene_renderer(scenario: Scenario) -> Renderer:
    """The renderer of the scenario's world, by its seed; raises ScenarioError where there is no camera."""
    if scenario.camera_path is None:
        raise ScenarioError(
            f"{scenario.path}: camera: missing; expected a camera file, to draw pictures through."
        )
    segments = [SurfaceSegment(s.start_m, s.surface_class) for s in scenario.road.segments]
    scene = Scene.random(np.random.default_rng([scenario.seed, SCENE_STREAM]))
    return Renderer(load_camera(scenario.camera_path), segments, scene)


def draw(job: PictureJob) -> int:
    """Render and write the frames of a job; returns their number."""
    renderer, pictures = scene_renderer(job.scenario), job.scenario.pictures
    quality = [cv2.IMWRITE_JPEG_QUALITY, pictures.jpeg_quality]
    for number, position_m in job.frames:
        image = renderer.frame(position_m).image
        seed = int(np.random.SeedSequence([job.scenario.seed, number]).generate_state(1)[0])
        image = disturb(image, DISTURBANCES[pictures.disturbance], seed)
        path = job.folder / frame_name(number)
        if not cv2.imwrite(str(path), image, quality):
            raise OSError(f"{path}: the picture could not be written; is the disk full?")
    return len(job.frames)


def frame_steps(scenario: Scenario) -> int:
    """Steps from picture to picture: the scenario's frame rate, to the nearest whole number of steps."""
    return max(1, round(1.0 / (scenario.pictures.fps * scenario.step_s)))


def frame_name(number: int) -> str:
    """File name of a frame."""
    return f"frame_{number:05d}.jpg"


def record(
    scenario: Scenario,
    trajectory: PlantTrajectory,
    folder: Path,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Render and write all pictures of a drive; returns a table of them.

    Returns
    -------
    DataFrame
        frame, row (of the trajectory), time_s, front_axle_m, path; empty without a camera.
    """
    columns = ["frame", "row", "time_s", "front_axle_m", "path"]
    if scenario.camera_path is None:
        return pd.DataFrame(columns=columns)
    rows = np.arange(0, len(trajectory), frame_steps(scenario))
    front_axle_m = trajectory.position_m[rows] + scenario.vehicle.to_core().cog_to_front_axle_m
    folder.mkdir(parents=True, exist_ok=True)
    frames = [(number, float(axle_m)) for number, axle_m in enumerate(front_axle_m, start=1)]
    batch = max(1, -(-len(frames) // (4 * WORKERS)))
    jobs = [PictureJob(scenario, tuple(frames[i : i + batch]), folder) for i in range(0, len(frames), batch)]
    done = 0
    for count in Parallel(n_jobs=WORKERS, return_as="generator_unordered")(
        delayed(draw)(job) for job in jobs
    ):
        done += count
        progress(done, len(frames))
    paths = [str((folder / frame_name(number)).resolve()) for number, _ in frames]
    values = zip((n for n, _ in frames), rows, trajectory.time_s[rows], front_axle_m, paths, strict=True)
    return pd.DataFrame(list(values), columns=columns)
