"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import paper as printed
from .dife import (
    GREATEST_THETA,
    NEVER_SEEN_M,
    SEEN_HOLD_M,
    FusionState,
    FusionStep,
    VisualTerm,
    Wheel,
    fusion_step,
    settled,
    unread,
)
from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Method, Rates, RoadClass, Source
from .identifiability import WheelInputs
from .paper import PrintedWheel, printed_step
from .preprocessing import LOCKED_M_S, jumped, preprocess
from .road_buffer import take_frame
from .robust import roads
from .robust.belief import WheelModel
from .robust.messages import radius_message, tyre_message
from .robust.wheel import INNOVATION, RobustState, Sample, begun, point, setup, stepped
from .sensors import (
    GREATEST_ACCELERATION_M_S2,
    LONGEST_STEP_S,
    FilteredReadings,
    Sensors,
    motion_plausible,
    unusable,
    unusable_text,
)
from .slip_calibration import SlipCalibration, calibrated
from .stationary_mean import gamma_factor, unsettled_slip
from .stiffness_mismatch import updated_mismatch
from .theta_variance import (
    Evidence,
    advanced_variance,
    drifted_variance,
    reading_noise,
    unknown_variance,
    variance_with_camera,
)
from .tyre import tyre_at_slip
from .vision.ife import Ife
from .vision.preview import Outcome, PreviewState, covering

__all__ = [
    "LOCKED_M_S",
    "Estimate",
    "EstimatorConfig",
    "EstimatorState",
    "RoadClass",
    "Sensors",
    "TrpacEstimator",
]

LEAST_LOAD = 0.05
"""Share of its static load below which a wheel's load is not taken [-]: the tyre's equations divide by it."""
LEAST_FRICTION = 1e-6
"""Used friction below which a reading says nothing of the tyre's curve, whatever the noise is said to be [-]."""
BOUNDS = 2.0
"""Standard deviations from TRPAC to the ends of the interval where it is symmetric [-]."""


