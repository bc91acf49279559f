"""The signals of a MAT-file (versions 4, 5 and 7.3); a reader of `sim2real.logs.formats.extractor`.

Structs become names with points. A struct with a vector of times and one of values is one signal on its own times, as
Simulink's "structure with time" is; any other vector is on the times of its struct, or of the struct around it. Nothing
is evaluated: objects of MATLAB's classes and function handles are listed, not read.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

TIMES = ("time", "t", "time_s", "timestamp", "timestamps")
VALUES = ("values", "data", "value")
UNITS = ("unit", "units")
"""Names of a struct's fields, without regard to capitals."""
LABELS = ("label", "signalname", "name", "blockname")
"""Fields that name the elements of an array of structs."""
MOST_NODES, DEEPEST = 200_000, 20
"""Fields and cells of a file, and structs within one another."""
MOST_CELLS = 2_000_000
"""Texts of a cell array."""
LONGEST_TEXT = 1_000
"""Characters of a text."""
NUMERIC = "fiub"
PLAIN = ("double", "single", "logical", *(f"{s}int{n}" for s in ("", "u") for n in (8, 16, 32, 64)))
"""MATLAB's classes of numbers."""


@dataclass(frozen=True)
class Numbers:
    """An array of numbers that is read when it is wanted; `kind` is empty, or says what else it holds."""

    shape: tuple[int, ...]
    read: Callable[[], Any]
    kind: str = ""

    @property
    def size(self) -> int:
        """How many there are."""
        return math.prod(self.shape)

    @property
    def is_vector(self) -> bool:
        """Whether they stand in one row or column of two or more."""
        return not self.kind and self.size > 1 and max(self.shape) == self.size


@dataclass(frozen=True)
class Texts:
    """Several texts that are read when they are wanted."""

    size: int
    read: Callable[[], list[str]]


@dataclass(frozen=True)
class Opaque:
    """What is not read: an object of this class."""

    kind: str


@dataclass(frozen=True)
class Found:
    """A signal: its values, the name of its time vector and that vector, its unit."""

    values: Numbers | Texts
    time: tuple[str, Numbers] | None
    unit: str


class Budget:
    """Counts what a file holds; raises ValueError where that is more than files of logs have."""

    def __init__(self) -> None:
        self._left = MOST_NODES

    def take(self, depth: int) -> None:
        """One more field or cell at this depth."""
        self._left -= 1
        if self._left < 0 or depth > DEEPEST:
            raise ValueError(f"more than {MOST_NODES} fields, or structs {DEEPEST} deep")


