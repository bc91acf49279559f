"""The cells of road friction, and the prior of each class of the camera."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..tyre import GREATEST_THETA, LEAST_THETA
from .arrays import Array, exp, spacing, total

CELL, CELL_SHARE = 0.006, 0.025
"""Width of a cell: the greater of a number and of a share of its friction. It is below the standard deviation that the
tyre leaves after half a second of sliding [-]."""
SLIPPERY, SLIPPERY_SHARE = 0.05, 0.2
"""Roads below this friction are rarer without a camera: wet ice near 0 degrees alone; by this share [-]."""
CLASS_SCATTER, NEW_SCATTER = 0.13, 0.15
"""Standard deviation of a road from its class's value: of a class that has lasted, and of a new one [-]."""
WRONG_CLASS, NEW_WRONG = 0.1, 0.2
"""Probability that the class is wrong and carries no information: of one that has lasted, and of a new one [-]."""
STOOD_M = 4.0
"""Distance after which a class counts as lasting: two near groups of the picture [m]."""
TURNED, NEW_TURNED = 0.9, 0.36
"""Share of the belief that moves to the prior of the class: of a lasting class, and of a new one [-]."""
CHANGE_PER_M = 0.02
"""Share of the belief that returns to the prior per distance: a road changes about every 50 m [1/m]."""


def cells() -> Array:
    """Frictions of the cells, shape (cells,) [-]."""
    values = [LEAST_THETA]
    while values[-1] < GREATEST_THETA:
        values.append(min(values[-1] + max(CELL, CELL_SHARE * values[-1]), GREATEST_THETA))
    return np.array(values)


THETA = cells()
"""The cells."""
PerCell = Annotated[Array, (len(THETA),)]
"""One value for each cell."""
PerClass = Annotated[Array, (3, len(THETA))]
"""One value for each class and cell."""


def unseen(theta: PerCell) -> PerCell:
    """Probability of each cell without a camera, shape (cells,): uniform, with less weight on slippery roads."""
    likely = spacing(theta) * np.where(theta < SLIPPERY, SLIPPERY_SHARE, 1.0)
    return likely / total(likely)


def of_class(theta: PerCell, value: float, greatest: bool, scatter: float, wrong: float) -> PerCell:
    """Probability of each cell for a class, shape (cells,).

    Parameters
    ----------
    theta : array, shape (cells,)
        Frictions [-].
    value : float
        Adhesion of the class [-].
    greatest : bool
        Whether no class has more: then all frictions above its value are alike.
    scatter, wrong : float
        Standard deviation of a road from the value, and the probability that the class carries no information [-].
    """
    most, without = math.inf if not greatest else 0.0, unseen(theta)
    off = np.minimum((theta - value) / scatter, most)
    likely = exp(-0.5 * off * off) * spacing(theta)
    return (1.0 - wrong) * likely / total(likely) + wrong * without


class Priors(NamedTuple):
    """Prior probability of each cell by class."""

    new: PerClass
    """Of a class that is new, shape (classes, cells)."""
    stood: PerClass
    """Of one that has lasted, shape (classes, cells)."""
    none: PerCell
    """Without one, shape (cells,)."""


def of_classes(
    theta: PerCell, class_theta: tuple[float, float, float], scatter: float, wrong: float
) -> PerClass:
    """Probability of each cell for each class, see `of_class`."""
    dry, wet, snow_ice = class_theta
    most = max(dry, wet, snow_ice)
    return np.array(
        [
            of_class(theta, dry, dry == most, scatter, wrong),
            of_class(theta, wet, wet == most, scatter, wrong),
            of_class(theta, snow_ice, snow_ice == most, scatter, wrong),
        ]
    )


def priors(theta: PerCell, class_theta: tuple[float, float, float]) -> Priors:
    """The priors for classes of these adhesions [-]."""
    return Priors(
        of_classes(theta, class_theta, NEW_SCATTER, NEW_WRONG),
        of_classes(theta, class_theta, CLASS_SCATTER, WRONG_CLASS),
        unseen(theta),
    )


NONE = -1
"""No class."""


class ClassUnderWheel(NamedTuple):
    """Classes that the camera gave for the road under the wheel so far."""

    last: int = NONE
    """Class that was given last, or none."""
    way_m: float = 0.0
    """Distance for which it has been given [m]."""
    stood: int = NONE
    """Class that lasted last, or none."""
    silent_m: float = 0.0
    """Distance since a class was given [m]."""


class Change(NamedTuple):
    """How sure it is that the road has changed."""

    memory: ClassUnderWheel
    """Classes up to now."""
    share: float
    """Share of the belief that goes to the prior [-]."""
    stood: bool
    """Whether a class counts as lasting from now on that is another one than before."""


def advanced(memory: ClassUnderWheel, given: int, way_m: float) -> Change:
    """The classes so far after a distance [m], and the share of the belief that moves.

    `given` is the class under the wheel now, or none. A lasting class is forgotten after `STOOD_M` without any.
    """
    share = 1.0 - math.exp(-CHANGE_PER_M * abs(way_m))
    last, driven_m, stood, silent_m = memory
    if given == NONE:
        silent_m += abs(way_m)
        if silent_m > STOOD_M:
            driven_m, stood = 0.0, NONE
        return Change(ClassUnderWheel(last, driven_m, stood, silent_m), share, False)
    if given != last:
        driven_m = 0.0
        if given != stood:
            share = max(share, NEW_TURNED)
    driven_m += abs(way_m)
    turned = driven_m >= STOOD_M and given != stood
    if turned:
        stood, share = given, max(share, TURNED)
    return Change(ClassUnderWheel(given, driven_m, stood, 0.0), share, turned)


def prior_of(memory: ClassUnderWheel, given: int, known: Priors) -> PerCell:
    """Prior probability of each cell by the class now and the lasting one, shape (cells,) [-]."""
    if given not in (NONE, memory.stood):
        return known.new[given]
    return known.none if memory.stood == NONE else known.stood[memory.stood]
