"""An optional teacher: middle features of a large network, handed on to the small one in training only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

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

AT_ONCE = 64
"""Patches that the teacher sees in one run while its features are standardised."""


class TeacherError(ValueError):
    """The teacher file cannot be used."""


@dataclass(frozen=True)
class Layer:
    """One operation: from which tensors to which, and between which values its output saturates.

    `weights` is empty for a sum or a border; `border` is left, right, top, bottom [px].
    """

    inputs: tuple[int, ...]
    output: int
    weights: str
    stride: int
    groups: int
    border: tuple[int, int, int, int]
    limits: tuple[float, float]


class Teacher(nn.Module):
    """Layers of an 8-bit network up to the last that is handed on, computed in floating point on any device.

    The outputs saturate where the 8-bit ones do, which holds ReLU6 too: no activation need be known.
    """

    POOLED: ClassVar[int] = 2 * sum(channels for _, channels in GLOSS_LAYERS.values())
    MAPS: ClassVar[int] = sum(GLOSS_LAYERS[index][1] for index in MAP_LAYERS)

    def __init__(self, layers: tuple[Layer, ...], weights: dict[str, Tensor], first: tuple[int, float, int]):
        """Of layers with their weights and biases; `first` is the input's tensor, scale and zero point."""
        super().__init__()
        self.layers, self.first = layers, first
        for name, value in weights.items():
            self.register_buffer(name, value)
        for name, size in (("pooled", (self.POOLED,)), ("maps", (self.MAPS, 1, 1))):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_deviation", torch.ones(size))

    @classmethod
    def read(cls, model: Path) -> Self:
        """MobileNetV2 1.0 / 224 from a TensorFlow Lite file with 8-bit weights (uint8 RGB input).

        Raises
        ------
        TeacherError
            The file is missing or holds another network.
        """
        if not model.is_file():
            raise TeacherError(f"{model}: not found; leave --teacher out to train without one")
        return cls(*_read(model))

    def forward(self, patches: Tensor) -> tuple[Tensor, Tensor]:
        """Standardised features of uint8 BGR patches (n, h, w, 3).

        Returns
        -------
        pooled : shape (n, 896)
            Mean and deviation of each channel of GLOSS_LAYERS.
        maps : shape (n, 160, 4, 6)
            Maps of MAP_LAYERS.
        """
        pooled, maps = self._features(patches)
        return (pooled - self.pooled_mean) / self.pooled_deviation, (
            maps - self.maps_mean
        ) / self.maps_deviation

    @torch.no_grad()
    def standardise(self, patches: Tensor) -> None:
        """Let each feature's mean be 0 and its deviation 1 over these patches, uint8 (n, h, w, 3)."""
        found = [self._features(some) for some in patches.split(AT_ONCE)]
        pooled, maps = (torch.cat(parts) for parts in zip(*found, strict=True))
        self.pooled_mean, self.pooled_deviation = pooled.mean(0), pooled.std(0).clamp_min(1e-3)
        self.maps_mean = maps.mean((0, 2, 3))[:, None, None]
        self.maps_deviation = maps.std((0, 2, 3)).clamp_min(1e-3)[:, None, None]

    def tensors(self, patches: Tensor) -> dict[int, Tensor]:
        """Maps of each of GLOSS_LAYERS, (n, channels, side, side), by the file's number of the tensor."""
        source, scale, zero = self.first
        rgb = patches.permute(0, 3, 1, 2).flip(1).float()
        large = functional.interpolate(rgb, (INPUT_PX, INPUT_PX), mode="bilinear", align_corners=False)
        values = {source: (large - zero) * scale}
        for layer in self.layers:
            inputs = [functional.pad(values[index], layer.border) for index in layer.inputs]
            if layer.weights:
                weight, bias = getattr(self, layer.weights), getattr(self, f"{layer.weights}_bias")
                found = functional.conv2d(inputs[0], weight, bias, layer.stride, groups=layer.groups)
            else:
                found = sum(inputs[1:], inputs[0])
            values[layer.output] = found.clamp(*layer.limits)
        return {index: values[index].float() for index in GLOSS_LAYERS}

    def _features(self, patches: Tensor) -> tuple[Tensor, Tensor]:
        seen = self.tensors(patches)
        pooled = [part for x in seen.values() for part in (x.mean((2, 3)), x.flatten(2).std(2, correction=0))]
        maps = [functional.adaptive_avg_pool2d(seen[index], MAP_CELLS) for index in MAP_LAYERS]
        return torch.cat(pooled, 1), torch.cat(maps, 1)


