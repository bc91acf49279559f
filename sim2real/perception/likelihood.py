"""How likely crossings are under a shift of the classes along the road.

A shift is to put the border into the crossing's bracket, but for an error under Student's t with four degrees of
freedom, so that a border in another place than road.yaml has it does not decide. Where within its stamp a class
belongs is uncertain, and so is the scale of the errors.
"""

from __future__ import annotations

from math import prod

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sim2real.perception.crossings import Crossings

Array = NDArray[np.float64]

ERROR_M = 0.1
"""Least scale of a crossing's error: borders are no lines, positions drift [m]."""
SCALES = np.array([1.0, 1.5, 2.5, 4.0, 7.0, 12.0, 20.0, 40.0, 80.0])
"""Scales of the crossings' errors that are tried [-]."""
SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Share of its stamp that a class is for [-]."""
SHARE_SPREAD, SHARE_SPREAD_SIMULATED = 0.2, 0.3
"""Standard deviation of it: the middle is the plain reading, its ends are possible. As simulated a class is right where
the road has it anywhere in the stretch, so that any share is nearly as good [-]."""
LEAST_WIDTH_M = 0.02
"""Width of a bracket that is at least reckoned with [m]."""
LEAST_SHARE = 1e-30
"""Probability that a crossing has at least, under any account [-]."""


def share_price(*, shifted: bool) -> Array:
    """What a share of the stamp costs an account, shape (shares,) [nats]."""
    spread = SHARE_SPREAD if shifted else SHARE_SPREAD_SIMULATED
    return 0.5 * ((SHARES - 0.5) / spread) ** 2


def profiles(crossings: Crossings, shift: Array) -> Array:
    """Log-likelihood of shifts, shape (..., k), over shares and scales: shape (shares, scales, ...) [nats]."""
    flat = np.ascontiguousarray(shift).reshape(prod(shift.shape[:-1]), shift.shape[-1])  # also of no crossing
    table = np.array([over_scales(flat, *crossings.bracket(share), SCALES) for share in SHARES])
    return table.reshape(len(SHARES), len(SCALES), *shift.shape[:-1])


def likeliest(crossings: Crossings, shift: Array, *, shifted: bool) -> Array:
    """Log-likelihood of shifts at the best share and scale, less the share's price, shape (...) [nats]."""
    table = profiles(crossings, shift)
    price = share_price(shifted=shifted).reshape(-1, *[1] * (table.ndim - 1))
    return np.asarray((table - price).max(axis=(0, 1)))


def scale_under(crossings: Crossings, shift: Array) -> float:
    """Scale of the errors that suits one shift, shape (k,), at the share that suits it best [-]."""
    table = profiles(crossings, shift) - share_price(shifted=True)[:, None]
    return float(SCALES[np.unravel_index(int(np.argmax(table)), table.shape)[1]])


@njit(cache=True, error_model="numpy")
def over_scales(shift: Array, low: Array, high: Array, scales: Array) -> Array:
    """Of crossings with these brackets under shifts, shape (m, k), summed over the crossings: shape (scales, m) [nats].

    The probability that an error under Student's t moves the border's shifted place into the bracket, per width: flat
    within the bracket, so that crossings whose pictures happen to fall alike do not add up to a shift.
    """
    out = np.zeros((scales.shape[0], shift.shape[0]))
    for j in range(shift.shape[1]):
        width = high[j] - low[j]
        if width < LEAST_WIDTH_M:
            width = LEAST_WIDTH_M
        for i in range(shift.shape[0]):
            beyond = abs(shift[i, j] - 0.5 * (low[j] + high[j]))
            for s in range(scales.shape[0]):
                error_m = scales[s] * ERROR_M
                share = _student((0.5 * width - beyond) / error_m) - _student(
                    (-0.5 * width - beyond) / error_m
                )
                if share < LEAST_SHARE:
                    share = LEAST_SHARE
                out[s, i] += np.log(share / width)
    return out


@njit(cache=True, error_model="numpy", forceinline=True)
def _student(t: float) -> float:
    """Distribution function of Student's t with four degrees of freedom, in closed form."""
    square = 1.0 + 0.25 * t * t
    return 0.5 + 0.375 * t / np.sqrt(square) * (1.0 - t * t / (12.0 * square))
