"""Roads of several surfaces, who drives on them, and where the car was: what the camera's cases see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car, Road
from .driver import COAST, Piece, Style
from .kernel import RECORD_STEP_S, V, X
from .pedals import clock_of, drag, faded, power, pressed, squeezed

Array = NDArray[np.floating[Any]]
Whole = NDArray[np.integer[Any]]

SURFACES = ("dry", "wet", "snow_ice")
CLASS_FRICTION = (0.8, 0.6, 0.2)
"""Friction value of each class [-]."""
ROAD_M = 1900.0
"""Farther than a car at 30 m/s comes in a minute."""
NEXT_M = {"usual": (12.0, 60.0), "few": (70.0, 180.0)}
"""From one border to the next."""
ODDS = (0.4, 0.35, 0.25)
"""Of dry, wet and snow, each but after itself."""


@dataclass(frozen=True)
class CameraRoad(Road):
    """road.yaml with the surfaces that a camera tells apart, an index of `SURFACES` for each segment."""

    surface: tuple[int, ...] = (0,)

    def write(self, path: Path) -> None:
        """As the contract's file."""
        segments = [
            {"start_m": start, "mu_left": mu, "mu_right": mu, "surface": SURFACES[surface]}
            for start, mu, surface in zip(self.start_m, self.mu, self.surface, strict=True)
        ]
        path.write_text(
            yaml.safe_dump({"schema": 1, "segments": segments}, sort_keys=False), encoding="utf-8"
        )

    @property
    def borders(self) -> Array:
        """Where one surface ends and the next begins [m]."""
        return np.array(self.start_m[1:])

    def class_at(self, place_m: Array) -> Whole:
        """Index of the surface at places; before the road's zero it is the first one."""
        return np.array(self.surface)[np.searchsorted(self.borders, place_m, side="right")]

    def with_friction(self, values: tuple[float, ...]) -> CameraRoad:
        """The same road with other friction for each surface."""
        return replace(self, mu=tuple(values[surface] for surface in self.surface))

    def with_mu(self, mu: Array) -> CameraRoad:
        """The same road with other friction for each stretch."""
        return replace(self, mu=tuple(float(value) for value in mu))

    def with_borders(self, borders: Array) -> CameraRoad:
        """The same surfaces with other borders."""
        return replace(self, start_m=(0.0, *(round(float(border), 2) for border in borders)))


def draw_camera_road(rng: Generator, kind: str) -> CameraRoad:
    """Surfaces at random, each of the friction that its class has; `kind` is one of `NEXT_M`."""
    surface = [int(rng.choice(3, p=ODDS))]
    starts = [0.0]
    while starts[-1] < ROAD_M:
        starts.append(round(starts[-1] + rng.uniform(*NEXT_M[kind]), 2))
        odds = np.array(ODDS) * (np.arange(3) != surface[-1])
        surface.append(int(rng.choice(3, p=odds / odds.sum())))
    return CameraRoad(tuple(starts), tuple(CLASS_FRICTION[s] for s in surface), tuple(surface))


@dataclass(frozen=True)
class Passage:
    """Where the front axle was, and how fast; before the record it rolled at the speed that the record begins with."""

    front_m: Array
    speed_m_s: Array

    @property
    def end_s(self) -> float:
        """Of the record."""
        return (self.front_m.size - 1) * RECORD_STEP_S

    def at(self, time_s: Array) -> Array:
        """Place of the front axle [m]."""
        clock = np.arange(self.front_m.size) * RECORD_STEP_S
        before = self.speed_m_s[0] * np.minimum(time_s, 0.0)
        after = self.speed_m_s[-1] * np.maximum(time_s - self.end_s, 0.0)
        return np.asarray(np.interp(time_s, clock, self.front_m) + before + after)

    def speed(self, time_s: Array) -> Array:
        """Of the car [m/s]."""
        return np.asarray(np.interp(time_s, np.arange(self.front_m.size) * RECORD_STEP_S, self.speed_m_s))


def passage_of(path: Array, car: Car) -> Passage:
    """Of the kernel's record."""
    return Passage(path[:, X] + car.wheelbase_m - car.cog_to_rear_axle_m, path[:, V].copy())


# --- drivers that every surface bears


def _keep(car: Car, rng: Generator) -> Array:
    """As good as one speed."""
    clock = clock_of(rng.uniform(3.0, 6.0))
    wave = 0.03 * np.sin(2.0 * np.pi * clock / rng.uniform(2.0, 4.0)) + rng.uniform(-0.005, 0.015)
    return faded(car.motor_peak_torque_nm * wave)


def _nudge(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.1, 0.3) * rng.choice([-1.0, 1.0])
    return squeezed((0.3, level), (rng.uniform(0.5, 1.5), level), (0.3, 0.0))


_KEEP = Piece(6.0, 99.0, _keep)
_UP = pressed(power, (0.25, 0.5), (0.5, 1.0), ((2.5, 6.0), 1.0), (0.5, 0.0))
_DOWN = pressed(drag, (0.25, 0.45), (0.5, 1.0), ((2.0, 5.0), 1.0), (0.5, 0.0))
ALL_SPEEDS = Style(
    rich=(
        Piece(0.0, 20.0, _UP),
        _KEEP,
        Piece(13.0, 99.0, _DOWN),
        Piece(7.0, 26.0, _nudge),
        Piece(0.0, 17.0, _UP),
        COAST,
        Piece(11.0, 99.0, _DOWN),
    ),
    mild=(_KEEP,),
    drive_front=(0.5, 0.6),
    brake_front=0.6,
)
"""Slow and fast in turn when rich, and one speed when mild."""
