"""Forms of a camera's chain: what the contract leaves open of how a real system sees, reckons and tells.

Each is an honest reading: none leaves a gap of its own, and none changes what a parameter means; what varies about a
deviation varies about its value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

STREAK = 4.0
"""Mean length of a streak of errors [results]."""
TAIL = 5.0
"""Degrees of freedom of a noise with heavy tails."""
STANDS_S = 0.1
"""How long a sample stands."""
KEY_EVERY, KEY_WORK = 5, 1.8
"""Pictures from one that is looked at in full to the next, and its work over the mean [-]."""
WIPES_S, WIPED = (0.8, 1.6), 0.12
"""From one wipe to the next, and the share of it that the blade is in the picture."""
AXLE_HZ = (11.2, 13.8)
"""An axle's own frequency, none that would beat with a reference that has a rate of its own."""


def _square(n: int, step: float, period: tuple[float, float], rng: Generator) -> Array:
    """1 and -1 in turn, half of a drawn period each."""
    return np.where((np.arange(n) * step / rng.uniform(*period) + rng.random()) % 1.0 < 0.5, 1.0, -1.0)


# --- when pictures are taken


def even(cycle_s: float, n: int, rng: Generator) -> Array:
    """Intervals between pictures [s]."""
    return np.full(n, cycle_s)


def breathing(cycle_s: float, n: int, rng: Generator) -> Array:
    """Slower where it is dark, over many seconds."""
    phase = np.arange(n) * cycle_s / rng.uniform(6.0, 15.0) + rng.random()
    return cycle_s * (1.0 + 0.2 * np.sin(2.0 * np.pi * phase))


def missed(cycle_s: float, n: int, rng: Generator) -> Array:
    """One trigger in ten comes to nothing."""
    return cycle_s / 1.1 * np.where(rng.random(n) < 0.1, 2.0, 1.0)


def shared(cycle_s: float, n: int, rng: Generator) -> Array:
    """Every third picture is another function's: intervals [s]."""
    return cycle_s * np.where(np.arange(n) % 2 == 0, 4.0 / 3.0, 2.0 / 3.0)


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


def loaded_work(mean_s: float, n: int, rng: Generator) -> Array:
    """More and less over some results, as the computer has other things to do."""
    pushes = rng.standard_normal(n + 50) * np.sqrt(1.0 - 0.9**2)
    return np.asarray(mean_s * np.exp(0.35 * lfilter([1.0], [1.0, -0.9], pushes)[50:] - 0.06125))


def throttled_work(mean_s: float, n: int, rng: Generator) -> Array:
    """At full speed and, too warm, at a lower one."""
    return mean_s * (1.0 + 0.35 * _square(n, 1.0, (60.0, 200.0), rng))


def keyframes(mean_s: float, n: int, rng: Generator) -> Array:
    """Looked at in full now and then, and only followed between: processing time [s]."""
    others = (KEY_EVERY - KEY_WORK) / (KEY_EVERY - 1)
    full = np.arange(n) % KEY_EVERY == rng.integers(KEY_EVERY)
    return mean_s * np.where(full, KEY_WORK, others)


# --- how a delay that the stamp misses differs about its mean


