"""Road, wheels and motors in their finer points, compiled: each is none while its number in `Physics` is neutral."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .compiling import compiled
from .physics import Physics

Array = NDArray[np.floating[Any]]

PATCH_M = 23.0
"""From one patch of the road to the next [m]."""
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
TEXTURE_M = 66.0
"""From one stretch of coarse asphalt to the next [m]."""
GRAVEL_M, GRAVEL_SHARE = 95.0, 0.2
"""From one stretch of loose gravel to the next [m], and the share of the road that has it."""
WEAVE_S = 6.0
"""In which a car goes from side to side of its lane and back."""
HUNT_S, QUEUE_S = 4.2, 2.6
"""In which an estimate of a motor's flux goes to and fro once; from a queue that grows to the one that shrinks."""
LASH_NM = 30.0
"""Torque about which a motor goes through the play of its gears slowly."""
MAP_NM = 100.0
"""Over which a torque map's error goes up and down between its points [N m]."""
GRAIN_M = 78.0
"""The same as an optical sensor sees it [m]."""
USUAL_NM = 150.0
"""Torque that a gain is stated at where it changes with the torque [N m]."""
BENDS_M = 151.0
"""From one winding stretch of the road to the next [m]."""
SEAL_M_S = 8.0
"""Of a seal whose lip begins to float: speed by which its friction has fallen to a third [m/s]."""
JACK_M_S2 = 3.0
"""About which a suspension's links lift or lower the body [m/s^2]."""
RUBS_M_S, SWEEPS_M_S = 0.3, 2.0
"""Sliding speed about which a direction begins to count; by which a tyre has swept off what lies on a road [m/s]."""
STOPS_M_S2 = 4.0
"""About which a body that pitches comes to its springs' stops [m/s^2]."""
FORMING = 0.002
"""Slip still to come about which a contact forms rather than lets go [-]."""
RUB_RAD_S = 0.1
"""About which a joint's friction turns [rad/s]."""
LASH_SHARE = 0.5 * np.sqrt(np.pi) * LASH_NM / USUAL_NM
"""Mean of exp(-(T / `LASH_NM`)^2) over the torques from none to `USUAL_NM` [-]."""


@njit(cache=True, inline="always")
def spread(axles: float, cross: float, wheel: int) -> float:
    """What one wheel has more than the mean: front over rear, and one diagonal over the other."""
    return (axles if wheel < 2 else -axles) + (cross if wheel == 0 or wheel == 3 else -cross)


@compiled
def in_share(p: Physics, tilt: float, wheel: int) -> float:
    """What one wheel has more than the mean by weight at rest [-]."""
    half = 0.5 * (p.front_arm + p.rear_arm)
    return tilt * p.front_arm / half if wheel < 2 else -tilt * p.rear_arm / half


@compiled
def winding(at: float) -> float:
    """1 where a road winds and 0 where it is straight, with clothoids between [-]."""
    return 0.5 + 0.5 * np.tanh(4.0 * np.sin(2.0 * np.pi * at / BENDS_M))


@compiled
def warmth(time: float) -> float:
    """From -1 of what is cold to 1 of what is warm; none on the mean of a drive [-]."""
    return 1.0 - 2.0 * np.exp(-time / WARM_S)


@compiled
def stiffened(p: Physics, time: float, speed: float) -> float:
    """What a warm, fast tyre is stiffer by [N]."""
    return p.stiffness_warm * warmth(time) + p.stiffness_speed * (min(speed / USUAL_M_S, 2.0) - 1.0)


@compiled
def coarse(at: float) -> float:
    """1 on stretches of coarse asphalt and -1 between them [-]."""
    return np.tanh(4.0 * np.sin(2.0 * np.pi * at / TEXTURE_M))


@compiled
def gravelly(at: float) -> float:
    """1 where loose gravel lies and 0 elsewhere, with short ends [-]."""
    off = abs(at / GRAVEL_M - np.floor(at / GRAVEL_M) - 0.5) * GRAVEL_M
    return 0.5 - 0.5 * np.tanh(off - 0.5 * GRAVEL_SHARE * GRAVEL_M)


