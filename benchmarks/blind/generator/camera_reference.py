"""What else measures the friction: `mu_reference`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .camera_chain import Chain, Fault
from .camera_forms import CAMERA_FORMS
from .camera_road import CLASS_FRICTION, CameraRoad, Passage
from .kernel import RECORD_STEP_S

Array = NDArray[np.floating[Any]]

LOST, RUN_S, RUNS_EVERY_S = 0.02, (0.2, 1.5), 8.0
"""Share of samples lost one by one; duration of a run of lost ones, and from one to the next in the mean."""
LEAST, MOST = 0.0, 1.3


def reference(
    chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, time_s: Array, log: str
) -> Array | None:
    """`mu_reference` at the rows: the friction of the class under the front wheels; none without a reference [-]."""
    if chain.reference_noise is None:
        return None
    noise = CAMERA_FORMS["reference"][chain.forms["reference"]]
    assert noise is not None
    step = float(np.median(np.diff(time_s)))
    values = friction_under(chain, passage, road, fault, time_s)
    values = values + chain.reference_noise * noise(time_s.size, step, chain.rng(log, 12))
    values = np.round(np.clip(values, LEAST, MOST), 4)
    values[_lost(chain, time_s, log)] = np.nan
    return np.asarray(values)


def friction_under(chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, time_s: Array) -> Array:
    """What it would read without noise [-]."""
    true = np.array(fault.friction)[road.class_at(passage.front_m)]
    if chain.forms["reference_filter"] == "low_pass":
        keep = np.exp(-RECORD_STEP_S / chain.reference_s)
        true = lfilter([1.0 - keep], [1.0, -keep], true, zi=[keep * true[0]])[0]
    return np.asarray(np.interp(time_s, np.arange(true.size) * RECORD_STEP_S, true))


def friction_shift(chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, time_s: Array) -> Array:
    """By how much a deviation changes it [-]."""
    neutral = friction_under(chain, passage, road, Fault(friction=CLASS_FRICTION), time_s)
    return friction_under(chain, passage, road, fault, time_s) - neutral


def _lost(chain: Chain, time_s: Array, log: str) -> NDArray[np.bool_]:
    rng, kind = chain.rng(log, 13), chain.forms["reference_lost"]
    gone = np.zeros(time_s.size, bool)
    if kind == "samples":
        return np.asarray(rng.random(time_s.size) < LOST)
    at = time_s[0] + rng.exponential(RUNS_EVERY_S)
    while kind == "runs" and at < time_s[-1]:
        end = at + rng.uniform(*RUN_S)
        gone |= (time_s >= at) & (time_s < end)
        at = end + rng.exponential(RUNS_EVERY_S)
    return gone
