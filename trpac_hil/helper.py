"""Processes beside the loop: start, stop and messages."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.queues import SimpleQueue
from multiprocessing.reduction import ForkingPickler
from typing import Any

from trpac_hil.errors import HilError
from trpac_hil.realtime import leave, lower_priority
from trpac_hil.shared import Numbers

CONTEXT = multiprocessing.get_context("spawn")
"""How processes are made: a forked child would inherit the unit's Python state and the loop's threads."""
START_TIMEOUT_S = 120.0
"""Longest time until a process is ready: loading takes seconds, numba compiles up to half a minute [s]."""
PARENT_EVERY_S = 1.0
"""Time between two checks that the parent is alive [s]."""
_START, _STOP = 0, 1


class Control:
    """Messages between the loop and one process beside it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._numbers = Numbers(2)
        self._messages: SimpleQueue[tuple[str, Any]] = CONTEXT.SimpleQueue()
        self._parent_seen_s = 0.0

    # Called by the loop

    def wait_until_ready(self, process: Any) -> None:
        """Wait until the process is ready; raises HilError where it refuses or dies."""
        end_s = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < end_s:
            if not self._messages.empty():
                kind, text = self._messages.get()
                if kind == "ready":
                    return
                raise HilError(str(text))
            if not process.is_alive():
                break
            time.sleep(0.02)
        raise HilError(f"The process of the {self.name} did not start; its error message is above.")

    def start(self, start_ns: int) -> None:
        """Set the time at which slot 0 begins."""
        self._numbers.set([float(start_ns), 0.0])

    def stop(self) -> None:
        """Ask the process to stop."""
        self._numbers.set([self._numbers.get()[_START] or 1.0, 1.0])

    def heard(self) -> list[tuple[str, Any]]:
        """Messages of the process since the last call: kind and content."""
        messages = []
        try:
            while not self._messages.empty():
                messages.append(self._messages.get())
        except (EOFError, OSError, queue.Empty):
            return messages
        return messages

    # Called by the process

    def ready(self) -> None:
        """Report that the process is ready."""
        self._messages.put(("ready", ""))

    def refuse(self, text: str) -> None:
        """Report why the process cannot begin."""
        self._messages.put(("refused", text))

    def send(self, kind: str, content: Any) -> None:
        """Send a message to the loop."""
        self._messages.put((kind, content))

    def wait_for_start(self) -> bool:
        """Wait for the start; returns False where the process is to stop instead."""
        while not self._numbers.get()[_START]:
            if self.stopped:
                return False
            time.sleep(0.005)
        return not self.stopped

    @property
    def start_ns(self) -> int:
        """When slot 0 begins [ns]."""
        return int(self._numbers.get()[_START])

    @property
    def stopped(self) -> bool:
        """Whether the process is to stop: it was asked to, or the loop's process has died."""
        if self._numbers.get()[_STOP]:
            return True
        now_s = time.monotonic()
        if now_s - self._parent_seen_s > PARENT_EVERY_S:
            self._parent_seen_s = now_s
            parent = parent_process()
            return parent is not None and not parent.is_alive()
        return False


class Body:
    """Function and arguments of a process; pickled, so that their modules are imported when the process runs."""

    def __init__(self, work: Callable[..., None], arguments: Sequence[Any]) -> None:
        self._work, self._arguments = work, tuple(arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        return bytes, (bytes(ForkingPickler.dumps((self._work, self._arguments))),)


def begin(packed: bytes, with_parent: bool) -> None:
    """Target of each process beside the loop, given a `Body`.

    With `with_parent` it ends as soon as the loop's process does; a process that has data to save checks
    `Control.stopped` instead.
    """
    if with_parent:
        threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    work, arguments = pickle.loads(packed)
    work(*arguments)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def helper(core: int | None) -> Iterator[None]:
    """Context of a process beside the loop: it ignores Ctrl-C, has low priority and keeps off the loop's core."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority()
    leave(core)
    yield
