"""Takes single channels out of an MDF file; run as a program of its own by `sim2real.logs.mdf_file`.

asammdf reads block addresses and record sizes from the file and trusts them: on damaged files it raises anything,
prints tracebacks of its own, unpacks without end, and can crash the interpreter. In a process of its own, whose memory
is bounded and which ends with its parent, that is one clean error.

It also hands a channel's conversion formula, text of the file's, to numexpr and SymPy, which run it as Python. So
neither is there: in their place stands `sim2real.logs.formula`, which is arithmetic alone.

It reads JSON, path and names, from standard input and writes arrays by name (npz) to standard output, in which
"told" is JSON. Whatever a library prints goes to standard error. Nothing of ours is imported as a package, so that it
starts fast.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import signal
import sys
from collections import Counter
from collections.abc import Collection
from io import BufferedReader, BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

DEATH_OF_PARENT = 1
"""Linux's number of the wish to get a signal when the parent ends: PR_SET_PDEATHSIG."""


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


if __name__ == "__main__":
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DEATH_OF_PARENT, signal.SIGKILL)
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

replace_evaluators()

import numpy as np  # noqa: E402
from asammdf import MDF, Signal  # noqa: E402

UNFINISHED = b"UnFinMF"
"""Start of an MDF that its recorder did not close."""


def bound_memory(most_bytes: int) -> None:
    """Let this process take so much more than it has now, where the system can tell; what needs more is refused."""
    if sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
        limit = pages * resource.getpagesize() + most_bytes
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def extract(path: Path, wanted: Collection[str], most_numbers: int) -> dict[str, Any]:
    """Arrays by name: "told" (JSON: names of all channels, masters, wanted channels), and each one's samples.

    A channel name that several groups have becomes NAME#GROUP. Raises ValueError where the wanted channels hold more
    than `most_numbers` samples.
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
        numbers = sum(int(groups[places[name][0]].channel_group.cycles_nr) for name in found)
        if numbers > most_numbers:
            raise ValueError(
                f"{numbers} samples in the channels that are read; expected at most {most_numbers}"
            )
        signals = mdf.select([(None, *places[name]) for name in found], ignore_value2text_conversions=True)
        arrays: dict[str, Any] = {}
        channels = {
            name: _told(str(k), s, arrays) for k, (name, s) in enumerate(zip(found, signals, strict=True))
        }
        told = {
            "names": list(places),
            "masters": [str(groups[g].channels[i].name) for g, i in mdf.masters_db.items()],
            "channels": channels,
        }
        return {**arrays, "told": np.frombuffer(json.dumps(told).encode(), np.uint8)}


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


if __name__ == "__main__":
    order = json.load(sys.stdin)
    bound_memory(order["most_bytes"])
    try:
        content = extract(Path(order["path"]), frozenset(order["wanted"]), order["most_numbers"])
    except Exception as error:  # noqa: BLE001 - asammdf raises anything on a damaged file
        reason = " ".join(str(error).split())[:300] if isinstance(error, ValueError) else type(error).__name__
        content = {"told": np.frombuffer(json.dumps({"refused": reason}).encode(), np.uint8)}
    np.savez(answer, **content)
    answer.close()
