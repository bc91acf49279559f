"""Kinds of noise, and loggers, that the seventh family adds."""

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

YAW_SHARE, YAW_S = 0.15, 0.3
"""Of the variance of the wheels' noise: what small turns of the steering wheel add on one side and take on the other;
their correlation time."""
LOUDER = (0.4, 1.2)
"""By which the noise is more in the end than in the beginning, over its mean: a connector that works loose."""
FRONT, REAR = ("wheel_speed_fl", "wheel_speed_fr"), ("wheel_speed_rl", "wheel_speed_rr")
"""What two messages carry that come in turn."""
WAKING = ("wheel_speed", "vehicle_speed", "accel")
WAKES_S = (0.1, 1.2)
"""Senders that are awake only a while after the logger is."""


def yawing(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and of the wheels in part the slow opposite of the other side's, shape (m, 6)."""
    steering = replace(noise, coloured_share=1.0, correlation_s=YAW_S)
    turns = noise_of(steering, time_s, rng)[:, :1] * np.array([1.0, -1.0, 1.0, -1.0])
    values = noise_of(noise, time_s, rng)
    values[:, :4] = np.sqrt(1.0 - YAW_SHARE) * values[:, :4] + np.sqrt(YAW_SHARE) * turns
    return values


def working_loose(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading's ever louder by its own share, shape (m, 6)."""
    gone = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    louder = 1.0 + rng.uniform(*LOUDER, 6) * (gone[:, None] - 0.5)
    return noise_of(noise, time_s, rng) * louder / np.sqrt(np.mean(louder**2, axis=0))


def in_turns(log: pd.DataFrame) -> pd.DataFrame:
    """Speeds of the front wheels with one row, of the rear ones with the next; the log has no value between."""
    odd = np.arange(len(log)) % 2 != 0
    columns = {str(c): odd for c in log if str(c).startswith(FRONT)}
    columns |= {str(c): ~odd for c in log if str(c).startswith(REAR)}
    return log.assign(**{column: log[column].mask(gone) for column, gone in columns.items()})


def waking(log: pd.DataFrame) -> pd.DataFrame:
    """What a sender measures is not there until it is awake."""
    rng, kept = np.random.default_rng(len(log)), log.copy()
    clock = log["time_s"].to_numpy()
    for sender in WAKING:
        columns = [str(c) for c in log if str(c).startswith(sender)]
        kept.loc[clock < clock[0] + rng.uniform(*WAKES_S), columns] = np.nan
    return kept


NOISES_SEVENTH: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "yawing": yawing,
    "working_loose": working_loose,
}
DIGITS_SEVENTH: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "in_turns": in_turns,
    "waking": waking,
}
"""What the seventh family adds."""
