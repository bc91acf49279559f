"""Deviations outside the library that the seventh family adds."""

from __future__ import annotations

from numpy.random import Generator

from .car import Car
from .library import Scale, growing, signed
from .world import Effect, Parameters, World


def _one_tyre(car: Car, rng: Generator) -> Scale:
    wheel = float(rng.integers(4))
    return lambda severity: {"wheel": wheel, "less_m": car.wheel_radius_m * 0.003 * 15.0**severity}


def _flat(world: World, given: Parameters) -> World:
    """A quarter of it in the mean, and in each way of dividing the wheels in two: three of them cancel."""
    wheel, part = int(given["wheel"]), -0.25 * given["less_m"]
    front, left = (1.0 if wheel < 2 else -1.0), (1.0 if wheel % 2 == 0 else -1.0)
    return world.moved(
        radius=world.physics.radius + part,
        radius_tilt=front * part,
        radius_sides=left * part,
        radius_side=front * left * part,
    )


BEYOND: dict[str, Effect] = {
    "one_tyre_flat": Effect(_one_tyre, _flat, ("tyre", "wheel", "wheel_speed_sensor")),
    "torque_split_shifted": Effect(
        signed("front_more", 0.03, 0.36), lambda w, g: w.moved(axle_split=g["front_more"]), ("powertrain",)
    ),
    "axles_coupled": Effect(
        growing("nm_s_rad", 1.0, 80.0), lambda w, g: w.moved(axle_viscous=g["nm_s_rad"]), ("powertrain",)
    ),
    "accelerometer_bends": Effect(
        signed("per_m_s2", 0.003, 0.06),
        lambda w, g: w.sensed(accel_bend_s2_m=g["per_m_s2"]),
        ("accelerometer",),
    ),
    "speed_rate_limited": Effect(
        growing("limit_m_s2", 9.0, 1.0),
        lambda w, g: w.sensed(speed_rate_m_s2=g["limit_m_s2"]),
        ("vehicle_speed_sensor",),
    ),
    "loose_gravel": Effect(
        growing("coefficient", 0.01, 0.2),
        lambda w, g: w.moved(gravel=g["coefficient"]),
        ("road", "wheel", "vehicle"),
    ),
}
"""From the seventh family on."""
