"""What both estimators are given at a step: filtered readings, slip with what is known of its offset, noise.

In plain numbers from end to end: this runs at each step of each wheel.
"""

from __future__ import annotations

import math

from .estimator_data import EstimatorConfig, EstimatorState, Rates
from .identifiability import WheelInputs
from .sensors import Readings, Sensors
from .slip import GREATEST_SLIP, signed_slip

MOST_AHEAD = 2.0
"""Most that a step may be longer than the one before for the readings' trend to be trusted over it [-]."""
LOCKED_M_S = 0.5
"""Below this rim speed the wheel of a driving car counts as locked: its brake then holds what the road gives, not the
torque that was commanded [m/s]."""
RELEASED = 5.0
"""Time constants of the sensor filter until it has forgotten a locked wheel's torque to 1 % [-]."""

DOUBTED = 0.5
"""Share of a steady doubt that the guard against noise counts [-]. Noise pulls the estimate at each of its peaks and so
adds up; an offset shifts it once, and `TRPAC_std` tells by how much it may."""


_new = tuple.__new__
"""Makes a named tuple of a tuple in a third of the time that its own constructor takes."""


def jumped(before: Readings, sensors: Sensors, radius_m: float, rates: Rates) -> bool:
    """Whether readings are where no car can have gone since: a host that began with zeros, a signal that came back.

    The observers would take such a jump for a force that they forget only slowly.
    """
    omega, _, speed_m_s = before
    speed_m_s -= sensors.vehicle_speed_m_s
    rim_m_s, most_m_s = (omega - sensors.wheel_speed_rad_s) * radius_m, rates.most_rim_m_s
    if not -most_m_s <= rim_m_s <= most_m_s:
        return True
    most_m_s = rates.most_m_s
    return not -most_m_s <= speed_m_s <= most_m_s


def wheel_inputs(
    config: EstimatorConfig,
    rates: Rates,
    state: EstimatorState,
    sensors: Sensors,
    radius_m: float,
    step_s: float,
    load_n: float,
) -> tuple[Readings, WheelInputs, float, float, float]:
    """Filtered readings, what both estimators are given of them, slip as read, smoothed slip, time since locked."""
    omega, torque_nm, speed_m_s = (
        sensors.wheel_speed_rad_s,
        sensors.wheel_torque_nm,
        sensors.vehicle_speed_m_s,
    )
    floor_m_s, way_m, settled = config.floor_m_s, speed_m_s * step_s, state.settled
    locked_s, noise = state.locked_s + step_s, rates.noise_m_s
    if speed_m_s > floor_m_s:
        noise /= speed_m_s
        if omega * radius_m < LOCKED_M_S:
            locked_s = 0.0
    else:
        noise /= floor_m_s
    omega_ahead, torque_ahead_nm, share = omega, torque_nm, 1.0
    if settled:
        share = rates.sensor_share
        before_omega, before_nm, before_m_s = state.readings
        omega = before_omega + share * (omega - before_omega)
        torque_nm = before_nm + share * (torque_nm - before_nm)
        speed_m_s = before_m_s + share * (speed_m_s - before_m_s)
        # Signals that go on as they came, where the observer sees them over the step to come.
        before_s = state.step_s
        ratio = step_s / before_s if before_s else 0.0
        ahead = rates.ahead * (ratio if ratio < MOST_AHEAD else MOST_AHEAD)
        omega_ahead = omega + ahead * (omega - before_omega)
        torque_ahead_nm = torque_nm + ahead * (torque_nm - before_nm)
    rim_m_s = omega * radius_m
    read_slip = signed = signed_slip(rim_m_s, speed_m_s, floor_m_s)
    size = direction = deviation = 0.0
    if read_slip or speed_m_s >= floor_m_s:
        offset, deviation = state.line.offset(speed_m_s if speed_m_s > floor_m_s else floor_m_s)
        curve = config.confidence.tyre_share * read_slip
        deviation = DOUBTED * math.sqrt(deviation * deviation + curve * curve)
        signed = read_slip - offset
        size, direction = (signed, 1.0) if signed > 0.0 else (-signed, -1.0 if signed < 0.0 else 0.0)
        if size > GREATEST_SLIP:
            size = GREATEST_SLIP
    smoothed_slip = signed
    if settled:
        smoothed_slip = state.smoothed_slip
        smoothed_slip += share * (signed - smoothed_slip)
    if rim_m_s >= floor_m_s:
        torque_ahead_nm -= config.vehicle.rolling_resistance * load_n * radius_m
    rise, filter_s = signed - smoothed_slip, config.sensor_filter_s
    inputs = _new(
        WheelInputs,
        (
            omega,
            omega_ahead,
            torque_ahead_nm,
            (size, direction),
            load_n,
            noise if noise > deviation else deviation,
            abs(rise),
            way_m,
            locked_s > RELEASED * filter_s,
            noise,
            deviation,
            direction * rise,
            2.0 * filter_s,
        ),
    )
    return (omega, torque_nm, speed_m_s), inputs, read_slip, smoothed_slip, locked_s
