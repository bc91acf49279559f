"""Deviations that the library lacks, and pairs, that the third family of the camera's cases adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from .camera_library import CameraEffect, Scale, Scene, growing
from .camera_system import BEHIND_M, HEIGHT_M

SHARPEST_1_M = 1.0 / 60.0
"""Most curvature of a road's crests and dips, those of a ramp."""
TO_HORIZON = 0.4
"""Share of the way to the horizon that a crest may take what is seen."""


def _crest(scene: Scene, rng: Generator) -> Scale:
    distance = scene.chain.preview_m + BEHIND_M + 6.0
    most = min(SHARPEST_1_M, 2.0 * TO_HORIZON * float(np.arctan(HEIGHT_M / distance)) / distance)
    return lambda severity: {"curvature_1_m": 0.0003 * (most / 0.0003) ** severity}


THIRD_OUTSIDE: dict[str, CameraEffect] = {
    "stamp_extrapolated": CameraEffect(
        growing("age_s", 0.2, 2.5), lambda f, g: replace(f, stamp_age_s=g["age_s"]), ("camera",)
    ),
    "rain_told_as_wet": CameraEffect(
        growing("share", 0.03, 1.0), lambda f, g: replace(f, rained=g["share"]), ("camera", "road")
    ),
    "clock_set_anew": CameraEffect(
        growing("step_s", 0.02, 1.2), lambda f, g: replace(f, clock_set_s=g["step_s"]), ("camera",)
    ),
    "spray_of_others": CameraEffect(
        growing("share", 0.04, 0.95), lambda f, g: replace(f, spray=g["share"]), ("camera", "road")
    ),
    "stretches_shrunk": CameraEffect(
        growing("by_m", 0.15, 5.0), lambda f, g: replace(f, shrunk_m=g["by_m"]), ("road", "camera")
    ),
    "road_undulates": CameraEffect(
        _crest, lambda f, g: replace(f, crest_1_m=g["curvature_1_m"]), ("road", "camera")
    ),
    "unsure_when_slow": CameraEffect(
        growing("share", 0.06, 0.97), lambda f, g: replace(f, slow_unsure=g["share"]), ("camera",)
    ),
    "reference_with_push": CameraEffect(
        growing("share", 0.01, 0.6), lambda f, g: replace(f, measured_push=g["share"]), ("road", "camera")
    ),
}
"""Stamps that go on from an old place, drops on the glass, spray, a clock that is set, crests, and such."""

THIRD_PAIRS = (
    ("camera_pitch", "exposure_shift"),
    ("motion_blur", "class_friction_offset"),
)
"""A new windscreen, tinted and glued in a little askew, and a slow shutter in another country."""
