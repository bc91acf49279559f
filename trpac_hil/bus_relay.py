"""Sends messages of another process to a bus that exists in the loop's process only, such as python-can's virtual one.

The process writes its messages into shared memory; a thread of the loop's process sends them to the bus.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

import can

from trpac_hil.bus import Link
from trpac_hil.deadlines import Deadlines, SystemClock, wait_until
from trpac_hil.shared import Ring

_COLUMNS = 5
MESSAGES_KEPT = 4096
"""Messages that the shared memory holds: those of one second and more at 1 kHz."""
_BYTES = struct.Struct("<II")
"""The eight bytes of a classic CAN message as two integers, which a float64 holds exactly."""


def relay_ring() -> Ring:
    """The shared memory between a `RelayedBus` and its `BusRelay`."""
    return Ring(_COLUMNS, MESSAGES_KEPT)


class RelayedBus:
    """The bus as the other process uses it, with the methods of `Link`: it sends and receives nothing."""

    def __init__(self, ring: Ring) -> None:
        self._ring = ring

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        """Write a message of at most 8 bytes to the shared memory."""
        self._ring.write([frame_id, extended, len(data), *_BYTES.unpack(data.ljust(_BYTES.size, b"\0"))])

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
        for frame_id, extended, length, low, high in self._ring.read().tolist():
            data = _BYTES.pack(int(low), int(high))[: int(length)]
            self._link.send(int(frame_id), bool(extended), data)
