"""Driver of the eighth family: one who learns to brake on a training ground."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


def _to_the_cones(car: Car, rng: Generator) -> Array:
    """A held speed up to the cones, then all of the brake at once (he lets go when the wheels slide)."""
    hold, limit = car.motor_peak_torque_nm * rng.uniform(0.02, 0.08), -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (0.3, hold),
        (rng.uniform(0.6, 1.5), hold),
        (0.1, 0.0),
        (rng.uniform(0.1, 0.2), limit),
        (rng.uniform(0.5, 1.2), limit),
        (0.15, 0.0),
        (0.4, 0.0),
    )


def _on_the_threshold(car: Car, rng: Generator) -> Array:
    """Up to where the wheels begin to slide, a little back, and up again, as he was told."""
    corners = [(rng.uniform(0.2, 0.4), -0.7 * limit_of(car))]
    for _ in range(rng.integers(2, 5)):
        corners += [(rng.uniform(0.2, 0.4), -rng.uniform(0.9, 1.1) * limit_of(car))]
        corners += [(0.15, -rng.uniform(0.5, 0.75) * limit_of(car))]
    return squeezed(*corners, (0.3, 0.0))


def _off_the_line(car: Car, rng: Generator) -> Array:
    """First too much, then as much as the wheels bear (he lets go when they spin)."""
    peak = car.motor_peak_torque_nm
    back = rng.uniform(0.5, 0.8) * peak
    return squeezed(
        (rng.uniform(0.1, 0.3), peak),
        (rng.uniform(0.5, 1.2), peak),
        (0.2, back),
        (rng.uniform(0.5, 1.5), back),
        (0.4, 0.0),
    )


def _slalom(car: Car, rng: Generator) -> Array:
    """Off at each cone and on between them, now and then with a touch of the brake."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        on, off = rng.uniform(0.3, 0.7), -rng.choice([0.0, 0.1, 0.3])
        corners += [(0.2, on), (rng.uniform(0.2, 0.4), on), (0.2, off), (rng.uniform(0.2, 0.4), off)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


def _round_the_circle(car: Car, rng: Generator) -> Array:
    """Round a wet circle: ever a little more, and off when it pushes."""
    clock, turn = clock_of(rng.uniform(3.0, 5.0)), rng.uniform(0.8, 1.4)
    return faded(car.motor_peak_torque_nm * (0.1 + rng.uniform(0.3, 0.6) * np.mod(clock / turn, 1.0) ** 2))


def _listening(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(1.0, 2.5) * 100.0))


def _slalom_gently(car: Car, rng: Generator) -> Array:
    return 0.2 * _slalom(car, rng)


def _back_to_the_start(car: Car, rng: Generator) -> Array:
    """A held speed, with a lift before each bend."""
    level = car.motor_peak_torque_nm * rng.uniform(0.03, 0.12)
    return squeezed((0.8, level), (rng.uniform(1.5, 3.5), level), (0.6, -0.3 * level), (1.0, 0.0))


_CONES = Piece(12.0, 99.0, _to_the_cones)
TRAINING = Style(
    rich=(
        _CONES,
        Piece(0.0, 21.0, _off_the_line),
        Piece(12.0, 99.0, _on_the_threshold, (0.15, 0.4)),
        Piece(7.0, 25.0, _slalom),
        Piece(7.0, 24.0, _round_the_circle),
        _CONES,
        Piece(8.0, 99.0, _listening),
    ),
    mild=(Piece(7.0, 24.0, _slalom_gently), Piece(0.0, 22.0, _back_to_the_start), COAST),
    drive_front=(0.5, 0.35, 0.6),
    brake_front=0.66,
)
