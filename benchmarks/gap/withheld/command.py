"""Runs the diagnosis as a user does, by its command, and watches time and memory."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

POLL_S = 0.05


@dataclass(frozen=True)
class Usage:
    """What a command took: exit code, wall time [s], peak proportional memory of all its processes [bytes]."""

    code: int
    seconds: float
    peak_bytes: int
    errors: str


def arguments(folder: Path, out: Path, fit: tuple[str, ...], jobs: int) -> list[str]:
    """Command line of a case's diagnosis."""
    call = [str(Path(sys.executable).with_name("trpac")), "gap", "diagnose"]
    call += ["--vehicle", str(folder / "vehicle.yaml"), "--road", str(folder / "road.yaml")]
    for log in fit:
        call += ["--fit", str(folder / f"{log}.csv")]
    call += ["--holdout", f"{folder / 'holdout.csv'}@{folder / 'road_holdout.yaml'}"]
    return [*call, "--out", str(out), "--jobs", str(jobs)]


def watch(call: list[str]) -> Usage:
    """Run to the end; memory is read from /proc, so Linux only."""
    began, peak = time.perf_counter(), 0
    process = subprocess.Popen(
        call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while process.poll() is None:
        peak = max(peak, sum(_share(pid) for pid in _session(process.pid)))
        time.sleep(POLL_S)
    errors = process.stderr.read() if process.stderr else ""
    return Usage(process.returncode, time.perf_counter() - began, peak, errors.strip())


def _session(leader: int) -> list[int]:
    """All processes of the session that `leader` began."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            fields = _text(folder / "stat").rpartition(")")[2].split()
            if len(fields) > 3 and int(fields[3]) == leader:
                found.append(int(folder.name))
    return found


def _share(pid: int) -> int:
    """Proportional share of memory [bytes]: pages that several processes have count once."""
    for line in _text(Path(f"/proc/{pid}/smaps_rollup")).splitlines():
        if line.startswith("Pss:"):
            return 1024 * int(line.split()[1])
    return 0


def _text(path: Path) -> str:
    """A file of /proc; empty once its process has gone."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError, PermissionError):
        return ""
