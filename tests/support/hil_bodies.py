"""Bodies of helper processes, in a module that loads nothing else."""

from __future__ import annotations

import time
from typing import Any


def deaf(control: Any) -> None:
    """A helper that does not look whether it is to stop."""
    control.ready()
    time.sleep(600.0)


def slow(control: Any) -> None:
    """A recorder that takes its time to write a long log, and says nothing meanwhile."""
    control.ready()
    while not control.stopped:
        time.sleep(0.01)
    time.sleep(1.5)
    control.send("done", "written")
