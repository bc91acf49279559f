"""Forms of a camera's chain: what the contract leaves open of how a real system sees, reckons and tells.

Each is an honest reading: none leaves a gap of its own, and none changes what a parameter means; what varies about a
deviation varies about its value. Each tells since which edition of the camera's cases it is drawn.
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

NEWEST_CAMERA = 3
"""Edition of the camera's cases: several forms of most aspects in the first, more of nearly all in each after it."""

STREAK = 4.0
"""Mean length of a streak of errors [results]."""
TAIL = 5.0
"""Degrees of freedom of a noise with heavy tails."""
STANDS_S = 0.1
"""How long a sample stands."""
KEY_EVERY, KEY_WORK = 5, 1.8
"""Pictures from one that is looked at in full to the next, and its work over the mean [-]."""
AGAIN, AGAIN_TIMES = 0.2, 1.7
"""Share of results whose message has to be sent again, and their delay over the mean [-]."""
WIPES_S, WIPED = (0.8, 1.6), 0.12
"""From one wipe to the next, and the share of it that the blade is in the picture."""
AXLE_HZ = (11.2, 13.8)
"""An axle's own frequency, none that would beat with a reference that has a rate of its own."""
BOX, BOX_MOST = 0.4, 0.9
"""Cycles of a texture that is told by over which an amount of blur of 1 smears, and where it stays [-]."""


def _square(n: int, step: float, period: tuple[float, float], rng: Generator) -> Array:
    """1 and -1 in turn, half of a drawn period each."""
    return np.where((np.arange(n) * step / rng.uniform(*period) + rng.random()) % 1.0 < 0.5, 1.0, -1.0)


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


