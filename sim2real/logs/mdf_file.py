"""Reading MDF (versions 3 and 4): channels of several rasters come onto the time base of the wheel speeds."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.contract import TIME
from sim2real.logs.errors import LogError
from sim2real.logs.resampling import DECIMATION, hold, last_index, median_step, onto
from sim2real.logs.table import Array, Finding, Table, Text, Wanted, numbered

EXTRACTOR = Path(__file__).with_name("mdf_channels.py")
"""Runs as a program of its own: on damaged files asammdf may crash the interpreter."""

LEAST_LIMIT_S, LIMIT_S_PER_MB = 60.0, 1.0
"""Reading takes seconds, some for every 100 MB; a damaged file may keep the reader busy for ever."""

SLOW_STEP_S = 0.05
"""A channel slower than this is interpolated with a warning: what happens between its samples is not known [s]."""

TIME_SYNC = 1
"""MDF's number for a master channel that is time (2 is angle, 3 distance, 4 index)."""


@dataclass(frozen=True)
class _Channel:
    """One channel: its times [s], samples, which of them are marked invalid, and what kind of master it has."""

    time_s: Array
    samples: NDArray[Any]
    invalid: NDArray[np.bool_] | None
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
    content = _extract(path, wanted.numbers | wanted.text)
    channels = {name: _Channel(**c) for name, c in content["channels"].items()}
    names = tuple(dict.fromkeys((*content["names"], *content["masters"], *({TIME} & wanted.numbers))))
    base = next((name for name in (*wanted.base, *channels) if name in channels), None)
    if base is None:
        return Table(names, {}, {}, np.arange(0), ())
    time_s = np.asarray(channels[base].time_s, dtype=np.float64)
    if len(time_s) < 2:
        raise LogError(f"{path}: channel {base} has fewer than two samples; expected one per time.")
    numbers: dict[str, Array] = {n: time_s for n in (*content["masters"], TIME) if n in wanted.numbers}
    text: dict[str, Text] = {}
    findings: list[Finding] = []
    for name, channel in channels.items():
        problem = _problem(name, channel, wanted, time_s)
        if problem:
            findings.append(Finding(f"channel {name} {problem}"))
        elif name in wanted.text:
            labels = ["", *channel.labels()]
            text[name] = np.array([labels[i + 1] for i in last_index(channel.time_s, time_s)], dtype=np.str_)
        else:
            numbers[name] = _on_base(channel, time_s, name in wanted.held)
            findings += _slow(name, channel, time_s, name in wanted.held)
    return Table(names, numbers, text, np.arange(1, len(time_s) + 1), tuple(findings))


def _extract(path: Path, names: frozenset[str]) -> dict[str, Any]:
    limit_s = LEAST_LIMIT_S + LIMIT_S_PER_MB * path.stat().st_size * 1e-6
    try:
        done = subprocess.run(
            [sys.executable, "-P", EXTRACTOR],
            input=pickle.dumps((path, names)),
            capture_output=True,
            timeout=limit_s,
            check=True,
        )
    except subprocess.TimeoutExpired as error:
        raise LogError(
            f"{path}: is no MDF that can be read within {limit_s:.0f} s; expected a whole file."
        ) from error
    except subprocess.CalledProcessError as error:
        last = error.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        why = f" ({last.partition(': ')[2]})" if "MdfException: " in last else ""
        raise LogError(f"{path}: cannot be read as MDF{why}; expected a whole MDF3 or MDF4 file.") from error
    content: dict[str, Any] = pickle.loads(done.stdout)
    return content


def _problem(name: str, channel: _Channel, wanted: Wanted, time_s: Array) -> str:
    """What keeps a channel from being used; empty when nothing does."""
    own, samples = channel.time_s, channel.samples
    if samples.ndim != 1 or samples.dtype.fields:
        return "holds several values per sample; expected one number."
    if not np.array_equal(own, time_s) and (len(own) < 2 or not np.all(np.diff(own) > 0.0)):
        return "has fewer than two samples, or times that do not ascend; expected ascending times."
    if channel.sync not in (None, TIME_SYNC):
        return "is recorded over an angle, a distance or an index; expected a time."
    if channel.is_text and name not in wanted.text | wanted.identifiers:
        return "holds text; expected numbers."
    if not channel.is_text and (name in wanted.text or samples.dtype.kind not in "fiu"):
        return f"holds {samples.dtype}; expected {'text' if name in wanted.text else 'numbers'}."
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
