"""An optional teacher: middle features of a large network, handed on to the small one in training only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

INPUT_PX = 224
GLOSS_LAYERS = {
    128: (28, 32),
    132: (28, 32),
    140: (14, 64),
    144: (14, 64),
    148: (14, 64),
    155: (14, 96),
    159: (14, 96),
}
"""Tensors of MobileNetV2's blocks 4 to 12 with their side and channels: texture and gloss, not yet objects. The mean
and deviation of each channel are handed on."""

MAP_LAYERS = (148, 159)
"""Tensors (blocks 9 and 12) whose maps are handed on as well, reduced to MAP_CELLS."""

MAP_CELLS = (4, 6)
"""Rows and columns of the handed-on maps."""


class TeacherError(ValueError):
    """The teacher file cannot be used."""


@dataclass(frozen=True)
class TeacherFeatures:
    """What the teacher sees in patches, standardised, aligned along the first axis.

    Attributes
    ----------
    pooled : float16, shape (n, 896)
        Mean and deviation of each channel of GLOSS_LAYERS.
    maps : float16, shape (n, 160, 4, 6)
        Maps of MAP_LAYERS.
    """

    POOLED: ClassVar[int] = 2 * sum(channels for _, channels in GLOSS_LAYERS.values())
    MAPS: ClassVar[int] = sum(GLOSS_LAYERS[index][1] for index in MAP_LAYERS)

    pooled: NDArray[np.float16]
    maps: NDArray[np.float16]

    def __len__(self) -> int:
        return len(self.pooled)

    def where(self, chosen: NDArray[np.bool_]) -> TeacherFeatures:
        """The chosen patches' features alone."""
        return TeacherFeatures(self.pooled[chosen], self.maps[chosen])


def teacher_features(
    model: Path, patches: NDArray[np.uint8], report: Callable[[int], None] = lambda done: None
) -> TeacherFeatures:
    """The teacher's features of each patch.

    Parameters
    ----------
    model : Path
        MobileNetV2 1.0 / 224 as a TensorFlow Lite file with 8-bit weights (uint8 RGB input).
    patches : uint8, shape (n, height, width, 3)
        BGR patches.
    report : callable
        Called with the number of patches done.
    """
    interpreter, source, scales = _load(model)
    rows, columns = (_area_weights(GLOSS_LAYERS[MAP_LAYERS[0]][0], cells) for cells in MAP_CELLS)
    pooled, maps = [], []
    for row, patch in enumerate(patches):
        large = cv2.resize(patch, (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_LINEAR)
        interpreter.set_tensor(source, large[None, :, :, ::-1])
        interpreter.invoke()
        found = {
            index: (interpreter.get_tensor(index)[0].astype(np.float32) - zero) * scale
            for index, (scale, zero) in scales.items()
        }
        pooled.append(
            np.concatenate(
                [part for layer in found.values() for part in (layer.mean((0, 1)), layer.std((0, 1)))]
            )
        )
        cells = [np.einsum("ij,jkc,lk->cil", rows, found[index], columns) for index in MAP_LAYERS]
        maps.append(np.concatenate(cells).astype(np.float16))
        report(row + 1)
    return TeacherFeatures(
        _standard(np.stack(pooled), (0,)), _standard(np.stack(maps).astype(np.float32), (0, 2, 3))
    )


def _area_weights(side: int, cells: int) -> NDArray[np.float32]:
    """Share of each of `side` pixels in each of fewer cells, shape (cells, side)."""
    unit = np.eye(side, dtype=np.float32)
    return np.asarray(cv2.resize(unit, (side, cells), interpolation=cv2.INTER_AREA), np.float32)


def _standard(features: NDArray[np.float32], axes: tuple[int, ...]) -> NDArray[np.float16]:
    centred = features - features.mean(axis=axes, keepdims=True)
    return (centred / np.maximum(centred.std(axis=axes, keepdims=True), 1e-3)).astype(np.float16)


def _load(model: Path):  # type: ignore[no-untyped-def]
    """The interpreter, its input's index, and scale and zero point of each layer that is handed on."""
    from ai_edge_litert.interpreter import Interpreter  # type: ignore[import-untyped]

    interpreter = Interpreter(str(model), num_threads=1, experimental_preserve_all_tensors=True)
    interpreter.allocate_tensors()
    details = {detail["index"]: detail for detail in interpreter.get_tensor_details()}
    for index, (side, channels) in GLOSS_LAYERS.items():
        if index not in details or tuple(details[index]["shape"]) != (1, side, side, channels):
            raise TeacherError(
                f"{model}: tensor {index} is not of shape {(1, side, side, channels)}; expected MobileNetV2 1.0 / 224"
            )
    scales = {index: details[index]["quantization"] for index in GLOSS_LAYERS}
    return interpreter, interpreter.get_input_details()[0]["index"], scales
