"""Pulse-counting wheel-speed sensors: their values lie on a lattice and are held over a window.

Rounding is not noise that a model's prediction could beat, but it leaves a mark that nothing else does: the values
are multiples of one quantum, 2 pi / (teeth window), and change only when a window ends. A counter that reports at every
row what it counted over a longer window shows the window otherwise: a pulse adds to the count as it comes, and is taken
off again a window later.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from scenarios.effects.base import Signals
from scenarios.effects.shifting import delayed
from scenarios.effects.wheel_speed_quantisation import MOST_TEETH, WheelSpeedQuantisation

Array = NDArray[np.float64]

SMOOTHING_S = 0.3
"""What changes more slowly is motion, what is faster is rounding or noise [s]."""
QUANTUM_RANGE = (1.2, 4.6)
"""Quanta that are looked for, in standard deviations of the fast part: rounding of a difference of counts has a
standard deviation of 0.41 quanta, of a slowly moving value 0.29 [-]."""
LATTICE_COHERENCE = 0.6
"""Least coherence of the values with a lattice; Gaussian noise reaches 0.36 within the range looked at [-]."""
HOLD_COHERENCE = 0.6
"""Least coherence of the times at which values change: a log of two rows per window shows 0.64 of it [-]."""
CHANGES_S = 4.0
"""Time over which changes are looked at: over a longer one the window would have to be known too well [s]."""
FEWEST_CHANGES = 20
"""Changes of one wheel that a window is read from."""
LONGEST_WINDOW_S = 0.25
DIGITS = 2e-4
"""How closely the logarithm of a quantum has to be that of a round number for it to be one [-]."""
FIVES = 4
"""Greatest power of five in a round number."""
SEEN = 1.5
"""Least window that a log shows, in its steps; samples further apart have lost ones between them [-]."""
COARSER = 6
"""Multiples of the quantum that are held to be it if the values change by them alone."""
ALL_BUT_FEW = 0.9
"""Share of the changes that have to be such multiples: noise makes the others [-]."""
PULSE_LEAVES, NEXT_LEAVES = -0.35, -0.58
"""Correlation of the rounding's steps with those a window later, at most, where the counter runs along.

Without noise it is -1/2, and -2/3 where the window is the log's step; of roundings that have nothing in common -1/2
from row to row [-].
"""
COUNTED = 0.25
"""Variance of the steps from which on they are those of a count: of a difference of two roundings it is 1/3, of one
1/6 [squared quanta]."""
JITTER = 0.03
"""Scatter of the log's steps from which on its rows are not regular [steps]."""
UNSEEN = 0.1
"""A window that the log is too slow for may be as short as this share of the log's step [-]."""
FEWEST_SAMPLES, MOST_SAMPLES = 100, 1200
SEARCH = 3000


class Reading(StrEnum):
    """How a log shows a counter's window."""

    HELD = "changes every"
    RUNNING = "counts over the last"
    UNSEEN = "changes at any row and counts over less than"
    ROUNDED = "is rounded at every row; the window is not visible and assumed as"


@dataclass(frozen=True)
class SmoothCounter(WheelSpeedQuantisation):
    """The counter as a prediction takes it: its averaging and its age, without rounding.

    Where in a tooth and in a window the log began is not known, so the rounding itself cannot be foretold.
    """

    held: ClassVar[float] = 0.5
    """Age of a count on average, over the window [-]."""

    @property
    def step_rad_s(self) -> float:
        """What one pulse more makes of the speed [rad/s]."""
        return 2.0 * np.pi / (self.teeth * self.window_s) if self.window_s > 0.0 else 0.0

    def sense(self, time_s: Array, signals: Signals) -> Signals:
        """Each wheel's mean speed over a window, half a window old."""
        if self.window_s == 0.0:
            return signals
        read = {k: self._read(time_s, v) for k, v in signals.items() if k.startswith("wheel_speed_")}
        return {**signals, **read}

    def _read(self, time_s: Array, speed_rad_s: Array) -> Array:
        turned = cumulative_trapezoid(speed_rad_s, time_s, initial=0.0)
        before = np.interp(time_s - self.window_s, time_s, turned)
        span = np.minimum(self.window_s, time_s - time_s[0])
        mean = np.where(span > 0.0, (turned - before) / np.maximum(span, 1e-12), speed_rad_s)
        return delayed(time_s, mean, self.held * self.window_s) if self.held else mean


class RunningCounter(SmoothCounter):
    """One that reports at every row what it counted over the last window."""

    held = 0.0


