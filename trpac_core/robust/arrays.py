"""Array functions whose last bit is that of the C library's, added up from first to last.

numpy's own exp and log differ from the C library's by a bit on some processors, and its sums go in pairs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def exp(values: Array) -> Array:
    """E to the power of each value, shape as given [-]."""
    return np.array(list(map(math.exp, values.ravel().tolist()))).reshape(values.shape)


def log(values: Array) -> Array:
    """Natural logarithm of each value, shape as given [-]."""
    return np.array(list(map(math.log, values.ravel().tolist()))).reshape(values.shape)


def total(values: Array) -> Array:
    """Sum over the last axis, which is kept with length 1; in the unit of the values."""
    return np.cumsum(values, axis=-1)[..., -1:]