def sent_again(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Some messages come through only when they are sent a second time: delay of each result [s]."""
    others = (1.0 - AGAIN * AGAIN_TIMES) / (1.0 - AGAIN)
    return delay_s * np.where(rng.random(n) < AGAIN, AGAIN_TIMES, others)


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


def box(amount: Array) -> Array:
    """As a texture's contrast falls that is smeared evenly: share of the confidence that is kept."""
    return np.asarray(np.sinc(np.minimum(BOX * amount, BOX_MOST)))


def rounded(amount: Array) -> Array:
    """Little at first, and then at an even rate of what is left."""
    return np.asarray(np.exp(-1.2 * (np.hypot(1.0, amount) - 1.0)))


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


FormsOf = dict[str, tuple[int, Callable[..., Any] | None]]


def _choices(*since: tuple[int, str]) -> FormsOf:
    """Forms without a function: choices beside a chain's parts, each edition's names in a row."""
    return {name: (edition, None) for edition, names in since for name in names.split()}


LAWS: FormsOf = {
    "exponential": (1, exponential),
    "gaussian": (1, gaussian),
    "threshold": (1, threshold),
    "hyperbolic": (1, hyperbolic),
    "linear": (2, linear),
    "knee": (2, knee),
    "bell": (2, bell),
    "saturating": (2, saturating),
    "box": (3, box),
    "rounded": (3, rounded),
}
CAMERA_FORMS: dict[str, FormsOf] = {
    "captures": {
        "even": (1, even),
        "jittered": (1, jittered),
        "alternating": (1, alternating),
        "breathing": (2, breathing),
        "missed": (2, missed),
        "stepping": (2, stepping),
        "by_way": (2, None),
        "shared": (3, shared),
    },
    "work": {
        "steady": (1, steady_work),
        "varying": (1, varying_work),
        "waiting": (1, waiting_work),
        "loaded": (2, loaded_work),
        "throttled": (2, throttled_work),
        "keyframes": (3, keyframes),
    },
    "lateness": {
        "constant": (1, constant),
        "scattered": (1, scattered),
        "in_frames": (1, in_frames),
        "waving": (1, waving),
        "long_tail": (2, long_tail),
        "resynced": (2, resynced),
        "sharing": (2, sharing),
        "warming": (2, warming),
        "when_fast": (2, None),
        "sent_again": (3, sent_again),
    },
    "mounting": _choices((1, "firm shaking"), (2, "squatting creeping rattling swaying"), (3, "bouncing")),
    "stamp": _choices((1, "cycle to_next window"), (2, "overlapping bounded worked")),
    "belongs": _choices((1, "centre near majority"), (2, "far most_slippery"), (3, "wider")),
    "errors": {"independent": (1, independent), "in_streaks": (1, in_streaks)},
    "confidence": {
        "white": (1, white),
        "slow": (1, slow),
        "skewed": (1, skewed),
        "heavy_tailed": (2, heavy_tailed),
        "two_levels": (2, two_levels),
        "standing": (2, standing),
        "wiped": (3, wiped),
    },
    "blur_law": LAWS,
    "exposure_law": LAWS,
    "kept": _choices((1, "to_nothing to_a_guess"), (2, "to_a_sixth")),
    "begins": _choices((1, "with_the_log before"), (2, "late"), (3, "ends_early")),
    "reference": {
        "white": (1, white),
        "slow": (1, slow),
        "drifting": (1, drifting),
        "heavy_tailed": (2, heavy_tailed),
        "standing": (2, standing),
        "vibrating": (3, vibrating),
        "by_stretch": (3, None),
    },
    "reference_filter": _choices((1, "none low_pass"), (2, "mean middle"), (3, "rate_limited")),
    "reference_lost": _choices((1, "none samples runs"), (3, "beside_borders")),
    "sent": _choices((2, "at_once on_a_bus"), (3, "through_gateway")),
    "lost": _choices((2, "one_by_one in_runs repeated")),
    "numbering": _choices((2, "counted dense strided wraps clock"), (3, "four_bits")),
    "stamp_noise": _choices((2, "exact noisy wandering")),
    "stamp_steps": _choices((2, "fine decimetres quarters")),
    "body": _choices((2, "level nods")),
    "exposure_course": _choices((2, "steady by_light hunting scattered by_class"), (3, "in_shade")),
    "blur_course": _choices((2, "steady by_light hunting by_class"), (3, "stepped")),
    "poor_pictures": _choices((2, "square hardly one_way say_none"), (3, "hold_last")),
    "error_odds": _choices((2, "even one_class at_patches at_times"), (3, "in_shadows")),
    "mistaken_for": _choices((2, "usual grippier slippery")),
    "voted": _choices((2, "each of_three confirmed"), (3, "of_five")),
    "told_confidence": _choices((2, "as_is coarse bytes capped smoothed overconfident"), (3, "three_bits")),
    "border_memory": _choices((2, "none recovers")),
    "levels": _choices((2, "alike one_lower"), (3, "wandering")),
    "none_says": _choices((2, "zero nan last")),
    "pauses": _choices((2, "none some"), (3, "when_slow")),
    "rows": _choices((2, "each lost_samples every_second"), (3, "on_arrival")),
    "position": _choices((2, "as_is steps lost_samples"), (3, "noisy")),
    "reference_rate": _choices((2, "each_row sparse held")),
    "reference_when": _choices((2, "always slipping at_times"), (3, "moving")),
    "reference_steps": _choices((2, "fine hundredths fiftieths")),
    "friction_off": _choices(
        (2, "as_drawn each_stretch all_alike one_only"), (3, "uneven_stretches slippery_only")
    ),
    "layout": _choices((2, "usual two_classes patches very_uneven clustered"), (3, "through_wet repeated")),
    "speeds": _choices((2, "all_speeds town surging in_waves"), (3, "plateaus")),
}
"""All that a camera's chain has forms of; of an aspect that an edition lacks, a chain has the first."""

OF_EFFECT: dict[str, tuple[str, ...]] = {
    "camera_latency": ("lateness",),
    "camera_pitch": ("mounting",),
    "exposure_shift": ("exposure_law", "exposure_course", "kept", "poor_pictures"),
    "motion_blur": ("blur_law", "blur_course", "kept", "poor_pictures"),
    "class_friction_offset": ("friction_off",),
}
"""Aspects that are an effect's own; all else is the system's that it is hidden in."""


def camera_forms_by(edition: int) -> dict[str, list[str]]:
    """Each aspect's forms that there were by an edition."""
    known = {
        aspect: [form for form, (since, _) in forms.items() if since <= edition]
        for aspect, forms in CAMERA_FORMS.items()
    }
    return {aspect: forms for aspect, forms in known.items() if forms}


def draw_forms_of(edition: int, rng: Generator) -> dict[str, str]:
    """A form of each of the edition's aspects, all equally likely."""
    return {aspect: str(rng.choice(forms)) for aspect, forms in camera_forms_by(edition).items()}


def form(forms: Mapping[str, str], aspect: str) -> str:
    """Which one a system has; of what its edition does not list, the first."""
    return forms.get(aspect) or next(iter(CAMERA_FORMS[aspect]))


def function(forms: Mapping[str, str], aspect: str) -> Callable[..., Any]:
    """That of a form that has one."""
    found = CAMERA_FORMS[aspect][form(forms, aspect)][1]
    assert found is not None
    return found
