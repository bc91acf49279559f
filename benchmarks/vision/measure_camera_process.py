"""Measures the classes that the camera side gives rendered, disturbed roads: the source of camera_process.yaml.

``python -m benchmarks.vision.measure_camera_process --worlds 24`` draws that many random worlds, each with the three
surfaces in a random order over 20 m each, passes pictures every 0.75 m through the disturbances of the scenario, the
JPEG encoder and the image estimator with the shipped networks, and writes the class of every picture of one surface.
The worlds' seeds begin at 900 000, apart from those of any scenario or sweep in this project.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from scenarios.camera.disturbances import disturb
from scenarios.files import RoadFile, RoadSegment, Scenario, load_scenario
from scenarios.pictures import DISTURBANCES, scene_renderer
from scenarios.sweep.camera import RECORDS
from scenarios.vision_overlay import image_estimator
from scenarios.yaml_text import to_yaml
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import IfeState
from trpac_core.vision.images import decode_image
from trpac_core.vision.trajectory import Motion

FIRST_SEED = 900_000
STRETCH_M = 20.0
SPACING_M = 0.75
"""Way between pictures: three frames of 20 Hz at 5 m/s [m]."""
SPEED_M_S = 7.0


@dataclass(frozen=True)
class ImageResult:
    """What was said of one picture; surface is None where the near group lies on two."""

    surface: Surface | None
    middle: Surface
    given: Surface
    Q_v: float
    flag: bool
    seconds: float


def world(base: Scenario, seed: int) -> Scenario:
    """The scenario with a world of its own: surfaces in a random order; friction does not show in pictures."""
    order = np.random.default_rng([seed, 1]).permutation(len(Surface))
    segments = [
        RoadSegment.model_validate(
            {
                "start_m": STRETCH_M * number,
                "mu_left": 0.5,
                "mu_right": 0.5,
                "surface": Surface(int(index)).label,
            }
        )
        for number, index in enumerate(order)
    ]
    return replace(base, seed=seed, road=RoadFile(schema=1, segments=segments))


def image_results(scenario: Scenario) -> Iterator[ImageResult]:
    """The image estimator's verdicts along a world, in the order of a drive."""
    renderer, ife, state = scene_renderer(scenario), image_estimator(scenario), IfeState()
    near_m, far_m = ife.config.ranges_m[0]
    disturbance = DISTURBANCES[scenario.pictures.disturbance]
    quality = [cv2.IMWRITE_JPEG_QUALITY, scenario.pictures.jpeg_quality]
    for number, position_m in enumerate(np.arange(0.0, 3.0 * STRETCH_M - far_m, SPACING_M)):
        seed = int(np.random.SeedSequence([scenario.seed, number]).generate_state(1)[0])
        image = disturb(renderer.frame(float(position_m)).image, disturbance, seed)
        _, packed = cv2.imencode(".jpg", image, quality)
        began = time.perf_counter()
        decoded = decode_image(packed.tobytes())
        state, result = ife.process(state, decoded, Motion(SPEED_M_S, way_m=float(position_m)))
        passed = time.perf_counter() - began
        ends = [
            scenario.road.segment_at(float(position_m) + ahead).surface_class for ahead in (near_m, far_m)
        ]
        middle = scenario.road.segment_at(float(position_m) + 0.5 * (near_m + far_m)).surface_class
        pure = ends[0] if ends[0] == ends[1] else None
        yield ImageResult(pure, middle, result.surface, float(result.Q_v), bool(result.flag), passed)


def record(found: list[ImageResult], seed: int) -> dict[str, Any]:
    """One world's verdicts per surface: classes as digits, confidences in hundredths, 0.5 at most without flag."""
    entry: dict[str, Any] = {"seed": seed}
    for surface in Surface:
        here = [v for v in found if v.surface == surface]
        confidence = [v.Q_v if v.flag else min(v.Q_v, 0.5) for v in here]
        entry[surface.label] = {
            "given": "".join(str(int(v.given)) for v in here),
            "Q_v_percent": " ".join(f"{100.0 * q:.0f}" for q in confidence),
        }
    return entry


def statistics(worlds: list[list[ImageResult]]) -> dict[str, Any]:
    """Confusion, flags, persistence of errors and time, for a person to read; the process draws from the records."""
    found = [v for along_world in worlds for v in along_world]
    confusion, flags = {}, {}
    for surface in Surface:
        here = [v for v in found if v.surface == surface]
        confusion[surface.label] = [round(float(np.mean([v.given == s for v in here])), 3) for s in Surface]
        flags[surface.label] = {
            "flag_share": round(float(np.mean([v.flag for v in here])), 3),
            "flag_share_of_wrong": _mean([v.flag for v in here if v.given != surface]),
            "wrong_share_by_world": [
                _mean([v.given != s for v in w if (s := v.surface) == surface]) for w in worlds
            ],
        }
    pairs = [(a, b) for w in worlds for a, b in pairwise(w) if a.surface == b.surface is not None]
    wrong_before = [b.given != b.surface for a, b in pairs if a.given != a.surface]
    mixed = [v for v in found if v.surface is None]
    seconds = np.array([v.seconds for v in found])
    return {
        "pictures": len(found),
        "confusion_dry_wet_snow_ice": confusion,
        "flags": flags,
        "wrong_share": _mean([v.given != v.surface for v in found if v.surface is not None]),
        "wrong_share_after_a_wrong_one": _mean(wrong_before),
        "on_two_surfaces_that_of_the_middle": _mean([v.given == v.middle for v in mixed]),
        "seconds_per_picture": {
            "median": round(float(np.median(seconds)), 4),
            "percentile_95": round(float(np.percentile(seconds, 95)), 4),
        },
    }


def _mean(values: list[bool]) -> float | None:
    return round(float(np.mean(values)), 3) if values else None


def main() -> None:
    """Command line of the measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=24)
    parser.add_argument("--out", type=Path, default=RECORDS)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    base = load_scenario("paper_simulation")
    seeds = range(FIRST_SEED, FIRST_SEED + options.worlds)
    worlds = []
    for seed in seeds:
        worlds.append(list(image_results(world(base, seed))))
        print(f"world {seed - FIRST_SEED + 1} of {options.worlds}", flush=True)
    content = {
        "schema": 1,
        "how": " ".join((__doc__ or "").split()),
        "disturbance": base.pictures.disturbance,
        "spacing_m": SPACING_M,
        "near_m": 3.5,
        "statistics": statistics(worlds),
        "worlds": [record(w, seed) for w, seed in zip(worlds, seeds, strict=True)],
    }
    options.out.write_text(to_yaml(content, width=4000), encoding="utf-8")


if __name__ == "__main__":
    main()
