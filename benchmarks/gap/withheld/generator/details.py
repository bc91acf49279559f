"""Road, wheels and motors in their finer points, compiled: each is none while its number in `Physics` is neutral."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .compiling import compiled
from .physics import Physics

Array = NDArray[np.floating[Any]]

ROLL_M_S = 17.0
"""Speed that a rolling resistance is stated at where it grows with speed [m/s]."""
FLOOR_M_S = 1.5
"""Below which the drives do not go: the least speed that a slip or a drag coefficient goes by [m/s]."""
USUAL_M_S = 20.0
"""Speed that a deviation is stated at where it changes with speed [m/s]."""
WARM_S = 15.0
"""In which what warms up is warm [s]."""
STALL_S = 1.6
"""From one message that a controller waits for to the next [s]."""
USUAL_RAD_S = 65.0
"""Speed of a motor or wheel that a deviation is stated at where it changes with it [rad/s]."""
PROFILE_STEP_M = 5.0
"""From one value of a road's profile to the next [m]."""
CUT_SLIP = 0.08
"""Slip over which a slip controller closes [-]."""
SLIPPERY = 0.75
"""Friction below which a road is wet or worse [-]."""
TEXTURE_M = 66.0
"""From one stretch of coarse asphalt to the next [m]."""
GRAVEL_M, GRAVEL_SHARE = 95.0, 0.2
"""From one stretch of loose gravel to the next [m], and the share of the road that has it."""
HUNT_S = 4.2
"""In which an estimate of a motor's flux goes to and fro once."""
USUAL_NM = 150.0
"""Torque that a gain is stated at where it changes with the torque [N m]."""
BENDS_M = 151.0
"""From one winding stretch of the road to the next [m]."""
RUBS_M_S = 0.3
"""Sliding speed about which a direction begins to count [m/s]."""
LASH_NM = 30.0
"""Torque about which a motor goes through the play of its gears slowly."""
LASH_SHARE = 0.5 * np.sqrt(np.pi) * LASH_NM / USUAL_NM
"""Mean of exp(-(T / `LASH_NM`)^2) over the torques from none to `USUAL_NM` [-]."""


@njit(cache=True, inline="always")
def spread(axles: float, cross: float, wheel: int) -> float:
    """What one wheel has more than the mean: front over rear, and one diagonal over the other."""
    return (axles if wheel < 2 else -axles) + (cross if wheel == 0 or wheel == 3 else -cross)


@compiled
def winding(at: float) -> float:
    """1 where a road winds and 0 where it is straight, with clothoids between [-]."""
    return 0.5 + 0.5 * np.tanh(4.0 * np.sin(2.0 * np.pi * at / BENDS_M))


@compiled
def warmth(time: float) -> float:
    """From -1 of what is cold to 1 of what is warm; none on the mean of a drive [-]."""
    return 1.0 - 2.0 * np.exp(-time / WARM_S)


@compiled
def coarse(at: float) -> float:
    """1 on stretches of coarse asphalt and -1 between them [-]."""
    return np.tanh(4.0 * np.sin(2.0 * np.pi * at / TEXTURE_M))


@compiled
def gravelly(at: float) -> float:
    """1 where loose gravel lies and 0 elsewhere, with short ends [-]."""
    off = abs(at / GRAVEL_M - np.floor(at / GRAVEL_M) - 0.5) * GRAVEL_M
    return 0.5 - 0.5 * np.tanh(off - 0.5 * GRAVEL_SHARE * GRAVEL_M)


@compiled
def radius_at(p: Physics, wheel: int, speed: float, angle: float) -> float:
    """Rolling radius of a wheel [m]."""
    radius = p.radius
    if p.radius_tilt != 0.0 or p.radius_side != 0.0:
        radius += spread(p.radius_tilt, p.radius_side, wheel)
    if p.radius_sides != 0.0:
        radius += p.radius_sides if wheel % 2 == 0 else -p.radius_sides
    if p.out_of_round > 0.0:
        radius *= 1.0 + p.out_of_round * np.cos(angle + 2.3 * wheel)
    if p.radius_growth != 0.0:
        radius += p.radius_growth * ((speed / USUAL_M_S) ** 2 - 1.0)
    return radius


@compiled
def profile_at(profile: Array, position: float) -> float:
    """A road's profile, linear between its values and begun anew at its end."""
    at = position / PROFILE_STEP_M
    whole = int(np.floor(at))
    first = profile[whole % profile.size]
    return first + (at - whole) * (profile[(whole + 1) % profile.size] - first)


@compiled
def blurred(p: Physics, mus: Array, at: float, k: int) -> float:
    """A friction that goes straight from one segment's to the next one's, over a length about the border [-]."""
    over = p.border_blur
    if k > 0 and at - p.border[k] < 0.5 * over:
        return mus[k - 1] + (mus[k] - mus[k - 1]) * (0.5 + (at - p.border[k]) / over)
    if k < p.border.size - 1 and p.border[k + 1] - at < 0.5 * over:
        return mus[k] + (mus[k + 1] - mus[k]) * (0.5 - (p.border[k + 1] - at) / over)
    return mus[k]


@compiled
def told_friction(p: Physics, wheel: int, position: float) -> float:
    """The road's friction under a wheel, as its file has it [-]."""
    at = position + (p.front_arm if wheel < 2 else -p.rear_arm)
    k = p.border.size - 1
    while k > 0 and p.border[k] > at:
        k -= 1
    return p.mu_left[k] if wheel % 2 == 0 else p.mu_right[k]


@njit(cache=True, inline="always")
def friction(p: Physics, wheel: int, position: float, speed: float, more: float = 0.0) -> float:
    """The road's friction under a wheel, as the real road has it, its deviation `more` than the road's own [-]."""
    at = position + (p.front_arm if wheel < 2 else -p.rear_arm)
    k = p.border.size - 1
    while k > 0 and p.border[k] > at:
        k -= 1
    mu = p.mu_left[k] if wheel % 2 == 0 else p.mu_right[k]
    if p.border_blur > 0.0:
        mu = blurred(p, p.mu_left if wheel % 2 == 0 else p.mu_right, at, k)
    if p.grip_axles != 0.0:
        mu *= 1.0 + spread(p.grip_axles, 0.0, wheel)
    factor = p.factor_left if wheel % 2 == 0 else p.factor_right
    if p.blotches.size > 0:
        factor = 1.0 + (factor - 1.0) * (1.0 + profile_at(p.blotches, at))
    if more != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + more)
    if p.wet_fall > 0.0 and mu < SLIPPERY:
        factor *= max(1.0 - p.wet_fall * (speed / USUAL_M_S - 1.0), 0.4)
    return mu * factor


@compiled
def stalled(duration: float, heard: float) -> float:
    """The time of what a controller goes by that for `duration`, now and then, gets nothing new [s]."""
    cycle = np.floor(heard / STALL_S)
    chance = np.sin(12.9898 * cycle + 4.137) * 43_758.5453
    begun = (cycle + 0.5 + 0.25 * (chance - np.floor(chance) - 0.5)) * STALL_S
    return begun if begun <= heard < begun + duration else heard


@compiled
def let_through(p: Physics, torque: float, slip: float) -> float:
    """What a slip controller leaves of a torque that makes a wheel slip [N m]."""
    if torque * slip <= 0.0:
        return torque
    return torque * (1.0 - p.slip_cut * min(max((abs(slip) - p.slip_allowed) / CUT_SLIP, 0.0), 1.0))
