"""Longitudinal tyre curves that the eighth family adds, of the same slope and peak as the simulation's."""

from __future__ import annotations

import numpy as np

from .compiling import compiled

COMPOSITE_AT, COMPOSITE_TOP = 2.1045880, 0.99907098
"""Where the composite slip's function has its peak, and how large that is [-]."""


@compiled
def bristles(slip: float, slope: float, peak: float) -> float:
    """Force of bristles with even load that give way [N]: 1 - (1 - exp(-2 x)) / (2 x) of `slope` s over it.

    The steady state of the distributed LuGre tyre with one friction (Canudas-de-Wit et al. 2003, Vehicle System
    Dynamics 39, 189-226); its peak is the locked wheel's.

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero, well above `peak` [N].
    peak : float
        Largest force [N].
    """
    if peak <= 0.0 or slip <= 0.0:
        return 0.0
    top = peak
    for _ in range(8):
        x = 2.0 * slope / top
        top = peak / (1.0 + np.expm1(-x) / x)
    x = 2.0 * slope * slip / top
    return top * (1.0 + np.expm1(-x) / x)


@compiled
def composite(slip: float, slope: float, peak: float, fading: float) -> float:
    """Force of a ratio of cubics in the composite slip, less `fading` of it for the locked wheel [N].

    The saturation function (c^3 + 0.34 c^2 + 4 c / pi) / (c^3 + 0.57 c^2 + 0.32 c + 1) of a radial tyre (Szostak,
    Allen, Rosenthal 1988, DOT HS 807 271), whose largest value is `COMPOSITE_TOP`; the fading begins beyond it.

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero [N].
    peak : float
        Largest force [N].
    fading : float
        What a locked wheel's force lacks, over the peak [-].
    """
    if peak <= 0.0 or slip <= 0.0:
        return 0.0
    per_slip = 0.25 * np.pi * slope * COMPOSITE_TOP / peak
    c = per_slip * slip
    rise = c * (4.0 / np.pi + c * (0.34 + c)) / (1.0 + c * (0.32 + c * (0.57 + c)))
    best = COMPOSITE_AT / per_slip
    if slip > best:
        rise *= 1.0 - fading * (slip - best) / (1.0 - best)
    return peak * rise / COMPOSITE_TOP
