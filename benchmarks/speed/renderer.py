"""CPU time of one picture, single-threaded: ``python -m benchmarks.speed.renderer``."""

import statistics
import time

import cv2
import numpy as np

from scenarios.camera.disturbances import PAPER, disturb
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface

FRAMES = 12


def cpu_ms(work, repeats=FRAMES):
    """Median and fastest CPU time of ``work(i)`` [ms]."""
    work(0)
    times = []
    for i in range(repeats):
        start = time.process_time()
        work(i)
        times.append((time.process_time() - start) * 1e3)
    return statistics.median(times), min(times)


def main():
    cv2.setNumThreads(1)
    print(f"{'what':34} {'median':>8} {'fastest':>8}  [ms CPU]")
    segments = [SurfaceSegment(0.0, Surface.DRY)]
    for factor in (1.0, 0.25):
        camera = Camera().scaled(factor)
        size = f"{camera.width_px}x{camera.height_px}"
        for surface in Surface:
            renderer = Renderer(camera, [SurfaceSegment(0.0, surface)], Scene())
            times = cpu_ms(lambda i, renderer=renderer: renderer.frame(2.0 * i))
            print(f"{size + ' frame, ' + surface.label:34} {times[0]:8.1f} {times[1]:8.1f}")
        looks = [Scene.random(np.random.default_rng(seed)) for seed in range(FRAMES)]
        times = cpu_ms(lambda i, camera=camera, looks=looks: Renderer(camera, segments, looks[i]))
        print(f"{size + ' new world':34} {times[0]:8.1f} {times[1]:8.1f}")
        image = Renderer(camera, segments, Scene()).frame(0.0).image
        times = cpu_ms(lambda i, image=image: disturb(image, PAPER, i))
        print(f"{size + ' disturbance':34} {times[0]:8.1f} {times[1]:8.1f}")


if __name__ == "__main__":
    main()
