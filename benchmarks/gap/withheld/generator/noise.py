"""Kinds of noise: each gives the noise of all readings, of the size that `Noise` tells, shape (m, 6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from .sensors import Noise, noise_of

Array = NDArray[np.floating[Any]]

TAIL = 5.0
"""Degrees of freedom: one sample in 300 beyond four standard deviations, and the spread still settles in a log."""
DRIFT_SHARE, DRIFT_S = 0.06, 3.0
"""Of the variance, and the correlation time: a quarter of the noise is slow, too little to be taken for a bias."""
LOUDER, BURST_S, QUIET_S = 2.0, 0.3, 2.0
"""Of noise in bursts: how much louder, and mean durations."""
FLICKER_SHARE, FLICKER_S = 0.25, (0.02, 0.06, 0.2, 0.6, 2.0)
"""Of the variance, and the correlation times whose sum falls with the frequency."""
WANDERS, WANDER_S = (0.1, 0.3), (1.0, 10.0)
"""Of the standard deviation, and the correlation time."""
HUM_SHARE, HUM_HZ, HUM_DECAY_S = 0.2, (10.0, 35.0), 0.15
"""Of the variance; frequency, and how long a hum rings."""
SPIKE, SPIKES = 6.0, 0.002
"""Of a switching inverter's spikes: size over the standard deviation, share of the samples."""
SHARED = 0.35
"""Of the variance of the wheels' noise: what shakes all of them."""
BAND_HZ, BAND_SHARE = (15.0, 35.0), 0.9
"""Corner of a sensor's own filter, and the share of the variance that has passed it; the rest comes after."""
MAINS_HZ, MAINS_SHARE = (49.9, 50.1), 0.2
"""Of a laboratory's supply, and its share of the variance; a slow log folds it to a low frequency."""
POPS_SHARE, POPS_S = 0.1, 0.4
"""Of the variance: what jumps between two levels; how long it stays, in the mean."""
SUPPLY_SHARE = 0.3
"""Of the variance: what all sensors get from the supply that they share."""
STONES_SHARE, STONES_S, STONE_HZ, STONE_DECAY_S = 0.3, 0.6, (12.0, 30.0), 0.08
"""Of the variance: what rings where a wheel hits something; from one to the next, frequency, decay."""
ROUGHER, ROUGH_S, SMOOTH_S = 1.7, 2.0, 3.0
"""Of a rough stretch of road: how much louder all is, and mean durations on and off it."""
SKEW = 6.0
"""Shape of the gamma distribution of a reading that errs further to one side."""
CHIRP_SHARE, CHIRP_HZ, CHIRP_S = 0.15, (15.0, 45.0), (4.0, 9.0)
"""Of the variance: a tone of the drive; the frequencies that it goes between, and the time that it takes."""
OWN_SHARE, OWN_S = (0.1, 0.6), (0.003, 0.03)
"""Of each reading's coloured part: share of the variance, correlation time."""
AXLE_SHARE = 0.4
"""Of the variance of the wheels' noise: what both wheels of an axle have alike."""
YAW_SHARE, YAW_S = 0.15, 0.3
"""Of the variance of the wheels' noise: what small turns of the steering wheel add on one side and take on the other;
their correlation time."""
LOOSER = (0.4, 1.2)
"""By which the noise is more in the end than in the beginning, over its mean: a connector that works loose."""
OWN_RATE_HZ = (60.0, 120.0)
"""Of sensors that sample by clocks of their own, before a tool has put all on one."""
TONES_SHARE, TONES_HZ, BEAT_HZ = 0.25, (18.0, 40.0), (0.2, 1.2)
"""Of the variance: two tones of nearly one frequency, as of two pumps or fans; their frequency and its difference."""
SPAN_S = (0.004, 0.025)
"""Over which a sensor takes the mean of what it samples, before it tells it."""
KEPT_SHARE = 0.2
"""Of a reading's variance: what a converter still holds of the channel that it read before."""
UPDATES_HZ = (70.0, 140.0)
"""Of sensors whose last sample stands until the next."""


def heavy_tailed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White noise with Student's t distribution, shape (m, 6)."""
    return rng.standard_t(TAIL, (time_s.size, 6)) * np.sqrt(1.0 - 2.0 / TAIL) * noise.sigmas


