"""Changes of class beside the borders by a law that no effect of the library has.

A wrong scale of position_m shifts borders by a share of the distance since the start of the log; a clock that runs fast
by the distance driven in a delay that grows with time; stamps that are extrapolated with the last speed by the
acceleration. Each law is a constant shift or delay and what it varies with, fitted and scored like the library's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.chain import Oddity, price
from sim2real.perception.crossings import Crossings
from sim2real.perception.likelihood import likeliest, scale_under

Array = NDArray[np.float64]

FEWEST = 6
"""Crossings on the fit logs from which on such a law is looked for."""
CLEARLY, MOSTLY = 10.0, 1.5
"""By so much, and so many times, a varying shift must beat every effect of the library [nats], [-]: a mounting that
settles, or a delay that drifts, is still an angle, or a delay, and takes most of it."""
LEAST_CHANGE_M = 0.7
"""Change of the shift over the crossings from which on it is a gap [m]."""
GRID, ZOOMS = 17, 5
"""Points per axis of the search, and how often it is drawn closer about the best."""


@dataclass(frozen=True)
class Law:
    """A constant shift and one that varies.

    Attributes
    ----------
    basis : callable
        Crossings to the shift by a unit of the constant and of what varies, two arrays of shape (k,) [m].
    most : tuple of float
        Largest constant and rate that are looked for.
    words : str
        What it says, with the rate in it.
    depends_on : str
        What it varies with.
    """

    basis: Callable[[Crossings], tuple[Array, Array]]
    most: tuple[float, float]
    words: str
    depends_on: str


BY_WAY = Law(
    lambda c: (np.ones(len(c)), c.since_m),
    (5.0, 0.05),
    "The changes of class differ from road.yaml's borders by about {rate:+.1%} of the distance since the start of "
    "the log. Check whether the scale of position_m is wrong, or whether it drifts.",
    "distance since the start of the log",
)
BY_TIME = Law(
    lambda c: (c.speed_m_s, c.speed_m_s * c.since_s),
    (1.0, 0.05),
    "The changes of class are late by about {rate:+.2%} of the time since the start of the log. Check whether the "
    "clocks of camera and logger run at the same rate.",
    "time since the start of the log",
)
BY_PUSH = Law(
    lambda c: (np.ones(len(c)), c.accel_m_s2),
    (5.0, 2.0),
    "The changes of class differ from road.yaml's borders by about {rate:+.2f} m for each m/s² of acceleration. "
    "Check whether the stamps are extrapolated with the last speed.",
    "acceleration",
)


@dataclass(frozen=True)
class Drift:
    """A shift by another law, and the scale of the errors that it leaves [-]."""

    odd: Oddity
    scale: float


def find_drift(known: Crossings, unseen: Crossings, plain: float, best: float) -> Drift | None:
    """The gap that a varying shift is; None where there is none.

    Parameters
    ----------
    known, unseen : Crossings
        Of the fit logs and of the hold-out.
    plain, best : float
        Log-likelihood of both together as simulated, and the score of the library's best account [nats].
    """
    if len(known) < FEWEST or not len(unseen):
        return None
    every = known.joined(unseen)
    least = max(best + CLEARLY, MOSTLY * best)
    found: Drift | None = None
    for law in (BY_WAY, BY_TIME, BY_PUSH):
        constant, rate = _fit(law, known)
        shift = _shift(law, every, constant, rate)
        score = float(likeliest(every, shift, shifted=True)) - plain - price(len(every), len(every))
        changes_m = np.ptp(rate * law.basis(every)[1])
        if changes_m >= LEAST_CHANGE_M and score > least:
            way = "later" if rate > 0.0 else "earlier"
            odd = Oddity(
                "image_place", law.words.format(rate=rate), law.depends_on, way, "in proportion to it"
            )
            found, least = Drift(odd, scale_under(every, shift)), score
    return found


def _shift(law: Law, crossings: Crossings, constant: Array | float, rate: Array | float) -> Array:
    base, varying = law.basis(crossings)
    return np.asarray(constant)[..., None] * base + np.asarray(rate)[..., None] * varying


def _fit(law: Law, crossings: Crossings) -> tuple[float, float]:
    """Constant and rate that are likeliest: the best of a grid, drawn closer about it."""
    centre, half = np.zeros(2), np.array(law.most)
    for _ in range(ZOOMS):
        axes = [np.linspace(m - h, m + h, GRID) for m, h in zip(centre, half, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"))
        likely = likeliest(crossings, _shift(law, crossings, grid[0], grid[1]), shifted=True)
        i, j = np.unravel_index(int(np.argmax(likely)), likely.shape)
        centre, half = grid[:, i, j], half * 4.0 / GRID
    return float(centre[0]), float(centre[1])
