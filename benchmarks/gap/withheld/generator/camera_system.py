"""A camera's system as it was built, what is hidden in it, and what it said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .camera_road import CLASS_FRICTION, Whole

Array = NDArray[np.floating[Any]]
Forms = dict[str, str]

HEIGHT_M = 1.4
BEHIND_M = 0.4
"""Lens above the road, and behind the front axle: the contract's camera file."""


@dataclass(frozen=True)
class Fault:
    """What is hidden in the chain, each at its neutral value; SI units."""

    delay_s: float = 0.0
    pitch_rad: float = 0.0
    stops: float = 0.0
    exposure_s: float = 0.0
    friction: tuple[float, float, float] = CLASS_FRICTION
    """True value of each class."""
    clock: float = 0.0
    """Share by which the camera's clock is fast: its stamps run away from the pictures."""
    odometer: float = 0.0
    """Share by which positions grow too fast."""
    map_m: float = 0.0
    """Standard deviation of the borders in road.yaml."""
    glare: float = 0.0
    """Share of the confidence that the sun takes."""
    confused_m: float = 0.0
    """Length of a stretch of the road whose surface is always mistaken."""
    confused_from_m: float = 0.0
    frozen_s: float = 0.0
    """How long the pictures stand still."""
    swapped: float = 0.0
    """Share of the results on a wet road that are told as snow."""
    fogged: float = 0.0
    """Share of the confidence that is gone at a log's end, as the lens fogs."""
    jumped_m: float = 0.0
    """By how much the position jumps, either way."""
    relabelled: float = 0.0
    """Share of road.yaml's stretches whose surface is another one by now."""
    sticky_s: float = 0.0
    """How long the most slippery surface is told on."""
    loose: float = 0.0
    """Share of the confidence that is gone where the car accelerates or brakes hard."""
    unsure: float = 0.0
    """Share of the confidence that is gone on wet roads."""
    measured_late_s: float = 0.0
    """How late the friction's reference is."""
    measured_speed: float = 0.0
    """Share by which the friction is less at double the mean speed."""
    stamp_age_s: float = 0.0
    """How old the place and the speed are that a stamp goes on from."""
    rained: float = 0.0
    """Share of the results that are told as wet while drops stand on the glass."""
    clock_set_s: float = 0.0
    """By how much the camera's clock is set, back and forth."""
    spray: float = 0.0
    """Share of the confidence that is gone while others throw up water."""
    shrunk_m: float = 0.0
    """By how much road.yaml's more slippery stretches reach too far at each end."""
    wandered_m: float = 0.0
    """By how much the position swings to and fro, fast and slowly."""
    slow_unsure: float = 0.0
    """Share of the confidence that is gone at a standstill."""
    measured_push: float = 0.0
    """Share by which the friction is less in hard acceleration, and more in hard braking."""


@dataclass(frozen=True)
class Chain:
    """A system as it was built, without its faults.

    `level` is the usual confidence of each class, `border_dip` what it loses where the picture shows a border, and
    `wrong_dip` where the result is wrong; `errors` the share of wrong results, `more_at_border` times as many there.
    `blur_m` and `stops` are the amounts of blur and wrong exposure that tell, `over` how much sooner overexposure does.
    """

    forms: Forms
    rate_hz: float
    work_s: float
    dropped: float
    preview_m: float
    window_m: float
    level: tuple[float, float, float]
    spread: float
    border_dip: float
    wrong_dip: float
    errors: float
    more_at_border: float
    none: float
    blur_m: float
    stops: float
    over: float
    first_id: int
    reference_noise: float | None
    """Standard deviation; without a reference none."""
    reference_s: float
    """Of its low pass."""
    digits: int
    seed: int

    def rng(self, log: str, aspect: int) -> Generator:
        """Of its own for each log and aspect."""
        return np.random.default_rng([self.seed, sum(log.encode()), aspect])


@dataclass(frozen=True)
class Results:
    """What the system said, one entry per result, and the truth behind it.

    Attributes
    ----------
    ready_s, number, surface, confidence, from_m, to_m : arrays
        As they go to the log.
    shift_m : array
        Place that is stamped less the place that the picture shows, for what the class belongs to.
    kept : array
        Share of the confidence that the deviations leave.
    mistaken : array
        Whether a deviation makes the class that of another place or surface.
    odds : array
        Of an ordinary error.
    """

    ready_s: Array
    number: Whole
    surface: Whole
    confidence: Array
    from_m: Array
    to_m: Array
    shift_m: Array
    kept: Array
    mistaken: NDArray[np.bool_]
    odds: Array


def draw_chain(rng: Generator, forms: Forms) -> Chain:
    """A system that a car may well have."""
    least = 10.0 if forms["belongs"] in ("near", "far", "wider") else 5.0
    if forms["voted"] == "of_five":  # else short stretches would be outvoted
        least = 20.0
    rate = float(np.exp(rng.uniform(*np.log((least, 60.0)))))
    level = rng.uniform(0.87, 0.96)
    return Chain(
        forms=forms,
        rate_hz=rate,
        work_s=float(rng.uniform(0.3, 1.5) / rate),
        dropped=float(rng.choice([0.0, rng.uniform(0.005, 0.06)])),
        preview_m=2.5 if rng.random() < 0.5 else float(rng.uniform(2.5, 12.0)),
        window_m=float(rng.uniform(0.3, 1.5)),
        level=tuple(float(x) for x in np.clip(level + rng.uniform(-0.03, 0.03, 3), 0.0, 0.98)),
        spread=float(rng.uniform(0.005, 0.05)),
        border_dip=float(rng.choice([0.0, rng.uniform(0.05, 0.3)])),
        wrong_dip=float(rng.uniform(0.0, 0.25)),
        errors=float(rng.choice([0.0, rng.uniform(0.005, 0.12)], p=[0.2, 0.8])),
        more_at_border=float(rng.uniform(1.0, 3.0)),
        none=float(rng.choice([0.0, rng.uniform(0.002, 0.02)], p=[0.7, 0.3])),
        blur_m=float(rng.uniform(0.15, 0.35)),
        stops=float(rng.uniform(1.5, 3.0)),
        over=float(rng.uniform(1.0, 1.4)),
        first_id=int(rng.choice([0, 1, rng.integers(2, 100_000)])),
        reference_noise=None if rng.random() < 0.2 else float(rng.uniform(0.005, 0.04)),
        reference_s=float(rng.uniform(0.03, 0.2)),
        digits=int(rng.choice([3, 4, 6])),
        seed=int(rng.integers(2**31)),
    )
