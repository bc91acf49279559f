"""The estimator of one wheel as functions of records: set-up, start, and a step with a class of the road ahead.

`TrpacEstimator` adds pictures and sentences to them; the native unit is made of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from . import paper
from .dife import FusionState, VisualTerm, Wheel, fusion_step, settled, visual_gain
from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Method, Rates, RoadClass, Source
from .paper import PrintedWheel, printed_step
from .preprocessing import jumped, preprocess
from .robust import roads, wheel
from .robust.belief import WheelModel
from .robust.wheel import RobustSetup, Sample, claim, point
from .sensors import (
    GREATEST_ACCELERATION_M_S2,
    LONGEST_STEP_S,
    FilteredReadings,
    Sensors,
    Unusable,
    motion_plausible,
    unusable,
)
from .stationary_mean import NO_MEAN
from .tyre import onset_slip
from .vision.preview import (
    Outcome,
    PreviewConfig,
    PreviewState,
    add_frame,
    covering,
    index_of,
    outcome_at,
    prune,
)

LEAST_LOAD = 0.05
"""Share of its static load below which a wheel's load is not taken [-]: the tyre's equations divide by it."""


@dataclass(frozen=True)
class WheelSetup:
    """Constants of a wheel under the settings.

    Attributes
    ----------
    wheel : Wheel
        Its constants.
    static_load_n, load_by_acceleration : float
        Load at rest [N], and its increase per acceleration [kg].
    setback_m : float
        How far it is behind the front axle [m].
    preview : PreviewConfig
        Settings of the stamps.
    robust : RobustSetup
        Set-up of the belief.
    """

    wheel: Wheel
    static_load_n: float
    load_by_acceleration: float
    setback_m: float
    preview: PreviewConfig
    robust: RobustSetup


def wheel_setup(config: EstimatorConfig) -> WheelSetup:
    """The set-up of a wheel under these settings."""
    car = config.vehicle
    static_load_n = car.wheel_load(config.front_axle)
    setback_m = 0.0 if config.front_axle else car.wheelbase_m
    mean_load_n = 0.5 * (car.wheel_load(True) + car.wheel_load(False))
    return WheelSetup(
        Wheel(car.wheel_inertia_kg_m2, car.wheel_radius_m, car.longitudinal_stiffness_n),
        static_load_n,
        car.wheel_load(config.front_axle, 1.0) - static_load_n,
        setback_m,
        replace(config.preview, behind_m=max(config.preview.behind_m, setback_m)),
        wheel.setup(
            WheelModel(
                car.longitudinal_stiffness_n, mean_load_n, car.wheel_inertia_kg_m2, car.wheel_radius_m
            ),
            car.rolling_resistance,
            config.sliding_speed_noise_m_s,
            config.torque_noise_nm,
            config.tolerance,
            config.class_theta,
        ),
    )


def first_state(config: EstimatorConfig, known: WheelSetup) -> EstimatorState:
    """The state before the first step."""
    start, printed = FusionState(config.theta_initial, 0.0), paper.begun(config.theta_initial)
    return EstimatorState(
        start, start, FilteredReadings(0.0, 0.0, 0.0), wheel.begun(known.robust), printed, printed
    )


def first_estimate(config: EstimatorConfig, known: WheelSetup, state: EstimatorState) -> Estimate:
    """The estimate before the first step."""
    load_n, C_x, said = known.static_load_n, known.wheel.longitudinal_stiffness_n, state.robust.said
    theta = _point(config, state, config.theta_initial, config.theta_initial)
    of_belief = claim(said, theta)
    return Estimate(
        TRPAC=theta,
        flag=False,
        K_v=0.0,
        excitation_flag=False,
        excitation_threshold=onset_slip(state.robust.onset_theta, load_n, C_x, sensitivity=0.0),
        slip=0.0,
        tyre_force_n=0.0,
        TRPAC_image=config.theta_initial,
        TRPAC_dynamics=config.theta_initial,
        image_confidence=0.0,
        frame_age_s=-1.0,
        TRPAC_std=of_belief.deviation,
        load_n=load_n,
        longitudinal_stiffness_n=C_x,
        TRPAC_low=of_belief.low,
        TRPAC_high=of_belief.high,
        TRPAC_expected=said.mean,
        TRPAC_expected_std=said.std,
        source=Source.NONE,
    )


def outcome_of(config: EstimatorConfig, road_class: RoadClass, time_s: float) -> Outcome:
    """A class by bus as a camera result, at a time [s]."""
    flag = road_class.confidence > config.vision.flag_threshold
    return Outcome(road_class.surface, road_class.confidence, flag, time_s)


def unusable_input(
    config: EstimatorConfig, step_s: float, sensors: Sensors, road_class: RoadClass | None
) -> Unusable:
    """The reason why readings, or a class by bus, are unusable."""
    reason = unusable(step_s, sensors, config.vehicle.wheel_radius_m, config.floor_m_s)
    if reason is Unusable.NOTHING and road_class is not None and not 0.0 <= road_class.confidence <= 1.0:
        return Unusable.CONFIDENCE
    return reason


def rates_of(rates: Rates, config: EstimatorConfig, step_s: float, before_s: float) -> Rates:
    """Values that depend on the step size: those of the step before, if it was as long."""
    return Rates.at(config, step_s, before_s) if step_s != rates.step_s or step_s == 0.0 else rates


class Moved(NamedTuple):
    """Acceleration, lagged speed and load of the car now."""

    acceleration_m_s2: float
    lagged_speed_m_s: float
    load_n: float
    settled: bool
    """Whether the filters went on; not so at the start, and after a gap or a jump of the readings."""


def moved(state: EstimatorState, known: WheelSetup, rates: Rates, sensors: Sensors) -> Moved:
    """Acceleration, lagged speed and load as they are now; at the start, and after a gap, unfiltered."""
    measured, lagged = sensors.longitudinal_acceleration_m_s2, state.lagged_speed_m_s
    settled_now = state.settled and not jumped(state.readings, sensors, known.wheel.radius_m, rates)
    if not settled_now:
        acceleration, lagged = measured or 0.0, sensors.vehicle_speed_m_s
    elif measured is not None:
        acceleration = state.acceleration_m_s2 + rates.sensor_share * (measured - state.acceleration_m_s2)
    else:
        # A signal that changes more rarely than the unit steps must not be cut at its jumps: so the speed is
        # differentiated by its distance from its own filter, and only that is bounded.
        slope = (sensors.vehicle_speed_m_s - lagged) * rates.differentiator_1_s
        acceleration = min(max(slope, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
        lagged += rates.acceleration_share * (sensors.vehicle_speed_m_s - lagged)
    measured_n = sensors.vertical_load_n
    if measured_n is None:
        load_n = known.static_load_n + known.load_by_acceleration * acceleration
    elif settled_now:
        load_n = state.load_n + rates.sensor_share * (measured_n - state.load_n)
    else:
        load_n = measured_n
    return Moved(acceleration, lagged, max(load_n, LEAST_LOAD * known.static_load_n), settled_now)


def stamp(
    state: EstimatorState,
    config: EstimatorConfig,
    known: WheelSetup,
    seen: Outcome | None,
    speed_m_s: float,
) -> None:
    """Stamp a frame's verdict onto the road ahead; a frame that failed, None, ends the validity of the last one."""
    state.frame_failed = seen is None
    said = seen
    if said is None:
        if state.preview.count == 0:
            return
        newest = outcome_at(state.preview, index_of(state.preview, state.preview.count - 1))
        said = Outcome(newest.surface, Q_v=0.0, flag=False, captured_s=state.time_s)
    prune(state.preview, known.preview, state.position_m)
    add_frame(
        state.preview,
        known.preview,
        said,
        position_m=state.position_m,
        speed_m_s=speed_m_s,
        frame_interval_s=1.0 / config.vision.camera.fps,
    )