def extract(order: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What JSON says of the file, and arrays by name.

    The order has the path and the wanted names. Told are all names, those of time vectors, objects that were not read
    by name with their class, names that mean several signals, and by wanted name: the key of its arrays, its unit, its
    size, what else than numbers or text it is, and the name of its time vector.

    Raises
    ------
    ValueError
        It holds too much, or links to another file.
    """
    path, wanted = Path(order["path"]), frozenset(order["wanted"])
    with path.open("rb") as file:
        start = file.read(520)
    if start[:8] == b"\x89HDF\r\n\x1a\n" or start[512:520] == b"\x89HDF\r\n\x1a\n":
        os.environ["HDF5_PLUGIN_PRELOAD"] = "::"  # no filter of others is loaded
        import h5py

        with h5py.File(path, "r") as root:
            return _answer(Hdf5(root).tree(), wanted, order["most_numbers"])
    from scipy.io import loadmat

    content = loadmat(path, struct_as_record=False, squeeze_me=False, chars_as_strings=True)
    budget = Budget()
    tree = {}
    for name, value in content.items():
        if not name.startswith("__"):
            node = _of_scipy(value, budget, 0)
            tree[_name_of(value) or name] = node
    return _answer(tree, wanted, order["most_numbers"])


def _answer(
    tree: dict[str, Any], wanted: frozenset[str], most_numbers: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    found: dict[str, Found] = {}
    opaque: dict[str, str] = {}
    _walk("", tree, None, found, opaque)
    short = {name: name.rpartition(".")[2] for name in found}
    count = Counter(short.values())
    by_name = {short[name]: name for name in found if count[short[name]] == 1} | {
        name: name for name in found
    }
    chosen = {name: by_name[name] for name in sorted(wanted) if name in by_name}
    times = {signal.time[0]: signal.time[1] for name in chosen.values() if (signal := found[name]).time}
    total = sum(found[name].values.size for name in chosen.values()) + sum(t.size for t in times.values())
    if total > most_numbers:
        raise ValueError(f"{total} samples in the variables that are read; expected at most {most_numbers}")
    keys = {name: str(k) for k, name in enumerate(times)}
    arrays = {f"time_{keys[name]}": _vector(vector) for name, vector in times.items()}
    channels = {}
    for k, (name, full) in enumerate(chosen.items()):
        signal = found[full]
        kind = _kind(signal.values)
        channels[name] = {
            "name": full,
            "key": str(k),
            "unit": signal.unit[:100],
            "size": signal.values.size,
            "kind": kind,
            "time": keys[signal.time[0]] if signal.time else None,
        }
        if isinstance(signal.values, Texts):
            arrays[f"samples_{k}"] = np.array([text[:LONGEST_TEXT] for text in signal.values.read()], np.str_)
        elif not kind:
            arrays[f"samples_{k}"] = _vector(signal.values)
    used = set(chosen.values())
    told = {
        "names": [name for name in found if name and name not in used],
        "masters": sorted({name for pair in times for name in (pair, short.get(pair, pair))}),
        "opaque": dict(list(opaque.items())[:20]),
        "several": {
            name: sorted(full for full in found if short[full] == name)[:5]
            for name in sorted(wanted)
            if count[name] > 1 and name not in chosen
        },
        "channels": channels,
    }
    return told, arrays


def _kind(values: Numbers | Texts) -> str:
    """What a signal is that is neither a vector nor texts; empty where it is."""
    if isinstance(values, Texts) or values.is_vector:
        return ""
    return values.kind or (
        "a single number" if values.size == 1 else f"an array of {'x'.join(map(str, values.shape))}"
    )


def _vector(values: Numbers) -> Any:
    return np.asarray(values.read(), dtype=np.float64).ravel()


def _walk(
    path: str,
    struct: dict[str, Any],
    around: tuple[str, Numbers] | None,
    found: dict[str, Found],
    opaque: dict[str, str],
) -> None:
    """Add the signals of a struct, whose surroundings have a time vector or None."""
    folded = {name.casefold(): name for name in reversed(struct)}

    def at(name: str) -> str:
        return f"{path}.{name}" if path else name

    own = next(
        (
            (at(folded[name]), node)
            for name in TIMES
            if isinstance(node := struct.get(folded.get(name, "")), Numbers) and node.is_vector
        ),
        None,
    )
    time = own or around
    values = next((struct[folded[name]] for name in VALUES if name in folded), None)
    beside = {
        n: node
        for n, node in struct.items()
        if n.casefold() not in VALUES and (own is None or at(n) != own[0])
    }
    if path and isinstance(values, Numbers | Texts) and not _holds(beside, values.size):
        found[path] = Found(values, _fitting(values, time), _unit(struct))
        if own:
            found[own[0]] = Found(own[1], own, "")
        return
    for name, node in struct.items():
        if isinstance(node, Numbers | Texts):
            found[at(name)] = Found(node, _fitting(node, time), "")
            continue
        is_array, is_signals = isinstance(node, list), own is not None and name.casefold() == "signals"
        inside = path if is_signals else at(name)
        for k, element in enumerate(node if is_array else [node]):
            place = f"{at(name)}({k + 1})" if is_array else at(name)
            if isinstance(element, Opaque):
                opaque[place] = element.kind
            elif isinstance(element, dict):
                label = _label(element) if is_array or is_signals else ""
                _walk(f"{inside}.{label}".lstrip(".") if label else place, element, time, found, opaque)


def _holds(struct: dict[str, Any], size: int) -> bool:
    """Whether a struct has a vector of that size."""
    return any(isinstance(node, Numbers) and node.is_vector and node.size == size for node in struct.values())


def _fitting(values: Numbers | Texts, time: tuple[str, Numbers] | None) -> tuple[str, Numbers] | None:
    return time if time is not None and time[1].size == values.size else None


def _label(struct: dict[str, Any]) -> str:
    """The name that an element of an array of structs states; empty without one."""
    folded = {name.casefold(): node for name, node in struct.items()}
    stated = (folded.get(name) for name in LABELS)
    return next((text.rpartition("/")[2] for text in stated if isinstance(text, str) and text), "")


def _unit(struct: dict[str, Any]) -> str:
    """The unit that a struct states, or its field DataInfo; empty without one."""
    folded = {name.casefold(): node for name, node in struct.items()}
    stated = next((folded[name] for name in UNITS if isinstance(folded.get(name), str)), "")
    inner = folded.get("datainfo")
    return stated or (_unit(inner) if isinstance(inner, dict) else "")


def _of_scipy(value: Any, budget: Budget, depth: int) -> Any:
    """What scipy read, as a tree of dict, list, str, Numbers, Texts and Opaque."""
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque, mat_struct

    budget.take(depth)
    if isinstance(value, mat_struct):
        return {name: _of_scipy(getattr(value, name), budget, depth + 1) for name in value._fieldnames}
    if isinstance(value, MatlabFunction):
        return Opaque("function handle")
    if isinstance(value, MatlabOpaque):
        return Opaque(_opaque_class(value))
    if isinstance(value, MatlabObject):
        return Opaque(str(value.classname))
    if isinstance(value, str):
        return value[:LONGEST_TEXT]
    if not isinstance(value, np.ndarray):
        return Opaque(type(value).__name__)
    if value.dtype.kind in "US":
        texts = [str(text) for text in value.ravel()]
        return (texts[0] if texts else "") if len(texts) < 2 else Texts(len(texts), lambda: texts)
    if value.dtype.kind == "O":
        return _several([*value.ravel()], lambda item: _of_scipy(item, budget, depth + 1), _text_of)
    kind = (
        "" if value.dtype.kind in NUMERIC else "complex numbers" if value.dtype.kind == "c" else "no numbers"
    )
    return Numbers(value.shape, lambda: value, kind)


def _several(items: list[Any], node: Callable[[Any], Any], text: Callable[[Any], str | None]) -> Any:
    """The node of a struct, of an array of structs, or of a cell array; Texts where all are text."""
    if len(items) > 1 and len(items) <= MOST_CELLS and all(text(item) is not None for item in items):
        return Texts(len(items), lambda: [text(item) or "" for item in items])
    return node(items[0]) if len(items) == 1 else [node(item) for item in items]


def _text_of(item: Any) -> str | None:
    if isinstance(item, np.ndarray) and item.dtype.kind in "US" and item.size < 2:
        return str(item.ravel()[0]) if item.size else ""
    return None


def _opaque_class(value: Any) -> str:
    names = [_text(value[name]) for name in ("s2", "s1") if name in (value.dtype.names or ())]
    return next((name for name in names if name), "object")


def _name_of(value: Any) -> str:
    """The variable's name that stands inside an opaque object, since scipy calls it None."""
    names = getattr(getattr(value, "dtype", None), "names", None) or ()
    return _text(value["s0"]) if "s0" in names else ""


def _text(field: Any) -> str:
    item = np.ravel(field)[0] if np.size(field) else b""
    return item.decode("ascii", "replace") if isinstance(item, bytes) else str(item)


class Hdf5:
    """A MAT-file of version 7.3, which is HDF5; its links stay within the file, and nothing outside is read."""

    def __init__(self, root: Any) -> None:
        self._root = root
        self._budget = Budget()

    def tree(self) -> dict[str, Any]:
        """Its variables."""
        return self._fields(self._root, 0)

    def _fields(self, group: Any, depth: int) -> dict[str, Any]:
        return {name: self._node(thing, depth + 1) for name, thing in self._members(group) if name[:1] != "#"}

    def _members(self, group: Any) -> Iterator[tuple[str, Any]]:
        import h5py

        for name in group:
            if type(group.get(name, getlink=True)) is not h5py.HardLink:
                raise ValueError(f"{name[:100]} is a link; expected the variable itself")
            yield str(name), group[name]

    def _node(self, thing: Any, depth: int) -> Any:
        import h5py

        self._budget.take(depth)
        matlab = _text(thing.attrs.get("MATLAB_class", b""))
        if "MATLAB_object_decode" in thing.attrs or matlab not in ("", "struct", "cell", "char", *PLAIN):
            return Opaque(matlab.replace("_", " ") or "object")
        if isinstance(thing, h5py.Group):
            members = dict(self._members(thing))
            refs = {n: m for n, m in members.items() if self._is_array_of_structs(m)}
            if refs and len(refs) == len(members):
                return self._structs(refs, depth)
            return self._fields(thing, depth)
        if not isinstance(thing, h5py.Dataset):
            return Opaque("HDF5 type")
        self._require_own(thing)
        if thing.dtype == h5py.ref_dtype:
            items = [self._root[ref] for ref in self._read(thing).ravel() if ref]
            return _several(items, lambda item: self._node(item, depth + 1), self._text_of)
        if thing.shape is None or "MATLAB_empty" in thing.attrs:
            return Numbers((0,), lambda: np.zeros(0))
        if matlab == "char":
            rows = self._rows(thing)
            return rows[0][:LONGEST_TEXT] if len(rows) == 1 else Texts(len(rows), lambda: rows)
        if thing.dtype.kind in "SO":
            return self._strings(thing)
        kind = "" if thing.dtype.kind in NUMERIC else "complex numbers" if thing.dtype.names else "no numbers"
        return Numbers(thing.shape, lambda: self._read(thing), kind)

    def _is_array_of_structs(self, thing: Any) -> bool:
        import h5py

        return (
            isinstance(thing, h5py.Dataset)
            and thing.dtype == h5py.ref_dtype
            and "MATLAB_class" not in thing.attrs
        )

    def _structs(self, fields: dict[str, Any], depth: int) -> list[Any]:
        columns = {name: self._read(refs).ravel() for name, refs in fields.items()}
        return [
            {name: self._node(self._root[refs[k]], depth + 1) for name, refs in columns.items() if refs[k]}
            for k in range(min(map(len, columns.values())))
        ]

    def _require_own(self, thing: Any) -> None:
        if thing.external or thing.is_virtual:
            raise ValueError(f"{thing.name[:100]} lies in another file; expected the variable itself")

    def _read(self, thing: Any) -> Any:
        if thing.size > MOST_CELLS and thing.dtype.kind == "O":
            raise ValueError(f"{thing.name[:100]} has {thing.size} cells; expected at most {MOST_CELLS}")
        return thing[()]

    def _rows(self, thing: Any) -> list[str]:
        """The lines of a char array, which stands transposed in the file."""
        if thing.size > MOST_CELLS:
            raise ValueError(f"{thing.name[:100]} is a text of {thing.size} characters")
        codes = np.atleast_2d(np.asarray(self._read(thing)))
        return [
            "".join(map(chr, line)).rstrip() for line in codes.reshape(codes.shape[0], -1).T.tolist()
        ] or [""]

    def _strings(self, thing: Any) -> Any:
        items = [
            x.decode("utf-8", "replace") if isinstance(x, bytes) else str(x)
            for x in np.ravel(self._read(thing))
        ]
        return items[0][:LONGEST_TEXT] if len(items) == 1 else Texts(len(items), lambda: items)

    def _text_of(self, item: Any) -> str | None:
        if _text(item.attrs.get("MATLAB_class", b"")) != "char":
            return None
        if "MATLAB_empty" in item.attrs:
            return ""
        rows = self._rows(item)
        return rows[0] if len(rows) == 1 else None
