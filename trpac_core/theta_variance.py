"""Variance of the estimate: by the tyre, the force it carries, the camera and the distance driven unseen.

The variance P is that of the error of theta_hat, not of a best guess: where the estimate holds, what is known of the
road may lie elsewhere, and the distance counts.

Force and slip on the sliding part of the curve are f = 1 - (1 - L)^2 of the elastic force, so L = 1 - sqrt(1 - f). A
relative error d of force or elastic line moves f to f (1 +- d): close to L = 1 a small d spans many roads, and beyond
it f says only that theta is no less than at f (1 - d). This is the information in theta; nothing about it is constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from .tyre import TyreAtSlip

LEAST_ROAD, GREATEST_ROAD = 0.05, 1.2
"""Roads lie between these [-]."""
HELD_SHARE = 0.95
"""Share of the true values that two standard deviations are to hold [-]."""
SURELY = 2.0
"""Deviations by which a bound on theta is taken lower than it reads [-]."""
LEAST_SHARE = 1e-9
"""Least error of the used friction, as a share: one may configure a car without any [-]."""
FARTHEST = 6.0
"""Deviations from the elastic line beyond which a tyre surely slides [-]."""
LAG_RATE_1_S = 50.0
"""Rate of the filter on the distance between the tyre's theta and the estimate [1/s]."""


@dataclass(frozen=True)
class VarianceModel:
    """Noise that the estimate is held to.

    Parameters
    ----------
    torque_noise_nm : float
        Of the wheel torque per sample [N m].
    tyre_share : float
        What the tyre's curve itself may be wrong by, as a share of used friction [-].
    car_share : float
        What load and torque may be wrong by: the share of theta that no driving can tell [-].
    road_change : float
        How far friction wanders at first per root of a metre driven unseen [1/sqrt(m)].
    class_change_m : float
        Way that a change of the class under the wheel counts as: the road may be another [m].
    class_scatter : float
        Distance of a road from the value of the class that the camera gave it, wrong classes included [-].
    unknown : float
        Standard deviation of roads of which nothing is known: anywhere between 0.05 and 1.2 [-].
    """

    torque_noise_nm: float = 3.2
    tyre_share: float = 0.01
    car_share: float = 0.03
    road_change: float = 0.05
    class_change_m: float = 60.0
    class_scatter: float = 0.15
    unknown: float = 0.33


MIDDLE_ROAD = 0.5 * (LEAST_ROAD + GREATEST_ROAD)
"""Middle of the roads that may be where nothing is known [-]."""


def uniform_variance(theta_hat: float, least: float, greatest: float) -> float:
    """Square of half the distance from the estimate that holds 95 % of the roads between two ends, alike likely [-].

    Not their mean square: no road lies beyond the ends, so two of its roots would hold every one.
    """
    above, below, held = greatest - theta_hat, theta_hat - least, HELD_SHARE * (greatest - least)
    nearer = min(above, below)
    half = 0.25 * held if 2.0 * nearer > held else 0.5 * (held - nearer)
    return half * half


def unknown_variance(model: VarianceModel, theta_hat: float) -> float:
    """That of an estimate that says nothing of the road [-]."""
    reach = math.sqrt(3.0) * model.unknown
    return uniform_variance(theta_hat, MIDDLE_ROAD - reach, MIDDLE_ROAD + reach)


def camera_share(model: VarianceModel, variance: float, theta_hat: float) -> float:
    """Share of its distance from the estimate that a class may claim [-].

    The Kalman gain P / (P + R), with the variance P of the estimate and R of a road about its class's value; as a
    share of what it is where nothing is known, so that Table 2 stands as it is there.
    """
    unknown, scatter = unknown_variance(model, theta_hat), model.class_scatter * model.class_scatter
    share = variance * (unknown + scatter) / (unknown * (variance + scatter))
    return min(share, 1.0)


def drifted_variance(model: VarianceModel, variance: float, theta_hat: float, way_m: float) -> float:
    """Variance after a way driven unseen: the road may have changed to any other [-]."""
    unknown = unknown_variance(model, theta_hat)
    if variance >= unknown:
        return variance
    return unknown - (unknown - variance) * math.exp(-(model.road_change**2) * abs(way_m) / unknown)


def theta_at(fraction: float, adhering: float) -> float:
    """Theta from the force as a fraction of the elastic one, below 1; 2 X / F_z is the road that just slides."""
    # 1 - sqrt(1 - f) in the form that keeps its digits where hardly any force is used.
    return 2.0 * adhering * (fraction / (1.0 + math.sqrt(1.0 - fraction)) if fraction < 1.0 else 1.0)


def bounded_variance(theta_hat: float, least: float) -> float:
    """`uniform_variance` where the road is known to be anywhere above `least` [-]."""
    return uniform_variance(theta_hat, min(least, GREATEST_ROAD - 0.1), GREATEST_ROAD)


