"""Deviations outside the library that the sixth family adds."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from .car import Car
from .library import Scale, growing, signed
from .world import AIR_KG_M3, Effect, Parameters, World


def _head_wind(car: Car, rng: Generator) -> Scale:
    sign, area = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.6, 0.9))
    return lambda severity: {"wind_m_s": sign * 0.7 * 20.0**severity, "drag_area_m2": area}


def _blows(world: World, given: Parameters) -> World:
    """Steadily against the car, or with it; the drag in still air is another effect's."""
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(gust_drag=drag, wind=np.full(2, given["wind_m_s"]))


def _mixed_tyres(world: World, given: Parameters) -> World:
    return world.moved(stiffness_tilt=given["front_more"] * world.physics.stiffness_drive)


def _fading(car: Car, rng: Generator) -> Scale:
    below = float(rng.uniform(7.0, 12.0))
    return lambda severity: {"below_m_s": below, "share": 0.04 * 22.0**severity}


def _blending(world: World, given: Parameters) -> World:
    """The motors brake less below a speed, and the brakes make up for a part of it only."""
    return world.moved(regen_fade=given["below_m_s"] / world.physics.radius, regen_lost=given["share"])


LAST_FURTHER: dict[str, Effect] = {
    "regeneration_fades": Effect(_fading, _blending, ("powertrain",)),
    "torque_dropouts": Effect(
        growing("hold_s", 0.02, 0.7), lambda w, g: w.moved(stall=g["hold_s"]), ("powertrain",)
    ),
    "wheel_speed_dropouts": Effect(
        growing("hold_s", 0.03, 0.8),
        lambda w, g: w.sensed(wheel_hold_s=g["hold_s"]),
        ("wheel_speed_sensor",),
    ),
    "accelerometer_delay": Effect(
        growing("delay_s", 0.008, 0.4), lambda w, g: w.sensed(accel_delay_s=g["delay_s"]), ("accelerometer",)
    ),
    "speed_predicted_ahead": Effect(
        growing("ahead_s", 0.01, 0.4),
        lambda w, g: w.sensed(speed_ahead_s=g["ahead_s"]),
        ("vehicle_speed_sensor",),
    ),
    "head_wind": Effect(_head_wind, _blows, ("vehicle",)),
    "road_map_shifted": Effect(
        signed("shift_m", 0.5, 25.0),
        lambda w, g: w.moved(border=w.physics.border + g["shift_m"]),
        ("road", "tyre"),
    ),
    "unlike_tyres_by_axle": Effect(signed("front_more", 0.04, 0.48), _mixed_tyres, ("tyre",)),
}
"""From the sixth family on."""
