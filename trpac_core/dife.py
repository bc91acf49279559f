"""The adhesion estimator with or without the camera: Eqs. (16) to (19) of Tian et al. 2022.

One step serves the dynamics estimator DE (epsilon = 0) and the fusion DIFE alike, so they differ by the camera alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from .excitation import FuzzyScheduler
from .identifiability import (
    GREATEST_THETA,
    LEAST_SENSITIVITY,
    Look,
    Place,
    WheelInputs,
    backed_theta,
    least_theta,
    place_of_mean,
    shown,
)
from .observer import advanced_state, observed_force, settled_state
from .stationary_mean import NOTHING, Steady, faded, held, quickened, same_slip
from .theta_variance import ConfidenceModel, camera_share
from .tyre import elastic_friction, force, sensitivity_of

__all__ = [
    "GREATEST_THETA",
    "LEAST_SENSITIVITY",
    "LEAST_THETA",
    "NEVER_SEEN_M",
    "OTHER_CLASS_M",
    "SEEN_HOLD_M",
    "FusionState",
    "FusionStep",
    "Gains",
    "Unaided",
    "VisualTerm",
    "Wheel",
    "dynamics_step",
    "fused_step",
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
_new = tuple.__new__


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
    steady: Steady = NOTHING
    """Means of slip and used friction since the wheel stands where it stands on the curve."""


class Unaided(NamedTuple):
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
    sensitivity: float
    """d mu / d theta there [-]; 0 where it is None."""
    steady: Steady
    place: Place | None
    """None where the newest reading stands for itself."""


class FusionStep(NamedTuple):
    """Outcome of one step."""

    state: FusionState
    unaided: Unaided
    threshold: float
    """Excitation threshold [-]."""
    excited: bool
    K_v: float
    """Visual gain, [-] in the form (17) and [1/s] in the form (18)."""

    @property
    def tyre_force_n(self) -> float:
        """Observed force F_hat [N]."""
        return self.unaided.force_n

    @property
    def theta_tyre(self) -> float | None:
        """theta(lambda, F_hat), see `Unaided` [-]."""
        return self.unaided.theta_tyre

    @property
    def sensitivity(self) -> float:
        """Sensitivity d mu / d theta there, see `Unaided` [-]."""
        return self.unaided.sensitivity


Outcome = tuple[FusionState, Unaided, float, bool, float]
"""What makes up a `FusionStep`."""


def settled(state: FusionState, inputs: WheelInputs, wheel: Wheel, gains: Gains) -> FusionState:
    """The state with its observed force balancing the wheel torque, to start from."""
    (size, direction), load_n = inputs.slip, inputs.load_n
    model = force(state.theta_hat, size, load_n, wheel.longitudinal_stiffness_n, direction)
    balanced = inputs.wheel_torque_nm / wheel.radius_m
    s = settled_state(model, balanced, inputs.wheel_speed_rad_s, gains.K, wheel.inertia_kg_m2, wheel.radius_m)
    return state._replace(s=s)


def unread(state: FusionState, passed_s: float, way_m: float) -> FusionState:
    """The state after a time and a way in which nothing could be read."""
    unseen_m = min(state.unseen_m + way_m, NEVER_SEEN_M)
    return state._replace(unseen_m=unseen_m, steady=faded(state.steady, passed_s))


def _unaided(
    state: FusionState,
    inputs: WheelInputs,
    look: Look,
    wheel: Wheel,
    gains: Gains,
    step_s: float,
    asked: bool,
    beside: Place | None,
) -> Unaided:
    """Observer and estimator over a step without a camera; the tyre is asked for theta where slip is high enough.

    `beside` is the place that the other estimator found in this step. A locked wheel tells nothing of its force: the
    observer is then led by the tyre model and the estimate holds.
    """
    theta_hat, s = state[0], state[1]
    omega, (size, direction), load_n = inputs[0], inputs[3], inputs[4]
    elastic, g_0, g_1, kappa = look[0]
    inertia, radius_m, C_x = wheel.inertia_kg_m2, wheel.radius_m, wheel.longitudinal_stiffness_n
    K, base, driven_n = gains.K, g_0 + g_1 * theta_hat, direction * load_n
    free = theta_hat >= 2.0 * elastic
    share = elastic if free else theta_hat * (1.0 - kappa * theta_hat)
    model_n = driven_n * (share * base)
    if not inputs[8]:
        s = settled_state(model_n, model_n, omega, K, inertia, radius_m)
        return _new(Unaided, (theta_hat, s, model_n, model_n, None, 0.0, NOTHING, None))
    force_n = observed_force(model_n, s, omega, K, inertia, radius_m)
    theta_tyre, sensitivity, place = None, 0.0, None
    theta_next, by_theta_n, theta_rate = theta_hat, 0.0, 0.0
    if asked:
        friction = force_n * direction / load_n
        steady = held(state[7], size, friction, inputs[11], inputs[9], step_s)
        if steady[3] > step_s:
            place = beside
            if place is None or not same_slip(place[0], steady):
                place = place_of_mean(steady, inputs, C_x)
            theta_tyre, sensitivity = shown(steady[1], place[1], place[2])
        else:
            theta_tyre, sensitivity = shown(friction, look[0], elastic_friction(look[1], load_n, C_x))
        if theta_tyre is not None:
            rate = gains.gamma * quickened(steady, inputs[12])
            rate *= 1.0 + gains.innovation * abs(theta_tyre - theta_hat)
            theta_next = _driven(theta_hat, rate, rate * theta_tyre, step_s)
            if theta_next != theta_hat and step_s > 0.0:
                theta_rate = (theta_next - theta_hat) / step_s
                slope = share * g_1 if free else (1.0 - 2.0 * kappa * theta_hat) * base + share * g_1
                by_theta_n = driven_n * slope
    else:
        steady = NOTHING
    s = advanced_state(s, model_n, by_theta_n, theta_rate, inputs[2], inputs[1], K, inertia, radius_m, step_s)
    return _new(Unaided, (theta_next, s, model_n, force_n, theta_tyre, sensitivity, steady, place))


def _led(
    state: FusionState,
    unaided: Unaided,
    inputs: WheelInputs,
    look: Look,
    wheel: Wheel,
    gains: Gains,
    theta_img: float | None,
    K_v: float,
    step_s: float,
) -> tuple[float, float]:
    """theta_hat and s after a step of Eq. (17) or (18) in which the camera pulls, or what tyre and camera agree on."""
    theta_hat, s = state[:2]
    _, omega_ahead, torque_nm, (_, direction), load_n = inputs[:5]
    inertia, radius_m = wheel.inertia_kg_m2, wheel.radius_m
    rate = K_v * (gains.gamma if gains.visual_term is VisualTerm.INSIDE else 1.0)
    pull = 0.0 if theta_img is None else rate * theta_img
    if unaided.theta_tyre is not None:
        by_tyre = gains.gamma * quickened(unaided.steady, inputs.noise_s)
        rate, pull = by_tyre + rate, by_tyre * unaided.theta_tyre + pull
    theta_next = _driven(theta_hat, rate, pull, step_s)
    by_theta_n = direction * load_n * sensitivity_of(theta_hat, look[0]) if theta_next != theta_hat else 0.0
    theta_rate = (theta_next - theta_hat) / step_s if step_s > 0.0 else 0.0
    return theta_next, advanced_state(
        s,
        unaided.model_n,
        by_theta_n,
        theta_rate,
        torque_nm,
        omega_ahead,
        gains.K,
        inertia,
        radius_m,
        step_s,
    )


def dynamics_step(
    state: FusionState, inputs: WheelInputs, look: Look, wheel: Wheel, gains: Gains, step_s: float
) -> Outcome:
    """One step of DE: what `fused_step` makes without a camera of a state that none has ever touched."""
    threshold = look[2]
    above = inputs[3][0] > threshold
    unaided = _unaided(state, inputs, look, wheel, gains, step_s, above, None)
    theta_next, s, _, _, theta_tyre, _, steady, _ = unaided
    shows = theta_tyre is not None
    unseen_m = 0.0
    if not shows:
        unseen_m = state[2] + inputs[7]
        if unseen_m > NEVER_SEEN_M:
            unseen_m = NEVER_SEEN_M
    after = _new(FusionState, (theta_next, s, unseen_m, None, None, 0.0, False, steady))
    return after, unaided, threshold, shows or (above and inputs[8]), 0.0


def fusion_step(*given: Any, **more: Any) -> FusionStep:
    """`fused_step` with its outcome by names; parameters as there."""
    return FusionStep(*fused_step(*given, **more))


def fused_step(
    state: FusionState,
    inputs: WheelInputs,
    look: Look,
    wheel: Wheel,
    gains: Gains,
    scheduler: FuzzyScheduler,
    theta_img: float | None,
    step_s: float,
    confidence: ConfidenceModel | None = None,
    variance: float = 0.0,
    before: FusionState | None = None,
    beside: Unaided | None = None,
) -> Outcome:
    """One step of observer and estimator.

    The tyre is excited where slip is above the fuzzy threshold. It also is where it visibly slides at a slip above
    the threshold that would stand without a picture: after a wrong class "dry" the fuzzy threshold alone would keep
    the estimator off a wet road on which the tyre shows theta (in the paper's simulation that leaves an error of
    0.07, against 0.005 so). Else theta_hat holds and the observer
    keeps running. The estimator's equation is linear in theta_hat over a step and is solved exactly, so that it is
    stable for any step size.

    Parameters
    ----------
    state, inputs, look, wheel, gains, scheduler
        State now, inputs at the start of the step, what slip and load say, and constants.
    theta_img : float or None
        Adhesion of the class that the camera gives the road under the wheel; None where epsilon = 0 [-].
    step_s : float
        Step [s].
    confidence, variance : ConfidenceModel, float
        That of the estimate: where the tyre is not seen, a class may claim `confidence.camera_share` of its distance
        from the estimate; without a model all of it.
    before, beside : FusionState and Unaided, optional
        DE's state and what it made of it on the same inputs. Where that is the same here it is taken from there; the
        outcome does not depend on it.
    """
    theta_hat, s, unseen_m, before_img, road_img, other_m, rests, steady = state
    size, way_m, threshold = inputs[3][0], inputs[7], look[2]
    above = may_show = size > threshold
    if theta_img is not None:
        if theta_img == road_img:
            other_m = 0.0
        elif road_img is not None:
            other_m = other_m + way_m if theta_img == before_img else way_m
            if other_m >= OTHER_CLASS_M:
                # Another class that stands: what the tyre showed was another road.
                road_img, other_m, rests = theta_img, 0.0, False
        before_img = theta_img
        threshold = scheduler.threshold(theta_img, inputs[4], wheel.longitudinal_stiffness_n, inputs[5])
        above = size > threshold
    unseen_m += way_m
    if unseen_m > NEVER_SEEN_M:
        unseen_m = NEVER_SEEN_M
    if before is None or beside is None:
        unaided = _unaided(state, inputs, look, wheel, gains, step_s, above or may_show, None)
    elif theta_hat != before[0] or s != before[1] or steady != before[7] or (above and not may_show):
        unaided = _unaided(state, inputs, look, wheel, gains, step_s, above or may_show, beside[7])
    else:
        unaided = beside
    theta_next, s, _, force_n, theta_tyre, _, steady, place = unaided
    K_v = 0.0
    excited = theta_tyre is not None or (above and inputs[8])
    if excited and theta_img is not None:
        by_tyre = theta_tyre
        if gains.tyre_first:
            if theta_tyre is not None:
                theta_img = _agreeing(theta_img, theta_hat, theta_tyre)
            elif rests or unseen_m < SEEN_HOLD_M or other_m > 0.0:
                theta_img = None
            else:
                by_tyre = backed_theta(theta_img, steady, place, inputs, wheel.longitudinal_stiffness_n)
                if by_tyre is not None:
                    theta_img = _agreeing(theta_img, theta_hat, by_tyre)
                else:
                    # Not less than it already carries.
                    theta_img = max(theta_img, least_theta(force_n, inputs, wheel.longitudinal_stiffness_n))
        if theta_img is not None:
            difference = abs(theta_img - theta_hat)
            if by_tyre is None and confidence is not None and gains.tyre_first:
                difference *= camera_share(confidence, variance, theta_hat)
            K_v = scheduler.K_v(difference)
        if K_v != 0.0 or by_tyre is not theta_tyre:
            led_by = unaided if by_tyre is theta_tyre else unaided._replace(theta_tyre=by_tyre)
            theta_next, s = _led(state, led_by, inputs, look, wheel, gains, theta_img, K_v, step_s)
    if theta_tyre is not None:
        unseen_m = 0.0
        road_img = before_img if road_img is None else road_img
        rests = road_img is not None
    after = _new(FusionState, (theta_next, s, unseen_m, before_img, road_img, other_m, rests, steady))
    return after, unaided, threshold, excited, K_v


def _agreeing(theta_img: float, theta_hat: float, theta_tyre: float) -> float | None:
    """What the camera may still say beside a tyre that is seen.

    None where the tyre pulls the estimate the other way; no farther off than what the tyre shows.
    """
    by_tyre, by_camera = theta_tyre - theta_hat, theta_img - theta_hat
    if by_tyre * by_camera < 0.0:
        return None
    # Of noisy samples half lie on the camera's side: without this bound their noise would be rectified.
    return theta_img if abs(by_camera) < abs(by_tyre) else theta_tyre


def _driven(theta_hat: float, rate: float, pull: float, step_s: float) -> float:
    """theta_hat one step later under theta_hat' = pull - rate theta_hat, both held over the step."""
    if rate == 0.0:
        return theta_hat
    target = pull / rate
    moved = target + (theta_hat - target) * math.exp(-rate * step_s)
    if moved < LEAST_THETA:
        return LEAST_THETA
    return moved if moved < GREATEST_THETA else GREATEST_THETA
