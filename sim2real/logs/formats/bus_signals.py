"""Signals out of the frames of a bus, as DBC files describe them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cantools.database import DecodeError
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from sim2real.logs.errors import LogError
from sim2real.logs.formats.dbc import DAMAGE, load_dbc, no_value
from sim2real.logs.rasters import Channel
from sim2real.logs.table import MOST_OUT_OF_ORDER, Array, Finding
from trpac_core.files import quoted

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Lengths that a frame can have; a message of another one is sent in the next longer frame [bytes]."""
HALF_STEP = 0.5
"""A value may pass its stated range by so many steps of its raw value: ranges in DBC files are rounded."""


@dataclass(frozen=True)
class Described:
    """One signal of a DBC file, with its message."""

    message: Message
    signal: Signal
    source: Path

    @property
    def name(self) -> str:
        """MESSAGE.SIGNAL."""
        return f"{self.message.name}.{self.signal.name}"

    @property
    def kind(self) -> tuple[int, bool]:
        """ID of its frames, and whether that has 29 bits."""
        return self.message.frame_id, self.message.is_extended_frame


@dataclass(frozen=True)
class Frames:
    """Frames of one ID on one channel of the bus.

    Attributes
    ----------
    channel : str
        As the log names it.
    time_s : array, shape (n,)
        In the log's order [s].
    lengths : array, shape (n,)
        Bytes of each.
    data : bytes
        All of them, one after another.
    """

    channel: str
    time_s: Array
    lengths: NDArray[np.uint8]
    data: bytes

    def rows(self, rows: NDArray[np.intp]) -> Frames:
        """These of them, in this order."""
        ends = np.cumsum(self.lengths, dtype=np.int64).tolist()
        widths = self.lengths.tolist()
        data = b"".join(self.data[ends[i] - widths[i] : ends[i]] for i in rows.tolist())
        return Frames(self.channel, self.time_s[rows], self.lengths[rows], data)


class Catalogue:
    """The signals of DBC files by their names: MESSAGE.SIGNAL, and SIGNAL, which several messages may have."""

    def __init__(self, dbc: Iterable[str | Path]) -> None:
        self.all = [
            Described(message, signal, Path(path))
            for path in dbc
            for message in load_dbc(path).messages
            for signal in message.signals
        ]
        self._named: dict[str, list[Described]] = {}
        for each in self.all:
            for name in (each.name, each.signal.name):
                self._named.setdefault(name, []).append(each)

    def wanted(self, names: Collection[str]) -> dict[str, tuple[Described, str]]:
        """The signals that these names mean, each with the channel of the bus that stands behind a #, or "".

        Raises
        ------
        LogError
            A name means several signals.
        """
        found: dict[str, tuple[Described, str]] = {}
        problems = []
        for name in sorted(names):
            plain, _, channel = name.partition("#")
            meant = self._named.get(plain, [])
            if len(meant) > 1:
                several = ", ".join(f"{each.name} ({quoted(each.source.name)})" for each in meant)
                problems.append(
                    f"signal {quoted(plain)} stands for several: {several}; expected a mapping with one of these, "
                    "or DBC files without the others."
                )
            elif meant:
                found[name] = meant[0], channel
        if problems:
            raise LogError("\n".join(problems))
        return found


def merged(parts: Sequence[Frames]) -> Frames:
    """The frames of one channel that stand in several places of a file, by time."""
    if len(parts) == 1:
        return parts[0]
    time_s = np.concatenate([part.time_s for part in parts])
    lengths = np.concatenate([part.lengths for part in parts])
    every = Frames(parts[0].channel, time_s, lengths, b"".join(part.data for part in parts))
    return every.rows(np.argsort(time_s, kind="stable"))


def ordered(name: str, frames: Frames) -> tuple[Frames, list[Finding]]:
    """The frames by time, of those of one time the last, and a warning where they were not; a fatal one of many."""
    time_s = frames.time_s
    late = np.flatnonzero(time_s < np.maximum.accumulate(time_s))
    rows = np.argsort(time_s, kind="stable")
    last = np.append(np.diff(time_s[rows]) > 0.0, True)
    repeated = time_s[rows[~last]]
    if not len(late) and not len(repeated):
        return frames, []
    first_s = time_s[late[0]] if len(late) else repeated[0]
    text = (
        f"message {name}: of {len(time_s)} frames {len(late)} are late and {len(repeated)} repeat a time, the first at "
        f"{first_s:.3f} s"
    )
    if len(late) + len(repeated) > MOST_OUT_OF_ORDER * len(time_s):
        return frames, [Finding(f"{text}; expected ascending times.")]
    told = Finding(f"{text}; they were sorted, and the last of each time kept.", fatal=False)
    return frames.rows(rows[last]), [told]


