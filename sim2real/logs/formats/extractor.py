"""A program that takes channels out of a file whose reader trusts it; started by `sim2real.logs.formats.extraction`.

Readers of binary formats take addresses and sizes from the file: on damaged files they raise anything, print, unpack
without end, and can crash the interpreter. In a process of its own, whose memory is bounded and which ends with its
parent, that is one clean error.

It reads an order from standard input, JSON with the name of a reader, and writes arrays by name (npz) to standard
output, in which "told" is JSON. Whatever a library prints goes to standard error. Nothing of ours is imported as a
package, so that it starts fast: a reader is the module of that name beside this file, and its function `extract`.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

DEATH_OF_PARENT = 1
"""Linux's number of the wish to get a signal when the parent ends: PR_SET_PDEATHSIG."""


def beside(name: str) -> ModuleType:
    """The module of that name in this folder; raises ImportError where it is missing."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    if spec is None or spec.loader is None:
        raise ImportError(f"{name}.py is missing beside extractor.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def bound_memory(most_bytes: int) -> None:
    """Let this process take so much more than it has now, where the system can tell; what needs more is refused."""
    if sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
        limit = pages * resource.getpagesize() + most_bytes
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def main() -> None:
    """Carry out the order on standard input."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DEATH_OF_PARENT, signal.SIGKILL)
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    order: dict[str, Any] = json.load(sys.stdin)
    import numpy as np

    arrays: dict[str, Any] = {}
    try:
        reader = beside(order["reader"])
        bound_memory(order["most_bytes"])
        told, arrays = reader.extract(order)
    except ModuleNotFoundError as error:
        told = {"missing": error.name}
    except Exception as error:  # noqa: BLE001 - libraries raise anything on a damaged file
        plain = isinstance(error, ValueError)
        told = {"refused": " ".join(str(error).split())[:300] if plain else type(error).__name__}
    np.savez(answer, told=np.frombuffer(json.dumps(told).encode(), np.uint8), **arrays)
    answer.close()


if __name__ == "__main__":
    main()
