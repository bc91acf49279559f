"""Ways in which friction falls with the sliding speed, compiled."""

from __future__ import annotations

import numpy as np

from .compiling import compiled

EXPONENTIAL, HYPERBOLIC, SATURATING, STRAIGHT, POWER, LOGARITHMIC, ARCTANGENT, TWO_RATES, ROOTED = range(9)
LINE_AND_TAIL = 9
"""Their codes."""


@compiled
def fallen(curve: int, sliding: float, floor: float) -> float:
    """Share of the friction that is left; `sliding` is the speed times the falloff [-].

    Whatever the curve, it is 1 with the slope -(1 - `floor`) at rest, and `floor` in the end.
    """
    if curve == HYPERBOLIC:
        return floor + (1.0 - floor) / (1.0 + sliding)
    if curve == SATURATING:
        return floor + (1.0 - floor) * (1.0 - np.tanh(sliding))
    if curve == STRAIGHT:
        return 1.0 - (1.0 - floor) * min(sliding, 1.0)
    if curve == POWER:
        return floor + (1.0 - floor) / (1.0 + 0.5 * sliding) ** 2
    if curve == LOGARITHMIC:
        return 1.0 - (1.0 - floor) * min(np.log1p(sliding), 1.0)
    if curve == ARCTANGENT:
        return 1.0 - (1.0 - floor) * 2.0 / np.pi * np.arctan(0.5 * np.pi * sliding)
    if curve == TWO_RATES:
        return floor + (1.0 - floor) * 0.5 * (np.exp(-1.7 * sliding) + np.exp(-0.3 * sliding))
    if curve == ROOTED:
        return floor + (1.0 - floor) / (sliding + np.sqrt(1.0 + sliding * sliding))
    if curve == LINE_AND_TAIL:
        tail = 0.5 * np.exp(1.0 - 2.0 * sliding)
        return floor + (1.0 - floor) * (1.0 - sliding if sliding < 0.5 else tail)
    return floor + (1.0 - floor) * np.exp(-sliding)
