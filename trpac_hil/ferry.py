"""How a process beside the loop reaches a bus that lives within the loop's process, such as python-can's virtual one.

The process writes its messages into shared memory; a thread of the loop's process hands them to the bus.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

import can

from trpac_hil.bus import Link
from trpac_hil.deadlines import Clock, Deadlines, wait_until
from trpac_hil.shared import Ring

_COLUMNS = 5
MESSAGES_KEPT = 4096
"""Messages that wait for a thread that is held up: one second and more at 1 kHz."""
_BYTES = struct.Struct("<II")
"""A classic message's eight bytes as two numbers that a float64 holds exactly."""


def ferry_ring() -> Ring:
    """The shared memory between a `Wire` and its `Ferry`."""
    return Ring(_COLUMNS, MESSAGES_KEPT)


class Wire:
    """The far end: a bus that takes messages and hears nothing. Stands where `Link` stands."""

    def __init__(self, ring: Ring) -> None:
        self._ring = ring

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        """Hand a message of at most 8 bytes over."""
        self._ring.write([frame_id, extended, len(data), *_BYTES.unpack(data.ljust(_BYTES.size, b"\0"))])

    def receive(self) -> list[can.Message]:
        """Nothing: the far end listens to nobody."""
        return []

    def close(self) -> None:
        """Nothing to shut."""


class Ferry:
    """The near end: takes over what has come, once per period.

    Parameters
    ----------
    ring : Ring
        What the far end writes to.
    link : Link
        The bus here.
    clock : Clock
        Time.
    """

    def __init__(self, ring: Ring, link: Link, clock: Clock) -> None:
        self._ring, self._link, self._clock = ring, link, clock

    def run(self, start_ns: int, period_ns: int, stop: Callable[[], bool]) -> None:
        """Take over once per period until told to stop."""
        deadlines, done = Deadlines(start_ns, period_ns), -1
        while not stop():
            now_ns = wait_until(self._clock, deadlines.due_ns(done + 1), 0)
            done = deadlines.next_slot(done, now_ns)
            self.take_over()

    def take_over(self) -> None:
        """Hand on all that waits, and drop what came from the bus: the far end would not listen."""
        self._link.receive()
        if not self._ring.waiting:
            return
        for frame_id, extended, length, low, high in self._ring.read().tolist():
            data = _BYTES.pack(int(low), int(high))[: int(length)]
            self._link.send(int(frame_id), bool(extended), data)
