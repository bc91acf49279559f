"""Whether an estimate is known: whether its interval can tell dry road from snow, and whether it has an upper end."""

from __future__ import annotations

from typing import Any

import numpy as np

from trpac_core.estimator_data import Method, Source
from trpac_core.robust.interval import HIGH_SHARE
from trpac_core.tyre import GREATEST_THETA
from trpac_core.vision.classes import CLASS_THETA, Surface

SLIPPERY, DRY = CLASS_THETA[Surface.SNOW_ICE], CLASS_THETA[Surface.DRY]
WIDEST = DRY - SLIPPERY
"""Width of an interval above which an estimate is not known: the distance of dry road from snow and ice, by the values
that the estimator has for these classes [-]."""
AT_THE_END = GREATEST_THETA - 0.005
"""Value from which an estimate is at the end of its range: it rounds to the greatest value that TRPAC has [-]."""
OPEN = (1.0 + HIGH_SHARE) * AT_THE_END
"""Upper bound from which the interval of `robust` has no upper end: the greatest TRPAC, moved outwards [-]."""
BY_SOURCE = {
    Source.NONE: "the friction in use",
    Source.TYRE: "the friction in use",
    Source.CAMERA: "the camera",
    Source.BOTH: "the friction in use and the camera",
}
"""What a lower bound comes from."""


def interval(method: Method, theta: Any, std: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """The 95 % interval of estimates: its own for `robust`, two deviations to either side, from 0, for the others."""
    return (low, high) if method is Method.ROBUST else (np.maximum(theta - 2.0 * std, 0.0), theta + 2.0 * std)


def is_narrow(low: Any, high: Any) -> Any:
    """Whether these intervals can tell dry road from snow."""
    return high - low <= WIDEST


def is_lower_bound(theta: Any, low: Any, high: Any, source: Any) -> Any:
    """Whether only a lower bound is known: the interval is narrow because TRPAC has a greatest value.

    So it is where the value or the upper bound is at the end of the range, and where neither tyre nor camera has shown
    the road but the friction in use excludes low values.
    """
    end = np.where(source == Source.NONE, GREATEST_THETA, OPEN)
    return is_narrow(low, high) & ((theta >= AT_THE_END) | (high >= end))


def is_known(theta: Any, low: Any, high: Any, source: Any) -> Any:
    """Whether estimates with these intervals and sources are known from both sides."""
    return is_narrow(low, high) & np.logical_not(is_lower_bound(theta, low, high, source))


def sentences(theta: float, std: float, low: float, high: float, source: Source) -> list[str]:
    """An estimate with its deviation and interval, and whether it is known."""
    if is_lower_bound(theta, low, high, source):
        return [
            f"at least {low:.2f}, from {BY_SOURCE[source]}.",
            f"No upper bound is known: the estimate reaches the end of its range, a TRPAC of {GREATEST_THETA:g}.",
        ]
    text = f"{theta:.2f}, with standard deviation {std:.2f}"
    if is_known(theta, low, high, source):
        return [f"{text} and 95 % interval {low:.2f} to {high:.2f}."]
    return [
        f"{text}: not known.",
        f"The 95 % interval is {low:.2f} to {high:.2f}, wider than the {WIDEST:.1f} between dry road ({DRY:g}) and "
        f"snow or ice ({SLIPPERY:g}).",
    ]
