"""What else measures the friction: `mu_reference`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import lfilter

from .camera_faults import acceleration
from .camera_forms import function
from .camera_outside_faults import pushed_share
from .camera_road import CLASS_FRICTION, CameraRoad, Passage
from .camera_system import Chain, Fault
from .kernel import RECORD_STEP_S

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

LOST, RUN_S, RUNS_EVERY_S = 0.02, (0.2, 1.5), 8.0
"""Share of samples lost one by one; duration of a run of lost ones, and from one to the next in the mean."""
LEAST, MOST = 0.0, 1.3
OWN_S = (0.05, 0.1, 0.2)
"""From one value to the next of a reference with a rate of its own."""
SLIPPING = 0.5
"""Share of a drive that is pushed or braked enough to tell the friction."""
MEASURED_S, UNMEASURED_S = (3.0, 8.0), (1.0, 3.0)
"""Of a reference that is there at times."""
MOVING_M_S = 4.0
"""Speed from which a reference is there that wants a rolling wheel, at most half of a drive's mean speed."""
BESIDE_S = (0.1, 0.4)
"""How long a reference says nothing once a wheel is on another surface."""
OF_STRETCH = 0.3
"""Share of the noise that is a stretch's own, the same whenever it is driven on."""
STEPS = {"fine": 1e-4, "hundredths": 0.01, "fiftieths": 0.02}
UNLIKE = 0.12
"""By which a class's deviation is more on one of its stretches and less on the next."""


def reference(
    chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, time_s: Array, log: str
) -> Array | None:
    """`mu_reference` at the rows: the friction of the class under the front wheels; none without a reference [-]."""
    if chain.reference_noise is None:
        return None
    values = friction_under(chain, passage, road, fault, time_s)
    values = values + chain.reference_noise * _noise(chain, passage, road, time_s, log)
    values = np.clip(values, LEAST, MOST)
    kind, coarse = chain.forms["reference_rate"], STEPS[chain.forms["reference_steps"]]
    values = (
        np.round(values, 4) if coarse == STEPS["fine"] else np.round(np.round(values / coarse) * coarse, 4)
    )
    if kind != "each_row":
        every = np.floor(time_s / float(chain.rng("", 35).choice(OWN_S)) + chain.rng(log, 36).random())
        fresh = np.diff(every, prepend=every[0] - 1.0) > 0.0
        held = values[np.maximum.accumulate(np.where(fresh, np.arange(time_s.size), 0))]
        values = held if kind == "held" else np.where(fresh, values, np.nan)
    values[_lost(chain, passage, road, time_s, log) | ~measured_at(chain, passage, time_s, log)] = np.nan
    return np.asarray(values)


def _noise(chain: Chain, passage: Passage, road: CameraRoad, time_s: Array, log: str) -> Array:
    """Of unit size [-]."""
    rng, step = chain.rng(log, 12), float(np.median(np.diff(time_s)))
    if chain.forms["reference"] == "by_stretch":  # surveyed beforehand, so that a stretch's error stays
        own = chain.rng(str(len(road.surface)), 44).standard_normal(len(road.surface))
        under = own[np.searchsorted(road.borders, passage.at(time_s), side="right")]
        return np.asarray(
            np.sqrt(1.0 - OF_STRETCH**2) * rng.standard_normal(time_s.size) + OF_STRETCH * under
        )
    return np.asarray(function(chain.forms, "reference")(time_s.size, step, rng))


def measured_at(chain: Chain, passage: Passage, time_s: Array, log: str) -> Flags:
    """Whether there is a reference at a time, but for lost samples."""
    kind, there = chain.forms["reference_when"], np.ones(time_s.size, bool)
    if kind == "slipping":
        clock = np.arange(0.0, passage.end_s, 0.02)
        enough = np.quantile(np.abs(acceleration(passage, clock)), 1.0 - SLIPPING)
        return np.asarray(np.abs(acceleration(passage, time_s)) >= enough)
    if kind == "moving":
        return np.asarray(passage.speed(time_s) >= min(MOVING_M_S, 0.5 * float(passage.speed_m_s.mean())))
    if kind == "at_times":
        rng, at = chain.rng(log, 37), 0.0
        while (at := at + rng.uniform(*MEASURED_S)) < time_s[-1]:
            end = at + rng.uniform(*UNMEASURED_S)
            there &= (time_s < at) | (time_s >= end)
            at = end
    return there


