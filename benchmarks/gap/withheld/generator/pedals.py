"""What a foot does: torques over time, through corners and with soft ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .kernel import GRAVITY
from .motors import COMMAND_STEP_S

Array = NDArray[np.floating[Any]]
Torque = Callable[[Car, Generator], Array]
Drawn = float | tuple[float, float]
"""A number, or the limits that it is drawn between."""


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


def power(car: Car) -> float:
    """All that the motors have [N m]."""
    return car.motor_peak_torque_nm


def drag(car: Car) -> float:
    """All that the motors brake by [N m]."""
    return -car.motor_peak_torque_nm


def brake(car: Car) -> float:
    """As much as a dry road bears of the brakes [N m]."""
    return -limit_of(car)


def pressed(of: Callable[[Car], float], level: Drawn, *corners: tuple[Drawn, float]) -> Torque:
    """A pedal pressed to a level, drawn first as a share `of` what there is, and through corners of that level.

    Each corner is the duration from the one before [s] and the share of the level.
    """

    def torque(car: Car, rng: Generator) -> Array:
        most = of(car) * _drawn(level, rng)
        return squeezed(*((_drawn(duration, rng), share * most) for duration, share in corners))

    return torque


def _drawn(value: Drawn, rng: Generator) -> float:
    return float(rng.uniform(*value)) if isinstance(value, tuple) else value


def rolling(least_s: float, most_s: float) -> Torque:
    """Nothing, for as long."""
    return lambda car, rng: np.zeros(round(rng.uniform(least_s, most_s) * 100.0))


def gently(share: float, torque: Torque) -> Torque:
    """A share of another torque."""
    return lambda car, rng: share * torque(car, rng)
