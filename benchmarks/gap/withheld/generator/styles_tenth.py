"""Driver of the tenth family: one who is late for work, from light to light and on the ring road between."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


def _turned_green(car: Car, rng: Generator) -> Array:
    """First off the light, with all that the motors have (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (rng.uniform(0.15, 0.3), peak),
        (rng.uniform(0.8, 1.8), peak),
        (0.4, 0.2 * peak),
        (rng.uniform(0.3, 0.8), 0.2 * peak),
        (0.2, 0.0),
    )


def _turning_red(car: Car, rng: Generator) -> Array:
    """On the power to make it, then all of the brake as he does not (he lets go when the wheels slide)."""
    up, limit = car.motor_peak_torque_nm * rng.uniform(0.4, 0.8), -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (0.2, up),
        (rng.uniform(0.3, 0.6), up),
        (0.12, 0.0),
        (rng.uniform(0.12, 0.25), limit),
        (rng.uniform(0.5, 1.1), limit),
        (0.2, 0.0),
        (0.3, 0.0),
    )


def _brake_lights(car: Car, rng: Generator) -> Array:
    """Those ahead brake one after the other: ever a little harder, with a breath between."""
    corners, level = [], -rng.uniform(0.15, 0.25) * limit_of(car)
    for _ in range(rng.integers(2, 4)):
        corners += [(0.2, level), (rng.uniform(0.2, 0.5), level), (0.2, 0.3 * level)]
        corners += [(rng.uniform(0.1, 0.4), 0.3 * level)]
        level *= 1.5
    return squeezed(*corners, (0.3, 0.0))


def _slip_road(car: Car, rng: Generator) -> Array:
    """More and more as the lane ends, and off at once when he is in."""
    peak, clock = car.motor_peak_torque_nm, clock_of(rng.uniform(1.5, 3.0))
    return np.concatenate([peak * rng.uniform(0.6, 0.95) * np.sqrt(clock / clock[-1]), np.zeros(20)])


def _gap_to_gap(car: Car, rng: Generator) -> Array:
    """From lane to lane: a push into each gap, and back to those ahead."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        push, back = rng.uniform(0.4, 0.9), -rng.uniform(0.0, 0.35)
        corners += [(0.12, push), (rng.uniform(0.2, 0.5), push), (rng.uniform(0.2, 0.5), back)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


def _rocking(car: Car, rng: Generator) -> Array:
    """His foot goes to and fro with the song on the radio, on every beat a little."""
    clock, beats = clock_of(rng.uniform(3.0, 5.0)), rng.uniform(1.4, 2.3)
    wave = np.abs(np.sin(np.pi * beats * clock)) ** 3 - 0.25
    return faded(car.motor_peak_torque_nm * (0.08 + rng.uniform(0.3, 0.7) * wave))


def _rolls_up(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(1.0, 2.5) * 100.0))


def _in_the_queue(car: Car, rng: Generator) -> Array:
    """A little on, and off again, and a touch of the brake."""
    up, down = car.motor_peak_torque_nm * np.array([rng.uniform(0.08, 0.2), -rng.uniform(0.02, 0.07)])
    return squeezed(
        (0.7, up), (rng.uniform(1.0, 2.5), up), (0.8, down), (rng.uniform(0.5, 1.5), down), (0.5, 0.0)
    )


def _rocking_gently(car: Car, rng: Generator) -> Array:
    return 0.3 * _rocking(car, rng)


_RED = Piece(12.0, 99.0, _turning_red)
COMMUTER = Style(
    rich=(
        Piece(0.0, 21.0, _turned_green),
        _RED,
        Piece(0.0, 22.0, _slip_road),
        Piece(8.0, 25.0, _gap_to_gap),
        Piece(11.0, 99.0, _brake_lights),
        Piece(8.0, 25.0, _rocking),
        _RED,
        Piece(8.0, 99.0, _rolls_up),
    ),
    mild=(Piece(7.0, 24.0, _rocking_gently), Piece(0.0, 22.0, _in_the_queue), COAST),
    drive_front=(0.55, 0.5, 0.7),
    brake_front=0.67,
)
