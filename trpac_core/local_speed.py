"""The speed of the road under each wheel of a turning car, the reference of slip in a curve."""

from __future__ import annotations

import math

from .sensors import PLAUSIBLE
from .vehicle import Vehicle

_FASTEST, _TURNING, _STEERED = (
    PLAUSIBLE[name] for name in ("vehicle_speed_m_s", "yaw_rate_rad_s", "steering_angle_rad")
)


def motion_known(speed_m_s: float, steering_angle_rad: float, yaw_rate_rad_s: float | None) -> bool:
    """Whether the readings of the motion are plausible for a road car."""
    turning = yaw_rate_rad_s or 0.0
    return abs(speed_m_s) <= _FASTEST and abs(steering_angle_rad) <= _STEERED and abs(turning) <= _TURNING


def local_speeds(
    car: Vehicle, speed_m_s: float, steering_angle_rad: float, yaw_rate_rad_s: float | None
) -> tuple[float, float, float, float]:
    """Speed of the road under each wheel, along the wheel: a rigid car that turns about the rear axle's line.

    Parameters
    ----------
    car : Vehicle
        Its track and wheelbase.
    speed_m_s, steering_angle_rad : float
        Of the car, and of its front wheels, left positive [m/s], [rad].
    yaw_rate_rad_s : float or None
        Left positive [rad/s]; without one the steering angle gives the curve.

    Returns
    -------
    tuple of float
        fl, fr, rl, rr [m/s]. Where a reading is unusable: the speed of the car.
    """
    if not motion_known(speed_m_s, steering_angle_rad, yaw_rate_rad_s):
        return (speed_m_s, speed_m_s, speed_m_s, speed_m_s)
    yaw = yaw_rate_rad_s
    if yaw is None:
        yaw = speed_m_s * math.tan(steering_angle_rad) / car.wheelbase_m
    across = 0.5 * yaw * car.track_m
    ahead, aside = math.cos(steering_angle_rad), yaw * car.wheelbase_m * math.sin(steering_angle_rad)
    left, right = speed_m_s - across, speed_m_s + across
    return (left * ahead + aside, right * ahead + aside, left, right)
