"""What stands beside the graph in a network's file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path


def annotate(path: Path, properties: Mapping[str, str | None]) -> None:
    """Set entries of an ONNX file's metadata, or with None take them out; others stay."""
    import onnx

    model = onnx.load(str(path))
    known = {entry.key: entry.value for entry in model.metadata_props}
    told = {key: value for key, value in {**known, **properties}.items() if value is not None}
    onnx.helper.set_model_props(model, told)
    onnx.save(model, str(path))


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
