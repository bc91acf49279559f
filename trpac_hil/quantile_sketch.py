"""Quantiles of any number of values in bounded memory."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST, GREATEST, RATIO = 1e-3, 1e9, 1.005
"""Range of the bins, and the ratio of their widths: a quantile is exact to half a per cent."""
_BINS = math.ceil(math.log(GREATEST / LEAST) / math.log(RATIO)) + 2


class QuantileSketch:
    """Counts of values in bins; values below 0 count as 0, NaN is ignored."""

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(_BINS, dtype=np.int64)
        self.greatest = 0.0

    def add(self, values: ArrayLike) -> None:
        """Count values."""
        numbers = np.asarray(values, dtype=np.float64)
        numbers = numbers[~np.isnan(numbers)]
        if not len(numbers):
            return
        bins = np.log(np.clip(numbers, LEAST, GREATEST) / LEAST) / math.log(RATIO)
        self._counts += np.bincount(np.ceil(bins).astype(np.int64), minlength=_BINS)
        self.greatest = max(self.greatest, float(numbers.max()))

    @property
    def count(self) -> int:
        """Number of values."""
        return int(self._counts.sum())

    def quantile(self, share: float) -> float:
        """Quantile of the values; NaN without values."""
        if not self.count:
            return math.nan
        reached = int(np.searchsorted(np.cumsum(self._counts), share * self.count))
        upper = LEAST * RATIO**reached if reached else 0.0
        return min(upper, self.greatest)

    def summary(self) -> dict[str, float] | None:
        """Median, 99th percentile and greatest value; None without values."""
        if not self.count:
            return None
        figures = {"median": self.quantile(0.5), "p99": self.quantile(0.99), "max": self.greatest}
        return {name: float(f"{value:.4g}") for name, value in figures.items()}
