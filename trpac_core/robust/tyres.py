"""The tyres that a wheel may have, and their curves of used friction over slip.

The curve of a tyre is not known exactly. There are four hypotheses: the described modified Dugoff tyre, the same with
another stiffness, and two rational curves that bend from the first slip on. The stiffness of all but the first is
proportional to the load, much as that of real tyres (Pacejka 2012, ch. 4). The two rational curves differ in the
position of their peak and in what they lose beyond it; magic formulas lie near the first, brush models and exponential
curves near the second.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from .arrays import Array, exp, stacked
from .roads import THETA, PerCell

LEAST_SLIP = 1e-9
"""Slip below which the tyre is taken at this slip: its formula divides by slip [-]."""
GREATEST_SLIP = 0.99
"""Slip above which the tyre is taken at this slip: the formula divides by 1 - slip [-]."""


@dataclass(frozen=True)
class Tyre:
    """One hypothesis of what the tyre is.

    Parameters
    ----------
    weight : float
        Probability before anything is known [-].
    slip_offset : float
        Standard deviation of the slip that a wheel without force reads: radius and speed sensor [-].
    softness : float
        Standard deviation of ln(described stiffness / stiffness) [-].
    mean_softness : float
        Mean of it. C_x may be stated as the slope at slip 0 or as that over the modified Dugoff tyre's 1.27; exp(0.1)
        lies between [-].
    peak : float
        Normalised slip C lambda / (theta F_z) of the curve's peak; 0 for the modified Dugoff tyre [-].
    fall : float
        Share of the bare curve's loss beyond its peak that the tyre has [-].
    """

    weight: float
    slip_offset: float
    softness: float
    mean_softness: float = 0.0
    peak: float = 0.0
    fall: float = 0.0


TOLD = 0
"""Index of the tyre that is as described, within the stated tolerances."""
TYRES = (
    Tyre(0.35, slip_offset=0.003, softness=0.05),
    Tyre(0.15, slip_offset=0.005, softness=0.15),
    Tyre(0.30, slip_offset=0.005, softness=0.20, mean_softness=-0.1, peak=2.15, fall=0.8),
    Tyre(0.20, slip_offset=0.005, softness=0.20, mean_softness=-0.1, peak=3.0, fall=0.4),
)
"""The hypotheses. A magic formula of shape factor 1.65 has its peak at 2.15, a brush or TMeasy curve at 3 (Pacejka
2012, ch. 3 and 4); beyond it steep magic formulas lose to 0.6 at three times the peak's slip, which is `fall` 1."""
FORMULAS = 2
"""Number of tyres, the first ones, with the modified Dugoff formula."""
PerTyre = Annotated[Array, (len(TYRES),)]
Column = Annotated[Array, (len(TYRES), 1)]
"""One value for each tyre: alone, and beside an axis of cells."""
Grid = Annotated[Array, (len(TYRES), len(THETA))]
"""One value for each tyre and cell."""
IS_TOLD = np.array([[float(index == TOLD)] for index in range(len(TYRES))])
"""1 for the tyre that is as described, else 0."""
PEAKS = np.array([tyre.peak for tyre in TYRES])
"""`Tyre.peak` of each [-]."""


class Curve(NamedTuple):
    """Used friction at a slip and its slopes, shape (tyres, cells) each [-]."""

    friction: Array
    by_slip: Array
    by_stiffness: Array
    """By the logarithm of the stiffness."""
    sliding: Array
    """From 0 where the tyre adheres to 1 where it slides all over."""


GridCurve = Annotated[Curve, (len(TYRES), len(THETA))]
SLIDES_AT = 5.0
"""Normalised slip at which a tyre counts as half sliding: about twice that of its peak [-]."""


def sliding(normalised_slip: Array) -> Array:
    """How far a tyre slides all over at a normalised slip C lambda / (theta F_z), shape as given [-]."""
    square = normalised_slip * normalised_slip
    return square / (square + SLIDES_AT * SLIDES_AT)


def dugoff(theta: Array, slip: Array, load_n: float, stiffness_n: Array) -> Curve:
    """Curve of the modified Dugoff tyre, see `trpac_core.tyre`, at unsigned slips; shapes that broadcast [-], [N]."""
    rolls = 1.0 - slip
    linear = stiffness_n * slip / rolls / load_n
    shape = 1.27 + slip * (1.15 * slip - 1.63) + 0.75 * slip * rolls * theta
    shape_by_slip = 2.3 * slip - 1.63 + 0.75 * (1.0 - 2.0 * slip) * theta
    linear_by_slip = stiffness_n / (load_n * rolls * rolls)
    slides = theta < 2.0 * linear
    share = np.where(slides, theta * (1.0 - 0.25 * theta / linear), linear)
    share_by_linear = np.where(slides, 0.25 * theta * theta / (linear * linear), 1.0)
    return Curve(
        share * shape,
        share_by_linear * linear_by_slip * shape + share * shape_by_slip,
        share_by_linear * linear * shape,
        sliding(linear / theta),
    )


def peaked(theta: Array, slip: Array, stiffness: Array, peak: Array, fall: Array) -> Curve:
    """Curve theta phi(x), x = K q / theta, at slips q over the road's speed, shapes that broadcast [-].

    phi = x / (1 + s (s + p - 2)) with s = x / p starts with slope 1 and has its maximum 1 at x = p. K is the stiffness
    over the load.
    """
    rate = stiffness / theta
    s = rate * slip / peak
    below = 1.0 + s * (s + peak - 2.0)
    share, by_x = peak * s / below, (1.0 - s * s) / (below * below)
    beyond = s > 1.0
    share = np.where(beyond, 1.0 - fall * (1.0 - share), share)
    by_x = np.where(beyond, fall * by_x, by_x)
    return Curve(theta * share, by_x * stiffness, by_x * stiffness * slip, sliding(rate * slip))


def size(slip: Array) -> Array:
    """Unsigned slip, within what the formulas can take, shape as given [-]."""
    return np.minimum(np.maximum(np.abs(slip), LEAST_SLIP), GREATEST_SLIP)


def curves(
    theta: PerCell,
    slip: Grid,
    softness: Grid,
    load_n: float,
    stiffness_n: float,
    mean_load_n: float,
    peak: Column,
    fall: Column,
) -> GridCurve:
    """Curve of each tyre in each cell, shape (tyres, cells).

    Parameters
    ----------
    theta : array, shape (cells,)
        Peak friction [-].
    slip, softness : array, shape (tyres, cells)
        Signed slip, positive where it drives, and ln(described stiffness / stiffness) [-].
    load_n, stiffness_n, mean_load_n : float
        Load, described C_x, and the load for which it holds [N].
    peak, fall : array, shape (tyres, 1)
        As in `Tyre` [-].
    """
    # C_x holds at the mean load; the stiffness of all but the described tyre is proportional to the load.
    by_load = np.where(IS_TOLD[:FORMULAS] > 0.0, 1.0, load_n / mean_load_n)
    told_n = stiffness_n * exp(-softness[:FORMULAS]) * by_load
    told = dugoff(theta, size(slip[:FORMULAS]), load_n, told_n)
    own, stiffness = size(slip[FORMULAS:]), stiffness_n * exp(-softness[FORMULAS:]) / mean_load_n
    # A braked wheel's slip is already taken over the road's speed, a driven one's over the rim's.
    road_share = np.where(slip[FORMULAS:] > 0.0, 1.0 - own, 1.0)
    other = peaked(theta, own / road_share, stiffness, peak[FORMULAS:], fall[FORMULAS:])
    return stacked(told, other._replace(by_slip=other.by_slip / (road_share * road_share)))
