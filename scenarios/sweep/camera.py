"""Road classes of a run without pictures, drawn from records of the real image estimator.

`camera_process.yaml` holds the image estimator's classes along rendered, disturbed worlds; it is written by
`python -m benchmarks.vision.measure_camera_process`. A run draws one world and, for each stretch of road, an offset in
that world's record of the surface; from there the record is played back by distance driven. Frequency, length and
confidence of wrong classes are those of the record, and one world holds for the whole run. A class arrives in the step
in which its picture was taken, as in the unit, plus the delay `late_s` of a bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.camera.disturbances import disturb
from scenarios.files import Scenario
from scenarios.pictures import DISTURBANCES, frame_steps, scene_renderer
from scenarios.plant.pipeline import PlantTrajectory
from scenarios.sweep.draw import Camera
from scenarios.yaml_text import parse_yaml
from trpac_core.estimator import RoadClass
from trpac_core.files import read_text
from trpac_core.vision.classes import Surface
from trpac_core.vision.images import decode_image

RECORDS = Path(__file__).with_name("camera_process.yaml")
CERTAIN = 0.95
"""Confidence of a wrong class that is given on purpose [-]."""


class Record(NamedTuple):
    """Classes along one surface of one world, at equal spacing: class index and Q_v, shape (n,) each."""

    given: NDArray[np.int64]
    Q_v: NDArray[np.float64]


@dataclass(frozen=True)
class CameraProcess:
    """The records, the distance between their entries [m], and from the front wheel to the road that they show [m]."""

    spacing_m: float
    near_m: float
    worlds: tuple[dict[Surface, Record], ...]


@lru_cache(maxsize=1)
def measured_process() -> CameraProcess:
    """The shipped records."""
    data = parse_yaml(read_text(RECORDS, 1_000_000, "the shipped records"))
    return CameraProcess(
        spacing_m=float(data["spacing_m"]),
        near_m=float(data["near_m"]),
        worlds=tuple({s: _record(world[s.label]) for s in Surface} for world in data["worlds"]),
    )


def _record(entry: dict[str, Any]) -> Record:
    given = np.array([int(digit) for digit in entry["given"]])
    return Record(given, np.array([float(q) for q in str(entry["Q_v_percent"]).split()]) / 100.0)


class Frames(NamedTuple):
    """The frames of a drive that arrive, and their disturbances, shape (n,) each."""

    taken: NDArray[np.int64]
    """Step at which the picture is taken."""
    arrives: NDArray[np.int64]
    """Step at which its class arrives."""
    front_m: NDArray[np.float64]
    """Where the front axle is when the picture is taken [m]."""
    wrong: NDArray[np.int64]
    """The wrong class that is given on purpose; -1 where none is."""


def frames_of(
    scenario: Scenario,
    trajectory: PlantTrajectory,
    camera: Camera,
    process: CameraProcess,
    random: np.random.Generator,
) -> Frames:
    """The frames of a drive with the run's disturbances drawn."""
    taken = np.arange(0, len(trajectory), frame_steps(scenario))
    front_m = trajectory.position_m[taken] + scenario.vehicle.to_core().cog_to_front_axle_m
    true = np.array([int(scenario.road.segment_at(float(m)).surface_class) for m in front_m + process.near_m])
    turn = int(random.integers(1, len(Surface)))
    wrong = np.where(_wrong_way(front_m, camera, random), (true + turn) % len(Surface), -1)
    kept = random.uniform(size=len(taken)) >= camera.lost_share
    late = round(camera.late_s / scenario.step_s)
    return Frames(taken[kept], taken[kept] + late, front_m[kept], wrong[kept])


