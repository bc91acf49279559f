"""The adhesion estimator with or without the camera: Eqs. (16) to (19) of Tian et al. 2022.

One step serves the dynamics estimator DE (epsilon = 0) and the fusion DIFE alike, so they differ by the camera alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from .excitation import FuzzyScheduler
from .identifiability import (
    GREATEST_THETA,
    WheelInputs,
    confirmed_theta,
    least_theta,
    point_of_mean,
    point_of_reading,
    significance_of_mean,
)
from .observer import advanced_state, observed_force, settled_state
from .stationary_mean import NO_MEAN, StationaryMean, aged, gamma_factor, with_reading
from .theta_variance import VarianceModel, camera_share
from .tyre import force, tyre_at_slip

__all__ = [
    "GREATEST_THETA",
    "LEAST_THETA",
    "NEVER_SEEN_M",
    "OTHER_CLASS_M",
    "SEEN_HOLD_M",
    "DynamicsUpdate",
    "FusionState",
    "FusionStep",
    "Gains",
    "VisualTerm",
    "Wheel",
    "fusion_step",
    "settled",
]

LEAST_THETA = 0.02
"""Lower end: at 0 the tyre model has no force and the estimate could never leave it [-]."""
SEEN_HOLD_M = 2.0
"""Way after which what the tyre showed no longer speaks for the road under it: the depth of the near group [m]."""
OTHER_CLASS_M = 4.0
"""Way for which another class must stand to be another road: twice what one picture's verdict reaches [m]."""
NEVER_SEEN_M = 1e6
"""Way since the tyre showed theta where it never did [m]."""


class VisualTerm(Enum):
    """Where the visual term stands."""

    INSIDE = 17
    """Eq. (17): inside the bracket that gamma multiplies."""
    OUTSIDE = 18
    """Eq. (18): outside of it, the form that the paper gives with its cases."""


@dataclass(frozen=True)
class Gains:
    """Gains of force observer and estimator.

    K [1/s] is the force observer's bandwidth, gamma [1/s] the estimator's.

    With `tyre_first` the camera hurries the estimate along but does not drag it away from what the tyre shows: where
    theta(lambda, F_hat) is seen, the visual term acts only in its direction and no farther than it. After it was seen
    the term rests for 2 m at least, and until the camera has said for 4 m that the road is of another class: a class
    has one value wherever it is, so the one under which the tyre was seen says nothing new. From the first sight
    on, a class that has not yet stood for 4 m says nothing by itself.
    A tyre that is not sure to slide counts as seen in this where it would show a theta within 0.15 of the class's.
    Where the tyre is not seen, theta_img counts as no less than force and slip allow, and K_v follows the share of
    the difference that the estimate's own variance leaves to the class. Eqs. (17) and (18) as printed have no such
    guard: there a wrong class with its flag up pulls a settled estimate off by
    K_v (theta_img - theta_hat) / (gamma + K_v), 0.02 for "dry" on a road of 0.5.
    """

    K: float = 63.0
    gamma: float = 12.5
    visual_term: VisualTerm = VisualTerm.OUTSIDE
    tyre_first: bool = True
    innovation: float = 0.0


@dataclass(frozen=True, slots=True)
class Wheel:
    """The constants of the wheel: I [kg m^2], R [m], C_x [N]."""

    inertia_kg_m2: float
    radius_m: float
    longitudinal_stiffness_n: float


class FusionState(NamedTuple):
    """Inner state of one estimator."""

    theta_hat: float
    """Estimated adhesion [-]."""
    s: float
    """The observer's s [rad/s^2]."""
    unseen_m: float = NEVER_SEEN_M
    """Way since the tyre last showed theta [m]."""
    theta_img: float | None = None
    """Adhesion of the class that the camera last gave the road under the wheel [-]."""
    road_img: float | None = None
    """That of the class that has stood, from the tyre's first showing theta on [-]."""
    other_m: float = 0.0
    """Way for which one other class than that has been given [m]."""
    rests: bool = False
    """Whether the tyre has shown theta since that class stands: the camera then has nothing to add."""
    mean: StationaryMean = NO_MEAN
    """Means of slip and used friction since the wheel is at one point of the curve."""


