"""Further drivers: one who squeezes the pedals and never just rolls, and one whose foot never rests."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

from .car import Car
from .driver import COAST, Piece, Style, brake_to_limit, launch
from .kernel import COMMAND_STEP_S, GRAVITY

Array = NDArray[np.floating[Any]]


def clock_of(duration_s: float) -> Array:
    return np.arange(1, round(duration_s / COMMAND_STEP_S) + 1) * COMMAND_STEP_S


def limit_of(car: Car) -> float:
    """Torque per wheel that a dry road just bears [N m]."""
    return car.mass_kg * GRAVITY / 4.0 * car.wheel_radius_m


def squeezed(*corners: tuple[float, float]) -> Array:
    """Torque through corners of (duration from the corner before [s], torque [N m]), at rest in each."""
    parts, last = [], 0.0
    for duration, level in corners:
        z = np.minimum(clock_of(duration) / duration, 1.0)
        parts.append(last + (level - last) * z * z * (3.0 - 2.0 * z))
        last = level
    return np.concatenate(parts)


def faded(torque: Array) -> Array:
    """From nothing and back to nothing, over 0.3 s each."""
    to_go = np.arange(torque.size)
    return torque * np.clip(np.minimum(to_go, to_go[::-1]) * COMMAND_STEP_S / 0.3, 0.0, 1.0)


# --- squeezing


def _swell(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.4, 0.95)
    return squeezed(
        (rng.uniform(0.8, 2.0), level), (rng.uniform(0.2, 1.0), level), (rng.uniform(0.8, 2.0), 0.0)
    )


def _surge(car: Car, rng: Generator) -> Array:
    """All that the motors have (the driver lets go when the wheels spin)."""
    level = car.motor_peak_torque_nm
    return squeezed((rng.uniform(0.3, 0.6), level), (rng.uniform(0.8, 2.0), level), (0.3, 0.0))


def _lift(car: Car, rng: Generator) -> Array:
    """Off the pedal: the motors brake a little."""
    level = -car.motor_peak_torque_nm * rng.uniform(0.03, 0.12)
    return squeezed((rng.uniform(0.3, 0.8), level), (rng.uniform(1.5, 3.5), level), (0.4, 0.0))


def _squeeze(car: Car, rng: Generator) -> Array:
    level = -car.motor_peak_torque_nm * rng.uniform(0.3, 1.0)
    return squeezed(
        (rng.uniform(0.4, 1.0), level), (rng.uniform(0.6, 1.8), level), (rng.uniform(0.4, 1.0), 0.0)
    )


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


def _swell_gently(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.08, 0.25)
    return squeezed(
        (rng.uniform(1.0, 2.0), level), (rng.uniform(1.0, 4.0), level), (rng.uniform(1.0, 2.0), 0.0)
    )


def _hum(car: Car, rng: Generator) -> Array:
    """A held speed, the foot a little up and down."""
    clock = clock_of(rng.uniform(4.0, 7.0))
    up, down = rng.uniform(0.03, 0.07), rng.uniform(0.01, 0.04)
    return faded(car.motor_peak_torque_nm * (up + down * np.sin(2.0 * np.pi * clock / rng.uniform(2.0, 4.0))))


SQUEEZING = Style(
    rich=(
        Piece(0.0, 24.0, _swell),
        Piece(0.0, 22.0, _surge),
        Piece(8.0, 99.0, _lift),
        Piece(13.0, 99.0, _squeeze),
        Piece(12.0, 99.0, _squeeze_to_limit),
        Piece(8.0, 26.0, _waver),
        Piece(12.0, 99.0, _squeeze_to_limit),
        Piece(0.0, 22.0, _surge),
    ),
    mild=(Piece(7.0, 99.0, _hum), Piece(0.0, 22.0, _swell_gently), Piece(9.0, 99.0, _lift)),
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
    limit = -car.mass_kg * GRAVITY / 4.0 * car.wheel_radius_m
    pulses = []
    for _ in range(rng.integers(3, 6)):
        level = limit * rng.uniform(0.4, 1.0)
        pulses += [(0.08, level), (rng.uniform(0.1, 0.35), level), (0.1, 0.0), (rng.uniform(0.1, 0.3), 0.0)]
    return squeezed(*pulses)


def _stairs(car: Car, rng: Generator) -> Array:
    """Up in even steps and down again."""
    steps = int(rng.integers(3, 5))
    height, tread = rng.uniform(0.6, 1.0) * car.motor_peak_torque_nm / steps, rng.uniform(0.3, 0.6)
    levels = [*range(1, steps + 1), *range(steps - 1, -1, -1)]
    return squeezed(*(corner for n in levels for corner in ((0.1, n * height), (tread, n * height))))


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
    mild=(Piece(7.0, 26.0, _wander_gently), Piece(0.0, 22.0, _swell_gently), COAST),
    drive_front=(0.4, 0.5, 0.6),
    brake_front=0.62,
)