def road_classes(
    scenario: Scenario,
    trajectory: PlantTrajectory,
    camera: Camera,
    seed: int,
    process: CameraProcess | None = None,
) -> dict[int, RoadClass]:
    """Road classes of a drive by the step at which they arrive; world and disturbances are drawn from the seed."""
    process = process or measured_process()
    random, disturbing = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    frames = frames_of(scenario, trajectory, camera, process, disturbing)
    given, Q_v = _played_back(scenario, frames.front_m + process.near_m, process, random)
    given = np.where(frames.wrong >= 0, frames.wrong, given)
    Q_v = np.where(frames.wrong >= 0, CERTAIN, Q_v) * camera.confidence_factor
    return {
        int(row): RoadClass(Surface(int(index)), float(q))
        for row, index, q in zip(frames.arrives, given, Q_v, strict=True)
    }


class RenderedFrames:
    """Pictures of a drive, drawn, disturbed and packed as JPEG when they are asked for."""

    def __init__(self, scenario: Scenario, trajectory: PlantTrajectory, camera: Camera, seed: int) -> None:
        self._scenario = scenario
        self._renderer = scene_renderer(scenario)
        disturbing = np.random.default_rng(np.random.SeedSequence(seed).spawn(2)[1])
        frames = frames_of(scenario, trajectory, camera, measured_process(), disturbing)
        self._frames = {int(row): index for index, row in enumerate(frames.arrives)}
        self._taken, self._front_m, self._wrong = frames.taken, frames.front_m, frames.wrong

    def get(self, row: int) -> NDArray[np.uint8] | RoadClass | None:
        """The picture that arrives at a step, a wrong class in its place, or None where none arrives."""
        index = self._frames.get(row)
        if index is None:
            return None
        if self._wrong[index] >= 0:
            return RoadClass(Surface(int(self._wrong[index])), CERTAIN)
        pictures = self._scenario.pictures
        image = self._renderer.frame(float(self._front_m[index])).image
        seed = int(
            np.random.SeedSequence([self._scenario.seed, int(self._taken[index])]).generate_state(1)[0]
        )
        image = disturb(image, DISTURBANCES[pictures.disturbance], seed)
        _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, pictures.jpeg_quality])
        return decode_image(packed.tobytes())


def _played_back(
    scenario: Scenario, position_m: NDArray[np.float64], process: CameraProcess, random: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Class index and confidence at road positions, shape (n,) each."""
    world = process.worlds[int(random.integers(len(process.worlds)))]
    given, Q_v = np.empty(len(position_m), dtype=np.int64), np.empty(len(position_m))
    starts = np.array([s.start_m for s in scenario.road.segments])
    stretch = np.clip(np.searchsorted(starts, position_m, side="right") - 1, 0, None)
    for index, segment in enumerate(scenario.road.segments):
        record, here = world[segment.surface_class], stretch == index
        offset = int(random.integers(len(record.given)))
        cell = np.floor((position_m[here] - starts[index]) / process.spacing_m).astype(np.int64)
        at = (offset + cell) % len(record.given)
        given[here], Q_v[here] = record.given[at], record.Q_v[at]
    return given, Q_v


def _wrong_way(
    front_m: NDArray[np.float64], camera: Camera, random: np.random.Generator
) -> NDArray[np.bool_]:
    """Whether a wrong class is given, shape (n,); stretches and gaps have exponentially distributed lengths."""
    if camera.wrong_share <= 0.0:
        return np.zeros(len(front_m), dtype=bool)
    if camera.wrong_share >= 1.0:
        return np.ones(len(front_m), dtype=bool)
    gap_m = camera.wrong_length_m * (1.0 - camera.wrong_share) / camera.wrong_share
    wrong = bool(random.uniform() < camera.wrong_share)
    borders, states = [-np.inf], [wrong]
    border_m = float(front_m[0])
    while border_m < front_m[-1]:
        border_m += float(random.exponential(camera.wrong_length_m if wrong else gap_m))
        wrong = not wrong
        borders.append(border_m)
        states.append(wrong)
    return np.array(states)[np.searchsorted(np.array(borders), front_m, side="right") - 1]
