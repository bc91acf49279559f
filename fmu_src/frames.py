"""New camera frames from the inputs of a unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trpac_core.estimator import RoadClass
from trpac_core.four_wheels import SideClasses
from trpac_core.vision.classes import Surface
from trpac_core.vision.images import MOST_FILE_BYTES, ImageError, check_size, decode_image, raw_bgr_image

from .memory import read_memory
from .settings import BUFFERS_ENABLED
from .signals import NO_ROAD_CLASS

Frame = NDArray[np.uint8] | RoadClass | SideClasses


class BusClass(NamedTuple):
    """Names of the inputs for one surface class by bus."""

    surface: str
    confidence: str


ONE_CLASS = (BusClass("road_class", "road_class_confidence"),)
CLASS_PER_SIDE = (
    BusClass("road_class.left", "road_class_confidence.left"),
    BusClass("road_class.right", "road_class_confidence.right"),
)

BUS = "<road_class>"
"""Source of a frame whose class came by bus."""
BUFFER = "<buffer>"
"""Source of a frame that came as a picture in memory."""
IN_MEMORY = "picture in memory"
"""Name of such a picture in messages."""
SURFACES = {surface.value: surface for surface in Surface}


@dataclass(frozen=True)
class FrameState:
    """The newest frame: its source, which is a path, BUS or BUFFER, its number, and whether it could not be used.

    `path` is the last path that was read, because a host may leave it set after other sources.
    """

    source: str = ""
    frame_id: int = 0
    failed: bool = False
    path: str = ""


def next_frame(
    seen: FrameState, values: Mapping[str, Any], bus: tuple[BusClass, ...]
) -> tuple[FrameState, Frame | None, str | None]:
    """The frame of this step where it is a new one; `bus` has the inputs for classes, of the road or of each side.

    A changed path or a changed frame number is a new frame. Without numbers (0) each picture in memory is a new frame,
    and so is each step with a class by bus, because a bus signal holds its value. `failed` stays set from a frame that
    cannot be used until one that can.

    Returns
    -------
    FrameState, frame or None, problem or None
        The problem is a sentence: why a new frame could not be used.
    """
    frame_id, source = values["frame_id"], _source(values, bus)
    if not source:
        # A picture in memory is set for one step only, so its absence now does not end the frame.
        if seen.source == BUFFER or (not seen.source and seen.frame_id == frame_id):
            return replace(seen, path="") if seen.path else seen, None, None
        return FrameState("", frame_id, seen.failed), None, None
    by_path = source not in (BUS, BUFFER)
    if (source, frame_id) == (seen.path if by_path else seen.source, seen.frame_id) and (by_path or frame_id):
        return seen, None, None
    taken = FrameState(source, frame_id, path=source if by_path else seen.path)
    try:
        frame = _read(source, values, bus)
    except ValueError as error:
        return replace(taken, failed=True), None, str(error)
    return taken, frame, None


def _source(values: Mapping[str, Any], bus: tuple[BusClass, ...]) -> str:
    for bus_class in bus:
        if values[bus_class.surface] != NO_ROAD_CLASS:
            return BUS
    if values[BUFFERS_ENABLED] and in_memory(values):
        return BUFFER
    return str(values["image_path"])


def in_memory(values: Mapping[str, Any]) -> bool:
    """Whether the inputs point to a picture in memory: neither address nor size is 0."""
    return values["image.size"] != 0 and (values["image.base.lo"] != 0 or values["image.base.hi"] != 0)


def _read(source: str, values: Mapping[str, Any], bus: tuple[BusClass, ...]) -> Frame | None:
    if source == BUS:
        return _by_bus(values, bus)
    if source == BUFFER:
        return _picture_in_memory(values)
    return decode_image(source)


def _picture_in_memory(values: Mapping[str, Any]) -> NDArray[np.uint8]:
    """A copy of the picture at an address, which is two signed halves of 32 bits.

    Size, width and height are checked before the first byte is read.
    """
    address = (values["image.base.lo"] & 0xFFFFFFFF) | (values["image.base.hi"] & 0xFFFFFFFF) << 32
    size, width, height = values["image.size"], values["image_width"], values["image_height"]
    raw = width != 0 or height != 0
    if not 0 < size <= MOST_FILE_BYTES:
        raise ImageError(f"image.size is {size} bytes; expected 1 to {MOST_FILE_BYTES}.")
    if raw:
        check_size(width, height, f"{IN_MEMORY} of image_width x image_height")
        if size != 3 * width * height:
            raise ImageError(
                f"image.size is {size} bytes; expected {3 * width * height} for {width} x {height} pixels of raw "
                "BGR. For a JPEG or PNG picture leave image_width and image_height at 0."
            )
    data = read_memory(address, size)
    return raw_bgr_image(data, width, height) if raw else decode_image(data, IN_MEMORY)


def _by_bus(values: Mapping[str, Any], bus: tuple[BusClass, ...]) -> RoadClass | SideClasses | None:
    """The class of the road, or those of its two sides, None where there is none; all problems in one ValueError."""
    problems = [text for bus_class in bus for text in _problems(bus_class, values)]
    if problems:
        raise ValueError("; ".join(problems) + ".")
    classes = [_road_class(bus_class, values) for bus_class in bus]
    return SideClasses(*classes) if bus == CLASS_PER_SIDE else classes[0]


def _road_class(bus_class: BusClass, values: Mapping[str, Any]) -> RoadClass | None:
    surface = SURFACES.get(values[bus_class.surface])
    return None if surface is None else RoadClass(surface, values[bus_class.confidence])


def _problems(bus_class: BusClass, values: Mapping[str, Any]) -> list[str]:
    number, confidence = values[bus_class.surface], values[bus_class.confidence]
    problems = []
    if number not in SURFACES and number != NO_ROAD_CLASS:
        problems.append(
            f"{bus_class.surface} is {number}, expected -1 (none), 0 (dry), 1 (wet) or 2 (snow or ice)"
        )
    if number != NO_ROAD_CLASS and not 0.0 <= confidence <= 1.0:
        problems.append(f"{bus_class.confidence} is {confidence}, expected 0 to 1")
    return problems
