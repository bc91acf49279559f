"""A world: a car on a road with whatever deviates from its simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .car import Car, Road
from .details import FLOOR_M_S, spread
from .falling import EXPONENTIAL
from .kernel import GRAVITY, RECORD_STEP_S
from .physics import Physics
from .sensor_set import Sensors
from .tyre import MAGIC, THETA_GRID, peaks

Array = NDArray[np.floating[Any]]
Parameters = dict[str, float]

PITCH_S = 0.0005
"""How late the loads follow the acceleration, in place of an implicit loop. 4 ms would show in a locking wheel."""
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
        lightest = p.inertia - abs(p.inertia_tilt) - abs(p.inertia_side) - p.motor_inertia
        if p.inertia_sides != 0.0:  # which may cancel the others at the lightest wheel
            left = np.array([1.0, -1.0, 1.0, -1.0]) * p.inertia_sides
            more = [spread(-p.inertia_tilt, p.inertia_side, w) + left[w] for w in range(4)]
            lightest = p.inertia + min(more) - p.motor_inertia
        lightest -= abs(p.inertia_speed)
        wheel = p.radius**2 / lightest + 4.0 / p.mass
        stiffness = max(p.stiffness_drive, p.stiffness_brake) + abs(p.stiffness_load) + abs(p.stiffness_tilt)
        stiffness += abs(p.stiffness_side) + abs(p.stiffness_warm) + abs(p.stiffness_speed)
        stiffness += abs(p.stiffness_texture) + abs(p.stiffness_wet) + abs(p.stiffness_sides)
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
    front = car.wheelbase_m - car.cog_to_rear_axle_m
    modelled = car.modelled
    height = modelled.get("load_transfer", {}).get("cog_height_m", 0.0)
    area = modelled.get("aero_drag", {}).get("drag_area_m2", 0.0)
    coefficient = modelled.get("rolling_resistance", {}).get("coefficient", 0.0)
    return World(
        Physics(
            mass=car.mass_kg,
            front_arm=front,
            rear_arm=car.cog_to_rear_axle_m,
            cog_height=height,
            height_jack=0.0,
            pitch_time=PITCH_S,
            springs_share=0.0,
            springs_time=1.0,
            springs_tilt=0.0,
            springs_rub=0.0,
            pitch_sign=0.0,
            pitch_stops=0.0,
            body_rate=0.0,
            load_side=0.0,
            radius=car.wheel_radius_m,
            radius_tilt=0.0,
            radius_growth=0.0,
            radius_side=0.0,
            radius_sides=0.0,
            radius_warm=0.0,
            radius_load=0.0,
            radius_wet=0.0,
            out_of_round=0.0,
            lever=1.0,
            inertia=car.wheel_inertia_kg_m2,
            inertia_tilt=0.0,
            inertia_side=0.0,
            inertia_sides=0.0,
            inertia_speed=0.0,
            stiffness_drive=car.stiffness_n,
            stiffness_brake=car.stiffness_n,
            stiffness_load=0.0,
            stiffness_tilt=0.0,
            stiffness_side=0.0,
            stiffness_sides=0.0,
            stiffness_warm=0.0,
            stiffness_speed=0.0,
            stiffness_texture=0.0,
            stiffness_wet=0.0,
            factor_left=1.0,
            factor_right=1.0,
            patch_depth=0.0,
            stretch_depth=0.0,
            blotches=np.zeros(0),
            grip_tilt=0.0,
            grip_speed=0.0,
            grip_warm=0.0,
            grip_sway=0.0,
            grip_wet=0.0,
            grip_sign=0.0,
            grip_slide=0.0,
            grip_load=0.0,
            grip_axles=0.0,
            wet_fall=0.0,
            falloff=0.0,
            falloff_floor=1.0,
            falloff_curve=EXPONENTIAL,
            falloff_time=0.0,
            falloff_wet=0.0,
            relaxation=0.0,
            relaxation_load=False,
            relaxation_shrinks=False,
            relaxation_speed=0.0,
            relaxation_tilt=0.0,
            relaxation_side=0.0,
            relaxation_warm=0.0,
            relaxation_direct=0.0,
            relaxation_rise=0.0,
            force_relaxation=0.0,
            foreign_share=0.0,
            foreign_curve=MAGIC,
            foreign_first=1.45,
            foreign_second=0.0,
            peak=np.zeros(THETA_GRID.size),
            heating=0.0,
            cooling=0.0,
            drag=0.5 * AIR_KG_M3 * area,
            drag_height=0.0,
            fanning=0.0,
            drag_fast=0.0,
            drag_cross=0.0,
            drag_wake=0.0,
            drag_power=0.0,
            drag_shelter=0.0,
            drag_nod=0.0,
            bend_drag=0.0,
            lift=0.0,
            gust_drag=0.0,
            wind=np.zeros(2),
            roll_force=0.0,
            roll_moment=coefficient,
            roll_growth=0.0,
            roll_linear=0.0,
            roll_wet=0.0,
            roll_texture=0.0,
            roll_tilt=0.0,
            roll_side=0.0,
            roll_load=0.0,
            roll_warm=0.0,
            roll_torque=0.0,
            roll_slow=0.0,
            roll_flat=0.0,
            gravel=0.0,
            slush=0.0,
            brake_drag=0.0,
            brake_share=np.ones(4),
            brake_pulse=0.0,
            brake_release=0.0,
            brake_warm=0.0,
            brake_wet=0.0,
            brake_texture=0.0,
            bearing=0.0,
            grade=0.0,
            wave_slope=0.0,
            wave_length=1.0,
            profile=np.zeros(0),
            delay=0.0,
            delay_tilt=0.0,
            delay_sign=0.0,
            delay_turn=0.0,
            delay_jump=0.0,
            delay_speed=0.0,
            delay_warm=0.0,
            message=0.0,
            message_joined=False,
            message_lost=0.0,
            beat=0.0,
            wait=0.0,
            stall=0.0,
            lag=0.0,
            lag_first=0.0,
            lag_sign=0.0,
            lag_damping=0.0,
            lag_tilt=0.0,
            lag_side=0.0,
            lag_rise=0.0,
            lag_speed=0.0,
            lag_load=0.0,
            lag_direct=0.0,
            lag_zero=0.0,
            lag_warm=0.0,
            lag_tail=0.0,
            lag_slow=1.0,
            actuator_play=0.0,
            slew=0.0,
            gain=np.ones(4),
            gain_sign=0.0,
            gain_speed=0.0,
            gain_load=0.0,
            gain_warm=0.0,
            gain_map=0.0,
            gain_sway=0.0,
            gain_turn=0.0,
            gain_power=0.0,
            axle_share=0.0,
            axle_split=0.0,
            axle_viscous=0.0,
            pad_rise=0.0,
            regen_fade=1.0,
            regen_lost=0.0,
            slip_allowed=1.0,
            slip_cut=0.0,
            dead_band=0.0,
            torque_step=0.0,
            torque_limit=1e9,
            power=0.0,
            notch=0.0,
            notch_rad_s=1.0,
            derating=0.0,
            ripple=0.0,
            ripple_order=1.0,
            shaft_stiffness=1.0,
            shaft_damping=0.0,
            shaft_play=0.0,
            shaft_tilt=0.0,
            shaft_axles=0.0,
            shaft_friction=0.0,
            shaft_rise=0.0,
            shaft_sign=0.0,
            shaft_turn=0.0,
            shaft_warm=0.0,
            motor_inertia=0.0,
            slosh_share=0.0,
            slosh_rate=1.0,
            border=np.array(road.start_m),
            border_blur=0.0,
            mu_left=np.array(road.mu),
            mu_right=np.array(road.mu),
        )
    )


def with_magic(world: World, share: float, shape: float, curvature: float) -> World:
    """With a tyre that is the magic formula to `share`: same initial slope, same peak."""
    return with_foreign(world, MAGIC, share, shape, curvature)


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
