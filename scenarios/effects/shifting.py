"""Signals shifted in time."""

from __future__ import annotations

import numpy as np

from scenarios.effects.base import Array


def delayed(time_s: Array, values: Array, delay_s: float) -> Array:
    """A signal delayed by `delay_s`, linear between the rows, shape (n,); its first value before the first row."""
    return values if delay_s == 0.0 else np.interp(time_s - delay_s, time_s, values)


def advanced(time_s: Array, values: Array, delay_s: float) -> Array:
    """A signal advanced by `delay_s`, shape (n,); NaN in the last `delay_s`."""
    return values if delay_s == 0.0 else np.interp(time_s + delay_s, time_s, values, right=np.nan)
