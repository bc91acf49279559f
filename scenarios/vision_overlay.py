"""The image estimator's regions and results, drawn onto the pictures of a run."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.camera.files import load_camera
from scenarios.files import Scenario
from scenarios.library import networks_folder
from scenarios.progress import Progress, silent
from scenarios.runner import Run
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import decode_image
from trpac_core.vision.results import FrameResult
from trpac_core.vision.trajectory import Motion

CLASS_BGR = {Surface.DRY: (60, 160, 240), Surface.WET: (230, 140, 40), Surface.SNOW_ICE: (220, 80, 200)}
ROAD_BGR, SHADOW_BGR = (90, 200, 90), (200, 90, 90)
LINE_BGR = (0, 230, 255)
FLAG_DOWN_BGR = (60, 60, 230)
NEAR_LINE_PX, FAR_LINE_PX = 5, 2
"""Widths of the lines of the near group and of the others [px]."""
TINT = 0.22
"""Opacity of the tint of road and shadow [-]."""
TILE_PX, COLUMNS = 640, 3
"""Width of a tile of the sheet [px], and tiles in a row."""


def image_estimator(scenario: Scenario) -> Ife:
    """The image estimator with the shipped networks and the unit's settings."""
    if scenario.camera_path is None:
        raise ValueError(f"{scenario.path}: there is no camera, so there are no pictures to look at.")
    car = scenario.vehicle.to_core()
    config = IfeConfig(
        camera=load_camera(scenario.camera_path),
        track_m=car.track_m,
        wheelbase_m=car.wheelbase_m,
        side="left" if scenario.wheel.endswith("l") else "right",
    )
    return Ife.load(config, networks_folder())


def annotate(image: NDArray[np.uint8], result: FrameResult, caption: str) -> NDArray[np.uint8]:
    """The picture with tints of road and shadow, ellipses, lines across the road, patches by class, and the result.

    The near group, which gives the result, has thick lines; a bar beside the result has the colour of its class, and a
    red line below it means that the flag is down.

    Raises ValueError where the result was made without its view.
    """
    if result.view is None:
        raise ValueError("The result holds no view: process the frame with with_view=True.")
    shown = image.copy()
    size = (image.shape[1], image.shape[0])
    for mask, colour in ((result.view.masks.drivable, ROAD_BGR), (result.view.masks.shadow, SHADOW_BGR)):
        inside = cv2.resize(mask, size, interpolation=cv2.INTER_LINEAR) > 0.5
        shown[inside] = ((1.0 - TINT) * shown[inside] + TINT * np.array(colour)).astype(np.uint8)
    for number, group in enumerate(result.view.groups):
        for outline in group.outlines_px[::2]:
            if np.isfinite(outline).all():
                cv2.polylines(
                    shown, [np.round(outline).astype(np.int32)], True, (255, 255, 255), 2, cv2.LINE_AA
                )
        for box, probabilities in zip(group.boxes_px, group.probabilities, strict=True):
            colour = CLASS_BGR[Surface(int(np.argmax(probabilities)))]
            corners = (int(box[0]), int(box[1])), (int(box[2]), int(box[3]))
            cv2.rectangle(shown, *corners, colour, NEAR_LINE_PX if number == 0 else FAR_LINE_PX)
    for line in result.view.lines_px:
        if np.isfinite(line).all():
            left, right = np.round(line).astype(np.int32).tolist()
            cv2.line(shown, left, right, LINE_BGR, NEAR_LINE_PX, cv2.LINE_AA)
    found = (
        f"{result.surface.label}  Q_v {result.Q_v:.2f} (p_util {result.p_util:.2f}, P {result.P_fusion:.2f})"
        f"  flag {int(result.flag)}"
    )
    cv2.rectangle(shown, (0, 0), (shown.shape[1], 150), (40, 40, 40), cv2.FILLED)
    cv2.rectangle(shown, (0, 0), (14, 150), CLASS_BGR[result.surface], cv2.FILLED)
    if not result.flag:
        cv2.rectangle(shown, (0, 138), (shown.shape[1], 150), FLAG_DOWN_BGR, cv2.FILLED)
    for row, text in enumerate((caption, found)):
        corner = (24, 60 + 64 * row)
        cv2.putText(shown, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 1.8, (255, 255, 255), 4, cv2.LINE_AA)
    return shown


def draw_overlay_sheet(run: Run, path: Path, progress: Progress = silent, count: int = 6) -> None:
    """Write a sheet of annotated pictures at equal distances of the run.

    All pictures up to the last one shown are processed with the shipped networks, so that results have the same history
    as those of the unit, and equal them where the unit was built from the same code.
    """
    ife, state = image_estimator(run.scenario), IfeState()
    chosen = {round(share * (len(run.frames) - 1)) for share in np.linspace(0.06, 0.94, count)}
    tiles = []
    for index in range(max(chosen) + 1):
        frame = run.frames.iloc[index]
        progress(index + 1, max(chosen) + 1)
        image = decode_image(Path(frame["path"]))
        row = run.table.iloc[int(frame["row"])]
        motion = Motion(
            float(row["vehicle_speed_m_s"]), float(row["accel_x_m_s2"]), way_m=float(frame["front_axle_m"])
        )
        state, result = ife.process(state, image, motion, with_view=index in chosen)
        if index in chosen:
            caption = f"t {frame['time_s']:.2f} s, front axle at {frame['front_axle_m']:.1f} m"
            tile = annotate(image, result, caption)
            height = round(TILE_PX * tile.shape[0] / tile.shape[1])
            tiles.append(cv2.resize(tile, (TILE_PX, height), interpolation=cv2.INTER_AREA))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    if not cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 88]):
        raise OSError(f"{path}: the sheet could not be written; is the disk full?")
