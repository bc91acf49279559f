"""Reading MDF (versions 3 and 4)."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from sim2real.logs.errors import LogError
from sim2real.logs.rasters import Channel, table_of
from sim2real.logs.table import MOST_NUMBERS, Table, Wanted

EXTRACTOR = Path(__file__).with_name("mdf_channels.py")
"""Runs as a program of its own: on damaged files asammdf may crash the interpreter."""

LEAST_LIMIT_S, LIMIT_S_PER_MB = 60.0, 1.0
"""Reading takes seconds, some for every 100 MB; a damaged file may keep the reader busy for ever."""

LEAST_MEMORY_BYTES, MEMORY_PER_BYTE = 300_000_000, 20
"""What the reader may take for a file: its blocks are packed, but seldom to less than a tenth [bytes]."""


def read_mdf(path: Path, wanted: Wanted) -> Table:
    """Read the wanted channels; raises LogError where the file is damaged or has no time base, see `table_of`.

    A name that several groups have is told apart as NAME#GROUP.
    """
    told, channels = _extract(path, wanted.numbers | wanted.text)
    return table_of(path, told["names"], told["masters"], channels, wanted)


def _extract(path: Path, names: frozenset[str]) -> tuple[dict[str, Any], dict[str, Channel]]:
    """What the file holds, and the named channels; raises LogError."""
    size = path.stat().st_size
    limit_s = LEAST_LIMIT_S + LIMIT_S_PER_MB * size * 1e-6
    order = {
        "path": str(path),
        "wanted": sorted(names),
        "most_numbers": MOST_NUMBERS,
        "most_bytes": LEAST_MEMORY_BYTES + MEMORY_PER_BYTE * size,
    }
    try:
        done = subprocess.run(
            [sys.executable, "-P", EXTRACTOR],
            input=json.dumps(order).encode(),
            capture_output=True,
            timeout=limit_s,
            check=True,
        )
        with np.load(BytesIO(done.stdout), allow_pickle=False) as arrays:
            told: dict[str, Any] = json.loads(arrays["told"].tobytes())
            channels = {name: _channel(said, arrays) for name, said in told.get("channels", {}).items()}
    except subprocess.TimeoutExpired as error:
        raise LogError(
            f"{path}: is no MDF that can be read within {limit_s:.0f} s; expected a whole file."
        ) from error
    except (subprocess.CalledProcessError, zipfile.BadZipFile, EOFError) as error:
        raise LogError(f"{path}: cannot be read as MDF; expected a whole MDF3 or MDF4 file.") from error
    if "refused" in told:
        raise LogError(
            f"{path}: cannot be read as MDF ({told['refused']}); expected a whole MDF3 or MDF4 file."
        )
    return told, channels


def _channel(said: dict[str, Any], arrays: Any) -> Channel:
    key, none = said.pop("key"), np.zeros(0)
    time_s, samples = (arrays[f"{what}_{key}"] if said["plain"] else none for what in ("time", "samples"))
    return Channel(time_s, samples, invalid=arrays.get(f"invalid_{key}"), **said)
