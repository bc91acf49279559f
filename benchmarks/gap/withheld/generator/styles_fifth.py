"""Drivers of the fifth family: a robot at the pedals, a learner, and one who feels for the grip of a winter road."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .styles import clock_of, faded, limit_of, squeezed

Array = NDArray[np.floating[Any]]


def _nothing(car: Car, rng: Generator) -> Array:
    return np.zeros(round(rng.uniform(1.5, 3.0) * 100.0))


# --- robot


def _many_tones(car: Car, rng: Generator) -> Array:
    """Twelve tones of even size, their phases after Schroeder, so that no moment is much louder than another."""
    clock, tones = clock_of(4.0), np.arange(1, 13)
    phases = -np.pi * tones * (tones - 1) / tones.size + rng.uniform(0.0, 2.0 * np.pi)
    wave = np.sin(2.0 * np.pi * 0.5 * tones * clock[:, None] + phases).sum(axis=1)
    share = rng.uniform(0.35, 0.7) * wave / np.abs(wave).max()
    return faded(car.motor_peak_torque_nm * (0.05 + share))


def _twice(car: Car, rng: Generator) -> Array:
    """A trapezoid up and one down, then the same again."""
    up, down = car.motor_peak_torque_nm * rng.uniform(0.4, 0.95), -limit_of(car) * rng.uniform(0.25, 0.7)
    rise, hold = rng.uniform(0.1, 0.4), rng.uniform(0.4, 0.8)
    once = (rise, up), (hold, up), (rise, 0.0), (0.3, 0.0), (rise, down), (0.6 * hold, down), (rise, 0.0)
    return squeezed(*once, (0.3, 0.0), *once)


def _slowly_to_limit(car: Car, rng: Generator) -> Array:
    """A brake that goes down at one rate, and is held there (it lets go when the wheels slide)."""
    limit, clock = -rng.uniform(1.05, 1.2) * limit_of(car), clock_of(rng.uniform(1.0, 2.5))
    return np.concatenate(
        [limit * clock / clock[-1], np.full(40, limit), np.linspace(limit, 0.0, 12), np.zeros(30)]
    )


def _at_once(car: Car, rng: Generator) -> Array:
    """All that the motors have, within the actuator's time (it lets go when the wheels spin)."""
    peak, hold = car.motor_peak_torque_nm, rng.uniform(0.8, 2.0)
    return np.concatenate([[0.5 * peak], np.full(round(100.0 * hold), peak), [0.5 * peak], np.zeros(40)])


def _impulses(car: Car, rng: Generator) -> Array:
    """Short ones of one length, each a little harder, to and fro."""
    length, wait, peak = rng.uniform(0.1, 0.2), rng.uniform(0.3, 0.6), car.motor_peak_torque_nm
    corners = []
    for share in np.linspace(0.3, 0.95, 4) * rng.choice([1.0, -0.8], 4):
        corners += [(0.04, share * peak), (length, share * peak), (0.04, 0.0), (wait, 0.0)]
    return squeezed(*corners)


def _small_tones(car: Car, rng: Generator) -> Array:
    """The lower tones alone, a tenth as large, about what holds a speed."""
    clock, tones = clock_of(rng.uniform(4.0, 6.0)), np.arange(1, 5)
    wave = np.sin(2.0 * np.pi * 0.25 * tones * clock[:, None] - 0.9 * tones**2).sum(axis=1)
    return faded(car.motor_peak_torque_nm * (0.04 + 0.06 * wave / np.abs(wave).max()))