class TrpacEstimator:
    """Dynamics estimator and fusion side by side on one wheel, with the camera ahead of both.

    Parameters
    ----------
    config : EstimatorConfig
        Settings.
    ife : Ife or None
        Classifies pictures; None where only classes come, or nothing.

    Notes
    -----
    Without `vertical_load_n` the load is the static one plus transfer by the acceleration; without a measured
    acceleration the speed is differentiated. The unit estimates in forward driving: rolling backwards it holds.
    """

    def __init__(self, config: EstimatorConfig, ife: Ife | None = None) -> None:
        self.config = config
        self._ife = ife
        car = config.vehicle
        self._wheel = Wheel(car.wheel_inertia_kg_m2, car.wheel_radius_m, car.longitudinal_stiffness_n)
        self._static_load_n = car.wheel_load(config.front_axle)
        self._load_by_acceleration = car.wheel_load(config.front_axle, 1.0) - self._static_load_n
        self._setback_m = 0.0 if config.front_axle else car.wheelbase_m
        self._preview = replace(config.preview, behind_m=max(config.preview.behind_m, self._setback_m))
        smoothing = config.gains.gamma * config.sensor_filter_s
        self._averaged = smoothing / (1.0 + smoothing)
        self._rates = Rates.at(config, 0.0, 0.0)
        self._least_load_n = LEAST_LOAD * self._static_load_n
        self._robust = None
        self._gains = config.gains
        if config.method is Method.ROBUST:
            self._gains = replace(config.gains, innovation=INNOVATION)
            mean_load_n = 0.5 * (car.wheel_load(True) + car.wheel_load(False))
            self._robust = setup(
                WheelModel(
                    car.longitudinal_stiffness_n, mean_load_n, car.wheel_inertia_kg_m2, car.wheel_radius_m
                ),
                car.rolling_resistance,
                config.sliding_speed_noise_m_s,
                config.confidence.torque_noise_nm,
                config.tolerance,
                config.class_theta,
            )
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        config, theta = self.config, self.config.theta_initial
        stiffness_n, start = self._wheel.longitudinal_stiffness_n, FusionState(theta, 0.0)
        variance = unknown_variance(config.confidence, theta)
        readings = FilteredReadings(0.0, 0.0, 0.0)
        self._state = EstimatorState(start, start, readings, config.tolerance.prior, variance)
        self._state.printed = self._state.printed_alone = printed.begun(theta)
        deviation = math.sqrt(variance)
        self._last = Estimate(
            TRPAC=theta,
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            excitation_threshold=config.scheduler.threshold(None, self._static_load_n, stiffness_n, 0.0),
            slip=0.0,
            tyre_force_n=0.0,
            TRPAC_image=theta,
            TRPAC_dynamics=theta,
            image_confidence=0.0,
            frame_age_s=-1.0,
            TRPAC_std=deviation,
            load_n=self._static_load_n,
            longitudinal_stiffness_n=stiffness_n,
            TRPAC_low=0.0,
            TRPAC_high=GREATEST_THETA,
            TRPAC_expected=theta,
            TRPAC_expected_std=deviation,
        )
        if self._robust is not None:
            self._state.robust = robust = begun(self._robust)
            last = _with_robust(self._last, robust, theta)
            self._last = last._replace(TRPAC_image=last.TRPAC, TRPAC_dynamics=last.TRPAC)

    @property
    def last(self) -> Estimate:
        """The estimate of the step before."""
        return self._last

    @property
    def way_m(self) -> float:
        """Way of the front wheel of this side since the start [m]."""
        return self._state.position_m

    @property
    def sees(self) -> bool:
        """Whether it can be given pictures."""
        return self._ife is not None

    def step(
        self,
        step_s: float,
        sensors: Sensors,
        frame: NDArray[np.uint8] | RoadClass | None = None,
        frame_failed: bool = False,
    ) -> Estimate:
        """One step: sensors are read at its start and go on over it as they came.

        Parameters
        ----------
        step_s : float
            Step; 0 takes in a frame and lets no time pass [s].
        sensors : Sensors
            Readings.
        frame : array of uint8, shape (height, width, 3), or RoadClass, optional
            A new picture (BGR), or a new class in its place.
        frame_failed : bool
            A new picture came and could not be read: the flag stays down until a good one comes, and on the road
            that it would have shown.

        Returns
        -------
        Estimate
            With `problem` set, where the readings were unusable: then the last good estimate with the flag down.

        Raises
        ------
        ImageError
            If the picture does not fit the camera; nothing has changed then.
        """
        config, state = self.config, self._state
        reason = unusable(step_s, sensors, self._wheel.radius_m, config.floor_m_s)
        problem = unusable_text(reason, step_s, sensors, 0.0)
        if frame is not None and isinstance(frame, RoadClass) and not 0.0 <= frame.confidence <= 1.0:
            problem = problem or f"Class confidence is {frame.confidence}; expected a number between 0 and 1."
            frame, frame_failed = None, True
        if problem is not None:
            return self._hold(step_s, sensors, frame, frame_failed, problem)
        if step_s != self._rates.step_s or step_s == 0.0:
            self._rates = Rates.at(config, step_s, state.step_s)
        if state.settled and jumped(state.readings, sensors, self._wheel.radius_m, self._rates):
            state.settled = False
        acceleration, lagged, load_n = self._moved(sensors)
        if frame is not None or frame_failed:
            take_frame(state, config, self._preview, self._ife, frame, sensors, acceleration)
        return self._advance(sensors, step_s, acceleration, lagged, load_n)

    def _moved(self, sensors: Sensors) -> tuple[float, float, float]:
        """Acceleration, lagged speed and load as they are now; at the start, and after a gap, unfiltered."""
        state, rates = self._state, self._rates
        measured, lagged = sensors.longitudinal_acceleration_m_s2, state.lagged_speed_m_s
        if not state.settled:
            acceleration, lagged = measured or 0.0, sensors.vehicle_speed_m_s
        elif measured is not None:
            acceleration = state.acceleration_m_s2 + rates.sensor_share * (measured - state.acceleration_m_s2)
        else:
            # A signal that changes more rarely than the unit steps must not be cut at its jumps: so the speed is
            # differentiated by its distance from its own filter, and only that is bounded.
            slope = (sensors.vehicle_speed_m_s - lagged) * rates.differentiator_1_s
            acceleration = min(max(slope, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
            lagged += rates.acceleration_share * (sensors.vehicle_speed_m_s - lagged)
        load_n = sensors.vertical_load_n
        if load_n is None:
            load_n = self._static_load_n + self._load_by_acceleration * acceleration
        elif state.settled:
            load_n = state.load_n + rates.sensor_share * (load_n - state.load_n)
        return acceleration, lagged, max(load_n, self._least_load_n)

    def _advance(
        self,
        sensors: Sensors,
        step_s: float,
        acceleration_m_s2: float,
        lagged_speed_m_s: float,
        load_n: float,
    ) -> Estimate:
        """Run both estimators over the step with the road that lies under the wheel at its start."""
        config, state, gains = self.config, self._state, self._gains
        wheel = self._calibrated_wheel(state.calibration)
        prepared = preprocess(config, self._rates, state, sensors, wheel.radius_m, step_s, load_n)
        inputs, fusion, dynamics = prepared.inputs, state.fusion, state.dynamics
        if not state.settled:
            fusion = settled(fusion, inputs, wheel, gains)
            dynamics = settled(dynamics, inputs, wheel, gains)
        outcome = self._under_wheel()
        flag = outcome is not None and outcome.flag and not state.frame_failed
        theta_img = config.class_theta[outcome.surface] if outcome is not None and flag else None
        alone = fusion_step(dynamics, inputs, wheel, gains, config.scheduler, None, step_s)
        fused = alone
        if config.method is Method.DIFE and (theta_img is not None or fusion != dynamics):
            fused = fusion_step(
                fusion,
                inputs,
                wheel,
                gains,
                config.scheduler,
                theta_img,
                step_s,
                config.confidence,
                state.variance,
            )
        state.since_update_s += step_s
        class_changed = fused.state.theta_img != fusion.theta_img
        if state.since_update_s >= config.sensor_filter_s or class_changed:
            if config.method is Method.DIFE:
                self._update_variance(fused, inputs, wheel, state.since_update_s)
            self._update_calibration(alone, inputs, prepared.read_slip, state.since_update_s)
            state.since_update_s = 0.0
        state.fusion, state.dynamics, state.readings = fused.state, alone.state, prepared.readings
        state.locked_s, state.lagged_slip = prepared.locked_s, prepared.lagged_slip
        state.time_s += step_s
        state.position_m += inputs.way_m
        state.speed_m_s, state.lagged_speed_m_s = sensors.vehicle_speed_m_s, lagged_speed_m_s
        state.acceleration_m_s2, state.load_n = acceleration_m_s2, load_n
        state.step_s, state.settled = step_s or state.step_s, True
        theta = fused.state.theta_hat
        variance = variance_with_camera(config.confidence, state.variance, theta, theta_img)
        image, bounds = self._image(outcome), _symmetric(theta, math.sqrt(variance))
        estimate = Estimate(
            TRPAC=theta,
            flag=flag,
            K_v=fused.K_v,
            excitation_flag=fused.excited,
            excitation_threshold=fused.threshold,
            slip=inputs.slip.size,
            tyre_force_n=fused.tyre_force_n,
            TRPAC_image=image.theta,
            TRPAC_dynamics=alone.state.theta_hat,
            image_confidence=image.Q_v,
            frame_age_s=image.age_s,
            TRPAC_std=bounds.deviation,
            load_n=load_n,
            longitudinal_stiffness_n=wheel.longitudinal_stiffness_n,
            TRPAC_low=bounds.low,
            TRPAC_high=bounds.high,
            TRPAC_expected=theta,
            TRPAC_expected_std=bounds.deviation,
        )
        if config.method is Method.AS_PRINTED:
            estimate = self._printed(estimate, sensors, theta_img, step_s)
        elif state.robust is not None and self._robust is not None:
            sample = Sample(
                sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, load_n
            )
            road_class = int(outcome.surface) if outcome is not None and flag else roads.NONE
            observed = alone.theta_tyre is not None
            state.robust = stepped(
                state.robust, self._robust, sample, road_class, step_s, inputs.way_m, observed
            )
            estimate = _with_robust(estimate, state.robust, estimate.TRPAC_dynamics)
            if estimate.excitation_flag and theta_img is not None:
                K_v = config.scheduler.K_v(abs(theta_img - estimate.TRPAC))
                estimate = estimate._replace(K_v=K_v)
        self._last = estimate._replace(source=self._source(flag, estimate.excitation_flag))
        return self._last

    def _calibrated_wheel(self, calibration: SlipCalibration) -> Wheel:
        """The wheel with the stiffness that was learnt."""
        wheel = self._wheel
        stiffness_n = wheel.longitudinal_stiffness_n / (1.0 + calibration.compliance())
        return Wheel(wheel.inertia_kg_m2, wheel.radius_m, stiffness_n)

    def _under_wheel(self) -> Outcome | None:
        """What the camera gave for the road under the wheel."""
        return covering(self._state.preview, self._preview, self._state.position_m - self._setback_m)

    def _image(self, outcome: Outcome | None) -> _Image:
        """What an estimate shows of the camera; where there is no class the last adhesion stays."""
        if outcome is None:
            return _Image(self._last.TRPAC_image, Q_v=0.0, age_s=-1.0)
        theta = self.config.class_theta[outcome.surface]
        return _Image(theta, outcome.Q_v, self._state.time_s - outcome.captured_s)

    def _source(self, flag: bool, excited: bool) -> Source:
        """What the estimate rests on; the estimator as printed remembers no road that the tyre has shown."""
        state, fusion = self._state, self._state.fusion
        if state.robust is not None:
            tyre = not state.robust.stale
        elif self.config.method is Method.AS_PRINTED:
            tyre = excited
        else:
            classes = fusion.theta_img is not None
            tyre = fusion.rests or fusion.unseen_m < (SEEN_HOLD_M if classes else NEVER_SEEN_M)
        return Source(tyre + 2 * flag)

    def _printed(
        self, estimate: Estimate, sensors: Sensors, theta_img: float | None, step_s: float
    ) -> Estimate:
        """The estimate after a step of Eqs. (12) to (19) with the camera, and beside it of the same without it."""
        state, gains, wheel = self._state, self.config.gains, self._wheel
        constants = PrintedWheel(
            wheel.inertia_kg_m2,
            wheel.radius_m,
            wheel.longitudinal_stiffness_n,
            gains.K,
            gains.gamma,
            gains.visual_term is VisualTerm.INSIDE,
            self.config.floor_m_s,
        )
        read = sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, estimate.load_n
        fused = printed_step(state.printed, constants, *read, theta_img, step_s)
        alone = printed_step(state.printed_alone, constants, *read, None, step_s)
        state.printed, state.printed_alone = fused.state, alone.state
        theta = fused.state.theta_hat
        # The paper's estimate has no deviation: that of a road of which nothing is known.
        state.variance = unknown_variance(self.config.confidence, theta)
        bounds = _symmetric(theta, math.sqrt(state.variance))
        return estimate._replace(
            TRPAC=theta,
            TRPAC_dynamics=alone.state.theta_hat,
            slip=fused.slip,
            tyre_force_n=fused.force_n,
            excitation_threshold=fused.threshold,
            excitation_flag=fused.excited,
            K_v=fused.K_v,
            TRPAC_std=bounds.deviation,
            TRPAC_low=bounds.low,
            TRPAC_high=bounds.high,
            TRPAC_expected=theta,
            TRPAC_expected_std=bounds.deviation,
        )

    def _update_variance(self, fused: FusionStep, inputs: WheelInputs, wheel: Wheel, passed_s: float) -> None:
        """Bring the variance of the fused estimate up to date after a time."""
        config, state, theta_hat = self.config, self._state, fused.state.theta_hat
        theta_tyre, mean = fused.theta_tyre, fused.dynamics.mean
        way_m = state.speed_m_s * passed_s
        before, after = state.fusion.theta_img, fused.state.theta_img
        if (
            theta_tyre is None
            and before is not None
            and after is not None
            and abs(after - theta_hat) > abs(before - theta_hat)
        ):
            # A class that is farther from the estimate than the one before: the road may be another.
            way_m += config.confidence.class_change_m
        if inputs.slip.size == 0.0 or passed_s == 0.0 or not inputs.torque_known:
            state.variance = drifted_variance(config.confidence, state.variance, theta_hat, way_m)
            state.lag = 0.0
            return
        speed_m_s = max(state.speed_m_s, config.floor_m_s)
        slip, friction = inputs.slip.size, inputs.friction(fused.tyre_force_n)
        if mean.duration_s > state.step_s:
            slip, friction = mean.slip, mean.friction
        tyre = tyre_at_slip(slip, inputs.load_n, wheel.longitudinal_stiffness_n)
        noise_share = (self._rates.noise_m_s / speed_m_s + inputs.slip_change) / slip
        torque_noise_nm = self._rates.noise_gain * config.confidence.torque_noise_nm
        torque_friction, mismatch = torque_noise_nm / (wheel.radius_m * inputs.load_n), 0.0
        if theta_tyre is not None and friction > max(torque_friction, LEAST_FRICTION):
            noise = reading_noise(friction, tyre, noise_share, torque_friction)
            state.mismatch = updated_mismatch(state.mismatch, tyre.adhering, theta_tyre, noise, passed_s)
            mismatch = state.mismatch.share()
        line_share = math.sqrt(state.calibration.slip_variance(slip, speed_m_s)) / slip
        state.variance, state.lag = advanced_variance(
            config.confidence,
            state.variance,
            state.lag,
            theta_hat,
            Evidence(theta_tyre, friction, tyre, line_share, noise_share, torque_friction, mismatch),
            self._averaged,
            config.gains.gamma * gamma_factor(mean, inputs.noise_s),
            way_m,
            passed_s,
        )

    def _update_calibration(
        self, alone: FusionStep, inputs: WheelInputs, read_slip: float, passed_s: float
    ) -> None:
        """Bring the calibration up to date with the slip that is read now."""
        config, state, speed_m_s = self.config, self._state, self._state.speed_m_s
        state.calibration = state.calibration.drifted(config.tolerance, passed_s)
        if not (state.settled and inputs.torque_known and speed_m_s > config.floor_m_s):
            return
        noise = self._rates.noise_m_s / speed_m_s
        state.unsettled_slip = unsettled_slip(state.unsettled_slip, inputs.slip_change, noise, passed_s)
        state.calibration = calibrated(
            state.calibration,
            config.tolerance,
            read_slip,
            speed_m_s,
            alone.tyre_force_n,
            inputs.load_n,
            self._wheel.longitudinal_stiffness_n,
            noise,
            state.unsettled_slip,
        )

    def _hold(
        self,
        step_s: float,
        sensors: Sensors,
        frame: NDArray[np.uint8] | RoadClass | None,
        frame_failed: bool,
        problem: str,
    ) -> Estimate:
        """Keep the last good estimate through unusable readings, while the road goes on under the wheel.

        A speed that can be read counts, else the last good one; a picture that came is not lost.
        """
        state = self._state
        passed_s = step_s if 0.0 < step_s <= LONGEST_STEP_S else 0.0
        if step_s > LONGEST_STEP_S:
            # The car may be anywhere: what was seen ahead is not under the wheel.
            state.preview, state.ife = PreviewState(), state.ife.elsewhere()
        if motion_plausible(sensors):
            if frame is not None or frame_failed:
                acceleration = state.acceleration_m_s2
                take_frame(state, self.config, self._preview, self._ife, frame, sensors, acceleration)
            state.speed_m_s = sensors.vehicle_speed_m_s
        way_m = state.speed_m_s * passed_s
        state.time_s += passed_s
        state.position_m += way_m
        theta, model = state.fusion.theta_hat, self.config.confidence
        state.variance = drifted_variance(model, state.variance, theta, way_m)
        state.fusion = unread(state.fusion, passed_s, way_m)
        state.dynamics = unread(state.dynamics, passed_s, way_m)
        if step_s > LONGEST_STEP_S:
            state.variance = unknown_variance(model, theta)
            state.fusion = FusionState(theta, state.fusion.s)
            state.dynamics = FusionState(state.dynamics.theta_hat, state.dynamics.s)
        state.lag, state.settled = 0.0, False
        if state.robust is not None and self._robust is not None:
            state.robust = (
                begun(self._robust)
                if step_s > LONGEST_STEP_S
                else stepped(state.robust, self._robust, None, roads.NONE, passed_s, way_m, False)
            )
        image, theta = self._image(self._under_wheel()), self._last.TRPAC
        bounds = _symmetric(theta, math.sqrt(state.variance))
        held = self._last._replace(
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            TRPAC_image=image.theta,
            image_confidence=image.Q_v,
            frame_age_s=image.age_s,
            TRPAC_std=bounds.deviation,
            TRPAC_low=bounds.low,
            TRPAC_high=bounds.high,
            TRPAC_expected_std=bounds.deviation,
            source=self._source(False, False),
            problem=problem,
        )
        if state.robust is not None:
            interval = state.robust.said
            held = held._replace(
                TRPAC_std=math.hypot(interval.std, interval.mean - theta),
                TRPAC_low=min(interval.low, theta),
                TRPAC_high=max(interval.high, theta),
                TRPAC_expected=interval.mean,
                TRPAC_expected_std=interval.std,
            )
        self._last = held
        return held

    def messages(self) -> dict[str, str]:
        """Sentences on what the drive shows of a car that is not as told, by what they concern; robust method only."""
        state, known = self._state.robust, self._robust
        if state is None or known is None:
            return {}
        axle = "Front" if self.config.front_axle else "Rear"
        texts = {
            f"{axle} tyres": tyre_message(state, known, axle, self._static_load_n),
            f"{axle} wheels": radius_message(state, known, axle),
        }
        return {about: text for about, text in texts.items() if text is not None}

    def state(self) -> dict[str, Any]:
        """All that is remembered as JSON-able values; floats survive the round trip bit by bit."""
        return {"state": self._state.to_json(), "last": self._last._asdict()}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Go back to what `state` gave."""
        self._state = EstimatorState.from_json(data["state"])
        self._last = Estimate(**{**data["last"], "source": Source(data["last"]["source"])})


class _Image(NamedTuple):
    """What an estimate shows of the camera."""

    theta: float
    Q_v: float
    age_s: float


class _Bounds(NamedTuple):
    """Standard deviation of an estimate, and its interval."""

    deviation: float
    low: float
    high: float


def _symmetric(theta: float, deviation: float) -> _Bounds:
    """The interval about an estimate that is symmetric but for the bounds of theta [-]."""
    low, high = theta - BOUNDS * deviation, theta + BOUNDS * deviation
    return _Bounds(deviation, max(low, 0.0), min(high, GREATEST_THETA))


def _with_robust(estimate: Estimate, state: RobustState, observer: float) -> Estimate:
    """The estimate of the robust method, by the observer's theta_hat [-]."""
    theta, deviation = point(state, observer)
    interval = state.said
    return estimate._replace(
        TRPAC=theta,
        TRPAC_std=deviation,
        TRPAC_low=interval.low,
        TRPAC_high=interval.high,
        TRPAC_expected=interval.mean,
        TRPAC_expected_std=interval.std,
    )