class DynamicsUpdate(NamedTuple):
    """What one step makes of slip, torque and load alone."""

    theta_hat: float
    """Estimate after the step [-]."""
    s: float
    """The observer's s after it [rad/s^2]."""
    model_n: float
    """Force of the tyre model at theta_hat before it [N]."""
    force_n: float
    """Observed force F_hat [N]."""
    theta_tyre: float | None
    """theta(lambda, F_hat); None where the tyre does not show it or the estimate holds [-]."""
    mean: StationaryMean
    """Means of slip and used friction with this step's reading."""


class FusionStep(NamedTuple):
    """Outcome of one step."""

    state: FusionState
    dynamics: DynamicsUpdate
    """The same step without the camera."""
    threshold: float
    """Excitation threshold [-]."""
    excited: bool
    K_v: float
    """Visual gain, [-] in the form (17) and [1/s] in the form (18)."""

    @property
    def tyre_force_n(self) -> float:
        """Observed force F_hat [N]."""
        return self.dynamics.force_n

    @property
    def theta_tyre(self) -> float | None:
        """theta(lambda, F_hat), see `DynamicsUpdate` [-]."""
        return self.dynamics.theta_tyre


def settled(state: FusionState, inputs: WheelInputs, wheel: Wheel, gains: Gains) -> FusionState:
    """The state with its observed force balancing the wheel torque, to start from."""
    model = _model_force(state.theta_hat, inputs, wheel)
    balanced = inputs.wheel_torque_nm / wheel.radius_m
    s = settled_state(model, balanced, inputs.wheel_speed_rad_s, gains.K, wheel.inertia_kg_m2, wheel.radius_m)
    return state._replace(s=s)


def unread(state: FusionState, passed_s: float, way_m: float) -> FusionState:
    """The state after a time and a way in which nothing could be read."""
    unseen_m = min(state.unseen_m + way_m, NEVER_SEEN_M)
    return state._replace(unseen_m=unseen_m, mean=aged(state.mean, passed_s))


def _model_force(theta_hat: float, inputs: WheelInputs, wheel: Wheel) -> float:
    """Force of the tyre model [N]."""
    slip = inputs.slip
    return force(theta_hat, slip.size, inputs.load_n, wheel.longitudinal_stiffness_n, slip.direction)


def _dynamics_update(
    state: FusionState, inputs: WheelInputs, wheel: Wheel, gains: Gains, step_s: float, above: bool
) -> DynamicsUpdate:
    """Observer and estimator over a step without the camera.

    theta(lambda, F_hat) is asked for where slip is above a threshold. The torque of a locked wheel is not known: the
    observer then is led by the tyre model and the estimate holds.
    """
    theta_hat, inertia, radius_m = state.theta_hat, wheel.inertia_kg_m2, wheel.radius_m
    model_n = _model_force(theta_hat, inputs, wheel)
    if not inputs.torque_known:
        s = settled_state(model_n, model_n, inputs.wheel_speed_rad_s, gains.K, inertia, radius_m)
        return DynamicsUpdate(theta_hat, s, model_n, model_n, theta_tyre=None, mean=NO_MEAN)
    force_n = observed_force(model_n, state.s, inputs.wheel_speed_rad_s, gains.K, inertia, radius_m)
    theta_tyre, theta_next, mean = None, theta_hat, NO_MEAN
    if above:
        mean = with_reading(
            state.mean,
            inputs.slip.size,
            inputs.friction(force_n),
            inputs.slip_rise,
            inputs.slip_noise,
            step_s,
        )
        theta_tyre = _theta_tyre(mean, inputs, wheel, step_s)
    if theta_tyre is not None:
        rate = gains.gamma * gamma_factor(mean, inputs.noise_s)
        rate *= 1.0 + gains.innovation * abs(theta_tyre - theta_hat)
        theta_next = _relaxed(theta_hat, rate, rate * theta_tyre, step_s)
    s = _advanced_observer(state, model_n, theta_next, inputs, wheel, gains, step_s)
    return DynamicsUpdate(theta_next, s, model_n, force_n, theta_tyre, mean)


