"""What a confidence does that neither blur nor exposure has it do, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.blocks import Blocks
from sim2real.perception.chain import Oddity
from sim2real.perception.confidence import ConfidenceFit
from trpac_core.vision.classes import Surface

Array = NDArray[np.float64]

SIGNAL = "image_confidence"

SHAKEN_SHARE, SHAKEN_BY = 0.3, 0.15
"""Share of the variance of what blur and exposure leave that goes with acceleration, and the fall of the confidence's
logarithm in the hardest twentieth of driving, from which on it does: others were within 0.1 [-]."""
SLOW_SHARE, SLOW_BY = 0.3, 0.15
"""Share of that variance that goes against speed, and the fall of the logarithm from the fastest to the slowest tenth,
from which on the camera is unsure when it is slow [-]."""
SHUNNED_BY, SHUNNED_SHARE = 0.45, 0.15
"""Fall of the logarithm on one class against another, and of the confidence itself, from which on the class is shunned:
nominal chains had up to 0.25, one that is less sure of snow 0.41, and little of a confidence that is low everywhere
[-]."""
FEWEST_OF_CLASS = 5
"""Blocks of a class that can tell."""
CREEPS, CREEPS_BY = 0.6, 0.2
"""Correlation of the confidence's logarithm with time in every log, and its change over a log, from which on it creeps:
chains that nothing disturbs were within 0.3 and 0.07 [-]."""
FEWEST_CREEPING = 10
"""Blocks of a log that can tell."""
RESTLESS = 0.14
"""Standard deviation of the confidence from second to second on one class at one speed, in shares of 1, from
which on it is a gap of its own: chains that nothing disturbs were within 0.15 [-]."""


def odd_pattern(blocks: Blocks, fit: ConfidenceFit, deviation: float) -> Oddity | None:
    """The gap that a confidence is which goes with what no effect has it go; None where it does not.

    Parameters
    ----------
    blocks : Blocks
        Of all logs.
    fit : ConfidenceFit
        What blur and exposure take of them.
    deviation : float
        Of the confidence's logarithm from second to second, on one class at one speed [-].
    """
    taken = fit.loss(blocks)
    # at one speed, but as low as blur and exposure leave it
    loss = blocks.loss - taken + (taken.mean() if len(blocks) else 0.0)
    rest = loss - _levels(loss, blocks)
    return (
        _shaken(rest, blocks)
        or _unsure_when_slow(rest, blocks)
        or _shunned(loss, blocks)
        or _creeping(rest, blocks)
        or _restless(blocks, deviation)
    )


def _levels(loss: Array, blocks: Blocks) -> Array:
    """Mean of each block's class."""
    level = np.zeros(len(blocks))
    for c in np.unique(blocks.classes):
        level[blocks.classes == c] = loss[blocks.classes == c].mean()
    return level


def _shaken(rest: Array, blocks: Blocks) -> Oddity | None:
    """Whether it falls where the car brakes or pulls, for those look alike from within the car."""
    accel = blocks.accel_m_s2
    if len(blocks) < FEWEST_CREEPING or not rest.std() or not accel.std():
        return None
    design = np.column_stack([np.ones(len(blocks)), np.maximum(accel, 0.0), np.maximum(-accel, 0.0)])
    solution, *_ = np.linalg.lstsq(design, rest, rcond=None)
    share = 1.0 - np.var(rest - design @ solution) / np.var(rest)
    hard = float(np.quantile(np.abs(accel), 0.95))
    pulling, braking = hard * solution[1:]
    if share < SHAKEN_SHARE or max(pulling, braking) < SHAKEN_BY:
        return None
    told = (
        f"The confidence falls with acceleration, by a factor of {np.exp(max(pulling, braking)):.1f} at {hard:.1f} "
        f"m/s². This explains {100.0 * share:.0f} % of its variance beside speed and class. Check whether the "
        "camera's bracket is loose."
    )
    return Oddity(SIGNAL, told, "acceleration", "less", "in proportion to its size")


def _unsure_when_slow(rest: Array, blocks: Blocks) -> Oddity | None:
    """Whether it falls where the car is slow, which is the reverse of blur."""
    speed = blocks.speed_m_s
    if len(blocks) < FEWEST_CREEPING or not rest.std() or not speed.std():
        return None
    slope, share = np.polyfit(speed, rest, 1)[0], np.corrcoef(speed, rest)[0, 1] ** 2
    slow, fast = np.quantile(speed, (0.1, 0.9))
    falls_by = -slope * (fast - slow)
    if share < SLOW_SHARE or falls_by < SLOW_BY:
        return None
    told = (
        f"The confidence is lower by a factor of {np.exp(falls_by):.1f} at {slow:.0f} m/s than at {fast:.0f} m/s, "
        "the reverse of blur. Check how the camera depends on speed."
    )
    return Oddity(SIGNAL, told, "speed", "less at low speed", "in proportion to it")


def _shunned(loss: Array, blocks: Blocks) -> Oddity | None:
    level = {
        int(c): float(loss[blocks.classes == c].mean())
        for c in np.unique(blocks.classes)
        if (blocks.classes == c).sum() >= FEWEST_OF_CLASS
    }
    if len(level) < 2:
        return None
    worst, best = max(level, key=lambda c: level[c]), min(level, key=lambda c: level[c])
    low, high = np.exp(-level[worst]), np.exp(-level[best])
    if level[worst] - level[best] < SHUNNED_BY or high - low < SHUNNED_SHARE:
        return None
    names = {int(s): s.label for s in Surface}
    told = (
        f"The confidence is {low:.2f} on {names[worst]} and {high:.2f} on {names[best]}, at the same speed. Check "
        "whether something dazzles or covers the camera there."
    )
    return Oddity(SIGNAL, told, "surface", f"less on {names[worst]}", "a level per surface")


def _creeping(rest: Array, blocks: Blocks) -> Oddity | None:
    changes = []
    for log in np.unique(blocks.log):
        time_s, loss = blocks.time_s[blocks.log == log], rest[blocks.log == log]
        if len(loss) < FEWEST_CREEPING or not loss.std():
            return None
        slope, correlation = np.polyfit(time_s, loss, 1)[0], np.corrcoef(time_s, loss)[0, 1]
        if abs(correlation) < CREEPS:
            return None
        changes.append(slope * np.ptp(time_s))
    if len(changes) < 2 or np.ptp(np.sign(changes)) or np.min(np.abs(changes)) < CREEPS_BY:
        return None
    way = "falls" if changes[0] > 0.0 else "rises"
    told = (
        f"The confidence {way} over every log, by a factor of "
        f"{np.exp(np.median(np.abs(changes))):.1f}, at the same speed and class. Check whether the lens fogs or "
        "the light changes."
    )
    return Oddity(SIGNAL, told, "time", way, "steadily over every log")


def _restless(blocks: Blocks, deviation: float) -> Oddity | None:
    if not len(blocks) or deviation * np.exp(-blocks.loss.mean()) < RESTLESS:
        return None
    told = (
        f"The confidence varies by a factor of {np.exp(deviation):.1f} from second to second, at the same speed "
        "and class. Check whether something covers the lens or shines into it at times."
    )
    return Oddity(SIGNAL, told, "time", "varies", "from second to second")
