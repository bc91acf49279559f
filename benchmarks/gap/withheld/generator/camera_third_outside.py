"""Deviations that the library lacks, and pairs, that the third family of the camera's cases adds."""

from __future__ import annotations

from dataclasses import replace

from .camera_library import CameraEffect, growing

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
    "position_wanders": CameraEffect(
        growing("amplitude_m", 0.15, 6.0),
        lambda f, g: replace(f, wandered_m=g["amplitude_m"]),
        ("camera", "road"),
    ),
    "unsure_when_slow": CameraEffect(
        growing("share", 0.06, 0.97), lambda f, g: replace(f, slow_unsure=g["share"]), ("camera",)
    ),
    "reference_with_push": CameraEffect(
        growing("share", 0.01, 0.6), lambda f, g: replace(f, measured_push=g["share"]), ("road", "camera")
    ),
}
"""Stamps that go on from an old place, drops on the glass, spray, a clock that is set, satellites, and such."""

THIRD_PAIRS = (
    ("camera_pitch", "exposure_shift"),
    ("motion_blur", "class_friction_offset"),
)
"""A new windscreen, tinted and glued in a little askew, and a slow shutter in another country."""
