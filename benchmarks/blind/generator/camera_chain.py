"""A camera's chain: from where the car was to what the perception columns say, and what is hidden in it.

Whatever is drawn in a run is drawn alike with and without a hidden deviation, from generators of their own, so that a
deviation at its neutral value leaves the nominal columns bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .camera_forms import CAMERA_FORMS
from .camera_road import CLASS_FRICTION, CameraRoad, Passage, Whole

Array = NDArray[np.floating[Any]]
Forms = dict[str, str]

HEIGHT_M = 1.4
BEHIND_M = 0.4
"""Lens above the road, and behind the front axle: the contract's camera file."""
POINTS = {"centre": (0.5,), "near": (1.0 / 3.0,), "majority": (0.1, 0.3, 0.5, 0.7, 0.9)}
"""Shares of the stamped stretch whose surface a result has."""
GUESS = 1.0 / 3.0
"""Least probability that the likeliest of three classes can have."""
MISTAKEN = np.array([[0.0, 0.85, 0.15], [0.85, 0.0, 0.15], [0.3, 0.7, 0.0]])
"""What a surface is taken for when a result is wrong."""
MOST_WRONG = 0.45
"""Odds of an error in a picture that shows nothing [-]."""
GLARE_M, GLARE_SHARE = 90.0, 0.35
"""From one stretch with the sun in the lens to the next, and how much of the road has it."""
FREEZES_S = 5.0
"""From one standstill of the pictures to the next, in the mean."""


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
    rate = float(np.exp(rng.uniform(*np.log((10.0 if forms["belongs"] == "near" else 5.0, 60.0)))))
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


def seen_at(distance_m: Array, pitch_rad: Array | float) -> Array:
    """Distance from the lens that a picture's point shows which the camera file has at `distance_m`.

    A pinhole over a flat road: nose down by `pitch_rad`, each point shows what is nearer.
    """
    turned = HEIGHT_M / np.tan(np.arctan(HEIGHT_M / distance_m) + pitch_rad)
    return np.where(np.asarray(pitch_rad) == 0.0, distance_m, turned)


def kept_of(chain: Chain, fault: Fault, speed_m_s: Array) -> Array:
    """Share of the confidence that blur and wrong exposure leave, at each speed [-]."""
    blur = CAMERA_FORMS["blur_law"][chain.forms["blur_law"]]
    exposure = CAMERA_FORMS["exposure_law"][chain.forms["exposure_law"]]
    assert blur is not None
    assert exposure is not None
    wrong = abs(fault.stops) / chain.stops * (chain.over if fault.stops > 0.0 else 1.0)
    kept = blur(speed_m_s * fault.exposure_s / chain.blur_m) * exposure(np.full(speed_m_s.size, wrong))
    floor = GUESS if chain.forms["kept"] == "to_a_guess" else 0.02
    return np.asarray(1.0 - (1.0 - floor) * (1.0 - kept))


def results(chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, log: str) -> Results:
    """All results of a drive; `road` is as it really is."""
    taken, ready = _timing(chain, passage.end_s, log)
    n, forms = taken.size, chain.forms
    at = passage.at(taken)
    length = _length(chain, passage, taken, ready)
    shown = _shown_s(chain, fault, taken, log)
    pitch = fault.pitch_rad * np.ones(n)
    if forms["mounting"] == "shaking":
        pitch *= 1.0 + 0.15 * np.clip(chain.rng(log, 5).standard_normal(n), -2.5, 2.5)
    places, shift = _places(chain, passage, shown, at, length, pitch)
    true = _class_of(road, places)
    honest = _class_of(road, _places(chain, passage, taken, at, length, np.zeros(n))[0])
    mistaken = np.zeros(n, bool)
    if fault.frozen_s > 0.0:
        mistaken |= true != honest
    if fault.confused_m > 0.0:
        middle = places.mean(axis=0)
        begin = fault.confused_from_m
        mistaken |= (middle >= begin) & (middle < begin + fault.confused_m)
        true = np.where(mistaken, np.array([1, 0, 1])[true], true)
    kept = kept_of(chain, fault, passage.speed(shown)) * (
        1.0 - fault.glare * _sunny(chain, places.mean(axis=0))
    )
    border = _class_of(road, at + BEHIND_M) != _class_of(road, at + chain.preview_m + length + BEHIND_M)
    border |= np.ptp(road.class_at(places), axis=0) > 0
    odds = np.clip(chain.errors * np.where(border, chain.more_at_border, 1.0), 0.0, 0.3)
    surface, wrong = _classified(chain, true, odds + (MOST_WRONG - odds) * (1.0 - kept) ** 2, log)
    confidence = _confidence(chain, true, border, wrong, log) * kept
    none = chain.rng(log, 9).random(n) < chain.none
    if fault.odometer != 0.0:
        shift = shift + fault.odometer * at
        at, length = at * (1.0 + fault.odometer), length * (1.0 + fault.odometer)
    begin = at + chain.preview_m
    whole = chain.rng(log, 3).random(n) >= chain.dropped
    return Results(
        ready[whole],
        (chain.first_id + np.arange(n))[whole],
        np.where(none, -1, surface)[whole],
        np.where(none, 0.0, np.clip(confidence, 0.0, 1.0))[whole],
        begin[whole],
        (begin + length)[whole],
        shift[whole],
        kept[whole],
        mistaken[whole],
        odds[whole],
    )


