"""Sensors that drift over seconds: how much, read off the log, and what a right model then leaves.

A car that drives straight turns left and right wheels alike, and what its model lacks shows in both. So the difference
of their residuals is the sensors' own, and what does not average out of it is drift. The other sensors are taken to
drift by the same share of their noise: they are of one rig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.drive import BLOCK_S, CHANNELS, WHEEL, Drive
from sim2real.noise import Noise
from sim2real.observer import Simulation

Array = NDArray[np.float64]

DRIFT_S = 3.0
"""Correlation time that a drift is taken to have [s]."""
MOST_DRIFT = 0.6
"""Greatest drift that is allowed for, in standard deviations of the noise on the grid of the diagnosis [-]."""
ALIKE = 2.0
"""Up to how much more variance than in the calmer axle is drift: a fault of one wheel shows in one axle [-]."""
DRAWS = 4
"""Drives of drawn drift that its effect is averaged over."""


def block_sums(rows: Array, length: int) -> Array:
    """Sums over blocks, divided by the root of the number of rows that count: of unit variance for white noise."""
    count = len(rows) // length
    cut = rows[: count * length].reshape(count, length, -1)
    used = np.maximum((cut != 0.0).sum(axis=1), 1)
    return cut.sum(axis=1) / np.sqrt(used)


def read_drift(drives: Sequence[Drive], noises: Sequence[Noise], residuals: Sequence[Array]) -> float:
    """Standard deviation of the drift, in those of the noise, from the differences of left and right wheels [-]."""
    squares = []
    for drive, noise, rest in zip(drives, noises, residuals, strict=True):
        length = drive.rows_in(BLOCK_S)
        scale = np.sqrt((1.0 + noise.correlation[WHEEL]) / (1.0 - noise.correlation[WHEEL]))
        z = (noise.whitened(rest) * noise.widening)[:, WHEEL]
        left_less_right = (z[:, 0::2] - z[:, 1::2]) / np.sqrt(2.0)
        excess = _spread(block_sums(np.nan_to_num(left_less_right), length)) - 1.0
        squares.append(np.maximum(excess, 0.0) / length * np.mean(scale**2))
    axles = [
        np.mean(known) for of_axle in np.transpose(squares) if len(known := of_axle[np.isfinite(of_axle)])
    ]
    if not axles:
        return 0.0
    return float(np.sqrt(min(np.mean(axles), ALIKE * min(axles), MOST_DRIFT**2)))


def _spread(sums: Array) -> Array:
    """Robust variance of each column; NaN where a wheel is not measured."""
    known = [np.abs(column[column != 0.0]) for column in sums.T]
    return np.array([(1.4826 * np.median(column)) ** 2 if len(column) else np.nan for column in known])


def with_drift(model: Simulation, drive: Drive, noise: Noise, drift: float, seed: int = 0) -> Noise:
    """The noise with what drifting sensors add to the blocks' means that a right model leaves, by drawn drifts."""
    if drift <= 0.0:
        return replace(noise, slow=np.zeros(len(CHANNELS)))
    generator = np.random.default_rng(seed)
    length, nominal = drive.rows_in(BLOCK_S), model.predict(drive).channels
    found = np.zeros(len(CHANNELS))
    for _ in range(DRAWS):
        off = drift * noise.sigma * _drawn(len(drive), drive.step_s, generator)
        moved = model.predict(replace(drive, measured=drive.measured + off)).channels
        rest = np.where(np.isfinite(drive.measured), off - (moved - nominal), np.nan)
        sums = block_sums(np.nan_to_num(noise.whitened(rest)), length)
        found += np.mean(np.square(sums), axis=0) / DRAWS
    return replace(noise, slow=found)


def _drawn(n: int, step_s: float, generator: np.random.Generator) -> Array:
    """First-order coloured noise of unit variance, shape (n, 7)."""
    slow = Noise(np.ones(len(CHANNELS)), np.full(len(CHANNELS), np.exp(-step_s / DRIFT_S)), np.ones((n, 1)))
    return slow.draw(n, generator)
