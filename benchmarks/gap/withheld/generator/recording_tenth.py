"""Kinds of noise, and loggers, that the tenth family adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .recording import every_second
from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

KEPT_SHARE = 0.2
"""Of a reading's variance: what a converter still holds of the channel that it read before."""
OWN_HZ = (70.0, 140.0)
"""Of sensors whose last sample stands until the next."""
CLOCK_OFF = 2e-4
"""By which a logger's clock may be fast or slow, over the true time."""


def multiplexed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and of each reading in part the one before it, shape (m, 6)."""
    own = noise_of(noise, time_s, rng) / noise.sigmas
    kept = np.roll(own, 1, axis=1)
    return (np.sqrt(1.0 - KEPT_SHARE) * own + np.sqrt(KEPT_SHARE) * kept) * noise.sigmas


def standing(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White at each sensor's own rate, each sample standing until the next, shape (m, 6)."""
    values, gone = np.empty((time_s.size, 6)), time_s - time_s[0]
    for reading in range(6):
        last = np.floor(gone * rng.uniform(*OWN_HZ) + rng.uniform()).astype(int)
        values[:, reading] = rng.standard_normal(last[-1] + 1)[last]
    return values * noise.sigmas


def slow_wheels(log: pd.DataFrame) -> pd.DataFrame:
    """Wheel speeds that come with every second row; the log has no value between."""
    return every_second(log, *(str(c) for c in log if str(c).startswith("wheel_speed")))


def own_clock(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped by a clock that is a little fast or slow."""
    rate = 1.0 + np.random.default_rng(len(log)).uniform(-CLOCK_OFF, CLOCK_OFF)
    return log.assign(time_s=np.round(rate * log["time_s"], 7))


NOISES_TENTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "multiplexed": multiplexed,
    "standing": standing,
}
DIGITS_TENTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "slow_wheels": slow_wheels,
    "own_clock": own_clock,
}
"""What the tenth family adds."""
