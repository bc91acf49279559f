"""Kinds of noise, and loggers, that the eighth family adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .recording import MEASURED
from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

BOX_SHARE = 0.3
"""Of the variance of speed and acceleration: what both have from the one box that they come from."""
OWN_HZ = (60.0, 120.0)
"""Of sensors that sample by clocks of their own, before a tool has put all on one."""
GAPS, GAP_ROWS = 12, (2, 9)
"""How often a log has lost a few rows of a signal, and how many, before a tool has filled them in."""
CLOCK_S = (20_000.0, 80_000.0)
"""Time of day that a drive begins at."""


def one_box(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and of speed and acceleration in part the same, of either sign, shape (m, 6)."""
    values, common = noise_of(noise, time_s, rng), noise_of(noise, time_s, rng)[:, :1] / noise.sigmas[0]
    alike = common * np.array([1.0, rng.choice([-1.0, 1.0])]) * noise.sigmas[4:]
    values[:, 4:] = np.sqrt(1.0 - BOX_SHARE) * values[:, 4:] + np.sqrt(BOX_SHARE) * alike
    return values


def resampled(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White at each sensor's own rate, on straight lines between its samples, shape (m, 6)."""
    values, gone = np.empty((time_s.size, 6)), time_s - time_s[0]
    for reading in range(6):
        at = gone * rng.uniform(*OWN_HZ) + rng.uniform()
        last = np.floor(at).astype(int)
        part, own = at - last, rng.standard_normal(last[-1] + 2)
        joined = (1.0 - part) * own[last] + part * own[last + 1]
        values[:, reading] = joined / np.sqrt(np.mean((1.0 - part) ** 2 + part**2))
    return values * noise.sigmas


def filled_in(log: pd.DataFrame) -> pd.DataFrame:
    """What was lost, and now and then a few rows of a signal on end, is a straight line."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    measured = [str(c) for c in log if str(c).startswith(MEASURED)]
    for start in rng.integers(1, len(log), GAPS):
        kept.loc[kept.index[start : start + rng.integers(*GAP_ROWS)], rng.choice(measured)] = np.nan
    lines = kept.set_index("time_s")[measured].interpolate(method="index", limit_direction="both")
    return kept.assign(**{column: lines[column].to_numpy() for column in measured})


def by_the_clock(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped by the time of day."""
    begun = np.round(np.random.default_rng(len(log)).uniform(*CLOCK_S), 3)
    return log.assign(time_s=np.round(log["time_s"] + begun, 7))


NOISES_EIGHTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "one_box": one_box,
    "resampled": resampled,
}
DIGITS_EIGHTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "filled_in": filled_in,
    "by_the_clock": by_the_clock,
}
"""What the eighth family adds."""
