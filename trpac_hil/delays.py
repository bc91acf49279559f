"""Whose a long delay was: the loop's own work, other work of this system, a wait, or a machine that stood still."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

if sys.platform != "win32":
    import resource

CAUSES = ("own_work", "other_work", "waiting", "machine", "untold")
"""The thread worked; it was ready and queued for its core; it was blocked beyond the sleep that it had asked for; or it
did none of the three, so that nothing here explains the time: the host of a virtual machine had the core, say."""
SCHEDULER_FILE = Path("/proc/thread-self/schedstat")


@dataclass(frozen=True)
class Spent:
    """What a thread has had since it began.

    `queued_ns`, the time for which it was ready and others had its core [ns], and `blocked`, how often it gave the core
    away itself, are None where the system does not tell them.
    """

    now_ns: int
    worked_ns: int
    queued_ns: int | None = None
    blocked: int | None = None


class Accounts(Protocol):
    """Tells how a thread spent its time."""

    def spent(self) -> Spent:
        """Up to now."""
        ...


class ThreadAccounts:
    """Accounts of the thread that opens them; queueing and blocking are told by Linux alone."""

    def __init__(self) -> None:
        self._file: int | None = None

    def __enter__(self) -> ThreadAccounts:
        """Open the accounts of the calling thread."""
        if SCHEDULER_FILE.exists():
            self._file = os.open(SCHEDULER_FILE, os.O_RDONLY | os.O_CLOEXEC)
        return self

    def __exit__(self, *problem: object) -> None:
        """Close them."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def spent(self) -> Spent:
        """Up to now; takes 3 us."""
        now_ns, worked_ns = time.perf_counter_ns(), time.thread_time_ns()
        if self._file is None:
            return Spent(now_ns, worked_ns)
        queued_ns = int(os.pread(self._file, 96, 0).split()[1])
        return Spent(now_ns, worked_ns, queued_ns, resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw)


def cause(began: Spent, ended: Spent, slept_ns: int) -> str:
    """What most of a stretch of time went to, beside the one sleep that was asked for.

    Parameters
    ----------
    began, ended : Spent
        The thread's accounts at both ends.
    slept_ns : int
        Length of the sleep that the thread asked for within, 0 where it asked for none [ns].

    Returns
    -------
    str
        One of `CAUSES`. Where the thread was blocked more often than it asked to sleep, nothing is put down to the
        machine, however little of the rest the other block may have taken.
    """
    if began.queued_ns is None or ended.queued_ns is None or began.blocked is None or ended.blocked is None:
        return "untold"
    worked_ns, queued_ns = ended.worked_ns - began.worked_ns, ended.queued_ns - began.queued_ns
    rest_ns = ended.now_ns - began.now_ns - slept_ns - worked_ns - queued_ns
    if rest_ns >= max(worked_ns, queued_ns):
        return "waiting" if ended.blocked - began.blocked > (slept_ns > 0) else "machine"
    return "own_work" if worked_ns >= queued_ns else "other_work"


class Delays:
    """Counts long overruns by their cause, from one look at the thread's accounts per cycle.

    A stretch reaches from one cycle that met its deadline to the next: those that only follow from a delay are put down
    to what it came of.
    """

    def __init__(self, accounts: Accounts) -> None:
        self.longs = dict.fromkeys(CAUSES, 0)
        self._accounts = accounts
        self.start()

    def start(self) -> None:
        """Begin a stretch."""
        self._began: Spent = self._accounts.spent()
        self._slept_ns: int | None = None

    def settle(self, sleep_until_ns: int, deadline_ns: int, longs: int) -> None:
        """End a cycle for which the thread slept until some time, and which brought this many long overruns."""
        began, ended = self._began, self._accounts.spent()
        if self._slept_ns is None:
            self._slept_ns = max(0, sleep_until_ns - began.now_ns)
        if longs:
            self.longs[cause(began, ended, self._slept_ns)] += longs
        if ended.now_ns <= deadline_ns:
            self._began, self._slept_ns = ended, None
