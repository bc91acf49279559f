"""Longitudinal tyre curve that the tenth family adds, of the same slope and peak as the simulation's."""

from __future__ import annotations

import numpy as np

from .compiling import compiled


@compiled
def humped(slip: float, slope: float, peak: float, sliding: float) -> float:
    """Force of z exp(1 - z) up to the peak at z = 1, and beyond it of the same fall to `sliding` [N].

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero [N].
    peak : float
        Largest force [N].
    sliding : float
        Force of a wheel that slides over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    z = slope * slip / (np.e * peak)
    hump = z * np.exp(1.0 - z)
    return peak * (hump if z <= 1.0 else sliding + (1.0 - sliding) * hump)
