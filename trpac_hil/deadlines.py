"""When each cycle is due: absolute times on the monotonic clock, so that no delay adds up."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

SPIN_NS = 60_000
"""How long before a due time the sleep ends and the clock is watched: what a sleep of Linux overshoots by [ns]."""


class Clock(Protocol):
    """Time as the loop knows it."""

    def now_ns(self) -> int:
        """A clock that only goes forward, at one pace, the same in all processes of the machine [ns]."""
        ...

    def wall_ns(self) -> int:
        """The clock on the wall, which somebody may set [ns]."""
        ...

    def cpu_ns(self) -> int:
        """Processor time that the calling thread has had [ns]."""
        ...

    def sleep_ns(self, duration_ns: int) -> None:
        """Give the processor away for about this time [ns]."""
        ...


class SystemClock:
    """The machine's own clocks."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC on Linux, the performance counter on Windows [ns]."""
        return time.perf_counter_ns()

    def wall_ns(self) -> int:
        """The system's time of day [ns]."""
        return time.time_ns()

    def cpu_ns(self) -> int:
        """Of this thread alone; on Windows in steps of 16 ms [ns]."""
        return time.thread_time_ns()

    def sleep_ns(self, duration_ns: int) -> None:
        """Sleep; on Linux until an absolute time (clock_nanosleep)."""
        time.sleep(duration_ns * 1e-9)


@dataclass(frozen=True)
class Deadlines:
    """Slots of one period each from a start on; a cycle's deadline is the end of its slot [ns]."""

    start_ns: int
    period_ns: int

    def due_ns(self, slot: int) -> int:
        """When a slot begins [ns]."""
        return self.start_ns + slot * self.period_ns

    def missed_by_ns(self, slot: int, now_ns: int) -> int:
        """By how much a slot's deadline is over, at or below 0 where it is not [ns]."""
        return now_ns - self.due_ns(slot + 1)

    def next_slot(self, done: int, now_ns: int) -> int:
        """The slot to run after one: the next, or the one that is on now where whole slots have passed.

        Slots that have passed are left out, not made up for: a burst of cycles would only be later still.
        """
        return max(done + 1, (now_ns - self.start_ns) // self.period_ns)


def wait_until(clock: Clock, due_ns: int, spin_ns: int = SPIN_NS) -> int:
    """Sleep most of the way to a time and watch the clock for the rest; returns the time then [ns]."""
    now_ns = clock.now_ns()
    while now_ns < due_ns:
        left_ns = due_ns - now_ns - spin_ns
        if left_ns > 0:
            clock.sleep_ns(left_ns)
        now_ns = clock.now_ns()
    return now_ns


class WallWatch:
    """Notices when somebody sets the clock on the wall; nothing of the loop depends on it, but its users may."""

    JUMP_NS = 100_000_000
    """Steps below this are a clock that is being slewed [ns]."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._offset_ns = clock.wall_ns() - clock.now_ns()

    def jump_ns(self) -> int:
        """By how much the wall clock moved against the monotonic one since the last look, 0 if not [ns]."""
        offset_ns = self._clock.wall_ns() - self._clock.now_ns()
        moved_ns, self._offset_ns = offset_ns - self._offset_ns, offset_ns
        return moved_ns if abs(moved_ns) > self.JUMP_NS else 0
