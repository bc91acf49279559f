"""What the second family of the camera's forms adds: each entry is named after the aspect that it is a form of.

As in the first, each is an honest reading that leaves no gap of its own and keeps what a parameter means: what varies
about a deviation varies about its value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.floating[Any]]
Aspects = dict[str, dict[str, Callable[..., Any] | None]]

TAIL = 5.0
"""Degrees of freedom of a noise with heavy tails."""
STANDS_S = 0.1
"""How long a sample stands."""


def _square(n: int, step: float, period: tuple[float, float], rng: Generator) -> Array:
    """1 and -1 in turn, half of a drawn period each."""
    return np.where((np.arange(n) * step / rng.uniform(*period) + rng.random()) % 1.0 < 0.5, 1.0, -1.0)


# --- when pictures are taken


def breathing(cycle_s: float, n: int, rng: Generator) -> Array:
    """Slower where it is dark, over many seconds."""
    phase = np.arange(n) * cycle_s / rng.uniform(6.0, 15.0) + rng.random()
    return cycle_s * (1.0 + 0.2 * np.sin(2.0 * np.pi * phase))


def missed(cycle_s: float, n: int, rng: Generator) -> Array:
    """One trigger in ten comes to nothing."""
    return cycle_s / 1.1 * np.where(rng.random(n) < 0.1, 2.0, 1.0)


def stepping(cycle_s: float, n: int, rng: Generator) -> Array:
    """Two rates in turn."""
    return cycle_s * (1.0 + 0.2 * _square(n, cycle_s, (5.0, 12.0), rng))


# --- how long a result takes, as the stamp accounts for


def loaded_work(mean_s: float, n: int, rng: Generator) -> Array:
    """More and less over some results, as the computer has other things to do."""
    pushes = rng.standard_normal(n + 50) * np.sqrt(1.0 - 0.9**2)
    return np.asarray(mean_s * np.exp(0.35 * lfilter([1.0], [1.0, -0.9], pushes)[50:] - 0.06125))


def throttled_work(mean_s: float, n: int, rng: Generator) -> Array:
    """At full speed and, too warm, at a lower one."""
    return mean_s * (1.0 + 0.35 * _square(n, 1.0, (60.0, 200.0), rng))


# --- how a delay that the stamp misses differs about its mean


def long_tail(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Seldom much later."""
    return delay_s * (0.6 + 0.4 * rng.exponential(1.0, n))