def constant(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Delay of each result [s]."""
    return np.full(n, delay_s)


def in_frames(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """A queue holds whole frames, one more or one less, as many as make the mean."""
    return cycle_s * np.floor(delay_s / cycle_s + rng.random(n))


def long_tail(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Seldom much later."""
    return delay_s * (0.6 + 0.4 * rng.exponential(1.0, n))


def sharing(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Another task runs half of the time."""
    return delay_s * (1.0 + 0.25 * _square(n, cycle_s, (2.0, 6.0), rng))


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


def linear(amount: Array) -> Array:
    """Share of the confidence that is kept."""
    return np.asarray(np.maximum(1.0 - 0.3 * amount, 0.05))


def saturating(amount: Array) -> Array:
    """Down to a third that a coarse feature still gives."""
    return np.asarray(1.0 / 3.0 + 2.0 / 3.0 * np.exp(-amount))


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


def wiped(n: int, step_s: float, rng: Generator) -> Array:
    """White, and half of it the wiper's blade."""
    period, phase = rng.uniform(*WIPES_S), rng.random()
    blade = (np.arange(n) * step_s / period + phase) % 1.0 < WIPED
    dips = (WIPED - blade) / np.sqrt(WIPED * (1.0 - WIPED))
    return np.asarray(np.sqrt(0.5) * (rng.standard_normal(n) + dips))


def vibrating(n: int, step_s: float, rng: Generator) -> Array:
    """White, and half of it the axle's own hop."""
    hop = np.sqrt(2.0) * np.sin(2.0 * np.pi * (np.arange(n) * step_s * rng.uniform(*AXLE_HZ) + rng.random()))
    return np.asarray(np.sqrt(0.5) * (rng.standard_normal(n) + hop))


def _choices(names: str) -> dict[str, None]:
    """Forms without a function: choices beside a chain's parts."""
    return dict.fromkeys(names.split())


LAWS = {
    "exponential": exponential,
    "gaussian": gaussian,
    "threshold": threshold,
    "linear": linear,
    "saturating": saturating,
}
CAMERA_FORMS: dict[str, Mapping[str, Callable[..., Any] | None]] = {
    "captures": {"even": even, "breathing": breathing, "missed": missed, "by_way": None, "shared": shared},
    "work": {
        "steady": steady_work,
        "varying": varying_work,
        "waiting": waiting_work,
        "loaded": loaded_work,
        "throttled": throttled_work,
        "keyframes": keyframes,
    },
    "lateness": {"constant": constant, "in_frames": in_frames, "long_tail": long_tail, "sharing": sharing},
    "mounting": _choices("firm creeping"),
    "stamp": _choices("cycle to_next window overlapping bounded worked"),
    "belongs": _choices("centre near majority far wider"),
    "errors": {"independent": independent, "in_streaks": in_streaks},
    "confidence": {
        "white": white,
        "skewed": skewed,
        "heavy_tailed": heavy_tailed,
        "two_levels": two_levels,
        "wiped": wiped,
    },
    "blur_law": LAWS,
    "exposure_law": LAWS,
    "kept": _choices("to_nothing to_a_guess to_a_sixth"),
    "begins": _choices("with_the_log before late ends_early"),
    "reference": {
        "white": white,
        "slow": slow,
        "drifting": drifting,
        "heavy_tailed": heavy_tailed,
        "standing": standing,
        "vibrating": vibrating,
        "by_stretch": None,
    },
    "reference_filter": _choices("none low_pass mean middle rate_limited"),
    "reference_lost": _choices("none samples runs beside_borders"),
    "sent": _choices("at_once on_a_bus through_gateway"),
    "lost": _choices("one_by_one in_runs repeated"),
    "numbering": _choices("counted dense strided wraps clock four_bits"),
    "stamp_noise": _choices("exact noisy wandering"),
    "stamp_steps": _choices("fine decimetres quarters"),
    "body": _choices("level nods"),
    "exposure_course": _choices("steady by_light hunting"),
    "blur_course": _choices("steady by_light hunting"),
    "poor_pictures": _choices("square hardly one_way say_none hold_last"),
    "error_odds": _choices("even one_class at_patches at_times in_shadows"),
    "mistaken_for": _choices("usual grippier slippery"),
    "voted": _choices("each of_three confirmed of_five"),
    "told_confidence": _choices("as_is coarse bytes capped smoothed overconfident three_bits"),
    "border_memory": _choices("none recovers"),
    "levels": _choices("alike one_lower wandering"),
    "none_says": _choices("zero nan last"),
    "pauses": _choices("none some when_slow"),
    "rows": _choices("each lost_samples every_second on_arrival"),
    "position": _choices("as_is steps lost_samples noisy"),
    "reference_rate": _choices("each_row sparse held"),
    "reference_when": _choices("always slipping at_times moving"),
    "reference_steps": _choices("fine hundredths fiftieths"),
    "friction_off": _choices("as_drawn each_stretch"),
    "layout": _choices("usual two_classes patches very_uneven clustered through_wet repeated"),
    "speeds": _choices("all_speeds town surging in_waves plateaus"),
}
"""All that a camera's chain has forms of."""


def function(forms: Mapping[str, str], aspect: str) -> Callable[..., Any]:
    """That of a form that has one."""
    found = CAMERA_FORMS[aspect][forms[aspect]]
    assert found is not None
    return found
