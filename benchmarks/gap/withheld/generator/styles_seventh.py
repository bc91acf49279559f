"""Driver of the seventh family: one who overtakes on a country road."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


def _behind(car: Car, rng: Generator) -> Array:
    """Too close: little pushes, and each time a little brake."""
    corners = []
    for _ in range(rng.integers(2, 5)):
        up, down = rng.uniform(0.2, 0.6), -rng.uniform(0.1, 0.4)
        corners += [(0.3, up), (rng.uniform(0.3, 0.8), up), (0.25, down), (rng.uniform(0.15, 0.5), down)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


def _past(car: Car, rng: Generator) -> Array:
    """A look, all that the motors have, and a lift when he is past (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    look, rise = rng.uniform(0.3, 0.6), rng.uniform(0.12, 0.3)
    return squeezed(
        (0.3, 0.35 * peak), (look, 0.35 * peak), (rise, peak), (rng.uniform(1.0, 2.2), peak), (0.4, 0.0)
    )


def _given_up(car: Car, rng: Generator) -> Array:
    """Out, something comes: all of the brake, and back in (he lets go when the wheels slide)."""
    peak, limit = car.motor_peak_torque_nm, -rng.uniform(1.0, 1.15) * limit_of(car)
    return squeezed(
        (0.2, 0.8 * peak),
        (rng.uniform(0.3, 0.7), 0.8 * peak),
        (0.2, 0.0),
        (rng.uniform(0.15, 0.3), limit),
        (rng.uniform(0.4, 0.9), limit),
        (0.3, 0.2 * limit),
        (0.3, 0.0),
    )


def _village(car: Car, rng: Generator) -> Array:
    """Down from what the country road allows, harder towards the sign."""
    clock, level = clock_of(rng.uniform(1.5, 3.0)), rng.uniform(0.35, 0.75) * limit_of(car)
    return np.concatenate([-level * (clock / clock[-1]) ** 1.5, np.linspace(-level, 0.0, 25)])


def _winding(car: Car, rng: Generator) -> Array:
    """Through bends: off before each, on again from its middle."""
    clock = clock_of(rng.uniform(3.5, 6.0))
    phase = 2.0 * np.pi * clock / rng.uniform(1.4, 2.6)
    wave = np.sin(phase) + 0.4 * np.sin(2.0 * phase + rng.uniform(0.0, 2.0 * np.pi))
    return faded(car.motor_peak_torque_nm * (0.1 + rng.uniform(0.2, 0.4) * wave))


def _nothing(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(1.0, 2.5) * 100.0))


def _behind_gently(car: Car, rng: Generator) -> Array:
    return 0.2 * _behind(car, rng)


def _past_gently(car: Car, rng: Generator) -> Array:
    return 0.2 * _past(car, rng)


_GIVEN_UP = Piece(11.0, 99.0, _given_up)
OVERTAKING = Style(
    rich=(
        Piece(7.0, 24.0, _behind),
        _GIVEN_UP,
        Piece(0.0, 21.0, _past),
        Piece(12.0, 99.0, _village),
        Piece(8.0, 25.0, _winding),
        _GIVEN_UP,
        Piece(8.0, 99.0, _nothing),
    ),
    mild=(Piece(7.0, 24.0, _behind_gently), Piece(0.0, 22.0, _past_gently), COAST),
    drive_front=(0.4, 0.5, 0.65),
    brake_front=0.65,
)
