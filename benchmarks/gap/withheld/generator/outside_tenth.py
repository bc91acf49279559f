"""Deviations outside the library that the tenth family adds."""

from __future__ import annotations

from numpy.random import Generator

from .car import Car
from .library import Scale, growing, signed
from .world import Effect


def _notch(car: Car, rng: Generator) -> Scale:
    """Of motors that spare a housing's resonance."""
    at = float(rng.uniform(40.0, 75.0))
    return lambda severity: {"at_rad_s": at, "share": 0.01 * 80.0**severity}


WELL_BEYOND: dict[str, Effect] = {
    "torque_notch": Effect(
        _notch, lambda w, g: w.moved(notch=g["share"], notch_rad_s=g["at_rad_s"]), ("powertrain",)
    ),
    # New tyres on one axle and worn ones on the other.
    "unlike_grip_by_axle": Effect(
        signed("front_more", 0.005, 0.3), lambda w, g: w.moved(grip_axles=g["front_more"]), ("tyre", "road")
    ),
    "wheel_speeds_blended": Effect(
        growing("share", 0.02, 0.9),
        lambda w, g: w.sensed(wheel_blend=g["share"]),
        ("wheel_speed_sensor",),
    ),
    # Of a sensor that now and then follows its own echo, or another car.
    "speed_mislocks": Effect(
        signed("share", 0.005, 0.3),
        lambda w, g: w.sensed(speed_mislocks=g["share"]),
        ("vehicle_speed_sensor",),
    ),
    "accelerometer_on_soft_pad": Effect(
        growing("period_s", 0.015, 0.35),
        lambda w, g: w.sensed(accel_period_s=g["period_s"]),
        ("accelerometer",),
    ),
}
"""From the tenth family on."""
