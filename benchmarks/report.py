"""How figures are told: lines of JSON with their circumstances, tables of markdown, the measured part of a page."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
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


def append(results: Path, figures: Mapping[str, Any]) -> dict[str, Any]:
    """Add one line of circumstances and figures to a file, and return it."""
    asked = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    line = {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": asked.stdout.strip() or None,
        "machine": machine(),
        **figures,
    }
    results.parent.mkdir(parents=True, exist_ok=True)
    with results.open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
    return line


def markdown(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table of markdown, without a line break at its end."""
    heads = list(heads)
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def write_between(page: Path, text: str, name: str = "measured") -> None:
    """Replace what stands between a page's lines `<!-- name: begin -->` and `end`; SystemExit where it has none."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    head, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, marker, tail = rest.partition(end)
    if not (found and marker):
        raise SystemExit(
            f"{page}: has no lines {begin} and {end}; expected both, the figures go between them."
        )
    page.write_text(f"{head}{begin}\n\n{text.strip()}\n\n{end}{tail}", encoding="utf-8")