class Frame(NamedTuple):
    """Result of the camera in a step."""

    came: bool
    """Whether it gave anything."""
    seen: Outcome | None
    """Its verdict; None where it failed."""


def stepped(
    state: EstimatorState,
    last: Estimate,
    config: EstimatorConfig,
    known: WheelSetup,
    rates: Rates,
    sensors: Sensors,
    frame: Frame,
    step_s: float,
) -> Estimate:
    """The estimate of a step with usable readings; the state is brought up to date.

    Parameters
    ----------
    state, last, config, known
        State and estimate before the step; settings and what they make of the wheel.
    rates : Rates
        Of this step's size.
    sensors, frame
        Readings at the start of the step, and what the camera gave.
    step_s : float
        Step [s].
    """
    now = moved(state, known, rates, sensors)
    state.settled = now.settled
    if frame.came:
        stamp(state, config, known, frame.seen, sensors.vehicle_speed_m_s)
    outcome = _under_wheel(state, known)
    flag = outcome is not None and outcome.flag and not state.frame_failed
    theta_img = config.class_theta[outcome.surface] if outcome is not None and flag else None
    prepared = preprocess(config, rates, state, sensors, step_s, now.load_n)
    way_m = sensors.vehicle_speed_m_s * step_s
    if config.method is Method.AS_PRINTED:
        step = _printed(state, config, known, sensors, now.load_n, theta_img, step_s)
    else:
        inputs, gains, fusion, dynamics = prepared.inputs, config.gains, state.fusion, state.dynamics
        if not state.settled:
            fusion = settled(fusion, inputs, known.wheel, gains)
            dynamics = settled(dynamics, inputs, known.wheel, gains)
        onset_theta = state.robust.onset_theta
        fused = alone = fusion_step(dynamics, inputs, known.wheel, gains, None, onset_theta, step_s)
        # A class has the same value on all its roads: beside a tyre that has shown this road it adds no information.
        unseen_img = theta_img if state.robust.stale else None
        if unseen_img is not None or fusion != dynamics:
            fused = fusion_step(fusion, inputs, known.wheel, gains, unseen_img, onset_theta, step_s)
        state.fusion, state.dynamics = fused.state, alone.state
        sample = Sample(
            sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, now.load_n
        )
        road_class = int(outcome.surface) if outcome is not None and flag else roads.NONE
        shown = alone.theta_tyre is not None
        state.robust = wheel.stepped(state.robust, known.robust, sample, road_class, step_s, way_m, shown)
        step = MethodStep(
            _point(config, state, fused.state.theta_hat, alone.state.theta_hat),
            alone.state.theta_hat,
            inputs.slip.size,
            fused.tyre_force_n,
            fused.threshold,
            fused.excited,
            fused.K_v,
        )
        if config.method is Method.ROBUST and fused.excited and theta_img is not None:
            step = step._replace(K_v=visual_gain(gains, theta_img, step.theta))
    state.readings, state.lagged_slip = prepared.readings, prepared.lagged_slip
    state.locked_s = prepared.locked_s
    state.time_s += step_s
    state.position_m += way_m
    state.speed_m_s, state.lagged_speed_m_s = sensors.vehicle_speed_m_s, now.lagged_speed_m_s
    state.acceleration_m_s2, state.load_n = now.acceleration_m_s2, now.load_n
    state.step_s, state.settled = step_s or state.step_s, True
    image, said = _image(state, last, config, outcome), state.robust.said
    of_belief = claim(said, step.theta)
    return Estimate(
        TRPAC=step.theta,
        flag=flag,
        K_v=step.K_v,
        excitation_flag=step.excited,
        excitation_threshold=step.threshold,
        slip=step.slip,
        tyre_force_n=step.tyre_force_n,
        TRPAC_image=image.theta,
        TRPAC_dynamics=step.theta_alone,
        image_confidence=image.Q_v,
        frame_age_s=image.age_s,
        TRPAC_std=of_belief.deviation,
        load_n=now.load_n,
        longitudinal_stiffness_n=known.wheel.longitudinal_stiffness_n,
        TRPAC_low=of_belief.low,
        TRPAC_high=of_belief.high,
        TRPAC_expected=said.mean,
        TRPAC_expected_std=said.std,
        source=_source(config, state, flag, step.excited),
    )


