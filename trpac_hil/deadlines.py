"""Due times of the cycles as absolute times on the monotonic clock, so that delays do not accumulate."""

from __future__ import annotations

import time
from dataclasses import dataclass

SPIN_NS = 60_000
"""Time before a due time at which sleep ends and polling of the clock begins: the overshoot of a Linux sleep [ns]."""


class SystemClock:
    """The machine's clocks."""

    def now_ns(self) -> int:
        """Monotonic time, the same in all processes of the machine [ns]."""
        return time.perf_counter_ns()

    def wall_ns(self) -> int:
        """Time of day, which may be set [ns]."""
        return time.time_ns()

    def cpu_ns(self) -> int:
        """Processor time of the calling thread; on Windows in steps of 16 ms [ns]."""
        return time.thread_time_ns()

    def sleep_ns(self, duration_ns: int) -> None:
        """Sleep; on Linux until an absolute time (clock_nanosleep)."""
        time.sleep(duration_ns * 1e-9)


@dataclass(frozen=True)
class Deadlines:
    """Slots of one period each; a cycle's deadline is the end of its slot [ns]."""

    start_ns: int
    period_ns: int

    def due_ns(self, slot: int) -> int:
        """When a slot begins [ns]."""
        return self.start_ns + slot * self.period_ns

    def missed_by_ns(self, slot: int, now_ns: int) -> int:
        """Time since a slot's deadline, 0 or less before it [ns]."""
        return now_ns - self.due_ns(slot + 1)

    def next_slot(self, done: int, now_ns: int) -> int:
        """The slot to run after `done`: the next one, or the current one where whole slots have passed.

        Missed slots are left out: a burst of cycles would only increase the delay.
        """
        return max(done + 1, (now_ns - self.start_ns) // self.period_ns)


def wait_until(clock: SystemClock, due_ns: int, spin_ns: int = SPIN_NS) -> int:
    """Sleep until `spin_ns` before a time, then poll the clock; returns the time then [ns]."""
    now_ns = clock.now_ns()
    while now_ns < due_ns:
        left_ns = due_ns - now_ns - spin_ns
        if left_ns > 0:
            clock.sleep_ns(left_ns)
        now_ns = clock.now_ns()
    return now_ns


class WallWatch:
    """Detects that the time of day was set; the loop itself does not depend on it."""

    JUMP_NS = 100_000_000
    """Least step that is reported; smaller ones are a clock being slewed [ns]."""

    def __init__(self, clock: SystemClock) -> None:
        self._clock = clock
        self._offset_ns = clock.wall_ns() - clock.now_ns()

    def jump_ns(self) -> int:
        """Step of the time of day against the monotonic clock since the last call, 0 below `JUMP_NS` [ns]."""
        offset_ns = self._clock.wall_ns() - self._clock.now_ns()
        moved_ns, self._offset_ns = offset_ns - self._offset_ns, offset_ns
        return moved_ns if abs(moved_ns) > self.JUMP_NS else 0
