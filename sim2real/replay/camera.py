"""What the camera says along a log: classes as the log's own system stamped them, or pictures, classified here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.files import VehicleFile
from sim2real.logs import Log, LogError
from sim2real.perception.frames import read_results
from sim2real.replay.inputs import ANY_ROAD, Inputs
from trpac_core.estimator import EstimatorConfig, RoadClass
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.preview import PreviewConfig
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.trajectory import Motion

MOST_TOLD = 3
"""Unreadable pictures that a warning names; the rest are counted."""

Frames = dict[int, RoadClass | None]
"""Row at which a result comes to its verdict; None is a picture that could not be used."""
Told = Callable[[int, int], None]


@dataclass(frozen=True)
class CameraSide:
    """The camera's results.

    Attributes
    ----------
    source : str
        In words, for the report.
    left, right : dict
        Results for the wheels of each side.
    preview : PreviewConfig
        Where on the road they belong.
    warnings : tuple of str
        What is odd, in sentences.
    """

    source: str
    left: Frames
    right: Frames
    preview: PreviewConfig
    warnings: tuple[str, ...] = ()

    def of(self, left_side: bool) -> Frames:
        """Results for a wheel."""
        return self.left if left_side else self.right


NO_CAMERA = CameraSide("none", {}, {}, PreviewConfig())


def camera_side(
    log: Log,
    inputs: Inputs,
    vehicle: VehicleFile,
    camera: Camera | None,
    models: Path,
    told: Told = lambda done, total: None,
) -> CameraSide:
    """Pictures where a camera file is given, else class columns where there are any, else nothing.

    Raises
    ------
    LogError
        A camera file is given and the log has no pictures.
    """
    if camera is not None:
        if log.image_path is None or not (log.image_path != "").any():
            raise LogError(
                f"{log.path}: has no column image_path; expected one with the names of the pictures, or the "
                "command without --camera."
            )
        return _from_pictures(log, inputs, camera, models, told)
    side = _from_columns(log, inputs, vehicle)
    if log.image_path is not None and not side.left:
        text = "image_path: the pictures are not used, because no camera file was given (--camera)."
        return CameraSide(side.source, {}, {}, side.preview, (*side.warnings, text))
    return side


def _from_columns(log: Log, inputs: Inputs, vehicle: VehicleFile) -> CameraSide:
    """The log's classes, each handed over where its stamp begins a preview distance ahead of the front wheels.

    The estimator stamps a class onto the road a fixed distance ahead. A log's stamps lie where its own system put them,
    so the distance is taken short enough for nearly all, and a result waits until its stamp is that far ahead.
    """
    results, warnings = read_results(log, ANY_ROAD, vehicle, Camera())
    if results is None:
        return CameraSide("none", {}, {}, PreviewConfig(), warnings)
    known = np.isfinite(results.confidence)
    if not known.any():
        text = "image_class: not used, because the column image_confidence is missing."
        return CameraSide("none", {}, {}, PreviewConfig(), (*warnings, text))
    front_m = inputs.position_m + inputs.vehicle.cog_to_front_axle_m
    arrived = np.searchsorted(inputs.time_s, results.time_s[known] - 1e-9)
    arrived = np.minimum(arrived, len(inputs) - 1)
    from_m = results.from_m[known]
    ahead_m = float(np.nanquantile(from_m - front_m[arrived], 0.05))
    preview = PreviewConfig(P_0_m=max(ahead_m, 0.0))
    reached = np.searchsorted(
        np.maximum.accumulate(np.nan_to_num(front_m, nan=-np.inf)), from_m - preview.P_0_m
    )
    rows = np.maximum(arrived, reached)
    frames: Frames = {
        int(row): RoadClass(Surface(int(surface)), float(Q_v))
        for row, surface, Q_v in zip(rows, results.classes[known], results.confidence[known], strict=True)
        if row < len(inputs)
    }
    return CameraSide("class columns of the log", frames, frames, preview, warnings)


def _from_pictures(log: Log, inputs: Inputs, camera: Camera, models: Path, told: Told) -> CameraSide:
    """The pictures, each classified along the left and the right wheels' track."""
    segmenter = Segmenter(models / "segmenter.onnx")
    classifier = SurfaceClassifier(models / "surface.onnx")
    preview = PreviewConfig()
    settings = EstimatorConfig(inputs.vehicle, vision=IfeConfig(camera=camera)).image_settings
    eyes, state = SidesIfe(settings, segmenter, classifier), SidesState()
    frames: tuple[Frames, Frames] = ({}, {})
    unreadable: list[str] = []
    rows, names = _new_pictures(log, inputs)
    for done, (row, name) in enumerate(zip(rows, names, strict=True)):
        try:
            image = decode_image(log.image_folder / name)
            state, *verdicts = eyes.process(state, image, _motion(inputs, row))
            for side, seen in zip(frames, verdicts, strict=True):
                side[row] = RoadClass(seen.surface, seen.told_by_bus(settings.flag_threshold))
        except ImageError as error:
            unreadable.append(str(error))
            frames[0][row] = frames[1][row] = None
        told(done + 1, len(rows))
    if len(unreadable) == len(rows):
        raise LogError(
            f"{log.path}: none of its {len(rows)} pictures can be used, the first: {unreadable[0]}"
        )
    return CameraSide("pictures of the log", *frames, preview, _unreadable(unreadable, len(rows)))


def _new_pictures(log: Log, inputs: Inputs) -> tuple[list[int], list[str]]:
    """Rows of the inputs at which a new picture came, and its name."""
    assert log.image_path is not None
    names = log.image_path
    new = np.flatnonzero((names != "") & (names != np.concatenate(([""], names[:-1]))))
    rows = np.searchsorted(inputs.time_s, log.time_s[new] - 1e-9)
    inside = rows < len(inputs)
    return rows[inside].tolist(), names[new][inside].tolist()


def _motion(inputs: Inputs, row: int) -> Motion:
    """The car's motion when a picture was taken; a lost sample is taken as standing, or as no change."""
    accel = 0.0 if inputs.accel_m_s2 is None else inputs.accel_m_s2[row]
    speed, acceleration = np.nan_to_num([inputs.speed_m_s[row], accel]).tolist()
    way_m, yaw_rate = float(inputs.position_m[row]), float(inputs.yaw_rate_rad_s[row])
    return Motion(
        speed,
        acceleration,
        float(inputs.steering_angle_rad[row]),
        yaw_rate if np.isfinite(yaw_rate) else None,
        way_m if np.isfinite(way_m) else None,
    )


def _unreadable(texts: list[str], pictures: int) -> tuple[str, ...]:
    if not texts:
        return ()
    more = f" (and {len(texts) - MOST_TOLD} more)" if len(texts) > MOST_TOLD else ""
    return (f"{len(texts)} of {pictures} pictures could not be used: {' '.join(texts[:MOST_TOLD])}{more}",)
