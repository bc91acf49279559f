"""What is left of a pulse counter's lattice where noise hides its steps.

Values that are counted and then disturbed lie nearer to the lattice's multiples than the car's motion would have them,
though no single value shows it. The motion itself is known well enough for that from the values' moving mean: what is
as coherent with a lattice as the motion is says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq

from sim2real.observing.lattice import Lattice, Reading, coherence, find_lattice, is_digit, read_wheels

Array = NDArray[np.float64]

EXCESS = 0.15
"""Least coherence of the values with a lattice beyond that of the motion; of noise alone, the best of ten thousand
lattices has less than 0.07 where there are two thousand values [-]."""
LEAST_SAMPLES = 2000
MOST_SAMPLES = 6000
RANGE = (0.6, 4.6)
"""Quanta that are looked for, in standard deviations of what is faster than the motion; what is held over a window lags
behind the motion, too [-]."""
BINS, FINER = 8, 4
"""Bins per least quantum, and steps of the search per one that the values' range tells from the next [-]."""
MOST_BINS = 2**21
"""Where the search would need more, the sensors are next to ideal, or a value is out of all bounds [-]."""
ALIKE = 0.005
"""How closely the logs of one car have to agree in the quantum [-]."""


@dataclass(frozen=True)
class Trace:
    """A lattice of which noise leaves a trace.

    Attributes
    ----------
    quantum_rad_s : float
        Step of the values [rad/s].
    sigma_rad_s : float
        Noise beside the rounding [rad/s].
    step_s : float
        The log's own [s].
    """

    quantum_rad_s: float
    sigma_rad_s: float
    step_s: float

    def aged(self, age_s: float) -> Lattice:
        """The lattice of a counter that makes the wheel speeds as late as this on average [s]."""
        return Lattice(self.quantum_rad_s, age_s, self.sigma_rad_s, self.step_s, Reading.AGED)


def find_counter(time_s: Array, wheels: Sequence[Array]) -> tuple[Lattice | None, Trace | None]:
    """What wheel speeds as logged, NaN where lost, tell of a counter: its lattice, or at least a trace of it."""
    lattice = find_lattice(time_s, wheels)
    return lattice, None if lattice else find_trace(time_s, wheels)


def find_trace(time_s: Array, wheels: Sequence[Array]) -> Trace | None:
    """The lattice that all wheel speeds have a trace of, or None.

    Parameters
    ----------
    time_s : array, shape (n,)
        Times [s].
    wheels : sequence of array, shape (n,)
        Wheel speeds as logged [rad/s]; NaN where lost.
    """
    read = read_wheels(time_s, wheels)
    if read is None or sum(map(len, read.values)) < LEAST_SAMPLES:
        return None
    values, spread = read.values, read.spread_rad_s
    best, excess = _most_traced(np.concatenate(values), np.concatenate(read.motion), spread)
    if excess < EXCESS:
        return None
    quantum, strength = _refined(values, best)
    if is_digit(quantum):
        return None
    sigma = quantum * np.sqrt(-np.log(min(strength, 1.0))) / (np.sqrt(2.0) * np.pi)
    return Trace(quantum, float(sigma), read.step_s)


def _most_traced(values: Array, motion: Array, spread: float) -> tuple[float, float]:
    """The quantum that the values agree with most beyond the motion, and by how much [-]."""
    low, high = (share * spread for share in RANGE)
    start, width = min(values.min(), motion.min()), low / BINS
    reach = max(values.max(), motion.max()) - start
    if FINER * max(reach, high) / width > MOST_BINS:
        return high, 0.0
    length = next_fast_len(int(FINER * max(reach, high) / width) + 1)
    rates = rfftfreq(length, width)
    looked = (rates >= 1.0 / high) & (rates <= 1.0 / low)

    def agreement(each: Array) -> Array:
        counts = np.bincount(((each - start) / width).astype(int), minlength=length)
        return np.abs(rfft(counts, length))[looked] / len(each)

    beyond = agreement(values) - agreement(motion)
    best = int(beyond.argmax())
    return float(1.0 / rates[looked][best]), float(beyond[best])


def _refined(values: Sequence[Array], quantum: float) -> tuple[float, float]:
    """The quantum nearby that the values agree with best, and how well [-]."""
    thin = max(sum(map(len, values)) // MOST_SAMPLES, 1)
    seen = np.concatenate([v[::thin] for v in values])
    near = 1.0 / (1.0 / quantum + np.linspace(-1.0, 1.0, 201) / max(float(np.ptp(seen)), quantum))
    found = coherence(seen, near := near[near > 0.0])
    best = int(found.argmax())
    return float(near[best]), float(found[best])


def common_trace(found: Sequence[Trace | None]) -> Trace | None:
    """The trace that most logs of a car share; None where they do not agree: chance has no memory."""
    there = sorted((t for t in found if t is not None), key=lambda t: t.quantum_rad_s)
    if not there:
        return None
    middle = there[len(there) // 2]
    alike = [t for t in there if abs(t.quantum_rad_s / middle.quantum_rad_s - 1.0) < ALIKE]
    return middle if 2 * len(alike) > len(found) and len(alike) > 1 else None
