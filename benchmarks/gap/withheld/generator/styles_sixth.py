"""Drivers of the sixth family: one who delivers parcels, one who saves power, and one with a foot on each pedal."""

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
    return np.zeros(round(rng.uniform(1.0, 2.5) * 100.0))


# --- delivery


def _between_doors(car: Car, rng: Generator) -> Array:
    """Up at once, a moment of rolling, and hard on the brake for the next door."""
    up, down = car.motor_peak_torque_nm * rng.uniform(0.6, 1.0), -limit_of(car) * rng.uniform(0.4, 0.8)
    return squeezed(
        (0.2, up),
        (rng.uniform(0.8, 1.8), up),
        (0.15, 0.0),
        (rng.uniform(0.2, 0.6), 0.0),
        (0.2, down),
        (rng.uniform(0.3, 0.8), down),
        (0.2, 0.0),
    )


def _number_seen_late(car: Car, rng: Generator) -> Array:
    """All of the brake at once, until he is there (he lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed((rng.uniform(0.12, 0.25), limit), (rng.uniform(0.4, 0.9), limit), (0.15, 0.0), (0.4, 0.0))


def _off_again(car: Car, rng: Generator) -> Array:
    """The pedal on the floor, off and on again (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    again = rng.uniform(0.5, 1.2)
    return squeezed((0.1, peak), (0.5, peak), (0.1, 0.0), (0.25, 0.0), (0.1, peak), (again, peak), (0.2, 0.0))


def _kerb_crawl(car: Car, rng: Generator) -> Array:
    """Little pushes while he reads the numbers."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        level = car.motor_peak_torque_nm * rng.uniform(0.25, 0.6)
        corners += [(0.15, level), (rng.uniform(0.1, 0.4), level), (0.2, 0.0), (rng.uniform(0.2, 0.6), 0.0)]
    return squeezed(*corners)


def _regenerate(car: Car, rng: Generator) -> Array:
    """Off the pedal of a van that brakes by its motors."""
    level = -car.motor_peak_torque_nm * rng.uniform(0.15, 0.35)
    return squeezed((0.25, level), (rng.uniform(0.8, 1.6), level), (0.25, 0.0))


def _round_gently(car: Car, rng: Generator) -> Array:
    up, down = car.motor_peak_torque_nm * np.array([rng.uniform(0.1, 0.2), -rng.uniform(0.03, 0.08)])
    return squeezed(
        (0.8, up), (rng.uniform(1.0, 2.0), up), (1.0, down), (rng.uniform(0.8, 1.8), down), (0.6, 0.0)
    )


_LATE = Piece(12.0, 99.0, _number_seen_late)
DELIVERY = Style(
    rich=(
        Piece(5.0, 20.0, _between_doors),
        _LATE,
        Piece(0.0, 20.0, _off_again),
        Piece(6.0, 24.0, _kerb_crawl),
        Piece(10.0, 99.0, _regenerate),
        _LATE,
        Piece(5.0, 20.0, _between_doors),
    ),
    mild=(Piece(7.0, 22.0, _round_gently), COAST, Piece(0.0, 18.0, _round_gently)),
    drive_front=(0.7, 0.5, 0.85),
    brake_front=0.63,
)


# --- saving


def _pulse(car: Car, rng: Generator) -> Array:
    """A pulse of what is best for the motors, then rolling."""
    level = car.motor_peak_torque_nm * rng.uniform(0.45, 0.75)
    corners = (rng.uniform(0.3, 0.6), level), (rng.uniform(1.0, 2.2), level), (rng.uniform(0.3, 0.6), 0.0)
    return squeezed(*corners, (rng.uniform(1.0, 2.5), 0.0))


def _harvest(car: Car, rng: Generator) -> Array:
    """Braking by the motors, less the slower he is."""
    level = -car.motor_peak_torque_nm * rng.uniform(0.3, 0.7)
    return squeezed((0.4, level), (rng.uniform(1.0, 2.0), 0.5 * level), (rng.uniform(0.5, 1.0), 0.0))


def _merge(car: Car, rng: Generator) -> Array:
    """All that there is, to join those who do not save (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (rng.uniform(0.3, 0.8), peak), (rng.uniform(1.0, 1.8), peak), (0.6, 0.1 * peak), (0.3, 0.0)
    )


def _cut_in(car: Car, rng: Generator) -> Array:
    """Another cuts in: from the motors' brake to all of it (he lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.15) * limit_of(car)
    return squeezed(
        (0.3, 0.2 * limit),
        (rng.uniform(0.2, 0.5), 0.2 * limit),
        (rng.uniform(0.4, 1.0), limit),
        (rng.uniform(0.3, 0.6), limit),
        (0.25, 0.0),
        (0.3, 0.0),
    )


def _feather(car: Car, rng: Generator) -> Array:
    """A pedal that is let in and out in waves, faster and faster."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    phase = 2.0 * np.pi * (0.4 * clock + rng.uniform(0.3, 0.8) * clock**2 / 2.0)
    return faded(car.motor_peak_torque_nm * (0.08 + rng.uniform(0.2, 0.5) * np.sin(phase)))


def _pulse_gently(car: Car, rng: Generator) -> Array:
    return 0.3 * _pulse(car, rng)


def _harvest_gently(car: Car, rng: Generator) -> Array:
    return 0.15 * _harvest(car, rng)


_CUT_IN = Piece(12.0, 99.0, _cut_in)
SAVING = Style(
    rich=(
        Piece(4.0, 23.0, _pulse),
        _CUT_IN,
        Piece(0.0, 21.0, _merge),
        Piece(10.0, 99.0, _harvest),
        Piece(8.0, 25.0, _feather),
        _CUT_IN,
        Piece(8.0, 99.0, _nothing),
    ),
    mild=(Piece(0.0, 23.0, _pulse_gently), Piece(9.0, 99.0, _harvest_gently), COAST),
    drive_front=(0.3, 0.4, 0.5),
    brake_front=0.57,
)


# --- two feet


def _both(car: Car, rng: Generator) -> Array:
    """Power, the other foot on the brake as well, then each alone."""
    up, down = car.motor_peak_torque_nm * rng.uniform(0.4, 0.8), -limit_of(car) * rng.uniform(0.2, 0.6)
    return squeezed(
        (0.3, up),
        (rng.uniform(0.4, 1.0), up),
        (0.1, up + down),
        (rng.uniform(0.2, 0.5), up + down),
        (0.1, down),
        (rng.uniform(0.2, 0.6), down),
        (0.15, 0.0),
    )


def _swap(car: Car, rng: Generator) -> Array:
    """From one foot to the other with nothing between, and back."""
    up, down = car.motor_peak_torque_nm * rng.uniform(0.4, 0.9), -limit_of(car) * rng.uniform(0.3, 0.7)
    corners = []
    for _ in range(rng.integers(2, 4)):
        corners += [(0.1, up), (rng.uniform(0.3, 0.7), up), (0.12, down), (rng.uniform(0.15, 0.4), down)]
    return squeezed(*corners, (0.2, 0.0))


def _left_foot(car: Car, rng: Generator) -> Array:
    """A foot that is used to a clutch: too hard, less, and hard again (he lets go when the wheels slide)."""
    limit = -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (rng.uniform(0.1, 0.2), 0.9 * limit),
        (0.12, 0.5 * limit),
        (rng.uniform(0.2, 0.5), 0.5 * limit),
        (rng.uniform(0.2, 0.5), limit),
        (rng.uniform(0.3, 0.6), limit),
        (0.2, 0.0),
        (0.2, 0.0),
    )


