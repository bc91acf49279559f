"""The camera side alone: the surface of single road pictures, and the image estimator over a folder or a video."""

from __future__ import annotations

import json
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fmu_src.packaging import sha256
from scenarios.camera.files import load_camera
from scenarios.errors import ScenarioError
from scenarios.looks import MODELS, annotate
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import LEAST_CONTRAST, Ife, IfeConfig, IfeState, usable_road
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import RoadMasks, Segmenter, SurfaceClassifier, calibrated_probabilities
from trpac_core.vision.regions import LEAST_ROI_WIDTH_PX, ROI_ASPECT, cut_patch, roi_box
from trpac_core.vision.results import FrameResult
from trpac_core.vision.trajectory import Motion
from trpac_core.vision.voting import Voting, VotingConfig

CLASSIFY_COLUMNS = ("file", "class", "confidence", "p_dry", "p_wet", "p_snow_ice")
FRAME_COLUMNS = ("frame", "class", "P_fusion", "p_util", "Q_v", "flag", "voting_class", "ms")
PICTURE_ENDINGS = frozenset((".jpg", ".jpeg", ".png", ".bmp", ".gif", ".heic", ".tif", ".tiff", ".webp"))
"""Files of a folder that count as pictures: those of unsupported formats are reported, not passed over."""

LOWER_CENTRE = (0.20, 0.60, 0.80, 0.95)
"""Where road is in the picture of a camera of which nothing is known: left, top, right, bottom [of its size]."""
PATCH_SCALES = (1.0, 0.55, 0.3)
"""Patch widths, of the largest that the lower centre holds [-]."""
MOST_PER_AXIS = 6
"""Patches of one width side by side, or one above the other."""
LEAST_USABLE = 0.8
"""Share of a patch that must be road out of the shadow [-]."""
LEAST_PATCHES = 4
"""With fewer patches on usable road, all of the lower centre's are taken."""
_LEAST_PROBABILITY = 1e-12

CANVAS_PX, FILM_PX, STRIP_TILE_PX = 1920, 960, 480
STRIP_TILES, STRIP_COLUMNS = 12, 3
HIGHEST_FPS = 1000.0
PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "trpac-fmu")
FRAMES_CSV, SUMMARY, FILM, STRIP = "frames.csv", "summary.json", "annotated.mp4", "strip.jpg"

Progress = Callable[[int, int], None]
"""Told how much of how much is done."""


def _silent(done: int, total: int) -> None:
    """Progress that nobody follows."""


# --- single pictures ---------------------------------------------------------------------------------------