def decoded(
    message: Message, frames: Frames, signals: Sequence[Signal]
) -> tuple[dict[str, Channel], list[Finding]]:
    """Signals of one message by their names, and what is wrong with its frames.

    Frames of another length than the message's are left aside; a multiplexed signal has samples where its frames carry
    it. Samples that the value table names as invalid, that are no finite number, or that lie outside the stated range,
    are lost.
    """
    length = next((n for n in FD_LENGTHS if n >= message.length), message.length)
    right = (frames.lengths == length) | (frames.lengths == message.length)
    findings = []
    if not right.all():
        others = ", ".join(map(str, np.unique(frames.lengths[~right])[:3].tolist()))
        text = (
            f"message {message.name}: {np.count_nonzero(~right)} of {len(right)} frames have {others} bytes; "
            f"{message.length} by the DBC file"
        )
        findings.append(
            Finding(f"{text}.") if not right.any() else Finding(f"{text}. They are ignored.", fatal=False)
        )
    rows: list[list[int]] = [[] for _ in signals]
    raws: list[list[float]] = [[] for _ in signals]
    names = [signal.name for signal in signals]
    ends = np.cumsum(frames.lengths, dtype=np.int64).tolist()
    widths, data, undescribed = frames.lengths.tolist(), frames.data, 0
    for i in np.flatnonzero(right).tolist():
        try:
            found = message.decode(data[ends[i] - widths[i] : ends[i]], decode_choices=False, scaling=False)
        except DecodeError:  # a branch of the multiplexer that the file does not describe
            undescribed += 1
            continue
        except DAMAGE as error:
            text = f"message {message.name} cannot be decoded: {quoted(error)}; expected another DBC file."
            return {}, [*findings, Finding(text)]
        for k, name in enumerate(names):
            if (raw := found.get(name)) is not None:  # type: ignore[union-attr]
                rows[k].append(i)
                raws[k].append(float(raw))  # type: ignore[arg-type]
    if undescribed and not all(signal.multiplexer_ids for signal in signals):
        text = (
            f"message {message.name}: {undescribed} frames have a multiplexer that the DBC file does not describe; "
            "their other signals are lost samples."
        )
        findings.append(Finding(text, fatal=False))
    channels = {}
    for k, signal in enumerate(signals):
        time_s = frames.time_s[rows[k]]
        values, lost = _values(f"{message.name}.{signal.name}", signal, time_s, np.array(raws[k]))
        channels[signal.name] = Channel(time_s, values, unit=signal.unit or "")
        findings += lost
    return channels, findings


def _values(name: str, signal: Signal, time_s: Array, raw: Array) -> tuple[Array, list[Finding]]:
    """Values in the signal's unit, NaN where lost, and a warning of those."""
    values = raw * float(signal.scale) + float(signal.offset)
    none = ~np.isfinite(values) | np.isin(raw, list(no_value(signal)))
    low = -np.inf if signal.minimum is None else float(signal.minimum)
    high = np.inf if signal.maximum is None else float(signal.maximum)
    slack = 0.0 if signal.is_float else HALF_STEP * abs(float(signal.scale))
    outside = (
        ~none & ((values < low - slack) | (values > high + slack)) if low < high else np.zeros_like(none)
    )
    lost = none | outside
    if not lost.any():
        return values, []
    parts = [
        f"{np.count_nonzero(which)} {what}"
        for which, what in (
            (none, "marked as no value"),
            (outside, f"outside [{low:g}, {high:g}] {signal.unit or ''}".rstrip()),
        )
        if which.any()
    ]
    text = (
        f"signal {name}: {np.count_nonzero(lost)} of {len(lost)} samples are lost, the first at "
        f"{time_s[np.flatnonzero(lost)[0]]:.3f} s: {', '.join(parts)} by the DBC file."
    )
    return np.where(lost, np.nan, values), [Finding(text, fatal=False)]
