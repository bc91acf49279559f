"""What the motors are told and give, before their lag, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .compiling import compiled
from .details import HUNT_S, USUAL_NM, USUAL_RAD_S, spread, stalled
from .physics import Physics

Array = NDArray[np.floating[Any]]

COMMAND_STEP_S = 0.01
DERATING_S = 12.0
"""In which a motor gets hot [s]."""
NOTCH_RAD_S = 7.0
"""Half of the band of speeds that a motor goes through with less torque [rad/s]."""


@compiled
def on_grid(table: Array, at: float) -> float:
    """`table` at `at` steps from its start, linear between, held beyond."""
    if at <= 0.0:
        return table[0]
    i = int(at)
    if i >= table.size - 1:
        return table[-1]
    return table[i] + (at - i) * (table[i + 1] - table[i])


@njit(cache=True, inline="always")
def commanded(command: Array, wheel: int, time: float) -> float:
    return on_grid(command[:, wheel], time / COMMAND_STEP_S)


@njit(cache=True, inline="always")
def motor_torque(p: Physics, command: Array, wheel: int, time: float, angle: float, turning: float) -> float:
    """What the motor is told after dead time, dead band, limits, gain and ripple, before its lag [N m]."""
    heard = time - p.delay
    if p.stall > 0.0:
        heard = stalled(p.stall, heard)
    if p.message > 0.0:
        heard = np.floor((heard + 0.5 * p.message) / p.message + 1e-9) * p.message
    torque = commanded(command, wheel, heard)
    if p.axle_share > 0.0:
        torque += p.axle_share * (commanded(command, (wheel + 2) % 4, heard) - torque)
    if p.axle_split != 0.0:
        torque *= 1.0 + spread(p.axle_split, 0.0, wheel)
    if p.dead_band > 0.0:
        torque = np.sign(torque) * max(abs(torque) - p.dead_band, 0.0)
    if p.torque_step > 0.0:
        torque = p.torque_step * np.trunc(torque / p.torque_step)
    torque = min(max(torque, -p.torque_limit), p.torque_limit)
    if p.power > 0.0:
        torque = min(torque, p.power / max(turning, 1.0))
    if p.notch > 0.0:
        torque *= 1.0 - p.notch * np.exp(-(((turning - p.notch_rad_s) / NOTCH_RAD_S) ** 2))
    if p.derating > 0.0:
        torque *= 1.0 - p.derating * (1.0 - np.exp(-time / DERATING_S))
    if p.ripple > 0.0:
        torque *= 1.0 + p.ripple * np.cos(p.ripple_order * angle)
    if p.regen_lost > 0.0 and torque < 0.0:
        torque *= 1.0 - p.regen_lost * (1.0 - min(turning / p.regen_fade, 1.0))
    gain = p.gain[wheel]
    if p.gain_sway != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_sway * np.sin(2.0 * np.pi * time / HUNT_S))
    if p.gain_power != 0.0:
        power = abs(torque) * turning / (USUAL_NM * USUAL_RAD_S)
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_power * (min(power, 2.0) - 1.0))
    if p.pad_rise > 0.0 and torque < 0.0:
        gain *= 1.0 + p.pad_rise * (1.0 - min(turning / USUAL_RAD_S, 2.0))
    return torque * gain
