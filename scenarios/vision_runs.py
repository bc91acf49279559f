"""The camera side alone: the image estimator over a folder of frames or a video."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.camera.files import load_camera
from scenarios.errors import ScenarioError
from scenarios.library import networks_folder
from scenarios.overlay_video import OverlayVideo, Strip, dark, shown
from scenarios.progress import Progress, silent
from scenarios.stills import PICTURE_ENDINGS, cell_of, pictures_in
from scenarios.whole_files import written_whole
from trpac_core.files import FileError, file_sha256, quoted, require_file
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError, check_size, decode_image
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.trajectory import Motion
from trpac_core.vision.voting import Voting, VotingConfig

FRAME_COLUMNS = ("frame", "class", "P_fusion", "p_util", "Q_v", "flag", "voting_class", "ms")
CONTAINERS = (
    "mov",
    "avi",
    "matroska",
    "mpegts",
    "mpeg",
    "flv",
    "h264",
    "hevc",
    "mjpeg",
    "mpegvideo",
    "asf",
    "ogg",
)
"""FFmpeg's names of the formats that are read: those that contain pictures, not lists of other files or addresses."""
MOST_VIDEO_BYTES = 100_000_000_000
"""Larger videos are refused [bytes]."""
LOWEST_FPS, HIGHEST_FPS = 0.01, 1000.0
"""Range of frame rates [1/s]."""
FASTEST_M_S = 150.0
"""Greatest speed [m/s]."""
PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "trpac-fmu")
WRITTEN = FRAMES_CSV, SUMMARY, VIDEO, STRIP = "frames.csv", "summary.json", "annotated.mp4", "strip.jpg"


@dataclass(frozen=True)
class Frames:
    """A folder of pictures, or a video, frame by frame.

    Attributes
    ----------
    path : Path
        The folder or the video.
    files : tuple of Path
        Pictures in their order; empty for a video.
    count : int
        Number of frames; of a video that in its header, which may be wrong or 0.
    bits : int or None
        How many bits pictures of 16 use, see `trpac_core.vision.images.eight_bits`.
    """

    path: Path
    files: tuple[Path, ...]
    count: int
    bits: int | None = None

    @classmethod
    def find(cls, path: Path, bits: int | None = None) -> Frames:
        """The frames at a path; raises ScenarioError."""
        if path.is_dir():
            files = tuple(pictures_in(path))
            if not files:
                raise ScenarioError(
                    f"{path}: no pictures in this folder. Expected JPEG or PNG files, one per frame."
                )
            return cls(path, files, len(files), bits)
        if path.suffix.lower() in PICTURE_ENDINGS:
            raise ScenarioError(
                f"{path}: a single picture. Expected a folder of frames or a video; for single pictures: "
                "trpac vision classify"
            )
        capture = _open_video(path)
        announced = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        return cls(path, (), max(announced, 0))

    def __iter__(self) -> Iterator[tuple[str, NDArray[np.uint8] | ImageError]]:
        """Name of each frame (file name, or number in the video), with its picture or the error of reading it."""
        if self.files:
            for file in self.files:
                try:
                    yield cell_of(file.name), decode_image(file, bits=self.bits)
                except ImageError as error:
                    yield cell_of(file.name), error
            return
        capture = _open_video(self.path)
        try:
            number, (read, image) = 0, capture.read()
            while read:
                check_size(image.shape[1], image.shape[0], f"{quoted(self.path)}, frame {number}")
                yield f"{number:06d}", image.astype(np.uint8, copy=False)
                number, (read, image) = number + 1, capture.read()
        finally:
            capture.release()


def _open_video(path: Path) -> cv2.VideoCapture:
    # Messages of decoder and OpenCV are suppressed; an error is raised here instead.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = f"format_whitelist;{','.join(CONTAINERS)}"
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        require_file(path, MOST_VIDEO_BYTES, "a folder of frames or a video file")
    except FileError as error:
        raise ScenarioError(str(error)) from error
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    cv2.utils.logging.setLogLevel(level)
    if not capture.isOpened():
        raise ScenarioError(
            f"{path}: not a video that can be decoded. Convert it to MP4, or to a folder of pictures."
        )
    # The camera file describes the pixels as stored, as for pictures.
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return capture


@dataclass(frozen=True)
class Drive:
    """A finished run over frames: table, content of summary.json, and folder of the four files."""

    table: pd.DataFrame
    summary: dict[str, Any]
    out: Path


