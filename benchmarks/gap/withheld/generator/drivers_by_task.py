"""Drivers by what they are about: winter, deliveries, saving power, overtaking, a training, the way to work."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .driver import COAST, Piece, Style
from .pedals import brake, clock_of, drag, faded, gently, limit_of, power, pressed, rolling, squeezed

Array = NDArray[np.floating[Any]]


# --- winter


def _feeling(car: Car, rng: Generator) -> Array:
    """Dabs of the brake from rolling, each harder, to feel what the road bears (he lets go when the wheels slide)."""
    corners = []
    for share in np.linspace(0.2, rng.uniform(0.9, 1.15), int(rng.integers(4, 6))):
        level = -share * limit_of(car)
        corners += [(0.12, level), (rng.uniform(0.12, 0.3), level), (0.12, 0.0), (rng.uniform(0.2, 0.5), 0.0)]
    return squeezed(*corners)


def _rocking(car: Car, rng: Generator) -> Array:
    """Power and drag of the motors in turn, to wake the car."""
    peak, corners = car.motor_peak_torque_nm, []
    for _ in range(rng.integers(3, 5)):
        corners += [(0.25, peak * rng.uniform(0.4, 0.85)), (rng.uniform(0.1, 0.4), 0.5 * peak)]
        corners += [(0.25, -peak * rng.uniform(0.15, 0.4)), (rng.uniform(0.1, 0.3), -0.15 * peak)]
    return squeezed(*corners, (0.3, 0.0))


_FEELING = Piece(12.0, 99.0, _feeling)


# A little, and as the road bears that, all of it (he lets go when the wheels slide).
_ALL = Piece(
    12.0,
    99.0,
    pressed(
        brake,
        (1.0, 1.2),
        *((0.3, 0.25), ((0.3, 0.7), 0.25), ((0.3, 0.6), 1.0), ((0.3, 0.8), 1.0), (0.2, 0.0), (0.3, 0.0)),
    ),
    (0.1, 0.4),
)


WINTER = Style(
    rich=(
        Piece(
            0.0, 24.0, pressed(power, (0.25, 0.5), ((0.8, 1.5), 1.0), ((1.0, 2.5), 1.0), ((0.5, 1.0), 0.0))
        ),
        _FEELING,
        # Up until the wheels spin, and held there (he lets go late).
        Piece(
            0.0,
            20.0,
            pressed(power, 1.0, ((1.0, 2.0), 0.9), (0.2, 1.0), ((0.4, 1.0), 1.0), (0.4, 0.0)),
            (0.2, 0.5),
        ),
        Piece(8.0, 25.0, _rocking),
        _ALL,
        Piece(8.0, 99.0, rolling(1.5, 3.0)),
        _ALL,
    ),
    drive_front=(0.35, 0.5, 0.45),
    brake_front=0.58,
)

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


def _kerb_crawl(car: Car, rng: Generator) -> Array:
    """Little pushes while he reads the numbers."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        level = car.motor_peak_torque_nm * rng.uniform(0.25, 0.6)
        corners += [(0.15, level), (rng.uniform(0.1, 0.4), level), (0.2, 0.0), (rng.uniform(0.2, 0.6), 0.0)]
    return squeezed(*corners)


_LATE = Piece(
    12.0, 99.0, pressed(brake, (1.0, 1.2), ((0.12, 0.25), 1.0), ((0.4, 0.9), 1.0), (0.15, 0.0), (0.4, 0.0))
)


DELIVERY = Style(
    rich=(
        Piece(5.0, 20.0, _between_doors),
        _LATE,
        # The pedal on the floor, off and on again (he lets go when the wheels spin).
        Piece(
            0.0,
            20.0,
            pressed(
                power,
                1.0,
                *((0.1, 1.0), (0.5, 1.0), (0.1, 0.0), (0.25, 0.0), (0.1, 1.0), ((0.5, 1.2), 1.0), (0.2, 0.0)),
            ),
        ),
        Piece(6.0, 24.0, _kerb_crawl),
        Piece(10.0, 99.0, pressed(drag, (0.15, 0.35), (0.25, 1.0), ((0.8, 1.6), 1.0), (0.25, 0.0))),
        _LATE,
        Piece(5.0, 20.0, _between_doors),
    ),
    drive_front=(0.7, 0.5, 0.85),
    brake_front=0.63,
)

