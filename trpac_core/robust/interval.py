"""What a belief says of the road: mean, deviation, and an interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .arrays import Array
from .belief import Belief

LOW, HIGH = 0.005, 0.965
"""Quantiles that the interval lies between. The lower bound is the more careful one: to claim grip that is not there
costs more than to miss some [-]."""
CLIP = 0.025
"""Quantile below which the point value does not go [-]."""
LOW_SHARE, HIGH_SHARE = 0.14, 0.06
"""Shares by which the bounds move out: mass, torque and load are not better known, and no driving tells. Below, what
the tyre carries is the edge of what is possible, and the truth may lie on it [-]."""


class Interval(NamedTuple):
    """Friction of the road [-]."""

    mean: float
    std: float
    low: float
    high: float
    clip: float
    """The quantile `CLIP`, as the bounds before they move out."""
    unmoved_high: float
    """The upper bound before it moves out."""


def interval(belief: Belief, theta: Array) -> Interval:
    """What the belief says; a bound lies at the next cell outside of its quantile."""
    likely = (belief.road * belief.tyre[:, None]).sum(axis=0)
    cumulated = np.cumsum(likely)
    mean = float((likely * theta).sum())
    variance = float((likely * theta * theta).sum()) - mean * mean
    last = len(theta) - 1
    low = theta[max(int(np.searchsorted(cumulated, LOW, side="right")) - 1, 0)]
    clip = theta[max(int(np.searchsorted(cumulated, CLIP, side="right")) - 1, 0)]
    high = theta[min(int(np.searchsorted(cumulated, HIGH)) + 1, last)]
    return Interval(
        mean,
        max(variance, 0.0) ** 0.5,
        float(low) * (1.0 - LOW_SHARE),
        float(high) * (1.0 + HIGH_SHARE),
        float(clip),
        float(high),
    )
