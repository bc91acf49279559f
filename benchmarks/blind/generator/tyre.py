"""Longitudinal tyre curves: the modified Dugoff tyre, and a magic formula of the same initial slope and peak."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

THETA_GRID = np.linspace(0.02, 1.5, 75)


@njit(cache=True)
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


@njit(cache=True)
def magic(slip: float, slope: float, peak: float, shape: float, curvature: float) -> float:
    """Force of the magic formula [N] (Pacejka 2012, Tire and Vehicle Dynamics, Eq. 4.49).

    Parameters
    ----------
    slip : float
        Unsigned slip [-].
    slope : float
        Force per slip at zero, the product B C D [N].
    peak : float
        Largest force, D [N].
    shape, curvature : float
        C and E [-].
    """
    if peak <= 0.0:
        return 0.0
    b = slope / (shape * peak) * slip
    return peak * np.sin(shape * np.arctan(b - curvature * (b - np.arctan(b))))


def peaks(stiffness: float, load: float) -> Array:
    """Largest force over load of the modified Dugoff tyre, at each value of `THETA_GRID` [-]."""
    slips = np.geomspace(1e-3, 1.0, 600)
    return np.array([max(dugoff(s, stiffness, t, load) for s in slips) / load for t in THETA_GRID])
