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
from scipy.optimize import nnls

from sim2real.observing.drive import BLOCK_S, CHANNELS, WHEEL, Drive
from sim2real.observing.noise import Noise
from sim2real.observing.observer import Simulation

Array = NDArray[np.float64]

DRIFT_S = (0.3, 1.0, 3.0)
"""Correlation times that a drift is made up of: flicker noise has all of them, a drifting zero the longest [s]."""
LENGTHS_S = (0.2, 0.6, 2.0)
"""Blocks whose means tell them apart [s]."""
MOST_DRIFT = 1.0
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


def read_drift(drives: Sequence[Drive], noises: Sequence[Noise], residuals: Sequence[Array]) -> Array:
    """Standard deviations of the drift's parts, one per correlation time of `DRIFT_S`, in those of the noise [-].

    From the differences of left and right wheels: the variance of their blocks' means over several lengths is a sum of
    what each part makes of it.
    """
    excess = []
    for seconds in LENGTHS_S:
        sums, whites = [], []
        for drive, noise, rest in zip(drives, noises, residuals, strict=True):
            scale = np.sqrt((1.0 + noise.correlation[WHEEL]) / (1.0 - noise.correlation[WHEEL]))
            z = (noise.whitened(rest) * noise.widening)[:, WHEEL] * np.mean(scale)
            left_less_right = (z[:, 0::2] - z[:, 1::2]) / np.sqrt(2.0)
            found = block_sums(np.nan_to_num(left_less_right), drive.rows_in(seconds))
            sums.append(np.where(found == 0.0, np.nan, found))
            whites.append(np.mean(scale) ** 2)
        # each log's own, by how much it has a say in the spread
        say = [np.count_nonzero(np.isfinite(found)) for found in sums]
        if not any(say):
            return np.zeros(len(DRIFT_S))
        white = np.average(whites, weights=say)
        axles = _spread(np.concatenate(sums)) - white
        known = np.maximum(axles[np.isfinite(axles)], 0.0)
        if not len(known):
            return np.zeros(len(DRIFT_S))
        excess.append(min(float(np.mean(known)), ALIKE * float(known.min())))
    longest = max(drives, key=len)
    rows = np.array([longest.rows_in(seconds) for seconds in LENGTHS_S])
    makes = np.array([[_of_blocks(n, longest.step_s / tau) for tau in DRIFT_S] for n in rows])
    weight = 1.0 / rows  # longer blocks are fewer, and hold more
    squares, _ = nnls(makes * weight[:, None], np.array(excess) * weight)
    return np.asarray(np.sqrt(squares * min(1.0, MOST_DRIFT**2 / max(float(squares.sum()), 1e-12))))


def _of_blocks(rows: int, rate: float) -> float:
    """Variance of `block_sums` of first-order noise of unit variance that forgets at a rate per row."""
    lags = np.arange(1, rows)
    return float(1.0 + 2.0 * np.sum((1.0 - lags / rows) * np.exp(-rate * lags)))


def _spread(sums: Array) -> Array:
    """Robust variance of each column; NaN where a wheel is not measured."""
    known = [np.abs(column[np.isfinite(column)]) for column in sums.T]
    return np.array([(1.4826 * np.median(column)) ** 2 if len(column) else np.nan for column in known])


def with_drift(model: Simulation, drive: Drive, noise: Noise, drift: Array) -> Noise:
    """The noise with what drifting sensors add to the blocks' means that a right model leaves, by drawn drifts."""
    if not np.any(drift > 0.0):
        return replace(noise, slow=np.zeros(len(CHANNELS)))
    parts = [(tau_s, np.full(len(CHANNELS), share)) for share, tau_s in zip(drift, DRIFT_S, strict=True)]
    return replace(noise, slow=left_of(model, drive, noise, [parts])[0][0])


def left_of(
    model: Simulation, drive: Drive, noise: Noise, drifts: Sequence[Sequence[tuple[float, Array]]]
) -> tuple[Array, Array]:
    """Variances that a right model leaves of drifting sensors, by drawn drifts: of the blocks' sums, and of the rows.

    A drift is a sum of parts: correlation time [s], and of each channel how much, in deviations of its noise [-].
    Both are of shape (drifts, 7), and NaN for rows of what is not measured.
    """
    length, nominal = drive.rows_in(BLOCK_S), model.predict(drive).channels
    lost = ~np.isfinite(drive.measured)
    known = np.maximum((~lost).sum(axis=0), 1)
    blocks, rows = np.zeros((2, len(drifts), len(CHANNELS)))
    for i, parts in enumerate(drifts):
        generator = np.random.default_rng(0)
        for _ in range(DRAWS):
            off = noise.sigma * sum(
                share * _drawn(len(drive), drive.step_s / tau_s, generator) for tau_s, share in parts
            )
            moved = model.predict(replace(drive, measured=drive.measured + off)).channels
            rest = np.where(lost, np.nan, off - (moved - nominal))
            sums = block_sums(np.nan_to_num(noise.whitened(rest)), length)
            blocks[i] += np.mean(np.square(sums), axis=0) / DRAWS
            rows[i] += np.nansum(np.square(noise.scaled(rest)), axis=0) / known / DRAWS
    return blocks, np.where(lost.all(axis=0), np.nan, rows)


def _drawn(n: int, rate: float, generator: np.random.Generator) -> Array:
    """First-order coloured noise of unit variance that forgets at a rate per row, shape (n, 7)."""
    slow = Noise(np.ones(len(CHANNELS)), np.full(len(CHANNELS), np.exp(-rate)), np.ones((n, 1)))
    return slow.draw(n, generator)
