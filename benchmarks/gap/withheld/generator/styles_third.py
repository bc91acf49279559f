"""Drivers of the third family: one who drives by one pedal, and one who works off a proving ground's list."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import Piece, Style
from .kernel import COMMAND_STEP_S
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


# --- one pedal


def _press(car: Car, rng: Generator) -> Array:
    """Down fast and up slowly, down to where the motors brake."""
    peak = car.motor_peak_torque_nm
    up, back = peak * rng.uniform(0.4, 0.95), -peak * rng.uniform(0.1, 0.4)
    return squeezed(
        (rng.uniform(0.15, 0.4), up),
        (rng.uniform(0.5, 2.0), up * rng.uniform(0.7, 1.0)),
        (rng.uniform(0.8, 1.6), back),
        (rng.uniform(0.3, 1.0), back),
        (0.3, 0.0),
    )


def _off(car: Car, rng: Generator) -> Array:
    """Off the pedal: the motors brake a good deal."""
    level = -car.motor_peak_torque_nm * rng.uniform(0.25, 0.6)
    return squeezed(
        (rng.uniform(0.15, 0.4), level), (rng.uniform(0.8, 2.0), level), (rng.uniform(0.3, 0.6), 0.0)
    )


def _tread(car: Car, rng: Generator) -> Array:
    """Off the pedal, then hard on the brake (the driver lets go when the wheels slide)."""
    off, limit = -car.motor_peak_torque_nm * rng.uniform(0.2, 0.5), -rng.uniform(1.0, 1.15) * limit_of(car)
    return squeezed((0.3, off), (rng.uniform(0.2, 0.5), off), (rng.uniform(0.8, 1.8), limit), (0.2, 0.0))


def _kick(car: Car, rng: Generator) -> Array:
    """All that the motors have, after a moment of little (the driver lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (0.3, 0.2 * peak), (0.4, 0.2 * peak), (0.12, peak), (rng.uniform(0.8, 1.8), peak), (0.3, 0.0)
    )


def _play(car: Car, rng: Generator) -> Array:
    """Up and down about nothing, in swings of their own."""
    corners = []
    for _ in range(rng.integers(5, 9)):
        share = rng.uniform(0.15, 0.6) if rng.random() < 0.6 else -rng.uniform(0.1, 0.5)
        corners.append((rng.uniform(0.2, 0.7), car.motor_peak_torque_nm * share))
    return squeezed(*corners, (0.3, 0.0))


def _press_gently(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.08, 0.2)
    return squeezed(
        (rng.uniform(0.6, 1.5), level), (rng.uniform(1.0, 3.0), 0.7 * level), (rng.uniform(1.0, 2.0), 0.0)
    )


def _off_gently(car: Car, rng: Generator) -> Array:
    level = -car.motor_peak_torque_nm * rng.uniform(0.04, 0.12)
    return squeezed((rng.uniform(0.5, 1.0), level), (rng.uniform(1.0, 3.0), level), (0.5, 0.0))


def _trim(car: Car, rng: Generator) -> Array:
    """A held speed, in small corrections of either sign."""
    levels = car.motor_peak_torque_nm * rng.uniform(-0.02, 0.08, rng.integers(4, 8))
    return squeezed(*((rng.uniform(0.5, 1.5), level) for level in levels), (0.5, 0.0))


_TREAD = Piece(12.0, 99.0, _tread)
ONE_PEDAL = Style(
    rich=(
        Piece(4.0, 24.0, _press),
        _TREAD,
        Piece(0.0, 20.0, _kick),
        Piece(10.0, 99.0, _off),
        Piece(8.0, 26.0, _play),
        _TREAD,
        Piece(0.0, 22.0, _kick),
    ),
    mild=(
        Piece(7.0, 99.0, _trim),
        Piece(0.0, 22.0, _press_gently),
        Piece(9.0, 99.0, _off_gently),
    ),
    drive_front=(0.45, 0.55, 0.7),
    brake_front=0.64,
)


# --- proving


def _switch(car: Car, rng: Generator) -> Array:
    """Between two levels at moments of chance."""
    levels = car.motor_peak_torque_nm * np.array([rng.uniform(-0.35, 0.1), rng.uniform(0.4, 0.8)])
    corners = []
    for i in range(2 * rng.integers(3, 6)):
        corners += [(0.06, levels[i % 2]), (rng.choice([0.15, 0.3, 0.6]), levels[i % 2])]
    return squeezed(*corners, (0.2, 0.0))


def _swing(car: Car, rng: Generator) -> Array:
    """One frequency after another, of even size."""
    size, parts = car.motor_peak_torque_nm * rng.uniform(0.25, 0.5), []
    for hertz in rng.choice([0.5, 1.0, 2.0, 3.0, 5.0], 3, replace=False):
        clock = clock_of(max(2.0 / hertz, 1.2))
        parts.append(faded(size * (0.15 + np.sin(2.0 * np.pi * hertz * clock))))
    return np.concatenate(parts)


def _brake_in_steps(car: Car, rng: Generator) -> Array:
    """Ever harder from one plateau to the next (the driver lets go when the wheels slide)."""
    limit, steps = -rng.uniform(1.0, 1.15) * limit_of(car), int(rng.integers(3, 5))
    corners = []
    for n in range(1, steps + 1):
        corners += [(0.15, limit * n / steps), (rng.uniform(0.2, 0.4), limit * n / steps)]
    return squeezed(*corners, (0.2, 0.0), (0.3, 0.0))


def _stop_hard(car: Car, rng: Generator) -> Array:
    """At once as hard as a dry road bears, until the wheels slide."""
    limit = -rng.uniform(1.0, 1.15) * limit_of(car)
    return squeezed((rng.uniform(0.15, 0.3), limit), (rng.uniform(0.4, 0.9), limit), (0.15, 0.0), (0.3, 0.0))


def _full_ramp(car: Car, rng: Generator) -> Array:
    """Evenly up to all that the motors have (the driver lets go when the wheels spin)."""
    peak, clock = car.motor_peak_torque_nm, clock_of(rng.uniform(1.5, 3.0))
    return np.concatenate(
        [peak * clock / clock[-1], np.full(50, peak), np.linspace(peak, 0.0, 25), np.zeros(20)]
    )


def _roll_out(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(2.5, 4.5) / COMMAND_STEP_S))


def _hold(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.02, 0.07)
    return squeezed((0.8, level), (rng.uniform(3.0, 6.0), level), (0.8, 0.0))


def _steps_gently(car: Car, rng: Generator) -> Array:
    height, tread = car.motor_peak_torque_nm * rng.uniform(0.04, 0.08), rng.uniform(0.8, 1.5)
    return squeezed(*(corner for n in (1, 2, 3, 1, 0) for corner in ((0.5, n * height), (tread, n * height))))


_IN_STEPS = Piece(12.0, 99.0, _brake_in_steps, (0.1, 0.5))
PROVING = Style(
    rich=(
        Piece(0.0, 22.0, _full_ramp, (0.1, 0.5)),
        _IN_STEPS,
        Piece(8.0, 24.0, _switch),
        Piece(8.0, 26.0, _swing),
        Piece(13.0, 99.0, _stop_hard),
        Piece(8.0, 99.0, _roll_out),
        _IN_STEPS,
    ),
    mild=(
        Piece(7.0, 99.0, _hold),
        Piece(0.0, 22.0, _steps_gently),
        Piece(8.0, 99.0, _roll_out),
    ),
    drive_front=(0.5, 0.35, 0.65),
    brake_front=0.6,
)
