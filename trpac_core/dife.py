"""Force observer and estimator of Eqs. (14) to (18) of Tian et al. 2022, run where the tyre slides with significance.

Print runs the estimator above a slip threshold that follows the camera's class. Noise then makes an adhering
tyre seem to slide, and the estimate falls; and a wrong class "dry" sets the threshold above all slip of a wet
road. Here theta(lambda, F_hat) counts where a tyre that does not slide would need less slip than there surely is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from .fuzzy import Partition
from .observer import advanced_state, observed_force, settled_state
from .slip import Slip
from .stationary_mean import NO_MEAN, StationaryMean, gamma_factor, least_slip, with_reading
from .tyre import GREATEST_THETA, LEAST_THETA, force, onset_slip, sliding_onset_friction, tyre_at_slip

LEAST_SENSITIVITY = 0.1
"""Where d mu / d theta is below this, an error of 0.01 in the used friction would be one of 0.1 in theta: there is
nothing to invert [-]."""
INNOVATION = 20.0
"""How much faster the estimate follows per distance from what the tyre shows: at 0.1 three times as fast [-]."""


DIFFERENCE_SETS = Partition(0.15, 0.35, 0.6)
"""Fuzzy sets of Table 2 over the distance of class and estimate [-]. S reaches over the scatter of roads about their
class's value, or that would pull the settled estimate away from the tyre's."""


class VisualTerm(Enum):
    """Where the visual term stands."""

    INSIDE = 17
    """Eq. (17): inside the bracket that gamma multiplies."""
    OUTSIDE = 18
    """Eq. (18): outside of it, the form that the paper gives with its cases."""


@dataclass(frozen=True)
class Gains:
    """Gains.

    Parameters
    ----------
    K, gamma : float
        Bandwidth of the force observer and rate of the estimator [1/s].
    visual_term : VisualTerm
        Form of the visual term.
    difference_sets : Partition
        Where the fuzzy sets of Table 2 over the distance of class and estimate lie [-].
    K_v_values : tuple of 3 floats
        K_v of S, M and B, [-] in the form (17) and [1/s] in the form (18).
    """

    K: float = 63.0
    gamma: float = 12.5
    visual_term: VisualTerm = VisualTerm.OUTSIDE
    difference_sets: Partition = DIFFERENCE_SETS
    K_v_values: tuple[float, float, float] = (0.0, 1.5, 3.0)


@dataclass(frozen=True, slots=True)
class Wheel:
    """The constants of the wheel: I [kg m^2], R [m], C_x [N]."""

    inertia_kg_m2: float
    radius_m: float
    longitudinal_stiffness_n: float


class WheelInputs(NamedTuple):
    """Inputs of the estimator of one wheel at a step."""

    wheel_speed_rad_s: float
    wheel_speed_ahead_rad_s: float
    """Mean over the step to come: a wheel that gains speed would else seem to bear too much force."""
    wheel_torque_nm: float
    """Mean over the step to come, less rolling resistance."""
    slip: Slip
    load_n: float
    torque_known: bool
    """False at a locked wheel: its brake holds what the road gives, whatever was commanded."""
    slip_noise: float
    """Standard deviation of the filtered slip through noise [-]."""
    slip_rise: float
    """Slip less its lagged value, filtered once more; positive while the tyre is being loaded [-]: force and slip then
    pass the filter along the chord of the tyre's bent curve, and lie that far beside it."""
    noise_s: float
    """Time in which the filtered noise forgets itself: twice the filter's constant [s]."""


class FusionState(NamedTuple):
    """Inner state of one estimator."""

    theta_hat: float
    """Estimated adhesion [-]."""
    s: float
    """The observer's s [rad/s^2]."""
    mean: StationaryMean = NO_MEAN
    """Means of slip and used friction since the wheel is at one point of the curve."""


class FusionStep(NamedTuple):
    """Outcome of one step."""

    state: FusionState
    tyre_force_n: float
    """Observed force F_hat [N]."""
    theta_tyre: float | None
    """theta(lambda, F_hat); None where the tyre does not show it [-]."""
    threshold: float
    """Slip above which the estimator runs [-]."""
    excited: bool
    K_v: float
    """Visual gain, [-] in the form (17) and [1/s] in the form (18)."""


def visual_gain(gains: Gains, theta_img: float, theta_hat: float) -> float:
    """K_v of a class's adhesion and an estimate [-], in the unit of `Gains.K_v_values`."""
    return gains.difference_sets.blend(abs(theta_img - theta_hat), gains.K_v_values)


