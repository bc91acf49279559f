"""Deviations of the camera's chain that the contract's library lacks; any of the subsystems is a right answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from numpy.random import Generator

from .camera_library import CAMERA_LIBRARY, CameraEffect, Scale, Scene, growing

SLOW_S = 0.6
"""Least lateness of a friction's reference that is more than a filter's [s]."""


def _signed(name: str, least: float, most: float) -> Callable[[Scene, Generator], Scale]:
    def at(scene: Scene, rng: Generator) -> Scale:
        sign = float(rng.choice([-1.0, 1.0]))
        return lambda severity: {name: sign * least * (most / least) ** severity}

    return at


def _confusion(scene: Scene, rng: Generator) -> Scale:
    begin = float(rng.uniform(50.0, 120.0))
    return lambda severity: {"from_m": begin, "length_m": 4.0 * 40.0**severity}


def _one(field: str, name: str, least: float, most: float, *places: str, at: Any = growing) -> CameraEffect:
    """One parameter that is one of the chain's faults."""
    return CameraEffect(at(name, least, most), lambda f, g: replace(f, **{field: g[name]}), places)


CAMERA_OUTSIDE: dict[str, CameraEffect] = {
    "odometer_drift": _one("odometer", "share", 0.001, 0.03, "camera", "road", at=_signed),
    "map_borders_off": _one("map_m", "spread_m", 0.3, 6.0, "road", "camera"),
    "sun_glare": _one("glare", "share", 0.05, 0.9, "camera", "road"),
    "stretch_confused": CameraEffect(
        _confusion,
        lambda f, g: replace(f, confused_m=g["length_m"], confused_from_m=g["from_m"]),
        ("camera", "road"),
    ),
    "camera_clock_fast": _one("clock", "share", 0.0005, 0.03, "camera"),
    "camera_freezes": _one("frozen_s", "hold_s", 0.1, 2.5, "camera"),
    "wet_told_as_snow": _one("swapped", "share", 0.03, 1.0, "camera", "road"),
    "lens_fogs": _one("fogged", "share", 0.04, 0.95, "camera"),
    "position_jumps": _one("jumped_m", "jump_m", 0.2, 8.0, "camera", "road"),
    "map_labels_old": _one("relabelled", "share", 0.01, 0.6, "road", "camera"),
    "slippery_told_on": _one("sticky_s", "hold_s", 0.05, 3.0, "camera", "road"),
    "bracket_loose": _one("loose", "share", 0.04, 0.95, "camera"),
    "wet_dazzles": _one("unsure", "share", 0.04, 0.9, "camera", "road"),
    "reference_late": _one("measured_late_s", "delay_s", SLOW_S, 4.0, "road", "camera"),
    "reference_with_speed": _one("measured_speed", "share", 0.02, 0.8, "road", "camera"),
    "stamp_extrapolated": _one("stamp_age_s", "age_s", 0.2, 2.5, "camera"),
    "rain_told_as_wet": _one("rained", "share", 0.03, 1.0, "camera", "road"),
    "clock_set_anew": _one("clock_set_s", "step_s", 0.02, 1.2, "camera"),
    "spray_of_others": _one("spray", "share", 0.04, 0.95, "camera", "road"),
    "stretches_shrunk": _one("shrunk_m", "by_m", 0.15, 5.0, "road", "camera"),
    "position_wanders": _one("wandered_m", "amplitude_m", 0.15, 6.0, "camera", "road"),
    "unsure_when_slow": _one("slow_unsure", "share", 0.06, 0.97, "camera"),
    "reference_with_push": _one("measured_push", "share", 0.01, 0.6, "road", "camera"),
}
"""Old labels in the map, a lens that fogs, a loose bracket, drops on the glass, a clock that is set, and such."""

ALL_EFFECTS = CAMERA_LIBRARY | CAMERA_OUTSIDE
"""All that can be hidden."""
