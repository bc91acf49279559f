"""Keeping the loop undisturbed: garbage collector, thread switches, timer slack, priority, cores."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SWITCH_INTERVAL_S = 2e-4
"""How long another thread of this process may hold the interpreter while the loop waits for it [s]."""
PRIORITY = 50
"""Of SCHED_FIFO: above all ordinary work, below the kernel's own threads."""
HELPER_NICENESS = 5
_PR_SET_TIMERSLACK = 29
_TIMER_SLACK_NS = 1000


@contextmanager
def undisturbed() -> Iterator[None]:
    """Collect garbage once, then no more; other threads give the interpreter back soon; sleeps end on time."""
    switch_s, collecting = sys.getswitchinterval(), gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    _set_timer_slack()
    try:
        yield
    finally:
        sys.setswitchinterval(switch_s)
        gc.unfreeze()
        if collecting:
            gc.enable()


def _set_timer_slack() -> None:
    # Linux may let a sleep of an ordinary thread overshoot by 50 us to save power.
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(_TIMER_SLACK_NS), 0, 0, 0)


def memory_mb() -> float | None:
    """Resident memory of this process; None where the system does not tell it as Linux does [MB]."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6


def raise_priority() -> str:
    """Ask for real-time priority; returns what came of it."""
    if not hasattr(os, "sched_setscheduler"):
        return "real-time priority: this system has none that can be asked for here"
    try:
        # Threads that start later inherit it, as they must: one that is held up with the interpreter holds the loop up.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return (
            "real-time priority: refused; allow it with a line '@GROUP - rtprio 50' in /etc/security/limits.conf "
            "or start as root"
        )
    except OSError as error:
        return f"real-time priority: refused ({error.strerror})"
    return f"real-time priority: SCHED_FIFO {PRIORITY}"


def lower_priority() -> None:
    """Make a process beside the loop give way to it."""
    if hasattr(os, "nice"):
        os.nice(HELPER_NICENESS)


@contextmanager
def as_before() -> Iterator[None]:
    """Give priority and cores back at the end: another run of this process is to choose anew."""
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    policy = (os.sched_getscheduler(0), os.sched_getparam(0)) if hasattr(os, "sched_getscheduler") else None
    try:
        yield
    finally:
        if policy is not None:
            with suppress(PermissionError):
                os.sched_setscheduler(0, *policy)
        if cores is not None:
            os.sched_setaffinity(0, cores)


def loop_core(asked: int | None, realtime: bool) -> int | None:
    """The loop's core: as told; with real-time priority else the last one, where the rest has another.

    Linux takes the processor from real-time threads for up to 50 ms in a second where ordinary work waits on their core
    (sched_rt_runtime_us, since 6.12 the fair server), so the loop must not share its core with any.
    """
    if asked is not None or not realtime or not hasattr(os, "sched_getaffinity"):
        return asked
    cores = os.sched_getaffinity(0)
    return max(cores) if len(cores) > 1 else None


def pin(core: int) -> str:
    """Run this process on one core alone; returns what came of it."""
    if not hasattr(os, "sched_setaffinity"):
        return "core: this system cannot pin a process here"
    try:
        os.sched_setaffinity(0, {core})
    except OSError as error:
        return f"core: {core} refused ({error.strerror}); there are {sorted(os.sched_getaffinity(0))}"
    return f"core: {core}"


def leave(core: int | None) -> None:
    """Keep a process beside the loop off the loop's core, where there is another."""
    if core is None or not hasattr(os, "sched_setaffinity"):
        return
    others = os.sched_getaffinity(0) - {core}
    if others:
        os.sched_setaffinity(0, others)
