"""Deadlines of the rig: ``python -m benchmarks.speed.hil [--duration-s 600] [--realtime] [--out FILE.json]``.

1 kHz on the virtual bus, with the plant as the car and a camera of 20 pictures a second beside it, on two cores: what
docs/guide/bus.md promises. The pictures are rendered first. Before and after it a bare loop of the same rate, core and
priority keeps the processor as long as a cycle does, and no more: what it misses is the machine's, not the rig's. What
counts is printed; the whole summary goes to the file.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from scenarios.files import load_scenario
from scenarios.pictures import PictureJob, draw
from trpac_hil.deadlines import SPIN_NS, Deadlines, SystemClock, wait_until
from trpac_hil.delays import Delays, ThreadAccounts
from trpac_hil.loop import LONG_NS
from trpac_hil.plant_node import PLAIN_SCENARIO, PlantJob
from trpac_hil.realtime import loop_core, pin, raise_priority, undisturbed
from trpac_hil.rig import run_hil
from trpac_hil.settings import HilSettings

PICTURES = 12
EVERY_M = 5.0
CORES = 2
RATE_HZ, BARE_S = 1000.0, 60.0
SHOWN = [
    "cycles",
    "overruns",
    "bare_loop",
    "timing",
    "held_cycles",
    "camera",
    "events",
    "system",
    "log",
    "machine",
]
BUSY_NS = 250_000
"""What a cycle of the rig takes [ns]."""


def bare_loop(duration_s: float, rate_hz: float, realtime: bool) -> dict[str, Any]:
    """Deadlines that a loop without any work of its own misses on this machine."""
    chosen = loop_core(None, realtime)
    if chosen is not None:
        pin(chosen)
    if realtime:
        raise_priority()
    clock, slots, done = SystemClock(), round(duration_s * rate_hz), -1
    missed_ns: list[int] = []
    with undisturbed(), ThreadAccounts() as accounts:
        deadlines, delays = Deadlines(clock.now_ns() + 100_000_000, round(1e9 / rate_hz)), Delays(accounts)
        while done + 1 < slots:
            due_ns = deadlines.due_ns(done + 1)
            now_ns = wait_until(clock, due_ns)
            slot = deadlines.next_slot(done, now_ns)
            missed = [deadlines.missed_by_ns(left_out, now_ns) for left_out in range(done + 1, slot)]
            while clock.now_ns() < now_ns + BUSY_NS:
                continue
            missed.append(deadlines.missed_by_ns(slot, clock.now_ns()))
            delays.settle(
                due_ns - SPIN_NS, deadlines.due_ns(slot + 1), sum(late > LONG_NS for late in missed)
            )
            missed_ns += missed
            done = slot
    return {
        "duration_s": duration_s,
        "overruns": sum(missed > 0 for missed in missed_ns),
        "beyond_5_ms": sum(missed > LONG_NS for missed in missed_ns),
        "beyond_5_ms_by": delays.longs,
        "worst_ms": round(max(0, *missed_ns) * 1e-6, 4),
    }


def alone(measure: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:
    """A measurement in a process of its own: priority and core stay there."""
    with ProcessPoolExecutor(1, get_context("spawn")) as processes:
        return processes.submit(measure, *arguments).result()


def pictures(folder: Path) -> Path:
    """A few rendered pictures along the paper's road."""
    folder.mkdir()
    frames = tuple((number + 1, number * EVERY_M) for number in range(PICTURES))
    draw(PictureJob(load_scenario(PLAIN_SCENARIO), frames, folder))
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration-s", type=float, default=600.0)
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--out", type=Path, help="JSON file for the whole summary")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
    with tempfile.TemporaryDirectory(prefix="bench-hil-") as name:
        folder = Path(name)
        settings = HilSettings(
            out=folder / "out",
            rate_hz=RATE_HZ,
            duration_s=options.duration_s,
            frames=pictures(folder / "frames"),
            camera=Path("scenarios/cameras/paper.yaml"),
            fps=20.0,
            plant=PlantJob(camera_fps=0.0, rate_hz=RATE_HZ),
            realtime=options.realtime,
            log=True,
        )
        load = os.getloadavg()[0]
        bare = (BARE_S, RATE_HZ, options.realtime)
        before = alone(bare_loop, *bare)
        summary = alone(run_hil, settings)
        summary["bare_loop"] = {"before": before, "after": alone(bare_loop, *bare)}
        log = settings.out / "log.mf4"
        summary["log"]["size_mb"] = round(log.stat().st_size / 1e6, 1) if log.exists() else None
    summary["machine"] = {
        "processor": platform.machine(),
        "load_before": load,
        "load_after": os.getloadavg()[0],
    }
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(summary, indent=2) + "\n")
    print(json.dumps({key: summary[key] for key in SHOWN}, indent=2))


if __name__ == "__main__":
    main()
