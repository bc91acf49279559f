"""Means of slip and used friction while a wheel stays at one point of the tyre's curve.

White noise gives one filtered reading the deviation sigma, and a mean over the time t about
sigma / sqrt(1 + t / (2 tau)), with the filter's constant tau. A mean restarts when slip moves: the curve is bent, and a
mean along it would lie beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

MOVED_DEVIATIONS = 3.0
"""Deviations of a filtered reading from the mean at which the wheel is at another point of the curve [-]."""
RISING_DEVIATIONS = 2.1
"""How far noise alone takes slip from its lagged value (filtered once more), in deviations of the filtered slip: three
of the difference, whose variance is half the slip's [-]."""
MEMORY_S = 0.2
"""Longest memory of a mean [s]."""
SIGNIFICANCE = 2.0
"""How many standard deviations of slip must lie between the tyre and one that does not slide at all, for a mean over
a long time [-]."""
SHORT_MEAN_SIGNIFICANCE = 0.5
"""How many more for a single reading [-]: a short mean is another one at each step, and one of many is soon far off."""
CURVE_SHARE = 0.005
"""Standard deviation of the slip at which the tyre's curve has a force, as a share of it, which no mean lessens [-]."""
SHORT_MEAN_S = 0.08
"""Time constant with which a longer mean needs less of that [s]."""
GREATEST_GAMMA_FACTOR = 2.0
"""Most by which gamma grows with a mean: K must stay well above it [-]."""


class StationaryMean(NamedTuple):
    """Means of the readings since slip is stationary."""

    slip: float = 0.0
    """Mean unsigned slip [-]."""
    friction: float = 0.0
    """Mean used friction in the direction of the slip [-]."""
    rise: float = 0.0
    """Mean of slip less its lagged value [-]."""
    duration_s: float = 0.0
    """Time since then; 0 where there is no reading [s]."""


NO_MEAN = StationaryMean()


def with_reading(
    mean: StationaryMean, slip: float, friction: float, rise: float, noise: float, step_s: float
) -> StationaryMean:
    """The means with one more reading; they begin anew where slip has moved.

    Parameters
    ----------
    mean : StationaryMean
        Means before.
    slip, friction, rise : float
        Unsigned slip, used friction, slip less its lagged value [-].
    noise : float
        Standard deviation of the filtered slip through noise [-].
    step_s : float
        Step [s].
    """
    stationary = abs(rise) < RISING_DEVIATIONS * noise and abs(slip - mean.slip) < MOVED_DEVIATIONS * noise
    if mean.duration_s == 0.0 or not stationary:
        return StationaryMean(slip, friction, rise, step_s)
    duration_s = mean.duration_s + step_s
    share = step_s / min(duration_s, MEMORY_S)
    return StationaryMean(
        slip=mean.slip + share * (slip - mean.slip),
        friction=mean.friction + share * (friction - mean.friction),
        rise=mean.rise + share * (rise - mean.rise),
        duration_s=duration_s,
    )


def least_slip(mean: StationaryMean, noise: float, noise_s: float) -> float:
    """The slip that the wheel has with significance: that of the mean less what noise and movement may add to it [-].

    On grippy roads force and slip lie on the adhesion part of the curve, where noise alone decides on which side of its
    end: half of all samples then seem to slide, and to have a theta of little more than the friction they use.

    Parameters
    ----------
    mean : StationaryMean
        The means.
    noise, noise_s : float
        Standard deviation of one filtered reading through noise [-], and twice the filter's time constant [s].
    """
    # A mean that forgets with a time constant is as sure as an even one over twice that.
    by_noise = noise * noise / (1.0 + min(mean.duration_s, 2.0 * MEMORY_S) / noise_s)
    by_curve = CURVE_SHARE * mean.slip
    deviation = math.sqrt(by_noise + by_curve * by_curve)
    significance = SIGNIFICANCE + SHORT_MEAN_SIGNIFICANCE * math.exp(-mean.duration_s / SHORT_MEAN_S)
    return mean.slip - significance * (deviation + abs(mean.rise))


def gamma_factor(mean: StationaryMean, noise_s: float) -> float:
    """Factor by which the estimate may follow a mean faster than a reading at the same noise [-]."""
    return min(1.0 + mean.duration_s / noise_s, GREATEST_GAMMA_FACTOR)
