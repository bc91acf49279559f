"""What residuals cost: their square where they are noise, their size where they are outliers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROBUST_FROM = 5.0
"""Residuals beyond this many standard deviations count by their size, no longer by its square: at a sliding wheel a
small error of the model makes a large residual [-]."""


def loss(z: Array) -> float:
    """Twice the negative log-likelihood up to a constant: quadratic for noise, linear for outliers."""
    return float(np.sum(robust(z)))


def robust(z: Array) -> Array:
    """Loss of each residual, z^2 near 0 [-]."""
    return 2.0 * ROBUST_FROM**2 * (np.sqrt(1.0 + (z / ROBUST_FROM) ** 2) - 1.0)


def robust_weight(z: Array) -> Array:
    """Weight of each residual in the robust fit [-]."""
    return 1.0 / np.sqrt(1.0 + (z / ROBUST_FROM) ** 2)
