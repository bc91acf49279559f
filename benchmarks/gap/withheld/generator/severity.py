"""How large a deviation is: its gap in units of the sensors' noise, and the severity that has a wanted gap.

The gap is taken over windows of a second, each begun at the state that the log shows: over a whole drive a simulation
that runs free goes astray without bound, and the number would tell the drive's length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import Drive, Style, UndrivableError, drive
from .kernel import RECORD_STEP_S, X, replay
from .sensors import Noise, read
from .world import World

Array = NDArray[np.floating[Any]]

WINDOW = round(1.0 / RECORD_STEP_S)
SETTLE = round(0.05 / RECORD_STEP_S)
CEILING = 1e3
SIGNALS = {"wheel_speed": slice(0, 4), "vehicle_speed": slice(4, 5), "accel_x": slice(5, 6)}


def residual(world: World, simulated: World, driven: Drive) -> Array:
    """What the sensors would read without noise less what the simulation says, shape (n, 6), NaN where it settles."""
    clock = np.arange(len(driven.path)) * RECORD_STEP_S
    shown = read(driven.path, world.sensors, clock)
    return residual_of(shown, driven.path[:, X].copy(), simulated, driven.command)


def residual_of(shown: Array, position_m: Array, simulated: World, command: Array) -> Array:
    """Of readings every `RECORD_STEP_S`: the same, shape (n, 6)."""
    wheels, speed = np.maximum(shown[:, :4], 0.0), np.maximum(shown[:, 4], 0.0)
    told = replay(simulated.physics, position_m, speed, wheels, simulated.split, command, WINDOW, SETTLE)
    return shown - told


@dataclass(frozen=True)
class Size:
    """A gap [noise floors]: 1 is none."""

    total: float
    signals: dict[str, float]


def size_of(difference: Array, noise: Noise) -> Size:
    """Root mean square over the signals, the noise itself included."""
    scaled = difference / noise.sigmas
    parts = {name: float(np.sqrt(np.nanmean(scaled[:, columns] ** 2))) for name, columns in SIGNALS.items()}
    return Size(float(np.sqrt(1.0 + np.mean(np.square(list(parts.values()))))), parts)


def find_severity(gap_at: Callable[[float], float], target: float, tries: int = 6) -> float:
    """Severity in 0..1 at which the gap, growing with it, is `target` within a tenth; the nearest end where none is.

    By the secant in the gap's logarithm, kept off the ends so that a gap that jumps is still bracketed.
    """
    low, high = 0.0, 1.0
    below, above = gap_at(low), gap_at(high)
    if below >= target:
        return low
    if above <= target:
        return high
    for _ in range(tries):
        share = np.log(target / below) / np.log(min(above, CEILING) / below)
        middle = low + (high - low) * float(np.clip(share, 0.15, 0.85))
        gap = gap_at(middle)
        if abs(np.log(gap / target)) < 0.1:
            break
        low, below, high, above = (middle, gap, high, above) if gap < target else (low, below, middle, gap)
    return middle


def drive_or_none(
    car: Car, world: World, rich: bool, duration_s: float, rng: Generator, style: Style
) -> Drive | None:
    """`drive`, or nothing where the car cannot be driven."""
    try:
        return drive(car, world, rich, duration_s, rng, style)
    except UndrivableError:
        return None
