"""Rendered drives over class changes that no training has seen."""

from __future__ import annotations

import hashlib
import inspect
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from itertools import permutations
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from models.training.rendered import SEED_RANGES, random_camera
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.trajectory import Motion

from .sequences import Frame, Sequence

FIRST_SEED = 4_000_000
SCALE = 0.5
"""Of the default camera's 1920 x 1200 pixels: 960 x 600, at which three in four training worlds are drawn too."""
FRAMES, STEP_M = 60, 0.5
CHANGE_M = (9.0, 27.0)
"""Stretch in which the road changes; the near group ends 4.5 m ahead, so both classes are long in view [m]."""
SPEEDS_M_S = (8.0, 22.0)
QUALITY = 95
PAIRS = tuple(permutations(Surface, 2))
STREET = 9
"""Beside a drive's seed, for its street: all else stays as it is without."""
PLAN, COST = "plan.json", "cost.json"


@dataclass(frozen=True)
class Plan:
    """One drive, all of it drawn from its seed."""

    seed: int
    camera: Camera
    look: Scene
    segments: tuple[SurfaceSegment, ...]
    likely_weather: bool
    speed_m_s: float
    lateral_m: tuple[float, ...]
    heading_rad: tuple[float, ...]

    @property
    def places_m(self) -> NDArray[np.float64]:
        """Front axle in each frame, road coordinate [m]."""
        return STEP_M * np.arange(FRAMES)


def plan(seed: int, streets: bool = False) -> Plan:
    """Every pair of classes in turn; every other six drives have the weather likely for the first, the rest any.

    With `streets` the same drive lies in the open shade of houses.
    """
    if any(seed in known for known in SEED_RANGES.values()):
        raise ValueError(f"Seed {seed} belongs to a training split; expected {FIRST_SEED} or above.")
    rng = np.random.default_rng(seed)
    first, second = PAIRS[seed % len(PAIRS)]
    likely = seed // len(PAIRS) % 2 == 0
    camera = random_camera(rng, SCALE)
    segments = (SurfaceSegment(-1000.0, first), SurfaceSegment(float(rng.uniform(*CHANGE_M)), second))
    look = Scene.random(rng, first if likely else None)
    if streets:
        look = look.in_a_street(np.random.default_rng([seed, STREET]))
    way = STEP_M * np.arange(FRAMES)
    wave, sway, phase = rng.uniform(30.0, 80.0), rng.uniform(0.0, 0.4), rng.uniform(0.0, 2.0 * np.pi)
    lateral = sway * np.sin(2.0 * np.pi * way / wave + phase)
    heading = np.arctan(sway * 2.0 * np.pi / wave * np.cos(2.0 * np.pi * way / wave + phase))
    return Plan(
        seed, camera, look, segments, likely, float(rng.uniform(*SPEEDS_M_S)), tuple(lateral), tuple(heading)
    )


def surfaces_at(drawn: Plan, number: int, ground_m: NDArray[np.float64]) -> NDArray[np.int64]:
    """Classes of ground points in the axes of the car at a frame, shape (n,)."""
    heading = drawn.heading_rad[number]
    along = drawn.places_m[number] + np.cos(heading) * ground_m[:, 0] - np.sin(heading) * ground_m[:, 1]
    starts = np.array([segment.start_m for segment in drawn.segments])
    classes = np.array([int(segment.surface) for segment in drawn.segments])
    return classes[np.searchsorted(starts, along, side="right") - 1]


def render(drawn: Plan, folder: Path) -> float:
    """Draw a drive's pictures as JPEG into a folder, whole or not at all; CPU time [s]."""
    begin = time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    renderer = Renderer(drawn.camera, drawn.segments, drawn.look)
    for number, place in enumerate(drawn.places_m):
        image = renderer.frame(float(place), drawn.lateral_m[number], drawn.heading_rad[number]).image
        if not cv2.imwrite(str(folder / f"{number:03d}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY]):
            raise OSError(f"{folder}: a picture could not be written; is the disk full?")
    spent = time.process_time() - begin
    (folder / COST).write_text(json.dumps({"cpu_s": spent}), encoding="utf-8")
    # The plan comes last: a folder without it was left half done and is drawn anew.
    (folder / PLAN).write_text(described(drawn), encoding="utf-8")
    return spent


def described(drawn: Plan) -> str:
    """A plan and the renderer's code as text, to tell whether pictures on disk are its own."""
    return json.dumps({**asdict(drawn), "renderer": _renderer_sha256()}, sort_keys=True, default=float)


@cache
def _renderer_sha256() -> str:
    code = sorted(Path(inspect.getfile(Renderer)).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in code)).hexdigest()


def rendered_drives(
    kept: Path,
    count: int,
    told: Callable[[int, int], None],
    first_seed: int = FIRST_SEED,
    *,
    streets: bool = False,
) -> tuple[list[Sequence], float]:
    """The first drives from a seed, drawn where the folder `kept` lacks them; CPU time of all when drawn [s].

    With `streets` all of them lie in the open shade of houses.
    """
    drives, cpu_s = [], 0.0
    for done, drawn in enumerate(plan(first_seed + number, streets) for number in range(count)):
        folder = kept / str(drawn.seed)
        written = folder / PLAN
        if not (written.is_file() and written.read_text(encoding="utf-8") == described(drawn)):
            render(drawn, folder)
        cpu_s += json.loads((folder / COST).read_text(encoding="utf-8"))["cpu_s"]
        drives.append(_sequence(drawn, folder))
        told(done + 1, count)
    return drives, cpu_s


def _sequence(drawn: Plan, folder: Path) -> Sequence:
    def truth(number: int) -> Callable[[NDArray[np.float64]], NDArray[np.int64]]:
        return lambda ground_m: surfaces_at(drawn, number, ground_m)

    return Sequence(
        name=str(drawn.seed),
        source="rendered, likely weather" if drawn.likely_weather else "rendered, any weather",
        left_out="full",
        camera=drawn.camera,
        motion=Motion(drawn.speed_m_s),
        frames=tuple(
            Frame(folder / f"{n:03d}.jpg", truth(n), way_m=float(place))
            for n, place in enumerate(drawn.places_m)
        ),
    )
