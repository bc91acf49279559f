"""Means of slip and used friction while a wheel stays at one point of the tyre's curve.

White noise blurs one filtered reading by sigma, and a mean over the time t by about sigma / sqrt(1 + t / (2 tau)), with
the filter's constant tau. A mean begins anew wherever slip moves: the curve is bent, and a mean over a way along it
would lie beside it.
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
FORCE_SETTLING_S = 0.016
"""Time in which the observed force settles after slip moved: 1 / K [s]."""
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


def aged(mean: StationaryMean, passed_s: float) -> StationaryMean:
    """The means after a time without readings, as if so much less had gone into them; none after their memory."""
    if passed_s == 0.0:
        return mean
    duration_s = min(mean.duration_s, 2.0 * MEMORY_S)
    duration_s -= passed_s * max(duration_s / MEMORY_S, 1.0)
    return mean._replace(duration_s=duration_s) if duration_s > 0.0 else NO_MEAN


def mean_slip_deviation(mean: StationaryMean, noise: float, noise_s: float, bias_deviation: float) -> float:
    """Standard deviation of the mean slip [-].

    Parameters
    ----------
    mean : StationaryMean
        The means.
    noise, noise_s : float
        That of one filtered reading through noise [-], and twice the filter's time constant [s].
    bias_deviation : float
        Standard deviation of a constant error of the slip, which no mean lessens [-].
    """
    # A mean that forgets with a time constant is as sure as an even one over twice that.
    duration_s = min(mean.duration_s, 2.0 * MEMORY_S)
    return math.sqrt(noise * noise / (1.0 + duration_s / noise_s) + bias_deviation * bias_deviation)


def unsettled_slip(before: float, slip_change: float, noise: float, passed_s: float) -> float:
    """Recent distance of slip from its lagged value, beyond noise, as far as the force has not settled since [-]."""
    left = before * math.exp(-passed_s / FORCE_SETTLING_S)
    return slip_change if slip_change > RISING_DEVIATIONS * noise and slip_change > left else left


def gamma_factor(mean: StationaryMean, noise_s: float) -> float:
    """How much faster the estimate may follow a mean than a reading, with no more noise left in it [-]."""
    return min(1.0 + mean.duration_s / noise_s, GREATEST_GAMMA_FACTOR)
