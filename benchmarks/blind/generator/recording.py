"""How a logger keeps what the sensors say: kinds of noise of one size, and the steps of a column's values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

TAIL = 5.0
"""Degrees of freedom: one sample in 300 beyond four standard deviations, and the spread still settles in a log."""
DRIFT_SHARE, DRIFT_S = 0.06, 3.0
"""Of the variance, and the correlation time: a quarter of the noise is slow, too little to be taken for a bias."""
BUS_STEPS = {
    "torque": 0.5,
    "wheel_speed": 1 / 32,
    "vehicle_speed": 1 / 64,
    "accel": 1 / 32,
    "position": 1 / 32,
}
"""Of signals on a vehicle's bus, each below the noise of a production car's sensor [N m, rad/s, m/s, m/s^2, m]."""


def heavy_tailed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White noise with Student's t distribution, shape (m, 6)."""
    return rng.standard_t(TAIL, (time_s.size, 6)) * np.sqrt(1.0 - 2.0 / TAIL) * noise.sigmas


def drifting(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a drift over seconds, shape (m, 6)."""
    slow = replace(noise, coloured_share=1.0, correlation_s=DRIFT_S)
    fast = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - DRIFT_SHARE) * fast + np.sqrt(DRIFT_SHARE) * noise_of(slow, time_s, rng)


def all_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values as they are."""
    return log


def bus_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values in the steps of `BUS_STEPS`."""
    steps = {str(c): step for c in log for name, step in BUS_STEPS.items() if name in str(c)}
    return log.assign(**{column: np.round(log[column] / step) * step for column, step in steps.items()})


NOISES: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "white_and_coloured": noise_of,
    "heavy_tailed": heavy_tailed,
    "drifting": drifting,
}
DIGITS: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {"all": all_digits, "bus": bus_digits}
