"""Children with a time limit: a crash or a hang is a finding, and the rest goes on."""

from __future__ import annotations

import json
import math
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.robustness.conformance.cases import CASES
from fmu_src.packaging import build_unit
from fmu_src.units import ROOT, UNITS
from scenarios.fmu_client.unpacking import unpack_unit

from .files import KINDS, damaged_files
from .states import UNIT_OF, damaged_states
from .vectors import fuzzed

RESULTS = Path("out") / "fuzz.jsonl"
UNIT_NAMES, KIND_NAMES = tuple(CASES), (*KINDS, *UNIT_OF)
LONGEST_S, LONGEST_START_S = 120.0, 600.0
"""Without a word for this long the child hangs; its first word may wait for numba's compilation [s]."""
SLICE_S = 1.0
SHOWN = 20
"""Findings of a kind that the result quotes."""


def child(name: str, seed: int, numbers: range, folder: Path) -> None:
    """The damaged files, states or acts of these numbers; one line of JSON before each, and one for each finding."""
    answers = os.fdopen(os.dup(1), "w")
    # What libraries and units say belongs to nobody here.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    with tempfile.TemporaryDirectory(prefix="trpac-fuzz-work-") as work:
        for line in _work(name, seed, numbers, folder, Path(work)):
            print(json.dumps(line), file=answers, flush=True)


def _work(name: str, seed: int, numbers: range, folder: Path, work: Path) -> Iterable[tuple[Any, ...]]:
    if name in KINDS:
        return damaged_files(name, seed, numbers)
    if name in UNIT_OF:
        return damaged_states(folder, work, seed, numbers)
    return fuzzed(folder, work, seed, numbers)


def run_kind(name: str, seed: int, count: int) -> dict[str, Any]:
    """All files or acts of a kind: how many, in what time, and the findings."""
    started = time.perf_counter()
    findings: list[str] = []
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="trpac-fuzz-unit-") as place:
        unit = UNIT_OF.get(name, name)
        folder = Path(place) / unit
        if unit in UNITS:
            unpack_unit(build_unit(UNITS[unit], Path(place) / f"{unit}.fmu"), folder)
        start = 0
        while start < count:
            start = _one_child(name, seed, start, count, folder, findings, counts)
    return {
        "count": count,
        "seconds": round(time.perf_counter() - started, 1),
        "findings": len(findings),
        "shown": findings[:SHOWN],
        **counts,
    }


def _heard(waiting: selectors.BaseSelector, limit_s: float) -> bool:
    """Whether the child says something in time; a machine or a process that was stopped meanwhile does not count."""
    return any(waiting.select(SLICE_S) for _ in range(math.ceil(limit_s / SLICE_S)))


def _one_child(
    name: str, seed: int, start: int, stop: int, folder: Path, findings: list[str], counts: Counter[str]
) -> int:
    """Runs a child to its end, a crash or a hang; returns the number that comes next."""
    command = [sys.executable, "-m", __package__ or "benchmarks.robustness.fuzz", "--child", name]
    command += [str(seed), str(start), str(stop), str(folder)]
    at, counted = -1, []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        waiting = selectors.DefaultSelector()
        waiting.register(process.stdout, selectors.EVENT_READ)
        while _heard(waiting, LONGEST_START_S if at <= start else LONGEST_S):
            line = process.stdout.readline()
            if not line:
                break
            at, finding, *counted = json.loads(line)
            if finding:
                findings.append(f"{at}: {finding}")
        else:
            process.kill()
            at = max(at, start)
            findings.append(f"{at}: hangs for {LONGEST_S:g} s")
            return at + 1
        counts.update(*counted)
        if process.wait() and at < 0:
            raise RuntimeError(f"{name}: the child ended with exit code {process.returncode} before it began")
        if process.returncode:
            findings.append(f"{at}: the process ended with exit code {process.returncode}")
            return at + 1
    return stop
