"""The raw frames of a bus log: BLF, ASC, candump, TRC; a reader of `sim2real.logs.formats.extractor`."""

from __future__ import annotations

import logging
import math
import os
import sys
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

_UNUSED = {"asammdf"} - set(sys.modules)
"""python-can loads it for MDF, which is not read here; it takes a second."""
sys.modules.update(dict.fromkeys(_UNUSED))  # type: ignore[arg-type]

from can.io.asc import ASCReader  # noqa: E402
from can.io.blf import BLFReader  # noqa: E402
from can.io.canutils import CanutilsLogReader  # noqa: E402
from can.io.trc import TRCReader  # noqa: E402
from can.message import Message  # noqa: E402

for _name in _UNUSED:
    del sys.modules[_name]

TEXT = {"ASC": ASCReader, "candump": CanutilsLogReader, "TRC": TRCReader}
MOST_SEEN = 5_000
"""IDs that are told, those with the most frames."""
LONGEST_LINE = 10_000
"""Bytes of a line of text; one frame of 64 bytes takes 300."""
LONGEST_FRAME = 64
"""Bytes of a frame of CAN FD."""
MOST_COMPLAINTS = 300_000
"""Warnings of python-can; more come from a damaged length that makes the reader stay where it is."""
MOST_AT_ONCE = 10_000
"""Frames of one time; likewise."""


class Lines:
    """The lines of a text file, none of them endless; `row` is the last one's number, `cut` whether it had no end.

    A last line without an end is left out: half a number is another number.
    """

    def __init__(self, file: BufferedReader) -> None:
        self.row = 0
        self.cut = False
        self._file = file

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = self._file.readline(LONGEST_LINE + 1)
        if len(line) > LONGEST_LINE:
            raise ValueError(f"row {self.row + 1} is longer than {LONGEST_LINE} bytes")
        self.cut = bool(line) and not line.endswith((b"\n", b"\r"))
        if not line or self.cut:
            raise StopIteration
        self.row += 1
        return line.decode("utf-8", "replace")

    def close(self) -> None:
        """Nothing: who opened the file closes it."""


class Complaints(logging.Handler):
    """Counts what python-can logs as a warning before it goes on; raises ValueError where it does not come on."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0

    def __enter__(self) -> Complaints:
        logging.getLogger("can").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger("can").removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Take note of one."""
        self.count += 1
        if self.count > MOST_COMPLAINTS:
            raise ValueError(record.getMessage())


def extract(order: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What JSON says of the log, and arrays by name.

    The order has the path, the form, the (ID, is extended) of wanted frames and the most frames of a log. Of each ID
    and channel of the bus, "frames" holds a key: its frames' times [s], their lengths, and all their bytes, are the
    arrays time_, length_ and data_KEY. Remote and error frames are left out.

    Raises
    ------
    ValueError
        The text of a row cannot be read, or there are more frames.
    """
    with Complaints() as complaints, Path(order["path"]).open("rb") as file:
        if order["form"] == "BLF":
            blf = BLFReader(file)
            epoch_s = blf.start_timestamp
            blf.start_timestamp = 0.0  # times from the begin have all their digits
            found = Collected(order["frames"], order["most_numbers"], first_channel=1)
            size = os.fstat(file.fileno()).st_size
            found.take(blf)
            told = found.told(epoch_s, blf.file_size > size, complaints.count)
            return told, found.arrays()
        lines = Lines(file)
        reader: Any = TEXT[order["form"]](lines)
        found = Collected(order["frames"], order["most_numbers"], first_channel=int(order["form"] == "ASC"))
        try:
            found.take(reader)
        except Exception as error:
            raise ValueError(f"row {lines.row}: {type(error).__name__}: {error}") from error
        if getattr(reader, "timestamps_format", None) == "relative":
            raise ValueError("its times are relative to the frame before; expected absolute ones")
        return found.told(0.0, lines.cut, complaints.count), found.arrays()


class Collected:
    """The wanted frames of a log by ID and channel, and a count of all.

    `first_channel` is the log's number for what python-can calls channel 0.
    """

    def __init__(self, wanted: Iterable[tuple[int, bool]], most_frames: int, first_channel: int) -> None:
        self._first_channel = first_channel
        self._wanted = frozenset((int(i), bool(x)) for i, x in wanted)
        self._most_frames = most_frames
        self._kept: dict[tuple[int, bool, Any], tuple[array[float], bytearray, bytearray]] = {}
        self._seen: Counter[tuple[int, bool]] = Counter()
        self._first_s = math.inf
        self._odd = 0

    def take(self, messages: Iterable[Message]) -> None:
        """Add frames; raises ValueError where they are more than a log has."""
        kept, wanted, seen = self._kept, self._wanted, self._seen
        since, at_s = 0, math.nan
        for n, frame in enumerate(messages):
            time_s, data = frame.timestamp, frame.data
            if time_s != at_s:
                since, at_s = n, time_s
            if n >= self._most_frames or n - since >= MOST_AT_ONCE:
                raise ValueError(f"{n - since} frames at once, or more than {self._most_frames}")
            if frame.is_error_frame or frame.is_remote_frame:
                continue
            if not math.isfinite(time_s) or len(data) > LONGEST_FRAME:
                self._odd += 1
                continue
            if time_s < self._first_s:
                self._first_s = time_s
            kind = frame.arbitration_id, frame.is_extended_id
            seen[kind] += 1
            if kind not in wanted:
                continue
            key = (*kind, frame.channel)
            if key not in kept:
                kept[key] = array("d"), bytearray(), bytearray()
            times, lengths, payload = kept[key]
            times.append(time_s)
            lengths.append(len(data))
            payload += data

    def told(self, epoch_s: float, cut: bool, unread: int) -> dict[str, Any]:
        """What JSON says of them.

        `epoch_s` is the time that theirs count from, 0 where they count from 1970; `cut` says that the file ends early,
        `unread` how many of its rows or objects python-can left out.
        """
        return {
            "frames": [
                {"id": number, "extended": extended, "channel": self._named(channel), "key": str(k)}
                for k, (number, extended, channel) in enumerate(self._kept)
            ],
            "seen": [[*key, n] for key, n in self._seen.most_common(MOST_SEEN)],
            "count": self._seen.total(),
            "first_s": self._first_s if self._seen else 0.0,
            "epoch_s": epoch_s,
            "odd": self._odd + unread,
            "cut": cut,
        }

    def arrays(self) -> dict[str, Any]:
        """Their times, lengths and bytes, by `told`'s keys."""
        arrays: dict[str, Any] = {}
        for k, (times, lengths, payload) in enumerate(self._kept.values()):
            arrays[f"time_{k}"] = np.frombuffer(times, np.float64)
            arrays[f"length_{k}"] = np.frombuffer(lengths, np.uint8)
            arrays[f"data_{k}"] = np.frombuffer(payload, np.uint8)
        return arrays

    def _named(self, channel: Any) -> str:
        if isinstance(channel, int):
            channel += self._first_channel
        return "" if channel is None else str(channel)[:100]