def friction_of(chain: Chain, road: CameraRoad, fault: Fault) -> Array:
    """What each stretch of the road really has [-]."""
    surface, true = np.array(road.surface), np.array(fault.friction)
    if chain.forms["friction_off"] != "each_stretch":
        return np.asarray(true[surface])
    usual, nth = np.array(CLASS_FRICTION), np.zeros(surface.size, int)
    for s in range(3):
        nth[surface == s] = np.arange(np.count_nonzero(surface == s))
    unlike = 1.0 + UNLIKE * np.where(nth % 2 == 0, 1.0, -1.0)
    return np.asarray(np.round(usual[surface] + (true - usual)[surface] * unlike, 4))


def friction_under(chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, time_s: Array) -> Array:
    """What it would read without noise [-]."""
    under = passage.front_m
    if fault.measured_late_s > 0.0:
        under = passage.at(np.arange(under.size) * RECORD_STEP_S - fault.measured_late_s)
    true = friction_of(chain, road, fault)[np.searchsorted(road.borders, under, side="right")]
    if fault.measured_speed > 0.0:
        mean = passage.speed_m_s.mean()
        true = true * (1.0 - fault.measured_speed * (passage.speed_m_s - mean) / mean)
    if fault.measured_push > 0.0:
        clock = np.arange(under.size) * RECORD_STEP_S
        true = true * pushed_share(fault, acceleration(passage, clock))
    kind, rows = chain.forms["reference_filter"], round(chain.reference_s / RECORD_STEP_S)
    if kind == "low_pass":
        keep = np.exp(-RECORD_STEP_S / chain.reference_s)
        true = lfilter([1.0 - keep], [1.0, -keep], true, zi=[keep * true[0]])[0]
    elif kind == "mean":  # of what has been, over twice the time
        true = uniform_filter1d(true, 2 * rows, mode="nearest", origin=rows - 1)
    elif kind == "rate_limited":  # as fast as the largest step between classes in twice the time
        true = _rate_limited(true, float(np.ptp(CLASS_FRICTION)) / (2.0 * chain.reference_s))
    elif kind == "middle":  # the same
        thinned = median_filter(true[::10], rows // 5, mode="nearest", origin=max(rows // 10 - 1, 0))
        true = np.repeat(thinned, 10)[: true.size]
    return np.asarray(np.interp(time_s, np.arange(true.size) * RECORD_STEP_S, true))


def _rate_limited(true: Array, most: float) -> Array:
    """Following at `most` a second, every tenth of the record's steps [-]."""
    step, now, followed = 10.0 * RECORD_STEP_S * most, float(true[0]), []
    for value in true[::10].tolist():
        now += min(max(value - now, -step), step)
        followed.append(now)
    return np.repeat(followed, 10)[: true.size]


def friction_shift(
    chain: Chain,
    passage: Passage,
    road: CameraRoad,
    fault: Fault,
    time_s: Array,
    told: CameraRoad | None = None,
) -> Array:
    """By how much a deviation, or another road as it is `told`, changes it [-]."""
    neutral = friction_under(chain, passage, told or road, Fault(friction=CLASS_FRICTION), time_s)
    return friction_under(chain, passage, road, fault, time_s) - neutral


def _lost(chain: Chain, passage: Passage, road: CameraRoad, time_s: Array, log: str) -> Flags:
    rng, kind = chain.rng(log, 13), chain.forms["reference_lost"]
    gone = np.zeros(time_s.size, bool)
    if kind == "samples":
        return np.asarray(rng.random(time_s.size) < LOST)
    if kind == "beside_borders":
        before = passage.at(time_s - chain.rng("", 46).uniform(*BESIDE_S))
        return np.asarray(np.diff(np.searchsorted(road.borders, [before, passage.at(time_s)]), axis=0)[0] > 0)
    at = time_s[0] + rng.exponential(RUNS_EVERY_S)
    while kind == "runs" and at < time_s[-1]:
        end = at + rng.uniform(*RUN_S)
        gone |= (time_s >= at) & (time_s < end)
        at = end + rng.exponential(RUNS_EVERY_S)
    return gone
