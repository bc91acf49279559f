"""An optional teacher: middle features of a large network, handed on to the small one in training only."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

INPUT_PX = 224
LAYER_SHAPE = (1, 14, 14, 96)
"""Shape of the layer that is handed on: MobileNetV2's block 12 (texture and gloss, not yet objects)."""

LAYER_INDEX = 159


class TeacherError(ValueError):
    """The teacher file cannot be used."""


def teacher_features(model: Path, patches: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Standardised mean and deviation of the teacher's middle maps for each patch, shape (n, 192).

    Parameters
    ----------
    model : Path
        MobileNetV2 1.0 / 224 as a TensorFlow Lite file with 8-bit weights (uint8 RGB input).
    patches : uint8, shape (n, height, width, 3)
        BGR patches.
    """
    from ai_edge_litert.interpreter import Interpreter  # type: ignore[import-untyped]

    if not model.is_file():
        raise TeacherError(f"{model}: not found; leave --teacher out to train without one")
    interpreter = Interpreter(str(model), num_threads=2, experimental_preserve_all_tensors=True)
    interpreter.allocate_tensors()
    source = interpreter.get_input_details()[0]
    layer = {detail["index"]: detail for detail in interpreter.get_tensor_details()}.get(LAYER_INDEX)
    if layer is None or tuple(layer["shape"]) != LAYER_SHAPE:
        raise TeacherError(
            f"{model}: tensor {LAYER_INDEX} is not of shape {LAYER_SHAPE}; expected MobileNetV2 1.0 / 224"
        )
    scale, zero = layer["quantization"]
    features = np.empty((len(patches), 2 * LAYER_SHAPE[-1]), np.float32)
    for row, patch in enumerate(patches):
        large = cv2.resize(patch, (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_LINEAR)
        interpreter.set_tensor(source["index"], large[None, :, :, ::-1])
        interpreter.invoke()
        maps = (interpreter.get_tensor(LAYER_INDEX)[0].astype(np.float32) - zero) * scale
        features[row] = np.concatenate((maps.mean(axis=(0, 1)), maps.std(axis=(0, 1))))
    deviation = features.std(axis=0)
    return (features - features.mean(axis=0)) / np.maximum(deviation, 1e-3)
