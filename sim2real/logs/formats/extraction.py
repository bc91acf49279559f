"""Channels out of files whose readers trust them, by a process of its own that may crash, hang or be refused memory."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.errors import LogError
from sim2real.logs.rasters import Channel
from sim2real.logs.table import MOST_NUMBERS

EXTRACTOR = Path(__file__).with_name("extractor.py")
"""Runs as a program of its own: on damaged files a reader may crash the interpreter."""

LEAST_LIMIT_S, LIMIT_S_PER_MB = 60.0, 1.0
"""Reading takes seconds, some for every 100 MB; a damaged file may keep the reader busy for ever."""

LEAST_MEMORY_BYTES, MEMORY_PER_BYTE = 300_000_000, 20
"""What the reader may take for a file: its blocks are packed, but seldom to less than a tenth [bytes]."""


@dataclass(frozen=True)
class Extract:
    """What a reader took out of a file.

    Attributes
    ----------
    told : dict
        What it says of the file.
    arrays : dict of array
        By key; `told` says what each is.
    """

    told: dict[str, Any]
    arrays: dict[str, NDArray[Any]]

    def channels(self) -> dict[str, Channel]:
        """The channels that `told` describes under "channels", by name."""
        return {name: self._channel(**said) for name, said in self.told.get("channels", {}).items()}

    def _channel(self, key: str, plain: bool, **said: Any) -> Channel:
        none = np.zeros(0)
        time_s, samples = (self.arrays[f"{what}_{key}"] if plain else none for what in ("time", "samples"))
        return Channel(time_s, samples, plain=plain, invalid=self.arrays.get(f"invalid_{key}"), **said)


def extract(path: Path, reader: str, kind: str, expected: str, **order: Any) -> Extract:
    """What a reader, a module beside this one, takes out of a file.

    Parameters
    ----------
    path : Path
        The file.
    reader : str
        The module's name.
    kind, expected : str
        What messages call the format, and what they expect: "MDF", "a whole MDF4 file".
    **order
        What else the reader is told.

    Raises
    ------
    LogError
        The file is damaged, too large, or takes too long.
    ModuleNotFoundError
        The reader needs a package that is not installed.
    """
    size = path.stat().st_size
    limit_s = LEAST_LIMIT_S + LIMIT_S_PER_MB * size * 1e-6
    bounds = {"most_numbers": MOST_NUMBERS, "most_bytes": LEAST_MEMORY_BYTES + MEMORY_PER_BYTE * size}
    try:
        done = subprocess.run(
            [sys.executable, "-P", EXTRACTOR],
            input=json.dumps({"reader": reader, "path": str(path), **bounds, **order}).encode(),
            capture_output=True,
            timeout=limit_s,
            check=True,
        )
        with np.load(BytesIO(done.stdout), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        told: dict[str, Any] = json.loads(arrays.pop("told").tobytes())
    except subprocess.TimeoutExpired as error:
        raise LogError(
            f"{path}: is no {kind} that can be read within {limit_s:.0f} s; {expected}."
        ) from error
    except (subprocess.CalledProcessError, zipfile.BadZipFile, EOFError) as error:
        raise LogError(f"{path}: cannot be read as {kind}; {expected}.") from error
    if "missing" in told:
        raise ModuleNotFoundError(f"No module named {told['missing']!r}", name=told["missing"])
    if "refused" in told:
        raise LogError(f"{path}: cannot be read as {kind} ({told['refused']}); {expected}.")
    return Extract(told, arrays)
