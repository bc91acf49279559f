"""Takes single channels out of an MDF file; run as a program of its own by `sim2real.logs.mdf_file`.

asammdf reads block addresses and record sizes from the file and trusts them: on damaged files it raises anything,
prints tracebacks of its own, and can crash the interpreter. In a process of its own that is one clean error.

It also hands a channel's conversion formula, text of the file's, to SymPy where numexpr cannot evaluate it, and SymPy
runs it as Python. So SymPy is kept from it, which halves the time to start, too.

It reads a pickled (path, names) from standard input and writes a pickled dict to standard output. Nothing
of ours is imported here, so that it starts fast.
"""

from __future__ import annotations

import pickle
import sys
from collections import Counter
from collections.abc import Collection
from io import BufferedReader, BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn


def refuse_formula(_: object, formula: str, **__: object) -> NoReturn:
    """In the place of `sympy.lambdify`: one clean error. Raises MdfException."""
    from asammdf.blocks.utils import MdfException

    raise MdfException(f"the formula {formula!r} of a channel is not one of numbers alone")


if __name__ == "__main__":
    sys.modules["sympy"] = ModuleType("sympy")
    sys.modules["sympy"].__dict__.update(symbols=str, lambdify=refuse_formula)

import numpy as np  # noqa: E402
from asammdf import MDF, Signal  # noqa: E402

UNFINISHED = b"UnFinMF"
"""Start of an MDF that its recorder did not close."""


def extract(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """Names of all channels and of the masters, and the wanted channels' samples.

    A channel name that several groups have becomes NAME#GROUP.
    """
    with _open(path) as stream, MDF(stream) as mdf:
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
        signals = mdf.select([(None, *places[name]) for name in found], ignore_value2text_conversions=True)
        return {
            "names": list(places),
            "masters": [str(groups[g].channels[i].name) for g, i in mdf.masters_db.items()],
            "channels": {name: _content(signal) for name, signal in zip(found, signals, strict=True)},
        }


def _content(signal: Signal) -> dict[str, Any]:
    return {
        "time_s": signal.timestamps,
        "samples": signal.samples,
        "invalid": None
        if signal.invalidation_bits is None
        else np.asarray(signal.invalidation_bits, dtype=bool),
        "sync": signal.master_metadata[1] if signal.master_metadata else None,
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


if __name__ == "__main__":
    pickle.dump(extract(*pickle.load(sys.stdin.buffer)), sys.stdout.buffer)