def _against_the_brake(car: Car, rng: Generator) -> Array:
    """Full power against a brake that is let go slowly (he lets go when the wheels spin)."""
    peak = car.motor_peak_torque_nm
    return squeezed(
        (0.3, 0.3 * peak), (rng.uniform(0.5, 1.0), peak), (rng.uniform(0.6, 1.4), peak), (0.2, 0.0)
    )


def _riding(car: Car, rng: Generator) -> Array:
    """Power that goes up and down on a brake that rests on."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    wave = np.abs(np.sin(np.pi * clock * rng.uniform(0.5, 1.5)))
    return faded(car.motor_peak_torque_nm * (rng.uniform(0.5, 0.9) * wave - rng.uniform(0.1, 0.3)))


def _riding_gently(car: Car, rng: Generator) -> Array:
    return 0.25 * _riding(car, rng)


_LEFT = Piece(12.0, 99.0, _left_foot)
TWO_FEET = Style(
    rich=(
        Piece(6.0, 24.0, _both),
        _LEFT,
        Piece(0.0, 20.0, _against_the_brake),
        Piece(9.0, 24.0, _swap),
        Piece(8.0, 25.0, _riding),
        _LEFT,
        Piece(7.0, 99.0, _nothing),
    ),
    mild=(Piece(7.0, 24.0, _riding_gently), COAST, Piece(0.0, 22.0, lambda car, rng: 0.2 * _both(car, rng))),
    drive_front=(0.5, 0.6, 0.45),
    brake_front=0.69,
)
