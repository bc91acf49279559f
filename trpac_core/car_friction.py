r"""One TRPAC for the whole car: the friction that a braking car can use of what lies under its four wheels.

A chassis controller asks how hard the car can brake, or drive, now. With anti-lock control each front wheel is held at
the peak of its own road, and the rear axle at that of its more slippery side ("select low"), which keeps the car stable
on split friction [1]_. The greatest deceleration over g is then

.. math:: \theta = \frac{F_{fl} \theta_{fl} + F_{fr} \theta_{fr} + (F_{rl} + F_{rr}) \min(\theta_{rl}, \theta_{rr})}
                        {F_{fl} + F_{fr} + F_{rl} + F_{rr}}

with the vertical loads F. A mean of all four would promise force that the rear axle may not use; the smallest
of the four would give away most of what a car with one wheel on ice has.

Of the two wheels of a side often only one shows its road: the front one when the car brakes, the rear one when it
drives off. So a wheel counts with its own estimate or with its partner's, whichever is surer, where the partner's
variance is larger by what the road may change over a wheelbase. The two are not averaged: how far their errors go
together (same speed signal, same tyre, same camera) is not known, and for one number covariance intersection [2]_, the
fusion that holds for any such correlation, is to take the surer one.

The deviation of the sum is the sum of the wheels' weighted deviations, the greatest that it can be whatever the
correlation. That of the smaller of two normal numbers about the smaller estimate is Clark's second moment [3]_.

References
----------
.. [1] Robert Bosch GmbH, Automotive Handbook, chapter on antilock braking systems: select-low control of the rear axle.
.. [2] Julier, Uhlmann (1997), Proc. American Control Conference, pp. 2369-2373.
.. [3] Clark (1961), Operations Research 9, pp. 145-162.
"""

from __future__ import annotations

import math
from typing import NamedTuple

_new = tuple.__new__
_ROOT_2, _ROOT_2_PI = math.sqrt(2.0), math.sqrt(2.0 * math.pi)


class Friction(NamedTuple):
    """An adhesion and its standard deviation [-]."""

    theta: float
    deviation: float


Known = tuple[float, float]
"""An adhesion and its standard deviation, as in `Friction` [-]."""


def surer(front: Known, rear: Known, axle_deviation: float) -> tuple[Known, Known]:
    """The friction of a side's two wheels: each its own estimate, or that of the other where that one says more.

    `axle_deviation` is the standard deviation of the road's change over a wheelbase [-].
    """
    front_deviation, rear_deviation = front[1], rear[1]
    if front_deviation <= rear_deviation:
        lent = math.hypot(front_deviation, axle_deviation)
        return front, rear if rear_deviation <= lent else (front[0], lent)
    lent = math.hypot(rear_deviation, axle_deviation)
    return front if front_deviation <= lent else (rear[0], lent), rear


def lower(first: Known, second: Known) -> Friction:
    """The smaller of two adhesions, and the root mean square error of taking it for the true minimum.

    Examples
    --------
    >>> lower(Friction(0.3, 0.02), Friction(0.8, 0.1)).deviation
    0.02
    """
    low, high = (first, second) if first[0] <= second[0] else (second, first)
    (low_theta, low_deviation), (high_theta, high_deviation) = low, high
    spread = math.hypot(low_deviation, high_deviation)
    if spread == 0.0:
        return Friction(low_theta, low_deviation)
    gap = high_theta - low_theta
    ratio = gap / spread
    right_order = 0.5 * (1.0 + math.erf(ratio / _ROOT_2))
    density = math.exp(-0.5 * ratio * ratio) / _ROOT_2_PI
    square = (
        low_deviation * low_deviation * right_order
        + (gap * gap + high_deviation * high_deviation) * (1.0 - right_order)
        - gap * spread * density
    )
    return _new(Friction, (low_theta, math.sqrt(square) if square > 0.0 else 0.0))


def car_friction(
    wheels: tuple[Known, Known, Known, Known],
    load_n: tuple[float, float, float, float],
    axle_deviation: float,
) -> Friction:
    """The car's adhesion from those of fl, fr, rl, rr and their vertical loads (see the module).

    Parameters
    ----------
    wheels : four Friction
        Each wheel's own estimate.
    load_n : tuple of 4 floats
        Vertical loads, of which at least one is above 0 [N].
    axle_deviation : float
        Standard deviation of the road's change over a wheelbase [-].

    Examples
    --------
    >>> ice, dry = Friction(0.2, 0.01), Friction(0.8, 0.01)
    >>> round(car_friction((ice, dry, ice, dry), (3500.0, 3500.0, 3000.0, 3000.0), 0.08).theta, 3)
    0.362
    """
    fl, fr, rl, rr = wheels
    (left_theta, left_deviation), rear_left = surer(fl, rl, axle_deviation)
    (right_theta, right_deviation), rear_right = surer(fr, rr, axle_deviation)
    rear_theta, rear_deviation = lower(rear_left, rear_right)
    left_n, right_n, rear_n, rear_right_n = load_n
    rear_n += rear_right_n
    total_n = left_n + right_n + rear_n
    theta = left_n * left_theta + right_n * right_theta + rear_n * rear_theta
    deviation = left_n * left_deviation + right_n * right_deviation + rear_n * rear_deviation
    return _new(Friction, (theta / total_n, deviation / total_n))
