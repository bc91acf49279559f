"""What the tests of withheld cars share: cars with one form of an effect, drives, and what their sensors say."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from withheld_plant import CAR, roll

from benchmarks.gap.withheld.generator import kernel
from benchmarks.gap.withheld.generator.car import Car, Road
from benchmarks.gap.withheld.generator.effects import EFFECT_FORMS
from benchmarks.gap.withheld.generator.forms import effect_in
from benchmarks.gap.withheld.generator.kernel import N, V, W, X, integrate
from benchmarks.gap.withheld.generator.outside import OUTSIDE
from benchmarks.gap.withheld.generator.physics import Physics
from benchmarks.gap.withheld.generator.sensor_set import Sensors
from benchmarks.gap.withheld.generator.sensors import read
from benchmarks.gap.withheld.generator.world import World, nominal

NO_COMMAND = np.zeros((2, 4))
DRY, WET = 0.9, 0.5
SLIDING = 0.79 * 9.81
"""Deceleration with locked wheels over the friction [m/s^2]."""


def numbered(items):
    """Parameters without their names in the test's: what the forms are is for the seal to tell."""
    return [pytest.param(item, id=str(i)) for i, item in enumerate(items)]


def forms_of(*effects: str):
    """All forms of effects."""
    return numbered((effect, form) for effect in effects for form in EFFECT_FORMS[effect])


def by_further(name: str, **given: float) -> World:
    return OUTSIDE[name].apply(nominal(CAR, Road()), given)


def with_form(effect: str, form: str, car: Car = CAR, road: Road | None = None, **given: float) -> World:
    return effect_in({effect: form}, effect).apply(nominal(car, road or Road()), given)


def driven(world: World, command: np.ndarray) -> np.ndarray:
    """Path of a car that begins freely rolling at 10 m/s."""
    rows = 10 * (len(command) - 1)
    path = np.zeros((rows + 1, N + 1))
    y = kernel.begin(world.physics, 0.0, 10.0, np.full(4, 10.0 / world.physics.radius), 0.0, command)
    path[0, :N] = y
    integrate(world.physics, y, 0, rows, world.split, command, path)
    return path


@cache
def pulled() -> np.ndarray:
    """Path of the nominal car as it gathers speed for 20 s."""
    return roll(nominal(CAR, Road()), 10.0, 20.0, 50.0)


def reading(path: np.ndarray, sensors: Sensors) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows' times, ideal readings and the sensors', away from the path's ends."""
    at = np.arange(1.0, len(path) * 1e-3 - 1.0, 0.0137)
    return at, read(path, Sensors(), at), read(path, sensors, at)


def slopes(
    p: Physics, slip: float = 0.0, speed: float = 20.0, time: float = 0.0, place: float = 0.0
) -> tuple[np.ndarray, float]:
    """Derivative of a car whose wheels all slip alike, and what an accelerometer reads [m/s^2]."""
    y = kernel.begin(p, 0.0, speed, np.full(4, speed / p.radius), time, NO_COMMAND)
    y[X] = place
    y[W : W + 4] = speed / p.radius / (1.0 - slip)
    dy = np.zeros(N)
    return dy, kernel.slope(p, y, time, NO_COMMAND, dy)


def slip_of(world: World, speed: float, torque: float) -> np.ndarray:
    """Of each wheel after 0.6 s, over its size as the simulation has it [-]."""
    path = roll(world, speed, 0.6, torque)
    rims = path[-1, W : W + 4] * CAR.wheel_radius_m
    return (rims - path[-1, V]) / np.maximum(rims, path[-1, V])


def slowing(world: World, speed: float, at_s: float) -> float:
    """How fast a car that coasts loses speed about a time [m/s^2]."""
    rows = round(at_s * 1000.0)
    path = roll(world, speed, at_s + 0.3)
    return float((path[rows - 200, V] - path[rows + 200, V]) / 0.4)
