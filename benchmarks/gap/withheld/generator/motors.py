"""What the motors are told and give, before their lag, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .commands import commanded, joined
from .details import (
    HUNT_S,
    MAP_NM,
    SMALL_TORQUE_NM,
    USUAL_NM,
    USUAL_RAD_S,
    WAIT_S,
    gain_of,
    queued,
    spread,
    stalled,
    wait_of,
    warmth,
)
from .physics import Physics

Array = NDArray[np.floating[Any]]

BEAT_S = 0.7
"""In which two clocks of nearly the same cycle pass each other once [s]."""
DERATING_S = 12.0
"""In which a motor gets hot [s]."""
NOTCH_RAD_S = 7.0
"""Half of the band of speeds that a motor goes through with less torque [rad/s]."""


@njit(cache=True, inline="always")
def motor_torque(p: Physics, command: Array, wheel: int, time: float, angle: float, turning: float) -> float:
    """What the motor is told after dead time, dead band, limits, gain and ripple, before its lag [N m]."""
    heard = time - p.delay
    if p.delay_tilt != 0.0:
        heard -= spread(p.delay_tilt, 0.0, wheel)
    if p.delay_turn != 0.0:
        heard -= p.delay_turn * (2.0 * wheel / 3.0 - 1.0)
    if p.delay_sign != 0.0:
        heard += p.delay_sign * np.tanh(commanded(command, wheel, heard) / SMALL_TORQUE_NM)
    if p.delay_speed != 0.0:
        heard -= p.delay_speed * (min(USUAL_RAD_S / max(turning, 1.0), 2.0) - 1.0)
    if p.delay_warm != 0.0:
        heard -= p.delay_warm * warmth(time)
    if p.delay_jump > 0.0:
        heard = queued(p.delay_jump, heard, time)
    if p.beat > 0.0:
        heard -= p.beat * (time / BEAT_S - np.floor(time / BEAT_S) - 0.5)
    if p.wait > 0.0:
        heard -= p.wait * wait_of(np.floor(time / WAIT_S))
    if p.stall > 0.0:
        heard = stalled(p.stall, heard)
    if p.message > 0.0 and not p.message_joined:
        sent = np.floor((heard + 0.5 * p.message) / p.message + 1e-9)
        if p.message_lost > 0.0 and wait_of(sent) > 0.5 - p.message_lost:
            sent -= 1.0
        heard = sent * p.message
    torque = commanded(command, wheel, heard)
    if p.axle_share > 0.0:
        torque += p.axle_share * (commanded(command, (wheel + 2) % 4, heard) - torque)
    if p.message > 0.0 and p.message_joined:
        torque = joined(command, wheel, heard, p.message)
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
    if p.gain_warm != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_warm * warmth(time))
    if p.gain_map != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_map * np.sin(2.0 * np.pi * abs(torque) / MAP_NM))
    if p.gain_sway != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_sway * np.sin(2.0 * np.pi * time / HUNT_S))
    if p.gain_turn != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_turn * np.cos(angle + 1.3 * wheel))
    if p.gain_power != 0.0:
        power = abs(torque) * turning / (USUAL_NM * USUAL_RAD_S)
        gain = 1.0 + (gain - 1.0) * (1.0 + p.gain_power * (min(power, 2.0) - 1.0))
    if p.gain_sign != 0.0 or p.gain_speed != 0.0 or p.pad_rise > 0.0 or p.gain_load != 0.0:
        return torque * gain_of(gain, p.gain_sign, p.gain_speed, p.pad_rise, p.gain_load, torque, turning)
    return torque * gain