class Evidence(NamedTuple):
    """What a step says of theta."""

    theta_tyre: float | None
    """theta(lambda, F_hat) where the tyre shows it [-]."""
    friction: float
    """Used friction in the direction of the slip [-]."""
    tyre: TyreAtSlip
    line_share: float
    """Standard deviation of the elastic line as a share of the slip [-]."""
    noise_share: float
    """That of the slip through noise and through its change, in one step [-]."""
    torque_friction: float
    """That of the used friction through the filtered torque's noise [-]."""
    mismatch: float = 0.0
    """Share of `StiffnessMismatch`, from 0 to 1 [-]."""


def reading_noise(friction: float, tyre: TyreAtSlip, noise_share: float, torque_friction: float) -> float:
    """Relative standard deviation of the tyre's theta through noise in one step; parameters as in `Evidence` [-]."""
    adhering = tyre.adhering
    fraction = friction / (adhering * tyre.g_0)
    share = math.hypot(noise_share, torque_friction / friction)
    low, high = theta_at(fraction * (1.0 - share), adhering), theta_at(fraction * (1.0 + share), adhering)
    return 0.5 * (high - low) / theta_at(fraction, adhering)


def advanced_variance(
    model: VarianceModel,
    variance: float,
    lag: float,
    theta_hat: float,
    evidence: Evidence,
    averaged: float,
    gamma: float,
    way_m: float,
    step_s: float,
) -> tuple[float, float]:
    """Variance of the estimate, and the tyre's smoothed distance from it, one step later.

    Parameters
    ----------
    model, variance, lag, theta_hat
        Constants; variance, distance and the estimate now [-].
    evidence : Evidence
        What the step says of theta.
    averaged : float
        What the estimator leaves of the variance of the slip's noise [-].
    gamma, way_m, step_s : float
        Rate of the estimator [1/s], way [m] and step [s].
    """
    variance = drifted_variance(model, variance, theta_hat, way_m)
    theta_tyre, friction, noise_share = evidence.theta_tyre, evidence.friction, evidence.noise_share
    if friction <= 0.0:
        return variance, 0.0
    adhering = evidence.tyre.adhering
    fraction = friction / (adhering * evidence.tyre.g_0)
    sure = evidence.line_share * evidence.line_share + model.tyre_share * model.tyre_share
    if theta_tyre is None:
        share = SURELY * math.sqrt(sure + noise_share * noise_share)
        least = theta_at(fraction * (1.0 - share), adhering) if share < 1.0 else 0.0
        if least > LEAST_ROAD:
            bound = bounded_variance(theta_hat, least)
            variance = bound if least > theta_hat else min(variance, bound)
        return variance, 0.0
    from_torque = evidence.torque_friction * evidence.torque_friction * averaged / (friction * friction)
    share = max(math.sqrt(sure + noise_share * noise_share * averaged + from_torque), LEAST_SHARE)
    low, high = theta_at(fraction * (1.0 - share), adhering), theta_at(fraction * (1.0 + share), adhering)
    half, scale = 0.5 * (high - low), model.car_share * theta_tyre
    settled = half * half + scale * scale
    # The same error may make a tyre that does not slide look like one that does: then any road above would do. By
    # Bayes' rule with all roads alike likely; exp(-x^2 / 2) integrates to sqrt(2 pi) half over those that slide.
    apart, above = (1.0 - fraction) / (fraction * share), GREATEST_ROAD - 2.0 * adhering
    if above > 0.0 and apart < FARTHEST:
        elsewhere, here = math.exp(-0.5 * apart * apart) * above, math.sqrt(2.0 * math.pi) * half
        # `here` is 0 where the force is surely more than the elastic one: no road that slides is known by it.
        share_elsewhere = elsewhere / (elsewhere + here) if here > 0.0 else 1.0
        settled += share_elsewhere * bounded_variance(theta_tyre, 2.0 * adhering)
    # A theta that follows the slip is no road's: then any road above would do.
    if evidence.mismatch > 0.0:
        settled += (
            evidence.mismatch * evidence.mismatch * (bounded_variance(theta_tyre, theta_tyre) - settled)
        )
    variance += (1.0 - math.exp(-2.0 * gamma * step_s)) * (settled - variance)
    variance = min(variance, unknown_variance(model, theta_hat))
    # Where the tyre goes on showing something else than the estimate, the estimate is off by that.
    lag += min(1.0, LAG_RATE_1_S * step_s) * (theta_tyre - theta_hat - lag)
    off = abs(lag) - half / share * noise_share
    return (max(variance, off * off) if off > 0.0 else variance), lag


def variance_with_camera(
    model: VarianceModel, variance: float, theta_hat: float, theta_img: float | None
) -> float:
    """Mean square error of the estimate with what the camera says of the road beside what is known [-]."""
    if theta_img is None:
        return variance
    scatter, distance = model.class_scatter * model.class_scatter, theta_img - theta_hat
    share = variance / (variance + scatter)
    together = share * scatter + share * distance * (share * distance)
    by_camera = scatter + distance * distance
    # Both may rest on the same: what is known of all roads. So together they are no surer than the better one.
    return max(together, min(variance, by_camera))