def _theta_tyre(mean: StationaryMean, inputs: WheelInputs, wheel: Wheel, step_s: float) -> float | None:
    """theta(lambda, F_hat) of the means, or of the newest reading where they have just begun anew [-]."""
    C_x = wheel.longitudinal_stiffness_n
    if mean.duration_s > step_s:
        point = point_of_mean(mean, inputs, C_x, significance_of_mean(mean))
    else:
        point = point_of_reading(inputs, C_x)
    return point.theta(mean.friction)


def _advanced_observer(
    state: FusionState,
    model_n: float,
    theta_next: float,
    inputs: WheelInputs,
    wheel: Wheel,
    gains: Gains,
    step_s: float,
) -> float:
    """The observer's s after a step over which theta_hat goes to `theta_next` [rad/s^2]."""
    by_theta_n = theta_rate = 0.0
    if theta_next != state.theta_hat and step_s > 0.0:
        theta_rate = (theta_next - state.theta_hat) / step_s
        tyre = tyre_at_slip(inputs.slip.size, inputs.load_n, wheel.longitudinal_stiffness_n)
        by_theta_n = inputs.slip.direction * inputs.load_n * tyre.friction_by_theta(state.theta_hat)
    return advanced_state(
        state.s,
        model_n,
        by_theta_n,
        theta_rate,
        inputs.wheel_torque_nm,
        inputs.wheel_speed_ahead_rad_s,
        gains.K,
        wheel.inertia_kg_m2,
        wheel.radius_m,
        step_s,
    )


def _with_camera(
    state: FusionState,
    dynamics: DynamicsUpdate,
    theta_tyre: float | None,
    theta_img: float | None,
    K_v: float,
    inputs: WheelInputs,
    wheel: Wheel,
    gains: Gains,
    step_s: float,
) -> tuple[float, float]:
    """theta_hat and s after a step of Eq. (17) or (18)."""
    rate = K_v * (gains.gamma if gains.visual_term is VisualTerm.INSIDE else 1.0)
    pull = 0.0 if theta_img is None else rate * theta_img
    if theta_tyre is not None:
        by_tyre = gains.gamma * gamma_factor(dynamics.mean, inputs.noise_s)
        rate, pull = by_tyre + rate, by_tyre * theta_tyre + pull
    theta_next = _relaxed(state.theta_hat, rate, pull, step_s)
    return theta_next, _advanced_observer(state, dynamics.model_n, theta_next, inputs, wheel, gains, step_s)


def _with_class(state: FusionState, theta_img: float | None, way_m: float) -> FusionState:
    """The state with the class that the camera gives now."""
    if theta_img is None:
        return state
    if state.road_img is None:
        return state._replace(theta_img=theta_img)
    if theta_img == state.road_img:
        return state._replace(theta_img=theta_img, other_m=0.0)
    other_m = state.other_m + way_m if theta_img == state.theta_img else way_m
    if other_m < OTHER_CLASS_M:
        return state._replace(theta_img=theta_img, other_m=other_m)
    # Another class that stands: what the tyre showed was another road.
    return state._replace(theta_img=theta_img, road_img=theta_img, other_m=0.0, rests=False)


