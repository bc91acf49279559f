"""The readers that run in processes of their own, forked with their libraries loaded: a start takes 20 ms, not 1 s."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

READERS = ("mdf_channels", "bus_frames", "mat_variables")


@contextmanager
def forked_readers() -> Iterator[None]:
    """While it lasts, `sim2real.logs.formats.extraction` starts its readers so."""
    from sim2real.logs.formats import extraction, extractor

    for name in READERS:
        extractor.beside(name)

    def run(_: Any, *, input: bytes, timeout: float, **__: Any) -> SimpleNamespace:
        with tempfile.TemporaryFile() as order, tempfile.TemporaryFile() as answer:
            order.write(input)
            order.seek(0)
            child = os.fork()
            if child == 0:
                _read(order.fileno(), answer.fileno(), extractor.main)
            _wait(child, timeout)
            answer.seek(0)
            return SimpleNamespace(stdout=answer.read())

    before, extraction.subprocess = extraction.subprocess, SimpleNamespace(**vars(subprocess) | {"run": run})
    try:
        yield
    finally:
        extraction.subprocess = before


def _read(order: int, answer: int, main: Any) -> None:
    """In the child: carry out the order, and end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for source, target in ((order, 0), (answer, 1), (nowhere, 2)):
        os.dup2(source, target)
    sys.stdin = os.fdopen(0)
    code = 1
    try:
        main()
        code = 0
    finally:
        os._exit(code)


def _wait(child: int, timeout: float) -> None:
    """Wait for the child; raises what `subprocess.run` raises."""
    until = time.monotonic() + timeout
    while time.monotonic() < until:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            if status:
                raise subprocess.CalledProcessError(status, "reader")
            return
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    raise subprocess.TimeoutExpired("reader", timeout)
