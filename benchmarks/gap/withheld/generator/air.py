"""What the air takes, compiled: each finer point is none while its number in `Physics` is neutral."""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiling import compiled
from .details import FLOOR_M_S, USUAL_M_S
from .physics import Physics

CROSS_RISE = 3.0
"""By which a drag grows with the square of the angle that the air comes from [1/rad^2]."""
SHUT_M_S = 3.0
"""About a speed within which shutters close [m/s]."""
WAKE_S, BARRIER_M = 10.0, 134.0
"""From one car ahead to the next [s]; from one stretch of road between walls or woods to the next [m]."""
NOD_M_S2 = 3.0
"""About which a body that squats or dives has turned as far as its springs let it [m/s^2]."""


@compiled
def in_wake(share: float, time: float) -> float:
    """Of a drag that is less behind others, and more on a free road [-]."""
    return 1.0 - share * np.tanh(4.0 * np.sin(2.0 * np.pi * time / WAKE_S))


@compiled
def drag_of(fast: float, speed: float) -> float:
    """Of a drag that is another before and after `USUAL_M_S` [-]."""
    return 1.0 + fast * np.tanh((speed - USUAL_M_S) / SHUT_M_S)


@compiled
def sheltered(share: float, at: float) -> float:
    """Of a drag that is less between walls or woods, and more where the wind can reach [-]."""
    return 1.0 - share * np.tanh(4.0 * np.sin(2.0 * np.pi * at / BARRIER_M))


@compiled
def crossed(wind: float, speed: float) -> float:
    """Of a drag in a wind from the side, over that at `USUAL_M_S`: the air is faster and comes askew [-]."""
    now, usual = (wind / max(speed, wind)) ** 2, (wind / USUAL_M_S) ** 2
    return (1.0 + CROSS_RISE * now) * np.sqrt(1.0 + now) / (1.0 + CROSS_RISE * usual) / np.sqrt(1.0 + usual)


@njit(cache=True, inline="always")
def dragging(p: Physics, speed: float, place: float, time: float, pushed: float) -> float:
    """Drag over the square of the speed, of a car whose body its acceleration has `pushed` [kg/m]."""
    drag = p.drag
    if p.drag_fast != 0.0:
        drag *= drag_of(p.drag_fast, speed)
    if p.drag_cross > 0.0:
        drag *= crossed(p.drag_cross, speed)
    if p.drag_wake > 0.0:
        drag *= in_wake(p.drag_wake, time)
    if p.drag_power != 0.0:
        drag *= (max(speed, FLOOR_M_S) / USUAL_M_S) ** p.drag_power
    if p.drag_shelter != 0.0:
        drag *= sheltered(p.drag_shelter, place)
    if p.drag_nod != 0.0:
        drag *= 1.0 + p.drag_nod * np.tanh(pushed / NOD_M_S2)
    return drag
