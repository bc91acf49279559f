"""Who drives: a person at the wheel of the real car, with pieces of driving drawn at random.

The driver sees the real car's speed and the wheels' slip, as a person does, and lets go when it slides too long or
gets too fast or too slow. The torque that results is the log's, and whoever simulates the drive gets it as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car
from .kernel import GRAVITY, RECORD_STEP_S, N, V, W, begin, integrate
from .motors import COMMAND_STEP_S
from .world import World

Array = NDArray[np.floating[Any]]

LOOK = 5
"""Command steps between two looks at the car."""
ROWS_PER_COMMAND = round(COMMAND_STEP_S / RECORD_STEP_S)
SLOWEST_M_S, FASTEST_M_S = 4.0, 30.0


class UndrivableError(RuntimeError):
    """The real car comes to a stop: the plant is for moving cars."""


@dataclass(frozen=True)
class Drive:
    """A drive of the real car.

    Attributes
    ----------
    path : array, shape (n, N + 1)
        The kernel's record every `RECORD_STEP_S`.
    command : array, shape (m, 4)
        Commanded torque every `COMMAND_STEP_S`, linear between [N m].
    """

    path: Array
    command: Array


@dataclass(frozen=True)
class Piece:
    """A piece of driving: the speeds that it may begin at, and the torque over its time.

    `torque` gives the mean torque per wheel every `COMMAND_STEP_S` of a car [N m]; `patience_s` is how long the driver
    lets a wheel slide.
    """

    slow_m_s: float
    fast_m_s: float
    torque: Callable[[Car, Generator], Array]
    patience_s: tuple[float, float] = (0.05, 0.3)


def _line(*corners: tuple[float, float]) -> Array:
    """Torque through corners of (duration from the corner before [s], torque [N m])."""
    durations, levels = zip(*corners, strict=True)
    ends = np.cumsum(durations)
    clock = np.arange(1, round(ends[-1] / COMMAND_STEP_S) + 1) * COMMAND_STEP_S
    return np.interp(clock, [0.0, *ends], [0.0, *levels])


def _accelerate(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.3, 0.9)
    return _line((rng.uniform(0.2, 0.8), level), (rng.uniform(1.5, 3.5), level), (rng.uniform(0.2, 0.8), 0.0))


def launch(car: Car, rng: Generator) -> Array:
    """All that the motors have, until the wheels spin (the driver lets go)."""
    level = car.motor_peak_torque_nm
    return _line((rng.uniform(0.1, 0.4), level), (rng.uniform(0.8, 2.0), level), (0.15, 0.0), (0.3, 0.0))


def _coast(car: Car, rng: Generator) -> Array:
    return np.zeros(int(rng.uniform(2.0, 4.0) / COMMAND_STEP_S))


def _brake(car: Car, rng: Generator) -> Array:
    level = -car.motor_peak_torque_nm * rng.uniform(0.3, 1.0)
    return _line((rng.uniform(0.2, 0.5), level), (rng.uniform(0.8, 2.0), level), (rng.uniform(0.2, 0.5), 0.0))


def brake_to_limit(car: Car, rng: Generator) -> Array:
    """Ever harder until the wheels slide (the driver lets go) or a dry road's grip is passed."""
    limit = -rng.uniform(1.0, 1.15) * car.mass_kg * GRAVITY / 4.0 * car.wheel_radius_m
    return _line((0.3, 0.35 * limit), (rng.uniform(0.8, 1.6), limit), (0.15, 0.0), (0.3, 0.0))


def _steps(car: Car, rng: Generator) -> Array:
    corners = []
    for level in car.motor_peak_torque_nm * rng.uniform(-0.5, 0.95, rng.integers(4, 7)):
        corners += [(rng.uniform(0.04, 0.12), level), (rng.uniform(0.3, 0.9), level)]
    return _line(*corners, (0.2, 0.0))


def _tips(car: Car, rng: Generator) -> Array:
    """Tip-in and tip-out: short pulses of either sign."""
    corners = []
    for _ in range(rng.integers(3, 6)):
        level = car.motor_peak_torque_nm * rng.uniform(0.3, 0.95) * rng.choice([1.0, 1.0, -0.6])
        corners += [
            (0.04, level),
            (rng.uniform(0.15, 0.5), level),
            (0.04, 0.0),
            (rng.uniform(0.15, 0.5), 0.0),
        ]
    return _line(*corners)


def _sweep(car: Car, rng: Generator) -> Array:
    """A sine whose frequency rises."""
    duration = rng.uniform(3.0, 5.0)
    clock = np.arange(round(duration / COMMAND_STEP_S)) * COMMAND_STEP_S
    slow, fast = 0.5, rng.uniform(4.0, 8.0)
    phase = 2.0 * np.pi * slow * duration / np.log(fast / slow) * ((fast / slow) ** (clock / duration) - 1.0)
    fade = np.minimum(1.0, np.minimum(clock, duration - clock) / 0.2)
    return car.motor_peak_torque_nm * rng.uniform(0.25, 0.6) * fade * (0.15 + np.sin(phase))


def _cruise(car: Car, rng: Generator) -> Array:
    a, b = car.motor_peak_torque_nm * rng.uniform(0.01, 0.08, 2)
    return _line((1.0, a), (rng.uniform(3.0, 6.0), b), (1.0, 0.0))


def _gently(car: Car, rng: Generator) -> Array:
    level = car.motor_peak_torque_nm * rng.uniform(0.08, 0.25)
    return _line((rng.uniform(0.8, 1.5), level), (rng.uniform(2.0, 5.0), level), (rng.uniform(0.8, 1.5), 0.0))


def _ease(car: Car, rng: Generator) -> Array:
    return -_gently(car, rng)


