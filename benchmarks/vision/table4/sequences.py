"""What is judged: pictures in a row, the camera that took them and what the road really is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.trajectory import Motion

Image = NDArray[np.uint8]
Truth = Callable[[NDArray[np.float64]], NDArray[np.int64]]
"""Classes of ground points in vehicle axes, shape (n, 2) to (n,)."""
WHOLE = ((0.0, 0.0, 1.0, 1.0),)


@dataclass(frozen=True)
class Frame:
    """One picture's file, and the class of the road as a function of the ground point."""

    path: Path
    truth: Truth
    part: str = ""
    """Part of the source's split ('train', 'val', ...); empty for rendered pictures."""
    way_m: float | None = None
    """Way driven until then, where it is known; with assumed cameras as guessed as their speed [m]."""


@dataclass(frozen=True)
class Sequence:
    """Pictures of one drive.

    Attributes
    ----------
    name, source : str
        The drive, and the row of the table that it counts for.
    left_out : str
        Folder of the networks that never saw the source; 'full' where none did.
    camera : Camera
        Rendered or assumed, of the cropped picture.
    motion : Motion
        Straight on.
    usable : tuple of boxes
        Parts of the picture in which road may be judged: left, top, right, bottom as shares.
    roi_scale : float
        Width of the regions over the default one [-].
    cropped_rows : int
        Rows kept from the top of the picture; 0 keeps all.
    consecutive : bool
        Whether the pictures follow each other at a frame rate.
    """

    name: str
    source: str
    left_out: str
    camera: Camera
    motion: Motion
    frames: tuple[Frame, ...]
    usable: tuple[tuple[float, float, float, float], ...] = WHOLE
    roi_scale: float = 1.0
    cropped_rows: int = 0
    consecutive: bool = True

    def validation_part(self) -> Sequence:
        """The frames of the split's part 'val': networks that learned from the source have not seen them."""
        return replace(self, frames=tuple(frame for frame in self.frames if frame.part == "val"))

    def motion_at(self, number: int) -> Motion:
        """The car's motion at a frame."""
        return replace(self.motion, way_m=self.frames[number].way_m)

    def picture(self, frame: Frame) -> Image:
        """The picture as the estimator gets it, BGR; raises OSError."""
        image = cv2.imread(str(frame.path), cv2.IMREAD_COLOR)
        if image is None:
            raise OSError(
                f"{frame.path}: not a readable picture; remove it and let it be made or copied again."
            )
        return image[: self.cropped_rows or None].astype(np.uint8, copy=False)


def constant(surface: Surface) -> Truth:
    """The same class everywhere."""
    return lambda ground_m: np.full(len(ground_m), int(surface))


def majority(classes: NDArray[np.int64]) -> tuple[Surface, float]:
    """Class of most of the near group's corners and its share; of two alike the one further ahead.

    `classes` are in the order of the way ahead. Raises ValueError where there are none.
    """
    if not len(classes):
        raise ValueError("The near group lies outside the picture: correct the camera.")
    counts = np.bincount(classes, minlength=len(Surface))
    best = np.flatnonzero(counts == counts.max())
    chosen = best[0] if len(best) == 1 else next(c for c in classes[::-1] if c in best)
    return Surface(int(chosen)), float(counts.max() / len(classes))
