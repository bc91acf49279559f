"""The contract's effects of the camera: how large, and what they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from .camera_road import CLASS_FRICTION, SURFACES
from .camera_system import BEHIND_M, HEIGHT_M, Chain, Fault
from .details import USUAL_M_S
from .world import Parameters

Scale = Callable[[float], Parameters]

MOST_BLUR = 1.6
"""Over the amount that tells, at `USUAL_M_S` [-]."""


@dataclass(frozen=True)
class Scene:
    """What bounds a deviation: the chain, and the classes that every log drives on."""

    chain: Chain
    driven: tuple[int, ...]


@dataclass(frozen=True)
class CameraEffect:
    """As `world.Effect`, of a camera's chain; `found` are the parameters that columns without pictures can tell."""

    at: Callable[[Scene, Generator], Scale]
    apply: Callable[[Fault, Parameters], Fault]
    subsystems: tuple[str, ...]
    found: tuple[str, ...] = ()


def growing(name: str, least: float, most: float) -> Callable[[Scene, Generator], Scale]:
    return lambda scene, rng: lambda severity: {name: least * (most / least) ** severity}


def _pitch(scene: Scene, rng: Generator) -> Scale:
    """Either way, but never so far up that the stretch comes near the horizon."""
    sign = float(rng.choice([-1.0, 1.0]))
    far = np.arctan(HEIGHT_M / (scene.chain.preview_m + BEHIND_M + 6.0))
    most = 0.12 if sign > 0.0 else min(0.12, 0.45 * float(far))
    return lambda severity: {"pitch_rad": sign * 0.002 * (most / 0.002) ** severity}


def _stops(scene: Scene, rng: Generator) -> Scale:
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda severity: {"stops": sign * 0.3 * (4.5 / 0.3) ** severity}


def _blur(scene: Scene, rng: Generator) -> Scale:
    """As far as more speed still takes more of the confidence, else it would be no other than a wrong exposure."""
    most = MOST_BLUR * scene.chain.blur_m / USUAL_M_S
    return lambda severity: {"exposure_s": 0.05 * most * 20.0**severity}


def _friction(scene: Scene, rng: Generator) -> Scale:
    """One class, two or all that are driven on; each its own way or all alike, and none beyond what roads have."""
    off = rng.permutation(scene.driven)[: rng.integers(1, len(scene.driven) + 1)]
    signs, shares = rng.choice([-1.0, 1.0], 3, p=[0.6, 0.4]), rng.uniform(0.6, 1.0, 3)
    most = {1.0: np.array([0.4, 0.5, 1.5]), -1.0: np.array([0.45, 0.5, 0.5])}

    def parameters(severity: float) -> Parameters:
        share = 0.06 * (1.0 / 0.06) ** severity
        values = {}
        for surface, name in enumerate(SURFACES):
            by = signs[surface] * shares[surface] * share * most[signs[surface]][surface]
            values[name] = round(CLASS_FRICTION[surface] * (1.0 + float(by) * (surface in off)), 4)
        return values

    return parameters


CAMERA_LIBRARY: dict[str, CameraEffect] = {
    "camera_latency": CameraEffect(
        growing("delay_s", 0.01, 0.6),
        lambda f, g: replace(f, delay_s=g["delay_s"]),
        ("camera",),
        ("delay_s",),
    ),
    "camera_pitch": CameraEffect(
        _pitch, lambda f, g: replace(f, pitch_rad=g["pitch_rad"]), ("camera",), ("pitch_rad",)
    ),
    "exposure_shift": CameraEffect(_stops, lambda f, g: replace(f, stops=g["stops"]), ("camera",)),
    "class_friction_offset": CameraEffect(
        _friction,
        lambda f, g: replace(f, friction=(g["dry"], g["wet"], g["snow_ice"])),
        ("camera", "road"),
        SURFACES,
    ),
    "motion_blur": CameraEffect(
        _blur,
        lambda f, g: replace(f, exposure_s=g["exposure_s"]),
        ("camera",),
    ),
}
"""The five effects of the contract's perception chain."""
