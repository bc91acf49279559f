"""Annotated video and contact sheet of a drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.vision_overlay import annotate
from trpac_core.vision.camera import Camera
from trpac_core.vision.results import FrameResult

CANVAS_PX, VIDEO_PX, STRIP_TILE_PX = 1920, 960, 480
"""Widths of the picture that is drawn on, of the video, and of a tile of the sheet [px]."""
STRIP_TILES, STRIP_COLUMNS = 12, 3


def shown(image: NDArray[np.uint8], result: FrameResult, caption: str) -> NDArray[np.uint8]:
    """The annotated frame at the video's width, with lettering of one size for all cameras."""
    factor = CANVAS_PX / image.shape[1]
    if result.view is not None and factor != 1.0:
        image = _at_width(image, CANVAS_PX)
        groups = tuple(
            replace(
                group,
                outlines_px=factor * group.outlines_px,
                boxes_px=np.round(factor * group.boxes_px).astype(np.int64),
            )
            for group in result.view.groups
        )
        lines_px = factor * result.view.lines_px
        result = replace(result, view=replace(result.view, groups=groups, lines_px=lines_px))
    return _at_width(annotate(image, result, caption), VIDEO_PX)


def _at_width(image: NDArray[np.uint8], width_px: int) -> NDArray[np.uint8]:
    """The picture scaled to a width."""
    height_px = even_height(width_px, image.shape[1], image.shape[0])
    if image.shape[:2] == (height_px, width_px):
        return image
    how = cv2.INTER_AREA if width_px < image.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(image, (width_px, height_px), interpolation=how).astype(np.uint8, copy=False)


def even_height(width_px: int, from_width_px: int, from_height_px: int) -> int:
    """Height at another width, even as encoders require [px]."""
    return max(2, 2 * round(width_px * from_height_px / from_width_px / 2.0))


def dark(size: tuple[int, int], caption: str) -> NDArray[np.uint8]:
    """A grey picture in place of a frame that could not be used."""
    shown = np.full((size[1], size[0], 3), 40, dtype=np.uint8)
    for row, text in enumerate((caption, "frame not usable")):
        corner = (12, 30 + 32 * row)
        cv2.putText(shown, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 2, cv2.LINE_AA)
    return shown


class OverlayVideo:
    """annotated.mp4; every frame is scaled to the camera's aspect ratio."""

    def __init__(self, path: Path, camera: Camera, fps: float) -> None:
        self._path, self._fps = path, fps
        self.size = (VIDEO_PX, even_height(VIDEO_PX, camera.width_px, camera.height_px))
        self._writer: cv2.VideoWriter | None = None
        self._count = 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """Add a frame."""
        if self._writer is None:
            self._writer = cv2.VideoWriter(
                str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._fps, self.size
            )
        if self._writer.isOpened():
            fits = (image.shape[1], image.shape[0]) == self.size
            self._writer.write(image if fits else cv2.resize(image, self.size, interpolation=cv2.INTER_AREA))
            self._count += 1

    def finish(self) -> bool:
        """Close the file; returns False where there is no encoder; raises OSError where the file is incomplete."""
        if self._writer is None or not self._writer.isOpened():
            self._path.unlink(missing_ok=True)
            return False
        self._writer.release()
        written = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        whole = written.isOpened() and int(written.get(cv2.CAP_PROP_FRAME_COUNT)) == self._count
        written.release()
        if not whole:
            raise OSError(f"{self._path.name}: the film could not be written whole; is the disk full?")
        return True


class Strip:
    """strip.jpg: frames at equal distances of a run of unknown length."""

    def __init__(self) -> None:
        self._tiles: list[NDArray[np.uint8]] = []
        self._stride, self._seen = 1, 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """Add a frame; where too many are kept, every second one is removed."""
        if self._seen % self._stride == 0:
            self._tiles.append(_at_width(image, STRIP_TILE_PX))
            if len(self._tiles) > 2 * STRIP_TILES:
                self._tiles, self._stride = self._tiles[::2], 2 * self._stride
        self._seen += 1

    def write(self, path: Path) -> None:
        """Write the sheet; raises OSError."""
        chosen = np.linspace(0, len(self._tiles) - 1, min(STRIP_TILES, len(self._tiles))).round().astype(int)
        tiles = [self._tiles[index] for index in chosen]
        height = max(tile.shape[0] for tile in tiles)
        columns = min(STRIP_COLUMNS, len(tiles))
        sheet = np.full((-(-len(tiles) // columns) * height, columns * STRIP_TILE_PX, 3), 40, dtype=np.uint8)
        for index, tile in enumerate(tiles):
            top, left = index // columns * height, index % columns * STRIP_TILE_PX
            sheet[top : top + tile.shape[0], left : left + STRIP_TILE_PX] = tile
        if not cv2.imwrite(str(path), sheet, [cv2.IMWRITE_JPEG_QUALITY, 88]):
            raise OSError(f"{path.name}: the strip could not be written; is the disk full?")
