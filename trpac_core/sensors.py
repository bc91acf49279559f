"""Sensor readings, the reasons that make them unusable, and the filter that all readings pass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

PLAUSIBLE = {
    "wheel_speed_rad_s": 1000.0,
    "wheel_torque_nm": 20_000.0,
    "vehicle_speed_m_s": 150.0,
    "vertical_load_n": 50_000.0,
    "steering_angle_rad": 1.5,
    "longitudinal_acceleration_m_s2": 50.0,
    "yaw_rate_rad_s": 20.0,
}
"""Sizes beyond which a reading of a road car is a fault or in another unit, in the unit of its name."""
_WHEEL_SPEED, _TORQUE, _SPEED, _LOAD, _STEERING, _ACCELERATION, _YAW_RATE = PLAUSIBLE.values()

GREATEST_ACCELERATION_M_S2 = 15.0
"""No road car's tyres give more: a steeper change of speed is a jump of the signal [m/s^2]."""

LONGEST_STEP_S = 10.0
"""Longest step; after a longer one the position is unknown [s]."""
JUMP_M_S, RIM_JUMP_M_S = 1.5, 8.0
"""How far a reading may be from its filter: a bus of 20 Hz at 15 m/s^2, and a wheel that a full brake locks [m/s]."""
RIM_ACCELERATION_M_S2 = 750.0
"""Steepest change of a rim's speed: 3000 N m on 1.2 kg m^2 at 0.3 m [m/s^2]."""


@dataclass(slots=True)  # frozen, its making would take 1 us, four times a step
class Sensors:
    """Sensor readings now. None means not connected; the estimator documents what replaces it.

    Torque is positive where it drives, brakes included; steering angle of the front wheels and yaw rate are
    positive to the left.
    """

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float
    vertical_load_n: float | None = None
    steering_angle_rad: float = 0.0
    longitudinal_acceleration_m_s2: float | None = None
    yaw_rate_rad_s: float | None = None


class FilteredReadings(NamedTuple):
    """The sensors behind their filter."""

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float

    def with_sample(self, sensors: Sensors, share: float) -> FilteredReadings:
        """The readings a step later; `share` is that of the filter, see `filter_share` [-]."""
        omega, torque_nm, speed_m_s = self
        return FilteredReadings(
            omega + share * (sensors.wheel_speed_rad_s - omega),
            torque_nm + share * (sensors.wheel_torque_nm - torque_nm),
            speed_m_s + share * (sensors.vehicle_speed_m_s - speed_m_s),
        )


def filter_share(step_s: float, time_constant_s: float) -> float:
    """Share of the difference to a held value that a first-order filter covers in a step [-]."""
    return 1.0 - math.exp(-step_s / time_constant_s)


class Unusable(IntEnum):
    """What makes the input of a step unusable, NOTHING where it is good; in the order in which it is looked for."""

    NOTHING = 0
    STEP = 1
    READING = 2
    LOAD = 3
    ROLLING_BACK = 4
    TURNING_BACK = 5
    CONFIDENCE = 6


def motion_plausible(sensors: Sensors) -> bool:
    """Whether the readings that place a picture on the road are finite and what a road car gives."""
    yaw_rate = sensors.yaw_rate_rad_s
    return (
        abs(sensors.vehicle_speed_m_s) <= _SPEED
        and abs(sensors.steering_angle_rad) <= _STEERING
        and (yaw_rate is None or abs(yaw_rate) <= _YAW_RATE)
    )


def plausible(sensors: Sensors) -> bool:
    """Whether all readings are finite and what a road car gives."""
    load_n, acceleration = sensors.vertical_load_n, sensors.longitudinal_acceleration_m_s2
    return (
        abs(sensors.wheel_speed_rad_s) <= _WHEEL_SPEED
        and abs(sensors.wheel_torque_nm) <= _TORQUE
        and motion_plausible(sensors)
        and (load_n is None or abs(load_n) <= _LOAD)
        and (acceleration is None or abs(acceleration) <= _ACCELERATION)
    )


def unusable(step_s: float, sensors: Sensors, wheel_radius_m: float, floor_m_s: float) -> Unusable:
    """The reason why the input of a step is unusable.

    A wheel that reads a little below 0 is locked, not reversed: what counts is its speed against the floor.
    """
    if not 0.0 <= step_s <= LONGEST_STEP_S:
        return Unusable.STEP
    if not plausible(sensors):
        return Unusable.READING
    load_n = sensors.vertical_load_n
    if load_n is not None and load_n <= 0.0:
        return Unusable.LOAD
    if sensors.vehicle_speed_m_s < -floor_m_s:
        return Unusable.ROLLING_BACK
    if sensors.wheel_speed_rad_s * wheel_radius_m < -floor_m_s and sensors.vehicle_speed_m_s > floor_m_s:
        return Unusable.TURNING_BACK
    return Unusable.NOTHING


def unusable_text(reason: Unusable, step_s: float, sensors: Sensors, confidence: float) -> str | None:
    """One sentence on what makes a step's input unusable, with the confidence of a class by bus; None for NOTHING."""
    if reason is Unusable.NOTHING:
        return None
    if reason is Unusable.STEP:
        return f"Step size is {step_s} s; expected 0 to {LONGEST_STEP_S:g} s. No time has passed."
    if reason is Unusable.READING:
        bad = [
            f"{name} is {value:g}, expected a number within +-{most:g}"
            for name, most in PLAUSIBLE.items()
            if (value := getattr(sensors, name)) is not None and not abs(value) <= most
        ]
        return f"{'; '.join(bad)}. Check the signal's source and unit."
    if reason is Unusable.LOAD:
        return f"vertical_load_n is {sensors.vertical_load_n:g}: a wheel without load has no friction to estimate."
    if reason is Unusable.ROLLING_BACK:
        return "The car rolls backwards: the camera looks the other way, and the estimate is held."
    if reason is Unusable.TURNING_BACK:
        return "The wheel turns backwards while the car drives forwards; check the sign of wheel_speed_rad_s."
    return f"Class confidence is {confidence}; expected a number between 0 and 1."