def held(
    state: EstimatorState,
    last: Estimate,
    config: EstimatorConfig,
    known: WheelSetup,
    sensors: Sensors,
    frame: Frame,
    step_s: float,
) -> Estimate:
    """The last good estimate through a step with unusable readings, while the road goes on under the wheel.

    A speed that can be read counts, else the last good one; a frame that came is not lost. Parameters as in `stepped`.
    """
    passed_s = step_s if 0.0 < step_s <= LONGEST_STEP_S else 0.0
    if step_s > LONGEST_STEP_S:
        # The car may be anywhere: what was seen ahead is not under the wheel.
        state.preview = PreviewState()
    if motion_plausible(sensors):
        if frame.came:
            stamp(state, config, known, frame.seen, sensors.vehicle_speed_m_s)
        state.speed_m_s = sensors.vehicle_speed_m_s
    way_m = state.speed_m_s * passed_s
    state.time_s += passed_s
    state.position_m += way_m
    state.settled = False
    state.fusion = state.fusion._replace(mean=NO_MEAN)
    state.dynamics = state.dynamics._replace(mean=NO_MEAN)
    if step_s > LONGEST_STEP_S:
        state.robust = wheel.begun(known.robust)
    elif config.method is not Method.AS_PRINTED:
        state.robust = wheel.stepped(state.robust, known.robust, None, roads.NONE, passed_s, way_m, False)
    image = _image(state, last, config, _under_wheel(state, known))
    said, of_belief = state.robust.said, claim(state.robust.said, last.TRPAC)
    return last._replace(
        flag=False,
        K_v=0.0,
        excitation_flag=False,
        TRPAC_image=image.theta,
        image_confidence=image.Q_v,
        frame_age_s=image.age_s,
        TRPAC_std=of_belief.deviation,
        TRPAC_low=of_belief.low,
        TRPAC_high=of_belief.high,
        TRPAC_expected=said.mean,
        TRPAC_expected_std=said.std,
        source=_source(config, state, False, False),
    )


