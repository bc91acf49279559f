"""ISO/TS 18571: how alike two curves look, from 0 to 1. It reports; it never decides."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sim2real.result import Trace

Array = NDArray[np.float64]
Ratings = dict[str, tuple[float | None, float | None]]

MOST_SAMPLES = 1500
"""Samples that a curve is averaged down to: the rating's time warping needs memory and time with their square.

The standard was written for curves of 0.1 to 0.2 s at 10 kHz, so for as many samples as this.
"""
LEAST_SAMPLES = 50
"""Below this the slope's nine-point average and a shift by a fifth leave too little to compare."""


def rate(traces: Iterable[Trace]) -> Ratings:
    """Rating of the simulation before and after, per signal; None where it is not defined."""
    return {
        t.signal: (rating(t.time_s, t.measured, t.before), rating(t.time_s, t.measured, t.after))
        for t in traces
    }


def rating(time_s: Array, measured: Array, simulated: Array) -> float | None:
    """Overall rating of one simulated curve after ISO/TS 18571.

    Parameters
    ----------
    time_s : array, shape (n,)
        Uniform time [s].
    measured, simulated : array, shape (n,)
        The reference and what is compared with it, in the same unit. Samples that either has lost (NaN) are bridged
        in both alike.

    Returns
    -------
    float or None
        0 to 1, the weighted mean of corridor (0.4), phase, magnitude and slope (0.2 each) [-]. None where the
        standard's terms divide by nothing: a curve that is constant, zero included, or too short.

    Raises
    ------
    ValueError
        Curves of unequal length.
    """
    from objective_rating_metrics.rating import ISO18571  # seconds to import; only who rates waits for it

    _keep_compiled()
    if not len(time_s) == len(measured) == len(simulated):
        raise ValueError(
            f"Curves of {len(time_s)}, {len(measured)} and {len(simulated)} samples; expected equal lengths."
        )
    lost = ~(np.isfinite(measured) & np.isfinite(simulated))
    if len(time_s) - np.count_nonzero(lost) < LEAST_SAMPLES:
        return None
    time, reference, compared = (
        _thinned(a) for a in (time_s, _bridged(time_s, measured, lost), _bridged(time_s, simulated, lost))
    )
    if np.ptp(reference) == 0.0 or np.ptp(compared) == 0.0:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):  # a shift may leave a constant piece: it never wins
        value = ISO18571(
            np.column_stack([time, reference]),
            np.column_stack([time, compared]),
            dt=float(time[1] - time[0]),
        ).overall_rating(ndigits=-1)
    return float(value) if np.isfinite(value) else None


def _keep_compiled() -> None:
    """Have the time warping's compiled code kept on disk: its package compiles it anew in every process, for 20 s."""
    from dtwalign.backtrack import _backtrack_jit
    from dtwalign.cost import _calc_cumsum_matrix_jit

    for function in (_backtrack_jit, _calc_cumsum_matrix_jit):
        if not function.signatures:
            function.enable_caching()


def _bridged(time_s: Array, curve: Array, lost: NDArray[np.bool_]) -> Array:
    return np.interp(time_s, time_s[~lost], curve[~lost]) if lost.any() else curve


def _thinned(curve: Array) -> Array:
    """Averages over equal blocks, at most `MOST_SAMPLES` of them; an incomplete last block is left out."""
    factor = -(-len(curve) // MOST_SAMPLES)
    whole = len(curve) // factor
    return curve[: whole * factor].reshape(whole, factor).mean(axis=1)
