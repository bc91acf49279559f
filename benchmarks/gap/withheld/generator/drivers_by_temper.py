"""Drivers by how they take the pedals: squeezing, restless, hurried, learning, with two feet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

from .car import Car
from .driver import COAST, Piece, Style, brake_to_limit, launch
from .kernel import GRAVITY
from .motors import COMMAND_STEP_S
from .pedals import brake, clock_of, drag, faded, gently, limit_of, power, pressed, rolling, squeezed

Array = NDArray[np.floating[Any]]


# --- squeezing


def _squeeze_to_limit(car: Car, rng: Generator) -> Array:
    """Ever harder and ever faster, until the wheels slide (the driver lets go) or a dry road's grip is passed."""
    limit = -rng.uniform(1.0, 1.15) * car.mass_kg * GRAVITY / 4.0 * car.wheel_radius_m
    clock = clock_of(rng.uniform(1.2, 2.2))
    return np.concatenate([limit * (clock / clock[-1]) ** 2, np.linspace(limit, 0.0, 20), np.zeros(30)])


def _waver(car: Car, rng: Generator) -> Array:
    """Three sines at once."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    tones = zip(rng.uniform([0.3, 1.0, 3.0], [1.0, 3.0, 7.0]), rng.uniform(0.0, 2.0 * np.pi, 3), strict=True)
    waves = sum(np.sin(2.0 * np.pi * hertz * clock + phase) for hertz, phase in tones)
    return faded(car.motor_peak_torque_nm * (0.06 + rng.uniform(0.12, 0.28) * waves))


_SURGE = Piece(0.0, 22.0, pressed(power, 1.0, ((0.3, 0.6), 1.0), ((0.8, 2.0), 1.0), (0.3, 0.0)))
_SQUEEZE_TO_LIMIT = Piece(12.0, 99.0, _squeeze_to_limit)
SQUEEZING = Style(
    rich=(
        Piece(
            0.0, 24.0, pressed(power, (0.4, 0.95), ((0.8, 2.0), 1.0), ((0.2, 1.0), 1.0), ((0.8, 2.0), 0.0))
        ),
        _SURGE,
        Piece(8.0, 99.0, pressed(drag, (0.03, 0.12), ((0.3, 0.8), 1.0), ((1.5, 3.5), 1.0), (0.4, 0.0))),
        Piece(13.0, 99.0, pressed(drag, (0.3, 1.0), ((0.4, 1.0), 1.0), ((0.6, 1.8), 1.0), ((0.4, 1.0), 0.0))),
        _SQUEEZE_TO_LIMIT,
        Piece(8.0, 26.0, _waver),
        _SQUEEZE_TO_LIMIT,
        _SURGE,
    ),
    drive_front=(0.5, 0.3, 0.8),
    brake_front=0.68,
)

# --- restless


def _wander(car: Car, rng: Generator, mean: float = 0.1, spread: float = 0.4) -> Array:
    """Noise that a foot could make: low-passed twice, about `mean` with `spread` of the motors' peak."""
    rows = round(rng.uniform(4.0, 7.0) / COMMAND_STEP_S)
    keep = np.exp(-COMMAND_STEP_S / rng.uniform(0.1, 0.4))
    wave = lfilter([1.0], [1.0, -2.0 * keep, keep**2], rng.standard_normal(rows + 200))[200:]
    share = np.clip(mean + spread * wave / max(wave.std(), 1e-12), -0.7, 0.95)
    return faded(car.motor_peak_torque_nm * share)


def _wander_gently(car: Car, rng: Generator) -> Array:
    return _wander(car, rng, mean=0.05, spread=0.06)


def _pump(car: Car, rng: Generator) -> Array:
    """Cadence braking."""
    pulses = []
    for _ in range(rng.integers(3, 6)):
        level = -limit_of(car) * rng.uniform(0.4, 1.0)
        pulses += [(0.08, level), (rng.uniform(0.1, 0.35), level), (0.1, 0.0), (rng.uniform(0.1, 0.3), 0.0)]
    return squeezed(*pulses)


def _stairs(car: Car, rng: Generator) -> Array:
    """Up in even steps and down again."""
    steps = int(rng.integers(3, 5))
    height, tread = rng.uniform(0.6, 1.0) * car.motor_peak_torque_nm / steps, rng.uniform(0.3, 0.6)
    levels = [*range(1, steps + 1), *range(steps - 1, -1, -1)]
    return squeezed(*(corner for n in levels for corner in ((0.1, n * height), (tread, n * height))))


