"""Messages in shared memory: to a bus that exists in the loop's process only, or to the recorder.

python-can's virtual bus lives within one process: there a thread of the loop's process sends what another one wrote.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

import can

from trpac_hil.bus import Link, frame
from trpac_hil.deadlines import Deadlines, SystemClock, wait_until
from trpac_hil.message import FD_SIZES
from trpac_hil.shared import Ring

_BYTES = struct.Struct(f"<{FD_SIZES[-1] // 4}I")
"""The bytes of a message as integers, which a float64 holds exactly."""
_HEAD = 5
"""Numbers before the bytes: time, identifier, whether it is extended, whether it was received, length."""
_COLUMNS = _HEAD + FD_SIZES[-1] // 4
RELAYED, RECORDED = 4096, 131_072
"""Messages that the memory holds: at 1 kHz of a second for the bus, and of 15 s and more for the recorder."""


def relay_ring(messages: int = RELAYED) -> Ring:
    """The shared memory for so many messages."""
    return Ring(_COLUMNS, messages)


def packed(message: can.Message) -> list[float]:
    """A message of at most 64 bytes as numbers."""
    data = bytes(message.data)
    head = (
        message.timestamp,
        message.arbitration_id,
        message.is_extended_id,
        message.is_rx,
        len(data),
    )
    return [*head, *_BYTES.unpack(data.ljust(_BYTES.size, b"\0"))]


def unpacked(row: Sequence[float]) -> can.Message:
    """The message of a row of numbers."""
    timestamp_s, frame_id, extended, received, length = row[:_HEAD]
    data = _BYTES.pack(*(int(part) for part in row[_HEAD:]))[: int(length)]
    message = frame(int(frame_id), bool(extended), data)
    message.timestamp, message.is_rx = timestamp_s, bool(received)
    return message


class RelayedBus:
    """The bus as the other process uses it, with the methods of `Link`: it sends and receives nothing."""

    fd = True

    def __init__(self, ring: Ring) -> None:
        self._ring = ring

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        """Write a message to the shared memory."""
        self._ring.write(packed(frame(frame_id, extended, data)))

    def receive(self) -> list[can.Message]:
        """An empty list."""
        return []

    def close(self) -> None:
        """Do nothing."""


class BusRelay:
    """Sends what the shared memory holds to the bus, once per period."""

    def __init__(self, ring: Ring, link: Link, clock: SystemClock) -> None:
        self._ring, self._link, self._clock = ring, link, clock

    def run(self, start_ns: int, period_ns: int, stop: Callable[[], bool]) -> None:
        """Send waiting messages once per period until `stop` returns True."""
        deadlines, done = Deadlines(start_ns, period_ns), -1
        while not stop():
            now_ns = wait_until(self._clock, deadlines.due_ns(done + 1), 0)
            done = deadlines.next_slot(done, now_ns)
            self.take_over()

    def take_over(self) -> None:
        """Send all waiting messages, and discard what the bus received."""
        self._link.receive()
        if not self._ring.waiting:
            return
        for row in self._ring.read().tolist():
            message = unpacked(row)
            self._link.send(message.arbitration_id, message.is_extended_id, bytes(message.data))
