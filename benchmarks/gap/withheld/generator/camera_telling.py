"""What a camera's system makes of its pictures: classes with errors, how sure it is, and the columns of the log."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import lfilter

from .camera_forms import function
from .camera_road import Whole
from .camera_system import Chain, Fault, Results

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

MISTAKEN = {
    "usual": np.array([[0.0, 0.85, 0.15], [0.85, 0.0, 0.15], [0.3, 0.7, 0.0]]),
    "grippier": np.array([[0.0, 0.9, 0.1], [0.95, 0.0, 0.05], [0.1, 0.9, 0.0]]),
    "slippery": np.array([[0.0, 0.6, 0.4], [0.1, 0.0, 0.9], [0.2, 0.8, 0.0]]),
}
"""What a surface is taken for when a result is wrong."""
MOST_WRONG = 0.45
"""Odds of an error in a picture that shows nothing [-]."""
MOST_ODDS = 0.3
"""Of an ordinary error."""
HARDLY, SILENT = 0.15, 0.6
"""Share of the usual errors of poor pictures that a robust system makes, and that a careful one says nothing at."""
ONE_CLASS = (2.0, 0.5)
"""Errors on the class that is hard and on the others, over the mean."""
PATCH_M, PATCHES, ON_PATCH = 2.5, 0.1, (6.0, 0.44)
"""Length and share of the patches that look like something else, and errors on and beside them over the mean."""
SPELL_S, SPELLS, IN_SPELL = 0.7, 0.15, (4.0, 0.47)
"""The same of spells of time."""
SHADE_M, SHADED, IN_SHADE = 35.0, 0.35, (4.0, 0.6)
"""From one row of trees to the next, the share of the road in their shadow, and errors on dry road there and elsewhere
over the mean."""
HELD = 0.5
"""Share of the usual errors of poor pictures in place of which a system tells the last class again."""
COARSE = {"coarse": 20.0, "bytes": 255.0, "three_bits": 7.0}
"""Steps of the confidence from 0 to 1."""
SMOOTH = 0.3
"""Share of the newest result in a running mean."""
SURER = 0.25
"""What an overconfident system leaves of its doubt."""
DIP, RECOVERS_S = 0.12, 0.5
"""What a change of the class takes of the confidence, and how long it takes to come back."""
LOWER = 0.03
"""What the hard class's confidence is less."""
WANDERS_S = (15.0, 40.0)
"""Over which a level goes up and down by as much."""
LOST_ROWS = 0.02
STEPS_M = {"fine": 0.0, "decimetres": 0.1, "quarters": 0.25}


def odds_of(chain: Chain, border: Flags, surface: Whole, place_m: Array, taken: Array, log: str) -> Array:
    """Of an ordinary error [-]."""
    odds = chain.errors * np.where(border, chain.more_at_border, 1.0)
    kind = chain.forms["error_odds"]
    if kind == "one_class":
        odds = odds * np.where(surface == chain.rng("", 24).integers(3), *ONE_CLASS)
    elif kind == "at_patches":
        bad = chain.rng("", 25).random(1600) < PATCHES
        odds = odds * np.where(bad[np.clip(place_m / PATCH_M, 0, bad.size - 1).astype(int)], *ON_PATCH)
    elif kind == "at_times":
        bad = chain.rng(log, 29).random(200) < SPELLS
        odds = odds * np.where(bad[np.clip(taken / SPELL_S, 0, bad.size - 1).astype(int)], *IN_SPELL)
    elif kind == "in_shadows":
        shade = (place_m / SHADE_M + chain.rng("", 25).random()) % 1.0 < SHADED
        odds = odds * np.where(shade & (surface == 0), *IN_SHADE)
    return np.clip(odds, 0.0, MOST_ODDS)


def classified(
    chain: Chain, fault: Fault, true: Whole, odds: Array, kept: Array, log: str
) -> tuple[Whole, Flags, Flags]:
    """Classes with errors, which results are wrong, and which say nothing."""
    n, kind = true.size, chain.forms["poor_pictures"]
    errors = function(chain.forms, "errors")
    mistaken = MISTAKEN[chain.forms["mistaken_for"]]
    poor = (1.0 - kept) ** 2 * (HARDLY if kind == "hardly" else 1.0)
    more = (MOST_WRONG - odds) * poor
    wrong = errors(odds + more, chain.rng(log, 6))
    taken_for = (chain.rng(log, 7).random(n)[:, None] > np.cumsum(mistaken[true], axis=1)).sum(axis=1)
    taken_for = np.minimum(taken_for, 2)
    none = chain.rng(log, 9).random(n) < chain.none
    if kind == "one_way":
        all_alike = wrong & (chain.rng(log, 23).random(n) * (odds + more) < more)
        taken_for = np.where(all_alike, 2 if fault.stops > 0.0 else 1 if fault.stops < 0.0 else 0, taken_for)
        wrong = wrong & (taken_for != true)
    elif kind == "say_none":
        none = none | (chain.rng(log, 23).random(n) < SILENT * poor)
    elif kind == "hold_last":
        held = chain.rng(log, 23).random(n) < HELD * poor
        held[:1] = False
        last = np.maximum.accumulate(np.where(held, 0, np.arange(n)))
        said = np.where(wrong, taken_for, true)[last]
        return said, said != true, none
    return np.where(wrong, taken_for, true), wrong, none


