"""Mean, standard deviation and interval of the road friction under a belief."""

from __future__ import annotations

import math
from typing import NamedTuple

from .arrays import count_below, count_up_to, cumulated, over_rows, total
from .belief import Belief
from .roads import PerCell

LOW, HIGH = 0.005, 0.965
"""Quantiles that the interval lies between. The lower bound is the more careful one: to claim grip that is not there
costs more than to miss some [-]."""
CLIP = 0.025
"""Quantile below which the point value does not go [-]."""
LOW_SHARE, HIGH_SHARE = 0.14, 0.06
"""Shares by which the bounds move out: mass, torque and load are not better known, and driving does not show them.
Below, what the tyre carries is the edge of what is possible, and the truth may lie on it [-]."""


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


def interval(belief: Belief, theta: PerCell) -> Interval:
    """The interval of a belief; a bound lies at the next cell outside of its quantile."""
    likely = over_rows(belief.road * belief.tyre[:, None])
    up_to = cumulated(likely)
    mean = float(total(likely * theta)[0])
    variance = float(total(likely * theta * theta)[0]) - mean * mean
    last = len(theta) - 1
    low = theta[max(count_up_to(up_to, LOW) - 1, 0)]
    clip = theta[max(count_up_to(up_to, CLIP) - 1, 0)]
    high = theta[min(count_below(up_to, HIGH) + 1, last)]
    return Interval(
        mean,
        math.sqrt(max(variance, 0.0)),
        float(low) * (1.0 - LOW_SHARE),
        float(high) * (1.0 + HIGH_SHARE),
        float(clip),
        float(high),
    )
