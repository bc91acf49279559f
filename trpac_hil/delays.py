"""Causes of long delays: the loop's own work, other work of this system, a wait, or the machine."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

if sys.platform != "win32":
    import resource

CAUSES = ("own_work", "other_work", "waiting", "machine", "untold")
"""The thread computed; it was ready and queued for its core; it was blocked beyond the sleep that it asked for; none of
the three, as where the host of a virtual machine took the core; not known on this system."""
SCHEDULER_FILE = Path("/proc/thread-self/schedstat")


@dataclass(frozen=True)
class Spent:
    """Times of a thread since it began.

    `queued_ns` is the time for which it was ready and others had its core [ns], `blocked` the number of voluntary
    context switches; both are None where the system does not count them.
    """

    now_ns: int
    worked_ns: int
    queued_ns: int | None = None
    blocked: int | None = None


class ThreadAccounts:
    """Times of the thread that opens this context; queueing and blocking are known on Linux only."""

    def __init__(self) -> None:
        self._file: int | None = None

    def __enter__(self) -> ThreadAccounts:
        """Begin to count for the calling thread."""
        if SCHEDULER_FILE.exists():
            self._file = os.open(SCHEDULER_FILE, os.O_RDONLY | os.O_CLOEXEC)
        return self

    def __exit__(self, *problem: object) -> None:
        """Close the file of the counts."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def spent(self) -> Spent:
        """The thread's times up to now; the call takes 3 us."""
        now_ns, worked_ns = time.perf_counter_ns(), time.thread_time_ns()
        if self._file is None:
            return Spent(now_ns, worked_ns)
        queued_ns = int(os.pread(self._file, 96, 0).split()[1])
        return Spent(now_ns, worked_ns, queued_ns, resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw)


def cause(began: Spent, ended: Spent, slept_ns: int) -> str:
    """The cause that took most of an interval, apart from the one sleep that was asked for.

    Parameters
    ----------
    began, ended : Spent
        The thread's times at both ends.
    slept_ns : int
        Length of the sleep that the thread asked for within, 0 where it asked for none [ns].

    Returns
    -------
    str
        One of `CAUSES`. Where the thread was blocked more often than it asked to sleep, the machine is never named.
    """
    if began.queued_ns is None or ended.queued_ns is None or began.blocked is None or ended.blocked is None:
        return "untold"
    worked_ns, queued_ns = ended.worked_ns - began.worked_ns, ended.queued_ns - began.queued_ns
    rest_ns = ended.now_ns - began.now_ns - slept_ns - worked_ns - queued_ns
    if rest_ns >= max(worked_ns, queued_ns):
        return "waiting" if ended.blocked - began.blocked > (slept_ns > 0) else "machine"
    return "own_work" if worked_ns >= queued_ns else "other_work"


class Delays:
    """Counts long overruns by their cause, from one reading of the thread's times per cycle.

    An interval reaches from one cycle that met its deadline to the next, so that all overruns that follow from one
    delay have its cause.
    """

    def __init__(self, accounts: ThreadAccounts) -> None:
        self.longs = dict.fromkeys(CAUSES, 0)
        self._accounts = accounts
        self.start()

    def start(self) -> None:
        """Begin an interval."""
        self._began: Spent = self._accounts.spent()
        self._slept_ns: int | None = None

    def settle(self, sleep_until_ns: int, deadline_ns: int, longs: int) -> None:
        """End a cycle that slept until `sleep_until_ns` and had `longs` long overruns."""
        began, ended = self._began, self._accounts.spent()
        if self._slept_ns is None:
            self._slept_ns = max(0, sleep_until_ns - began.now_ns)
        if longs:
            self.longs[cause(began, ended, self._slept_ns)] += longs
        if ended.now_ns <= deadline_ns:
            self._began, self._slept_ns = ended, None