def drifting(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a drift over seconds, shape (m, 6)."""
    slow = replace(noise, coloured_share=1.0, correlation_s=DRIFT_S)
    fast = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - DRIFT_SHARE) * fast + np.sqrt(DRIFT_SHARE) * noise_of(slow, time_s, rng)


def bursting(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading louder for some tenths of a second every few seconds, shape (m, 6)."""
    louder = np.ones((time_s.size, 6))
    for reading in louder.T:
        at = time_s[0] + rng.exponential(QUIET_S)
        while at < time_s[-1]:
            end = at + rng.exponential(BURST_S)
            reading[slice(*np.searchsorted(time_s, [at, end]))] = LOUDER
            at = end + rng.exponential(QUIET_S)
    return noise_of(noise, time_s, rng) * louder / np.sqrt(np.mean(louder**2, axis=0))


def flickering(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and in part with a density that falls with the frequency, shape (m, 6)."""
    white = replace(noise, coloured_share=0.0)
    parts = [replace(noise, coloured_share=1.0, correlation_s=time) for time in FLICKER_S]
    slow = sum(noise_of(part, time_s, rng) for part in parts) / np.sqrt(len(parts))
    return np.sqrt(1.0 - FLICKER_SHARE) * noise_of(white, time_s, rng) + np.sqrt(FLICKER_SHARE) * slow


def wandering(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a drift, each log and reading with its own size and time, shape (m, 6)."""
    values = noise_of(noise, time_s, rng)
    for reading in range(6):
        share = rng.uniform(*WANDERS) ** 2
        slow = replace(noise, coloured_share=1.0, correlation_s=float(np.exp(rng.uniform(*np.log(WANDER_S)))))
        drift = noise_of(slow, time_s, rng)[:, reading]
        values[:, reading] = np.sqrt(1.0 - share) * values[:, reading] + np.sqrt(share) * drift
    return values


def humming(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part what shakes at a frequency of its own, shape (m, 6)."""
    step = np.median(np.diff(time_s))
    values = noise_of(noise, time_s, rng) / noise.sigmas
    for reading in range(6):
        hertz, keep = rng.uniform(*HUM_HZ), np.exp(-step / HUM_DECAY_S)
        lead = round(10.0 * HUM_DECAY_S / step)
        filtered = [1.0, -2.0 * keep * np.cos(2.0 * np.pi * hertz * step), keep**2]
        gain = np.sqrt(np.sum(lfilter([1.0], filtered, np.arange(lead) == 0) ** 2))
        shakes = lfilter([1.0], filtered, rng.standard_normal(time_s.size + lead))[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - HUM_SHARE) * values[:, reading] + np.sqrt(HUM_SHARE) * shakes
    return values * noise.sigmas


def spiking(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, with spikes, shape (m, 6)."""
    values = noise_of(noise, time_s, rng) / noise.sigmas
    spikes = rng.choice([-SPIKE, SPIKE], values.shape) * (rng.random(values.shape) < SPIKES)
    return (values + spikes) / np.sqrt(1.0 + SPIKES * SPIKE**2) * noise.sigmas


def shaking_together(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, of the four wheels in part the same, shape (m, 6)."""
    values = noise_of(noise, time_s, rng)
    common = noise_of(noise, time_s, rng)[:, :1]
    values[:, :4] = np.sqrt(1.0 - SHARED) * values[:, :4] + np.sqrt(SHARED) * common
    return values


def band_limited(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """What a sensor's filter lets through, each its own, and a little white noise after it, shape (m, 6)."""
    rate = 1.0 / float(np.median(np.diff(time_s)))
    values = noise_of(replace(noise, coloured_share=0.0), time_s, rng) / noise.sigmas
    lead = int(rate)
    for reading in range(6):
        filtered = butter(2, rng.uniform(*BAND_HZ), fs=rate)
        gain = np.sqrt(np.sum(lfilter(*filtered, np.arange(lead) == 0) ** 2))
        passed = lfilter(*filtered, rng.standard_normal(time_s.size + lead))[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - BAND_SHARE) * values[:, reading] + np.sqrt(BAND_SHARE) * passed
    return values * noise.sigmas


def mains(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part the mains' hum, of all readings at one frequency, shape (m, 6)."""
    hertz, phases = rng.uniform(*MAINS_HZ), rng.uniform(0.0, 2.0 * np.pi, 6)
    hum = np.sqrt(2.0) * np.sin(2.0 * np.pi * hertz * time_s[:, None] + phases)
    return (
        np.sqrt(1.0 - MAINS_SHARE) * noise_of(noise, time_s, rng) + np.sqrt(MAINS_SHARE) * hum * noise.sigmas
    )


def popping(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a level that jumps, each reading's at its own moments, shape (m, 6)."""
    step = float(np.median(np.diff(time_s)))
    jumps = rng.random((time_s.size, 6)) < step / POPS_S
    level = rng.choice([-1.0, 1.0], 6) * (1.0 - 2.0 * (np.cumsum(jumps, axis=0) % 2))
    return (
        np.sqrt(1.0 - POPS_SHARE) * noise_of(noise, time_s, rng) + np.sqrt(POPS_SHARE) * level * noise.sigmas
    )


def shared_supply(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part the same in all readings, shape (m, 6)."""
    common = noise_of(noise, time_s, rng)[:, :1] / noise.sigmas[0]
    own = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - SUPPLY_SHARE) * own + np.sqrt(SUPPLY_SHARE) * common * noise.sigmas


def bounded(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and as likely anywhere within its bounds, shape (m, 6)."""
    return np.sqrt(3.0) * rng.uniform(-1.0, 1.0, (time_s.size, 6)) * noise.sigmas


def stones(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part what rings after each of some hits, in all readings at once, shape (m, 6)."""
    step, values = float(np.median(np.diff(time_s))), noise_of(noise, time_s, rng) / noise.sigmas
    lead = round(10.0 * STONE_DECAY_S / step)
    hits = rng.standard_normal(time_s.size + lead) * (rng.random(time_s.size + lead) < step / STONES_S)
    keep = np.exp(-step / STONE_DECAY_S)
    for reading in range(6):
        turn = 2.0 * np.pi * rng.uniform(*STONE_HZ) * step
        filtered = [1.0, -2.0 * keep * np.cos(turn), keep**2]
        gain = np.sqrt(np.sum(lfilter([1.0], filtered, np.arange(lead) == 0) ** 2) * step / STONES_S)
        rings = lfilter([1.0], filtered, hits)[lead:] / gain
        values[:, reading] = np.sqrt(1.0 - STONES_SHARE) * values[:, reading] + np.sqrt(STONES_SHARE) * rings
    return values * noise.sigmas


def rough_stretches(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, all readings louder together where the road is rough, shape (m, 6)."""
    louder, at = np.ones(time_s.size), time_s[0] + rng.exponential(SMOOTH_S)
    while at < time_s[-1]:
        end = at + rng.exponential(ROUGH_S)
        louder[slice(*np.searchsorted(time_s, [at, end]))] = ROUGHER
        at = end + rng.exponential(SMOOTH_S)
    return noise_of(noise, time_s, rng) * (louder / np.sqrt(np.mean(louder**2)))[:, None]


def skewed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, each reading erring seldom and far to one side, often and little to the other, shape (m, 6)."""
    sides = rng.choice([-1.0, 1.0], 6)
    return sides * (rng.gamma(SKEW, 1.0, (time_s.size, 6)) - SKEW) / np.sqrt(SKEW) * noise.sigmas


def chirping(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part a tone that goes up and down, each reading with its own phase, shape (m, 6)."""
    low, high = CHIRP_HZ
    turn, start = 2.0 * np.pi / rng.uniform(*CHIRP_S), rng.uniform(0.0, 2.0 * np.pi)
    hertz = 0.5 * (low + high) + 0.5 * (high - low) * np.sin(turn * time_s + start)
    phase = 2.0 * np.pi * np.cumsum(hertz * np.gradient(time_s))
    tone = np.sqrt(2.0) * np.sin(phase[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6))
    rest = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - CHIRP_SHARE) * rest + np.sqrt(CHIRP_SHARE) * tone * noise.sigmas


def own_colours(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading with its own share and correlation time, shape (m, 6)."""
    values = np.empty((time_s.size, 6))
    for reading in range(6):
        correlation = float(np.exp(rng.uniform(*np.log(OWN_S))))
        own = replace(noise, coloured_share=float(rng.uniform(*OWN_SHARE)), correlation_s=correlation)
        values[:, reading] = noise_of(own, time_s, rng)[:, reading]
    return values


def by_axle(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, of the two wheels of an axle in part the same, shape (m, 6)."""
    values, common = noise_of(noise, time_s, rng), noise_of(noise, time_s, rng)[:, [0, 0, 2, 2]]
    values[:, :4] = np.sqrt(1.0 - AXLE_SHARE) * values[:, :4] + np.sqrt(AXLE_SHARE) * common
    return values


def yawing(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and of the wheels in part the slow opposite of the other side's, shape (m, 6)."""
    steering = replace(noise, coloured_share=1.0, correlation_s=YAW_S)
    turns = noise_of(steering, time_s, rng)[:, :1] * np.array([1.0, -1.0, 1.0, -1.0])
    values = noise_of(noise, time_s, rng)
    values[:, :4] = np.sqrt(1.0 - YAW_SHARE) * values[:, :4] + np.sqrt(YAW_SHARE) * turns
    return values


def working_loose(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White and coloured, each reading's ever louder by its own share, shape (m, 6)."""
    gone = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    louder = 1.0 + rng.uniform(*LOOSER, 6) * (gone[:, None] - 0.5)
    return noise_of(noise, time_s, rng) * louder / np.sqrt(np.mean(louder**2, axis=0))


def resampled(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White at each sensor's own rate, on straight lines between its samples, shape (m, 6)."""
    values, gone = np.empty((time_s.size, 6)), time_s - time_s[0]
    for reading in range(6):
        at = gone * rng.uniform(*OWN_RATE_HZ) + rng.uniform()
        last = np.floor(at).astype(int)
        part, own = at - last, rng.standard_normal(last[-1] + 2)
        joined = (1.0 - part) * own[last] + part * own[last + 1]
        values[:, reading] = joined / np.sqrt(np.mean((1.0 - part) ** 2 + part**2))
    return values * noise.sigmas


def beating_tones(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and in part two tones that swell and fade together, each reading's its own, shape (m, 6)."""
    phases, hertz = rng.uniform(0.0, 2.0 * np.pi, (2, 6)), rng.uniform(*TONES_HZ, 6)
    other = hertz + rng.uniform(*BEAT_HZ, 6)
    turns = 2.0 * np.pi * time_s[:, None]
    tones = np.sin(turns * hertz + phases[0]) + np.sin(turns * other + phases[1])
    rest = noise_of(noise, time_s, rng)
    return np.sqrt(1.0 - TONES_SHARE) * rest + np.sqrt(TONES_SHARE) * tones * noise.sigmas


def meaned(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, and then the mean over a span of each sensor's own, shape (m, 6)."""
    step, values = float(np.median(np.diff(time_s))), np.empty((time_s.size, 6))
    for reading in range(6):
        rows = max(round(rng.uniform(*SPAN_S) / step), 1)
        white = rng.standard_normal(time_s.size + rows - 1)
        values[:, reading] = np.convolve(white, np.ones(rows), "valid") / np.sqrt(rows)
    return values * noise.sigmas


def multiplexed(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White, coloured, and of each reading in part the one before it, shape (m, 6)."""
    own = noise_of(noise, time_s, rng) / noise.sigmas
    kept = np.roll(own, 1, axis=1)
    return (np.sqrt(1.0 - KEPT_SHARE) * own + np.sqrt(KEPT_SHARE) * kept) * noise.sigmas


def standing(noise: Noise, time_s: Array, rng: Generator) -> Array:
    """White at each sensor's own rate, each sample standing until the next, shape (m, 6)."""
    values, gone = np.empty((time_s.size, 6)), time_s - time_s[0]
    for reading in range(6):
        last = np.floor(gone * rng.uniform(*UPDATES_HZ) + rng.uniform()).astype(int)
        values[:, reading] = rng.standard_normal(last[-1] + 1)[last]
    return values * noise.sigmas


NOISES: dict[str, Callable[[Noise, Array, Generator], Array]] = {
    "white_and_coloured": noise_of,
    "heavy_tailed": heavy_tailed,
    "drifting": drifting,
    "bursting": bursting,
    "flickering": flickering,
    "wandering": wandering,
    "humming": humming,
    "spiking": spiking,
    "shaking_together": shaking_together,
    "band_limited": band_limited,
    "mains": mains,
    "popping": popping,
    "shared_supply": shared_supply,
    "bounded": bounded,
    "stones": stones,
    "rough_stretches": rough_stretches,
    "skewed": skewed,
    "chirping": chirping,
    "own_colours": own_colours,
    "by_axle": by_axle,
    "yawing": yawing,
    "working_loose": working_loose,
    "resampled": resampled,
    "beating_tones": beating_tones,
    "meaned": meaned,
    "multiplexed": multiplexed,
    "standing": standing,
}
