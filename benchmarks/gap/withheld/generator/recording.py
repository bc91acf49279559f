"""How a logger keeps what the sensors say: kinds of noise of one size, and the steps of a column's values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

TAIL = 5.0
"""Degrees of freedom: one sample in 300 beyond four standard deviations, and the spread still settles in a log."""
DRIFT_SHARE, DRIFT_S = 0.06, 3.0
"""Of the variance, and the correlation time: a quarter of the noise is slow, too little to be taken for a bias."""
LOUDER, BURST_S, QUIET_S = 2.0, 0.3, 2.0
"""Of noise in bursts: how much louder, and mean durations."""
FLICKER_SHARE, FLICKER_S = 0.25, (0.02, 0.06, 0.2, 0.6, 2.0)
"""Of the variance, and the correlation times whose sum falls with the frequency."""
WANDERS, WANDER_S = (0.1, 0.3), (1.0, 10.0)
"""Of the standard deviation, and the correlation time."""
WARMTH = (0.1, 0.25)
"""Of the standard deviation."""
HUM_SHARE, HUM_HZ, HUM_DECAY_S = 0.2, (10.0, 35.0), 0.15
"""Of the variance; frequency, and how long a hum rings."""
DECIMALS = {"torque": 1, "wheel_speed": 2, "vehicle_speed": 2, "accel": 2, "position": 2}
"""Of a tool that writes tables."""
REPEATED, RUN_ROWS, RUNS = 0.005, (3, 12), 12
"""Share of samples that a late row repeats; rows of a run of lost ones, and how many runs a log has."""
MEASURED = ("wheel_speed", "vehicle_speed", "accel")
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


def bursting(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading louder for some tenths of a second every few seconds, shape (m, 6)."""
    louder = np.ones((time_s.size, 6))
    for reading in louder.T:
        at = time_s[0] + rng.exponential(QUIET_S)
        while at < time_s[-1]:
            end = at + rng.exponential(BURST_S)
            reading[slice(*np.searchsorted(time_s, [at, end]))] = LOUDER
            at = end + rng.exponential(QUIET_S)
    return noise_of(noise, time_s, rng) * louder / np.sqrt(np.mean(louder**2, axis=0))


def flickering(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and in part with a density that falls with the frequency, shape (m, 6)."""
    white = replace(noise, coloured_share=0.0)
    parts = [replace(noise, coloured_share=1.0, correlation_s=time) for time in FLICKER_S]
    slow = sum(noise_of(part, time_s, rng) for part in parts) / np.sqrt(len(parts))
    return np.sqrt(1.0 - FLICKER_SHARE) * noise_of(white, time_s, rng) + np.sqrt(FLICKER_SHARE) * slow


def wandering(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a drift, each log and reading with its own size and time, shape (m, 6)."""
    values = noise_of(noise, time_s, rng)
    for reading in range(6):
        share = rng.uniform(*WANDERS) ** 2
        slow = replace(noise, coloured_share=1.0, correlation_s=float(np.exp(rng.uniform(*np.log(WANDER_S)))))
        drift = noise_of(slow, time_s, rng)[:, reading]
        values[:, reading] = np.sqrt(1.0 - share) * values[:, reading] + np.sqrt(share) * drift
    return values


def warming(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and what a sensor's warmth adds as it nears its end, none on the whole, shape (m, 6)."""
    gone = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    warmth = np.exp(-gone[:, None] / rng.uniform(0.2, 1.0, 6))
    warmth = (warmth - warmth.mean(axis=0)) / warmth.std(axis=0)
    size = rng.uniform(*WARMTH, 6) * rng.choice([-1.0, 1.0], 6)
    return np.sqrt(1.0 - size**2) * noise_of(noise, time_s, rng) + size * warmth * noise.sigmas


def humming(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part what shakes at a frequency of its own, shape (m, 6)."""
    step = np.median(np.diff(time_s))
    values = noise_of(noise, time_s, rng) / noise.sigmas
    for reading in range(6):
        hertz, keep = rng.uniform(*HUM_HZ), np.exp(-step / HUM_DECAY_S)
        lead = round(10.0 * HUM_DECAY_S / step)
        filtered = [1.0, -2.0 * keep * np.cos(2.0 * np.pi * hertz * step), keep**2]
        gain = np.sqrt(np.sum(lfilter([1.0], filtered, np.arange(lead) == 0) ** 2))
        shakes = lfilter([1.0], filtered, rng.standard_normal(time_s.size + lead))[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - HUM_SHARE) * values[:, reading] + np.sqrt(HUM_SHARE) * shakes
    return values * noise.sigmas


def all_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values as they are."""
    return log


def bus_digits(log: pd.DataFrame) -> pd.DataFrame:
    """Values in the steps of `BUS_STEPS`."""
    steps = {str(c): step for c in log for name, step in BUS_STEPS.items() if name in str(c)}
    return log.assign(**{column: np.round(log[column] / step) * step for column, step in steps.items()})


def decimals(log: pd.DataFrame) -> pd.DataFrame:
    """Values with few decimals."""
    return log.round({str(c): n for c in log for name, n in DECIMALS.items() if name in str(c)})


def _measured(log: pd.DataFrame) -> list[str]:
    return [str(c) for c in log if str(c).startswith(MEASURED)]


def every_second(log: pd.DataFrame, *columns: str) -> pd.DataFrame:
    """With these columns in every second row; the log has no value between."""
    between = np.arange(len(log)) % 2 != 0
    return log.assign(**{column: log[column].mask(between) for column in columns})


def repeating(log: pd.DataFrame) -> pd.DataFrame:
    """A lost sample is the one before; now and then another is too."""
    columns = _measured(log)
    late = np.random.default_rng(len(log)).random((len(log), len(columns))) < REPEATED
    return log.assign(**log[columns].mask(late).ffill().bfill())


def losing_runs(log: pd.DataFrame) -> pd.DataFrame:
    """A signal at a time is lost for a few rows on end."""
    rng, columns, kept = np.random.default_rng(len(log)), _measured(log), log.copy()
    for start in rng.integers(0, len(log), RUNS):
        rows = slice(int(start), int(start + rng.integers(*RUN_ROWS)))
        kept.loc[kept.index[rows], rng.choice(columns)] = np.nan
    return kept


NOISES: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "white_and_coloured": noise_of,
    "heavy_tailed": heavy_tailed,
    "drifting": drifting,
}
DIGITS: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {"all": all_digits, "bus": bus_digits}
"""Of the first two families."""

NOISES_THIRD: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "bursting": bursting,
    "flickering": flickering,
    "wandering": wandering,
    "warming": warming,
    "humming": humming,
}
DIGITS_THIRD: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "decimals": decimals,
    "repeating": repeating,
    "losing_runs": losing_runs,
}
"""What the third adds."""