@dataclass(frozen=True)
class Lattice:
    """What a pulse-counting sensor leaves in a log.

    Attributes
    ----------
    quantum_rad_s, window_s : float
        Step of the values [rad/s] and of their times [s].
    sigma_rad_s : float
        Noise beside the rounding [rad/s].
    step_s : float
        The log's own; a window of no more than it cannot be seen [s].
    reading : Reading
        How the log shows the window.
    """

    quantum_rad_s: float
    window_s: float
    sigma_rad_s: float
    step_s: float
    reading: Reading = Reading.HELD

    @property
    def teeth(self) -> int:
        """Pulses per revolution."""
        return max(round(2.0 * np.pi / (self.quantum_rad_s * self.window_s)), 1)

    @property
    def rounding_rad_s(self) -> float:
        """Standard deviation of the rounding: a count is the difference of two roundings [rad/s]."""
        return self.quantum_rad_s / np.sqrt(6.0)

    def effect(self) -> SmoothCounter:
        """The sensor that leaves it."""
        kind = RunningCounter if self.reading is Reading.RUNNING else SmoothCounter
        return kind(float(self.teeth), self.window_s)

    @property
    def window_range_s(self) -> tuple[float, float]:
        """What the window may be [s]."""
        if self.reading is Reading.ROUNDED:
            return UNSEEN * self.step_s, LONGEST_WINDOW_S
        seen = self.reading is not Reading.UNSEEN
        least = self.window_s - 0.5 * self.step_s if seen else UNSEEN * self.step_s
        return least, self.window_s + 0.5 * self.step_s

    @property
    def sentence(self) -> str:
        """What it is, in words."""
        return (
            f"All wheel speeds are multiples of {self.quantum_rad_s:.4g} rad/s, and each {self.reading} "
            f"{1e3 * self.window_s:.4g} ms."
        )

    @property
    def teeth_range(self) -> tuple[float, float]:
        """What the teeth may be: their product with the window is what the values tell."""
        short, long = self.window_range_s
        turns = 2.0 * np.pi / self.quantum_rad_s
        return turns / long - 0.5, turns / short + 0.5


@dataclass(frozen=True)
class Wheels:
    """Wheel speeds as logged, lost samples left out, and their slow part.

    Attributes
    ----------
    values, motion : list of array
        Of each wheel: what was read, and its moving mean [rad/s].
    step_s : float
        The longest of the wheels' own [s].
    spread_rad_s : float
        Standard deviation of what is faster than the motion, by its median; more than 0.
    """

    values: list[Array]
    motion: list[Array]
    step_s: float
    spread_rad_s: float


def read_wheels(time_s: Array, wheels: Sequence[Array]) -> Wheels | None:
    """Wheel speeds in which a lattice may be looked for; None where they are too few, or nothing in them is fast."""
    values = [w[np.isfinite(w)] for w in wheels]
    if min(len(v) for v in values) < FEWEST_SAMPLES:
        return None
    step_s = max(float(np.median(np.diff(time_s[np.isfinite(w)]))) for w in wheels)
    length = max(round(SMOOTHING_S / step_s), 3)
    motion = [uniform_filter1d(v, length) for v in values]
    spread = 1.4826 * float(np.median(np.abs(np.concatenate(values) - np.concatenate(motion))))
    return Wheels(values, motion, step_s, spread) if spread > 0.0 else None