def confidence_of(
    chain: Chain, true: Whole, border: Flags, wrong: Flags, kept: Array, taken: Array, log: str
) -> Array:
    """Q_v [-]."""
    noise = function(chain.forms, "confidence")
    level, kind = np.array(chain.level), chain.forms["told_confidence"]
    if chain.forms["levels"] == "one_lower":
        level = level - LOWER * (np.arange(3) == chain.rng("", 24).integers(3))
    values = level[true]
    if chain.forms["levels"] == "wandering":
        rng = chain.rng(log, 43)
        values = values * (
            1.0 + LOWER * np.sin(2.0 * np.pi * (taken / rng.uniform(*WANDERS_S) + rng.random()))
        )
    values = values * (1.0 - chain.border_dip * border) * (1.0 - chain.wrong_dip * wrong)
    if chain.forms["border_memory"] == "recovers":
        changed = np.flatnonzero(np.diff(true, prepend=true[:1]))
        last = np.searchsorted(changed, np.arange(true.size), side="right") - 1
        since = np.where(last >= 0, taken - taken[np.append(changed, 0)[last]], np.inf)
        values = values * (1.0 - DIP * np.exp(-since / RECOVERS_S))
    noisy = values * np.exp(chain.spread * noise(true.size, 1.0 / chain.rate_hz, chain.rng(log, 8)))
    sure = np.minimum(noisy, float(level.mean()) if kind == "capped" else 1.0)
    if kind == "overconfident":
        sure = 1.0 - SURER * (1.0 - sure)
    sure = sure * kept
    if kind == "smoothed":
        sure = lfilter([SMOOTH], [1.0, SMOOTH - 1.0], sure, zi=[(1.0 - SMOOTH) * sure[0]])[0]
    if kind in COARSE:
        sure = np.round(sure * COARSE[kind]) / COARSE[kind]
    return np.asarray(sure)


def voted(chain: Chain, surface: Whole, ready: Array) -> tuple[Whole, Array]:
    """What neighbours agree on, told one result later, or two, and stamped as before."""
    kind = chain.forms["voted"]
    if kind == "each":
        return surface, ready
    if kind == "of_five":
        return _of_five(chain, surface, ready)
    later = np.append(ready[1:], ready[-1] + 1.0 / chain.rate_hz)
    before, after = np.append(surface[:1], surface[:-1]), np.append(surface[1:], surface[-1:])
    if kind == "of_three":
        return np.where(before == after, before, surface), later
    said = surface.copy()
    for i in range(1, said.size):
        said[i] = surface[i] if surface[i] == after[i] else said[i - 1]
    return said, later


def _of_five(chain: Chain, surface: Whole, ready: Array) -> tuple[Whole, Array]:
    """The class that three of five have, else one's own."""
    n, around = surface.size, np.pad(surface, 2, mode="edge")
    votes = np.array([sum(around[i : i + n] == s for i in range(5)) for s in range(3)])
    most = votes.argmax(axis=0)
    last = ready[-1:] + np.array([1.0, 2.0]) / chain.rate_hz
    return np.where(votes.max(axis=0) >= 3, most, surface), np.append(ready, last)[2:]


def columns(chain: Chain, said: Results, time_s: Array, log: str = "") -> pd.DataFrame:
    """Perception columns at the rows: each result stands from when it is ready to the next one; none is before."""
    last = np.searchsorted(said.ready_s, time_s, side="right") - 1
    there = last >= 0
    begin, end = _stamps(chain, said)
    seen = pd.DataFrame(
        {
            "frame_id": np.where(there, said.number[last], _before(chain)),
            "image_class": np.where(there, said.surface[last], -1),
            "image_confidence": np.where(there, np.round(said.confidence[last], chain.digits), np.nan),
            "image_from_m": np.where(there, np.round(begin[last], chain.digits), np.nan),
            "image_to_m": np.where(there, np.round(end[last], chain.digits), np.nan),
        }
    )
    return _logged(chain, seen, np.diff(last, prepend=-1) > 0, log)


def _logged(chain: Chain, seen: pd.DataFrame, fresh: Flags, log: str) -> pd.DataFrame:
    """With the samples that the logger has; all columns of a result come in one message."""
    kind = chain.forms["rows"]
    if kind == "each":
        return seen
    gone = np.arange(len(seen)) % 2 == 1
    if kind == "lost_samples":
        gone = chain.rng(log, 34).random(len(seen)) < LOST_ROWS
    elif kind == "on_arrival":
        gone = ~fresh
    return pd.DataFrame({name: values.mask(gone) for name, values in seen.items()})


def _before(chain: Chain) -> int:
    """`frame_id` before the first result."""
    number = chain.first_id - 1
    return number % 256 if chain.forms["numbering"] == "wraps" else number


def _stamps(chain: Chain, said: Results) -> tuple[Array, Array]:
    """In the steps that they are told in, and never of no length."""
    step = STEPS_M[chain.forms["stamp_steps"]]
    if step == 0.0:
        return said.from_m, said.to_m
    begin = np.round(said.from_m / step) * step
    return begin, np.maximum(np.round(said.to_m / step) * step, begin + step)
