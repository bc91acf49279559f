"""The networks of the camera side: road masks and surface of a picture, and surface of patches."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.errors import TrpacError

from .classes import Surface
from .onnx_runtime import ort, ort_errors
from .roi_sampling import PATCH_HEIGHT_PX, PATCH_WIDTH_PX

MASK_WIDTH_PX = 256
MASK_HEIGHT_PX = 160
HALVED_FROM = 4
"""Times the masks' size from which on a picture is halved first [-]."""
MASKS = ("drivable", "shadow")
VERDICTS = ("logits", "readable")
"""Outputs of the networks; the segmenter's further one is SURFACE."""
SURFACE = "surface"
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
    """Masks of the road in a picture, and surface logits of the whole picture.

    Attributes
    ----------
    drivable, shadow : float32, shape (160, 256)
        Probabilities at the network's resolution [-].
    surface : float64, shape (3,)
        Logits of dry, wet, snow and ice of the road in its surroundings; equal where nothing is known.
    """

    drivable: NDArray[np.float32]
    shadow: NDArray[np.float32]
    surface: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(Surface)))


@dataclass(frozen=True)
class PatchVerdicts:
    """Output of the surface network for n patches.

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
    """Computes masks of drivable road and shadow, and the surface logits of the whole picture."""

    def segment(self, image: NDArray[np.uint8]) -> RoadMasks:
        """Masks and surface of a BGR picture of any size."""
        ...


class PatchClassifier(Protocol):
    """Classifies the surface of road patches."""

    @property
    def temperature(self) -> float:
        """T of the temperature scaling [-]."""
        ...

    def verdicts(self, patches: NDArray[np.uint8]) -> PatchVerdicts:
        """Logits and readability of BGR patches (n, 64, 96, 3)."""
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
    """The multi-task network for drivable road and shadow (section 3.1), and for the surface of the road as a whole."""

    def __init__(self, path: str | Path, threads: int = 2) -> None:
        """Load and check the file; raises ModelError."""
        self._session = _load(path, threads)
        self._path = path
        _check_input(self._session, path, "image", [1, MASK_HEIGHT_PX, MASK_WIDTH_PX, 3])
        _check_outputs(self._session, path, (*MASKS, SURFACE))

    def segment(self, image: NDArray[np.uint8]) -> RoadMasks:
        """Masks and surface of a BGR picture of any size, reduced by area averaging; raises ModelError."""
        shape = (MASK_HEIGHT_PX, MASK_WIDTH_PX)
        *masks, logits = _run(self._session, self._path, (*MASKS, SURFACE), {"image": reduced(image)[None]})
        for name, mask in zip(MASKS, masks, strict=True):
            if mask.size != MASK_HEIGHT_PX * MASK_WIDTH_PX or not np.isfinite(mask).all():
                raise ModelError(
                    f"{self._path}: expected {name!r} finite and of {MASK_HEIGHT_PX} x {MASK_WIDTH_PX}, got shape "
                    f"{mask.shape}. Export or train the network again."
                )
        _check_logits(logits, 1, self._path)
        drivable, shadow = (mask.reshape(shape) for mask in masks)
        return RoadMasks(drivable, shadow, logits[0].astype(np.float64))


class SurfaceClassifier:
    """The patch classifier for dry, wet, snow and ice, with its calibration (section 3.1)."""

    def __init__(self, path: str | Path, threads: int = 2) -> None:
        """Load and check the file; raises ModelError."""
        self._session = _load(path, threads)
        self._path = path
        _check_input(self._session, path, "patches", [None, PATCH_HEIGHT_PX, PATCH_WIDTH_PX, 3])
        _check_outputs(self._session, path, VERDICTS)
        self._temperature = _read_temperature(self._session, path)

    @property
    def temperature(self) -> float:
        """T of the temperature scaling [-]."""
        return self._temperature

    def verdicts(self, patches: NDArray[np.uint8]) -> PatchVerdicts:
        """Verdicts on BGR patches (n, 64, 96, 3) in one run; raises ModelError if they are not finite."""
        logits, readable = _run(self._session, self._path, VERDICTS, {"patches": patches})
        _check_logits(logits, len(patches), self._path)
        if readable.shape != (len(patches),) or not (np.abs(readable - 0.5) <= 0.5 + _ROUNDING).all():
            raise ModelError(
                f"{self._path}: expected 'readable' of shape {(len(patches),)} within [0, 1], got shape "
                f"{readable.shape}. Export or train the network again."
            )
        return PatchVerdicts(logits.astype(np.float64), readable.astype(np.float64).clip(0.0, 1.0))


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
