"""Preprocessing of the sensors: filtered readings, slip with what is known of its offset, noise."""

from __future__ import annotations

import math
from typing import NamedTuple

from .estimator_data import EstimatorConfig, EstimatorState, Rates
from .identifiability import WheelInputs
from .sensors import FilteredReadings, Sensors
from .slip import GREATEST_SLIP, Slip, signed_slip

GREATEST_STEP_RATIO = 2.0
"""Most that a step may be longer than the one before for the readings' trend to be trusted over it [-]."""
LOCKED_M_S = 0.5
"""Below this rim speed the wheel of a driving car counts as locked: its brake then holds what the road gives, not the
torque that was commanded [m/s]."""
RELEASED = 5.0
"""Time constants of the sensor filter until it has forgotten a locked wheel's torque to 1 % [-]."""
BIAS_SHARE = 0.5
"""Share of a constant error's deviation that the guard against noise counts [-]. Noise pulls the estimate at each of
its peaks and so adds up; an offset shifts it once, and `TRPAC_std` tells by how much it may."""


class Preprocessed(NamedTuple):
    """What a step makes of the sensors."""

    readings: FilteredReadings
    inputs: WheelInputs
    read_slip: float
    """Signed slip as it is read [-]."""
    lagged_slip: float
    """Signed slip less its offset, filtered once more [-]."""
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
    radius_m: float,
    step_s: float,
    load_n: float,
) -> Preprocessed:
    """What a step makes of the sensors; at the start, and after a gap, they are not filtered."""
    floor_m_s, settled = config.floor_m_s, state.settled
    share = rates.sensor_share if settled else 1.0
    sample = FilteredReadings(sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s)
    readings = state.readings.with_sample(sensors, share) if settled else sample
    omega_ahead, torque_ahead_nm = readings.wheel_speed_rad_s, readings.wheel_torque_nm
    if settled:
        # Signals that go on as they came, where the observer sees them over the step to come.
        ratio = step_s / state.step_s if state.step_s else 0.0
        ahead = rates.ahead * min(ratio, GREATEST_STEP_RATIO)
        omega_ahead += ahead * (readings.wheel_speed_rad_s - state.readings.wheel_speed_rad_s)
        torque_ahead_nm += ahead * (readings.wheel_torque_nm - state.readings.wheel_torque_nm)
    rim_m_s, speed_m_s = readings.wheel_speed_rad_s * radius_m, readings.vehicle_speed_m_s
    if rim_m_s >= floor_m_s:
        torque_ahead_nm -= config.vehicle.rolling_resistance * load_n * radius_m
    read_slip = signed_slip(rim_m_s, speed_m_s, floor_m_s)
    slip, bias_deviation = read_slip, 0.0
    if read_slip or speed_m_s >= floor_m_s:
        calibrated_m_s = max(speed_m_s, floor_m_s)
        slip -= state.calibration.offset(calibrated_m_s)
        curve = config.confidence.tyre_share * read_slip
        offset_deviation = math.sqrt(state.calibration.offset_variance(calibrated_m_s))
        bias_deviation = BIAS_SHARE * math.sqrt(offset_deviation * offset_deviation + curve * curve)
    lagged_slip = state.lagged_slip + share * (slip - state.lagged_slip) if settled else slip
    direction = math.copysign(1.0, slip) if slip else 0.0
    is_locked = sensors.vehicle_speed_m_s > floor_m_s and sensors.wheel_speed_rad_s * radius_m < LOCKED_M_S
    locked_s = 0.0 if is_locked else state.locked_s + step_s
    noise = rates.noise_m_s / max(sensors.vehicle_speed_m_s, floor_m_s)
    inputs = WheelInputs(
        wheel_speed_rad_s=readings.wheel_speed_rad_s,
        wheel_speed_ahead_rad_s=omega_ahead,
        wheel_torque_nm=torque_ahead_nm,
        slip=Slip(min(abs(slip), GREATEST_SLIP), direction),
        load_n=load_n,
        slip_deviation=max(noise, bias_deviation),
        slip_change=abs(slip - lagged_slip),
        way_m=sensors.vehicle_speed_m_s * step_s,
        torque_known=locked_s > RELEASED * config.sensor_filter_s,
        slip_noise=noise,
        slip_bias_deviation=bias_deviation,
        slip_rise=direction * (slip - lagged_slip),
        noise_s=2.0 * config.sensor_filter_s,
    )
    return Preprocessed(readings, inputs, read_slip, lagged_slip, locked_s)