def find_lattice(time_s: Array, wheels: Sequence[Array]) -> Lattice | None:
    """The lattice that all wheel speeds lie on, or None.

    Parameters
    ----------
    time_s : array, shape (n,)
        Times [s].
    wheels : sequence of array, shape (n,)
        Wheel speeds as logged [rad/s]; NaN where lost.
    """
    read = read_wheels(time_s, wheels)
    if read is None:
        return None
    values, step_s, spread = read.values, read.step_s, read.spread_rad_s
    pooled = np.concatenate([v[:: max(len(v) * 4 // MOST_SAMPLES, 1)] for v in values])
    quantum, strength = _best_quantum(pooled, QUANTUM_RANGE[0] * spread, QUANTUM_RANGE[1] * spread)
    if strength < LATTICE_COHERENCE:
        return None
    quantum = _coarsest(values, quantum)
    rest = np.concatenate([v - quantum * np.round(v / quantum) for v in values])
    window, reading = _held_window(time_s, wheels, quantum, step_s), Reading.HELD
    if window is None:
        window, reading = _running_window(wheels, quantum, step_s, regular=_jitter(time_s) < JITTER)
    found = Lattice(quantum, window, 1.4826 * float(np.median(np.abs(rest))), step_s, reading)
    return None if is_digit(quantum) or found.teeth > MOST_TEETH else found


def is_digit(quantum: float) -> bool:
    """Whether a quantum is the last digit of a file or of a bus signal: a product of powers of two and five."""
    turns = np.log2(quantum / 5.0 ** np.arange(-FIVES, FIVES + 1))
    return bool((np.abs(turns - np.round(turns)) < DIGITS).any())


def common_lattice(found: Sequence[Lattice | None]) -> Lattice | None:
    """The lattice that most logs of a car share: a sensor does not come and go."""
    there = [lattice for lattice in found if lattice is not None]
    if 2 * len(there) <= len(found):
        return None
    reading = Counter(lattice.reading for lattice in there).most_common(1)[0][0]
    alike = [lattice for lattice in there if lattice.reading is reading]
    middle = sorted(alike, key=lambda lattice: lattice.quantum_rad_s)[len(alike) // 2]
    windows = float(np.median([lattice.window_s for lattice in alike]))
    return replace(middle, window_s=windows)


def coherence(values: Array, periods: Array) -> Array:
    """How well values agree with multiples of each period, 0 to 1."""
    return np.array([abs(np.mean(np.exp(2j * np.pi * values / p))) for p in periods])


def _best_quantum(values: Array, low: float, high: float) -> tuple[float, float]:
    """The quantum with the greatest coherence, refined, and that coherence."""
    reach = max(float(np.ptp(values)), high)
    count = int(min(max(4.0 * reach * (1.0 / low - 1.0 / high), 50.0), SEARCH))
    periods = 1.0 / np.linspace(1.0 / high, 1.0 / low, count)
    found = coherence(values, periods)
    best = float(periods[int(found.argmax())])
    near = 1.0 / np.linspace(1.0 / best - 1.0 / reach, 1.0 / best + 1.0 / reach, 201)
    near = near[(near >= low) & (near <= high)]
    finer = coherence(values, near)
    return float(near[int(finer.argmax())]), float(finer.max())


def _coarsest(values: Sequence[Array], quantum: float) -> float:
    """The greatest multiple of a quantum by which the values change: a lattice lies on every finer one, too."""
    steps = np.concatenate([np.diff(np.round(v / quantum)) for v in values])
    steps = steps[steps != 0.0]
    pooled = np.concatenate(values)
    for times in range(COARSER, 1, -1):
        alike = np.mean(steps % times == 0.0) if len(steps) else 0.0
        if alike >= ALL_BUT_FEW and coherence(pooled, np.array([times * quantum]))[0] >= LATTICE_COHERENCE:
            return times * quantum
    return quantum


def _changes(time_s: Array, wheel: Array, quantum: float) -> Array:
    """Times at which a wheel's value changes, those across lost samples excepted: nobody knows when [s]."""
    there = np.isfinite(wheel)
    at, steps = time_s[there], np.round(wheel[there] / quantum)
    since = np.diff(at)
    return at[1:][(np.abs(np.diff(steps)) > 0.5) & (since < SEEN * np.median(since))]


def _held_window(time_s: Array, wheels: Sequence[Array], quantum: float, step_s: float) -> float | None:
    """The longest window at whose ends alone the values change; None where they change at any row [s]."""
    changes = [_changes(time_s, w, quantum) for w in wheels]
    # the counter's window need not be a multiple of the log's step, and the log sees its end a part of a step late
    early = [c[c < c[0] + CHANGES_S] - c[0] for c in changes if len(c)]
    early = [c for c in early if len(c) >= FEWEST_CHANGES]
    low, high = 1.0 / LONGEST_WINDOW_S, 1.0 / (SEEN * step_s)
    if high <= low or not early:
        return None

    def agreement(rates: Array) -> Array:
        """Each wheel's windows may begin at times of their own."""
        return np.asarray(np.mean([coherence(c, 1.0 / rates) for c in early], axis=0))

    rates = np.linspace(low, high, max(int(4.0 * CHANGES_S * (high - low)), 2))
    good = np.flatnonzero(agreement(rates) > HOLD_COHERENCE)
    if not len(good):
        return None
    near = rates[good[0]] + np.linspace(0.0, 1.0 / CHANGES_S, 41)
    return float(1.0 / near[int(agreement(near).argmax())])


def _jitter(time_s: Array) -> float:
    """Scatter of the log's steps, by their median, lost samples left out [steps]."""
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    return 1.4826 * float(np.median(np.abs(steps - step_s))) / step_s


def _running_window(
    wheels: Sequence[Array], quantum: float, step_s: float, regular: bool
) -> tuple[float, Reading]:
    """The window after which each pulse is taken off the count again [s], and how the log shows it.

    Where no such time shows, no row's pulses are another's, or it is no count at all: the log's step stands for it. Nor
    does it where the rows are not `regular`: then a pulse is taken off a part of a step after some row.
    """
    steps = [np.diff(v) for w in wheels if len(v := w[np.isfinite(w)]) > 2]
    steps = [d - uniform_filter1d(d, max(round(SMOOTHING_S / step_s), 3)) for d in steps]
    variance = np.mean([np.mean(d * d) for d in steps])
    lags = np.arange(1, min(round(LONGEST_WINDOW_S / step_s), min(map(len, steps)) - 1) + 1)
    again = np.array([np.mean([np.mean(d[lag:] * d[:-lag]) for d in steps]) for lag in lags]) / variance
    if len(lags) > 1 and again[1:].min() < PULSE_LEAVES:
        return float(lags[1 + int(again[1:].argmin())] * step_s), Reading.RUNNING
    if again[0] < NEXT_LEAVES:
        return step_s, Reading.RUNNING
    counted = regular and variance > COUNTED * quantum**2
    return step_s, Reading.UNSEEN if counted else Reading.ROUNDED
