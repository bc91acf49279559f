"""The MDF extractor in forks of one process: a thousand starts of Python and asammdf take twenty minutes."""

from __future__ import annotations

import math
import os
import runpy
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import IO, Any
from unittest import mock

NOT_FORKED = 25
"""Of so many files one is read as users read it, by a process that starts anew."""
POLL_S = 0.002
_NUMBERS = count()


@contextmanager
def forked(script: Path) -> Iterator[None]:
    """`subprocess.run` of this script becomes a fork, with the same streams, exit codes, limit and errors."""
    run = subprocess.run

    def instead(command: Sequence[Any], **options: Any) -> Any:
        if command[-1] != script or next(_NUMBERS) % NOT_FORKED == 0:
            return run(command, **options)
        return _forked(script, command, options["input"], options["timeout"])

    with mock.patch.object(subprocess, "run", instead):
        yield


def _forked(
    script: Path, command: Sequence[Any], given: bytes, timeout_s: float
) -> subprocess.CompletedProcess[bytes]:
    with (
        tempfile.TemporaryFile() as asked,
        tempfile.TemporaryFile() as said,
        tempfile.TemporaryFile() as told,
    ):
        asked.write(given)
        asked.seek(0)
        process = os.fork()
        if process == 0:
            _become(script, asked, said, told)
        code = _wait(process, timeout_s)
        said.seek(0)
        told.seek(0)
        out, errors = said.read(), told.read()
    if code is None:
        raise subprocess.TimeoutExpired(list(command), timeout_s)
    if code:
        raise subprocess.CalledProcessError(code, list(command), out, errors)
    return subprocess.CompletedProcess(list(command), code, out, errors)


def _become(script: Path, *streams: IO[bytes]) -> None:
    """Run the script on these streams as its standard ones, and end."""
    code = 1
    try:
        for descriptor, stream in enumerate(streams):
            os.dup2(stream.fileno(), descriptor)
        sys.stdin, sys.stdout, sys.stderr = os.fdopen(0), os.fdopen(1, "w"), os.fdopen(2, "w")
        runpy.run_path(str(script), run_name="__main__")
        sys.stdout.flush()
        code = 0
    except BaseException:  # noqa: BLE001 - as an interpreter ends, whatever it is
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _wait(process: int, timeout_s: float) -> int | None:
    """Exit code, negative for a signal; None where the process had to be killed."""
    for _ in range(math.ceil(timeout_s / POLL_S)):
        found, status = os.waitpid(process, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(POLL_S)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return None