def resynced(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """A clock that runs off until it is set again."""
    return delay_s * (0.75 + 0.5 * ((np.arange(n) * cycle_s / rng.uniform(1.0, 6.0) + rng.random()) % 1.0))


def sharing(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Another task runs half of the time."""
    return delay_s * (1.0 + 0.25 * _square(n, cycle_s, (2.0, 6.0), rng))


def warming(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Ever later, as the computer gets warm."""
    return delay_s * np.linspace(0.8, 1.2, n)


# --- what is lost at an amount of blur or wrong exposure, 1 the amount that tells


def linear(amount: Array) -> Array:
    """Share of the confidence that is kept."""
    return np.asarray(np.maximum(1.0 - 0.3 * amount, 0.05))


def knee(amount: Array) -> Array:
    """Nothing up to a quarter."""
    return np.asarray(np.exp(-0.8 * np.maximum(amount - 0.25, 0.0)))


def bell(amount: Array) -> Array:
    """Soon, and then ever less."""
    return np.asarray(1.0 / (1.0 + amount**2))


def saturating(amount: Array) -> Array:
    """Down to a third that a coarse feature still gives."""
    return np.asarray(1.0 / 3.0 + 2.0 / 3.0 * np.exp(-amount))


# --- noise of the confidence and of a friction's reference, of unit size


def heavy_tailed(n: int, step_s: float, rng: Generator) -> Array:
    """Student's."""
    return rng.standard_t(TAIL, n) * np.sqrt(1.0 - 2.0 / TAIL)


def two_levels(n: int, step_s: float, rng: Generator) -> Array:
    """White, and half of it from one level to the other."""
    jumps = rng.random(n) < step_s / 0.7
    level = np.where(np.cumsum(jumps) % 2 == 0, 1.0, -1.0)
    return np.asarray(np.sqrt(0.5) * (rng.standard_normal(n) + level))


def standing(n: int, step_s: float, rng: Generator) -> Array:
    """White, each value standing for a while."""
    last = np.floor(np.arange(n) * step_s / STANDS_S + rng.random()).astype(int)
    return rng.standard_normal(last[-1] + 1)[last]


NEW: Aspects = {
    "sent": {"at_once": None, "on_a_bus": None},
    "lost": {"one_by_one": None, "in_runs": None, "repeated": None},
    "numbering": {"counted": None, "dense": None, "strided": None, "wraps": None, "clock": None},
    "stamp_noise": {"exact": None, "noisy": None, "wandering": None},
    "stamp_steps": {"fine": None, "decimetres": None, "quarters": None},
    "body": {"level": None, "nods": None},
    "exposure_course": {
        "steady": None,
        "by_light": None,
        "hunting": None,
        "scattered": None,
        "by_class": None,
    },
    "blur_course": {"steady": None, "by_light": None, "hunting": None, "by_class": None},
    "poor_pictures": {"square": None, "hardly": None, "one_way": None, "say_none": None},
    "error_odds": {"even": None, "one_class": None, "at_patches": None, "at_times": None},
    "mistaken_for": {"usual": None, "grippier": None, "slippery": None},
    "voted": {"each": None, "of_three": None, "confirmed": None},
    "told_confidence": {
        "as_is": None,
        "coarse": None,
        "bytes": None,
        "capped": None,
        "smoothed": None,
        "overconfident": None,
    },
    "border_memory": {"none": None, "recovers": None},
    "levels": {"alike": None, "one_lower": None},
    "none_says": {"zero": None, "nan": None, "last": None},
    "pauses": {"none": None, "some": None},
    "rows": {"each": None, "lost_samples": None, "every_second": None},
    "position": {"as_is": None, "steps": None, "lost_samples": None},
    "reference_rate": {"each_row": None, "sparse": None, "held": None},
    "reference_when": {"always": None, "slipping": None, "at_times": None},
    "reference_steps": {"fine": None, "hundredths": None, "fiftieths": None},
    "friction_off": {"as_drawn": None, "each_stretch": None, "all_alike": None, "one_only": None},
    "layout": {
        "usual": None,
        "two_classes": None,
        "patches": None,
        "very_uneven": None,
        "clustered": None,
    },
    "speeds": {"all_speeds": None, "town": None, "surging": None, "in_waves": None},
}
"""Aspects that the first family has one form of only, here the first of each."""

LAWS = {"linear": linear, "knee": knee, "bell": bell, "saturating": saturating}

MORE: Aspects = {
    "captures": {"breathing": breathing, "missed": missed, "stepping": stepping, "by_way": None},
    "work": {"loaded": loaded_work, "throttled": throttled_work},
    "lateness": {
        "long_tail": long_tail,
        "resynced": resynced,
        "sharing": sharing,
        "warming": warming,
        "when_fast": None,
    },
    "mounting": {"squatting": None, "creeping": None, "rattling": None, "swaying": None},
    "stamp": {"overlapping": None, "bounded": None, "worked": None},
    "belongs": {"far": None, "most_slippery": None},
    "confidence": {"heavy_tailed": heavy_tailed, "two_levels": two_levels, "standing": standing},
    "blur_law": {**LAWS},
    "exposure_law": {**LAWS},
    "kept": {"to_a_sixth": None},
    "begins": {"late": None},
    "reference": {"heavy_tailed": heavy_tailed, "standing": standing},
    "reference_filter": {"mean": None, "middle": None},
    **NEW,
}
