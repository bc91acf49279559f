"""Real pictures in a row, and stills, with cameras that are assumed (assumed_cameras.yaml) and say so."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from models.training.data import Box, Picture, pixel_box, read_manifest
from scenarios.strict import load_strict
from trpac_core.vision.camera import Camera
from trpac_core.vision.trajectory import Motion

from .sequences import WHOLE, Frame, Sequence, constant

ASSUMED = Path(__file__).with_name("assumed_cameras.yaml")
STILLS = "other_cameras"
STILL_SPEED_M_S = 10.0
NEAR_DEPTHS_M = (2.9, 4.9)
"""Depths of the near group's ends ahead of a lens 0.4 m behind the front axle [m]."""
NEAR_HALF_WIDTH_M = 0.9
"""Half the width of both tracks' ellipses in the near group [m]."""


class AssumedSource(BaseModel):
    """One entry of assumed_cameras.yaml, as written."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    rows: dict[str, list[str]]
    left_out: str
    width_px: int
    height_px: int
    cropped_rows: int | None = None
    horizon_row: float
    centre_column: float
    fx_px: float
    height_m: float
    roi_scale: float = 1.0
    usable: list[list[int]] = []
    speed_m_s: float
    consecutive: bool
    frames_per_s: float = Field(gt=0.0)

    def camera(self) -> Camera:
        """The assumed camera of the cropped picture: what the rows below the crop showed is no part of it."""
        middle = self.height_px / 2.0
        return Camera(
            width_px=self.width_px,
            height_px=self.cropped_rows or self.height_px,
            fx_px=self.fx_px,
            fy_px=self.fx_px,
            cx_px=self.centre_column,
            cy_px=middle,
            height_m=self.height_m,
            pitch_rad=float(np.arctan((middle - self.horizon_row) / self.fx_px)),
        )

    def way_m(self, file: Path) -> float:
        """Way until a frame, by the number at the end of its name; in the camera's scale, as `roi_scale` is [m]."""
        number = int(re.findall(r"\d+", file.stem)[-1])
        return self.roi_scale * self.speed_m_s * number / self.frames_per_s

    def usable_shares(self) -> tuple[Box, ...]:
        """Parts that may be judged, as shares of the cropped picture."""
        width, height = self.width_px, self.cropped_rows or self.height_px
        return tuple((a / width, b / height, c / width, d / height) for a, b, c, d in self.usable) or WHOLE


class AssumedFile(BaseModel):
    """assumed_cameras.yaml."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    sources: list[AssumedSource] = Field(min_length=1)


def real_sequences(data: Path) -> list[Sequence]:
    """Every drive of the data folder with an assumed camera, then each still of the other cameras.

    Raises DataFolderError where the folder is not whole.
    """
    pictures = read_manifest(data)
    file = load_strict(ASSUMED, AssumedFile)
    return [*_clips(pictures, file.sources), *_stills(pictures)]


def _clips(pictures: Iterable[Picture], assumed: Iterable[AssumedSource]) -> Iterator[Sequence]:
    by_folder: dict[str, list[Picture]] = {}
    for picture in pictures:
        by_folder.setdefault(picture.source, []).append(picture)
    for source in assumed:
        for row, folder in ((row, folder) for row, folders in source.rows.items() for folder in folders):
            yield Sequence(
                name=folder,
                source=row,
                left_out=source.left_out,
                camera=source.camera(),
                motion=Motion(source.speed_m_s),
                frames=tuple(
                    _frame(picture, source.way_m(picture.path))
                    for picture in sorted(by_folder.get(folder, []), key=lambda p: p.path.name)
                ),
                usable=source.usable_shares(),
                roi_scale=source.roi_scale,
                cropped_rows=source.cropped_rows or 0,
                consecutive=source.consecutive,
            )


def _frame(picture: Picture, way_m: float | None = None) -> Frame:
    return Frame(picture.path, constant(picture.surface), picture.split, way_m)


def _stills(pictures: Iterable[Picture]) -> Iterator[Sequence]:
    for picture in pictures:
        if picture.source.split("/")[0] == STILLS:
            height, width = picture.image().shape[:2]
            yield Sequence(
                name=f"{picture.source}/{picture.path.name}",
                source="other cameras, stills",
                left_out="full",
                camera=camera_over(picture.boxes[0], width, height),
                motion=Motion(STILL_SPEED_M_S),
                frames=(_frame(picture),),
                consecutive=False,
            )


def camera_over(box: Box, width_px: int, height_px: int) -> Camera:
    """A camera whose near group fills a road box: all that can be assumed of a still of which nothing is known."""
    left, top, right, bottom = pixel_box(box, np.empty((height_px, width_px)))
    near, far = NEAR_DEPTHS_M
    height_times_focal = (bottom - top) / (1.0 / near - 1.0 / far)
    focal = (right - left) / 2.0 * near / NEAR_HALF_WIDTH_M
    horizon = bottom - height_times_focal / near
    # The principal point is put on the horizon: a lens shifted, not tilted, keeps the box's rows where they are.
    return Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=(left + right) / 2.0,
        cy_px=horizon,
        height_m=height_times_focal / focal,
        pitch_rad=0.0,
    )
