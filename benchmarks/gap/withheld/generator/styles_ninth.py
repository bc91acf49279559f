"""Driver of the ninth family: one who leaves the pedals to the cruise control, and takes over when he has enough."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


def _resume(car: Car, rng: Generator) -> Array:
    """Back to the set speed: a limited push that fades as the speed comes near."""
    level, clock = car.motor_peak_torque_nm * rng.uniform(0.3, 0.6), clock_of(rng.uniform(2.0, 4.0))
    return np.concatenate([squeezed((rng.uniform(0.3, 0.7), level)), level * np.exp(-clock), np.zeros(10)])


def _keeping_distance(car: Car, rng: Generator) -> Array:
    """The controller hunts about the distance to the car ahead, a little slower each time."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    wave = np.sin(2.0 * np.pi * rng.uniform(0.6, 1.2) * clock / (1.0 + 0.15 * clock))
    return faded(car.motor_peak_torque_nm * (0.06 + rng.uniform(0.2, 0.45) * wave))


def _cut_in(car: Car, rng: Generator) -> Array:
    """Someone moves in ahead: a brake in two stages, and its release in one."""
    soft, hard = -rng.uniform(0.15, 0.3) * limit_of(car), -rng.uniform(0.45, 0.75) * limit_of(car)
    return squeezed(
        (0.25, soft),
        (rng.uniform(0.4, 0.9), soft),
        (0.2, hard),
        (rng.uniform(0.5, 1.2), hard),
        (rng.uniform(0.3, 0.6), 0.0),
    )


def _emergency(car: Car, rng: Generator) -> Array:
    """A jolt that warns, then all of the brake at once (it lets go when the wheels slide)."""
    jolt, limit = -0.35 * limit_of(car), -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (0.08, jolt),
        (0.12, jolt),
        (0.1, 0.0),
        (rng.uniform(0.3, 0.7), 0.0),
        (rng.uniform(0.1, 0.2), limit),
        (rng.uniform(0.5, 1.2), limit),
        (0.2, 0.0),
        (0.3, 0.0),
    )


def _enough(car: Car, rng: Generator) -> Array:
    """His own foot down, all that the motors have (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed((rng.uniform(0.1, 0.25), peak), (rng.uniform(0.8, 1.8), peak), (0.2, 0.0), (0.4, 0.0))


def _pulled_back(car: Car, rng: Generator) -> Array:
    """On and off as lanes ahead open and close."""
    corners = []
    for _ in range(rng.integers(2, 5)):
        on, off = rng.uniform(0.3, 0.8), -rng.uniform(0.1, 0.5)
        corners += [(0.15, on), (rng.uniform(0.2, 0.6), on), (0.1, 0.0), (rng.uniform(0.1, 0.4), 0.0)]
        corners += [(0.15, off), (rng.uniform(0.2, 0.5), off), (0.1, 0.0)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


def _let_run(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(1.5, 3.0) * 100.0))


def _resume_gently(car: Car, rng: Generator) -> Array:
    return 0.35 * _resume(car, rng)


def _keeping_gently(car: Car, rng: Generator) -> Array:
    return 0.25 * _keeping_distance(car, rng)


_EMERGENCY = Piece(12.0, 99.0, _emergency)
CRUISE_CONTROL = Style(
    rich=(
        Piece(0.0, 23.0, _resume),
        _EMERGENCY,
        Piece(8.0, 25.0, _keeping_distance),
        Piece(0.0, 21.0, _enough),
        Piece(12.0, 99.0, _cut_in),
        Piece(8.0, 25.0, _pulled_back),
        _EMERGENCY,
        Piece(8.0, 99.0, _let_run),
    ),
    mild=(Piece(0.0, 22.0, _resume_gently), Piece(8.0, 24.0, _keeping_gently), COAST),
    drive_front=(0.5, 0.4, 0.55),
    brake_front=0.64,
)
