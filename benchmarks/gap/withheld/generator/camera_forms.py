"""Forms of a camera's chain: what the contract leaves open of how a real system sees, reckons and tells.

Each is an honest reading: none leaves a gap of its own, and none changes what a parameter means.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

STREAK = 4.0
"""Mean length of a streak of errors [results]."""


# --- when pictures are taken


def even(cycle_s: float, n: int, rng: Generator) -> Array:
    """Intervals between pictures [s]."""
    return np.full(n, cycle_s)


def jittered(cycle_s: float, n: int, rng: Generator) -> Array:
    """Of a busy computer."""
    return cycle_s * np.clip(1.0 + 0.12 * rng.standard_normal(n), 0.6, 1.4)


def alternating(cycle_s: float, n: int, rng: Generator) -> Array:
    """Of a camera that takes pictures in pairs."""
    return cycle_s * (1.0 + 0.25 * np.where(np.arange(n) % 2 == 0, 1.0, -1.0))


# --- how long a result takes, as the stamp accounts for


def steady_work(mean_s: float, n: int, rng: Generator) -> Array:
    """Processing time [s]."""
    return np.full(n, mean_s)


def varying_work(mean_s: float, n: int, rng: Generator) -> Array:
    """As many patches as the road shows."""
    return mean_s * np.exp(0.25 * rng.standard_normal(n) - 0.03125)


def waiting_work(mean_s: float, n: int, rng: Generator) -> Array:
    """Now and then another task comes first."""
    return mean_s * np.where(rng.random(n) < 0.06, 2.2, 0.923)


# --- how a delay that the stamp misses differs about its mean


def constant(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Delay of each result [s]."""
    return np.full(n, delay_s)


def scattered(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """From result to result."""
    return delay_s * (1.0 + 0.2 * np.clip(rng.standard_normal(n), -2.5, 2.5))


def in_frames(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """A queue holds whole frames, one more or one less, as many as make the mean."""
    return cycle_s * np.floor(delay_s / cycle_s + rng.random(n))


def waving(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Two clocks that beat."""
    phase = 2.0 * np.pi * (np.arange(n) * cycle_s / rng.uniform(2.0, 5.0) + rng.random())
    return delay_s * (1.0 + 0.25 * np.sin(phase))


# --- what is lost at an amount of blur or wrong exposure, 1 the amount that tells


def exponential(amount: Array) -> Array:
    """Share of the confidence that is kept."""
    return np.asarray(np.exp(-0.7 * amount))


def gaussian(amount: Array) -> Array:
    """Little at first."""
    return np.asarray(np.exp(-0.7 * amount**2))


def threshold(amount: Array) -> Array:
    """Nearly nothing, and then nearly all."""
    return np.asarray((1.0 + np.exp(-4.0)) / (1.0 + np.exp(4.0 * (amount - 1.0))))


def hyperbolic(amount: Array) -> Array:
    """As a ratio of signal to noise falls."""
    return np.asarray(1.0 / (1.0 + amount))


# --- classification errors


def independent(odds: Array, rng: Generator) -> Flags:
    """Which results are wrong."""
    return np.asarray(rng.random(odds.size) < odds)


def in_streaks(odds: Array, rng: Generator) -> Flags:
    """One error brings the next: a patch of the road looks like another surface for a while."""
    starts, ends = rng.random(odds.size), rng.random(odds.size) < 1.0 / STREAK
    wrong, now = np.zeros(odds.size, bool), False
    for i, chance in enumerate(odds.tolist()):
        now = not ends[i] if now else starts[i] < chance / (STREAK * (1.0 - min(chance, 0.9)))
        wrong[i] = now
    return wrong


# --- noise of the confidence and of a friction's reference, of unit size


def white(n: int, step_s: float, rng: Generator) -> Array:
    """Each by itself."""
    return rng.standard_normal(n)


def slow(n: int, step_s: float, rng: Generator) -> Array:
    """Half of it over some tenths of a second."""
    keep = np.exp(-step_s / 0.4)
    pushes = rng.standard_normal(n) * np.sqrt(1.0 - keep**2)
    return np.asarray(np.sqrt(0.5) * (rng.standard_normal(n) + lfilter([1.0], [1.0, -keep], pushes)))


def skewed(n: int, step_s: float, rng: Generator) -> Array:
    """Now and then much less."""
    return (1.0 - rng.gamma(1.5, 1.0, n) / 1.5) * np.sqrt(1.5)


def drifting(n: int, step_s: float, rng: Generator) -> Array:
    """White, and a drift over many seconds of a quarter of its size."""
    clock = np.arange(n) * step_s
    return rng.standard_normal(n) + 0.25 * np.sin(
        2.0 * np.pi * (clock / rng.uniform(8.0, 15.0) + rng.random())
    )


CAMERA_FORMS: dict[str, dict[str, Callable[..., Any] | None]] = {
    "captures": {"even": even, "jittered": jittered, "alternating": alternating},
    "work": {"steady": steady_work, "varying": varying_work, "waiting": waiting_work},
    "lateness": {"constant": constant, "scattered": scattered, "in_frames": in_frames, "waving": waving},
    "mounting": {"firm": None, "shaking": None},
    "stamp": {"cycle": None, "to_next": None, "window": None},
    "belongs": {"centre": None, "near": None, "majority": None},
    "errors": {"independent": independent, "in_streaks": in_streaks},
    "confidence": {"white": white, "slow": slow, "skewed": skewed},
    "blur_law": {
        "exponential": exponential,
        "gaussian": gaussian,
        "threshold": threshold,
        "hyperbolic": hyperbolic,
    },
    "exposure_law": {
        "exponential": exponential,
        "gaussian": gaussian,
        "threshold": threshold,
        "hyperbolic": hyperbolic,
    },
    "kept": {"to_nothing": None, "to_a_guess": None},
    "begins": {"with_the_log": None, "before": None},
    "reference": {"white": white, "slow": slow, "drifting": drifting},
    "reference_filter": {"none": None, "low_pass": None},
    "reference_lost": {"none": None, "samples": None, "runs": None},
}
"""All that a camera's chain has forms of in the first family; those without a function are choices beside its parts."""
