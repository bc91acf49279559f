"""Reading MDF (versions 3 and 4): channels of several rasters come onto the time base of the wheel speeds."""

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

from sim2real.logs.contract import TIME
from sim2real.logs.errors import LogError
from sim2real.logs.resampling import DECIMATION, hold, last_index, median_step, onto
from sim2real.logs.table import MOST_NUMBERS, Array, Finding, Table, Text, Wanted, labels_of, numbered

EXTRACTOR = Path(__file__).with_name("mdf_channels.py")
"""Runs as a program of its own: on damaged files asammdf may crash the interpreter."""

LEAST_LIMIT_S, LIMIT_S_PER_MB = 60.0, 1.0
"""Reading takes seconds, some for every 100 MB; a damaged file may keep the reader busy for ever."""

LEAST_MEMORY_BYTES, MEMORY_PER_BYTE = 300_000_000, 20
"""What the reader may take for a file: its blocks are packed, but seldom to less than a tenth [bytes]."""

SLOW_STEP_S = 0.05
"""A channel slower than this is interpolated with a warning: what happens between its samples is not known [s]."""

TIME_SYNC = 1
"""MDF's number for a master channel that is time (2 is angle, 3 distance, 4 index)."""


@dataclass(frozen=True)
class _Channel:
    """One channel: its times [s], samples, which are marked invalid, what they are, and what kind of master it has.

    Where a sample is more than one number or text, there is no `time_s` and no `samples`.
    """

    time_s: Array
    samples: NDArray[Any]
    invalid: NDArray[np.bool_] | None
    plain: bool
    kind: str
    sync: int | None

    @property
    def is_text(self) -> bool:
        return self.samples.dtype.kind in "SU"

    def labels(self) -> list[str]:
        """Its samples as text, "" where invalid."""
        lost = np.zeros(len(self.samples), dtype=bool) if self.invalid is None else self.invalid
        texts = [x.decode("utf-8", "replace") if isinstance(x, bytes) else str(x) for x in self.samples]
        return ["" if gone else text for text, gone in zip(texts, lost, strict=True)]

    def values(self) -> Array:
        """Its samples as numbers, NaN where invalid."""
        if self.is_text:
            return numbered(self.labels())
        values = self.samples.astype(np.float64)
        return values if self.invalid is None else np.where(self.invalid, np.nan, values)


def read_mdf(path: Path, wanted: Wanted) -> Table:
    """Read the wanted channels; samples count from 1. Raises LogError where the file is damaged or has no time base.

    Faster channels are averaged over a sample of the base, slower ones interpolated, classes held. A name that several
    groups have is told apart as NAME#GROUP; the master channels go by their own names and by time_s.
    """
    told, channels = _extract(path, wanted.numbers | wanted.text)
    names = tuple(dict.fromkeys((*told["names"], *told["masters"], *({TIME} & wanted.numbers))))
    base = next((name for name in (*wanted.base, *channels) if name in channels), None)
    if base is None:
        return Table(names, {}, {}, np.arange(0), ())
    time_s = np.asarray(channels[base].time_s, dtype=np.float64)
    if len(time_s) < 2:
        raise LogError(f"{path}: channel {base} has fewer than two samples; expected one per time.")
    numbers: dict[str, Array] = {n: time_s for n in (*told["masters"], TIME) if n in wanted.numbers}
    text: dict[str, Text] = {}
    findings: list[Finding] = []
    for name, channel in channels.items():
        problem = _problem(name, channel, wanted, time_s)
        if problem:
            findings.append(Finding(f"channel {name} {problem}"))
        elif name in wanted.text:
            labels = ["", *channel.labels()]
            text[name] = labels_of([labels[i + 1] for i in last_index(channel.time_s, time_s)])
        else:
            numbers[name] = _on_base(channel, time_s, name in wanted.held)
            findings += _slow(name, channel, time_s, name in wanted.held)
    return Table(names, numbers, text, np.arange(1, len(time_s) + 1), tuple(findings))


def _extract(path: Path, names: frozenset[str]) -> tuple[dict[str, Any], dict[str, _Channel]]:
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


def _channel(said: dict[str, Any], arrays: Any) -> _Channel:
    key, none = said.pop("key"), np.zeros(0)
    time_s, samples = (arrays[f"{what}_{key}"] if said["plain"] else none for what in ("time", "samples"))
    return _Channel(time_s, samples, arrays.get(f"invalid_{key}"), **said)


def _problem(name: str, channel: _Channel, wanted: Wanted, time_s: Array) -> str:
    """What keeps a channel from being used; empty when nothing does."""
    own, samples = channel.time_s, channel.samples
    if not channel.plain:
        return f"holds {channel.kind} per sample; expected one number."
    if not np.array_equal(own, time_s) and (len(own) < 2 or not np.all(np.diff(own) > 0.0)):
        return "has fewer than two samples, or times that do not ascend; expected ascending times."
    if channel.sync not in (None, TIME_SYNC):
        return "is recorded over an angle, a distance or an index; expected a time."
    if channel.is_text and name not in wanted.text | wanted.identifiers:
        return "holds text; expected numbers."
    if not channel.is_text and (name in wanted.text or samples.dtype.kind not in "fiu"):
        return f"holds {channel.kind}; expected {'text' if name in wanted.text else 'numbers'}."
    return ""


def _on_base(channel: _Channel, time_s: Array, held: bool) -> Array:
    values = channel.values()
    if np.array_equal(channel.time_s, time_s):
        return values
    if held:
        return hold(channel.time_s, values, time_s)
    return onto(channel.time_s, values, time_s, median_step(time_s))


def _slow(name: str, channel: _Channel, time_s: Array, held: bool) -> list[Finding]:
    """A warning where a channel is much slower than the base."""
    own, base = median_step(channel.time_s), median_step(time_s)
    if held or own <= SLOW_STEP_S or own < DECIMATION * base:
        return []
    text = f"channel {name} comes at {1.0 / own:.3g} Hz and was interpolated onto {1.0 / base:.4g} Hz."
    return [Finding(text, fatal=False)]
