"""Which camera frame is new, and what it holds."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trpac_core.estimator import RoadClass
from trpac_core.vision.classes import Surface
from trpac_core.vision.images import MOST_PIXELS, ImageError, decode_image, raw_bgr_image

from .signals import NO_ROAD_CLASS

Frame = NDArray[np.uint8] | RoadClass


BUS = "<road_class>"
"""Source of a frame whose class came by bus."""
BUFFER = "<buffer>"
"""Source of a frame that came as a picture in memory."""
SURFACES = {surface.value: surface for surface in Surface}
MOST_BYTES = 3 * MOST_PIXELS
"""Larger buffers are refused unread [bytes]."""


@dataclass(frozen=True)
class FrameState:
    """The newest frame that was taken: the path it came from, BUS or BUFFER, and whether it could not be used."""

    source: str = ""
    frame_id: int = 0
    failed: bool = False


def next_frame(seen: FrameState, values: Mapping[str, Any]) -> tuple[FrameState, Frame | None, str | None]:
    """The frame of this step, if it is a new one.

    A changed path or a changed frame number is a new frame. Without numbers (0) each picture in memory is one, and
    so is each step in which a class comes by bus, since a bus signal holds its value. After a frame that cannot
    be used `failed` stays set until one can.

    Returns
    -------
    FrameState, frame or None, problem or None
        The problem is one sentence that says why a new frame could not be used.
    """
    frame_id, source = values["frame_id"], _source(values)
    if not source:
        # A picture in memory is set for one step: that none is set now ends nothing.
        return (seen if seen.source == BUFFER else FrameState("", frame_id, seen.failed)), None, None
    unnumbered = source in (BUS, BUFFER) and frame_id == 0
    if (source, frame_id) == (seen.source, seen.frame_id) and not unnumbered:
        return seen, None, None
    try:
        frame = _read(source, values)
    except ValueError as error:
        return FrameState(source, frame_id, failed=True), None, str(error)
    return FrameState(source, frame_id), frame, None


def _source(values: Mapping[str, Any]) -> str:
    if values["road_class"] != NO_ROAD_CLASS:
        return BUS
    if values["image.size"] != 0 and (values["image.base.lo"] != 0 or values["image.base.hi"] != 0):
        return BUFFER
    return str(values["image_path"])


def _read(source: str, values: Mapping[str, Any]) -> Frame:
    if source == BUS:
        return _road_class(values)
    if source == BUFFER:
        return _picture_in_memory(values)
    return decode_image(source)


def _picture_in_memory(values: Mapping[str, Any]) -> NDArray[np.uint8]:
    """The picture at an address, copied; the address is two signed halves of 32 bits."""
    address = (values["image.base.lo"] & 0xFFFFFFFF) | (values["image.base.hi"] & 0xFFFFFFFF) << 32
    size, width, height = values["image.size"], values["image_width"], values["image_height"]
    raw = width != 0 or height != 0
    if not 0 < size <= MOST_BYTES:
        raise ImageError(f"image.size is {size} bytes; expected 1 to {MOST_BYTES}.")
    if raw and size != 3 * width * height:
        raise ImageError(
            f"image.size is {size} bytes; expected {3 * width * height} for {width} x {height} pixels of raw BGR. "
            "For a JPEG or PNG picture leave image_width and image_height at 0."
        )
    data = ctypes.string_at(address, size)
    return raw_bgr_image(data, width, height) if raw else decode_image(data, "picture in memory")


def _road_class(values: Mapping[str, Any]) -> RoadClass:
    number, confidence = values["road_class"], values["road_class_confidence"]
    surface = SURFACES.get(number)
    if surface is not None and 0.0 <= confidence <= 1.0:
        return RoadClass(surface, confidence)
    problems = []
    if surface is None:
        problems.append(f"road_class is {number}, expected -1 (none), 0 (dry), 1 (wet) or 2 (snow or ice)")
    if not 0.0 <= confidence <= 1.0:
        problems.append(f"road_class_confidence is {confidence}, expected 0 to 1")
    raise ValueError("; ".join(problems) + ".")
