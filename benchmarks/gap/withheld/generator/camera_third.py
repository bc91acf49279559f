"""What the third family of the camera's forms adds: each entry is named after the aspect that it is a form of.

As in the families before, each is an honest reading that leaves no gap of its own and keeps what a parameter means.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .camera_second import Aspects

Array = NDArray[np.floating[Any]]

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


def shared(cycle_s: float, n: int, rng: Generator) -> Array:
    """Every third picture is another function's: intervals [s]."""
    return cycle_s * np.where(np.arange(n) % 2 == 0, 4.0 / 3.0, 2.0 / 3.0)


def keyframes(mean_s: float, n: int, rng: Generator) -> Array:
    """Looked at in full now and then, and only followed between: processing time [s]."""
    others = (KEY_EVERY - KEY_WORK) / (KEY_EVERY - 1)
    full = np.arange(n) % KEY_EVERY == rng.integers(KEY_EVERY)
    return mean_s * np.where(full, KEY_WORK, others)


def sent_again(delay_s: float, cycle_s: float, n: int, rng: Generator) -> Array:
    """Some messages come through only when they are sent a second time: delay of each result [s]."""
    others = (1.0 - AGAIN * AGAIN_TIMES) / (1.0 - AGAIN)
    return delay_s * np.where(rng.random(n) < AGAIN, AGAIN_TIMES, others)


def box(amount: Array) -> Array:
    """As a texture's contrast falls that is smeared evenly: share of the confidence that is kept."""
    return np.asarray(np.sinc(np.minimum(BOX * amount, BOX_MOST)))


def rounded(amount: Array) -> Array:
    """Little at first, and then at an even rate of what is left."""
    return np.asarray(np.exp(-1.2 * (np.hypot(1.0, amount) - 1.0)))


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


FURTHER: Aspects = {
    "captures": {"shared": shared},
    "work": {"keyframes": keyframes},
    "lateness": {"sent_again": sent_again},
    "mounting": {"bouncing": None},
    "belongs": {"wider": None},
    "confidence": {"wiped": wiped},
    "blur_law": {"box": box, "rounded": rounded},
    "exposure_law": {"box": box, "rounded": rounded},
    "begins": {"ends_early": None},
    "reference": {"vibrating": vibrating, "by_stretch": None},
    "reference_filter": {"rate_limited": None},
    "reference_lost": {"beside_borders": None},
    "sent": {"through_gateway": None},
    "numbering": {"four_bits": None},
    "exposure_course": {"in_shade": None},
    "blur_course": {"stepped": None},
    "poor_pictures": {"hold_last": None},
    "error_odds": {"in_shadows": None},
    "voted": {"of_five": None},
    "told_confidence": {"three_bits": None},
    "levels": {"wandering": None},
    "pauses": {"when_slow": None},
    "rows": {"on_arrival": None},
    "position": {"noisy": None},
    "reference_when": {"moving": None},
    "friction_off": {"uneven_stretches": None, "slippery_only": None},
    "layout": {"through_wet": None, "repeated": None},
    "speeds": {"plateaus": None},
}
"""More forms of aspects that the second family has already."""
