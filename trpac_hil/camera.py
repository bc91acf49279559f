"""The camera's process: plays a folder of pictures at a fixed rate and shares class and confidence of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.camera_computer import CameraComputer
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import ModelError
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


def motion_of(numbers: Sequence[float]) -> Motion:
    """The motion that the numbers `MOTION` describe."""
    speed, acceleration, steering, yaw, way = numbers
    return Motion(speed, acceleration, steering, None if math.isnan(yaw) else yaw, way)


def run_camera(job: CameraJob, motion: Numbers, results: Ring, control: Control) -> None:
    """Body of the process: classify each picture when it is due and share the result, until the loop ends."""
    with helper(job.core):
        cv2.setNumThreads(1)
        try:
            computer = CameraComputer(job.vision, job.sides, job.threads)
            computer.classes(job.source.picture(0), Motion(10.0))
        except (ModelError, ImageError) as error:
            control.refuse(str(error))
            return
        computer.forget()
        control.ready()
        if control.wait_for_start():
            _play(job, computer, motion, results, control)


def _play(job: CameraJob, computer: CameraComputer, motion: Numbers, results: Ring, control: Control) -> None:
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
        classes = _classes(job, computer, number, motion, control)
        ready_ns = clock.now_ns()
        work_ms = (ready_ns - now_ns) * 1e-6
        results.write([number, deadlines.due_ns(number), ready_ns, left_out, work_ms, *classes])


def _classes(
    job: CameraJob, computer: CameraComputer, number: int, motion: Numbers, control: Control
) -> list[float]:
    moving = motion_of(motion.get())
    try:
        seen = computer.classes(job.source.picture(number), moving)
    except (ImageError, ModelError) as error:
        control.send("picture", f"A picture could not be used: {error}")
        return [FAILED, 0.0] * len(job.sides)
    return [number for road in seen for number in (float(road.surface), road.confidence)]
