"""Which camera frame is new, and what it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trpac_core.estimator import RoadClass
from trpac_core.vision.classes import Surface
from trpac_core.vision.images import decode_image

from .variables import NO_ROAD_CLASS

Frame = NDArray[np.uint8] | RoadClass


BUS = "road_class"
"""Source of a frame whose class came by bus."""


@dataclass(frozen=True)
class FrameState:
    """The newest frame that was taken: the path it came from or BUS, and whether it could not be used."""

    source: str = ""
    frame_id: int = 0
    failed: bool = False


def next_frame(seen: FrameState, values: Mapping[str, Any]) -> tuple[FrameState, Frame | None, str | None]:
    """The frame of this step, if it is a new one.

    A changed path or a changed frame number is a new frame. A class by bus holds its value between frames:
    with numbered frames a changed number is a new one, without (0) each step is. After a frame that cannot be
    used `failed` stays set until one can.

    Returns
    -------
    FrameState, frame or None, problem or None
        The problem is one sentence that says why a new frame could not be used.
    """
    frame_id = values["frame_id"]
    by_bus = values["road_class"] != NO_ROAD_CLASS
    source = BUS if by_bus else values["image_path"]
    known = (source, frame_id) == (seen.source, seen.frame_id)
    if known and not (by_bus and frame_id == 0):
        return seen, None, None
    if not source:
        return FrameState("", frame_id, seen.failed), None, None
    try:
        frame = _road_class(values) if by_bus else decode_image(source)
    except ValueError as error:
        return FrameState(source, frame_id, failed=True), None, str(error)
    return FrameState(source, frame_id), frame, None


def _road_class(values: Mapping[str, Any]) -> RoadClass:
    number, confidence = values["road_class"], values["road_class_confidence"]
    problems = []
    if number not in list(Surface):
        problems.append(f"road_class is {number}, expected -1 (none), 0 (dry), 1 (wet) or 2 (snow or ice)")
    if not 0.0 <= confidence <= 1.0:
        problems.append(f"road_class_confidence is {confidence}, expected 0 to 1")
    if problems:
        raise ValueError("; ".join(problems) + ".")
    return RoadClass(Surface(number), confidence)