# --- saving


def _feather(car: Car, rng: Generator) -> Array:
    """A pedal that is let in and out in waves, faster and faster."""
    clock = clock_of(rng.uniform(3.0, 5.0))
    phase = 2.0 * np.pi * (0.4 * clock + rng.uniform(0.3, 0.8) * clock**2 / 2.0)
    return faded(car.motor_peak_torque_nm * (0.08 + rng.uniform(0.2, 0.5) * np.sin(phase)))


# A pulse of what is best for the motors, then rolling; braking by the motors, less the slower he is.
_PULSE = pressed(
    power, (0.45, 0.75), ((0.3, 0.6), 1.0), ((1.0, 2.2), 1.0), ((0.3, 0.6), 0.0), ((1.0, 2.5), 0.0)
)
_HARVEST = pressed(drag, (0.3, 0.7), (0.4, 1.0), ((1.0, 2.0), 0.5), ((0.5, 1.0), 0.0))
# Another cuts in: from the motors' brake to all of it (he lets go when the wheels slide).
_CUT_IN = Piece(
    12.0,
    99.0,
    pressed(
        brake,
        (1.0, 1.15),
        *((0.3, 0.2), ((0.2, 0.5), 0.2), ((0.4, 1.0), 1.0), ((0.3, 0.6), 1.0), (0.25, 0.0), (0.3, 0.0)),
    ),
)


SAVING = Style(
    rich=(
        Piece(4.0, 23.0, _PULSE),
        _CUT_IN,
        # All that there is, to join those who do not save (he lets go when the wheels spin).
        Piece(0.0, 21.0, pressed(power, 1.0, ((0.3, 0.8), 1.0), ((1.0, 1.8), 1.0), (0.6, 0.1), (0.3, 0.0))),
        Piece(10.0, 99.0, _HARVEST),
        Piece(8.0, 25.0, _feather),
        _CUT_IN,
        Piece(8.0, 99.0, rolling(1.0, 2.5)),
    ),
    mild=(Piece(0.0, 23.0, gently(0.3, _PULSE)), Piece(9.0, 99.0, gently(0.15, _HARVEST)), COAST),
    drive_front=(0.3, 0.4, 0.5),
    brake_front=0.57,
)

# --- overtaking


