"""A contact sheet of rendered roads: ``python -m scenarios.camera.preview --out sheet.png``."""

from __future__ import annotations

import argparse

import cv2
import numpy as np
from numpy.typing import NDArray

from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface

from .renderer import Renderer
from .scene import Scene, SurfaceSegment

SHADOW_TINT = np.array([0, 0, 128], dtype=np.uint8)


def contact_sheet(seed: int, columns: int, rows_per_surface: int, labels: bool) -> NDArray[np.uint8]:
    """Random scenes at 480 x 300, rows of dry, wet and snow/ice; ``labels`` tints the labelled shadows red."""
    rng = np.random.default_rng(seed)
    camera = Camera().scaled(0.25)
    rows = []
    for surface in [surface for surface in Surface for _ in range(rows_per_surface)]:
        pictures = []
        for _ in range(columns):
            renderer = Renderer(camera, [SurfaceSegment(0.0, surface)], Scene.random(rng, surface))
            frame = renderer.frame(rng.uniform(0.0, 200.0), rng.normal(0.0, 0.3), rng.normal(0.0, 0.02))
            picture = frame.image
            if labels:
                picture[frame.shadow] = picture[frame.shadow] // 2 + SHADOW_TINT
            pictures.append(picture)
        rows.append(np.hstack(pictures))
    return np.vstack(rows)


def main() -> None:
    """Command line of the preview."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, help="PNG to write")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--columns", type=int, default=4)
    parser.add_argument("--rows", type=int, default=2, help="rows per surface")
    parser.add_argument("--labels", action="store_true", help="tint the labelled shadows red")
    options = parser.parse_args()
    sheet = contact_sheet(options.seed, options.columns, options.rows, options.labels)
    if not cv2.imwrite(options.out, sheet):
        parser.error(f"--out {options.out}: cannot be written; expected a PNG file in an existing folder")


if __name__ == "__main__":
    main()