@njit(cache=True, inline="always")
def braking(p: Physics, wheel: int, place: float, angle: float, turning: float, time: float) -> float:
    """What a brake that is not told to brake takes at a wheel [N m]."""
    drag = p.brake_drag * p.brake_share[wheel]
    if p.brake_pulse > 0.0:
        drag *= 1.0 + p.brake_pulse * np.cos(angle + 1.7 * wheel)
    if p.brake_release > 0.0:
        drag *= released(p.brake_release, turning)
    if p.brake_warm != 0.0:
        drag *= 1.0 + p.brake_warm * warmth(time)
    if p.brake_wet != 0.0 and told_friction(p, wheel, place) < SLIPPERY:
        drag *= 1.0 + p.brake_wet
    if p.brake_texture != 0.0:
        drag *= 1.0 + p.brake_texture * coarse(place + (p.front_arm if wheel < 2 else -p.rear_arm))
    return drag


@compiled
def released(share: float, turning: float) -> float:
    """Of pads that a fast disc knocks back [-]."""
    return 1.0 - share * (min(turning / USUAL_RAD_S, 2.0) - 1.0)


@compiled
def lag_of(p: Physics, wheel: int, turning: float, told: float, given: float) -> float:
    """Of a lag that is another at each wheel, speed or torque, or where torque is built up and let go [-]."""
    lag = (1.0 + spread(p.lag_tilt, p.lag_side, wheel)) * (
        1.0 + p.lag_speed * (min(turning / USUAL_RAD_S, 2.0) - 1.0)
    )
    if p.lag_rise != 0.0:
        lag *= 1.0 + p.lag_rise * np.tanh((abs(told) - abs(given)) / SMALL_TORQUE_NM)
    if p.lag_load != 0.0:
        lag *= 1.0 + p.lag_load * (min(abs(told) / USUAL_NM, 2.0) - 1.0)
    if p.lag_zero != 0.0:
        lag *= 1.0 + p.lag_zero * (np.exp(-((given / LASH_NM) ** 2)) - LASH_SHARE)
    return lag


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
def stretched(depth: float, factor: float, at: float) -> float:
    """A friction factor whose deviation goes in stretches [-]."""
    return 1.0 + (factor - 1.0) * (1.0 + depth * np.tanh(4.0 * np.sin(2.0 * np.pi * at / STRETCH_M)))


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


@compiled
def gripping(p: Physics, rubbing: float, loaded: float = 1.0) -> float:
    """What a friction deviates more by as a tyre drives rather than brakes, sweeps the road, and is pressed on it [-].

    `loaded` is 1 of a quarter of the weight.
    """
    more = p.grip_sign * np.tanh(rubbing / RUBS_M_S)
    if p.grip_load != 0.0:
        more += p.grip_load * (min(loaded, 2.0) - 1.0)
    return more + p.grip_slide * (np.tanh(abs(rubbing) / SWEEPS_M_S) - 0.5)


@njit(cache=True, inline="always")
def friction(
    p: Physics, wheel: int, position: float, speed: float, time: float = 0.0, more: float = 0.0
) -> float:
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
    if p.patch_depth > 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + p.patch_depth * np.sin(2.0 * np.pi * at / PATCH_M))
    if p.stretch_depth > 0.0:
        factor = stretched(p.stretch_depth, factor, at)
    if p.blotches.size > 0:
        factor = 1.0 + (factor - 1.0) * (1.0 + profile_at(p.blotches, at))
    if p.grip_tilt != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + in_share(p, p.grip_tilt, wheel))
    if p.grip_speed != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + p.grip_speed * (min(speed / USUAL_M_S, 2.0) - 1.0))
    if p.grip_warm != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + p.grip_warm * warmth(time))
    if p.grip_sway != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + p.grip_sway * np.sin(2.0 * np.pi * time / WEAVE_S))
    if p.grip_wet != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + (p.grip_wet if mu < SLIPPERY else -p.grip_wet))
    if more != 0.0:
        factor = 1.0 + (factor - 1.0) * (1.0 + more)
    if p.wet_fall > 0.0 and mu < SLIPPERY:
        factor *= max(1.0 - p.wet_fall * (speed / USUAL_M_S - 1.0), 0.4)
    return mu * factor


