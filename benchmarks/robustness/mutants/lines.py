"""Which lines each test runs, in its own process and in those that it starts.

A copy of this file is the `sitecustomize` of all of them, and so it imports nothing of ours. A line of the record says
test, file and line; a unit's own copy of a module counts as the module.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from types import FrameType
from typing import Any

_UNIT = re.compile(r".*/resources/(\w+)_[0-9a-f]{12}/(.*)")


class Lines:
    """Writes down each line of the chosen files the first time that a test runs it."""

    def __init__(self, record: str, root: str, folders: tuple[str, ...]) -> None:
        self._record = os.open(record, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        self._root, self._folders = root, folders
        self._tracers: dict[str, Any] = {}
        self.begin(os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0])

    def begin(self, test: str) -> None:
        """From now on it is this test; tracing starts again where an error within the tracer has ended it."""
        self.test = test
        self._seen: set[tuple[str, int]] = set()
        sys.settrace(self._called)
        threading.settrace(self._called)

    def _called(self, frame: FrameType, event: str, argument: object) -> Any:
        name = frame.f_code.co_filename
        if name not in self._tracers:
            self._tracers[name] = self._tracer(name)
        return self._tracers[name]

    def _tracer(self, name: str) -> Any:
        carried = _UNIT.fullmatch(name)
        place = "/".join(carried.groups()) if carried else os.path.relpath(name, self._root)
        if not place.startswith(self._folders):
            return None

        def tracer(frame: FrameType, event: str, argument: object) -> Any:
            at = (place, frame.f_lineno)
            if event == "line" and at not in self._seen:
                self._seen.add(at)
                os.write(self._record, f"{self.test}\t{place}\t{frame.f_lineno}\n".encode())
            return tracer

        return tracer


lines: Lines | None = None
if __name__ == "sitecustomize" and "MUTANTS_RECORD" in os.environ:
    _folders = tuple(os.environ["MUTANTS_FOLDERS"].split(":"))
    lines = Lines(os.environ["MUTANTS_RECORD"], os.environ["MUTANTS_ROOT"], _folders)
