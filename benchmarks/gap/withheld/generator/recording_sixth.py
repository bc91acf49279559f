"""Kinds of noise, and loggers, that the sixth family adds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .recording import every_second
from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

ROUGHER, ROUGH_S, SMOOTH_S = 1.7, 2.0, 3.0
"""Of a rough stretch of road: how much louder all is, and mean durations on and off it."""
SKEW = 6.0
"""Shape of the gamma distribution of a reading that errs further to one side."""
CHIRP_SHARE, CHIRP_HZ, CHIRP_S = 0.15, (15.0, 45.0), (4.0, 9.0)
"""Of the variance: a tone of the drive; the frequencies that it goes between, and the time that it takes."""
OWN_SHARE, OWN_S = (0.1, 0.6), (0.003, 0.03)
"""Of each reading's coloured part: share of the variance, correlation time."""
AXLE_SHARE = 0.4
"""Of the variance of the wheels' noise: what both wheels of an axle have alike."""
TICK_S = 1e-4
"""Of a logger's clock."""
DIGITS_KEPT = {"torque": 4, "wheel_speed": 4, "vehicle_speed": 4, "accel": 3, "position": 5}
"""Of a text that keeps so many figures of each value."""
FRAMES = ("wheel_speed", "vehicle_speed", "accel")
FRAME_LOST = 0.004
"""Messages on the bus, each with its readings; share of them that is lost."""
SPARSE_COLUMN = "accel_x_m_s2"
"""Of a sensor that is slower than the log."""


def rough_stretches(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, all readings louder together where the road is rough, shape (m, 6)."""
    louder, at = np.ones(time_s.size), time_s[0] + rng.exponential(SMOOTH_S)
    while at < time_s[-1]:
        end = at + rng.exponential(ROUGH_S)
        louder[slice(*np.searchsorted(time_s, [at, end]))] = ROUGHER
        at = end + rng.exponential(SMOOTH_S)
    return noise_of(noise, time_s, rng) * (louder / np.sqrt(np.mean(louder**2)))[:, None]


def skewed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, each reading erring seldom and far to one side, often and little to the other, shape (m, 6)."""
    sides = rng.choice([-1.0, 1.0], 6)
    return sides * (rng.gamma(SKEW, 1.0, (time_s.size, 6)) - SKEW) / np.sqrt(SKEW) * noise.sigmas


def chirping(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a tone that goes up and down, each reading with its own phase, shape (m, 6)."""
    low, high = CHIRP_HZ
    turn, start = 2.0 * np.pi / rng.uniform(*CHIRP_S), rng.uniform(0.0, 2.0 * np.pi)
    hertz = 0.5 * (low + high) + 0.5 * (high - low) * np.sin(turn * time_s + start)
    phase = 2.0 * np.pi * np.cumsum(hertz * np.gradient(time_s))
    tone = np.sqrt(2.0) * np.sin(phase[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6))
    rest = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - CHIRP_SHARE) * rest + np.sqrt(CHIRP_SHARE) * tone * noise.sigmas


def own_colours(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading with its own share and correlation time, shape (m, 6)."""
    values = np.empty((time_s.size, 6))
    for reading in range(6):
        correlation = float(np.exp(rng.uniform(*np.log(OWN_S))))
        own = replace(noise, coloured_share=float(rng.uniform(*OWN_SHARE)), correlation_s=correlation)
        values[:, reading] = noise_of(own, time_s, rng)[:, reading]
    return values


def by_axle(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, of the two wheels of an axle in part the same, shape (m, 6)."""
    values, common = noise_of(noise, time_s, rng), noise_of(noise, time_s, rng)[:, [0, 0, 2, 2]]
    values[:, :4] = np.sqrt(1.0 - AXLE_SHARE) * values[:, :4] + np.sqrt(AXLE_SHARE) * common
    return values


def in_ticks(log: pd.DataFrame) -> pd.DataFrame:
    """Rows stamped by a clock with coarse ticks."""
    return log.assign(time_s=np.round(np.round(log["time_s"] / TICK_S) * TICK_S, 7))


def significant_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values with as many figures as `DIGITS_KEPT`."""
    kept = {str(c): n for c in log for name, n in DIGITS_KEPT.items() if name in str(c)}
    return log.assign(**{c: _figures(log[c].to_numpy(), n) for c, n in kept.items()})


def _figures(values: Array, digits: int) -> Array:
    size = np.where(np.isfinite(values) & (values != 0.0), np.abs(values), 1.0)
    step = 10.0 ** (np.floor(np.log10(size)) - digits + 1)
    return np.asarray(np.round(values / step) * step)


def losing_frames(log: pd.DataFrame) -> pd.DataFrame:
    """Now and then a message is lost, with all readings that it carries."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    for frame in FRAMES:
        columns = [str(c) for c in log if str(c).startswith(frame)]
        kept.loc[rng.random(len(log)) < FRAME_LOST, columns] = np.nan
    return kept


def slow_accelerometer(log: pd.DataFrame) -> pd.DataFrame:
    """An accelerometer that comes with every second row; the log has no value between."""
    return every_second(log, SPARSE_COLUMN)


NOISES_SIXTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "rough_stretches": rough_stretches,
    "skewed": skewed,
    "chirping": chirping,
    "own_colours": own_colours,
    "by_axle": by_axle,
}
DIGITS_SIXTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "in_ticks": in_ticks,
    "significant_digits": significant_digits,
    "losing_frames": losing_frames,
    "slow_accelerometer": slow_accelerometer,
}
"""What the sixth family adds."""
