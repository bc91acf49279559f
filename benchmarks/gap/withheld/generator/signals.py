"""What becomes of a signal on its way: late, held, averaged, filtered."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from .compiling import compiled
from .kernel import RECORD_STEP_S

Array = NDArray[np.floating[Any]]

BEAT_S = 0.7
"""In which two clocks of nearly the same cycle pass each other once."""
RELOCK_S, MISLOCK_S = 1.8, 0.25
"""Of a sensor that locks onto what it sees: in how long it goes wrong once, and how long it takes to notice."""
PAD_DAMPING = 0.12
"""Of a sensor on a soft pad, over the critical one."""
LOOP_DAMPING = 0.5
"""Of a loop that tracks a speed, over the critical one."""


def mislocked(time_s: Array, seed: int) -> Array:
    """1 while a sensor has locked onto something else, for `MISLOCK_S` in every `RELOCK_S`, and 0 else [-]."""
    cycle = np.floor(time_s / RELOCK_S).astype(int)
    begun = np.random.default_rng([seed, 19]).uniform(0.0, RELOCK_S - MISLOCK_S, cycle.max() + 1)[cycle]
    since = time_s - cycle * RELOCK_S - begun
    return np.asarray((since >= 0.0) & (since < MISLOCK_S), dtype=float)


def mean_age(filter_s: float) -> float:
    """How late a record's first-order filter makes a ramp [s]."""
    keep = np.exp(-RECORD_STEP_S / filter_s) if filter_s > 0.0 else 0.0
    return float(RECORD_STEP_S * keep / (1.0 - keep))


def beat(time_s: Array, size_s: float, phase: float) -> Array:
    """How much later than on average a value comes whose sender's clock passes the reader's [s]."""
    return size_s * (np.mod(time_s / BEAT_S + phase, 1.0) - 0.5)


def ringing(signal: Array, period_s: float) -> Array:
    """A record as a sensor on a soft pad reads it, which swings with the period."""
    if period_s == 0.0:
        return signal
    rate = 2.0 * np.pi / period_s
    pad = [rate**2], [1.0, 2.0 * PAD_DAMPING * rate, rate**2]
    (told,), given, _ = cont2discrete(pad, RECORD_STEP_S, method="foh")
    return np.asarray(lfilter(told, given, signal, zi=lfilter_zi(told, given) * signal[0])[0])


def lag(signal: Array, time_constant_s: float) -> Array:
    """What a first-order low pass makes of a record."""
    if time_constant_s == 0.0:
        return signal
    keep = np.exp(-RECORD_STEP_S / time_constant_s)
    return lfilter([1.0 - keep], [1.0, -keep], signal, zi=[keep * signal[0]])[0]


@compiled
def limited(signal: Array, rate: float) -> Array:
    """A record that follows by `rate` per second at most."""
    out, most = signal.copy(), rate * RECORD_STEP_S
    for i in range(1, out.size):
        out[i] = out[i - 1] + min(max(signal[i] - out[i - 1], -most), most)
    return out


@compiled
def tracked(signal: Array, loop_s: float) -> Array:
    """A record that a loop of second order follows: not late on a ramp, but beyond the mark where one ends."""
    out, rate, value = signal.copy(), 0.0, signal[0]
    for i in range(1, out.size):
        value += rate * RECORD_STEP_S
        off = signal[i] - value
        value += 2.0 * LOOP_DAMPING * off / loop_s * RECORD_STEP_S
        rate += off / loop_s**2 * RECORD_STEP_S
        out[i] = value
    return out


@compiled
def played(signal: Array, play: float) -> Array:
    """A record that follows only when it is `play` behind, either way."""
    out = signal.copy()
    for i in range(1, out.size):
        out[i] = min(max(out[i - 1], signal[i] - play), signal[i] + play)
    return out


def hold(signal: Array, duration_s: float, rng: Generator) -> Array:
    """Dropouts: every second or two the last value stands for `duration_s`."""
    if duration_s == 0.0:
        return signal
    source = np.arange(signal.size)
    at = 0.0
    while (at := at + duration_s + rng.uniform(0.7, 2.0)) < signal.size * RECORD_STEP_S:
        start = int(at / RECORD_STEP_S)
        source[start : start + int(duration_s / RECORD_STEP_S)] = start
    return signal[source]
