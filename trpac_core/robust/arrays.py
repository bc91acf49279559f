"""Array functions whose last bit is that of the C library's, added up from first to last.

numpy's own exp and log differ from the C library's by a bit on some processors, and its sums go in pairs. The native
unit has the same functions in C; an `Array` without a shape is one of its elements there.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = TypeVar("Rows", bound=tuple[Any, ...])
"""A NamedTuple of arrays."""


def exp(values: Array) -> Array:
    """E to the power of each value, shape as given [-]."""
    return np.array(list(map(math.exp, values.ravel().tolist()))).reshape(values.shape)


def log(values: Array) -> Array:
    """Natural logarithm of each value, shape as given [-]."""
    return np.array(list(map(math.log, values.ravel().tolist()))).reshape(values.shape)


def total(values: Array) -> Array:
    """Sum over the last axis, which is kept with length 1; in the unit of the values."""
    return np.cumsum(values, axis=-1)[..., -1:]


def over_rows(values: Array) -> Array:
    """Sum over the first axis, which goes; in the unit of the values."""
    return values.sum(axis=0)


def cumulated(values: Array) -> Array:
    """Sums of the values up to each, shape as given (n,)."""
    return np.cumsum(values)


def spacing(values: Array) -> Array:
    """Half the distance between the neighbours of each value, shape as given (n,)."""
    return np.gradient(values)


def stacked(first: Rows, second: Rows) -> Rows:
    """The rows of the first and of the second one under each other, of every array in them."""
    return type(first)(*(np.concatenate(both) for both in zip(first, second, strict=True)))


def greatest(values: Array) -> float:
    """The greatest of all values."""
    return float(values.max())


def first_greatest(values: Array) -> int:
    """Place of the greatest of values, the first of those alike."""
    return int(values.argmax())


def count_below(ascending: Array, value: float) -> int:
    """How many of ascending values are less than a value."""
    return int(np.searchsorted(ascending, value))


def count_up_to(ascending: Array, value: float) -> int:
    """How many of ascending values are not greater than a value."""
    return int(np.searchsorted(ascending, value, side="right"))
