"""A camera's chain: from where the car was to what the perception columns say, and what is hidden in it.

Whatever is drawn in a run is drawn alike with and without a hidden deviation, from generators of their own, so that a
deviation at its neutral value leaves the nominal columns bit for bit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .camera_faults import courses, jumps_m, kept_of, nod_of, outside_kept, pitch_of, shown_s
from .camera_outside_faults import extrapolated_m, rained_on, wandered_m
from .camera_road import CameraRoad, Passage, Whole
from .camera_system import BEHIND_M, HEIGHT_M, Chain, Fault, Results
from .camera_telling import classified, confidence_of, odds_of, voted
from .camera_timing import delivered, numbers, timing

Array = NDArray[np.floating[Any]]

POINTS = {
    "centre": (0.5,),
    "near": (1.0 / 3.0,),
    "majority": (0.1, 0.3, 0.5, 0.7, 0.9),
    "far": (2.0 / 3.0,),
    "wider": (-0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25),
}
"""Shares of the stamped stretch whose surface a result has; some look beyond it."""
OVERLAP, BOUNDS_M, LEAST_M = 1.5, (0.4, 2.0), 0.01
"""Of stretches that overlap, over the way of a cycle; of bounded ones, and of any."""
STAMP_M, WANDER_M, WANDER_S = 0.04, 0.06, 3.0
"""Noise of the stamps, white or wandering, and how long it wanders."""


def seen_at(distance_m: Array, pitch_rad: Array | float) -> Array:
    """Distance from the lens that a picture's point shows which the camera file has at `distance_m`.

    A pinhole over a flat road: nose down by `pitch_rad`, each point shows what is nearer.
    """
    turned = HEIGHT_M / np.tan(np.arctan(HEIGHT_M / distance_m) + pitch_rad)
    return np.where(np.asarray(pitch_rad) == 0.0, distance_m, turned)


def results(chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, log: str) -> Results:
    """All results of a drive; `road` is as it really is."""
    taken, ready = timing(chain, passage, log)
    at, length = passage.at(taken), _length(chain, passage, taken, ready)
    shown, nod = shown_s(chain, fault, passage, taken, log), nod_of(chain, passage, taken)
    pitch = pitch_of(chain, fault, taken.size) + nod
    places, shift = _places(chain, passage, shown, at, length, pitch)
    middle = places.mean(axis=0)
    really = _class_of(road, places)
    honest = _class_of(road, _places(chain, passage, taken, at, length, nod)[0])
    true, mistaken = _as_mistaken(chain, fault, (really, honest), middle, taken, log)
    by = courses(chain, middle, taken, log)
    kept = kept_of(chain, fault, passage.speed(shown), by)
    kept = kept * outside_kept(chain, fault, passage, taken, middle, really, log)
    border = _shows_border(chain, road, at, length, places)
    odds = odds_of(chain, border, really, middle, taken, log)
    surface, wrong, none = classified(chain, fault, true, odds, kept, log)
    confidence = confidence_of(chain, true, border, wrong, kept, taken, log)
    surface, ready = voted(chain, surface, ready)
    if fault.odometer != 0.0:
        shift = shift + fault.odometer * at
        at, length = at * (1.0 + fault.odometer), length * (1.0 + fault.odometer)
    if fault.jumped_m != 0.0:
        moved = jumps_m(chain, fault, taken, passage.end_s, log)
        at, shift = at + moved, shift + moved
    if fault.wandered_m != 0.0:
        off = wandered_m(chain, fault, taken, log)
        at, shift = at + off, shift + off
    if fault.stamp_age_s > 0.0:
        off = extrapolated_m(passage, taken, fault.stamp_age_s)
        at, shift = at + off, shift + off
    begin = at + chain.preview_m + _stamp_noise(chain, taken.size, log)
    which, there = delivered(chain, taken.size, log)
    told = Results(
        ready,
        np.arange(taken.size),
        np.where(none, -1, surface)[which],
        _unsaid(chain, np.clip(confidence, 0.0, 1.0), none)[which],
        begin[which],
        (begin + length)[which],
        shift[which],
        kept[which],
        mistaken[which],
        odds[which],
    )
    told = Results(*(getattr(told, name)[there] for name in Results.__dataclass_fields__))
    return replace(told, number=numbers(chain, taken, there))


def _length(chain: Chain, passage: Passage, taken: Array, ready: Array) -> Array:
    """Of the stamp [m]: what is driven in a cycle, to the next picture or while it works, or what the window shows."""
    kind = chain.forms["stamp"]
    if kind == "window":
        return np.full(taken.size, chain.window_m)
    if kind == "worked":
        return np.maximum(passage.at(taken + chain.work_s) - passage.at(taken), 0.05)
    if kind == "to_next":
        to_next = np.diff(passage.at(np.append(taken, taken[-1] + 1.0 / chain.rate_hz)))
        return np.maximum(to_next, LEAST_M)
    way = np.maximum(passage.speed(ready) / chain.rate_hz, LEAST_M)
    if kind == "bounded":
        return np.clip(way, *BOUNDS_M)
    return OVERLAP * way if kind == "overlapping" else way


def _places(
    chain: Chain, passage: Passage, shown_s: Array, at: Array, length: Array, pitch: Array
) -> tuple[Array, Array]:
    """Places whose surface a result has, shape (points, n), and how far the stamp is ahead of them, shape (n,) [m]."""
    shares = np.array(POINTS[chain.forms["belongs"]])[:, None]
    distance = chain.preview_m + BEHIND_M + shares * length
    really = passage.at(shown_s) - BEHIND_M + seen_at(distance, pitch)
    return really, (at - BEHIND_M + distance - really).mean(axis=0)


def _class_of(road: CameraRoad, places: Array) -> Whole:
    """Surface of most of the places, of equally many the least slippery one."""
    found = road.class_at(np.atleast_2d(places))
    return np.argmax([(found == surface).sum(axis=0) for surface in range(3)], axis=0)


def _shows_border(
    chain: Chain, road: CameraRoad, at: Array, length: Array, places: Array
) -> NDArray[np.bool_]:
    """Whether a picture shows more than one surface."""
    ends = (at + BEHIND_M, at + chain.preview_m + length + BEHIND_M)
    near, far = (_class_of(road, end) for end in ends)
    return np.asarray((near != far) | (np.ptp(road.class_at(places), axis=0) > 0))


def _as_mistaken(
    chain: Chain, fault: Fault, seen: tuple[Whole, Whole], middle: Array, taken: Array, log: str
) -> tuple[Whole, NDArray[np.bool_]]:
    """Classes as deviations make them, of what is `seen` and what an honest system would see; and which those are."""
    true, honest = seen
    mistaken = np.zeros(true.size, bool)
    if fault.frozen_s > 0.0:
        mistaken |= true != honest
    if fault.confused_m > 0.0:
        begin = fault.confused_from_m
        mistaken |= (middle >= begin) & (middle < begin + fault.confused_m)
        true = np.where(mistaken, np.array([1, 0, 1])[true], true)
    if fault.swapped > 0.0:
        swaps = (true == 1) & (chain.rng(log, 30).random(true.size) < fault.swapped)
        true, mistaken = np.where(swaps, 2, true), mistaken | swaps
    if fault.sticky_s > 0.0:
        begins = np.searchsorted(taken, taken - fault.sticky_s)
        stuck = np.array([true[b : i + 1].max() for i, b in enumerate(begins)])
        true, mistaken = stuck, mistaken | (stuck != true)
    if fault.rained > 0.0:
        true, rained = rained_on(chain, fault, true, taken, log)
        mistaken = mistaken | rained
    return true, mistaken


def _stamp_noise(chain: Chain, n: int, log: str) -> Array | float:
    """Of where the system believes to be [m]."""
    kind, rng = chain.forms["stamp_noise"], chain.rng(log, 32)
    if kind == "noisy":
        return STAMP_M * rng.standard_normal(n)
    if kind == "wandering":
        keep = np.exp(-1.0 / (chain.rate_hz * WANDER_S))
        pushes = rng.standard_normal(n) * np.sqrt(1.0 - keep**2)
        return np.asarray(WANDER_M * lfilter([1.0], [1.0, -keep], pushes))
    return 0.0


def _unsaid(chain: Chain, confidence: Array, none: NDArray[np.bool_]) -> Array:
    """The confidence of a result that says nothing."""
    kind = chain.forms["none_says"]
    if kind == "last":
        return confidence
    return np.where(none, np.nan if kind == "nan" else 0.0, confidence)
