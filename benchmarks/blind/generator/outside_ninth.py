"""Deviations outside the library that the ninth family adds.

Steps of a torque are those of valves that open in pulses: a few bar each.
"""

from __future__ import annotations

from numpy.random import Generator

from .car import Car
from .library import Scale, growing
from .world import Effect


def _zero_point(car: Car, rng: Generator) -> Scale:
    """Of a converter from pulses to a voltage, which the wheels share."""
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda severity: {"offset_rad_s": sign * 0.05 * 50.0**severity}


STILL_BEYOND: dict[str, Effect] = {
    "torque_in_steps": Effect(
        growing("step_nm", 3.0, 80.0), lambda w, g: w.moved(torque_step=g["step_nm"]), ("powertrain",)
    ),
    "cornering_drag": Effect(
        growing("force_n", 20.0, 900.0),
        lambda w, g: w.moved(bend_drag=g["force_n"]),
        ("vehicle", "tyre", "road"),
    ),
    "wheel_speed_offset": Effect(
        _zero_point,
        lambda w, g: w.sensed(wheel_offset_rad_s=g["offset_rad_s"]),
        ("wheel_speed_sensor",),
    ),
    "speed_tracking_loop": Effect(
        growing("loop_s", 0.02, 0.8),
        lambda w, g: w.sensed(speed_loop_s=g["loop_s"]),
        ("vehicle_speed_sensor",),
    ),
    "accelerometer_fades": Effect(
        growing("time_constant_s", 60.0, 1.0),
        lambda w, g: w.sensed(accel_fades_s=g["time_constant_s"]),
        ("accelerometer",),
    ),
}
"""From the ninth family on."""