def _behind(car: Car, rng: Generator) -> Array:
    """Too close: little pushes, and each time a little brake."""
    corners = []
    for _ in range(rng.integers(2, 5)):
        up, down = rng.uniform(0.2, 0.6), -rng.uniform(0.1, 0.4)
        corners += [(0.3, up), (rng.uniform(0.3, 0.8), up), (0.25, down), (rng.uniform(0.15, 0.5), down)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


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


_GIVEN_UP = Piece(11.0, 99.0, _given_up)


OVERTAKING = Style(
    rich=(
        Piece(7.0, 24.0, _behind),
        _GIVEN_UP,
        # A look, all that the motors have, and a lift when he is past (he lets go when the wheels spin).
        Piece(
            0.0,
            21.0,
            pressed(
                power,
                1.0,
                *((0.3, 0.35), ((0.3, 0.6), 0.35), ((0.12, 0.3), 1.0), ((1.0, 2.2), 1.0), (0.4, 0.0)),
            ),
        ),
        Piece(12.0, 99.0, _village),
        Piece(8.0, 25.0, _winding),
        _GIVEN_UP,
        Piece(8.0, 99.0, rolling(1.0, 2.5)),
    ),
    drive_front=(0.4, 0.5, 0.65),
    brake_front=0.65,
)

# --- training


def _to_the_cones(car: Car, rng: Generator) -> Array:
    """A held speed up to the cones, then all of the brake at once (he lets go when the wheels slide)."""
    hold, limit = car.motor_peak_torque_nm * rng.uniform(0.02, 0.08), -rng.uniform(1.0, 1.2) * limit_of(car)
    return squeezed(
        (0.3, hold),
        (rng.uniform(0.6, 1.5), hold),
        (0.1, 0.0),
        (rng.uniform(0.1, 0.2), limit),
        (rng.uniform(0.5, 1.2), limit),
        (0.15, 0.0),
        (0.4, 0.0),
    )


def _on_the_threshold(car: Car, rng: Generator) -> Array:
    """Up to where the wheels begin to slide, a little back, and up again, as he was told."""
    corners = [(rng.uniform(0.2, 0.4), -0.7 * limit_of(car))]
    for _ in range(rng.integers(2, 5)):
        corners += [(rng.uniform(0.2, 0.4), -rng.uniform(0.9, 1.1) * limit_of(car))]
        corners += [(0.15, -rng.uniform(0.5, 0.75) * limit_of(car))]
    return squeezed(*corners, (0.3, 0.0))


def _off_the_line(car: Car, rng: Generator) -> Array:
    """First too much, then as much as the wheels bear (he lets go when they spin)."""
    peak = car.motor_peak_torque_nm
    back = rng.uniform(0.5, 0.8) * peak
    return squeezed(
        (rng.uniform(0.1, 0.3), peak),
        (rng.uniform(0.5, 1.2), peak),
        (0.2, back),
        (rng.uniform(0.5, 1.5), back),
        (0.4, 0.0),
    )


def _slalom(car: Car, rng: Generator) -> Array:
    """Off at each cone and on between them, now and then with a touch of the brake."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        on, off = rng.uniform(0.3, 0.7), -rng.choice([0.0, 0.1, 0.3])
        corners += [(0.2, on), (rng.uniform(0.2, 0.4), on), (0.2, off), (rng.uniform(0.2, 0.4), off)]
    return car.motor_peak_torque_nm * squeezed(*corners, (0.3, 0.0))


def _round_the_circle(car: Car, rng: Generator) -> Array:
    """Round a wet circle: ever a little more, and off when it pushes."""
    clock, turn = clock_of(rng.uniform(3.0, 5.0)), rng.uniform(0.8, 1.4)
    return faded(car.motor_peak_torque_nm * (0.1 + rng.uniform(0.3, 0.6) * np.mod(clock / turn, 1.0) ** 2))


_CONES = Piece(12.0, 99.0, _to_the_cones)


TRAINING = Style(
    rich=(
        _CONES,
        Piece(0.0, 21.0, _off_the_line),
        Piece(12.0, 99.0, _on_the_threshold, (0.15, 0.4)),
        Piece(7.0, 25.0, _slalom),
        Piece(7.0, 24.0, _round_the_circle),
        _CONES,
        Piece(8.0, 99.0, rolling(1.0, 2.5)),
    ),
    mild=(
        Piece(7.0, 24.0, gently(0.2, _slalom)),
        # A held speed, with a lift before each bend.
        Piece(
            0.0, 22.0, pressed(power, (0.03, 0.12), (0.8, 1.0), ((1.5, 3.5), 1.0), (0.6, -0.3), (1.0, 0.0))
        ),
        COAST,
    ),
    drive_front=(0.5, 0.35, 0.6),
    brake_front=0.66,
)

# --- commuter


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


def _commuter_rocking(car: Car, rng: Generator) -> Array:
    """His foot goes to and fro with the song on the radio, on every beat a little."""
    clock, beats = clock_of(rng.uniform(3.0, 5.0)), rng.uniform(1.4, 2.3)
    wave = np.abs(np.sin(np.pi * beats * clock)) ** 3 - 0.25
    return faded(car.motor_peak_torque_nm * (0.08 + rng.uniform(0.3, 0.7) * wave))


_RED = Piece(12.0, 99.0, _turning_red)


COMMUTER = Style(
    rich=(
        # First off the light, with all that the motors have (he lets go when the wheels spin).
        Piece(
            0.0,
            21.0,
            pressed(
                power,
                1.0,
                *(((0.15, 0.3), 1.0), ((0.8, 1.8), 1.0), (0.4, 0.2), ((0.3, 0.8), 0.2), (0.2, 0.0)),
            ),
        ),
        _RED,
        Piece(0.0, 22.0, _slip_road),
        Piece(8.0, 25.0, _gap_to_gap),
        Piece(11.0, 99.0, _brake_lights),
        Piece(8.0, 25.0, _commuter_rocking),
        _RED,
        Piece(8.0, 99.0, rolling(1.0, 2.5)),
    ),
    drive_front=(0.55, 0.5, 0.7),
    brake_front=0.67,
)
