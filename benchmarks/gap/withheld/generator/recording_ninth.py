"""Kinds of noise, and loggers, that the ninth family adds."""

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

TONES_SHARE, TONES_HZ, BEAT_HZ = 0.25, (18.0, 40.0), (0.2, 1.2)
"""Of the variance: two tones of nearly one frequency, as of two pumps or fans; their frequency and its difference."""
SPAN_S = (0.004, 0.025)
"""Over which a sensor takes the mean of what it samples, before it tells it."""
BEFORE_S = (2.0, 9.0)
"""What a triggered recorder keeps of the time before its trigger, which is its zero."""


def beating_tones(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part two tones that swell and fade together, each reading's its own, shape (m, 6)."""
    phases, hertz = rng.uniform(0.0, 2.0 * np.pi, (2, 6)), rng.uniform(*TONES_HZ, 6)
    other = hertz + rng.uniform(*BEAT_HZ, 6)
    turns = 2.0 * np.pi * time_s[:, None]
    tones = np.sin(turns * hertz + phases[0]) + np.sin(turns * other + phases[1])
    rest = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - TONES_SHARE) * rest + np.sqrt(TONES_SHARE) * tones * noise.sigmas


def meaned(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and then the mean over a span of each sensor's own, shape (m, 6)."""
    step, values = float(np.median(np.diff(time_s))), np.empty((time_s.size, 6))
    for reading in range(6):
        rows = max(round(rng.uniform(*SPAN_S) / step), 1)
        white = rng.standard_normal(time_s.size + rows - 1)
        values[:, reading] = np.convolve(white, np.ones(rows), "valid") / np.sqrt(rows)
    return values * noise.sigmas


def slow_place(log: pd.DataFrame) -> pd.DataFrame:
    """A position that comes with every second row; the log has no value between."""
    return every_second(log, "position_m")


def triggered(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped from a trigger on, some of them before it."""
    before = np.round(np.random.default_rng(len(log)).uniform(*BEFORE_S), 3)
    return log.assign(time_s=np.round(log["time_s"] - before, 7))


NOISES_NINTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "beating_tones": beating_tones,
    "meaned": meaned,
}
DIGITS_NINTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "slow_place": slow_place,
    "triggered": triggered,
}
"""What the ninth family adds."""
