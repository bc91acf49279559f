"""Deviations outside the library that the ninth family adds.

Steps of a torque are those of valves that open in pulses: a few bar each.
"""

from __future__ import annotations

from .library import growing, signed
from .world import Effect

STILL_BEYOND: dict[str, Effect] = {
    "torque_in_steps": Effect(
        growing("step_nm", 3.0, 80.0), lambda w, g: w.moved(torque_step=g["step_nm"]), ("powertrain",)
    ),
    "cornering_drag": Effect(
        growing("force_n", 20.0, 900.0),
        lambda w, g: w.moved(bend_drag=g["force_n"]),
        ("vehicle", "tyre", "road"),
    ),
    # Of a converter from pulses to a voltage, which the wheels share.
    "wheel_speed_offset": Effect(
        signed("offset_rad_s", 0.05, 2.5),
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