def _small_trapezoid(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.choice([0.1, 0.15, 0.2])
    return squeezed((0.6, level), (rng.uniform(1.5, 3.5), level), (0.6, 0.0), (1.0, 0.0))


_TO_LIMIT = Piece(12.0, 99.0, _slowly_to_limit, (0.1, 0.4))
ROBOT = Style(
    rich=(
        Piece(8.0, 24.0, _many_tones),
        _TO_LIMIT,
        Piece(0.0, 21.0, _at_once, (0.1, 0.5)),
        Piece(10.0, 24.0, _twice),
        Piece(7.0, 99.0, _nothing),
        _TO_LIMIT,
        Piece(8.0, 25.0, _impulses),
    ),
    mild=(Piece(7.0, 26.0, _small_tones), Piece(0.0, 22.0, _small_trapezoid), COAST),
    drive_front=(0.5, 0.2, 0.8),
    brake_front=0.65,
)


# --- learner


def _bucking(car: Car, rng: Generator) -> Array:
    """Too much, too little, too much: his foot goes with the car's jerks."""
    clock, hertz = clock_of(rng.uniform(2.5, 4.5)), rng.uniform(1.2, 2.5)
    mean, size = rng.uniform(0.15, 0.3), rng.uniform(0.3, 0.6)
    decay = np.exp(-clock / rng.uniform(1.5, 4.0))
    return faded(car.motor_peak_torque_nm * (mean + size * decay * np.sin(2.0 * np.pi * hertz * clock)))


def _startled(car: Car, rng: Generator) -> Array:
    """On the brake with all his weight, off it at once, then half on (he lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (rng.uniform(0.1, 0.2), limit),
        (rng.uniform(0.2, 0.6), limit),
        (0.1, 0.0),
        (rng.uniform(0.2, 0.5), 0.0),
        (0.2, 0.45 * limit),
        (rng.uniform(0.4, 0.9), 0.35 * limit),
        (0.3, 0.0),
    )


def _stamped(car: Car, rng: Generator) -> Array:
    """The wrong pedal's whole way, until the wheels spin or he is startled."""
    peak = car.motor_peak_torque_nm
    return squeezed((0.15, peak), (rng.uniform(0.6, 1.4), peak), (0.1, -0.2 * peak), (0.4, 0.0))


def _unsteady(car: Car, rng: Generator) -> Array:
    """Up in one go and back in little ones."""
    level, corners = car.motor_peak_torque_nm * rng.uniform(0.5, 0.9), []
    for part in np.linspace(1.0, 0.1, int(rng.integers(4, 7))):
        corners += [(0.15, part * level), (rng.uniform(0.2, 0.6), part * level * rng.uniform(0.8, 1.0))]
    return squeezed(*corners, (0.3, 0.0))


def _late(car: Car, rng: Generator) -> Array:
    """Ever harder as the place where he should stop comes near (he lets go when the wheels slide)."""
    limit, clock = -rng.uniform(0.9, 1.15) * limit_of(car), clock_of(rng.uniform(1.5, 2.5))
    return np.concatenate([limit * np.expm1(2.5 * clock / clock[-1]) / np.expm1(2.5), np.zeros(30)])


def _timid(car: Car, rng: Generator) -> Array:
    """A little, a little less, a little more."""
    levels = car.motor_peak_torque_nm * rng.uniform(0.02, 0.18, rng.integers(4, 7))
    return squeezed(*((rng.uniform(0.3, 1.2), level) for level in levels), (0.5, 0.0))


def _easing(car: Car, rng: Generator) -> Array:
    """On the brake in two goes, with little."""
    low = -car.motor_peak_torque_nm * rng.uniform(0.04, 0.1)
    return squeezed((0.5, low), (rng.uniform(0.5, 1.5), low), (0.3, 0.0), (0.6, 0.7 * low), (1.0, 0.0))


LEARNER = Style(
    rich=(
        Piece(5.0, 24.0, _bucking),
        Piece(12.0, 99.0, _startled),
        Piece(0.0, 20.0, _stamped),
        Piece(0.0, 23.0, _unsteady),
        Piece(12.0, 99.0, _late),
        Piece(8.0, 99.0, _nothing),
        Piece(12.0, 99.0, _startled),
    ),
    mild=(Piece(0.0, 22.0, _timid), Piece(10.0, 99.0, _easing), COAST, Piece(7.0, 24.0, _timid)),
    drive_front=(0.6, 0.7),
    brake_front=0.72,
)


# --- winter


def _feeling(car: Car, rng: Generator) -> Array:
    """Dabs of the brake from rolling, each harder, to feel what the road bears (he lets go when the wheels slide)."""
    corners = []
    for share in np.linspace(0.2, rng.uniform(0.9, 1.15), int(rng.integers(4, 6))):
        level = -share * limit_of(car)
        corners += [(0.12, level), (rng.uniform(0.12, 0.3), level), (0.12, 0.0), (rng.uniform(0.2, 0.5), 0.0)]
    return squeezed(*corners)


def _pull_away(car: Car, rng: Generator) -> Array:
    """Up until the wheels spin, and held there (he lets go late)."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (rng.uniform(1.0, 2.0), 0.9 * peak), (0.2, peak), (rng.uniform(0.4, 1.0), peak), (0.4, 0.0)
    )


def _rocking(car: Car, rng: Generator) -> Array:
    """Power and drag of the motors in turn, to wake the car."""
    peak, corners = car.motor_peak_torque_nm, []
    for _ in range(rng.integers(3, 5)):
        corners += [(0.25, peak * rng.uniform(0.4, 0.85)), (rng.uniform(0.1, 0.4), 0.5 * peak)]
        corners += [(0.25, -peak * rng.uniform(0.15, 0.4)), (rng.uniform(0.1, 0.3), -0.15 * peak)]
    return squeezed(*corners, (0.3, 0.0))


def _with_care(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.25, 0.5)
    return squeezed(
        (rng.uniform(0.8, 1.5), level), (rng.uniform(1.0, 2.5), level), (rng.uniform(0.5, 1.0), 0.0)
    )


def _then_all(car: Car, rng: Generator) -> Array:
    """A little, and as the road bears that, all of it (he lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (0.3, 0.25 * limit),
        (rng.uniform(0.3, 0.7), 0.25 * limit),
        (rng.uniform(0.3, 0.6), limit),
        (rng.uniform(0.3, 0.8), limit),
        (0.2, 0.0),
        (0.3, 0.0),
    )


def _soft_foot(car: Car, rng: Generator) -> Array:
    return 0.35 * _with_care(car, rng)


def _drag(car: Car, rng: Generator) -> Array:
    """The motors' drag, let in and out softly."""
    level = -car.motor_peak_torque_nm * rng.uniform(0.03, 0.08)
    return squeezed((1.0, level), (rng.uniform(1.5, 3.5), level), (1.0, 0.0))


_FEELING = Piece(12.0, 99.0, _feeling)
_ALL = Piece(12.0, 99.0, _then_all, (0.1, 0.4))
WINTER = Style(
    rich=(
        Piece(0.0, 24.0, _with_care),
        _FEELING,
        Piece(0.0, 20.0, _pull_away, (0.2, 0.5)),
        Piece(8.0, 25.0, _rocking),
        _ALL,
        Piece(8.0, 99.0, _nothing),
        _ALL,
    ),
    mild=(Piece(0.0, 23.0, _soft_foot), Piece(10.0, 99.0, _drag), Piece(7.0, 99.0, _nothing)),
    drive_front=(0.35, 0.5, 0.45),
    brake_front=0.58,
)
