"""Drivers of the fourth family: one whose car has assistants, and one in a hurry on a winding road."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


# --- assisted


def _anti_lock(car: Car, rng: Generator) -> Array:
    """A brake that is let go and applied again, some times a second, by a controller that looks for the limit."""
    limit, corners = -limit_of(car), []
    level = rng.uniform(0.8, 1.1)
    corners.append((rng.uniform(0.2, 0.4), level * limit))
    for _ in range(rng.integers(4, 8)):
        low = level * rng.uniform(0.35, 0.6)
        corners += [(0.06, low * limit), (rng.uniform(0.03, 0.08), low * limit)]
        corners.append((rng.uniform(0.1, 0.2), level * rng.uniform(0.9, 1.1) * limit))
    return squeezed(*corners, (0.2, 0.0), (0.2, 0.0))


def _traction(car: Car, rng: Generator) -> Array:
    """Full torque that a controller takes back when the wheels spin (in the end he lets go)."""
    peak, corners = car.motor_peak_torque_nm, []
    for _ in range(rng.integers(2, 5)):
        low = peak * rng.uniform(0.4, 0.7)
        corners += [(0.1, peak), (rng.uniform(0.3, 0.7), peak), (0.06, low), (rng.uniform(0.05, 0.15), low)]
    return squeezed(*corners, (0.3, 0.0))


def _follow(car: Car, rng: Generator) -> Array:
    """Behind another car: speed up, slow down, each as much as is left to catch up."""
    clock = clock_of(rng.uniform(4.0, 7.0))
    decay = np.exp(-np.mod(clock, rng.uniform(1.2, 2.2)) / rng.uniform(0.6, 1.2))
    sign = np.sign(np.sin(2.0 * np.pi * clock / rng.uniform(2.0, 3.5) + 0.3))
    level = np.where(sign > 0.0, rng.uniform(0.3, 0.7), -rng.uniform(0.2, 0.5)) * decay
    smooth = np.convolve(np.pad(level, 10, mode="edge"), np.full(21, 1.0 / 21.0), mode="valid")
    return faded(car.motor_peak_torque_nm * smooth)


def _emergency(car: Car, rng: Generator) -> Array:
    """A warning jerk, half a brake, then all of it (the driver lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.15) * limit_of(car)
    return squeezed(
        (0.1, 0.2 * limit),
        (0.15, 0.0),
        (0.2, 0.4 * limit),
        (rng.uniform(0.4, 0.8), 0.4 * limit),
        (0.2, limit),
        (rng.uniform(0.3, 0.7), limit),
        (0.2, 0.0),
        (0.2, 0.0),
    )


def _ramp_up(car: Car, rng: Generator) -> Array:
    """A speed controller's: straight up, held, straight down."""
    level = car.motor_peak_torque_nm * rng.uniform(0.35, 0.75)
    clock = clock_of(rng.uniform(2.5, 4.5))
    return level * np.clip(np.minimum(clock, clock[-1] - clock) / rng.uniform(0.5, 1.0), 0.0, 1.0)


def _follow_gently(car: Car, rng: Generator) -> Array:
    return 0.2 * _follow(car, rng)


def _controlled(car: Car, rng: Generator) -> Array:
    """A held speed: an integrator that hunts a little."""
    clock = clock_of(rng.uniform(4.0, 7.0))
    hunt = np.sin(2.0 * np.pi * clock / rng.uniform(1.5, 3.0)) * np.exp(-clock / rng.uniform(2.0, 5.0))
    return faded(car.motor_peak_torque_nm * (rng.uniform(0.02, 0.07) + rng.uniform(0.01, 0.05) * hunt))


ASSISTED = Style(
    rich=(
        Piece(0.0, 24.0, _ramp_up),
        Piece(12.0, 99.0, _anti_lock, (0.3, 0.6)),
        Piece(0.0, 22.0, _traction, (0.2, 0.5)),
        Piece(8.0, 26.0, _follow),
        Piece(12.0, 99.0, _emergency),
        COAST,
        Piece(12.0, 99.0, _anti_lock, (0.3, 0.6)),
    ),
    mild=(
        Piece(7.0, 99.0, _controlled),
        Piece(0.0, 24.0, lambda car, rng: 0.35 * _ramp_up(car, rng)),
        Piece(9.0, 26.0, _follow_gently),
        COAST,
    ),
    drive_front=(0.5, 0.4, 0.75),
    brake_front=0.66,
)


# --- hurried


def _into_a_bend(car: Car, rng: Generator) -> Array:
    """Hard on the brake late, and off it slowly (he lets go when the wheels slide)."""
    level = -rng.uniform(0.6, 1.15) * limit_of(car)
    return squeezed(
        (rng.uniform(0.12, 0.25), level),
        (rng.uniform(0.2, 0.6), 0.95 * level),
        (rng.uniform(0.8, 1.6), 0.0),
        (0.1, 0.0),
    )


def _out_of_a_bend(car: Car, rng: Generator) -> Array:
    """Ever more, then all that there is, until the next bend."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (0.3, 0.2 * peak),
        (rng.uniform(0.8, 1.6), 0.7 * peak),
        (0.3, peak),
        (rng.uniform(0.5, 1.8), peak),
        (0.12, 0.0),
    )


def _floored(car: Car, rng: Generator) -> Array:
    """All at once (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed((0.08, peak), (rng.uniform(0.6, 1.6), peak), (0.15, 0.0), (0.2, 0.0))


def _lifts(car: Car, rng: Generator) -> Array:
    """On the power, with short lifts and dabs of the brake between."""
    corners = []
    for _ in range(rng.integers(2, 5)):
        high, low = rng.uniform(0.4, 0.8), rng.choice([0.0, -0.1, -0.4])
        corners += [(0.15, high), (rng.uniform(0.4, 0.9), high), (0.1, low), (rng.uniform(0.15, 0.4), low)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.2, 0.0))


def _balance(car: Car, rng: Generator) -> Array:
    """Round a long bend: now a little more, now a little less."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    hertz, mean, size = rng.uniform(0.4, 1.2), rng.uniform(0.05, 0.2), rng.uniform(0.15, 0.4)
    wave = np.sin(2.0 * np.pi * hertz * clock)
    return faded(car.motor_peak_torque_nm * (mean + size * np.sign(wave) * np.abs(wave) ** 0.6))


def _hurry_gently(car: Car, rng: Generator) -> Array:
    up, down = rng.uniform(0.1, 0.25), -rng.uniform(0.03, 0.12)
    parts = (rng.uniform(0.5, 1.0), up), (rng.uniform(0.8, 2.5), up), (rng.uniform(0.5, 1.0), down)
    return car.motor_peak_torque_nm * squeezed(*parts, (rng.uniform(0.5, 1.5), down), (0.5, 0.0))


def _balance_gently(car: Car, rng: Generator) -> Array:
    return 0.25 * _balance(car, rng)


_BEND = Piece(12.0, 99.0, _into_a_bend)
HURRIED = Style(
    rich=(
        Piece(0.0, 23.0, _out_of_a_bend),
        _BEND,
        Piece(0.0, 20.0, _floored),
        Piece(8.0, 25.0, _lifts),
        _BEND,
        Piece(8.0, 25.0, _balance),
        Piece(8.0, 99.0, lambda car, rng: np.zeros(round(rng.uniform(1.0, 2.0) * 100.0))),
        _BEND,
    ),
    mild=(Piece(0.0, 23.0, _hurry_gently), Piece(7.0, 26.0, _balance_gently), COAST),
    drive_front=(0.3, 0.45, 0.6),
    brake_front=0.7,
)
