"""Deadlines of the rig: ``python -m benchmarks.bench_hil [--duration-s 600] [--realtime] [--out FILE.json]``.

1 kHz on the virtual bus, with the plant as the car in the same process and a camera of 20 pictures a second in one of
its own, on two cores: what docs/hil.md promises. The pictures are rendered first. What counts is printed; the whole
summary goes to the file.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
from dataclasses import replace
from pathlib import Path

from scenarios.files import load_scenario
from scenarios.pictures import PictureJob, draw
from trpac_hil.partner import PLAIN_SCENARIO, PartnerJob
from trpac_hil.rig import HilSettings, run_hil

PICTURES = 12
EVERY_M = 5.0
CORES = 2


def pictures(folder: Path) -> Path:
    """A few rendered pictures along the paper's road."""
    folder.mkdir()
    frames = tuple((number + 1, number * EVERY_M) for number in range(PICTURES))
    draw(PictureJob(load_scenario(PLAIN_SCENARIO), frames, folder))
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration-s", type=float, default=600.0)
    parser.add_argument("--rate-hz", type=float, default=1000.0)
    parser.add_argument("--fps", type=float, default=20.0)
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--core", type=int)
    parser.add_argument("--frames", type=Path, help="folder of pictures in place of rendered ones")
    parser.add_argument("--no-log", action="store_true")
    parser.add_argument("--out", type=Path, help="JSON file for the whole summary")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
    with tempfile.TemporaryDirectory(prefix="bench-hil-") as name:
        folder = Path(name)
        settings = HilSettings(
            out=folder / "out",
            rate_hz=options.rate_hz,
            duration_s=options.duration_s,
            frames=options.frames or pictures(folder / "frames"),
            camera=Path("scenarios/cameras/paper.yaml"),
            fps=options.fps,
            plant=PartnerJob(camera_fps=0.0),
            realtime=options.realtime,
            core=options.core,
            log=not options.no_log,
        )
        load = os.getloadavg()[0]
        plant = settings.plant
        settings = replace(settings, plant=replace(plant, rate_hz=options.rate_hz) if plant else None)
        summary = run_hil(settings)
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
    shown = ("cycles", "overruns", "timing", "held_cycles", "camera", "events", "system", "log", "machine")
    print(json.dumps({key: summary[key] for key in shown}, indent=2))


if __name__ == "__main__":
    main()
