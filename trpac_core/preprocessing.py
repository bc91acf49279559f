"""What one wheel's observer is given at a step: the readings behind their filter, and the slip of the wheel."""

from __future__ import annotations

import math
from typing import NamedTuple

from .dife import WheelInputs
from .estimator_data import EstimatorConfig, EstimatorState, Rates
from .sensors import FilteredReadings, Sensors
from .slip import GREATEST_SLIP, Slip, signed_slip

GREATEST_STEP_RATIO = 2.0
"""Most that a step may be longer than the one before for the readings' trend to be trusted over it [-]."""
LOCKED_M_S = 0.5
"""Below this rim speed the wheel of a driving car counts as locked: its brake then holds what the road gives, not the
torque that was commanded [m/s]."""
RELEASED = 5.0
"""Time constants of the sensor filter until it has forgotten a locked wheel's torque to 1 % [-]."""


class Preprocessed(NamedTuple):
    """What a step makes of the sensors."""

    readings: FilteredReadings
    inputs: WheelInputs
    lagged_slip: float
    """Signed slip, filtered once more [-]."""
    locked_s: float
    """Time since the wheel was last locked [s]."""


def jumped(before: FilteredReadings, sensors: Sensors, radius_m: float, rates: Rates) -> bool:
    """Whether readings are where no car can have gone since: a host that began with zeros, a signal that came back.

    The observers would take such a jump for a force that they forget only slowly.
    """
    rim_m_s = (before.wheel_speed_rad_s - sensors.wheel_speed_rad_s) * radius_m
    speed_m_s = before.vehicle_speed_m_s - sensors.vehicle_speed_m_s
    return not (abs(rim_m_s) <= rates.most_rim_m_s and abs(speed_m_s) <= rates.most_m_s)


def preprocess(
    config: EstimatorConfig,
    rates: Rates,
    state: EstimatorState,
    sensors: Sensors,
    step_s: float,
    load_n: float,
) -> Preprocessed:
    """What a step makes of the sensors; at the start, and after a gap, they are not filtered."""
    car, floor_m_s = config.vehicle, config.floor_m_s
    readings = FilteredReadings(sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s)
    omega_ahead, torque_ahead_nm = readings.wheel_speed_rad_s, readings.wheel_torque_nm
    if state.settled:
        # Signals that go on as they came, where the observer sees them over the step to come.
        readings = state.readings.with_sample(sensors, rates.sensor_share)
        ratio = step_s / state.step_s if state.step_s else 0.0
        ahead = rates.ahead * min(ratio, GREATEST_STEP_RATIO)
        omega_ahead = readings.wheel_speed_rad_s + ahead * (
            readings.wheel_speed_rad_s - state.readings.wheel_speed_rad_s
        )
        torque_ahead_nm = readings.wheel_torque_nm + ahead * (
            readings.wheel_torque_nm - state.readings.wheel_torque_nm
        )
    rim_m_s = readings.wheel_speed_rad_s * car.wheel_radius_m
    if rim_m_s >= floor_m_s:
        torque_ahead_nm -= car.rolling_resistance * load_n * car.wheel_radius_m
    slip = signed_slip(rim_m_s, readings.vehicle_speed_m_s, floor_m_s)
    lagged_slip = (
        state.lagged_slip + rates.sensor_share * (slip - state.lagged_slip) if state.settled else slip
    )
    direction = math.copysign(1.0, slip) if slip else 0.0
    locked = (
        sensors.vehicle_speed_m_s > floor_m_s and sensors.wheel_speed_rad_s * car.wheel_radius_m < LOCKED_M_S
    )
    locked_s = 0.0 if locked else state.locked_s + step_s
    inputs = WheelInputs(
        readings.wheel_speed_rad_s,
        omega_ahead,
        torque_ahead_nm,
        Slip(min(abs(slip), GREATEST_SLIP), direction),
        load_n,
        torque_known=locked_s > RELEASED * config.sensor_filter_s,
        slip_noise=rates.noise_m_s / max(sensors.vehicle_speed_m_s, floor_m_s),
        slip_rise=direction * (slip - lagged_slip),
        noise_s=2.0 * config.sensor_filter_s,
    )
    return Preprocessed(readings, inputs, lagged_slip, locked_s)
