"""Longitudinal tyre curves that the ninth family adds, of the same slope and peak as the simulation's."""

from __future__ import annotations

import numpy as np

from .compiling import compiled


@compiled
def brush_elliptic(slip: float, slope: float, peak: float) -> float:
    """Force of the brush model under an elliptic pressure, as Hertz has it of a stiff belt [N].

    With k = pi `slope` s / (4 `peak`), the bristles hold from the leading edge to u = (k^2 - 1) / (k^2 + 1) of half the
    contact, and slide behind it; the peak is approached as the slip grows.

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero, well above `peak` [N].
    peak : float
        Largest force [N].
    """
    if peak <= 0.0:
        return 0.0
    k = 0.25 * np.pi * slope * slip / peak
    over = 1.0 + k * k
    u = (k * k - 1.0) / over
    holds = 2.0 * k / over**2
    slides = 0.5 * (2.0 * u * k / over + np.arcsin(u)) + 0.25 * np.pi
    return peak * 2.0 / np.pi * (holds + slides)


@compiled
def splined(slip: float, slope: float, peak: float, stretch: float, sliding: float) -> float:
    """Force of two cubics, as of a table with three points: at rest, at the peak, of the locked wheel [N].

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero [N].
    peak : float
        Largest force [N].
    stretch : float
        Slip of the peak over peak / slope, at most 3 [-].
    sliding : float
        Force of the locked wheel over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    best = stretch * peak / slope
    x = slip / best
    if x <= 1.0:
        return peak * x * (stretch * (1.0 - x) ** 2 + x * (3.0 - 2.0 * x))
    z = (slip - best) / (1.0 - best)
    return peak * (1.0 - (1.0 - sliding) * z * z * (3.0 - 2.0 * z))