def run_frames(
    frames: Frames, camera_file: Path, speed_m_s: float, fps: float, out: Path, progress: Progress = silent
) -> Drive:
    """Results of the image estimator and the voting baseline over frames at a constant speed.

    Parameters
    ----------
    frames : Frames
        Pictures or video.
    camera_file : Path
        camera.yaml.
    speed_m_s, fps : float
        Speed of the car [m/s]; frames per second.
    out : Path
        Folder for frames.csv, annotated.mp4, strip.jpg and summary.json, which appear together at the end.
    progress : callable
        Called with how many of how many frames are done.

    Raises
    ------
    ScenarioError
        If the camera file is wrong, speed or rate are out of range, or no frame could be used.
    ModelError
        If a network file cannot be used.
    OSError
        If the folder cannot be written.
    """
    _check_numbers(speed_m_s, fps)
    if os.path.realpath(frames.path) in map(os.path.realpath, (out, *(out / name for name in WRITTEN))):
        raise ScenarioError(
            f"{out}: holds the frames. Expected another folder: the run would write among them, or over them."
        )
    if folders := [name for name in WRITTEN if (out / name).is_dir()]:
        raise ScenarioError(f"{out / folders[0]}: a folder. Expected none: a file of that name is written.")
    camera = load_camera(camera_file)
    segmenter, classifier = (
        Segmenter(networks_folder() / "segmenter.onnx"),
        SurfaceClassifier(networks_folder() / "surface.onnx"),
    )
    estimators = _Estimators(
        segmenter,
        Ife(IfeConfig(camera=camera), segmenter, classifier),
        Voting(VotingConfig(camera=camera), segmenter, classifier),
        speed_m_s / fps,
        Motion(speed_m_s),
    )
    with written_whole(out) as scratch:
        video, strip = OverlayVideo(scratch / VIDEO, camera, fps), Strip()
        rows, unreadable = [], []
        for number, (name, image) in enumerate(frames):
            caption = f"{name}  {number / fps:.2f} s"
            try:
                row, shown = estimators.process(number, name, image, caption)
            except ImageError as error:
                unreadable.append({"frame": name, "reason": str(error)})
                row, shown = (name, "", None, None, None, 0, "", None), dark(video.size, caption)
            rows.append(row)
            video.add(shown)
            strip.add(shown)
            progress(number + 1, max(frames.count, number + 1))
        table = pd.DataFrame(rows, columns=list(FRAME_COLUMNS))
        if len(unreadable) == len(rows):
            raise ScenarioError(_nothing_usable(frames, unreadable))
        summary = _summary(table, unreadable, frames, camera_file, speed_m_s, fps, video.finish())
        strip.write(scratch / STRIP)
        table.to_csv(scratch / FRAMES_CSV, index=False, float_format="%.6g")
        (scratch / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        if not (scratch / VIDEO).exists():
            (out / VIDEO).unlink(missing_ok=True)  # of an earlier run
    return Drive(table, summary, out)


def _check_numbers(speed_m_s: float, fps: float) -> None:
    problems = []
    if not 0.0 <= speed_m_s <= FASTEST_M_S:
        problems.append(f"speed {speed_m_s:g} m/s; expected 0 to {FASTEST_M_S:g}")
    if not LOWEST_FPS <= fps <= HIGHEST_FPS:
        problems.append(f"{fps:g} frames per second; expected {LOWEST_FPS:g} to {HIGHEST_FPS:g}")
    if problems:
        raise ScenarioError(f"Motion: {'; '.join(problems)}.")


def _nothing_usable(frames: Frames, unreadable: Sequence[dict[str, str]]) -> str:
    if not unreadable:
        return (
            f"{frames.path}: not one frame could be decoded. Convert it to MP4, or to a folder of pictures."
        )
    return (
        f"{frames.path}: none of {len(unreadable)} frames could be used. The first: {unreadable[0]['reason']}"
    )


class _Estimators:
    """Both estimators over successive frames, with the state of the image estimator."""

    def __init__(self, segmenter: Segmenter, ife: Ife, voting: Voting, step_m: float, motion: Motion) -> None:
        self._segmenter, self._ife, self._voting = segmenter, ife, voting
        self._step_m, self._motion = step_m, motion
        self._state = IfeState()

    def process(
        self, number: int, name: str, image: NDArray[np.uint8] | ImageError, caption: str
    ) -> tuple[tuple[Any, ...], NDArray[np.uint8]]:
        """Row of the table and annotated picture; where ImageError is raised the state is unchanged."""
        if isinstance(image, ImageError):
            raise image
        if not self._state.frame_count:
            # The networks' first run allocates memory, so its time is not representative.
            self._ife.process(self._state, image, self._motion)
        motion = replace(self._motion, way_m=number * self._step_m)
        start = time.perf_counter()
        masks = self._segmenter.segment(image)
        after, result = self._ife.process(self._state, image, motion, masks=masks, with_view=True)
        ms = 1e3 * (time.perf_counter() - start)
        vote = self._voting.process(self._state.frame_count, image, masks=masks)
        self._state = after
        voted = "" if vote.surface is None else vote.surface.label
        found = (result.surface.label, result.P_fusion, result.p_util, result.Q_v, int(result.flag))
        return (name, *found, voted, ms), shown(image, result, f"{caption}  voting: {voted or 'no road'}")


def _summary(
    table: pd.DataFrame,
    unreadable: Sequence[dict[str, str]],
    frames: Frames,
    camera_file: Path,
    speed_m_s: float,
    fps: float,
    video: bool,
) -> dict[str, Any]:
    """The content of summary.json; shares are of the frames that could be used."""
    seen = table[table["class"] != ""]
    return {
        "frames": len(table),
        "frames_announced": frames.count,
        "unreadable": list(unreadable),
        "class_share": {s.label: float((seen["class"] == s.label).mean()) for s in Surface},
        "voting_class_share": {s.label: float((seen["voting_class"] == s.label).mean()) for s in Surface},
        "flag_share": float(seen["flag"].mean()),
        "ms_median": float(seen["ms"].median()),
        "ms_p99": float(np.percentile(seen["ms"].astype(float), 99.0)),
        "speed_m_s": speed_m_s,
        "fps": fps,
        "source": str(frames.path),
        "camera": str(camera_file),
        "annotated": VIDEO if video else None,
        "strip": STRIP,
        "versions": {package: version(package) for package in PACKAGES},
        "model_sha256": {
            file: file_sha256(networks_folder() / file) for file in ("segmenter.onnx", "surface.onnx")
        },
    }
