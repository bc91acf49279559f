"""Longitudinal tyre curves: the modified Dugoff tyre, and foreign ones of the same initial slope and peak.

Foreign curves take the unsigned slip [-], the force per slip at zero [N], well above the peak, the largest force [N],
and parameters of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiling import compiled

Array = NDArray[np.floating[Any]]

THETA_GRID = np.linspace(0.02, 1.5, 75)
MAGIC, RATIONAL, DECAYING, CUBED, HYPERBOLIC_TANGENT, SINE_RISE = range(6)
"""Codes of the foreign curves."""


@compiled
def dugoff(slip: float, stiffness: float, theta: float, load: float) -> float:
    """Force of the modified Dugoff tyre in pure longitudinal slip [N].

    With the adhesion force x = C s / (1 - s), Dugoff's L is theta F_z / (2 x): the force is x while x < theta F_z / 2,
    and saturates as theta F_z (1 - theta F_z / (4 x)) beyond, which stays finite for the locked wheel. The shape G
    multiplies both (Bian, Chen, Luo, Li 2014, SAE 2014-01-0123).

    Parameters
    ----------
    slip : float
        Unsigned slip, 0 to 1 [-].
    stiffness : float
        C_x [N].
    theta : float
        Friction of the road [-].
    load : float
        Vertical load [N].
    """
    if slip <= 0.0 or load <= 0.0 or theta <= 0.0:
        return 0.0
    grip = theta * load
    adhesion = stiffness * slip / max(1.0 - slip, 1e-12)
    force = adhesion if adhesion < 0.5 * grip else grip * (1.0 - 0.25 * grip / adhesion)
    shape = 1.27 + slip * ((1.15 - 0.75 * theta) * slip - (1.63 - 0.75 * theta))
    return force * shape


@compiled
def magic(slip: float, slope: float, peak: float, shape: float, curvature: float) -> float:
    """Force of the magic formula [N] (Pacejka 2012, Tire and Vehicle Dynamics, Eq. 4.49).

    shape, curvature: C and E [-].
    """
    if peak <= 0.0:
        return 0.0
    b = slope / (shape * peak) * slip
    return peak * np.sin(shape * np.arctan(b - curvature * (b - np.arctan(b))))


@compiled
def rational(slip: float, slope: float, peak: float, stretch: float, sliding: float) -> float:
    """Force of a rational function up to the peak and a cubic fall beyond [N] (Rill 2013, the TMeasy tyre).

    stretch: slip of the peak over peak / slope, at least 2 [-].
    sliding: force from five times the peak's slip on, over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slip * slope / (stretch * peak)
    if x <= 1.0:
        return slope * slip / (1.0 + x * (x + stretch - 2.0))
    z = min((x - 1.0) / 4.0, 1.0)
    return peak * (1.0 - (1.0 - sliding) * z * z * (3.0 - 2.0 * z))


@compiled
def decaying(slip: float, slope: float, peak: float, loss: float) -> float:
    """Force of c (1 - exp(-b s) - `loss` s) [N] (Burckhardt 1993, Fahrwerktechnik: Radschlupf-Regelsysteme).

    loss: what a locked wheel's force lacks, over c; above 0 [-].
    """
    if peak <= 0.0:
        return 0.0
    top = peak
    for _ in range(6):
        ratio = loss * top / (slope + loss * top)
        top = peak / (1.0 - ratio + ratio * np.log(ratio))
    return top * (1.0 - np.exp(-(slope / top + loss) * slip) - loss * slip)


@compiled
def cubed(slip: float, slope: float, peak: float, curvature: float) -> float:
    """Force of 1 - exp(-(x + E x^2 + (E^2 + 1/12) x^3)) times the peak, x = `slope` s / peak [N].

    The static part of the UniTire model (Guo, Lu 2007, Vehicle System Dynamics 45, 79-99).

    curvature: E [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slope * slip / peak
    return peak * (1.0 - np.exp(-x * (1.0 + x * (curvature + x * (curvature**2 + 1.0 / 12.0)))))


@compiled
def sine_rise(slip: float, slope: float, peak: float, sliding: float) -> float:
    """Force of a quarter of a sine up to the peak, and a bell's fall to `sliding` of it over five times as far [N].

    sliding: force of a wheel that slides over the peak [-].
    """
    if peak <= 0.0:
        return 0.0
    x = slope * slip / peak
    if x <= 0.5 * np.pi:
        return peak * np.sin(x)
    beyond = (x - 0.5 * np.pi) / (2.5 * np.pi)
    return peak * (sliding + (1.0 - sliding) * np.exp(-beyond * beyond))


@compiled
def foreign(curve: int, slip: float, slope: float, peak: float, first: float, second: float) -> float:
    """Force of a foreign curve by its code [N]; `first` and `second` are its own parameters."""
    if curve == RATIONAL:
        return rational(slip, slope, peak, first, second)
    if curve == DECAYING:
        return decaying(slip, slope, peak, first)
    if curve == CUBED:
        return cubed(slip, slope, peak, first)
    if curve == HYPERBOLIC_TANGENT:
        return peak * np.tanh(slope * slip / peak) if peak > 0.0 else 0.0
    if curve == SINE_RISE:
        return sine_rise(slip, slope, peak, first)
    return magic(slip, slope, peak, first, second)


def peaks(stiffness: float, load: float) -> Array:
    """Largest force over load of the modified Dugoff tyre, at each value of `THETA_GRID` [-]."""
    slips = np.geomspace(1e-3, 1.0, 600)
    return np.array([max(dugoff(s, stiffness, t, load) for s in slips) / load for t in THETA_GRID])
