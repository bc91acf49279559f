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
from scipy.ndimage import uniform_filter1d

from sim2real.lattice import QUANTUM_RANGE, SMOOTHING_S, Lattice, Reading, coherence, is_digit

Array = NDArray[np.float64]

EXCESS = 0.15
"""Least coherence of the values with a lattice beyond that of the motion; of noise alone, three thousand lattices
leave less than 0.07 where there are two thousand values [-]."""
LEAST_SAMPLES = 2000
MOST_SAMPLES = 6000
SEARCH = 3000
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


def find_trace(time_s: Array, wheels: Sequence[Array]) -> Trace | None:
    """The lattice that all wheel speeds have a trace of, or None.

    Parameters
    ----------
    time_s : array, shape (n,)
        Times [s].
    wheels : sequence of array, shape (n,)
        Wheel speeds as logged [rad/s]; NaN where lost.
    """
    values = [w[np.isfinite(w)] for w in wheels]
    if sum(map(len, values)) < LEAST_SAMPLES:
        return None
    step_s = max(float(np.median(np.diff(time_s[np.isfinite(w)]))) for w in wheels)
    length = max(round(SMOOTHING_S / step_s), 3)
    motion = [uniform_filter1d(v, length) for v in values]
    spread = 1.4826 * float(np.median(np.abs(np.concatenate(values) - np.concatenate(motion))))
    if spread <= 0.0:
        return None
    thin = max(sum(map(len, values)) // MOST_SAMPLES, 1)
    seen, moved = (np.concatenate([v[::thin] for v in part]) for part in (values, motion))
    low, high = QUANTUM_RANGE[0] * spread, QUANTUM_RANGE[1] * spread
    reach = max(float(np.ptp(seen)), high)
    count = int(np.clip(4.0 * reach * (1.0 / low - 1.0 / high), 50, SEARCH))
    best, _ = _most(seen, moved, 1.0 / np.linspace(1.0 / high, 1.0 / low, count))
    near = 1.0 / np.linspace(1.0 / best - 1.0 / reach, 1.0 / best + 1.0 / reach, 201)
    quantum, excess = _most(seen, moved, near[(near >= low) & (near <= high)])
    if excess < EXCESS or is_digit(quantum):
        return None
    sigma = quantum * np.sqrt(-np.log(min(excess, 1.0))) / (np.sqrt(2.0) * np.pi)
    return Trace(quantum, float(sigma), step_s)


def _most(seen: Array, moved: Array, periods: Array) -> tuple[float, float]:
    """The period that the values agree with most beyond the motion, and by how much [-]."""
    beyond = coherence(seen, periods) - coherence(moved, periods)
    best = int(beyond.argmax())
    return float(periods[best]), float(beyond[best])


def common_trace(found: Sequence[Trace | None]) -> Trace | None:
    """The trace that most logs of a car share; None where they do not agree: chance has no memory."""
    there = sorted((t for t in found if t is not None), key=lambda t: t.quantum_rad_s)
    if not there:
        return None
    middle = there[len(there) // 2]
    alike = [t for t in there if abs(t.quantum_rad_s / middle.quantum_rad_s - 1.0) < ALIKE]
    return middle if 2 * len(alike) > len(found) and len(alike) > 1 else None
