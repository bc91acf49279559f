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


class Friction(NamedTuple):
    """An adhesion and its standard deviation [-]."""

    theta: float
    deviation: float


def surer(front: Friction, rear: Friction, axle_deviation: float) -> tuple[Friction, Friction]:
    """The friction of a side's two wheels: each its own estimate, or that of the other where its deviation is smaller.

    `axle_deviation` is the standard deviation of the road's change over a wheelbase [-].
    """
    if front.deviation <= rear.deviation:
        from_front = Friction(front.theta, _together(front.deviation, axle_deviation))
        return front, rear if rear.deviation <= from_front.deviation else from_front
    from_rear = Friction(rear.theta, _together(rear.deviation, axle_deviation))
    return front if front.deviation <= from_rear.deviation else from_rear, rear


def _together(first: float, second: float) -> float:
    """Standard deviation of the sum of two independent errors; math.hypot's last bit differs between its versions."""
    return math.sqrt(first * first + second * second)


def lower(first: Friction, second: Friction) -> Friction:
    """The smaller of two adhesions, and the root mean square error of taking it for the true minimum.

    Examples
    --------
    >>> lower(Friction(0.3, 0.02), Friction(0.8, 0.1)).deviation
    0.02
    """
    low, high = (first, second) if first.theta <= second.theta else (second, first)
    deviation = _together(low.deviation, high.deviation)
    if deviation == 0.0:
        return low
    gap = high.theta - low.theta
    ratio = gap / deviation
    right_order = 0.5 * (1.0 + math.erf(ratio / math.sqrt(2.0)))
    density = math.exp(-0.5 * ratio * ratio) / math.sqrt(2.0 * math.pi)
    square = (
        low.deviation * low.deviation * right_order
        + (gap * gap + high.deviation * high.deviation) * (1.0 - right_order)
        - gap * deviation * density
    )
    return Friction(low.theta, math.sqrt(max(square, 0.0)))


def car_friction(
    wheels: tuple[Friction, Friction, Friction, Friction],
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
    fl_n, fr_n, rl_n, rr_n = load_n
    left, rear_left = surer(fl, rl, axle_deviation)
    right, rear_right = surer(fr, rr, axle_deviation)
    rear, rear_n = lower(rear_left, rear_right), rl_n + rr_n
    total_n = fl_n + fr_n + rear_n
    theta = fl_n * left.theta + fr_n * right.theta + rear_n * rear.theta
    deviation = fl_n * left.deviation + fr_n * right.deviation + rear_n * rear.deviation
    return Friction(theta / total_n, deviation / total_n)
