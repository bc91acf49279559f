"""The networks behind the camera side: road and shadow masks, surface of patches, surface of a whole picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.errors import TrpacError

from .classes import Surface
from .onnx_runtime import ort, ort_errors
from .picture import LOOK_HEIGHT_PX, LOOK_WIDTH_PX, picture_looks
from .roi_sampling import PATCH_HEIGHT_PX, PATCH_WIDTH_PX
from .scene import SceneHead

MASK_WIDTH_PX = 256
MASK_HEIGHT_PX = 160
HALVED_FROM = 4
"""Times the masks' size from which on a picture is halved first [-]."""
MASKS = ("drivable", "shadow")
VERDICTS = ("logits", "readable")
PICTURE_VERDICTS = ("logits",)
"""Outputs of the networks."""
_ROUNDING = 1e-5
"""By how much the runtime's sigmoid may leave [0, 1]."""

_RUNTIME_ERRORS = (
    ort_errors.Fail,
    ort_errors.InvalidArgument,
    ort_errors.InvalidGraph,
    ort_errors.InvalidProtobuf,
    ort_errors.NoSuchFile,
    ort_errors.NotImplemented,
    ort_errors.RuntimeException,
    UnicodeDecodeError,  # the runtime's own error text, where it quotes damaged names
)
"""Of a damaged file, some as it is loaded and some not before it is run."""
CLASS_LIST = ",".join(surface.label for surface in Surface)


class ModelError(TrpacError):
    """A network file that cannot be used; the text names the file and what was expected."""


@dataclass(frozen=True)
class RoadMasks:
    """Probabilities over the whole picture at the network's resolution, both of shape (160, 256) [-]."""

    drivable: NDArray[np.float32]
    shadow: NDArray[np.float32]


@dataclass(frozen=True)
class PatchVerdicts:
    """What the surface network says of n patches.

    Attributes
    ----------
    logits : float64, shape (n, 3)
        Of dry, wet, snow and ice.
    readable : float64, shape (n,)
        Probability that the patch shows road that can be read at all [-].
    """

    logits: NDArray[np.float64]
    readable: NDArray[np.float64]


class RoadSegmenter(Protocol):
    """Finds drivable road and shadow in a picture."""

    def segment(self, image: NDArray[np.uint8]) -> RoadMasks:
        """Masks of a BGR picture of any size."""
        ...


class PatchClassifier(Protocol):
    """Tells the surface of road patches."""

    @property
    def temperature(self) -> float:
        """T of the temperature scaling [-]."""
        ...

    def verdicts(self, patches: NDArray[np.uint8], scene: NDArray[np.uint8] | None = None) -> PatchVerdicts:
        """What BGR patches (n, 64, 96, 3) show, alone or in the scene that they were cut from, see `scene_of`."""
        ...


