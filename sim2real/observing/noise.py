"""The sensors' noise, read off the log itself, and residuals in units of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from sim2real.observing.drive import CHANNELS, WHEEL, Drive

Array = NDArray[np.float64]

RESOLUTION = np.array([0.02, 0.002, 0.01, 0.01, 0.01, 0.01, 0.01])
"""Least standard deviation that a channel is credited with, each in its unit: digits in files, integrators."""
LONG_LAG_S = 0.04
"""Lag at which sensor noise has forgotten itself, and a gap has hardly changed yet [s]."""
MOST_CORRELATION = 0.9
"""Greatest correlation from row to row that is taken for noise [-]."""
FEWEST = 50
"""Differences that a channel's noise must be read from."""


@dataclass(frozen=True)
class Noise:
    """Noise of one drive's channels: first-order autoregressive.

    Attributes
    ----------
    sigma : array, shape (7,)
        Standard deviation, in each channel's unit.
    correlation : array, shape (7,)
        From row to row [-].
    widening : array, shape (n, 7)
        By how much more than by noise a right model may be off at each row [-], see `sim2real.observing.doubt`.
    slow : array, shape (7,)
        What drifting sensors add to the variance of the blocks' means, 1 without [-], see `sim2real.observing.drift`.
    """

    sigma: Array
    correlation: Array
    widening: Array
    slow: Array = field(default_factory=lambda: np.zeros(len(CHANNELS)))

    def scaled(self, residuals: Array) -> Array:
        """Residuals in standard deviations, shape (n, 7)."""
        return residuals / (self.sigma * self.widening)

    def whitened(self, residuals: Array) -> Array:
        """Residuals without what the row before foretells of them, in standard deviations, shape (n, 7)."""
        z = residuals / self.sigma
        rest = (z[1:] - self.correlation * z[:-1]) / np.sqrt(1.0 - self.correlation**2)
        first = z[:1]
        return np.concatenate([first, np.where(np.isfinite(rest), rest, z[1:])]) / self.widening

    def sharper(self, other: Noise) -> Noise:
        """Of two readings the smaller one, channel by channel; the doubt is the other's."""
        smaller = other.sigma < self.sigma
        sigma = np.where(smaller, other.sigma, self.sigma)
        correlation = np.where(smaller, other.correlation, self.correlation)
        share = other.sigma / sigma
        return Noise(sigma, correlation, np.sqrt(1.0 + (other.widening**2 - 1.0) * share**2))

    def draw(self, n: int, generator: np.random.Generator) -> Array:
        """Noise of n rows, shape (n, 7), in each channel's unit."""
        white = generator.standard_normal((n, len(CHANNELS)))
        out = np.empty_like(white)
        out[0] = white[0]
        fresh = np.sqrt(1.0 - self.correlation**2)
        for k in range(1, n):
            out[k] = self.correlation * out[k - 1] + fresh * white[k]
        return out * self.sigma


def read_noise(drive: Drive, residuals: Array, doubt: Array) -> Noise:
    """Noise from the second differences of a model's residuals at a short and a long lag.

    What the model lacks changes slowly or rarely, so that the median of the differences is the noise's. The two lags
    tell its standard deviation and its correlation apart.

    Parameters
    ----------
    drive : Drive
        The drive.
    residuals : array, shape (n, 7)
        Measured minus predicted, NaN where lost.
    doubt : array, shape (n, 7)
        What a right model's prediction may be off by, in each channel's unit.
    """
    long_lag = max(round(LONG_LAG_S / drive.step_s), 2)
    sigma, correlation = RESOLUTION.copy(), np.zeros(len(CHANNELS))
    rows = np.where(drive.moving[:, None], residuals, np.nan)
    for i in range(len(CHANNELS)):
        short, far = _spread(rows[:, i], 1), _spread(rows[:, i], long_lag)
        if short is None or far is None or far <= 0.0:
            continue
        rho = _correlation(short / far, long_lag)
        sigma[i] = max(np.sqrt(far / _second_difference(rho**long_lag)), RESOLUTION[i])
        correlation[i] = rho if sigma[i] > RESOLUTION[i] else 0.0
    if drive.lattice is not None:  # most rows may lie on one step, and the median knows nothing of the others
        sigma[WHEEL] = np.maximum(sigma[WHEEL], drive.lattice.rounding_rad_s)
    return Noise(sigma, correlation, widening(doubt, sigma))


def widening(doubt: Array, sigma: Array) -> Array:
    """By how much more than by noise a prediction with a doubt may be off, shape of `doubt` [-]."""
    return np.asarray(np.sqrt(1.0 + (doubt / sigma) ** 2))


def _spread(values: Array, lag: int) -> float | None:
    """Robust variance of the second difference; None with too few samples."""
    second = values[: -2 * lag] - 2.0 * values[lag:-lag] + values[2 * lag :]
    second = second[np.isfinite(second)]
    if len(second) < FEWEST:
        return None
    return float((1.4826 * np.median(np.abs(second))) ** 2)


def _second_difference(rho: float) -> float:
    """Variance of the second difference of unit noise whose correlation over its lag is rho."""
    return 6.0 - 8.0 * rho + 2.0 * rho * rho


def _correlation(ratio: float, long_lag: int) -> float:
    """Correlation from row to row for a ratio of the differences' variances, short over long lag."""

    def excess(rho: float) -> float:
        return _second_difference(rho) / _second_difference(rho**long_lag) - ratio

    if excess(0.0) <= 0.0:
        return 0.0
    if excess(MOST_CORRELATION) >= 0.0:
        return MOST_CORRELATION
    return float(brentq(excess, 0.0, MOST_CORRELATION))
