"""Kinds of noise, and loggers, that the fifth family adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

from .recording import every_second
from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

MAINS_HZ, MAINS_SHARE = (49.9, 50.1), 0.2
"""Of a laboratory's supply, and its share of the variance; a slow log folds it to a low frequency."""
POPS_SHARE, POPS_S = 0.1, 0.4
"""Of the variance: what jumps between two levels; how long it stays, in the mean."""
SUPPLY_SHARE = 0.3
"""Of the variance: what all sensors get from the supply that they share."""
STONES_SHARE, STONES_S, STONE_HZ, STONE_DECAY_S = 0.3, 0.6, (12.0, 30.0), 0.08
"""Of the variance: what rings where a wheel hits something; from one to the next, frequency, decay."""
RANGES = {
    "torque": 4000.0,
    "wheel_speed": 250.0,
    "vehicle_speed": 80.0,
    "accel": 60.0,
}
"""Of a converter with `BITS`; half a step is at most four tenths of the best sensor's noise."""
BITS = 14
CHANGES = {"wheel_speed": 0.01, "vehicle_speed": 0.005, "accel": 0.015, "position": 0.005}
"""Less than which a recorder does not write anew: half of the best sensor's noise."""
SLOW_COLUMN = "vehicle_speed_m_s"
"""Of a receiver that is slower than the log."""


def mains(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part the mains' hum, of all readings at one frequency, shape (m, 6)."""
    hertz, phases = rng.uniform(*MAINS_HZ), rng.uniform(0.0, 2.0 * np.pi, 6)
    hum = np.sqrt(2.0) * np.sin(2.0 * np.pi * hertz * time_s[:, None] + phases)
    return (
        np.sqrt(1.0 - MAINS_SHARE) * noise_of(noise, time_s, rng) + np.sqrt(MAINS_SHARE) * hum * noise.sigmas
    )


def popping(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a level that jumps, each reading's at its own moments, shape (m, 6)."""
    step = float(np.median(np.diff(time_s)))
    jumps = rng.random((time_s.size, 6)) < step / POPS_S
    level = rng.choice([-1.0, 1.0], 6) * (1.0 - 2.0 * (np.cumsum(jumps, axis=0) % 2))
    return (
        np.sqrt(1.0 - POPS_SHARE) * noise_of(noise, time_s, rng) + np.sqrt(POPS_SHARE) * level * noise.sigmas
    )


def shared_supply(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part the same in all readings, shape (m, 6)."""
    common = noise_of(noise, time_s, rng)[:, :1] / noise.sigmas[0]
    own = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - SUPPLY_SHARE) * own + np.sqrt(SUPPLY_SHARE) * common * noise.sigmas


def bounded(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and as likely anywhere within its bounds, shape (m, 6)."""
    return np.sqrt(3.0) * rng.uniform(-1.0, 1.0, (time_s.size, 6)) * noise.sigmas


def stones(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part what rings after each of some hits, in all readings at once, shape (m, 6)."""
    step, values = float(np.median(np.diff(time_s))), noise_of(noise, time_s, rng) / noise.sigmas
    lead = round(10.0 * STONE_DECAY_S / step)
    hits = rng.standard_normal(time_s.size + lead) * (rng.random(time_s.size + lead) < step / STONES_S)
    keep = np.exp(-step / STONE_DECAY_S)
    for reading in range(6):
        turn = 2.0 * np.pi * rng.uniform(*STONE_HZ) * step
        filtered = [1.0, -2.0 * keep * np.cos(turn), keep**2]
        gain = np.sqrt(np.sum(lfilter([1.0], filtered, np.arange(lead) == 0) ** 2) * step / STONES_S)
        rings = lfilter([1.0], filtered, hits)[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - STONES_SHARE) * values[:, reading] + np.sqrt(STONES_SHARE) * rings
    return values * noise.sigmas


def converted_in_bits(log: pd.DataFrame) -> pd.DataFrame:
    """Values in the steps of a converter."""
    steps = {str(c): span / 2**BITS for c in log for name, span in RANGES.items() if name in str(c)}
    return log.assign(**{c: np.round(log[c] / step) * step for c, step in steps.items()})


def on_change(log: pd.DataFrame) -> pd.DataFrame:
    """Values that stand until they have changed by as much as `CHANGES`."""
    steps = {str(c): least for c in log for name, least in CHANGES.items() if str(c).startswith(name)}
    return log.assign(**{c: _standing(log[c].to_numpy(), least) for c, least in steps.items()})


def _standing(values: Array, least: float) -> Array:
    kept, last = values.copy(), np.inf
    for i, value in enumerate(values.tolist()):
        if abs(value - last) >= least:
            last = value
        elif value == value:
            kept[i] = last
    return kept


def slow_receiver(log: pd.DataFrame) -> pd.DataFrame:
    """A vehicle speed that comes with every second row; the log has no value between."""
    return every_second(log, SLOW_COLUMN)


NOISES_FIFTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "mains": mains,
    "popping": popping,
    "shared_supply": shared_supply,
    "bounded": bounded,
    "stones": stones,
}
DIGITS_FIFTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "converted_in_bits": converted_in_bits,
    "on_change": on_change,
    "slow_receiver": slow_receiver,
}
"""What the fifth family adds."""
