"""Channels on times of their own, as recorders of buses write them, onto the time base of the wheel speeds."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim2real.logs.contract import TIME
from sim2real.logs.errors import LogError
from sim2real.logs.resampling import DECIMATION, SLOWEST_S, hold, last_index, median_step, onto
from sim2real.logs.table import Array, Finding, Table, Text, Wanted, labels_of, numbered

SLOW_STEP_S = 0.05
"""A channel slower than this is interpolated with a warning: what happens between its samples is not known [s]."""

TIME_SYNC = 1
"""MDF's number for a master channel that is time (2 is angle, 3 distance, 4 index)."""

UNEVEN_SHARE = 0.05
"""Share of the base's steps off by more than half a step from which on its times are no clock [-]."""


@dataclass(frozen=True)
class Channel:
    """One channel of a file.

    Attributes
    ----------
    time_s, samples : array, shape (n,)
        Its own times, ascending [s], and its values, numbers or text; empty where a sample is neither.
    unit : str
        As the file states it; empty without one.
    invalid : array of bool, shape (n,), or None
        Which samples the file marks as invalid.
    plain : bool
        Whether a sample is one number or one text.
    kind : str
        What messages call its values.
    sync : int or None
        MDF's number for the kind of its master; None for time.
    """

    time_s: Array
    samples: NDArray[Any]
    unit: str = ""
    invalid: NDArray[np.bool_] | None = None
    plain: bool = True
    kind: str = "numbers"
    sync: int | None = None

    @property
    def is_text(self) -> bool:
        """Whether a sample is a text."""
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


def table_of(
    path: Path,
    names: Collection[str],
    masters: Collection[str],
    channels: Mapping[str, Channel],
    wanted: Wanted,
    notes: tuple[str, ...] = (),
) -> Table:
    """The wanted channels on the times of the first wheel speed; its rows are samples and count from 1.

    Faster channels are averaged over a sample of the base, slower ones interpolated, classes held. Where the base comes
    unevenly, its mean step makes even times. The master channels go by their own names and by time_s.

    Parameters
    ----------
    path : Path
        The file, for messages.
    names, masters : collection of str
        All of its channels, and those of time among or beside them.
    channels : mapping
        The wanted ones.
    wanted : Wanted
        What of the file is read.
    notes : tuple of str
        How the file was understood.

    Raises
    ------
    LogError
        The base has fewer than two samples.
    """
    every = tuple(dict.fromkeys((*names, *masters, *({TIME} & wanted.numbers))))
    units = {name: channel.unit for name, channel in channels.items() if channel.unit}
    base = next((name for name in (*wanted.base, *channels) if name in channels), None)
    if base is None:
        return Table(every, {}, {}, np.arange(0), (), units, notes)
    time_s = np.asarray(channels[base].time_s, dtype=np.float64)
    if len(time_s) < 2:
        raise LogError(f"{path}: channel {base} has fewer than two samples; expected one per time.")
    text: dict[str, Text] = {}
    findings: list[Finding] = []
    step = median_step(time_s)
    uneven = np.count_nonzero(np.abs(np.diff(time_s) - step) > 0.5 * step)
    is_uneven = bool(uneven > UNEVEN_SHARE * len(time_s) and np.all(np.diff(time_s) > 0.0))
    if is_uneven:
        step = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)  # the median is that of bursts
        time_s = np.arange(time_s[0], time_s[-1], step)
        findings.append(
            Finding(
                f"channel {base} is sampled unevenly: {uneven} of its samples are more than half a step "
                f"({500.0 * step:.3g} ms) off. All channels are interpolated onto an even {1.0 / step:.4g} Hz.",
                fatal=False,
            )
        )
    numbers: dict[str, Array] = {n: time_s for n in (*masters, TIME) if n in wanted.numbers}
    for name, channel in channels.items():
        problem = _problem(name, channel, wanted, time_s)
        if problem:
            findings.append(Finding(f"channel {name} {problem}"))
        elif name in wanted.text:
            labels = ["", *channel.labels()]
            text[name] = labels_of([labels[i + 1] for i in last_index(channel.time_s, time_s)])
        else:
            held = name in wanted.held
            bridged = is_uneven and not held
            numbers[name] = _bridged(channel, time_s) if bridged else _on_base(channel, time_s, held)
            findings += _slow(name, channel, time_s, name in wanted.held)
    return Table(every, numbers, text, np.arange(1, len(time_s) + 1), tuple(findings), units, notes)


def _problem(name: str, channel: Channel, wanted: Wanted, time_s: Array) -> str:
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


def _on_base(channel: Channel, time_s: Array, held: bool) -> Array:
    values = channel.values()
    if np.array_equal(channel.time_s, time_s):
        return values
    if held:
        return hold(channel.time_s, values, time_s)
    return onto(channel.time_s, values, time_s, median_step(time_s))


def _bridged(channel: Channel, time_s: Array) -> Array:
    """A channel without a clock, as a line through its samples; lost where they are further apart than `SLOWEST_S`."""
    values = channel.values()
    known = np.isfinite(values)
    own, values = channel.time_s[known], values[known]
    if len(own) < 2:
        return np.full(len(time_s), np.nan)
    after = np.clip(np.searchsorted(own, time_s), 1, len(own) - 1)
    lost = (time_s < own[0]) | (time_s > own[-1]) | (own[after] - own[after - 1] > SLOWEST_S)
    return np.where(lost, np.nan, np.interp(time_s, own, values))


def _slow(name: str, channel: Channel, time_s: Array, held: bool) -> list[Finding]:
    """A warning where a channel is much slower than the base."""
    own, base = median_step(channel.time_s), median_step(time_s)
    if held or own <= SLOW_STEP_S or own < DECIMATION * base:
        return []
    text = f"channel {name} comes at {1.0 / own:.3g} Hz and was interpolated onto {1.0 / base:.4g} Hz."
    return [Finding(text, fatal=False)]
