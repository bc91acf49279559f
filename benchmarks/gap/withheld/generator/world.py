"""A world: a car on a road with whatever deviates from its simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car, Road
from .details import FLOOR_M_S
from .kernel import GRAVITY, RECORD_STEP_S
from .physics import Physics
from .sensor_set import Sensors
from .tyre import peaks

Array = NDArray[np.floating[Any]]
Parameters = dict[str, float]

AIR_KG_M3 = 1.225
"""Of the standard atmosphere (ISO 2533): the density that a drag area refers to."""


@dataclass(frozen=True)
class World:
    """What moves the car and what its sensors make of it."""

    physics: Physics
    sensors: Sensors = field(default_factory=Sensors)

    def moved(self, **changes: Any) -> World:
        """With other physics."""
        return replace(self, physics=self.physics._replace(**changes))

    def sensed(self, **changes: Any) -> World:
        """With other sensors."""
        return replace(self, sensors=replace(self.sensors, **changes))

    @property
    def split(self) -> int:
        """Integration steps per record that keep the classical Runge-Kutta method well inside its stability (2.78)."""
        p = self.physics
        wheel = p.radius**2 / (p.inertia - p.motor_inertia) + 4.0 / p.mass
        stiffness = (
            max(p.stiffness_drive, p.stiffness_brake) + abs(p.stiffness_tilt) + abs(p.stiffness_texture)
        )
        rate = 1.27 * stiffness * wheel / FLOOR_M_S
        return max(3, int(np.ceil(rate * RECORD_STEP_S / 2.0)))


@dataclass(frozen=True)
class Effect:
    """A deviation: how large it may plausibly be, and what it changes.

    Attributes
    ----------
    at : callable
        Of the car, and of a generator that fixes direction and secondary parameters, to a function of severity,
        0 the least that one would care about and 1 the most that is plausible, to the parameters.
    apply : callable
        World and parameters to the world with it.
    subsystems : tuple of str
        Where it lies; any of them is a right answer.
    """

    at: Callable[[Car, Generator], Callable[[float], Parameters]]
    apply: Callable[[World, Parameters], World]
    subsystems: tuple[str, ...]


def nominal(car: Car, road: Road) -> World:
    """The world as the simulation has it, the effects that it models included."""
    area = car.modelled.get("aero_drag", {}).get("drag_area_m2", 0.0)
    return World(
        Physics(
            mass=car.mass_kg,
            front_arm=car.wheelbase_m - car.cog_to_rear_axle_m,
            rear_arm=car.cog_to_rear_axle_m,
            cog_height=car.modelled.get("load_transfer", {}).get("cog_height_m", 0.0),
            radius=car.wheel_radius_m,
            inertia=car.wheel_inertia_kg_m2,
            stiffness_drive=car.stiffness_n,
            stiffness_brake=car.stiffness_n,
            drag=0.5 * AIR_KG_M3 * area,
            roll_moment=car.modelled.get("rolling_resistance", {}).get("coefficient", 0.0),
            border=np.array(road.start_m),
            mu_left=np.array(road.mu),
            mu_right=np.array(road.mu),
        )
    )


def with_foreign(world: World, curve: int, share: float, first: float = 0.0, second: float = 0.0) -> World:
    """With a tyre that is another curve of `tyre.py` to `share`; `first` and `second` are that curve's parameters."""
    p = world.physics
    return world.moved(
        foreign_share=share,
        foreign_curve=curve,
        foreign_first=first,
        foreign_second=second,
        peak=peaks(p.stiffness_drive, p.mass * GRAVITY / 4.0),
    )
