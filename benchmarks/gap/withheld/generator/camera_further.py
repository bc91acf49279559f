"""Deviations that the library lacks, and pairs: what the second family of the camera's cases adds, and each has."""

from __future__ import annotations

from dataclasses import replace

from .camera_family import CameraFamily
from .camera_library import CAMERA_LIBRARY, CAMERA_OUTSIDE, CAMERA_PAIRS, CameraEffect, growing
from .camera_third_outside import THIRD_OUTSIDE, THIRD_PAIRS

SLOW_S = 0.6
"""Least lateness of a friction's reference that is more than a filter's [s]."""

FURTHER_OUTSIDE: dict[str, CameraEffect] = {
    "wet_told_as_snow": CameraEffect(
        growing("share", 0.03, 1.0), lambda f, g: replace(f, swapped=g["share"]), ("camera", "road")
    ),
    "lens_fogs": CameraEffect(
        growing("share", 0.04, 0.95), lambda f, g: replace(f, fogged=g["share"]), ("camera",)
    ),
    "position_jumps": CameraEffect(
        growing("jump_m", 0.2, 8.0), lambda f, g: replace(f, jumped_m=g["jump_m"]), ("camera", "road")
    ),
    "map_labels_old": CameraEffect(
        growing("share", 0.01, 0.6), lambda f, g: replace(f, relabelled=g["share"]), ("road", "camera")
    ),
    "slippery_told_on": CameraEffect(
        growing("hold_s", 0.05, 3.0), lambda f, g: replace(f, sticky_s=g["hold_s"]), ("camera", "road")
    ),
    "bracket_loose": CameraEffect(
        growing("share", 0.04, 0.95), lambda f, g: replace(f, loose=g["share"]), ("camera",)
    ),
    "wet_dazzles": CameraEffect(
        growing("share", 0.04, 0.9), lambda f, g: replace(f, unsure=g["share"]), ("camera", "road")
    ),
    "reference_late": CameraEffect(
        growing("delay_s", SLOW_S, 4.0),
        lambda f, g: replace(f, measured_late_s=g["delay_s"]),
        ("road", "camera"),
    ),
    "reference_with_speed": CameraEffect(
        growing("share", 0.02, 0.8), lambda f, g: replace(f, measured_speed=g["share"]), ("road", "camera")
    ),
}
"""Old labels in the map, a lens that fogs, a bracket that shakes under power, a reference that is late, and such."""

FURTHER_PAIRS = (
    ("camera_latency", "exposure_shift"),
    ("camera_pitch", "class_friction_offset"),
    ("camera_latency", "motion_blur"),
)
"""A night drive with a computer that is too slow, a knock and another country, a slow shutter on a slow system."""

CAMERA_OUTSIDES = {
    CameraFamily.FIRST: CAMERA_OUTSIDE,
    CameraFamily.SECOND: {**CAMERA_OUTSIDE, **FURTHER_OUTSIDE},
    CameraFamily.THIRD: {**CAMERA_OUTSIDE, **FURTHER_OUTSIDE, **THIRD_OUTSIDE},
}
"""Each family's deviations outside the library."""
PAIRS_OF = {
    CameraFamily.FIRST: (CAMERA_PAIRS,),
    CameraFamily.SECOND: (CAMERA_PAIRS, FURTHER_PAIRS),
    CameraFamily.THIRD: (CAMERA_PAIRS, FURTHER_PAIRS, THIRD_PAIRS),
}
"""Each family's pairs: those of the one before, and what it adds."""

ALL_EFFECTS = {**CAMERA_LIBRARY, **CAMERA_OUTSIDES[CameraFamily.THIRD]}
"""All that can be hidden."""
