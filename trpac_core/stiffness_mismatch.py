"""Does the tyre at hand slide where the model says so? What the course of its readings tells.

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
_new = tuple.__new__


class Following(NamedTuple):
    """The slope e [-] with its variance, and the running means of ln X and ln theta, None before the first reading."""

    slope: float = 0.0
    variance: float = 1.0
    log_elastic: float | None = None
    log_theta: float | None = None

    def share(self) -> float:
        """What of the slope lies beyond doubt, from 0 to 1 [-]."""
        least = self.slope - CONTRADICTED * math.sqrt(self.variance)
        return min(max(least, 0.0), 1.0)


def followed(
    before: Following, elastic: float, theta_tyre: float, noise: float, passed_s: float
) -> Following:
    """The slope after one more reading.

    Parameters
    ----------
    before : Following
        What was known.
    elastic, theta_tyre : float
        X / F_z and theta(lambda, F_hat), above 0 [-].
    noise : float
        Relative standard deviation of that theta through noise, in one reading [-].
    passed_s : float
        Time that this reading stands for [s].
    """
    slope, variance, log_elastic, log_theta = before
    now_elastic, now_theta = math.log(elastic), math.log(theta_tyre)
    if log_elastic is None or log_theta is None:
        return Following(slope, variance, now_elastic, now_theta)
    along, off = now_elastic - log_elastic, now_theta - log_theta
    total = along * along * variance + CORRELATED * noise * noise
    surprise = off - slope * along
    if total > 0.0 and surprise * surprise < REJECTED * REJECTED * total:
        gain = variance * along / total
        slope, variance = slope + gain * surprise, variance * (1.0 - gain * along)
    grown, share = min(1.0, variance + FORGETTING_1_S * passed_s), -math.expm1(-passed_s / MEAN_S)
    return _new(Following, (slope, grown, log_elastic + share * along, log_theta + share * off))
