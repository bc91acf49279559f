"""What stands beside the graph in a network's file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path


def annotate(path: Path, properties: Mapping[str, str]) -> None:
    """Set entries of an ONNX file's metadata; others stay."""
    import onnx

    model = onnx.load(str(path))
    known = {entry.key: entry.value for entry in model.metadata_props}
    onnx.helper.set_model_props(model, {**known, **properties})
    onnx.save(model, str(path))


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
