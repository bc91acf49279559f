"""Signals shifted in time; what delayed signals have in common."""

from __future__ import annotations

import numpy as np

from scenarios.effects.base import Array


def delayed(time_s: Array, values: Array, delay_s: float) -> Array:
    """What a signal was `delay_s` ago, shape (n,); its first value before that. Linear between the rows."""
    return values if delay_s == 0.0 else np.interp(time_s - delay_s, time_s, values)


def advanced(time_s: Array, values: Array, delay_s: float) -> Array:
    """What a delayed signal really was, shape (n,): NaN at the end, where its report is still to come."""
    return values if delay_s == 0.0 else np.interp(time_s + delay_s, time_s, values, right=np.nan)