def calibrated_probabilities(logits: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Softmax of the logits over the temperature T, shape (n, 3) [-] (section 3.1)."""
    scaled = logits / temperature
    raised = np.exp(scaled - scaled.max(axis=1, keepdims=True))
    return raised / raised.sum(axis=1, keepdims=True)


def reduced(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A BGR picture of any size as the segmenter sees it, shape (160, 256, 3): means over areas.

    Means of four pixels are quick, means over areas with broken edges slow: a large picture is halved before. What that
    changes, a grey level here and there, is much less than the network has learned to bear.
    """
    while image.shape[0] >= HALVED_FROM * MASK_HEIGHT_PX and image.shape[1] >= HALVED_FROM * MASK_WIDTH_PX:
        rows, columns = image.shape[0] // 2, image.shape[1] // 2
        image = cv2.resize(
            image[: 2 * rows, : 2 * columns], (columns, rows), interpolation=cv2.INTER_AREA
        ).astype(np.uint8, copy=False)
    return np.asarray(
        cv2.resize(image, (MASK_WIDTH_PX, MASK_HEIGHT_PX), interpolation=cv2.INTER_AREA), np.uint8
    )


class Segmenter:
    """The multi-task network for drivable road and shadow (section 3.1)."""

    def __init__(self, path: str | Path, threads: int = 2) -> None:
        """Load and check the file; raises ModelError."""
        self._session = _load(path, threads)
        self._path = path
        _check_input(self._session, path, "image", [1, MASK_HEIGHT_PX, MASK_WIDTH_PX, 3])
        _check_outputs(self._session, path, MASKS)

    def segment(self, image: NDArray[np.uint8]) -> RoadMasks:
        """Masks of a BGR picture of any size, reduced by area averaging; raises ModelError if they are none."""
        shape = (MASK_HEIGHT_PX, MASK_WIDTH_PX)
        masks = _run(self._session, self._path, MASKS, {"image": reduced(image)[None]})
        for name, mask in zip(MASKS, masks, strict=True):
            if mask.size != MASK_HEIGHT_PX * MASK_WIDTH_PX or not np.isfinite(mask).all():
                raise ModelError(
                    f"{self._path}: expected {name!r} finite and of {MASK_HEIGHT_PX} x {MASK_WIDTH_PX}, got shape "
                    f"{mask.shape}. Export or train the network again."
                )
        drivable, shadow = (mask.reshape(shape) for mask in masks)
        return RoadMasks(drivable, shadow)


class SurfaceClassifier:
    """The patch classifier for dry, wet, snow and ice, with its calibration (section 3.1)."""

    def __init__(self, path: str | Path, threads: int = 2) -> None:
        """Load and check the file; raises ModelError."""
        self._session = _load(path, threads)
        self._path = path
        _check_input(self._session, path, "patches", [None, PATCH_HEIGHT_PX, PATCH_WIDTH_PX, 3])
        _check_outputs(self._session, path, VERDICTS)
        self._temperature = _read_temperature(self._session, path)
        self._head = _read_scene_head(self._session, path)

    @property
    def temperature(self) -> float:
        """T of the temperature scaling [-]."""
        return self._temperature

    @property
    def scene_head(self) -> SceneHead | None:
        """What a scene adds to the logits; None where the file knows patches alone."""
        return self._head

    def verdicts(self, patches: NDArray[np.uint8], scene: NDArray[np.uint8] | None = None) -> PatchVerdicts:
        """Verdicts on BGR patches in one run; raises ModelError if they are not finite.

        Parameters
        ----------
        patches : uint8, shape (n, 64, 96, 3)
            BGR.
        scene : uint8, shape (20, 32, 3) or (n, 20, 32, 3), optional
            The picture that they were cut from, or the picture of each, by `scene_of`; None judges patches alone.
        """
        logits, readable = _run(self._session, self._path, VERDICTS, {"patches": patches})
        _check_logits(logits, len(patches), self._path)
        if readable.shape != (len(patches),) or not (np.abs(readable - 0.5) <= 0.5 + _ROUNDING).all():
            raise ModelError(
                f"{self._path}: expected 'readable' of shape {(len(patches),)} within [0, 1], got shape "
                f"{readable.shape}. Export or train the network again."
            )
        seen = logits.astype(np.float64)
        if scene is not None and self._head is not None:
            seen = seen + self._head.logits(patches, scene)
        return PatchVerdicts(seen, readable.astype(np.float64).clip(0.0, 1.0))


class PictureClassifier:
    """The classifier of a picture as a whole, for stills: it goes with the surface classifier of the same training."""

    def __init__(self, path: str | Path, threads: int = 2) -> None:
        """Load and check the file; raises ModelError."""
        self._session = _load(path, threads)
        self._path = path
        _check_input(self._session, path, "looks", [None, LOOK_HEIGHT_PX, LOOK_WIDTH_PX, 3])
        _check_outputs(self._session, path, PICTURE_VERDICTS)
        self._temperature = _read_temperature(self._session, path)

    @property
    def temperature(self) -> float:
        """T of the temperature scaling, learned beside the log probabilities of the patches [-]."""
        return self._temperature

    def logits(self, image: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Mean logits of the looks at a BGR picture, shape (3,); raises ModelError if they are not finite."""
        looks = picture_looks(image)
        (logits,) = _run(self._session, self._path, PICTURE_VERDICTS, {"looks": looks})
        _check_logits(logits, len(looks), self._path)
        return np.asarray(logits.mean(axis=0, dtype=np.float64))


def _load(path: str | Path, threads: int) -> ort.InferenceSession:
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Idle threads must not spin: the host simulation needs the cores between two frames.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    if not Path(path).is_file():
        raise ModelError(
            f"{path}: no such network file. Expected an ONNX file; train it or correct the path."
        )
    try:
        return ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except _RUNTIME_ERRORS as error:
        raise ModelError(
            f"{path}: not an ONNX network that this version of onnxruntime runs: {error}"
        ) from error


def _run(
    session: ort.InferenceSession,
    path: str | Path,
    outputs: tuple[str, ...],
    inputs: dict[str, NDArray[Any]],
) -> list[NDArray[np.float32]]:
    """The outputs; ModelError where a file that could be loaded cannot be run."""
    try:
        found: list[NDArray[np.float32]] = session.run(list(outputs), inputs)
    except _RUNTIME_ERRORS as error:
        raise ModelError(
            f"{path}: a damaged network, it cannot be run: {error}. Export or train the network again."
        ) from error
    return found


def _check_input(session: ort.InferenceSession, path: str | Path, name: str, shape: list[int | None]) -> None:
    wanted = f"one input '{name}' of type tensor(uint8) and shape {['n' if n is None else n for n in shape]}"
    inputs = session.get_inputs()
    found = ", ".join(f"'{i.name}' {i.type} {i.shape}" for i in inputs)
    fits = (
        len(inputs) == 1
        and inputs[0].name == name
        and inputs[0].type == "tensor(uint8)"
        and len(inputs[0].shape) == len(shape)
        and all(
            not isinstance(got, int) if want is None else got == want
            for got, want in zip(inputs[0].shape, shape, strict=True)
        )
    )
    if not fits:
        raise ModelError(f"{path}: expected {wanted}; found {found}. Is it another network's file?")


def _check_logits(logits: NDArray[np.float32], count: int, path: str | Path) -> None:
    if logits.shape != (count, len(Surface)) or not np.isfinite(logits).all():
        raise ModelError(
            f"{path}: expected finite logits of shape {(count, len(Surface))}, got shape {logits.shape}. Export or "
            "train the network again."
        )


def _check_outputs(session: ort.InferenceSession, path: str | Path, names: tuple[str, ...]) -> None:
    found = {output.name: output.type for output in session.get_outputs()}
    if any(found.get(name) != "tensor(float)" for name in names):
        raise ModelError(f"{path}: expected outputs {list(names)} of type tensor(float); found {found}.")


def _read_temperature(session: ort.InferenceSession, path: str | Path) -> float:
    metadata = session.get_modelmeta().custom_metadata_map
    text, classes = metadata.get("temperature"), metadata.get("classes")
    try:
        temperature = float(text) if text is not None else np.nan
    except ValueError:
        temperature = np.nan
    problems = []
    if not (np.isfinite(temperature) and temperature > 0.0):
        problems.append(f"'temperature' must be a decimal number above 0, is {text!r}")
    if classes != CLASS_LIST:
        problems.append(f"'classes' must be {CLASS_LIST!r}, is {classes!r}")
    if problems:
        raise ModelError(
            f"{path}: wrong metadata: {'; '.join(problems)}. Export the network with its calibration."
        )
    return temperature


def _read_scene_head(session: ort.InferenceSession, path: str | Path) -> SceneHead | None:
    """The head of a file that holds one."""
    text = session.get_modelmeta().custom_metadata_map.get("scene")
    if text is None:
        return None
    try:
        return SceneHead.from_text(text)
    except ValueError as error:
        raise ModelError(
            f"{path}: wrong metadata 'scene': {error}. Export the network with its calibration."
        ) from error
