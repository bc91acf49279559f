"""Writing the networks as ONNX files with the contract of the estimator."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from trpac_core.vision.networks import CLASS_LIST

from .annotate import annotate
from .nets import RoadNet, SurfaceNet
from .trunk import Trunk

OPSET = 18
HALVED_FROM = 256
"""Numbers of an array from which on it is kept in half precision [-]."""


class _RoadGraph(nn.Module):
    """Probabilities of the masks instead of logits."""

    def __init__(self, net: RoadNet):
        super().__init__()
        self.net = net

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        drivable, shadow, surface = self.net(image)
        return torch.sigmoid(drivable), torch.sigmoid(shadow), surface


def export_segmenter(net: RoadNet, path: Path) -> None:
    """Write segmenter.onnx.

    From `image` uint8 (1, 160, 256, 3) BGR to `drivable`, `shadow` (1, 160, 256) and `surface` (1, 3).
    """
    example = torch.zeros((1, 160, 256, 3), dtype=torch.uint8)
    _export(_RoadGraph(net), example, path, "image", ["drivable", "shadow", "surface"], None)
    annotate(path, {"task": "drivable area, road shadow and surface of the road", "classes": CLASS_LIST})


def export_trunk(trunk: Trunk, path: Path) -> None:
    """Write a trunk: `images` uint8 (N, 160, 256, 3) BGR to its maps."""
    example = torch.zeros((2, 160, 256, 3), dtype=torch.uint8)
    maps = [f"map_{block}" for block in trunk.kind.read]
    _export(trunk, example, path, "images", maps, {"images": {0: "n"}})


def export_surface(net: SurfaceNet, temperature: float, path: Path) -> None:
    """Write surface.onnx: `patches` uint8 (N, 64, 96, 3) BGR to `logits` (N, 3) and `readable` (N,).

    T is in the metadata.
    """
    example = torch.zeros((2, 64, 96, 3), dtype=torch.uint8)
    _export(net, example, path, "patches", ["logits", "readable"], {"patches": {0: "n"}})
    annotate(path, {"temperature": f"{temperature:.6f}", "classes": CLASS_LIST})


def _export(
    net: nn.Module, example: Tensor, path: Path, name: str, outputs: list[str], dynamic: dict | None
) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    net = net.eval().to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    shapes = None if dynamic is None else ({0: torch.export.Dim("n", min=1)},)
    program = torch.onnx.export(
        net, (example,), input_names=[name], output_names=outputs, opset_version=OPSET, dynamo=True,
        dynamic_shapes=shapes, verbose=False,
    )  # fmt: skip
    if program is None:
        raise RuntimeError(
            f"{path}: torch exported no ONNX program; check the versions in requirements/train.txt"
        )
    program.save(str(path), external_data=False)
    _tidy(path)


def _tidy(path: Path) -> None:
    """Drop the exporter's notes on nodes from an ONNX file, and keep its large arrays in half precision.

    They are widened again as the file is loaded: the file is half as large, and the network as quick.
    """
    import onnx

    model = onnx.load(str(path))
    graph = model.graph
    for part in (*graph.node, *graph.value_info, *graph.input, *graph.output):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    del graph.value_info[:]
    graph.ClearField("metadata_props")
    wide = [a for a in graph.initializer if a.data_type == onnx.TensorProto.FLOAT and _size(a) >= HALVED_FROM]
    for array in wide:
        name, values = array.name, onnx.numpy_helper.to_array(array)
        array.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), f"{name}_half"))
        cast = onnx.helper.make_node("Cast", [array.name], [name], to=onnx.TensorProto.FLOAT)
        graph.node.insert(0, cast)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))


def _size(array: Any) -> int:
    return int(np.prod(array.dims))
