"""The channels of an MDF file, and its raw frames of a bus; a reader of `sim2real.logs.formats.extractor`.

asammdf hands a channel's conversion formula, text of the file's, to numexpr and SymPy, which run it as Python. So
neither is there: in their place stands `sim2real.logs.formats.formula`, which is arithmetic alone.
"""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from collections.abc import Collection, Iterator
from io import BufferedReader, BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn


def load_formulas() -> ModuleType:
    """The module `formula`, by its place."""
    spec = importlib.util.spec_from_file_location("formula", Path(__file__).with_name("formula.py"))
    if spec is None or spec.loader is None:
        raise ImportError("formula.py is missing beside mdf_channels.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def replace_evaluators() -> None:
    """Put `formula.evaluate` where asammdf takes numexpr's and SymPy's functions from."""
    formulas = load_formulas()

    def evaluate(text: str) -> Any:
        # As numexpr does, it takes its variables from where it is called: X or X1, and P1 to P6 of asammdf's own.
        there = sys._getframe(1).f_locals
        names = [name for name in ("X", "X1", "INF", "NaN", *(f"P{i}" for i in range(1, 7))) if name in there]
        return formulas.evaluate(text, {name: there[name] for name in names})

    def refuse(_: object, text: str, **__: object) -> NoReturn:
        # asammdf's second try, after `evaluate` has refused: this time the reason gets through.
        try:
            formulas.evaluate(text, {"X": 1.0, "X1": 1.0})
        except formulas.FormulaError as error:
            raise formulas.FormulaError(f"the formula {text[:100]!r} of a channel {error}") from None
        raise formulas.FormulaError(f"the formula {text[:100]!r} of a channel cannot be evaluated")

    for name, content in (
        ("numexpr", {"evaluate": evaluate}),
        ("sympy", {"symbols": str, "lambdify": refuse}),
    ):
        module = ModuleType(name)
        module.__dict__.update(content, __version__="0")  # pandas asks for it
        sys.modules[name] = module


replace_evaluators()

import numpy as np  # noqa: E402
from asammdf import MDF, Signal  # noqa: E402

UNFINISHED = b"UnFinMF"
"""Start of an MDF that its recorder did not close."""
FRAME = "CAN_DataFrame"
"""Name of a channel that holds raw frames, after the standard for bus logging; its parts are NAME.ID and so on."""
EXTENDED, ID_BITS = 1 << 31, (1 << 29) - 1
"""Bit of an ID that says that it has 29 bits, and those bits."""
CHUNK = 100_000
"""Raw frames that are looked at together; each takes about 100 bytes."""
MOST_SEEN = 5_000
"""IDs that are told, those with the most frames."""


def extract(order: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What JSON says of the file, and arrays by name.

    The order has the path, the wanted channels, and the (ID, is extended) of wanted frames. Told are the names of all
    channels, the masters, the wanted channels, and whether there are raw frames, with the wanted ones. A channel name
    that several groups have becomes NAME#GROUP.

    Raises
    ------
    ValueError
        The wanted channels hold more than `most_numbers` samples.
    """
    arrays: dict[str, Any] = {}
    with _open(Path(order["path"])) as stream, MDF(stream) as mdf:
        told = _channels(mdf, frozenset(order["wanted"]), order["most_numbers"], arrays)
        told["bus"] = any(channel.name == FRAME for group in mdf.groups for channel in group.channels)
        if told["bus"] and order.get("frames") is not None:
            kept = {(int(i), bool(x)) for i, x in order["frames"]}
            told |= _frames(mdf, kept, order["most_numbers"], arrays)
        told["epoch_s"] = mdf.header.start_time.timestamp()
    return told, arrays


def _channels(mdf: MDF, wanted: Collection[str], most_numbers: int, arrays: dict[str, Any]) -> dict[str, Any]:
    groups: list[Any] = list(mdf.groups)
    every = [
        (str(channel.name), g, i)
        for g, group in enumerate(groups)
        for i, channel in enumerate(group.channels)
        if i != mdf.masters_db.get(g)
    ]
    count = Counter(name for name, _, _ in every)
    places = {name if count[name] == 1 else f"{name}#{g}": (g, i) for name, g, i in every}
    found = [name for name in places if name in wanted]
    numbers = sum(int(groups[places[name][0]].channel_group.cycles_nr) for name in found)
    if numbers > most_numbers:
        raise ValueError(f"{numbers} samples in the channels that are read; expected at most {most_numbers}")
    signals = mdf.select([(None, *places[name]) for name in found], ignore_value2text_conversions=True)
    return {
        "names": list(places),
        "units": {name: str(groups[g].channels[i].unit or "") for name, (g, i) in places.items()},
        "masters": [str(groups[g].channels[i].name) for g, i in mdf.masters_db.items()],
        "channels": {
            name: _told(str(k), s, arrays) for k, (name, s) in enumerate(zip(found, signals, strict=True))
        },
    }


def _frames(
    mdf: MDF, kept: Collection[tuple[int, bool]], most_numbers: int, arrays: dict[str, Any]
) -> dict[str, Any]:
    """The frames with these IDs, as `bus_frames` tells of them."""
    found: dict[tuple[int, ...], list[tuple[Any, Any, Any]]] = {}
    seen: Counter[tuple[int, bool]] = Counter()
    first_s = np.inf
    for time_s, kinds, lengths, data in _chunks(mdf, most_numbers):
        first_s = min(first_s, float(time_s.min()))
        keys, which = np.unique(kinds, axis=0, return_inverse=True)
        for k, key in enumerate(keys.tolist()):
            rows = np.flatnonzero(which.ravel() == k)
            kind = (key[0], bool(key[1]))
            seen[kind] += len(rows)
            if kind in kept:
                there = np.arange(data.shape[1]) < lengths[rows, None]
                part = time_s[rows], lengths[rows].astype(np.uint8), data[rows][there]
                found.setdefault(tuple(key), []).append(part)
    for k, parts in enumerate(found.values()):
        for name, content in zip(("time", "length", "data"), zip(*parts, strict=True), strict=True):
            arrays[f"{name}_f{k}"] = np.concatenate(content)
    return {
        "frames": [
            {"id": number, "extended": bool(extended), "channel": str(channel), "key": f"f{k}"}
            for k, (number, extended, channel, _) in enumerate(found)
        ],
        "seen": [[*key, n] for key, n in seen.most_common(MOST_SEEN)],
        "count": seen.total(),
        "first_s": first_s if seen else 0.0,
    }


def _chunks(mdf: MDF, most_numbers: int) -> Iterator[tuple[Any, Any, Any, Any]]:
    """Of CHUNK raw frames at a time: times [s]; ID, is extended, channel, group; lengths; bytes, (frames, longest)."""
    for g, group in enumerate(list[Any](mdf.groups)):
        parts = {str(channel.name): i for i, channel in enumerate(group.channels)}
        count = group.channel_group.cycles_nr
        if FRAME not in parts or not count:
            continue
        if count > most_numbers:
            raise ValueError(f"{count} frames; expected at most {most_numbers}")
        missing = [name for name in ("ID", "DataBytes") if f"{FRAME}.{name}" not in parts]
        if missing:
            raise ValueError(f"raw frames in group {g} without {FRAME}.{missing[0]}")
        for offset in range(0, count, CHUNK):
            there = {
                name: mdf.get(group=g, index=parts[full], raw=True, record_offset=offset, record_count=CHUNK)
                for name in ("ID", "IDE", "BusChannel", "DataLength", "DataBytes")
                if (full := f"{FRAME}.{name}") in parts
            }
            ids = there["ID"].samples.astype(np.int64)
            data = _as_bytes(there["DataBytes"].samples)
            none, full_length = np.zeros(len(ids), np.int64), np.full(len(ids), data.shape[1])
            extended = there["IDE"].samples.astype(bool) if "IDE" in there else ids & EXTENDED != 0
            channel = there["BusChannel"].samples.astype(np.int64) if "BusChannel" in there else none
            lengths = there["DataLength"].samples.astype(np.int64) if "DataLength" in there else full_length
            kinds = np.column_stack((ids & ID_BITS, extended, channel, none + g))
            yield there["ID"].timestamps, kinds, np.minimum(lengths, full_length), data


def _as_bytes(samples: Any) -> Any:
    """Payloads as an array of bytes, shape (frames, longest)."""
    samples = np.ascontiguousarray(samples)
    if samples.dtype.kind == "S" or samples.ndim == 1:
        return samples.view(np.uint8).reshape(len(samples), -1)
    return samples.astype(np.uint8)


def _told(key: str, signal: Signal, arrays: dict[str, Any]) -> dict[str, Any]:
    """What JSON says of a channel; its samples go into `arrays`, where they are one number or text each."""
    samples = np.asarray(signal.samples)
    plain = samples.ndim == 1 and samples.dtype.kind in "fiubSU"
    if plain:
        arrays[f"samples_{key}"] = samples
        arrays[f"time_{key}"] = np.asarray(signal.timestamps, dtype=np.float64)
        if signal.invalidation_bits is not None:
            arrays[f"invalid_{key}"] = np.asarray(signal.invalidation_bits, dtype=bool)
    return {
        "key": key,
        "plain": plain,
        "unit": str(signal.unit or ""),
        "kind": "several values" if samples.ndim != 1 or samples.dtype.fields else str(samples.dtype)[:40],
        "sync": int(signal.master_metadata[1]) if signal.master_metadata else None,
    }


def _open(path: Path) -> BufferedReader | BytesIO:
    """The file; as a copy in memory where asammdf would complete what the recorder did not close."""
    file = path.open("rb")
    if file.read(len(UNFINISHED)) == UNFINISHED:
        with file:
            file.seek(0)
            return BytesIO(file.read())
    file.seek(0)
    return file
