"""What a foot does: torques over time, through corners and with soft ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .car import Car
from .kernel import COMMAND_STEP_S, GRAVITY

Array = NDArray[np.floating[Any]]


def clock_of(duration_s: float) -> Array:
    return np.arange(1, round(duration_s / COMMAND_STEP_S) + 1) * COMMAND_STEP_S


def limit_of(car: Car) -> float:
    """Torque per wheel that a dry road just bears [N m]."""
    return car.mass_kg * GRAVITY / 4.0 * car.wheel_radius_m


def squeezed(*corners: tuple[float, float]) -> Array:
    """Torque through corners of (duration from the corner before [s], torque [N m]), at rest in each."""
    parts, last = [], 0.0
    for duration, level in corners:
        z = np.minimum(clock_of(duration) / duration, 1.0)
        parts.append(last + (level - last) * z * z * (3.0 - 2.0 * z))
        last = level
    return np.concatenate(parts)


def faded(torque: Array) -> Array:
    """From nothing and back to nothing, over 0.3 s each."""
    to_go = np.arange(torque.size)
    return torque * np.clip(np.minimum(to_go, to_go[::-1]) * COMMAND_STEP_S / 0.3, 0.0, 1.0)
