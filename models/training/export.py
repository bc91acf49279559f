"""Writing the networks as ONNX files with the contract of the estimator."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from trpac_core.vision.networks import CLASS_LIST
from trpac_core.vision.picture import LOOK_HEIGHT_PX, LOOK_WIDTH_PX

from .annotate import annotate
from .nets import Segmenter, SurfaceNet

OPSET = 18


class _SegmenterGraph(nn.Module):
    """Probabilities instead of logits."""

    def __init__(self, net: Segmenter):
        super().__init__()
        self.net = net

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        drivable, shadow = self.net(image)
        return torch.sigmoid(drivable), torch.sigmoid(shadow)


def export_segmenter(net: Segmenter, path: Path) -> None:
    """Write segmenter.onnx: `image` uint8 (1, 160, 256, 3) BGR to `drivable`, `shadow` (1, 160, 256)."""
    example = torch.zeros((1, 160, 256, 3), dtype=torch.uint8)
    _export(_SegmenterGraph(net), example, path, "image", ["drivable", "shadow"], None)
    annotate(path, {"task": "drivable area and road shadow"})


def export_surface(net: SurfaceNet, temperature: float, path: Path) -> None:
    """Write surface.onnx: `patches` uint8 (N, 64, 96, 3) BGR to `logits` (N, 3) and `readable` (N,).

    T is in the metadata.
    """
    example = torch.zeros((2, 64, 96, 3), dtype=torch.uint8)
    _export(net, example, path, "patches", ["logits", "readable"], {"patches": {0: "n"}})
    annotate(path, {"temperature": f"{temperature:.6f}", "classes": CLASS_LIST})


class _PictureGraph(nn.Module):
    """The classes alone: the other heads know patches."""

    def __init__(self, net: SurfaceNet):
        super().__init__()
        self.net = net

    def forward(self, looks: Tensor) -> Tensor:
        return self.net.classifier(self.net.embed(looks))


def export_picture(net: SurfaceNet, temperature: float, path: Path) -> None:
    """Write picture.onnx: `looks` uint8 (N, 128, 192, 3) BGR to `logits` (N, 3); T is in the metadata."""
    example = torch.zeros((2, LOOK_HEIGHT_PX, LOOK_WIDTH_PX, 3), dtype=torch.uint8)
    _export(_PictureGraph(net), example, path, "looks", ["logits"], {"looks": {0: "n"}})
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
    """Drop the exporter's notes on nodes from an ONNX file."""
    import onnx

    model = onnx.load(str(path))
    for part in (*model.graph.node, *model.graph.value_info, *model.graph.input, *model.graph.output):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    del model.graph.value_info[:]
    model.graph.ClearField("metadata_props")
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