class MethodStep(NamedTuple):
    """What a method makes of a step; as in `Estimate`."""

    theta: float
    theta_alone: float
    slip: float
    tyre_force_n: float
    threshold: float
    excited: bool
    K_v: float


def _printed(
    state: EstimatorState,
    config: EstimatorConfig,
    known: WheelSetup,
    sensors: Sensors,
    load_n: float,
    theta_img: float | None,
    step_s: float,
) -> MethodStep:
    """A step of Eqs. (12) to (19) with the camera, and beside it of the same without it."""
    gains = config.gains
    constants = PrintedWheel(
        known.wheel.inertia_kg_m2,
        known.wheel.radius_m,
        known.wheel.longitudinal_stiffness_n,
        gains.K,
        gains.gamma,
        gains.visual_term is VisualTerm.INSIDE,
        config.floor_m_s,
    )
    omega, torque_nm, speed_m_s = (
        sensors.wheel_speed_rad_s,
        sensors.wheel_torque_nm,
        sensors.vehicle_speed_m_s,
    )
    fused = printed_step(state.printed, constants, omega, torque_nm, speed_m_s, load_n, theta_img, step_s)
    alone = printed_step(state.printed_alone, constants, omega, torque_nm, speed_m_s, load_n, None, step_s)
    state.printed, state.printed_alone = fused.state, alone.state
    return MethodStep(
        fused.state.theta_hat,
        alone.state.theta_hat,
        fused.slip,
        fused.force_n,
        fused.threshold,
        fused.excited,
        fused.K_v,
    )


def _point(config: EstimatorConfig, state: EstimatorState, fused: float, observer: float) -> float:
    """TRPAC of the method, with the estimates with and without the camera [-]."""
    return point(state.robust, observer) if config.method is Method.ROBUST else fused


def _under_wheel(state: EstimatorState, known: WheelSetup) -> Outcome | None:
    """Result of the camera for the road under the wheel."""
    return covering(state.preview, known.preview, state.position_m - known.setback_m)


class ImageShown(NamedTuple):
    """Camera outputs of an estimate."""

    theta: float
    Q_v: float
    age_s: float


def _image(
    state: EstimatorState, last: Estimate, config: EstimatorConfig, outcome: Outcome | None
) -> ImageShown:
    """Camera outputs of an estimate; without a class the last adhesion stays."""
    if outcome is None:
        return ImageShown(last.TRPAC_image, Q_v=0.0, age_s=-1.0)
    theta = config.class_theta[outcome.surface]
    return ImageShown(theta, outcome.Q_v, state.time_s - outcome.captured_s)


def _source(config: EstimatorConfig, state: EstimatorState, flag: bool, excited: bool) -> Source:
    """The source of the estimate; the method as printed does not remember that the tyre has shown this road."""
    tyre = excited if config.method is Method.AS_PRINTED else not state.robust.stale
    return Source(tyre + 2 * flag)
