"""How the shipped networks' confidence falls with exposure and motion blur, on rendered roads.

``python -m benchmarks.vision.measure_camera_laws --worlds 20`` prints, per strength of a disturbance, the image
estimator's mean log confidence against the undisturbed picture and its share of wrong classes: the source of the
constants of ``scenarios/effects/exposure_shift.py`` and ``motion_blur.py``. Exposure multiplies the linear light and
clips it; blur is the mean, in linear light, of pictures along the way driven while the shutter is open.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from scenarios.camera.disturbances import DISPLAY_GAMMA
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.trajectory import Motion

MODELS = Path(__file__).resolve().parents[2] / "models"
STOPS = (-4.0, -3.0, -2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
BLUR_M = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
SUB_FRAMES = 12
SCALE = 0.5
"""Of the paper's 1920 x 1200 pixels."""
LEAST_CONFIDENCE = 0.01
"""Confidence below it counts as this much: its logarithm would run away [-]."""


def disturbed(renderer: Renderer, position_m: float) -> Iterator[tuple[tuple[str, float], np.ndarray]]:
    """The picture at a place, plain and with every disturbance."""
    image = renderer.frame(position_m).image
    light = linear(image)
    yield ("none", 0.0), image
    for stops in STOPS:
        yield ("exposure_stops", stops), developed(light * 2.0**stops)
    for way_m in BLUR_M:
        places = position_m + way_m * (np.arange(SUB_FRAMES) / SUB_FRAMES - 0.5)
        frames = [linear(renderer.frame(float(place)).image) for place in places]
        yield ("blur_m", way_m), developed(np.mean(frames, axis=0))


def linear(image: np.ndarray) -> np.ndarray:
    return (image.astype(np.float32) / 255.0) ** DISPLAY_GAMMA


def developed(light: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / DISPLAY_GAMMA)).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=20, help="random worlds per surface")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    camera = Camera().scaled(SCALE)
    segmenter = Segmenter(MODELS / "segmenter.onnx", 1)
    ife = Ife(IfeConfig(camera=camera), segmenter, SurfaceClassifier(MODELS / "surface.onnx", 1))
    found: dict[tuple[str, float], list[tuple[float, bool, Surface]]] = {}
    for world in range(arguments.worlds):
        for surface in Surface:
            look = Scene.random(np.random.default_rng([world, int(surface), 77]), surface)
            renderer = Renderer(camera, [SurfaceSegment(0.0, surface)], look)
            for key, image in disturbed(renderer, 30.0):
                _, result = ife.process(IfeState(), image, Motion(15.0))
                found.setdefault(key, []).append((result.Q_v, result.surface == surface, surface))
    plain = np.log([max(q, LEAST_CONFIDENCE) for q, _, _ in found["none", 0.0]])
    print(
        f"{'disturbance':>16} {'strength':>8} {'mean log drop':>14} {'median Q_v':>11} {'wrong':>6}   by class"
    )
    for (name, strength), rows in found.items():
        logs = np.log([max(q, LEAST_CONFIDENCE) for q, _, _ in rows])
        wrong = 1.0 - np.mean([right for _, right, _ in rows])
        by_class = [
            np.mean([d for d, (_, _, s) in zip(plain - logs, rows, strict=True) if s == surface])
            for surface in Surface
        ]
        print(
            f"{name:>16} {strength:8.2f} {np.mean(plain - logs):14.3f} {np.exp(np.median(logs)):11.3f} {wrong:6.2f}   "
            + " ".join(f"{d:6.3f}" for d in by_class)
        )
    q = np.exp(plain)
    print("plain Q_v, quantiles 5 25 50 75 95 %:", np.round(np.quantile(q, [0.05, 0.25, 0.5, 0.75, 0.95]), 3))


if __name__ == "__main__":
    main()
