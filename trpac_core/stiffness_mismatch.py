"""Mismatch of the tyre's stiffness, from how its theta follows its slip.

A road has one theta, whatever the driver does: on a tyre that is as told, theta(lambda, F_hat) stays where it is while
slip comes and goes. On one that is softer than told each point of its elastic line looks like the end of the curve, and
theta(lambda, F_hat) follows the slip ratio X = C_x lambda / (1 - lambda):

    ln theta(lambda, F_hat) = const + e ln X,    e = 0: it slides as told;   e = 1: all of it is elastic

A Kalman filter follows the slope e about the running mean of both. The reading then is off by the share e of the way
to the roads above it: at e = 1 it tells no more than that the road carries what the tyre carries.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .slip_calibration import CONTRADICTED, CORRELATED, REJECTED

MEAN_S = 0.5
"""Time constant of the running means: a stroke of the pedal [s]."""
FORGETTING_1_S = 0.01
"""Growth of the slope's variance with time: another part of the curve may be as told [1/s]."""


class StiffnessMismatch(NamedTuple):
    """The slope e [-] with its variance, and the running means of ln X and ln theta, None before the first reading."""

    slope: float = 0.0
    variance: float = 1.0
    log_adhering: float | None = None
    log_theta: float | None = None

    def share(self) -> float:
        """The part of the slope that lies beyond `CONTRADICTED` deviations of 0, from 0 to 1 [-]."""
        least = self.slope - CONTRADICTED * math.sqrt(self.variance)
        return min(max(least, 0.0), 1.0)


def updated_mismatch(
    before: StiffnessMismatch, adhering: float, theta_tyre: float, noise: float, passed_s: float
) -> StiffnessMismatch:
    """The slope after one more reading.

    Parameters
    ----------
    before : StiffnessMismatch
        What was known.
    adhering, theta_tyre : float
        X / F_z and theta(lambda, F_hat), above 0 [-].
    noise : float
        Relative standard deviation of that theta through noise, in one reading [-].
    passed_s : float
        Time that this reading stands for [s].
    """
    log_adhering, log_theta = math.log(adhering), math.log(theta_tyre)
    if before.log_adhering is None or before.log_theta is None:
        return before._replace(log_adhering=log_adhering, log_theta=log_theta)
    slope, variance = before.slope, before.variance
    by_adhering, by_theta = log_adhering - before.log_adhering, log_theta - before.log_theta
    total = by_adhering * by_adhering * variance + CORRELATED * noise * noise
    innovation = by_theta - slope * by_adhering
    if total > 0.0 and innovation * innovation < REJECTED * REJECTED * total:
        gain = variance * by_adhering / total
        slope, variance = slope + gain * innovation, variance * (1.0 - gain * by_adhering)
    share = -math.expm1(-passed_s / MEAN_S)
    return StiffnessMismatch(
        slope,
        variance=min(1.0, variance + FORGETTING_1_S * passed_s),
        log_adhering=before.log_adhering + share * by_adhering,
        log_theta=before.log_theta + share * by_theta,
    )
