"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import paper as printed
from .dife import (
    GREATEST_THETA,
    NEVER_SEEN_M,
    SEEN_HOLD_M,
    FusionState,
    Outcome,
    VisualTerm,
    Wheel,
    dynamics_step,
    fused_step,
    settled,
    unread,
)
from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Method, Rates, RoadClass, Source
from .identifiability import Look, WheelInputs, look_at
from .paper import PrintedStep, PrintedWheel, printed_step
from .preprocessing import LOCKED_M_S, jumped, wheel_inputs
from .road_buffer import RoadUnderWheel, take_frame
from .robust import roads
from .robust.belief import WheelModel
from .robust.messages import radius_message, tyre_message
from .robust.wheel import INNOVATION, Sample, begun, point, setup, stepped
from .sensors import (
    GREATEST_ACCELERATION_M_S2,
    LONGEST_STEP_S,
    MOTION,
    Sensors,
    implausible,
    plain,
    unusable,
)
from .slip_calibration import ElasticLine, learned
from .stationary_mean import quickened, unsettled
from .stiffness_mismatch import followed
from .theta_variance import (
    Evidence,
    advanced_variance,
    reading_noise,
    unknown_variance,
    wandered,
    with_camera,
)
from .tyre import TyreAtSlip, cubic_at_slip
from .vision.ife import Ife
from .vision.preview import PreviewState

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
_LEAST_FRICTION = 1e-6
"""Used friction below which a reading says nothing of the tyre's curve, whatever the noise is said to be [-]."""
BOUNDS = 2.0
"""Standard deviations from TRPAC to the ends of the interval where it is symmetric [-]."""
_SOURCES = tuple(Source)
_new = tuple.__new__


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
        self._radius_m, self._least_load_n = car.wheel_radius_m, LEAST_LOAD * self._static_load_n
        self._road = RoadUnderWheel(self._preview)
        self._softened_by: tuple[ElasticLine | None, Wheel] = (None, self._wheel)
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
                config.elastic,
                config.class_theta,
            )
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        config, theta = self.config, self.config.theta_initial
        stiffness_n, start = self._wheel.longitudinal_stiffness_n, FusionState(theta, 0.0)
        variance = unknown_variance(config.confidence, theta)
        self._state = EstimatorState(start, start, (0.0, 0.0, 0.0), config.elastic.start, variance)
        self._state.printed = self._state.printed_alone = printed.begun(theta)
        low, high, expected, expected_deviation = 0.0, GREATEST_THETA, theta, math.sqrt(variance)
        if self._robust is not None:
            self._state.robust = robust = begun(self._robust)
            said = robust.said
            low, high, expected, expected_deviation = said.low, said.high, said.mean, said.std
            theta, deviation = point(robust, theta)
            variance = deviation * deviation
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
            TRPAC_std=math.sqrt(variance),
            load_n=self._static_load_n,
            longitudinal_stiffness_n=stiffness_n,
            TRPAC_low=low,
            TRPAC_high=high,
            TRPAC_expected=expected,
            TRPAC_expected_std=expected_deviation,
        )

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
        config, rates, problem = self.config, self._rates, None
        if not plain(step_s, sensors, config.floor_m_s):
            problem = unusable(step_s, sensors, self._wheel.radius_m, config.floor_m_s)
        if frame is not None and isinstance(frame, RoadClass) and not 0.0 <= frame.confidence <= 1.0:
            problem = problem or f"Class confidence is {frame.confidence}; expected a number between 0 and 1."
            frame, frame_failed = None, True
        if problem is not None:
            return self._hold(step_s, sensors, frame, frame_failed, problem)
        state = self._state
        if step_s != rates.step_s or step_s == 0.0:
            self._rates = rates = Rates.at(config, step_s, state.step_s)
        if state.settled and jumped(state.readings, sensors, self._radius_m, rates):
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
        least_n = self._least_load_n
        return acceleration, lagged, load_n if load_n > least_n else least_n

    def _advance(
        self,
        sensors: Sensors,
        step_s: float,
        acceleration_m_s2: float,
        lagged_speed_m_s: float,
        load_n: float,
    ) -> Estimate:
        """Run both estimators over the step with the road that lies under the wheel at its start."""
        config, state = self.config, self._state
        scheduler, gains = config.scheduler, self._gains
        softened_by, wheel = self._softened_by
        if softened_by is not state.line:
            wheel = self._softened(state.line)
        C_x = wheel.longitudinal_stiffness_n
        readings, inputs, read_slip, smoothed_slip, locked_s = wheel_inputs(
            config, self._rates, state, sensors, self._radius_m, step_s, load_n
        )
        fusion, dynamics = state.fusion, state.dynamics
        if not state.settled:
            fusion = settled(fusion, inputs, wheel, gains)
            dynamics = settled(dynamics, inputs, wheel, gains)
        outcome = self._road.at(state.preview, state.position_m - self._setback_m)
        flag, theta_img, theta_seen = False, None, self._last.TRPAC_image
        Q_v, age_s = 0.0, -1.0
        if outcome is not None:
            flag = outcome.flag and not state.frame_failed
            theta_seen, Q_v = config.class_theta[outcome.surface], outcome.Q_v
            theta_img = theta_seen if flag else None
        look = look_at(inputs, C_x, scheduler)
        alone = dynamics_step(dynamics, inputs, look, wheel, gains, step_s)
        fused = alone
        if config.method is Method.DIFE and (theta_img is not None or fusion != dynamics):
            model, known = config.confidence, state.variance
            fused = fused_step(
                fusion,
                inputs,
                look,
                wheel,
                gains,
                scheduler,
                theta_img,
                step_s,
                model,
                known,
                dynamics,
                alone[1],
            )
        after, unaided, threshold, excited, K_v = fused
        theta, class_after, class_before = after[0], after[3], fusion[3]
        unasked_s = state.unasked_s + step_s
        if unasked_s >= config.sensor_filter_s or class_after != class_before:
            if config.method is Method.DIFE:
                state.variance, state.lag = self._variance(state, fused, inputs, look, wheel, unasked_s)
            state.line = self._learned(state, alone, inputs, read_slip, unasked_s)
            unasked_s = 0.0
        state.fusion, state.dynamics, state.readings = after, alone[0], readings
        state.unasked_s, state.locked_s, state.smoothed_slip = unasked_s, locked_s, smoothed_slip
        state.time_s += step_s
        state.position_m += inputs[7]
        state.speed_m_s, state.lagged_speed_m_s = sensors.vehicle_speed_m_s, lagged_speed_m_s
        state.acceleration_m_s2, state.load_n = acceleration_m_s2, load_n
        state.step_s, state.settled = step_s or state.step_s, True
        if outcome is not None:
            age_s = state.time_s - outcome.captured_s
        theta_alone, slip, force_n = alone[0][0], inputs[3][0], unaided[3]
        if config.method is Method.AS_PRINTED:
            step, theta_alone = self._as_printed(sensors, load_n, theta_img, step_s)
            _, slip, force_n, threshold, excited, K_v = step
            theta = step.state.theta_hat
            # The paper's estimate has no deviation: that of a road of which nothing is known.
            state.variance = variance = unknown_variance(config.confidence, theta)
        else:
            variance = with_camera(config.confidence, state.variance, theta, theta_img)
        deviation = math.sqrt(variance)
        low, high = max(theta - BOUNDS * deviation, 0.0), min(theta + BOUNDS * deviation, GREATEST_THETA)
        expected, expected_deviation = theta, deviation
        if state.robust is not None and self._robust is not None:
            given = roads.NONE if outcome is None or not flag else int(outcome.surface)
            sample = Sample(
                sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, load_n
            )
            seen = unaided[4] is not None
            state.robust = stepped(state.robust, self._robust, sample, given, step_s, inputs[7], seen)
            said = state.robust.said
            theta, deviation = point(state.robust, theta_alone)
            low, high, expected, expected_deviation = said.low, said.high, said.mean, said.std
            K_v = scheduler.K_v(abs(theta_img - theta)) if excited and theta_img is not None else 0.0
        self._last = _new(
            Estimate,
            (
                theta,
                flag,
                K_v,
                excited,
                threshold,
                slip,
                force_n,
                theta_seen,
                theta_alone,
                Q_v,
                age_s,
                deviation,
                load_n,
                C_x,
                low,
                high,
                expected,
                expected_deviation,
                self._source(flag, excited),
                None,
            ),
        )
        return self._last

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
        return _SOURCES[tyre + 2 * flag]

    def _as_printed(
        self, sensors: Sensors, load_n: float, theta_img: float | None, step_s: float
    ) -> tuple[PrintedStep, float]:
        """A step of Eqs. (12) to (19) with the camera, and the estimate of the same without it [-]."""
        state, gains, wheel = self._state, self.config.gains, self._wheel
        told = PrintedWheel(
            wheel.inertia_kg_m2,
            wheel.radius_m,
            wheel.longitudinal_stiffness_n,
            gains.K,
            gains.gamma,
            gains.visual_term is VisualTerm.INSIDE,
            self.config.floor_m_s,
        )
        read = sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, load_n
        with_picture = printed_step(state.printed, told, *read, theta_img, step_s)
        alone = printed_step(state.printed_alone, told, *read, None, step_s)
        state.printed, state.printed_alone = with_picture.state, alone.state
        return with_picture, alone.state.theta_hat

    def _softened(self, line: ElasticLine) -> Wheel:
        """The wheel with the stiffness that was learnt, kept until the line changes."""
        told = self._wheel
        softened_n = told.longitudinal_stiffness_n / (1.0 + line.compliance())
        wheel = Wheel(told.inertia_kg_m2, told.radius_m, softened_n)
        self._softened_by = line, wheel
        return wheel

    def _variance(
        self,
        state: EstimatorState,
        fused: Outcome,
        inputs: WheelInputs,
        look: Look,
        wheel: Wheel,
        passed_s: float,
    ) -> tuple[float, float]:
        """Variance and lag of the fused estimate after a time."""
        config, theta_hat, before_s = self.config, fused[0].theta_hat, state.step_s
        _, _, _, force_n, theta_tyre, _, steady, place = fused[1]
        size, direction = inputs.slip
        way_m = state.speed_m_s * passed_s
        before, after = state.fusion.theta_img, fused[0].theta_img
        if (
            theta_tyre is None
            and before is not None
            and after is not None
            and abs(after - theta_hat) > abs(before - theta_hat)
        ):
            # A class that is farther from the estimate than the one before: the road may be another.
            way_m += config.confidence.class_change_m
        if size == 0.0 or passed_s == 0.0 or not inputs.torque_known:
            return wandered(config.confidence, state.variance, theta_hat, way_m), 0.0
        speed_m_s = max(state.speed_m_s, config.floor_m_s)
        cubic, friction = look[0], force_n * direction / inputs.load_n
        if steady.held_s > before_s:
            size, friction = steady.slip, steady.friction
            cubic = (
                place[1]
                if place is not None
                else cubic_at_slip(size, inputs.load_n, wheel.longitudinal_stiffness_n)
            )
        tyre = TyreAtSlip(*cubic)
        noise_share = (self._rates.noise_m_s / speed_m_s + inputs.slip_change) / size
        torque_noise_nm = self._rates.noise_gain * config.confidence.torque_noise_nm
        torque_friction, following = torque_noise_nm / (wheel.radius_m * inputs.load_n), 0.0
        if theta_tyre is not None and friction > max(torque_friction, _LEAST_FRICTION):
            noise = reading_noise(friction, tyre, noise_share, torque_friction)
            state.following = followed(state.following, tyre.elastic, theta_tyre, noise, passed_s)
            following = state.following.share()
        line_share = math.sqrt(state.line.slip_variance(size, speed_m_s)) / size
        evidence = Evidence(theta_tyre, friction, tyre, line_share, noise_share, torque_friction, following)
        return advanced_variance(
            config.confidence,
            state.variance,
            state.lag,
            theta_hat,
            evidence,
            self._averaged,
            config.gains.gamma * quickened(steady, inputs.noise_s),
            way_m,
            passed_s,
        )

    def _learned(
        self,
        state: EstimatorState,
        alone: Outcome,
        inputs: WheelInputs,
        read_slip: float,
        passed_s: float,
    ) -> Any:
        """The elastic line with the slip that is read now."""
        config, speed_m_s = self.config, state.speed_m_s
        line = state.line.drifted(config.elastic, passed_s)
        if not (state.settled and inputs.torque_known and speed_m_s > config.floor_m_s):
            return line
        noise = self._rates.noise_m_s / speed_m_s
        state.unsettled = unsettled(state.unsettled, inputs.slip_change, noise, passed_s)
        return learned(
            line,
            config.elastic,
            read_slip,
            speed_m_s,
            alone[1].force_n,
            inputs.load_n,
            self._wheel.longitudinal_stiffness_n,
            noise,
            state.unsettled,
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
        if not implausible(sensors, MOTION):
            if frame is not None or frame_failed:
                acceleration = state.acceleration_m_s2
                take_frame(state, self.config, self._preview, self._ife, frame, sensors, acceleration)
            state.speed_m_s = sensors.vehicle_speed_m_s
        way_m = state.speed_m_s * passed_s
        state.time_s += passed_s
        state.position_m += way_m
        theta, model = state.fusion.theta_hat, self.config.confidence
        state.variance = wandered(model, state.variance, theta, way_m)
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
        outcome = self._road.at(state.preview, state.position_m - self._setback_m)
        theta_seen, Q_v, age_s = self._last.TRPAC_image, 0.0, -1.0
        if outcome is not None:
            theta_seen, Q_v = self.config.class_theta[outcome.surface], outcome.Q_v
            age_s = state.time_s - outcome.captured_s
        self._last = self._last._replace(
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            TRPAC_image=theta_seen,
            image_confidence=Q_v,
            frame_age_s=age_s,
            **self._held_bounds(),
            source=self._source(False, False),
            problem=problem,
        )
        return self._last

    def _held_bounds(self) -> dict[str, float]:
        """Deviation and interval of the estimate that is held; of the robust one with its expectation too."""
        state, theta = self._state, self._last.TRPAC
        deviation = math.sqrt(state.variance)
        if state.robust is None:
            return {
                "TRPAC_std": deviation,
                "TRPAC_low": max(theta - BOUNDS * deviation, 0.0),
                "TRPAC_high": min(theta + BOUNDS * deviation, GREATEST_THETA),
                "TRPAC_expected_std": deviation,
            }
        said = state.robust.said
        return {
            "TRPAC_std": math.hypot(said.std, said.mean - theta),
            "TRPAC_low": min(said.low, theta),
            "TRPAC_high": max(said.high, theta),
            "TRPAC_expected": said.mean,
            "TRPAC_expected_std": said.std,
        }

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