def _timing(chain: Chain, end_s: float, log: str) -> tuple[Array, Array]:
    """When each picture was taken, and when its result was ready [s]."""
    cycle, begins = 1.0 / chain.rate_hz, -1.0 if chain.forms["begins"] == "before" else 0.0
    n = int((end_s - begins) * chain.rate_hz * 1.1) + 2
    captures, work = (CAMERA_FORMS[a][chain.forms[a]] for a in ("captures", "work"))
    assert captures is not None
    assert work is not None
    rng = chain.rng(log, 1)
    taken = begins + rng.uniform(0.0, cycle) + np.cumsum(captures(cycle, n, rng)) - cycle
    ready = np.maximum.accumulate(taken + work(chain.work_s, n, chain.rng(log, 2)))
    return taken[taken < end_s], ready[taken < end_s]


def _length(chain: Chain, passage: Passage, taken: Array, ready: Array) -> Array:
    """Of the stamp [m]: what is driven in a cycle, or to the next picture, or as far as the window shows."""
    if chain.forms["stamp"] == "window":
        return np.full(taken.size, chain.window_m)
    if chain.forms["stamp"] == "cycle":
        return np.maximum(passage.speed(ready) / chain.rate_hz, 0.01)
    to_next = np.diff(passage.at(np.append(taken, taken[-1] + 1.0 / chain.rate_hz)))
    return np.maximum(to_next, 0.01)


def _shown_s(chain: Chain, fault: Fault, taken: Array, log: str) -> Array:
    """When what the result tells was really seen [s]."""
    late = CAMERA_FORMS["lateness"][chain.forms["lateness"]]
    assert late is not None
    delay = late(fault.delay_s, 1.0 / chain.rate_hz, taken.size, chain.rng(log, 4)) if fault.delay_s else 0.0
    shown = taken - delay - fault.clock * np.maximum(taken, 0.0)
    if fault.frozen_s > 0.0:
        rng, at = chain.rng(log, 10), 0.0
        while (at := at + rng.exponential(FREEZES_S)) < taken[-1]:
            held = (taken >= at) & (taken < at + fault.frozen_s)
            shown[held] = shown[held][:1]
            at += fault.frozen_s
    return np.asarray(shown)


def _places(
    chain: Chain, passage: Passage, shown_s: Array, at: Array, length: Array, pitch: Array
) -> tuple[Array, Array]:
    """Places whose surface a result has, shape (points, n), and how far the stamp is ahead of them, shape (n,) [m]."""
    shares = np.array(POINTS[chain.forms["belongs"]])[:, None]
    distance = chain.preview_m + BEHIND_M + shares * length
    really = passage.at(shown_s) - BEHIND_M + seen_at(distance, pitch)
    return really, (at - BEHIND_M + distance - really).mean(axis=0)


def _class_of(road: CameraRoad, places: Array) -> Whole:
    """Surface of most of the places; of equally many the least slippery one."""
    found = road.class_at(np.atleast_2d(places))
    return np.argmax([(found == surface).sum(axis=0) for surface in range(3)], axis=0)


def _sunny(chain: Chain, place_m: Array) -> Array:
    """1 where the sun is in the lens: stretches of the road, as it bends [-]."""
    bends = np.cos(2.0 * np.pi * (place_m / GLARE_M + chain.rng("", 11).random()))
    return np.asarray((bends > np.cos(np.pi * GLARE_SHARE)).astype(float))


def _classified(chain: Chain, true: Whole, odds: Array, log: str) -> tuple[Whole, NDArray[np.bool_]]:
    """Classes with errors, and which results are wrong."""
    errors = CAMERA_FORMS["errors"][chain.forms["errors"]]
    assert errors is not None
    wrong = errors(odds, chain.rng(log, 6))
    taken_for = (chain.rng(log, 7).random(true.size)[:, None] > np.cumsum(MISTAKEN[true], axis=1)).sum(axis=1)
    return np.where(wrong, np.minimum(taken_for, 2), true), wrong


def _confidence(
    chain: Chain, true: Whole, border: NDArray[np.bool_], wrong: NDArray[np.bool_], log: str
) -> Array:
    """Q_v of a chain without faults [-]."""
    noise = CAMERA_FORMS["confidence"][chain.forms["confidence"]]
    assert noise is not None
    values = np.array(chain.level)[true] * (1.0 - chain.border_dip * border) * (1.0 - chain.wrong_dip * wrong)
    noisy = values * np.exp(chain.spread * noise(true.size, 1.0 / chain.rate_hz, chain.rng(log, 8)))
    return np.asarray(np.minimum(noisy, 1.0))


def columns(chain: Chain, said: Results, time_s: Array) -> pd.DataFrame:
    """Perception columns at the rows: each result stands from when it is ready to the next one; none is before."""
    last = np.searchsorted(said.ready_s, time_s, side="right") - 1
    there = last >= 0
    return pd.DataFrame(
        {
            "frame_id": np.where(there, said.number[last], chain.first_id - 1),
            "image_class": np.where(there, said.surface[last], -1),
            "image_confidence": np.where(there, np.round(said.confidence[last], chain.digits), np.nan),
            "image_from_m": np.where(there, np.round(said.from_m[last], chain.digits), np.nan),
            "image_to_m": np.where(there, np.round(said.to_m[last], chain.digits), np.nan),
        }
    )
