"""What becomes of a signal on its way: late, held, averaged, filtered."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from .compiling import compiled
from .details import WAIT_S
from .kernel import RECORD_STEP_S
from .motors import BEAT_S

Array = NDArray[np.floating[Any]]

SLOW_S = (5.3, 11.0, 17.0)
"""Periods of what a bias wanders by."""
JUMP_S = 3.5
"""From one jump of a scale to the next."""
FAN_S, COOLING_S = 4.0, 3.0
"""How long a box's fan runs, and stands; how fast what is in it follows."""
RELOCK_S, MISLOCK_S = 1.8, 0.25
"""Of a sensor that locks onto what it sees: in how long it goes wrong once, and how long it takes to notice."""
PAD_DAMPING = 0.12
"""Of a sensor on a soft pad, over the critical one."""
LOOP_DAMPING = 0.5
"""Of a loop that tracks a speed, over the critical one."""
MOST_PACED = 3.0
"""How much older than at the usual speed a value that comes with the distance may be."""


def slow(time_s: Array, seed: int) -> Array:
    """What a bias wanders by, of size 1 at most [-]."""
    phases = np.random.default_rng([seed, 14]).uniform(0.0, 2.0 * np.pi, len(SLOW_S))
    waves = [np.sin(2.0 * np.pi * time_s / s + phase) for s, phase in zip(SLOW_S, phases, strict=True)]
    return np.mean(waves, axis=0)


def paced(turning: Array, usual: float) -> Array:
    """How much older than at the `usual` speed a value is that takes a distance, over its age there [-]."""
    return np.asarray(np.minimum(usual / np.maximum(turning, 1e-3), MOST_PACED) - 1.0)


def jumping(time_s: Array, seed: int) -> Array:
    """One of two levels, every `JUMP_S` the other [-]."""
    phase = np.random.default_rng([seed, 16]).uniform(0.0, 2.0)
    return 1.0 - 2.0 * (np.floor(time_s / JUMP_S + phase) % 2.0)


def cycling(time_s: Array, seed: int) -> Array:
    """What warms up and cools down in turn, of size 1 [-]."""
    half = np.mod(time_s / FAN_S + np.random.default_rng([seed, 18]).uniform(0.0, 2.0), 2.0)
    most = np.tanh(0.5 * FAN_S / COOLING_S)
    risen = (1.0 - (1.0 + most) * np.exp(-np.mod(half, 1.0) * FAN_S / COOLING_S)) / most
    return np.asarray(np.where(half < 1.0, risen, -risen))


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


def wait(time_s: Array, size_s: float, waits: Array) -> Array:
    """How much later than on average a value comes whose message had to wait for others [s]."""
    return size_s * waits[np.clip(time_s / WAIT_S, 0, waits.size - 1).astype(int)]


def beat(time_s: Array, size_s: float, phase: float) -> Array:
    """How much later than on average a value comes whose sender's clock passes the reader's [s]."""
    return size_s * (np.mod(time_s / BEAT_S + phase, 1.0) - 0.5)


def joined(record: Array, signal: Array, message_s: float, phase: float) -> Array:
    """The signal as straight lines between its messages."""
    if message_s == 0.0:
        return signal
    sent = np.arange(phase * message_s, record[-1], message_s)
    return np.interp(record, sent, np.interp(sent, record, signal))


def extrapolated(record: Array, signal: Array, message_s: float, phase: float) -> Array:
    """The signal as each message and the one before it let one expect it until the next."""
    if message_s == 0.0:
        return signal
    sent = np.arange(phase - 2.0, record[-1] / message_s + 1.0) * message_s
    told = np.interp(sent, record, signal)
    last = np.searchsorted(sent, record, side="right") - 1
    rate = (told[last] - told[last - 1]) / message_s
    return np.asarray(told[last] + rate * (record - sent[last]))


def middle(signal: Array, over_s: float) -> Array:
    """The middle one of all values over `over_s` around each of a record's."""
    if over_s == 0.0:
        return signal
    half = int(0.5 * over_s / RECORD_STEP_S)
    return np.asarray(median_filter(signal, size=2 * half + 1, mode="nearest"))


def fitted(signal: Array, over_s: float) -> Array:
    """The slope of a line through the places of `over_s` around each of a record's values.

    By least squares, so that a speed counts by how far from both ends it was: as a parabola.
    """
    if over_s == 0.0:
        return signal
    half = int(0.5 * over_s / RECORD_STEP_S)
    weights = 1.0 - (np.arange(-half, half + 1) / (half + 1.0)) ** 2
    return np.convolve(np.pad(signal, half, "edge"), weights / weights.sum(), "valid")


def ringing(signal: Array, period_s: float) -> Array:
    """A record as a sensor on a soft pad reads it, which swings with the period."""
    if period_s == 0.0:
        return signal
    rate = 2.0 * np.pi / period_s
    pad = [rate**2], [1.0, 2.0 * PAD_DAMPING * rate, rate**2]
    (told,), given, _ = cont2discrete(pad, RECORD_STEP_S, method="foh")
    return np.asarray(lfilter(told, given, signal, zi=lfilter_zi(told, given) * signal[0])[0])


def sent(at: Array, message_s: float, phase: float, lost: float, seed: int) -> Array:
    """The messages' times nearest to `at` [s]; of a lost one, that of the last that was not."""
    if message_s == 0.0:
        return at
    sent = np.floor(at / message_s - phase + 0.5)
    if lost > 0.0:
        number = (sent - sent.min()).astype(int)
        kept = np.random.default_rng([seed, 15]).random(number.max() + 1) >= lost
        kept[0] = True
        sent = sent.min() + np.maximum.accumulate(np.where(kept, np.arange(kept.size), 0))[number]
    return (sent + phase) * message_s


def mean(record: Array, signal: Array, at: Array, over_s: float) -> Array:
    """Mean of the signal over `over_s` around `at`; what it was when the record began stands for all before."""
    if over_s == 0.0:
        return np.interp(at, record, signal)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]))]) * RECORD_STEP_S

    def until(end: Array) -> Array:
        return np.interp(end, record, area) + signal[0] * np.minimum(end, 0.0)

    return (until(at + 0.5 * over_s) - until(at - 0.5 * over_s)) / over_s


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