def _read(model: Path) -> tuple[tuple[Layer, ...], dict[str, Tensor], tuple[int, float, int]]:
    """Layers, weights and input of the network in a file."""
    from ai_edge_litert.interpreter import Interpreter  # type: ignore[import-untyped]

    interpreter = Interpreter(str(model), num_threads=1, experimental_preserve_all_tensors=True)
    interpreter.allocate_tensors()
    details = {detail["index"]: detail for detail in interpreter.get_tensor_details()}
    for index, (side, channels) in GLOSS_LAYERS.items():
        if index not in details or tuple(details[index]["shape"]) != (1, side, side, channels):
            raise TeacherError(
                f"{model}: tensor {index} is not of shape {(1, side, side, channels)}; expected MobileNetV2 1.0 / 224"
            )
    layers: list[Layer] = []
    weights: dict[str, Tensor] = {}
    source = interpreter.get_input_details()[0]["index"]
    first = source
    for operation in interpreter._get_ops_details():
        kind, output = operation["op_name"], int(operation["outputs"][0])
        if kind == "QUANTIZE":
            first = output
            continue
        layer = _layer(kind, [int(index) for index in operation["inputs"]], output, details)
        layers.append(layer)
        if layer.weights:
            weights |= _weights(layer, [int(i) for i in operation["inputs"][1:]], interpreter, details)
        if output == max(GLOSS_LAYERS):
            break
    scale, zero = details[source]["quantization"]
    return tuple(layers), weights, (first, float(scale), int(zero))


def _layer(kind: str, inputs: list[int], output: int, details: dict[int, Any]) -> Layer:
    """One operation, with the stride and the border that its shapes tell."""
    if kind not in ("CONV_2D", "DEPTHWISE_CONV_2D", "ADD", "PAD"):
        raise TeacherError(f"operation {kind} in the teacher's first layers; expected MobileNetV2 1.0 / 224")
    before, after = (details[index]["shape"][1] for index in (inputs[0], output))
    convolved = kind.endswith("CONV_2D")
    kernel = details[inputs[1]]["shape"][1] if convolved else 1
    stride = round(before / after) if convolved else 1
    missing = max((after - 1) * stride + kernel - before, 0)
    border = (missing // 2, missing - missing // 2) if kind != "PAD" else (0, missing)
    scale, zero = details[output]["quantization"]
    return Layer(
        inputs=tuple(inputs if kind == "ADD" else inputs[:1]),
        output=output,
        weights=f"layer_{output}" if convolved else "",
        stride=stride,
        groups=int(details[inputs[0]]["shape"][3]) if kind == "DEPTHWISE_CONV_2D" else 1,
        border=border * 2,
        limits=(float(scale) * (-128 - zero), float(scale) * (127 - zero)),
    )


def _weights(
    layer: Layer, constants: list[int], interpreter: Any, details: dict[int, Any]
) -> dict[str, Tensor]:
    """Weights and bias of a convolution in floating point, in the order of axes that torch has."""
    found = []
    for index in constants:
        known = details[index]["quantization_parameters"]
        axis, values = known["quantized_dimension"], interpreter.get_tensor(index).astype(np.float32)
        shape = [-1 if number == axis else 1 for number in range(values.ndim)]
        values = (values - known["zero_points"].reshape(shape)) * known["scales"].reshape(shape)
        found.append(torch.from_numpy(values.astype(np.float32)))
    weight, bias = found
    turned = weight.permute(3, 0, 1, 2) if layer.groups > 1 else weight.permute(0, 3, 1, 2)
    return {layer.weights: turned.contiguous(), f"{layer.weights}_bias": bias}
