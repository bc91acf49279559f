"""Means of slip and used friction while a wheel stays at one place of the tyre's curve.

White noise blurs one filtered reading by sigma, and a mean over the time t by about sigma / sqrt(1 + t / (2 tau)), with
the filter's constant tau. A mean begins anew wherever slip goes elsewhere: the curve is bent, and a mean over a way
along it would lie beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

ELSEWHERE = 3.0
"""Deviations of a filtered reading from the mean at which the wheel is elsewhere on the curve [-]."""
LEVEL = 2.1
"""How far noise alone takes slip from its own, once more filtered, course, in deviations of the filtered slip: three of
the difference, whose variance is half the slip's [-]."""
MEMORY_S = 0.2
"""Longest memory of a mean [s]."""
FORCE_SETTLES_S = 0.016
"""Time in which the observed force settles after slip moved: 1 / K [s]."""

_LONGEST_S = 2.0 * MEMORY_S
QUICKEST = 2.0
"""Most by which gamma grows with a mean: K must stay well above it [-]."""

_new = tuple.__new__


class Steady(NamedTuple):
    """What has been read since slip stands where it stands."""

    slip: float = 0.0
    """Mean unsigned slip [-]."""
    friction: float = 0.0
    """Mean used friction in its direction [-]."""
    rise: float = 0.0
    """Mean of the slip's way ahead of its own course [-]."""
    held_s: float = 0.0
    """Time since then; 0 where nothing is known [s]."""


NOTHING = Steady()


def held(before: Steady, slip: float, friction: float, rise: float, noise: float, step_s: float) -> Steady:
    """The means after one more reading.

    Parameters
    ----------
    before : Steady
        Means before.
    slip, friction, rise : float
        Unsigned slip, used friction, slip less its own course [-].
    noise : float
        Standard deviation of the filtered slip through noise [-].
    step_s : float
        Step [s].
    """
    mean_slip, mean_friction, mean_rise, held_s = before
    level, away, off = LEVEL * noise, ELSEWHERE * noise, slip - mean_slip
    if held_s == 0.0 or not (-level < rise < level and -away < off < away):
        return _new(Steady, (slip, friction, rise, step_s))
    held_s += step_s
    share = step_s / (held_s if held_s < MEMORY_S else MEMORY_S)
    return _new(
        Steady,
        (
            mean_slip + share * off,
            mean_friction + share * (friction - mean_friction),
            mean_rise + share * (rise - mean_rise),
            held_s,
        ),
    )


def faded(before: Steady, passed_s: float) -> Steady:
    """The means after a time without readings, as if so much less had gone into them; none after their memory."""
    if passed_s == 0.0:
        return before
    held_s = min(before.held_s, _LONGEST_S)
    held_s -= passed_s * max(held_s / MEMORY_S, 1.0)
    return before._replace(held_s=held_s) if held_s > 0.0 else NOTHING


def same_slip(first: Steady, second: Steady) -> bool:
    """Whether both are means of the same slip over the same time, whatever their used friction."""
    return first[0] == second[0] and first[2] == second[2] and first[3] == second[3]


def mean_deviation(steady: Steady, noise: float, noise_s: float, doubt: float) -> float:
    """Standard deviation of the mean slip [-].

    Parameters
    ----------
    steady : Steady
        The means.
    noise, noise_s : float
        That of one filtered reading through noise [-], and twice the filter's time constant [s].
    doubt : float
        Standard deviation of what slip reads too much all the time, which no mean lessens [-].
    """
    # A mean that forgets with a time constant is as sure as an even one over twice that.
    held_s = steady[3]
    if held_s > _LONGEST_S:
        held_s = _LONGEST_S
    return math.sqrt(noise * noise / (1.0 + held_s / noise_s) + doubt * doubt)


def unsettled(before: float, slip_change: float, noise: float, passed_s: float) -> float:
    """How far slip has lately been from its own course, beyond what noise makes, as the force forgets it [-]."""
    left = before * math.exp(-passed_s / FORCE_SETTLES_S)
    return slip_change if slip_change > LEVEL * noise and slip_change > left else left


def quickened(steady: Steady, noise_s: float) -> float:
    """How much quicker the estimate may follow a mean than a reading, with no more noise left in it [-]."""
    factor = 1.0 + steady[3] / noise_s
    return factor if factor < QUICKEST else QUICKEST
