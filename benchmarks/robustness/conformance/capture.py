"""What compiled libraries write to the process's own output."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def said_by_libraries(folder: Path) -> Iterator[list[str]]:
    """Both outputs of the process, whoever writes them, as the list's one text once the block has ended."""
    text: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile(dir=folder) as file:
        try:
            for number in (1, 2):
                os.dup2(file.fileno(), number)
            yield text
        finally:
            for number, copy in zip((1, 2), kept, strict=True):
                os.dup2(copy, number)
                os.close(copy)
            file.seek(0)
            text.append(file.read().decode(errors="replace"))
