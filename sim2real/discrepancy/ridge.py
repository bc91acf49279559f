"""Robust least squares with a normal prior, and the size and memory of what it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HUBER = 3.0
"""Residuals beyond this many standard deviations count by their size [-]."""
ROUNDS = 4
"""Rounds of reweighting."""
CHANNEL_GROUPS = ((0,), (1,), (2, 3), (4, 5), (6,))
"""Position, vehicle speed, front and rear wheel speeds, accelerometer: channels whose remainders have one size."""
FEWEST = 10
"""Blocks that a size is read from, at least."""
CLIPPED = 6.0
"""Remainders beyond this many medians do not widen the size any more [-]."""
MEMORY_BLOCKS = 6
"""Consecutive blocks whose sum tells how far the remainder remembers itself."""
START_MEMORY = 20.0
"""Memory that the first reading of the remainder's size begins with [blocks]."""
SCALE_ROUNDS = 5
"""Rounds in which size, memory and the columns' coefficients are read in turn."""


@dataclass(frozen=True)
class Scale:
    """What the best account leaves, and how much of it is independent.

    Attributes
    ----------
    size : array, shape (n, 7)
        Standard deviation per block and channel, in those of the noise; at least 1.
    memory : float
        How many consecutive blocks count as one [-].
    """

    size: Array
    memory: float


def huber(u: Array) -> Array:
    """Huber's loss: the square of noise, a line for outliers."""
    a = np.abs(u)
    return np.where(a < HUBER, u * u, 2.0 * HUBER * a - HUBER * HUBER)


def solve(z: Array, columns: Array, size: Array, temper: float, precision: Array) -> tuple[float, Array]:
    """Least cost over the columns' coefficients, and these.

    The cost is the robust loss of (z + columns b) / size over the temper, and the sum of precision b^2.

    Parameters
    ----------
    z : array, shape (n, 7)
        Whitened residuals as means of blocks.
    columns : array, shape (n, 7, k)
        What they change by per unit of each coefficient.
    size : array, shape (n, 7)
        See `Scale`.
    temper : float
        How much less the evidence counts than independent noise would [-].
    precision : array, shape (k,)
        Inverse variances of the coefficients' priors about 0.
    """
    scaled = np.asarray((z / size).ravel())
    rest: Array = scaled
    design = (columns / size[..., None]).reshape(len(scaled), -1)
    found: Array = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        weighed = design * (1.0 / (temper * np.maximum(1.0, np.abs(rest) / HUBER)))[:, None]
        inner = design.T @ weighed + np.diag(precision)
        found = np.asarray(np.linalg.solve(inner, -(weighed.T @ scaled)), dtype=np.float64)
        rest = np.asarray(scaled + design @ found, dtype=np.float64)
    return float(huber(rest).sum() / temper + (precision * found * found).sum()), found


def weighed(columns: Array, rest: Array, size: Array, temper: float) -> Array:
    """Columns, shape (n, 7, k), as rows of a least-squares problem with the robust weights of a remainder."""
    weight = 1.0 / (temper * np.maximum(1.0, np.abs(rest / size) / HUBER))
    return np.asarray((columns * (np.sqrt(weight) / size)[..., None]).reshape(-1, columns.shape[-1]))


def read_scale(rest: Array, live: NDArray[np.bool_], limit: NDArray[np.bool_]) -> Scale:
    """Size of a remainder, shape (n, 7), per group of channels near the tyres' limit and away from it; its memory."""
    size = np.ones(rest.shape)
    for group in CHANNEL_GROUPS:
        for near in (False, True):
            at = np.ix_(limit == near, np.array(group))
            values = rest[at][live[at]]
            if len(values) >= FEWEST:
                most = CLIPPED * np.median(np.abs(values)) + 1e-9
                size[at] = max(1.0, float(np.sqrt(np.mean(np.minimum(values**2, most**2)))))
    units = np.where(live, np.clip(rest / size, -HUBER, HUBER), 0.0)
    count = len(units) // MEMORY_BLOCKS
    if not count or not live.any():
        return Scale(size, 1.0)
    cut = slice(count * MEMORY_BLOCKS)
    sums = units[cut].reshape(count, MEMORY_BLOCKS, -1).sum(axis=1)
    number = live[cut].reshape(count, MEMORY_BLOCKS, -1).sum(axis=1)
    full = number > MEMORY_BLOCKS / 2
    square = float(np.mean(units[live] ** 2))
    memory = float(np.mean(sums[full] ** 2 / number[full])) / max(square, 1e-9) if full.any() else 1.0
    return Scale(size, max(1.0, memory))


def scale_beside(z: Array, columns: Array, limit: NDArray[np.bool_]) -> tuple[Scale, Array]:
    """Size and memory of what columns of one prior standard deviation leave, and that remainder, shape (n, 7)."""
    live, one = z != 0.0, np.ones(columns.shape[-1])
    scale, rest = Scale(read_scale(z, live, limit).size, START_MEMORY), z
    for _ in range(SCALE_ROUNDS):
        _, b = solve(z, columns, scale.size, scale.memory, one)
        rest = z + columns @ b
        scale = read_scale(rest, live, limit)
    return scale, rest
