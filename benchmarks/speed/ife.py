"""Time of each stage of the image-based fusion estimator on a rendered 1920 x 1200 frame; prints JSON.

python -m benchmarks.speed.ife [--models FOLDER] [--frames N] [--threads N] [--side left|right|both] [--groups 1|2|3]
"""

import argparse
import json
import os
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np

from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision import ife as ife_module
from trpac_core.vision import region as region_module
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import decode_image
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.trajectory import Motion

STAGES: dict[str, dict[ModuleType, list[str]]] = {
    "track": {ife_module: ["reckon"]},
    "lines": {ife_module: ["lines_across"]},
    "regions": {
        ife_module: ["corners_in_ellipses", "classify_corners", "sample"],
        region_module: ["roi_widths_px", "roi_boxes"],
    },
    "patches": {region_module: ["cut_box"]},
    "fuse": {ife_module: ["among_neighbours", "update_weights", "basic_probability", "combine"]},
}
WARM_UP = 5
STEP_M = 0.5
"""Way from frame to frame: enough for the middle group to be looked at in each [m]."""


class Stopwatch:
    """Sums the time of wrapped functions per stage and frame."""

    def __init__(self) -> None:
        self.frame: dict[str, float] = defaultdict(float)
        self.frames: dict[str, list[float]] = defaultdict(list)

    def wrap(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any, **options: Any) -> Any:
            begin = time.perf_counter()
            result = function(*args, **options)
            self.frame[stage] += time.perf_counter() - begin
            return result

        return timed

    def end_frame(self, total_s: float) -> None:
        self.frame["other"] = total_s - sum(self.frame.values())
        for stage, duration in {**self.frame, "whole": total_s}.items():
            self.frames[stage].append(duration * 1e3)
        self.frame.clear()


def summary(durations_ms: list[float]) -> dict[str, float]:
    return {
        "median_ms": round(float(np.median(durations_ms)), 2),
        "p99_ms": round(float(np.percentile(durations_ms, 99)), 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, default=Path(__file__).parents[2] / "models")
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--side", choices=["left", "right", "both"], default="both")
    parser.add_argument(
        "--groups", type=int, choices=[1, 2, 3], default=1, help="with a verdict: in the units the near one"
    )
    options = parser.parse_args()

    segmenter = Segmenter(options.models / "segmenter.onnx", options.threads)
    classifier = SurfaceClassifier(options.models / "surface.onnx", options.threads)
    renderer = Renderer(Camera(), [SurfaceSegment(0.0, Surface.WET)], Scene(seed=1))
    pictures = [renderer.frame(float(position)).image for position in range(0, 50, 10)]
    jpeg = cv2.imencode(".jpg", pictures[0])[1].tobytes()

    watch = Stopwatch()
    estimator = Ife(IfeConfig(side=options.side, groups_looked_at=options.groups), segmenter, classifier)
    segmenter.segment = watch.wrap("resize_and_segment", segmenter.segment)  # type: ignore[method-assign]
    classifier.verdicts = watch.wrap("classify", classifier.verdicts)  # type: ignore[method-assign]
    for stage, modules in STAGES.items():
        for module, names in modules.items():
            for name in names:
                setattr(module, name, watch.wrap(stage, getattr(module, name)))

    state, n_roi, decode_ms = IfeState(), 0, []
    for frame in range(WARM_UP + options.frames):
        begin = time.perf_counter()
        motion = Motion(10.0, way_m=STEP_M * frame)
        state, result = estimator.process(state, pictures[frame % len(pictures)], motion)
        watch.end_frame(time.perf_counter() - begin)
        n_roi += sum(group.n_roi for group in result.groups)
        begin = time.perf_counter()
        decode_image(jpeg)
        decode_ms.append((time.perf_counter() - begin) * 1e3)
    print(
        json.dumps(
            {
                "picture_px": [1920, 1200],
                "side": options.side,
                "groups": options.groups,
                "frames": options.frames,
                "threads": options.threads,
                "cpus": os.cpu_count(),
                "patches_per_frame": round(n_roi / (WARM_UP + options.frames), 1),
                "stages": {stage: summary(times[WARM_UP:]) for stage, times in watch.frames.items()},
                "jpeg_decode_besides": summary(decode_ms[WARM_UP:]),
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