ACCELERATE = Piece(0.0, 24.0, _accelerate)
BRAKE = Piece(13.0, 99.0, _brake)
RICH = (
    ACCELERATE,
    Piece(7.0, 99.0, _coast),
    BRAKE,
    Piece(12.0, 99.0, brake_to_limit),
    Piece(0.0, 22.0, launch),
    Piece(12.0, 99.0, brake_to_limit),
    Piece(8.0, 25.0, _steps),
    Piece(7.0, 26.0, _tips),
    Piece(8.0, 26.0, _sweep),
)
GENTLY = Piece(0.0, 22.0, _gently)
COAST = Piece(8.0, 99.0, _coast)
EASE = Piece(13.0, 99.0, _ease)
MILD = (Piece(7.0, 99.0, _cruise), GENTLY, COAST)


@dataclass(frozen=True)
class Style:
    """What a driver does with his car, and how the car shares it out.

    Attributes
    ----------
    rich, mild : tuple of Piece
        Pieces of driving that excite everything, and calm ones; each is done once before any is repeated.
    drive_front : tuple of float
        Front shares of the motors, one of which is drawn for each piece [-].
    brake_front : float
        Front share of the brakes [-].
    """

    rich: tuple[Piece, ...]
    drive_front: tuple[float, ...]
    brake_front: float
    mild: tuple[Piece, ...] = MILD


BRISK = Style(RICH, (0.5, 0.5, 0.4, 0.6, 0.7), 0.6)
"""Straight ramps and plateaus, one kind of driving after the other."""


def _next_piece(waiting: list[Piece], style: Style, rich: bool, speed: float, rng: Generator) -> Piece:
    """The next one waiting that suits the speed, else one that mends the speed; refills when all are done."""
    if not waiting:
        pieces = style.rich if rich else style.mild
        waiting += [pieces[i] for i in rng.permutation(len(pieces))]
    for piece in waiting:
        if piece.slow_m_s <= speed <= piece.fast_m_s:
            waiting.remove(piece)
            return piece
    if speed < waiting[0].slow_m_s:
        return ACCELERATE if rich or speed < 6.0 else GENTLY
    return BRAKE if rich else EASE


def _distribute(torque: Array, peak: float, style: Style, rng: Generator) -> Array:
    """To four wheels: motors with a front share and up to their peak, brakes with their own."""
    front = rng.choice(style.drive_front)
    share = np.where(torque < 0.0, style.brake_front, front)
    wheels = 2.0 * torque[:, None] * np.column_stack([share, share, 1.0 - share, 1.0 - share])
    return np.minimum(wheels, peak)


def drive(
    car: Car, world: World, rich: bool, duration_s: float, rng: Generator, style: Style = BRISK
) -> Drive:
    """Drive the real car.

    Parameters
    ----------
    car : Car
        As its maker describes it: what the driver knows.
    world : World
        As it really is.
    rich : bool
        Everything up to the tyre's limit, or calm cruising.
    duration_s : float
        Length of the drive [s].
    rng : Generator
        What the driver feels like.
    style : Style
        What he is like.

    Raises
    ------
    UndrivableError
        The car all but stops: the world is none that can be driven.
    """
    steps = round(duration_s / COMMAND_STEP_S / LOOK) * LOOK
    command = np.zeros((steps + 1, 4))
    path = np.zeros((steps * ROWS_PER_COMMAND + 1, N + 1))
    speed = rng.uniform(8.0, 20.0) if rich else rng.uniform(10.0, 24.0)
    y = begin(
        world.physics, rng.uniform(0.0, 20.0), speed, np.full(4, speed / world.physics.radius), 0.0, command
    )
    path[0, :N] = y
    at, waiting = 0, list[Piece]()
    while at < steps:
        piece = _next_piece(waiting, style, rich, y[V], rng)
        plan = _distribute(piece.torque(car, rng), car.motor_peak_torque_nm, style, rng)
        patience = rng.uniform(*piece.patience_s)
        at = _perform(world, plan, patience, at, y, command, path)
        if y[V] < 0.5 * SLOWEST_M_S:
            raise UndrivableError(f"the car all but stops {at * COMMAND_STEP_S:.1f} s into the drive")
    path[0, N] = path[1, N]
    return Drive(path, command)


def _perform(
    world: World, plan: Array, patience_s: float, at: int, y: Array, command: Array, path: Array
) -> int:
    """Drive one piece from command step `at` on; returns the step reached. `y`, `command` and `path` are filled in."""
    steps = len(command) - 1
    done, sliding_s = 0, 0.0
    while done < len(plan) and at < steps:
        chunk = plan[done : done + LOOK]
        command[at + 1 : at + 1 + LOOK] = np.vstack([chunk, np.repeat(chunk[-1:], LOOK - len(chunk), axis=0)])
        integrate(
            world.physics, y, at * ROWS_PER_COMMAND, LOOK * ROWS_PER_COMMAND, world.split, command, path
        )
        at, done = at + LOOK, done + LOOK
        rims = y[W : W + 4] * world.physics.radius
        sliding_s += LOOK * COMMAND_STEP_S * bool(np.max(np.abs(rims - y[V])) > 0.15 * y[V])
        pushes = plan[min(done, len(plan) - 1)].sum()
        out_of_range = (y[V] < SLOWEST_M_S and pushes <= 0.0) or (y[V] > FASTEST_M_S and pushes >= 0.0)
        if sliding_s > patience_s or out_of_range:
            release = command[at] * np.linspace(1.0, 0.0, 11)[1:, None]
            plan = np.vstack([plan[:done], release])
            sliding_s, patience_s = 0.0, np.inf
            if len(plan) == done + len(release) and not command[at].any():
                return at
    return at
