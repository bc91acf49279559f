"""Kinds of noise, and loggers, that the fourth family adds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from .recording import MEASURED
from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

SPIKE, SPIKES = 6.0, 0.002
"""Of a switching inverter's spikes: size over the standard deviation, share of the samples."""
SHARED = 0.35
"""Of the variance of the wheels' noise: what shakes all of them."""
BOUNCE_SHARE, BOUNCE_HZ, BOUNCE_DAMPING = 0.05, (1.1, 1.8), 0.3
HOP_SHARE, HOP_HZ, HOP_DAMPING = 0.25, (9.0, 14.0), 0.12
"""Of the body on its springs, of the wheels on their tyres: share of the variance, frequency, damping ratio."""
DIFFERENCED = 0.6
"""Of the variance: what has been differenced, so that it is more the higher the frequency."""
BAND_HZ, BAND_SHARE = (15.0, 35.0), 0.9
"""Corner of a sensor's own filter, and the share of the variance that has passed it; the rest comes after."""
STEPS_DOWN = {
    "torque": 0.05,
    "wheel_speed": 1 / 128,
    "vehicle_speed": 1 / 256,
    "accel": 1 / 128,
    "position": 1 / 200,
}
"""Of a bus that drops what is below a step; half a step is at most a fifth of the best sensor's noise."""
UNITS = {
    "torque": 0.1,
    "wheel_speed": 0.1 * 2.0 * np.pi / 60.0,
    "vehicle_speed": 0.01 / 3.6,
    "accel": 0.001 * 9.80665,
    "position": 0.01,
}
"""Last digits of a log in rpm, km/h and g, in this one's units."""
OVERRUNS, OVERRUN_S = 4, (0.02, 0.15)
"""How often a logger cannot keep up, and how long."""


def spiking(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, with spikes, shape (m, 6)."""
    values = noise_of(noise, time_s, rng) / noise.sigmas
    spikes = rng.choice([-SPIKE, SPIKE], values.shape) * (rng.random(values.shape) < SPIKES)
    return (values + spikes) / np.sqrt(1.0 + SPIKES * SPIKE**2) * noise.sigmas


def shaking_together(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, of the four wheels in part the same, shape (m, 6)."""
    values = noise_of(noise, time_s, rng)
    common = noise_of(noise, time_s, rng)[:, :1]
    values[:, :4] = np.sqrt(1.0 - SHARED) * values[:, :4] + np.sqrt(SHARED) * common
    return values


def _resonance(time_s: Array, hertz: float, damping: float, rng: Generator) -> Array:
    """Noise of a mass on a spring whose base is shaken, of size 1, shape (m,)."""
    step = float(np.median(np.diff(time_s)))
    decay = damping * 2.0 * np.pi * hertz * step
    turn = np.sqrt(1.0 - damping**2) * 2.0 * np.pi * hertz * step
    filtered = [1.0, -2.0 * np.exp(-decay) * np.cos(turn), np.exp(-2.0 * decay)]
    lead = round(8.0 / decay)
    gain = np.sqrt(np.sum(lfilter([1.0], filtered, np.arange(lead) == 0) ** 2))
    return np.asarray(lfilter([1.0], filtered, rng.standard_normal(time_s.size + lead))[lead:] / gain)


def bouncing(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part an uneven road's: the body bounces and the wheels hop, shape (m, 6)."""
    values = noise_of(noise, time_s, rng) / noise.sigmas
    for reading in range(6):
        bounce = _resonance(time_s, rng.uniform(*BOUNCE_HZ), BOUNCE_DAMPING, rng)
        hop = _resonance(time_s, rng.uniform(*HOP_HZ), HOP_DAMPING, rng)
        shakes = np.sqrt(BOUNCE_SHARE) * bounce + np.sqrt(HOP_SHARE) * hop
        values[:, reading] = np.sqrt(1.0 - BOUNCE_SHARE - HOP_SHARE) * values[:, reading] + shakes
    return values * noise.sigmas


def differenced(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and most of it the difference of a place's noise from row to row, shape (m, 6)."""
    place = rng.standard_normal((time_s.size + 1, 6))
    fast = np.diff(place, axis=0) / np.sqrt(2.0) * noise.sigmas
    return np.sqrt(1.0 - DIFFERENCED) * noise_of(noise, time_s, rng) + np.sqrt(DIFFERENCED) * fast


def band_limited(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """What a sensor's filter lets through, each its own, and a little white noise after it, shape (m, 6)."""
    rate = 1.0 / float(np.median(np.diff(time_s)))
    values = noise_of(replace(noise, coloured_share=0.0), time_s, rng) / noise.sigmas
    lead = int(rate)
    for reading in range(6):
        filtered = butter(2, rng.uniform(*BAND_HZ), fs=rate)
        gain = np.sqrt(np.sum(lfilter(*filtered, np.arange(lead) == 0) ** 2))
        passed = lfilter(*filtered, rng.standard_normal(time_s.size + lead))[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - BAND_SHARE) * values[:, reading] + np.sqrt(BAND_SHARE) * passed
    return values * noise.sigmas


def _steps(log: pd.DataFrame, steps: dict[str, float]) -> dict[str, float]:
    return {str(c): step for c in log for name, step in steps.items() if name in str(c)}


def truncating(log: pd.DataFrame) -> pd.DataFrame:
    """Values in the steps of `STEPS_DOWN`, what is below a step dropped."""
    return log.assign(**{c: np.floor(log[c] / step) * step for c, step in _steps(log, STEPS_DOWN).items()})


def converted(log: pd.DataFrame) -> pd.DataFrame:
    """Values that were written in other units, with few digits."""
    return log.assign(**{c: np.round(log[c] / step) * step for c, step in _steps(log, UNITS).items()})


def overrunning(log: pd.DataFrame) -> pd.DataFrame:
    """Now and then all that is measured is lost at once, for some hundredths of a second."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    measured = [str(c) for c in log if str(c).startswith(MEASURED)]
    clock = log["time_s"].to_numpy()
    for start in rng.choice(clock, OVERRUNS):
        kept.loc[(clock >= start) & (clock < start + rng.uniform(*OVERRUN_S)), measured] = np.nan
    return kept


NOISES_FOURTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "spiking": spiking,
    "shaking_together": shaking_together,
    "bouncing": bouncing,
    "differenced": differenced,
    "band_limited": band_limited,
}
DIGITS_FOURTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "truncating": truncating,
    "converted": converted,
    "overrunning": overrunning,
}
"""What the fourth family adds."""
