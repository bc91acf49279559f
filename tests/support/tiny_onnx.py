"""Writes networks of two nodes as ONNX files, by the protobuf wire format: stand-ins that need no training."""

from pathlib import Path

FLOAT, UINT8, INT64 = 1, 2, 7


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _field(number: int, value: int | str | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, kind: int, shape: list[int | str]) -> bytes:
    dims = b"".join(_field(1, _field(1 if isinstance(size, int) else 2, size)) for size in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, kind) + _field(2, dims)))


def _node(kind: str, source: str, target: str, attributes: bytes = b"") -> bytes:
    return _field(1, source) + _field(2, target) + _field(4, kind) + attributes


def _cast(source: str) -> bytes:
    return _node("Cast", source, "as_float", _field(5, _field(1, "to") + _field(3, FLOAT) + _field(20, 2)))


def _mean(target: str, axes: list[int]) -> bytes:
    over = _field(1, "axes") + b"".join(_field(8, axis) for axis in axes) + _field(20, 7)
    flat = _field(1, "keepdims") + _field(3, 0) + _field(20, 2)
    return _node("ReduceMean", "as_float", target, _field(5, over) + _field(5, flat))


def _reshape(source: str, target: str, size: int) -> list[bytes]:
    tensor = _field(1, 1) + _field(2, INT64) + _field(7, _varint(size))
    value = _field(1, "value") + _field(5, tensor) + _field(20, 4)
    constant = _field(2, "size") + _field(4, "Constant") + _field(5, value)
    return [constant, _field(1, source) + _field(1, "size") + _field(2, target) + _field(4, "Reshape")]


def _write(path: Path, nodes: list[bytes], inputs: list[bytes], outputs: list[bytes], metadata: dict) -> Path:
    graph = b"".join(_field(1, node) for node in nodes) + _field(2, "tiny")
    graph += b"".join(_field(11, tensor) for tensor in inputs) + b"".join(_field(12, t) for t in outputs)
    model = _field(1, 8) + _field(7, graph) + _field(8, _field(1, "") + _field(2, 13))
    model += b"".join(_field(14, _field(1, key) + _field(2, value)) for key, value in metadata.items())
    path.write_bytes(model)
    return path


def write_classifier(
    path: Path, *, height: int = 64, metadata: dict | None = None, only_for: int | None = None
) -> Path:
    """Logits are the mean blue, green and red of each patch; any patch is readable, the more so the brighter it is.

    With `only_for` it can be loaded, but run on that number of patches alone, as a damaged network may.
    """
    calibration = {"temperature": "2.5", "classes": "dry,wet,snow_ice"} if metadata is None else metadata
    return _write(
        path,
        [
            _cast("patches"),
            _mean("logits", [1, 2]),
            _mean("grey", [1, 2, 3]),
            *(
                [_node("Sigmoid", "grey", "readable")]
                if only_for is None
                else _reshape("grey", "readable", only_for)
            ),
        ],
        [_tensor("patches", UINT8, ["n", height, 96, 3])],
        [_tensor("logits", FLOAT, ["n", 3]), _tensor("readable", FLOAT, ["n"])],
        calibration,
    )


def write_segmenter(
    path: Path, *, outputs: tuple[str, str] = ("drivable", "shadow"), drivable_by: str = "Sigmoid"
) -> Path:
    """Drivable is the sigmoid of the mean colour: above 0.99 where anything is lit; shadow its mean, unscaled.

    The surface's logits are the mean blue, green and red of the picture.
    """
    drivable, shadow = outputs
    mask = [1, 160, 256]
    return _write(
        path,
        [
            _cast("image"),
            _mean(shadow, [3]),
            _node(drivable_by, shadow, drivable),
            _mean("surface", [1, 2]),
        ],
        [_tensor("image", UINT8, [1, 160, 256, 3])],
        [_tensor(drivable, FLOAT, mask), _tensor(shadow, FLOAT, mask), _tensor("surface", FLOAT, [1, 3])],
        {},
    )
