"""Settings of interpreter and system for the loop: garbage collector, thread switches, timer slack, priority, cores."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SWITCH_INTERVAL_S = 2e-4
"""Longest time for which another thread holds the interpreter while the loop waits for it [s]."""
PRIORITY = 50
"""Priority of SCHED_FIFO: above ordinary work, below the kernel's threads."""
HELPER_NICENESS = 5
"""Niceness of the processes beside the loop."""
_PR_SET_TIMERSLACK, _TIMER_SLACK_NS = 29, 1000
"""Option of prctl(2), and by how much a sleep may be late [ns]; Linux's default is 50,000."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Context without garbage collection, with short thread switches and a small timer slack."""
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
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(_TIMER_SLACK_NS), 0, 0, 0)


def memory_mb() -> float | None:
    """Resident memory of this process; None without /proc [MB]."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6


def raise_priority() -> str:
    """Ask for real-time priority; returns the outcome as a sentence."""
    if not hasattr(os, "sched_setscheduler"):
        return "real-time priority: not available on this system"
    try:
        # Threads that start later inherit it: a preempted thread that holds the interpreter would delay the loop.
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
    """Lower the priority of a process beside the loop."""
    if hasattr(os, "nice"):
        os.nice(HELPER_NICENESS)


@contextmanager
def as_before() -> Iterator[None]:
    """Context that restores priority and cores at its end."""
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
    """The loop's core: `asked`; else, with real-time priority, the last one where there is more than one.

    Linux takes the processor from real-time threads for up to 50 ms in a second where ordinary work waits on their core
    (sched_rt_runtime_us, since 6.12 the fair server), so the loop does not share its core.
    """
    if asked is not None or not realtime or not hasattr(os, "sched_getaffinity"):
        return asked
    cores = os.sched_getaffinity(0)
    return max(cores) if len(cores) > 1 else None


def pin(core: int) -> str:
    """Run this process on one core alone; returns the outcome as a sentence."""
    if not hasattr(os, "sched_setaffinity"):
        return "core: not available on this system"
    try:
        os.sched_setaffinity(0, {core})
    except OSError as error:
        return f"core: {core} refused ({error.strerror}); there are {sorted(os.sched_getaffinity(0))}"
    return f"core: {core}"


def leave(core: int | None) -> None:
    """Keep a process off the loop's core, where there is another core."""
    if core is None or not hasattr(os, "sched_setaffinity"):
        return
    others = os.sched_getaffinity(0) - {core}
    if others:
        os.sched_setaffinity(0, others)
