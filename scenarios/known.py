"""Whether an estimate is known: whether its interval can tell dry road from snow."""

from __future__ import annotations

from typing import Any

import numpy as np

from trpac_core.estimator_data import Method
from trpac_core.vision.classes import CLASS_THETA, Surface

SLIPPERY, DRY = CLASS_THETA[Surface.SNOW_ICE], CLASS_THETA[Surface.DRY]
WIDEST = DRY - SLIPPERY
"""Width of an interval above which an estimate is not known: the distance of dry road from snow and ice, by the values
that the estimator has for these classes [-]."""


def interval(method: Method, theta: Any, std: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """The 95 % interval of estimates: its own for `robust`, two deviations to either side, from 0, for the others."""
    return (low, high) if method is Method.ROBUST else (np.maximum(theta - 2.0 * std, 0.0), theta + 2.0 * std)


def is_known(low: Any, high: Any) -> Any:
    """Whether estimates with these intervals are known."""
    return high - low <= WIDEST


def sentences(theta: float, std: float, low: float, high: float) -> list[str]:
    """An estimate with its deviation and interval, and whether it is known."""
    text = f"{theta:.2f}, with standard deviation {std:.2f}"
    if is_known(low, high):
        return [f"{text} and 95 % interval {low:.2f} to {high:.2f}."]
    return [
        f"{text}: not known.",
        f"The 95 % interval is {low:.2f} to {high:.2f}, wider than the {WIDEST:.1f} between dry road ({DRY:g}) and "
        f"snow or ice ({SLIPPERY:g}).",
    ]
