"""Road, wheels and motors in their finer points, compiled: each is none while its number in `Physics` is neutral."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .physics import Physics

Array = NDArray[np.floating[Any]]

PATCH_M = 23.0
"""From one patch of the road to the next [m]."""
ROLL_M_S = 17.0
"""Speed that a rolling resistance is stated at where it grows with speed [m/s]."""
USUAL_M_S = 20.0
"""Speed that a deviation is stated at where it changes with speed [m/s]."""
USUAL_RAD_S = 65.0
"""The same of a motor that turns [rad/s]."""
STRETCH_M = 57.0
"""From one resurfaced stretch of the road to the next but one [m]."""
PROFILE_STEP_M = 5.0
"""From one value of a road's profile to the next [m]."""
SMALL_TORQUE_NM, SMALL_M_S2 = 20.0, 0.5
"""About which a direction begins to count: of a torque, of an acceleration."""
WAIT_S = 0.01
"""Cycle of messages that wait for others on a bus, each as long as chance has it."""
CUT_SLIP = 0.08
"""Slip over which a slip controller closes [-]."""
SLIPPERY = 0.75
"""Friction below which a road is wet or worse [-]."""


@njit(cache=True)
def radius_at(p: Physics, wheel: int, speed: float) -> float:
    """Rolling radius of a wheel [m]."""
    radius = p.radius
    if p.radius_tilt != 0.0:
        radius += p.radius_tilt if wheel < 2 else -p.radius_tilt
    if p.radius_growth != 0.0:
        radius += p.radius_growth * ((speed / USUAL_M_S) ** 2 - 1.0)
    return radius


@njit(cache=True)
def profile_at(profile: Array, position: float) -> float:
    """A road's profile, linear between its values and begun anew at its end."""
    at = position / PROFILE_STEP_M
    whole = int(np.floor(at))
    first = profile[whole % profile.size]
    return first + (at - whole) * (profile[(whole + 1) % profile.size] - first)


@njit(cache=True)
def stretched(depth: float, factor: float, at: float) -> float:
    """A friction factor whose deviation goes in stretches [-]."""
    return 1.0 + (factor - 1.0) * (1.0 + depth * np.tanh(4.0 * np.sin(2.0 * np.pi * at / STRETCH_M)))


@njit(cache=True)
def told_friction(p: Physics, wheel: int, position: float) -> float:
    """The road's friction under a wheel, as its file has it [-]."""
    at = position + (p.front_arm if wheel < 2 else -p.rear_arm)
    k = p.border.size - 1
    while k > 0 and p.border[k] > at:
        k -= 1
    return p.mu_left[k] if wheel % 2 == 0 else p.mu_right[k]


@njit(cache=True, inline="always")
def friction(p: Physics, wheel: int, position: float, speed: float) -> float:
    """The road's friction under a wheel, as the real road has it [-]."""
    at = position + (p.front_arm if wheel < 2 else -p.rear_arm)
    k = p.border.size - 1
    while k > 0 and p.border[k] > at:
        k -= 1
    mu = p.mu_left[k] if wheel % 2 == 0 else p.mu_right[k]
    factor = p.factor_left if wheel % 2 == 0 else p.factor_right
    if p.patch_depth > 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + p.patch_depth * np.sin(2.0 * np.pi * at / PATCH_M))
    if p.stretch_depth > 0.0:
        factor = stretched(p.stretch_depth, factor, at)
    if p.wet_fall > 0.0 and mu < SLIPPERY:
        factor *= max(1.0 - p.wet_fall * (speed / USUAL_M_S - 1.0), 0.4)
    return mu * factor


@njit(cache=True)
def rolling_of(p: Physics, wheel: int, position: float, speed: float) -> float:
    """What resists a wheel's rolling over what does so on a dry road at `ROLL_M_S` [-]."""
    rolling = 1.0 + p.roll_linear * (speed / ROLL_M_S - 1.0)
    if p.roll_wet > 0.0 and told_friction(p, wheel, position) < SLIPPERY:
        rolling *= 1.0 + p.roll_wet
    return rolling


@njit(cache=True)
def gain_of(gain: float, sign: float, fast: float, pads: float, torque: float, turning: float) -> float:
    """What a motor or brake gives over what it is told, by direction, speed, and for pads by their bite [-]."""
    if sign != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + sign * np.tanh(torque / SMALL_TORQUE_NM))
    if fast != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + fast * (min(turning / USUAL_RAD_S, 3.0) - 1.0))
    if pads > 0.0 and torque < 0.0:
        gain *= 1.0 + pads * (1.0 - min(turning / USUAL_RAD_S, 2.0))
    return gain


@njit(cache=True)
def wait_of(cycle: float) -> float:
    """How long the message of a cycle has to wait, less the mean, over the longest [-]."""
    seed = np.sin(12.9898 * cycle + 4.137) * 43_758.5453
    return seed - np.floor(seed) - 0.5


@njit(cache=True)
def let_through(p: Physics, torque: float, slip: float) -> float:
    """What a slip controller leaves of a torque that makes a wheel slip [N m]."""
    if torque * slip <= 0.0:
        return torque
    return torque * (1.0 - p.slip_cut * min(max((abs(slip) - p.slip_allowed) / CUT_SLIP, 0.0), 1.0))


@njit(cache=True)
def shaft_of(p: Physics, wheel: int, twist: float, rate: float) -> float:
    """Torque of a shaft whose play is taken up, and of which left and right may differ [N m]."""
    stiffness = p.shaft_stiffness * (1.0 + (p.shaft_tilt if wheel % 2 == 0 else -p.shaft_tilt))
    wound = twist - min(max(twist, -p.shaft_play), p.shaft_play)
    if p.shaft_play > 0.0 and wound == 0.0:
        return 0.0
    return stiffness * wound + p.shaft_damping * rate
