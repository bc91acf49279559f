"""Lines of results: when, of which code and on what machine a figure was measured, and the figures."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


def machine() -> dict[str, Any]:
    """What ran it, and how busy that was."""
    return {
        "cpus": os.cpu_count(),
        "processor": platform.machine(),
        "load_1min": os.getloadavg()[0],
        "python": platform.python_version(),
    }


def circumstances() -> dict[str, Any]:
    """When, of which code and on what machine."""
    asked = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": asked.stdout.strip() or None,
        "machine": machine(),
    }


def append(results: Path, figures: Mapping[str, Any]) -> dict[str, Any]:
    """Add one line of circumstances and figures to a file, and return it."""
    line = circumstances() | dict(figures)
    results.parent.mkdir(parents=True, exist_ok=True)
    with results.open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
    return line
