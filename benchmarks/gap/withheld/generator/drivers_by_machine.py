"""Drives that machines and lists make: controllers that help, a robot, a proving ground's list, cruise control."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .pedals import brake, clock_of, faded, limit_of, power, pressed, rolling, squeezed

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


def _ramp_up(car: Car, rng: Generator) -> Array:
    """A speed controller's: straight up, held, straight down."""
    level = car.motor_peak_torque_nm * rng.uniform(0.35, 0.75)
    clock = clock_of(rng.uniform(2.5, 4.5))
    return level * np.clip(np.minimum(clock, clock[-1] - clock) / rng.uniform(0.5, 1.0), 0.0, 1.0)


ASSISTED = Style(
    rich=(
        Piece(0.0, 24.0, _ramp_up),
        Piece(12.0, 99.0, _anti_lock, (0.3, 0.6)),
        Piece(0.0, 22.0, _traction, (0.2, 0.5)),
        Piece(8.0, 26.0, _follow),
        # A warning jerk, half a brake, then all of it (the driver lets go when the wheels slide).
        Piece(
            12.0,
            99.0,
            pressed(
                brake,
                (1.0, 1.15),
                *((0.1, 0.2), (0.15, 0.0), (0.2, 0.4), ((0.4, 0.8), 0.4)),
                *((0.2, 1.0), ((0.3, 0.7), 1.0), (0.2, 0.0), (0.2, 0.0)),
            ),
        ),
        COAST,
        Piece(12.0, 99.0, _anti_lock, (0.3, 0.6)),
    ),
    drive_front=(0.5, 0.4, 0.75),
    brake_front=0.66,
)

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
        Piece(7.0, 99.0, rolling(1.5, 3.0)),
        _TO_LIMIT,
        Piece(8.0, 25.0, _impulses),
    ),
    mild=(Piece(7.0, 26.0, _small_tones), Piece(0.0, 22.0, _small_trapezoid), COAST),
    drive_front=(0.5, 0.2, 0.8),
    brake_front=0.65,
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


def _full_ramp(car: Car, rng: Generator) -> Array:
    """Evenly up to all that the motors have (the driver lets go when the wheels spin)."""
    peak, clock = car.motor_peak_torque_nm, clock_of(rng.uniform(1.5, 3.0))
    return np.concatenate(
        [peak * clock / clock[-1], np.full(50, peak), np.linspace(peak, 0.0, 25), np.zeros(20)]
    )


_IN_STEPS = Piece(12.0, 99.0, _brake_in_steps, (0.1, 0.5))


PROVING = Style(
    rich=(
        Piece(0.0, 22.0, _full_ramp, (0.1, 0.5)),
        _IN_STEPS,
        Piece(8.0, 24.0, _switch),
        Piece(8.0, 26.0, _swing),
        # At once as hard as a dry road bears, until the wheels slide.
        Piece(
            13.0,
            99.0,
            pressed(brake, (1.0, 1.15), ((0.15, 0.3), 1.0), ((0.4, 0.9), 1.0), (0.15, 0.0), (0.3, 0.0)),
        ),
        Piece(8.0, 99.0, rolling(2.5, 4.5)),
        _IN_STEPS,
    ),
    drive_front=(0.5, 0.35, 0.65),
    brake_front=0.6,
)

# --- cruise control


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


def _cruise_control_emergency(car: Car, rng: Generator) -> Array:
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


def _pulled_back(car: Car, rng: Generator) -> Array:
    """On and off as lanes ahead open and close."""
    corners = []
    for _ in range(rng.integers(2, 5)):
        on, off = rng.uniform(0.3, 0.8), -rng.uniform(0.1, 0.5)
        corners += [(0.15, on), (rng.uniform(0.2, 0.6), on), (0.1, 0.0), (rng.uniform(0.1, 0.4), 0.0)]
        corners += [(0.15, off), (rng.uniform(0.2, 0.5), off), (0.1, 0.0)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


_EMERGENCY = Piece(12.0, 99.0, _cruise_control_emergency)


CRUISE_CONTROL = Style(
    rich=(
        Piece(0.0, 23.0, _resume),
        _EMERGENCY,
        Piece(8.0, 25.0, _keeping_distance),
        # His own foot down, all that the motors have (he lets go when the wheels spin).
        Piece(0.0, 21.0, pressed(power, 1.0, ((0.1, 0.25), 1.0), ((0.8, 1.8), 1.0), (0.2, 0.0), (0.4, 0.0))),
        Piece(12.0, 99.0, _cut_in),
        Piece(8.0, 25.0, _pulled_back),
        _EMERGENCY,
        Piece(8.0, 99.0, rolling(1.5, 3.0)),
    ),
    drive_front=(0.5, 0.4, 0.55),
    brake_front=0.64,
)