@compiled
def rolling_of(p: Physics, wheel: int, position: float, speed: float, loaded: float) -> float:
    """What resists a wheel over that on a dry road at `ROLL_M_S`; `loaded` is 1 of a quarter of the weight [-]."""
    rolling = 1.0 + p.roll_linear * (speed / ROLL_M_S - 1.0)
    if p.roll_wet > 0.0 and told_friction(p, wheel, position) < SLIPPERY:
        rolling *= 1.0 + p.roll_wet
    if p.roll_texture > 0.0:
        at = position + (p.front_arm if wheel < 2 else -p.rear_arm)
        rolling *= 1.0 + p.roll_texture * np.tanh(4.0 * np.sin(2.0 * np.pi * at / TEXTURE_M))
    if p.roll_tilt != 0.0:
        rolling *= 1.0 + in_share(p, p.roll_tilt, wheel)
    if p.roll_side != 0.0:
        rolling *= 1.0 + (p.roll_side if wheel % 2 == 0 else -p.roll_side)
    if p.roll_slow != 0.0:
        rolling *= 1.0 + p.roll_slow * (np.exp(-speed / SEAL_M_S) - np.exp(-ROLL_M_S / SEAL_M_S))
    if p.roll_load != 0.0:
        rolling *= max(loaded, 1e-3) ** p.roll_load
    return rolling


@compiled
def gain_of(
    gain: float, sign: float, fast: float, pads: float, hard: float, torque: float, turning: float
) -> float:
    """What a motor or brake gives over what it is told, by direction, speed, torque, and for pads by their bite [-]."""
    if hard != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + hard * (min(abs(torque) / USUAL_NM, 2.0) - 1.0))
    if sign != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + sign * np.tanh(torque / SMALL_TORQUE_NM))
    if fast != 0.0:
        gain = 1.0 + (gain - 1.0) * (1.0 + fast * (min(turning / USUAL_RAD_S, 3.0) - 1.0))
    if pads > 0.0 and torque < 0.0:
        gain *= 1.0 + pads * (1.0 - min(turning / USUAL_RAD_S, 2.0))
    return gain


@compiled
def wait_of(cycle: float) -> float:
    """How long the message of a cycle has to wait, less the mean, over the longest [-]."""
    seed = np.sin(12.9898 * cycle + 4.137) * 43_758.5453
    return seed - np.floor(seed) - 0.5


@compiled
def stalled(duration: float, heard: float) -> float:
    """The time of what a controller goes by that for `duration`, now and then, gets nothing new [s]."""
    cycle = np.floor(heard / STALL_S)
    begun = (cycle + 0.5 + 0.25 * wait_of(cycle)) * STALL_S
    return begun if begun <= heard < begun + duration else heard


@compiled
def queued(jump: float, heard: float, time: float) -> float:
    """The time of what comes through a queue that now holds less, now more; the more it holds, the later [s]."""
    cycle = np.floor(time / QUEUE_S)
    if cycle % 2.0 == 0.0:
        return heard + jump
    return heard + max(-jump, cycle * QUEUE_S - time + jump)


@compiled
def let_through(p: Physics, torque: float, slip: float) -> float:
    """What a slip controller leaves of a torque that makes a wheel slip [N m]."""
    if torque * slip <= 0.0:
        return torque
    return torque * (1.0 - p.slip_cut * min(max((abs(slip) - p.slip_allowed) / CUT_SLIP, 0.0), 1.0))


@compiled
def shaft_of(
    p: Physics, wheel: int, twist: float, rate: float, angle: float = 0.0, time: float = 0.0
) -> float:
    """Torque of a shaft whose play is taken up, whose joints may rub, and which may differ from the others [N m]."""
    stiffness = p.shaft_stiffness * (1.0 + (p.shaft_tilt if wheel % 2 == 0 else -p.shaft_tilt))
    if p.shaft_axles != 0.0:
        stiffness *= 1.0 + spread(p.shaft_axles, 0.0, wheel)
    if p.shaft_turn != 0.0:
        stiffness *= 1.0 + p.shaft_turn * np.cos(2.0 * angle + 1.1 * wheel)
    if p.shaft_warm != 0.0:
        stiffness *= 1.0 + p.shaft_warm * warmth(time)
    if p.shaft_rise != 0.0:
        stiffness *= 1.0 + p.shaft_rise * (np.tanh(stiffness * abs(twist) / USUAL_NM) - 0.5)
    if p.shaft_sign != 0.0:
        stiffness *= 1.0 + p.shaft_sign * np.tanh(stiffness * twist / SMALL_TORQUE_NM)
    wound = twist - min(max(twist, -p.shaft_play), p.shaft_play)
    if p.shaft_play > 0.0 and wound == 0.0:
        return 0.0
    torque = stiffness * wound + p.shaft_damping * rate
    if p.shaft_friction > 0.0:
        torque += p.shaft_friction * np.tanh(rate / RUB_RAD_S)
    return torque
