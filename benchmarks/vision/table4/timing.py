"""Time of the whole estimator on one 1920 x 1200 picture."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import decode_image
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.trajectory import Motion

THREADS = 2
FRAMES, WARM_UP = 200, 10
GROUPS = {"near group, as in the units": 1, "all three groups": 3}


def frame_times(models: Path) -> dict[str, Any]:
    """Median and 99th percentile per frame, decoding apart, by clock and processor; with the load at hand."""
    networks = (
        Segmenter(models / "segmenter.onnx", THREADS),
        SurfaceClassifier(models / "surface.onnx", THREADS),
    )
    renderer = Renderer(Camera(), [SurfaceSegment(0.0, Surface.WET)], Scene(seed=1))
    pictures = [renderer.frame(float(place)).image for place in range(0, 50, 10)]
    files = [cv2.imencode(".jpg", picture)[1].tobytes() for picture in pictures]
    found: dict[str, Any] = {
        "threads": THREADS,
        "cpus": os.cpu_count(),
        "frames": FRAMES,
        "load_1min_before": os.getloadavg()[0],
    }
    # A memory without looks and a known way: the middle group is looked at in every frame.
    moving = Motion(10.0, way_m=0.0)
    for name, groups in GROUPS.items():
        ife = Ife(IfeConfig(groups_looked_at=groups), *networks)
        found[name] = _timed(lambda i, ife=ife: ife.process(IfeState(), pictures[i % 5], moving))
    found["JPEG decoding besides"] = _timed(lambda i: decode_image(files[i % 5]))
    return found


def _timed(work: Callable[[int], Any]) -> dict[str, float]:
    wall, processor = [], []
    for i in range(WARM_UP + FRAMES):
        begin, busy = time.perf_counter(), time.process_time()
        work(i)
        wall.append(1e3 * (time.perf_counter() - begin))
        processor.append(1e3 * (time.process_time() - busy))
    wall, processor = wall[WARM_UP:], processor[WARM_UP:]
    return {
        "median_ms": round(float(np.median(wall)), 2),
        "p99_ms": round(float(np.percentile(wall, 99.0)), 2),
        "processor_median_ms": round(float(np.median(processor)), 2),
    }
