"""Deviations outside the library that the eighth family adds."""

from __future__ import annotations

import numpy as np

from .library import growing, signed
from .world import Effect, Parameters, World


def _vectored(world: World, given: Parameters) -> World:
    """A controller hands torque from one side to the other, which the log's command does not tell."""
    return world.moved(
        gain=world.physics.gain * (1.0 + given["left_more"] * np.array([1.0, -1.0, 1.0, -1.0]))
    )


AND_BEYOND: dict[str, Effect] = {
    "torque_vectored": Effect(signed("left_more", 0.01, 0.3), _vectored, ("powertrain",)),
    "road_borders_blurred": Effect(
        growing("over_m", 1.0, 40.0), lambda w, g: w.moved(border_blur=g["over_m"]), ("road", "tyre")
    ),
    "wheel_speed_dies": Effect(
        growing("least_rad_s", 8.0, 40.0),
        lambda w, g: w.sensed(wheel_least_rad_s=g["least_rad_s"]),
        ("wheel_speed_sensor",),
    ),
    "speed_hysteresis": Effect(
        growing("play_m_s", 0.02, 0.6),
        lambda w, g: w.sensed(speed_play_m_s=g["play_m_s"]),
        ("vehicle_speed_sensor",),
    ),
    "accelerometer_in_steps": Effect(
        growing("step_m_s2", 0.1, 1.6),
        lambda w, g: w.sensed(accel_step_m_s2=g["step_m_s2"]),
        ("accelerometer",),
    ),
}
"""From the eighth family on."""
