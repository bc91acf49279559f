"""How large a camera's deviation is: what it changes, in units of what a chain without it differs by anyway.

Computed from the truth against the same chain without the deviation, so that classification errors, which hit both
alike, neither hide nor feign it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera_chain import POINTS, results
from .camera_reference import friction_shift, measured_at
from .camera_road import CameraRoad, Passage
from .camera_system import Chain, Fault, Results
from .severity import Size

Array = NDArray[np.floating[Any]]

PLACE_M = 0.1
"""Least spread of a border's place: that of a border itself."""
LEVEL = 0.03
"""Least spread of a log confidence: so well is a system's level known at all."""
REFERENCE = 0.012
"""Least spread of a friction's reference: so well is any known [-]."""
WRONG = 0.08
"""Least spread of a second's share of wrong classes [-]."""
BLOCK_S = 1.0
SLOW = {
    "white": 0.1,
    "slow": 0.5,
    "drifting": 0.25,
    "heavy_tailed": 0.1,
    "standing": 0.32,
    "vibrating": 0.1,
    "by_stretch": 0.32,
}
"""Share of a reference's noise that is left in a second's mean [-]."""


@dataclass(frozen=True)
class Stage:
    """A drive that a deviation is looked at in; `told` is road.yaml, `road` what is really there."""

    chain: Chain
    passage: Passage
    road: CameraRoad
    log: str


def gap_of(stage: Stage, fault: Fault, told: CameraRoad | None = None) -> Size:
    """Gap of a deviation, that of no signal being 1 in all [noise floors].

    A camera's deviation shows in one of its signals only, so they are summed, and not averaged as the car's are.
    """
    chain, passage, road, log = stage.chain, stage.passage, stage.road, stage.log
    plain = results(chain, passage, road, Fault(), log)
    said = results(chain, passage, road, fault, log)
    inside = plain.ready_s > 0.0
    moved = said.shift_m - plain.shift_m
    other = told if told is not None and fault.relabelled else None
    elsewhere = None if other else told
    parts = {
        "place": _place(stage, plain, moved, elsewhere or road),
        "confidence": _confidence(plain, said, inside),
        "class": _classes(plain, _mislabelled(said, road, other), inside),
        "friction": _friction(stage, fault, other),
    }
    return Size(float(np.sqrt(1.0 + sum(part**2 for part in parts.values()))), parts)


def _mislabelled(said: Results, road: CameraRoad, told: CameraRoad | None) -> Results:
    """With the results on stretches that road.yaml has another surface of as mistaken too."""
    if told is None:
        return said
    middle = 0.5 * (said.from_m + said.to_m)
    return replace(said, mistaken=said.mistaken | (road.class_at(middle) != told.class_at(middle)))


def crossings(passage: Passage, road: CameraRoad) -> Array:
    """Borders that the front axle came over in a drive [m]."""
    borders = road.borders
    return np.asarray(borders[(borders > passage.front_m[0]) & (borders < passage.front_m[-1])])


def _place(stage: Stage, plain: Results, moved: Array, told: CameraRoad) -> float:
    """Of where a class changes: root mean square over the borders."""
    chain, there = stage.chain, crossings(stage.passage, stage.road)
    if there.size == 0:
        return 0.0
    middle = 0.5 * (plain.from_m + plain.to_m)
    shift = np.interp(there, middle, moved)
    beside = np.searchsorted(stage.road.borders, there)
    shift = shift + stage.road.borders[beside] - told.borders[beside]
    step = np.interp(there, middle, np.gradient(middle))
    apart = (0.5 - np.mean(POINTS[chain.forms["belongs"]])) * np.interp(
        there, middle, plain.to_m - plain.from_m
    )
    odds = np.interp(there, middle, plain.odds)
    spread = np.sqrt(step**2 / 12.0 + apart**2 + step**2 * odds + PLACE_M**2)
    return float(np.sqrt(np.mean((shift / spread) ** 2)))


def _blocks(time_s: Array, values: Array) -> Array:
    """Means over `BLOCK_S`."""
    which = (time_s / BLOCK_S).astype(int)
    counts = np.bincount(which)
    sums = np.bincount(which, values)
    return np.asarray(sums[counts > 0] / counts[counts > 0])


def _confidence(plain: Results, said: Results, inside: NDArray[np.bool_]) -> float:
    """Of the log confidence: root mean square over the seconds."""
    time_s = plain.ready_s[inside]
    usual = _blocks(time_s, np.log(np.maximum(np.nan_to_num(plain.confidence[inside]), 0.05)))
    lost = _blocks(time_s, np.log(np.maximum(said.kept[inside], 0.02)))
    return float(np.sqrt(np.mean(lost**2)) / np.hypot(np.std(usual), LEVEL))


def _classes(plain: Results, said: Results, inside: NDArray[np.bool_]) -> float:
    """Of the class, where a deviation makes it that of something else: root mean square over the seconds."""
    time_s = plain.ready_s[inside]
    wrong = _blocks(time_s, said.mistaken[inside].astype(float))
    odds = float(np.mean(plain.odds))
    spread = np.hypot(np.sqrt(odds * (1.0 - odds) * wrong.size / time_s.size), WRONG)
    return float(np.sqrt(np.mean(wrong**2)) / spread)


def _friction(stage: Stage, fault: Fault, told: CameraRoad | None) -> float:
    """Of the friction's reference: root mean square over the seconds that have one."""
    chain = stage.chain
    if chain.reference_noise is None:
        return 0.0
    time_s = np.arange(0.0, stage.passage.end_s, 0.02)
    shift = friction_shift(chain, stage.passage, stage.road, fault, time_s, told)
    measured = measured_at(chain, stage.passage, time_s, stage.log)
    if not measured.any():
        return 0.0
    blocks = _blocks(time_s[measured], shift[measured])
    noise = SLOW[chain.forms["reference"]] * chain.reference_noise
    return float(np.sqrt(np.mean(blocks**2)) / np.hypot(noise, REFERENCE))
