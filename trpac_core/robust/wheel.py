"""The robust estimator of one wheel: readings in blocks, the belief about road and tyre, the point value.

The point value is the observer's, Eqs. (14) to (16), within the belief's bounds, on a road that the observer has read;
before, and where the camera has found another road since, it is the mean of the belief.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from ..vehicle import CarTolerance
from .belief import (
    FIRST,
    Belief,
    Hypotheses,
    WheelModel,
    as_told,
    driven,
    mean_offset,
    onset_theta,
    read,
    shows,
    told_formula,
    unread,
)
from .blocks import BLOCK_S, Filling, Means, Noise, heard, means_of, reading
from .interval import Interval, interval
from .roads import STOOD_M, THETA, ClassUnderWheel, PerCell, Priors, advanced, prior_of, priors
from .tyres import TOLD

BELIEVED = 0.2
"""Probability of the described formula from which the tyre is taken to be as described [-]."""
LEAST_TOLERANCE = 1e-4
"""Smallest tolerance of radius and stiffness that is used: the filter divides by it [-]."""
LEAST_USED_SHARE = 0.1
"""Share of TRPAC below which the used friction does not distinguish the tyres [-]."""
OFFSET_DEVIATIONS = 2.0
"""Stated standard deviations beyond which the slip offset contradicts the description [-]."""
SCALE_DEVIATION = 0.04
"""Standard deviation of TRPAC by mass, torque and load, as a share of it [-]."""


@dataclass(frozen=True)
class RobustSetup:
    """Constants of the robust estimator of a wheel.

    Attributes
    ----------
    theta : array, shape (cells,)
        Friction of the cells [-].
    known : Priors
        By the camera's class.
    tyres : Hypotheses
        Hypotheses about the tyre.
    wheel : WheelModel
        Description of the wheel.
    rolling_resistance : float
        [-].
    wheel_noise, speed_noise : float
        Least variance of a sample of wheel speed [rad^2/s^2] and of vehicle speed [m^2/s^2].
    torque_noise_nm : float
        Standard deviation of a sample of the torque [N m].
    speed_bias_m_s : float
        Standard deviation of a constant error of the sliding speed [m/s].
    """

    theta: PerCell
    known: Priors
    tyres: Hypotheses
    wheel: WheelModel
    rolling_resistance: float
    wheel_noise: float
    speed_noise: float
    torque_noise_nm: float
    speed_bias_m_s: float


def setup(
    wheel: WheelModel,
    rolling_resistance: float,
    sliding_speed_noise_m_s: float,
    torque_noise_nm: float,
    tolerance: CarTolerance,
    class_theta: tuple[float, float, float],
) -> RobustSetup:
    """The set-up of a wheel; the stated noise of the sliding speed [m/s] is shared evenly by its two sensors."""
    half = 0.5 * sliding_speed_noise_m_s * sliding_speed_noise_m_s
    return RobustSetup(
        THETA,
        priors(THETA, class_theta),
        as_told(FIRST, max(tolerance.ratio, LEAST_TOLERANCE), max(tolerance.compliance, LEAST_TOLERANCE)),
        wheel,
        rolling_resistance,
        half / (wheel.radius_m * wheel.radius_m),
        half,
        torque_noise_nm,
        tolerance.speed_bias_m_s,
    )


class RobustState(NamedTuple):
    """State of the robust estimator.

    Attributes
    ----------
    belief : Belief
        About road and tyre.
    said : Interval
        Interval of the road friction.
    memory : ClassUnderWheel
        Classes of the camera so far.
    filling, before : Filling, Means or None
        The block that fills, and the one before it.
    friction : float
        Used friction that was read last, 0 before any [-].
    onset_theta : float
        Friction that the road has at most with the probability `belief.SLIDES`, if the tyre is as described [-].
    slowness_s_m : float
        One over the speed of the last reading, 0 before any [s/m].
    way_m : float
        Distance since the last block was full [m].
    wheel_noise, speed_noise : Noise
        Of the readings.
    unread_m : float
        Distance since the observer last read the road [m].
    stale : bool
        Whether the camera has since found another road.
    doubted_s, offset_s : float
        Time of readings for which the described formula, and the stated radius, have been improbable [s].
    """

    belief: Belief
    said: Interval
    memory: ClassUnderWheel
    filling: Filling
    before: Means | None
    friction: float
    onset_theta: float
    slowness_s_m: float
    way_m: float
    wheel_noise: Noise
    speed_noise: Noise
    unread_m: float
    stale: bool
    doubted_s: float = 0.0
    offset_s: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """The state as JSON-able values, exact."""
        values = self._asdict()
        values["belief"] = {f.name: getattr(self.belief, f.name).tolist() for f in fields(Belief)}
        return values

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> RobustState:
        """The state that `to_json` wrote."""
        before = data["before"]
        return cls(
            Belief(**{name: np.array(values) for name, values in data["belief"].items()}),
            Interval(*data["said"]),
            ClassUnderWheel(*data["memory"]),
            Filling(*data["filling"]),
            None if before is None else Means(*before),
            data["friction"],
            data["onset_theta"],
            data["slowness_s_m"],
            data["way_m"],
            Noise(*data["wheel_noise"]),
            Noise(*data["speed_noise"]),
            data["unread_m"],
            data["stale"],
            data["doubted_s"],
            data["offset_s"],
        )


def begun(known: RobustSetup) -> RobustState:
    """The state before anything was read."""
    belief = unread(known.tyres, known.known.none)
    return RobustState(
        belief,
        interval(belief, known.theta),
        ClassUnderWheel(),
        Filling(),
        None,
        0.0,
        onset_theta(belief, known.theta),
        0.0,
        0.0,
        Noise(known.wheel_noise),
        Noise(known.speed_noise),
        unread_m=0.0,
        stale=True,
    )


class Sample(NamedTuple):
    """Readings of a step."""

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float
    load_n: float


def stepped(
    state: RobustState,
    known: RobustSetup,
    sample: Sample | None,
    given: int,
    step_s: float,
    way_m: float,
    observed: bool,
) -> RobustState:
    """The state after a step.

    Parameters
    ----------
    state, known
        Before, and the set-up.
    sample : Sample or None
        Readings; None where they are unusable.
    given : int
        Class that the camera gives the road under the wheel, or `roads.NONE`.
    step_s, way_m : float
        Step [s] and distance over it [m].
    observed : bool
        Whether the observer reads the road in this step.
    """
    unread_m, stale = (0.0, False) if observed else (state.unread_m + way_m, state.stale)
    way_m += state.way_m
    if sample is None:
        # What the block had is dropped: its means would count the lost time as standstill.
        state = state._replace(way_m=way_m, unread_m=unread_m, stale=stale)
        return _on_road(state, known, None, given, state.filling.duration_s + step_s)
    wheel_noise, speed_noise = state.wheel_noise, state.speed_noise
    new = wheel_noise.values == 0 or sample.wheel_speed_rad_s != wheel_noise.before
    wheel_noise = heard(wheel_noise, sample.wheel_speed_rad_s, step_s, known.wheel_noise)
    speed_noise = heard(speed_noise, sample.vehicle_speed_m_s, step_s, known.speed_noise)
    old = state.filling
    filling = Filling(
        old.wheel_speed + step_s * sample.wheel_speed_rad_s,
        old.wheel_torque + step_s * sample.wheel_torque_nm,
        old.vehicle_speed + step_s * sample.vehicle_speed_m_s,
        old.load + step_s * sample.load_n,
        old.duration_s + step_s,
        old.samples + new,
    )
    state = state._replace(
        filling=filling,
        way_m=way_m,
        wheel_noise=wheel_noise,
        speed_noise=speed_noise,
        unread_m=unread_m,
        stale=stale,
    )
    if filling.duration_s < BLOCK_S:
        return state
    return _on_road(state, known, means_of(filling), given, filling.duration_s)


def _on_road(
    state: RobustState,
    known: RobustSetup,
    means: Means | None,
    given: int,
    duration_s: float,
) -> RobustState:
    """The state after a block, with its means where it has any."""
    memory, changed, stood = advanced(state.memory, given, state.way_m)
    now, friction, slowness, slip_drift = None, 0.0, state.slowness_s_m, 0.0
    if means is not None and state.before is not None:
        wheel = known.wheel
        now = reading(
            state.before,
            means,
            state.friction,
            wheel.inertia_kg_m2,
            wheel.radius_m,
            known.rolling_resistance,
        )
        friction = now.friction
        if shows(now):
            # A constant error of the speed is another slip at another speed.
            slowness = 1.0 / now.speed_m_s
            slip_drift = (
                known.speed_bias_m_s
                * known.speed_bias_m_s
                * abs(slowness - state.slowness_s_m)
                * max(slowness, state.slowness_s_m)
            )
        else:
            now = None
    belief = driven(
        state.belief, known.tyres, prior_of(memory, given, known.known), changed, duration_s, slip_drift
    )
    if now is not None:
        belief = read(
            belief,
            known.tyres,
            known.theta,
            now,
            known.wheel,
            state.wheel_noise.variance,
            state.speed_noise.variance,
            known.torque_noise_nm,
        )
    said = interval(belief, known.theta)
    doubted_s, offset_s = state.doubted_s, state.offset_s
    if now is not None:
        if told_formula(belief) >= BELIEVED:
            doubted_s = 0.0
        elif abs(friction) > LEAST_USED_SHARE * said.mean:
            doubted_s += duration_s
        offset_s = offset_s + duration_s if _offset_is_strange(belief, known, slowness) else 0.0
    return state._replace(
        belief=belief,
        said=said,
        memory=memory,
        filling=Filling(),
        before=means,
        friction=friction,
        onset_theta=onset_theta(belief, known.theta),
        slowness_s_m=slowness,
        way_m=0.0,
        # What the observer reads on the class's own road is not undone by it.
        stale=state.stale or (stood and state.unread_m > STOOD_M),
        doubted_s=doubted_s,
        offset_s=offset_s,
    )


def _offset_is_strange(belief: Belief, known: RobustSetup, slowness_s_m: float) -> bool:
    """Whether the slip offset lies beyond the stated tolerances of radius and speed."""
    by_speed, offset = known.speed_bias_m_s * slowness_s_m, mean_offset(belief)
    told = known.tyres.offset_variance[TOLD, 0] + by_speed * by_speed
    return bool(offset * offset > OFFSET_DEVIATIONS * OFFSET_DEVIATIONS * told)


def point(state: RobustState, observer: float) -> float:
    """TRPAC, with the observer's theta_hat [-]: the belief's mean until the tyre has shown this road."""
    said = state.said
    return said.mean if state.stale else min(max(observer, said.clip), said.unmoved_high)


class Claim(NamedTuple):
    """Standard deviation and bounds of an estimate under the belief [-]."""

    deviation: float
    low: float
    high: float


def claim(said: Interval, theta: float) -> Claim:
    """Standard deviation of an estimate under the belief, and the interval, which holds the estimate."""
    off, scale = said.mean - theta, SCALE_DEVIATION * said.mean
    deviation = math.sqrt(said.std * said.std + off * off + scale * scale)
    return Claim(deviation, min(said.low, theta), max(said.high, theta))
