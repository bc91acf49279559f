"""Roads that are laid otherwise than usual, and drivers that every surface bears."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .camera_road import ALL_SPEEDS, CLASS_FRICTION, ODDS, ROAD_M, CameraRoad
from .car import Car
from .driver import COAST, Piece, Style
from .pedals import clock_of, drag, faded, power, pressed, squeezed

Array = NDArray[np.floating[Any]]
Stretches = Iterator[tuple[float, int]]
"""Length and surface of one stretch after the other."""


def _other(rng: Generator, surface: int) -> int:
    odds = np.array(ODDS) * (np.arange(3) != surface)
    return int(rng.choice(3, p=odds / odds.sum()))


def _two_classes(rng: Generator) -> Stretches:
    """One lies on the other all the way."""
    pair = rng.permutation(3)[:2]
    while True:
        yield from ((float(rng.uniform(12.0, 55.0)), int(surface)) for surface in pair)


def _patches(rng: Generator) -> Stretches:
    """Short ones of one surface, again and again, in another; a third one now and then."""
    ground, patch, third = rng.permutation(3)
    while True:
        yield float(rng.uniform(14.0, 40.0)), int(ground)
        rare = rng.random() < 0.2
        yield (
            float(rng.uniform(25.0, 50.0) if rare else rng.uniform(7.0, 13.0)),
            int(third if rare else patch),
        )


def _very_uneven(rng: Generator) -> Stretches:
    surface = int(rng.choice(3, p=ODDS))
    while True:
        yield float(np.exp(rng.uniform(*np.log((7.0, 120.0))))), surface
        surface = _other(rng, surface)


def _clustered(rng: Generator) -> Stretches:
    """Much the same for long, and then many on end."""
    surface = int(rng.choice(3, p=ODDS))
    while True:
        for length in (rng.uniform(45.0, 80.0), *rng.uniform(8.0, 25.0, rng.integers(4, 8))):
            yield float(length), surface
            surface = _other(rng, surface)


def _through_wet(rng: Generator) -> Stretches:
    """What is not dry is wet at its edges, and some of it snow within."""
    while True:
        yield float(rng.uniform(18.0, 50.0)), 0
        if rng.random() < 0.3:
            yield float(rng.uniform(15.0, 40.0)), 1
            continue
        yield float(rng.uniform(8.0, 16.0)), 1
        yield float(rng.uniform(15.0, 45.0)), 2
        yield float(rng.uniform(8.0, 16.0)), 1


def _repeated(rng: Generator) -> Stretches:
    """Lanes of a proving ground, laid one after the other and driven round and round."""
    lanes = [float(length) for length in rng.uniform(14.0, 50.0, rng.integers(2, 4) * 3)]
    order = [int(surface) for surface in rng.permutation(3)]
    while True:
        yield from zip(lanes, order * (len(lanes) // 3), strict=True)


LAYOUTS = {
    "two_classes": _two_classes,
    "patches": _patches,
    "very_uneven": _very_uneven,
    "clustered": _clustered,
    "through_wet": _through_wet,
    "repeated": _repeated,
}


def draw_laid_road(rng: Generator, layout: str) -> CameraRoad:
    """Of one of `LAYOUTS`, each surface with the friction that its class has."""
    starts, surfaces = [0.0], list[int]()
    for length, surface in LAYOUTS[layout](rng):
        surfaces.append(surface)
        if starts[-1] >= ROAD_M:
            break
        starts.append(round(starts[-1] + length, 2))
    return CameraRoad(tuple(starts), tuple(CLASS_FRICTION[s] for s in surfaces), tuple(surfaces))


# --- drivers


def _along(car: Car, rng: Generator) -> Array:
    return faded(car.motor_peak_torque_nm * np.full(round(rng.uniform(150, 350)), rng.uniform(0.01, 0.04)))


def _surge(car: Car, rng: Generator) -> Array:
    """Past another car, and back to its speed."""
    up, down = (car.motor_peak_torque_nm * rng.uniform(0.35, 0.55) for _ in range(2))
    there, back = rng.uniform(3.0, 5.0), rng.uniform(2.5, 4.5)
    return squeezed((0.5, up), (there, up), (0.8, 0.0), (0.8, -down), (back, -down), (0.5, 0.0))


def _wave(car: Car, rng: Generator) -> Array:
    """Up hill and down dale."""
    period = rng.uniform(7.0, 11.0)
    clock = clock_of(rng.uniform(1.0, 1.5) * period)
    wave = rng.uniform(0.35, 0.55) * np.sin(2.0 * np.pi * clock / period) + 0.02
    return faded(car.motor_peak_torque_nm * wave)


_ALONG = Piece(5.0, 99.0, _along)
_OFF = pressed(power, (0.3, 0.5), (0.4, 1.0), ((2.0, 4.0), 1.0), (0.4, 0.0))
_TOWARDS_A_LIGHT = pressed(drag, (0.25, 0.45), (0.6, 1.0), ((1.5, 3.5), 1.0), (0.6, 0.0))
_STEP_UP = pressed(power, (0.3, 0.45), (0.6, 1.0), ((1.5, 3.5), 1.0), (0.6, 0.0))
_STEP_DOWN = pressed(drag, (0.25, 0.4), (0.6, 1.0), ((1.0, 2.5), 1.0), (0.6, 0.0))
TOWN = Style(
    rich=(Piece(0.0, 9.0, _OFF), _ALONG, Piece(9.5, 99.0, _TOWARDS_A_LIGHT)),
    mild=(_ALONG,),
    drive_front=(0.5,),
    brake_front=0.62,
)
SURGING = Style(
    rich=(Piece(7.0, 16.0, _surge), _ALONG, Piece(16.0, 99.0, _TOWARDS_A_LIGHT), Piece(0.0, 12.0, _OFF)),
    mild=(_ALONG, COAST),
    drive_front=(0.4, 0.6),
    brake_front=0.6,
)
IN_WAVES = Style(
    rich=(Piece(7.0, 20.0, _wave), Piece(0.0, 12.0, _OFF), Piece(15.0, 99.0, _TOWARDS_A_LIGHT)),
    mild=(_ALONG, COAST, _ALONG),
    drive_front=(0.5, 0.55),
    brake_front=0.65,
)
PLATEAUS = Style(
    rich=(
        Piece(0.0, 20.0, _STEP_UP),
        _ALONG,
        Piece(0.0, 14.0, _STEP_UP),
        _ALONG,
        Piece(12.0, 99.0, _STEP_DOWN),
        _ALONG,
    ),
    mild=(_ALONG,),
    drive_front=(0.5,),
    brake_front=0.6,
)
"""One set speed after the other."""

SPEEDS = {
    "all_speeds": ALL_SPEEDS,
    "town": TOWN,
    "surging": SURGING,
    "in_waves": IN_WAVES,
    "plateaus": PLATEAUS,
}
