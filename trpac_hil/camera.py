"""The camera's process: plays a folder of pictures at a fixed rate and shares class and confidence of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.library import networks_folder
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import ModelError, Segmenter, SurfaceClassifier
from trpac_core.vision.results import FrameResult
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.trajectory import Motion
from trpac_hil.deadlines import Deadlines, SystemClock
from trpac_hil.helper import Control, helper
from trpac_hil.shared import Numbers, Ring

FAILED = -1.0
"""Value of the class where the picture could not be used."""
MOTION = ("speed_m_s", "acceleration_m_s2", "steering_angle_rad", "yaw_rate_rad_s", "way_m")
"""Numbers of the car's motion that the loop shares; the yaw rate is NaN where it is not measured."""
HEAD = 5
"""Numbers of a result before the classes: picture, time taken, time ready [ns], pictures left out, work [ms]."""
RESULTS_KEPT = 64
LONGEST_SLEEP_NS = 50_000_000


def result_columns(sides: int) -> int:
    """How many numbers a result has: the head, and class and confidence of each side."""
    return HEAD + 2 * sides


@dataclass(frozen=True)
class PictureFolder:
    """The pictures of a folder, repeated without end."""

    files: tuple[Path, ...]

    def picture(self, number: int) -> NDArray[np.uint8]:
        """The picture of a number, counted from 0; raises ImageError."""
        return decode_image(self.files[number % len(self.files)])


@dataclass(frozen=True)
class CameraJob:
    """Settings of the camera's process.

    Attributes
    ----------
    source : PictureFolder
        Pictures.
    vision : IfeConfig
        Settings of the image estimator: camera, car, and the unit's parameters `image.*`.
    fps : float
        Pictures per second.
    sides : tuple of str
        Tracks to classify: 'left', 'right', or both in this order.
    threads : int
        Threads of each network.
    core : int or None
        The loop's core, which this process does not use.
    """

    source: PictureFolder
    vision: IfeConfig
    fps: float
    sides: tuple[str, ...] = ("left",)
    threads: int = 1
    core: int | None = None


@dataclass
class ImageEstimator:
    """The image estimator of one side or of both, with its memory."""

    job: CameraJob
    state: Any = field(init=False)
    _ife: Any = field(init=False)

    def __post_init__(self) -> None:
        """Load the networks; raises ModelError."""
        job = self.job
        networks = (
            Segmenter(networks_folder() / "segmenter.onnx", job.threads),
            SurfaceClassifier(networks_folder() / "surface.onnx", job.threads),
        )
        config = replace(job.vision, groups_looked_at=1)
        if len(job.sides) == 2:
            self._ife, self.state = SidesIfe(config, *networks), SidesState()
        else:
            side: Any = job.sides[0]
            self._ife, self.state = Ife(replace(config, side=side), *networks), IfeState()

    def process(self, image: NDArray[np.uint8], motion: Motion) -> Sequence[FrameResult]:
        """Results of a picture, one per side; where ImageError or ModelError is raised the state is unchanged."""
        self.state, *results = self._ife.process(self.state, image, motion)
        return results


def motion_of(numbers: Sequence[float]) -> Motion:
    """The motion that the numbers `MOTION` describe."""
    speed, acceleration, steering, yaw, way = numbers
    return Motion(speed, acceleration, steering, None if math.isnan(yaw) else yaw, way)


def run_camera(job: CameraJob, motion: Numbers, results: Ring, control: Control) -> None:
    """Body of the process: classify each picture when it is due and share the result, until the loop ends."""
    with helper(job.core):
        cv2.setNumThreads(1)
        try:
            estimator = ImageEstimator(job)
            first = job.source.picture(0)
            estimator.process(first, Motion(10.0))
        except (ModelError, ImageError) as error:
            control.refuse(str(error))
            return
        estimator.state = type(estimator.state)()
        control.ready()
        if control.wait_for_start():
            _play(job, estimator, motion, results, control)


def _play(
    job: CameraJob, estimator: ImageEstimator, motion: Numbers, results: Ring, control: Control
) -> None:
    clock = SystemClock()
    deadlines = Deadlines(control.start_ns, round(1e9 / job.fps))
    done, left_out = -1, 0
    while not control.stopped:
        due_ns = deadlines.due_ns(done + 1)
        now_ns = clock.now_ns()
        if now_ns < due_ns:
            clock.sleep_ns(min(due_ns - now_ns, LONGEST_SLEEP_NS))
            continue
        # Too slow for the rate: the newest picture is used, those in between are left out.
        number = deadlines.next_slot(done, now_ns)
        left_out += number - done - 1
        done = number
        classes = _classes(job, estimator, number, motion, control)
        ready_ns = clock.now_ns()
        work_ms = (ready_ns - now_ns) * 1e-6
        results.write([number, deadlines.due_ns(number), ready_ns, left_out, work_ms, *classes])


def _classes(
    job: CameraJob, estimator: ImageEstimator, number: int, motion: Numbers, control: Control
) -> list[float]:
    moving = motion_of(motion.get())
    try:
        seen = estimator.process(job.source.picture(number), moving)
    except (ImageError, ModelError) as error:
        control.send("picture", f"A picture could not be used: {error}")
        return [FAILED, 0.0] * len(job.sides)
    return [
        number
        for result in seen
        for number in (float(result.surface), result.told_by_bus(job.vision.flag_threshold))
    ]
