"""What slip, load and force show of theta, and where noise hides it."""

from __future__ import annotations

import math
from typing import NamedTuple

from .slip import GREATEST_SLIP, Slip
from .stationary_mean import StationaryMean, mean_slip_deviation
from .tyre import TyreAtSlip, sliding_onset_friction, tyre_at_slip

GREATEST_THETA = 1.2
"""Upper end of what the estimate may be: the domain of the difference in section 4.2 [-]."""
SIGNIFICANCE = 1.5
"""How many standard deviations of slip must lie between the tyre and one that does not slide at all, for a mean over
a long time [-]."""
SHORT_MEAN_SIGNIFICANCE = 1.0
"""How many more for a single reading [-]: a short mean is another one at each step, and one of many is soon far off."""
SHORT_MEAN_S = 0.08
"""Time constant with which a longer mean needs less of that [s]."""
READING_SIGNIFICANCE = SIGNIFICANCE + SHORT_MEAN_SIGNIFICANCE
CONFIRMED_SIGNIFICANCE = 0.25
"""The same where the camera's class is that of such a road: two independent sources need less of each [-]."""
CONFIRMED_AFTER_S = 0.02
"""Least duration of a mean for that: as long as its noise takes to forget itself [s]."""
NEAR_CLASS = 0.15
"""How far roads lie about the value of their class [-]."""
LEAST_SENSITIVITY = 0.1
"""Where d mu / d theta is below this, an error of 0.01 in the used friction would be one of 0.1 in theta: there is
nothing to invert [-]."""


class WheelInputs(NamedTuple):
    """What one wheel's estimator is given at a step."""

    wheel_speed_rad_s: float
    wheel_speed_ahead_rad_s: float
    """Mean over the step to come: a wheel that gains speed would else seem to bear too much force."""
    wheel_torque_nm: float
    """Mean over the step to come."""
    slip: Slip
    load_n: float
    slip_deviation: float
    """Standard deviation of the slip through sensor noise and a bias that is not known better [-]."""
    slip_change: float
    """Distance of the slip from its lagged value (filtered once more) [-]: force and slip of a tyre that is being
    loaded or unloaded pass the filter along the chord of its bent curve, and lie that far beside it."""
    way_m: float = 0.0
    """Way driven over the step to come [m]."""
    torque_known: bool = True
    """False at a locked wheel: its brake holds what the road gives, whatever was commanded."""
    slip_noise: float = 0.0
    """Standard deviation of the filtered slip through noise alone, which a mean over time lessens [-]."""
    slip_bias_deviation: float = 0.0
    """That of slip's constant offset and of the tyre's curve, which no mean lessens, as far as it counts [-]."""
    slip_rise: float = 0.0
    """`slip_change` with its sign: positive while the tyre is being loaded [-]."""
    noise_s: float = 1.0
    """Time in which the filtered noise forgets itself: twice the filter's constant [s]."""

    def friction(self, force_n: float) -> float:
        """Used friction of a force in the direction of the slip [-]."""
        return force_n * self.slip.direction / self.load_n


class OperatingPoint(NamedTuple):
    """Where on the tyre's curve the wheel is, by slip and load."""

    tyre: TyreAtSlip
    slides_below: float
    """Used friction below which the tyre slides with significance; 0 where noise hides it [-]."""

    def theta(self, friction: float) -> float | None:
        """The inverse of a used friction; None where theta is not identifiable [-]."""
        if friction > self.slides_below or self.slides_below == 0.0:
            return None
        theta = self.tyre.theta(friction)
        if theta is None or self.tyre.friction_by_theta(theta) < LEAST_SENSITIVITY:
            return None
        return min(theta, GREATEST_THETA)


def point_of_reading(inputs: WheelInputs, longitudinal_stiffness_n: float) -> OperatingPoint:
    """The operating point of the newest reading.

    On grippy roads force and slip lie on the curve's elastic part, where noise alone decides on which side of its
    end: half of all samples then seem to slide, and to have a theta of little more than the friction they use.
    So the force must also be below the elastic one of a slip that is `READING_SIGNIFICANCE` deviations smaller.
    """
    slip, load_n = inputs.slip.size, inputs.load_n
    least_slip = slip - READING_SIGNIFICANCE * (inputs.slip_deviation + inputs.slip_change)
    return OperatingPoint(
        tyre_at_slip(slip, load_n, longitudinal_stiffness_n),
        sliding_onset_friction(least_slip, load_n, longitudinal_stiffness_n),
    )


def point_of_mean(
    mean: StationaryMean, inputs: WheelInputs, longitudinal_stiffness_n: float, significance: float
) -> OperatingPoint:
    """The operating point of the mean slip, which slides with a significance in standard deviations [-]."""
    deviation = mean_slip_deviation(mean, inputs.slip_noise, inputs.noise_s, inputs.slip_bias_deviation)
    least_slip = mean.slip - significance * (deviation + abs(mean.rise))
    return OperatingPoint(
        tyre_at_slip(mean.slip, inputs.load_n, longitudinal_stiffness_n),
        sliding_onset_friction(least_slip, inputs.load_n, longitudinal_stiffness_n),
    )


def significance_of_mean(mean: StationaryMean) -> float:
    """Standard deviations that a mean needs by its duration [-]."""
    return SIGNIFICANCE + SHORT_MEAN_SIGNIFICANCE * math.exp(-mean.duration_s / SHORT_MEAN_S)


def confirmed_theta(
    theta_img: float, mean: StationaryMean, inputs: WheelInputs, longitudinal_stiffness_n: float
) -> float | None:
    """theta(lambda, F_hat) of the means where the camera's class confirms it; None where it does not [-]."""
    if mean.duration_s < CONFIRMED_AFTER_S:
        return None
    point = point_of_mean(mean, inputs, longitudinal_stiffness_n, CONFIRMED_SIGNIFICANCE)
    theta = point.theta(mean.friction)
    return theta if theta is not None and abs(theta - theta_img) < NEAR_CLASS else None


def visible_theta(force_n: float, inputs: WheelInputs, longitudinal_stiffness_n: float) -> float | None:
    """theta(lambda, F) of the newest reading; None where it is not identifiable, see `point_of_reading` [-]."""
    return point_of_reading(inputs, longitudinal_stiffness_n).theta(inputs.friction(force_n))


def least_theta(force_n: float, inputs: WheelInputs, longitudinal_stiffness_n: float) -> float:
    """The smallest theta that force and slip allow: the inverse at a slip `READING_SIGNIFICANCE` deviations larger.

    Below the curve's maximum, that is: beyond it a larger slip asks for more theta, but there the tyre is seen.
    """
    slip = inputs.slip.size + READING_SIGNIFICANCE * (inputs.slip_deviation + inputs.slip_change)
    friction = inputs.friction(force_n)
    tyre = tyre_at_slip(min(slip, GREATEST_SLIP), inputs.load_n, longitudinal_stiffness_n)
    theta = tyre.theta(friction)
    if theta is None:
        theta = 2.0 * tyre.adhering if friction > 0.0 else 0.0
    return min(theta, GREATEST_THETA)