def find_pictures(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Picture files named or lying in named folders, numbers in names in their order, each once; and problems."""
    found: dict[Path, None] = {}
    problems = []
    for path in paths:
        inside = _pictures_in(path) if path.is_dir() else [path]
        if not inside:
            problems.append(
                f"{path}: no pictures in this folder. Expected JPEG or PNG files; name subfolders too."
            )
        found.update(dict.fromkeys(inside))
    return list(found), problems


def _pictures_in(folder: Path) -> list[Path]:
    files = (
        p for p in folder.iterdir() if p.suffix.lower() in PICTURE_ENDINGS and not p.name.startswith(".")
    )
    return sorted((p for p in files if p.is_file()), key=_counting_order)


def _counting_order(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """Sorting key in which frame_2 comes before frame_10."""
    parts = re.findall(r"(\d+)|(\D+)", path.name)
    return [(0, int(digits), "") if digits else (1, 0, text) for digits, text in parts], path.name


def classify_pictures(files: Sequence[Path], progress: Progress = _silent) -> tuple[pd.DataFrame, list[str]]:
    """Surface of each picture, of any camera.

    Parameters
    ----------
    files : sequence of Path
        JPEG or PNG.
    progress : callable
        Told how many pictures are done.

    Returns
    -------
    DataFrame, list of str
        Columns `CLASSIFY_COLUMNS`, one row per picture that could be judged; one sentence per other picture.

    Raises
    ------
    ModelError
        If a network file cannot be used.
    """
    segmenter, classifier = Segmenter(MODELS / "segmenter.onnx"), SurfaceClassifier(MODELS / "surface.onnx")
    rows, problems = [], []
    for done, file in enumerate(files, start=1):
        try:
            image = _upright(file)
            probabilities = picture_probabilities(image, segmenter.segment(image), classifier, str(file))
            surface = Surface(int(probabilities.argmax()))
            rows.append((str(file), surface.label, float(probabilities.max()), *probabilities.tolist()))
        except ImageError as error:
            problems.append(str(error))
        progress(done, len(files))
    return pd.DataFrame(rows, columns=list(CLASSIFY_COLUMNS)), problems


def picture_probabilities(
    image: NDArray[np.uint8], masks: RoadMasks, classifier: SurfaceClassifier, name: str = "image"
) -> NDArray[np.float64]:
    """Probabilities of dry, wet, snow and ice of one picture, shape (3,) [-].

    The mean log probability of its patches, normalised: patches of one picture share light, camera and road, so they
    are not the independent bodies of evidence that Dempster's rule would multiply to near-certainty.

    Raises ImageError where the lower centre shows nothing at all: a covered, blinded or dark camera.
    """
    height, width = image.shape[:2]
    boxes = _patch_places(width, height)
    usable = usable_road(masks, remove_shadow=True)
    share = np.array(
        [_usable_share(usable, roi_box(width, height, at[:2], at[2]), width, height) for at in boxes]
    )
    on_road = boxes[share >= LEAST_USABLE]
    for places in (on_road, boxes):
        cut = [cut_patch(image, place[:2], place[2]) for place in places]
        patches = [patch for patch in cut if patch.std(axis=(0, 1)).max() >= LEAST_CONTRAST]
        if len(patches) >= LEAST_PATCHES:
            break
    if not patches:
        raise ImageError(
            f"{name}: one even colour where the road should be. Is the lens covered, or the picture dark?"
        )
    probabilities = calibrated_probabilities(classifier.logits(np.stack(patches)), classifier.temperature)
    logs = np.log(np.maximum(probabilities, _LEAST_PROBABILITY)).mean(axis=0)
    raised = np.exp(logs - logs.max())
    return raised / raised.sum()


def _upright(file: Path) -> NDArray[np.uint8]:
    """The picture as a viewer shows it; raises ImageError. A turn noted by a telephone would move the road."""
    image = decode_image(file)
    data = file.read_bytes()
    if b"Exif\0" not in data[:65536] and b"eXIf" not in data:
        return image
    turned = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_BGR)
    return image if turned is None else turned.astype(np.uint8, copy=False)


def _patch_places(width_px: int, height_px: int) -> NDArray[np.float64]:
    """Patches that cover the lower centre in three sizes: column, row and width of each, shape (n, 3) [px]."""
    left, top, right, bottom = np.array(LOWER_CENTRE) * [width_px, height_px, width_px, height_px]
    largest = min(right - left, ROI_ASPECT * (bottom - top))
    places = []
    for scale in PATCH_SCALES:
        width = scale * largest
        if scale == PATCH_SCALES[0] or width >= LEAST_ROI_WIDTH_PX:
            columns = _spread(left, right, width)
            places += [(x, y, width) for x in columns for y in _spread(top, bottom, width / ROI_ASPECT)]
    return np.array(places)


def _spread(low: float, high: float, length: float) -> NDArray[np.float64]:
    """Centres of pieces of a length that overlap by two fifths and fill the stretch from low to high."""
    count = min(MOST_PER_AXIS, 1 + round((high - low - length) / (0.6 * length)))
    if count == 1:
        return np.array([(low + high) / 2.0])
    return np.linspace(low + length / 2.0, high - length / 2.0, count)


def _usable_share(
    usable: NDArray[np.bool_], box: tuple[int, int, int, int], width_px: int, height_px: int
) -> float:
    """Share of a patch that is usable road [-], from the mask of the whole picture."""
    rows, columns = usable.shape
    left, right = box[0] * columns // width_px, -(-box[2] * columns // width_px)
    top, bottom = box[1] * rows // height_px, -(-box[3] * rows // height_px)
    return float(usable[top:bottom, left:right].mean())


def write_classes(table: pd.DataFrame, out: Path) -> None:
    """Write the table of `classify_pictures`, whole or not at all; raises OSError."""
    with _scratch_for(out.parent) as scratch:
        table.to_csv(scratch / out.name, index=False, float_format="%.6f")
        out.parent.mkdir(parents=True, exist_ok=True)
        (scratch / out.name).replace(out)


@contextmanager
def _scratch_for(folder: Path) -> Iterator[Path]:
    """A passing folder on the file system that a folder lies on, or will lie on, so that moving is at once."""
    whole = folder.absolute()
    nearest = next(place for place in (whole, *whole.parents) if place.exists())
    with tempfile.TemporaryDirectory(dir=nearest, prefix=".trpac_") as scratch:
        yield Path(scratch)


# --- frames ------------------------------------------------------------------------------------------------


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
        Number of frames; of a video as announced, which may be wrong or 0.
    """

    path: Path
    files: tuple[Path, ...]
    count: int

    @classmethod
    def find(cls, path: Path) -> Frames:
        """Look what is there; raises ScenarioError."""
        if path.is_dir():
            files = tuple(_pictures_in(path))
            if not files:
                raise ScenarioError(
                    f"{path}: no pictures in this folder. Expected JPEG or PNG files, one per frame."
                )
            return cls(path, files, len(files))
        if not path.is_file():
            raise ScenarioError(
                f"{path}: no such folder or video. Expected a folder of frames or a video file."
            )
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
        """Name of each frame (file name, or number in the video) with the picture or what is wrong with it."""
        if self.files:
            for file in self.files:
                try:
                    yield file.name, decode_image(file)
                except ImageError as error:
                    yield file.name, error
            return
        capture = _open_video(self.path)
        try:
            number, (read, image) = 0, capture.read()
            while read:
                yield f"{number:06d}", image.astype(np.uint8, copy=False)
                number, (read, image) = number + 1, capture.read()
        finally:
            capture.release()


def _open_video(path: Path) -> cv2.VideoCapture:
    # The decoder and OpenCV would print their own complaints; one clear error is raised here instead.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    cv2.utils.logging.setLogLevel(level)
    if not capture.isOpened():
        raise ScenarioError(
            f"{path}: not a video that can be decoded. Convert it to MP4, or to a folder of pictures."
        )
    return capture


@dataclass(frozen=True)
class Drive:
    """A finished run over frames: the table, what summary.json holds, and the folder with all four files."""

    table: pd.DataFrame
    summary: dict[str, Any]
    out: Path


def run_frames(
    frames: Frames, camera_file: Path, speed_m_s: float, fps: float, out: Path, progress: Progress = _silent
) -> Drive:
    """Image estimator, with its memory, and voting baseline over frames taken at a constant speed.

    Parameters
    ----------
    frames : Frames
        What the camera saw.
    camera_file : Path
        camera.yaml.
    speed_m_s, fps : float
        Speed of the car, at least 0 [m/s]; frames per second, above 0.
    out : Path
        Folder for frames.csv, annotated.mp4, strip.jpg and summary.json, which appear together at the end.
    progress : callable
        Told how many frames are done.

    Raises
    ------
    ScenarioError
        If the camera file is wrong, the numbers make no sense, or no frame at all could be used.
    ModelError
        If a network file cannot be used.
    OSError
        If the folder cannot be written.
    """
    _check_numbers(speed_m_s, fps)
    if out.resolve() == frames.path.resolve():
        raise ScenarioError(
            f"{out}: holds the frames. Expected another folder: the next run would take the strip for one."
        )
    camera = load_camera(camera_file)
    segmenter, classifier = Segmenter(MODELS / "segmenter.onnx"), SurfaceClassifier(MODELS / "surface.onnx")
    watcher = _Watcher(
        segmenter,
        Ife(IfeConfig(camera=camera), segmenter, classifier),
        Voting(VotingConfig(camera=camera), segmenter, classifier),
        Motion(speed_m_s),
    )
    with _scratch_for(out) as scratch:
        film, strip = _Film(scratch / FILM, camera, fps), _Strip()
        rows, unreadable = [], []
        for number, (name, image) in enumerate(frames):
            caption = f"{name}  {number / fps:.2f} s"
            try:
                row, shown = watcher.look(name, image, caption)
            except ImageError as error:
                unreadable.append({"frame": name, "reason": str(error)})
                row, shown = (name, "", None, None, None, 0, "", None), _dark(film.size, caption)
            rows.append(row)
            film.add(shown)
            strip.add(shown)
            progress(number + 1, max(frames.count, number + 1))
        table = pd.DataFrame(rows, columns=list(FRAME_COLUMNS))
        if len(unreadable) == len(rows):
            raise ScenarioError(_nothing_usable(frames, unreadable))
        summary = _summary(table, unreadable, frames, camera_file, speed_m_s, fps, film.finish())
        strip.write(scratch / STRIP)
        table.to_csv(scratch / FRAMES_CSV, index=False, float_format="%.6g")
        (scratch / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        _publish(scratch, out)
    return Drive(table, summary, out)


def _check_numbers(speed_m_s: float, fps: float) -> None:
    problems = []
    if not (np.isfinite(speed_m_s) and speed_m_s >= 0.0):
        problems.append(f"speed {speed_m_s:g} m/s; expected a number of at least 0")
    if not (np.isfinite(fps) and 0.0 < fps <= HIGHEST_FPS):
        problems.append(f"{fps:g} frames per second; expected a number above 0 and at most {HIGHEST_FPS:g}")
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


class _Watcher:
    """Both estimators over successive frames; the memory of the image estimator lies here."""

    def __init__(self, segmenter: Segmenter, ife: Ife, voting: Voting, motion: Motion) -> None:
        self._segmenter, self._ife, self._voting, self._motion = segmenter, ife, voting, motion
        self._state = IfeState()

    def look(
        self, name: str, image: NDArray[np.uint8] | ImageError, caption: str
    ) -> tuple[tuple[Any, ...], NDArray[np.uint8]]:
        """Row of the table and annotated picture; raises ImageError, and then nothing is remembered."""
        if isinstance(image, ImageError):
            raise image
        if not self._state.frame_count:
            # The networks' first run sets up their memory: it says nothing of a frame's time.
            self._ife.process(self._state, image, self._motion)
        start = time.perf_counter()
        masks = self._segmenter.segment(image)
        after, result = self._ife.process(self._state, image, self._motion, masks=masks, with_view=True)
        ms = 1e3 * (time.perf_counter() - start)
        vote = self._voting.process(self._state.frame_count, image, masks=masks)
        self._state = after
        voted = "" if vote.surface is None else vote.surface.label
        verdict = (result.surface.label, result.P_fusion, result.p_util, result.Q_v, int(result.flag))
        return (name, *verdict, voted, ms), _shown(image, result, f"{caption}  voting: {voted or 'no road'}")


def _summary(
    table: pd.DataFrame,
    unreadable: Sequence[dict[str, str]],
    frames: Frames,
    camera_file: Path,
    speed_m_s: float,
    fps: float,
    film: bool,
) -> dict[str, Any]:
    """What a run found, and what is needed to repeat it; shares are of the frames that could be used."""
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
        "annotated": FILM if film else None,
        "strip": STRIP,
        "versions": {package: version(package) for package in PACKAGES},
        "model_sha256": {file: sha256(MODELS / file) for file in ("segmenter.onnx", "surface.onnx")},
    }


def _publish(scratch: Path, out: Path) -> None:
    """Move the finished files into the folder; a film of an earlier run goes where this one has none."""
    out.mkdir(parents=True, exist_ok=True)
    if not (scratch / FILM).exists():
        (out / FILM).unlink(missing_ok=True)
    for file in sorted(scratch.iterdir()):
        file.replace(out / file.name)


# --- pictures of a run -------------------------------------------------------------------------------------


def _shown(image: NDArray[np.uint8], result: FrameResult, caption: str) -> NDArray[np.uint8]:
    """The annotated frame at the film's width, lettering of one size whatever the camera."""
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
        result = replace(result, view=replace(result.view, groups=groups))
    return _at_width(annotate(image, result, caption), FILM_PX)


def _at_width(image: NDArray[np.uint8], width_px: int) -> NDArray[np.uint8]:
    """The picture at a width."""
    height_px = _even_height(width_px, image.shape[1], image.shape[0])
    if image.shape[:2] == (height_px, width_px):
        return image
    how = cv2.INTER_AREA if width_px < image.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(image, (width_px, height_px), interpolation=how).astype(np.uint8, copy=False)


def _even_height(width_px: int, from_width_px: int, from_height_px: int) -> int:
    """Height at another width, even as encoders want it [px]."""
    return max(2, 2 * round(width_px * from_height_px / from_width_px / 2.0))


def _dark(size: tuple[int, int], caption: str) -> NDArray[np.uint8]:
    """What stands for a frame that could not be used."""
    shown = np.full((size[1], size[0], 3), 40, dtype=np.uint8)
    for row, text in enumerate((caption, "frame not usable")):
        place = (12, 30 + 32 * row)
        cv2.putText(shown, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 2, cv2.LINE_AA)
    return shown


class _Film:
    """annotated.mp4, begun with the first frame; every frame is fitted to the camera's shape."""

    def __init__(self, path: Path, camera: Camera, fps: float) -> None:
        self._path, self._fps = path, fps
        self.size = (FILM_PX, _even_height(FILM_PX, camera.width_px, camera.height_px))
        self._writer: cv2.VideoWriter | None = None
        self._count = 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """One more frame."""
        if self._writer is None:
            self._writer = cv2.VideoWriter(
                str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._fps, self.size
            )
        if self._writer.isOpened():
            fits = (image.shape[1], image.shape[0]) == self.size
            self._writer.write(image if fits else cv2.resize(image, self.size, interpolation=cv2.INTER_AREA))
            self._count += 1

    def finish(self) -> bool:
        """Close; False where this machine has no encoder; raises OSError where the film is not whole."""
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


class _Strip:
    """strip.jpg: frames evenly spread over a run whose length need not be known."""

    def __init__(self) -> None:
        self._tiles: list[NDArray[np.uint8]] = []
        self._stride, self._seen = 1, 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """One more frame; every second one kept so far goes whenever too many are kept."""
        if self._seen % self._stride == 0:
            self._tiles.append(_at_width(image, STRIP_TILE_PX))
            if len(self._tiles) > 2 * STRIP_TILES:
                self._tiles, self._stride = self._tiles[::2], 2 * self._stride
        self._seen += 1

    def write(self, path: Path) -> None:
        """Write the sheet; raises OSError."""
        places = np.linspace(0, len(self._tiles) - 1, min(STRIP_TILES, len(self._tiles))).round().astype(int)
        tiles = [self._tiles[place] for place in places]
        height = max(tile.shape[0] for tile in tiles)
        columns = min(STRIP_COLUMNS, len(tiles))
        sheet = np.full((-(-len(tiles) // columns) * height, columns * STRIP_TILE_PX, 3), 40, dtype=np.uint8)
        for place, tile in enumerate(tiles):
            top, left = place // columns * height, place % columns * STRIP_TILE_PX
            sheet[top : top + tile.shape[0], left : left + STRIP_TILE_PX] = tile
        if not cv2.imwrite(str(path), sheet, [cv2.IMWRITE_JPEG_QUALITY, 88]):
            raise OSError(f"{path.name}: the strip could not be written; is the disk full?")
