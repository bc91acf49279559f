"""How sure the estimate is: variance gained where the tyre shows theta, lost with every metre where it does not."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .dife import Wheel, WheelInputs
from .tyre import friction_by_slip


@dataclass(frozen=True)
class ConfidenceModel:
    """Noise that the estimate is held to.

    Parameters
    ----------
    torque_noise_nm : float
        Of the wheel torque per sample [N m].
    tyre_share : float
        What the tyre model itself may be wrong by, as a share of used friction [-].
    road_change : float
        How far friction may wander per root of a metre driven unseen [1/sqrt(m)].
    unknown : float
        Standard deviation where nothing is known: of a road between 0.1 and 1.1 [-].
    """

    torque_noise_nm: float = 3.2
    tyre_share: float = 0.01
    road_change: float = 0.05
    unknown: float = 0.29


def wandered(model: ConfidenceModel, variance: float, way_m: float) -> float:
    """Variance after a way driven unseen [-]."""
    return min(variance + model.road_change**2 * abs(way_m), model.unknown**2)


def advanced_variance(
    model: ConfidenceModel,
    variance: float,
    theta_hat: float,
    sensitivity: float,
    inputs: WheelInputs,
    wheel: Wheel,
    gamma: float,
    way_m: float,
    step_s: float,
) -> float:
    """Variance of the estimate one step later [-].

    While the tyre shows theta (sensitivity d mu / d theta above 0) the estimator is a first-order filter of
    rate gamma over theta(lambda, F_hat), so its variance goes to that of filtered white noise,
    sigma^2 gamma dt / 2, plus the tyre model's own error. Otherwise it grows with the way driven.
    """
    if step_s == 0.0:
        return variance
    grown = wandered(model, variance, way_m)
    if sensitivity > 0.0:
        slope = friction_by_slip(theta_hat, inputs.slip.size, inputs.load_n, wheel.longitudinal_stiffness_n)
        from_slip = slope * inputs.slip_deviation
        from_torque = model.torque_noise_nm / (wheel.radius_m * inputs.load_n)
        sample = (from_slip**2 + from_torque**2) / sensitivity**2
        settled = sample * gamma * step_s / 2.0 + (model.tyre_share / sensitivity) ** 2
        share = 1.0 - math.exp(-2.0 * gamma * step_s)
        grown += share * (settled - grown)
    return min(grown, model.unknown**2)