_SWELL_GENTLY = pressed(power, (0.08, 0.25), ((1.0, 2.0), 1.0), ((1.0, 4.0), 1.0), ((1.0, 2.0), 0.0))
RESTLESS = Style(
    rich=(
        Piece(8.0, 26.0, _wander),
        Piece(0.0, 22.0, launch),
        Piece(12.0, 99.0, _pump),
        Piece(0.0, 20.0, _stairs),
        COAST,
        Piece(12.0, 99.0, brake_to_limit),
        Piece(8.0, 26.0, _wander),
        Piece(12.0, 99.0, brake_to_limit),
    ),
    mild=(Piece(7.0, 26.0, _wander_gently), Piece(0.0, 22.0, _SWELL_GENTLY), COAST),
    drive_front=(0.4, 0.5, 0.6),
    brake_front=0.62,
)

# --- hurried


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


_OUT_OF_A_BEND = pressed(
    power, 1.0, (0.3, 0.2), ((0.8, 1.6), 0.7), (0.3, 1.0), ((0.5, 1.8), 1.0), (0.12, 0.0)
)
_INTO_A_BEND = Piece(
    12.0,
    99.0,
    pressed(brake, (0.6, 1.15), ((0.12, 0.25), 1.0), ((0.2, 0.6), 0.95), ((0.8, 1.6), 0.0), (0.1, 0.0)),
)
HURRIED = Style(
    rich=(
        Piece(0.0, 23.0, _OUT_OF_A_BEND),
        _INTO_A_BEND,
        Piece(0.0, 20.0, pressed(power, 1.0, (0.08, 1.0), ((0.6, 1.6), 1.0), (0.15, 0.0), (0.2, 0.0))),
        Piece(8.0, 25.0, _lifts),
        _INTO_A_BEND,
        Piece(8.0, 25.0, _balance),
        Piece(8.0, 99.0, rolling(1.0, 2.0)),
        _INTO_A_BEND,
    ),
    mild=(Piece(0.0, 23.0, _hurry_gently), Piece(7.0, 26.0, gently(0.25, _balance)), COAST),
    drive_front=(0.3, 0.45, 0.6),
    brake_front=0.7,
)

# --- learner


def _bucking(car: Car, rng: Generator) -> Array:
    """Too much, too little, too much: his foot goes with the car's jerks."""
    clock, hertz = clock_of(rng.uniform(2.5, 4.5)), rng.uniform(1.2, 2.5)
    mean, size = rng.uniform(0.15, 0.3), rng.uniform(0.3, 0.6)
    decay = np.exp(-clock / rng.uniform(1.5, 4.0))
    return faded(car.motor_peak_torque_nm * (mean + size * decay * np.sin(2.0 * np.pi * hertz * clock)))


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


# On the brake with all his weight, off it at once, then half on (he lets go when the wheels slide).
_STARTLED = Piece(
    12.0,
    99.0,
    pressed(
        brake,
        (1.0, 1.2),
        *(((0.1, 0.2), 1.0), ((0.2, 0.6), 1.0), (0.1, 0.0), ((0.2, 0.5), 0.0)),
        *((0.2, 0.45), ((0.4, 0.9), 0.35), (0.3, 0.0)),
    ),
)
LEARNER = Style(
    rich=(
        Piece(5.0, 24.0, _bucking),
        _STARTLED,
        # The wrong pedal's whole way, until the wheels spin or he is startled.
        Piece(0.0, 20.0, pressed(power, 1.0, (0.15, 1.0), ((0.6, 1.4), 1.0), (0.1, -0.2), (0.4, 0.0))),
        Piece(0.0, 23.0, _unsteady),
        Piece(12.0, 99.0, _late),
        Piece(8.0, 99.0, rolling(1.5, 3.0)),
        _STARTLED,
    ),
    drive_front=(0.6, 0.7),
    brake_front=0.72,
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


def _riding(car: Car, rng: Generator) -> Array:
    """Power that goes up and down on a brake that rests on."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    wave = np.abs(np.sin(np.pi * clock * rng.uniform(0.5, 1.5)))
    return faded(car.motor_peak_torque_nm * (rng.uniform(0.5, 0.9) * wave - rng.uniform(0.1, 0.3)))


# A foot that is used to a clutch: too hard, less, and hard again (he lets go when the wheels slide).
_LEFT_FOOT = Piece(
    12.0,
    99.0,
    pressed(
        brake,
        (1.0, 1.2),
        *(((0.1, 0.2), 0.9), (0.12, 0.5), ((0.2, 0.5), 0.5)),
        *(((0.2, 0.5), 1.0), ((0.3, 0.6), 1.0), (0.2, 0.0), (0.2, 0.0)),
    ),
)
TWO_FEET = Style(
    rich=(
        Piece(6.0, 24.0, _both),
        _LEFT_FOOT,
        Piece(0.0, 20.0, pressed(power, 1.0, (0.3, 0.3), ((0.5, 1.0), 1.0), ((0.6, 1.4), 1.0), (0.2, 0.0))),
        Piece(9.0, 24.0, _swap),
        Piece(8.0, 25.0, _riding),
        _LEFT_FOOT,
        Piece(7.0, 99.0, rolling(1.0, 2.5)),
    ),
    drive_front=(0.5, 0.6, 0.45),
    brake_front=0.69,
)