def settled(state: FusionState, inputs: WheelInputs, wheel: Wheel, gains: Gains) -> FusionState:
    """The state with its observed force balancing the wheel torque, to start from."""
    slip, balanced_n = inputs.slip, inputs.wheel_torque_nm / wheel.radius_m
    model_n = force(state.theta_hat, slip.size, inputs.load_n, wheel.longitudinal_stiffness_n, slip.direction)
    s = settled_state(
        model_n, balanced_n, inputs.wheel_speed_rad_s, gains.K, wheel.inertia_kg_m2, wheel.radius_m
    )
    return state._replace(s=s)


def _theta_tyre(mean: StationaryMean, inputs: WheelInputs, longitudinal_stiffness_n: float) -> float | None:
    """theta(lambda, F_hat) of the means; None where the tyre does not slide with significance, or hides theta [-]."""
    surely = least_slip(mean, inputs.slip_noise, inputs.noise_s)
    if mean.friction > sliding_onset_friction(surely, inputs.load_n, longitudinal_stiffness_n):
        return None
    tyre = tyre_at_slip(mean.slip, inputs.load_n, longitudinal_stiffness_n)
    theta = tyre.theta(mean.friction)
    return theta if theta is not None and tyre.friction_by_theta(theta) >= LEAST_SENSITIVITY else None


def fusion_step(
    state: FusionState,
    inputs: WheelInputs,
    wheel: Wheel,
    gains: Gains,
    theta_img: float | None,
    onset_theta: float,
    step_s: float,
) -> FusionStep:
    """One step of observer and estimator.

    The estimator's equation is linear in theta_hat over a step and is solved exactly, so that it is stable for any
    step size. The torque of a locked wheel is not known: the observer then is led by the tyre model and the
    estimate holds.

    Parameters
    ----------
    state, inputs, wheel, gains
        State now, inputs at the start of the step, and constants.
    theta_img : float or None
        Adhesion of the class that the camera gives the road under the wheel; None where epsilon = 0 [-].
    onset_theta : float
        Friction of the road whose tyre begins to slide at the threshold [-].
    step_s : float
        Step [s].
    """
    slip, load_n, C_x = inputs.slip, inputs.load_n, wheel.longitudinal_stiffness_n
    theta_hat, inertia, radius_m = state.theta_hat, wheel.inertia_kg_m2, wheel.radius_m
    threshold = onset_slip(onset_theta, load_n, C_x, sensitivity=0.0)
    tyre = tyre_at_slip(slip.size, load_n, C_x)
    model_n = slip.direction * load_n * tyre.friction(theta_hat)
    if not inputs.torque_known:
        s = settled_state(model_n, model_n, inputs.wheel_speed_rad_s, gains.K, inertia, radius_m)
        return FusionStep(FusionState(theta_hat, s), model_n, None, threshold, excited=False, K_v=0.0)
    force_n = observed_force(model_n, state.s, inputs.wheel_speed_rad_s, gains.K, inertia, radius_m)
    excited, theta_tyre, mean, rate, pull, K_v = slip.size > threshold, None, NO_MEAN, 0.0, 0.0, 0.0
    if excited:
        friction = slip.direction * force_n / load_n
        mean = with_reading(state.mean, slip.size, friction, inputs.slip_rise, inputs.slip_noise, step_s)
        theta_tyre = _theta_tyre(mean, inputs, C_x)
    if theta_tyre is not None:
        factor = gamma_factor(mean, inputs.noise_s)
        # A single reading may be noise: only what has been averaged may hurry.
        innovation = INNOVATION * (factor - 1.0) * abs(theta_tyre - theta_hat)
        rate = gains.gamma * factor * (1.0 + innovation)
        pull = rate * theta_tyre
    if excited and theta_img is not None:
        K_v = visual_gain(gains, theta_img, theta_hat)
        by_camera = K_v * (gains.gamma if gains.visual_term is VisualTerm.INSIDE else 1.0)
        rate, pull = rate + by_camera, pull + by_camera * theta_img
    theta_next, model_change_n = theta_hat, 0.0
    if rate > 0.0:
        target = pull / rate
        theta_next = target + (theta_hat - target) * math.exp(-rate * step_s)
        theta_next = min(max(theta_next, LEAST_THETA), GREATEST_THETA)
        model_change_n = slip.direction * load_n * tyre.friction(theta_next) - model_n
    s = advanced_state(
        state.s,
        model_n,
        model_change_n,
        inputs.wheel_torque_nm,
        inputs.wheel_speed_ahead_rad_s,
        gains.K,
        inertia,
        radius_m,
        step_s,
    )
    return FusionStep(FusionState(theta_next, s, mean), force_n, theta_tyre, threshold, excited, K_v)