def fusion_step(
    state: FusionState,
    inputs: WheelInputs,
    wheel: Wheel,
    gains: Gains,
    scheduler: FuzzyScheduler,
    theta_img: float | None,
    step_s: float,
    confidence: VarianceModel | None = None,
    variance: float = 0.0,
) -> FusionStep:
    """One step of observer and estimator.

    The tyre is excited where slip is above the fuzzy threshold. It also is where it visibly slides at a slip above
    the threshold that would stand without a picture: after a wrong class "dry" the fuzzy threshold alone would keep
    the estimator off a wet road on which the tyre shows theta (in the paper's simulation that leaves an error of
    0.07, against 0.005 so). Else theta_hat holds and the observer
    keeps running. The estimator's equation is linear in theta_hat over a step and is solved exactly, so that it is
    stable for any step size.

    Parameters
    ----------
    state, inputs, wheel, gains, scheduler
        State now, inputs at the start of the step, and constants.
    theta_img : float or None
        Adhesion of the class that the camera gives the road under the wheel; None where epsilon = 0 [-].
    step_s : float
        Step [s].
    confidence, variance : VarianceModel, float
        That of the estimate: where the tyre is not seen, a class may claim `theta_variance.camera_share` of its
        distance from the estimate; without a model all of it.
    """
    slip, load_n, C_x = inputs.slip.size, inputs.load_n, wheel.longitudinal_stiffness_n
    threshold = scheduler.threshold(theta_img, load_n, C_x, inputs.slip_deviation)
    threshold_alone = scheduler.threshold(None, load_n, C_x, inputs.slip_deviation)
    dynamics = _dynamics_update(state, inputs, wheel, gains, step_s, slip > min(threshold, threshold_alone))
    theta_tyre, theta_hat = dynamics.theta_tyre, state.theta_hat
    theta_next, s, K_v = dynamics.theta_hat, dynamics.s, 0.0
    state = _with_class(state, theta_img, inputs.way_m)
    unseen_m = min(state.unseen_m + inputs.way_m, NEVER_SEEN_M)
    excited = theta_tyre is not None or (slip > threshold and inputs.torque_known)
    if excited and theta_img is not None:
        by_tyre, by_camera = (
            _guarded(theta_img, state, unseen_m, dynamics, inputs, C_x)
            if gains.tyre_first
            else (theta_tyre, theta_img)
        )
        if by_camera is not None:
            difference = abs(by_camera - theta_hat)
            if by_tyre is None and confidence is not None and gains.tyre_first:
                difference *= camera_share(confidence, variance, theta_hat)
            K_v = scheduler.K_v(difference)
        if K_v != 0.0 or by_tyre is not theta_tyre:
            theta_next, s = _with_camera(
                state, dynamics, by_tyre, by_camera, K_v, inputs, wheel, gains, step_s
            )
    road_img, rests = state.road_img, state.rests
    if theta_tyre is not None:
        unseen_m = 0.0
        road_img = state.theta_img if state.road_img is None else state.road_img
        rests = road_img is not None
    after = FusionState(
        theta_next, s, unseen_m, state.theta_img, road_img, state.other_m, rests, dynamics.mean
    )
    return FusionStep(after, dynamics, threshold, excited, K_v)


def _guarded(
    theta_img: float,
    state: FusionState,
    unseen_m: float,
    dynamics: DynamicsUpdate,
    inputs: WheelInputs,
    longitudinal_stiffness_n: float,
) -> tuple[float | None, float | None]:
    """What tyre and camera pull theta_hat to under the guards of `Gains.tyre_first`; None where one does not [-]."""
    theta_tyre = dynamics.theta_tyre
    silent = state.rests or unseen_m < SEEN_HOLD_M or state.other_m > 0.0
    if theta_tyre is None and not silent:
        theta_tyre = confirmed_theta(theta_img, dynamics.mean, inputs, longitudinal_stiffness_n)
    if theta_tyre is not None:
        return theta_tyre, _agreeing(theta_img, state.theta_hat, theta_tyre)
    if silent:
        return None, None
    # Not less than it already carries.
    return None, max(theta_img, least_theta(dynamics.force_n, inputs, longitudinal_stiffness_n))


def _agreeing(theta_img: float, theta_hat: float, theta_tyre: float) -> float | None:
    """What the camera may still say beside a tyre that is seen.

    None where the tyre pulls the estimate the other way; no farther off than what the tyre shows.
    """
    by_tyre, by_camera = theta_tyre - theta_hat, theta_img - theta_hat
    if by_tyre * by_camera < 0.0:
        return None
    # Of noisy samples half lie on the camera's side: without this bound their noise would be rectified.
    return theta_img if abs(by_camera) < abs(by_tyre) else theta_tyre


def _relaxed(theta_hat: float, rate: float, pull: float, step_s: float) -> float:
    """theta_hat one step later under theta_hat' = pull - rate theta_hat, both held over the step."""
    if rate == 0.0:
        return theta_hat
    target = pull / rate
    moved = target + (theta_hat - target) * math.exp(-rate * step_s)
    return min(max(moved, LEAST_THETA), GREATEST_THETA)
