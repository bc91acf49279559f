"""Reading MDF (versions 3 and 4): channels of several rasters come onto the time base of the wheel speeds."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.utils import MdfException

from sim2real.logs.contract import TIME
from sim2real.logs.errors import LogError
from sim2real.logs.resampling import hold, last_index, median_step, onto
from sim2real.logs.table import Array, Finding, Table, Text, Wanted, numbered

DAMAGE = (MdfException, OSError, ValueError, LookupError, TypeError, AttributeError, struct.error, zlib.error)
"""What asammdf raises on damaged files: it does not check before it reads."""

SLOW_STEP_S = 0.05
"""A channel slower than this is interpolated with a warning: what happens between its samples is not known."""

TIME_SYNC = 1
"""MDF's number for a master channel that is time (2 is angle, 3 distance, 4 index)."""


def read_mdf(path: Path, wanted: Wanted) -> Table:
    """Read the wanted channels; samples count from 1. Raises LogError where the file is damaged or has no time base.

    Faster channels are averaged over a sample of the base, slower ones interpolated, classes held. A name that several
    groups have is told apart as NAME#GROUP.
    """
    try:
        with MDF(path) as mdf:
            places = _places(mdf)
            masters = _masters(mdf)
            found = [name for name in places if name in wanted.numbers | wanted.text]
            signals = dict(
                zip(
                    found,
                    mdf.select([(None, *places[n]) for n in found], ignore_value2text_conversions=True),
                    strict=True,
                )
            )
    except DAMAGE as error:
        raise LogError(
            f"{path}: cannot be read as MDF ({error}); expected a whole MDF3 or MDF4 file."
        ) from error
    return _table(path, wanted, signals, tuple(dict.fromkeys((*places, *masters, TIME))), masters)


def _groups(mdf: MDF) -> list[Any]:
    return list(mdf.groups)  # those of the two versions have no type in common


def _places(mdf: MDF) -> dict[str, tuple[int, int]]:
    """Channel name to its group and index, masters left out; a name that several groups have becomes NAME#GROUP."""
    every = [
        (channel.name, g, i)
        for g, group in enumerate(_groups(mdf))
        for i, channel in enumerate(group.channels)
        if i != mdf.masters_db.get(g)
    ]
    count = Counter(name for name, _, _ in every)
    return {name if count[name] == 1 else f"{name}#{g}": (g, i) for name, g, i in every}


def _masters(mdf: MDF) -> tuple[str, ...]:
    groups = _groups(mdf)
    return tuple(dict.fromkeys(str(groups[g].channels[i].name) for g, i in mdf.masters_db.items()))


def _table(
    path: Path, wanted: Wanted, signals: dict[str, Signal], names: tuple[str, ...], masters: tuple[str, ...]
) -> Table:
    base = next((signals[name] for name in (*wanted.base, *signals) if name in signals), None)
    if base is None:
        return Table(names, {}, {}, np.arange(0), ())
    time_s = np.asarray(base.timestamps, dtype=np.float64)
    if len(time_s) < 2:
        raise LogError(f"{path}: channel {base.name} has fewer than two samples; expected one per time.")
    numbers: dict[str, Array] = {name: time_s for name in (*masters, TIME) if name in wanted.numbers}
    text: dict[str, Text] = {}
    findings: list[Finding] = []
    for name, signal in signals.items():
        problem = _problem(name, signal, wanted, time_s)
        if problem:
            findings.append(Finding(f"channel {name} {problem}"))
        elif name in wanted.text:
            text[name] = _held_text(signal, time_s)
        else:
            numbers[name] = _held_or_onto(signal, time_s, name in wanted.held)
            findings += _raster_notes(name, signal, time_s, name in wanted.held)
    return Table(names, numbers, text, np.arange(1, len(time_s) + 1), tuple(findings))


def _problem(name: str, signal: Signal, wanted: Wanted, time_s: Array) -> str:
    """What keeps a channel from being used; empty when nothing does."""
    if signal.samples.ndim != 1 or signal.samples.dtype.fields:
        return "holds several values per sample; expected one number."
    own = signal.timestamps
    if not np.array_equal(own, time_s) and (len(own) < 2 or not np.all(np.diff(own) > 0.0)):
        return "has fewer than two samples, or times that do not ascend; expected ascending times."
    if signal.master_metadata is not None and signal.master_metadata[1] != TIME_SYNC:
        return "is recorded over an angle, a distance or an index; expected a time."
    is_text = signal.samples.dtype.kind in "SU"
    if is_text and name not in wanted.text | wanted.identifiers:
        return "holds text; expected numbers."
    if not is_text and (name in wanted.text or signal.samples.dtype.kind not in "fiu"):
        return f"holds {signal.samples.dtype}; expected {'text' if name in wanted.text else 'numbers'}."
    return ""


def _labels(signal: Signal) -> list[str]:
    return [x.decode("utf-8", "replace") if isinstance(x, bytes) else str(x) for x in signal.samples]


def _held_text(signal: Signal, time_s: Array) -> Text:
    labels = ["", *_labels(signal)]
    return np.array([labels[i + 1] for i in last_index(signal.timestamps, time_s)], dtype=np.str_)


def _held_or_onto(signal: Signal, time_s: Array, held: bool) -> Array:
    is_text = signal.samples.dtype.kind in "SU"
    values = numbered(_labels(signal)) if is_text else signal.samples.astype(np.float64)
    if signal.invalidation_bits is not None:
        values = np.where(signal.invalidation_bits, np.nan, values)
    if np.array_equal(signal.timestamps, time_s):
        return values
    return (
        hold(signal.timestamps, values, time_s)
        if held
        else onto(signal.timestamps, values, time_s, median_step(time_s))
    )


def _raster_notes(name: str, signal: Signal, time_s: Array, held: bool) -> list[Finding]:
    """A warning where a channel is much slower than the base."""
    own, base = median_step(signal.timestamps), median_step(time_s)
    if held or own <= SLOW_STEP_S or own < 1.5 * base:
        return []
    return [
        Finding(
            f"channel {name} comes at {1.0 / own:.3g} Hz and was interpolated onto {1.0 / base:.4g} Hz.",
            fatal=False,
        )
    ]
