"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .confidence import Evidence, advanced_variance, unknown_variance, wandered, with_camera
from .dife import FusionState, FusionStep, Look, Wheel, WheelInputs, fusion_step, look_at, settled
from .elastic import learned
from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Rates, RoadClass
from .readings import (
    GREATEST_ACCELERATION_M_S2,
    MOTION,
    Readings,
    Sensors,
    ahead,
    implausible,
    plain,
    smoothed,
    unusable,
)
from .slip import GREATEST_SLIP, Slip, wheel_slip
from .tyre import peak_friction
from .vision.ife import Ife
from .vision.preview import Outcome, add_frame, covering, prune
from .vision.trajectory import Motion

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
MOST_AHEAD = 2.0
"""Most that a step may be longer than the one before for the readings' trend to be trusted over it [-]."""
JUMP_M_S, RIM_JUMP_M_S = 1.5, 8.0
"""How far a reading may be from its filter: a bus of 20 Hz at 15 m/s^2, and a wheel that a full brake locks [m/s]."""
RIM_ACCELERATION_M_S2 = 750.0
"""Steepest change of a rim's speed: 3000 N m on 1.2 kg m^2 at 0.3 m [m/s^2]."""
LOCKED_M_S = 0.5
"""Below this rim speed the wheel of a driving car counts as locked: its brake then holds what the road gives, not the
torque that was commanded [m/s]."""
RELEASED = 5.0
"""Time constants of the sensor filter until it has forgotten a locked wheel's torque to 1 % [-]."""


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
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        config, theta = self.config, self.config.theta_initial
        stiffness_n, start = self._wheel.longitudinal_stiffness_n, FusionState(theta, 0.0)
        variance = unknown_variance(config.confidence, theta)
        self._state = EstimatorState(start, start, Readings(0.0, 0.0, 0.0), config.elastic.start, variance)
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
            TRPAC_peak=peak_friction(theta, self._static_load_n, stiffness_n),
            image_confidence=0.0,
            frame_age_s=-1.0,
            TRPAC_std=math.sqrt(variance),
        )

    @property
    def last(self) -> Estimate:
        """The estimate of the step before."""
        return self._last

    def step(
        self,
        step_s: float,
        sensors: Sensors,
        frame: NDArray[np.uint8] | RoadClass | None = None,
        *,
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
        problem = None
        if not plain(step_s, sensors, self.config.floor_m_s):
            problem = unusable(step_s, sensors, self._wheel.radius_m, self.config.floor_m_s)
        if isinstance(frame, RoadClass) and not 0.0 <= frame.confidence <= 1.0:
            problem = problem or f"Class confidence is {frame.confidence}; expected a number between 0 and 1."
            frame, frame_failed = None, True
        if problem is not None:
            return self._hold(step_s, sensors, frame, frame_failed, problem)
        if step_s != self._rates.step_s or step_s == 0.0:
            self._rates = Rates.at(self.config, step_s, self._state.step_s)
        if self._state.settled and self._jumped(sensors, step_s):
            self._state = self._state._replace(settled=False)
        acceleration, lagged, load_n = self._moved(sensors)
        state = self._state
        if frame is not None or frame_failed:
            judging = state._replace(acceleration_m_s2=acceleration)
            state = self._with_frame(judging, frame, frame_failed, sensors)
        return self._advance(state, sensors, step_s, acceleration, lagged, load_n)

    def _jumped(self, sensors: Sensors, step_s: float) -> bool:
        """Whether readings are where no car can have gone since: a host that began with zeros, a signal that came back.

        The observers would take such a jump for a force that they forget only slowly.
        """
        omega, _, speed_m_s = self._state.readings
        speed_m_s -= sensors.vehicle_speed_m_s
        rim_m_s = (omega - sensors.wheel_speed_rad_s) * self._wheel.radius_m
        return (
            abs(speed_m_s) > JUMP_M_S + GREATEST_ACCELERATION_M_S2 * step_s
            or abs(rim_m_s) > RIM_JUMP_M_S + RIM_ACCELERATION_M_S2 * step_s
        )

    def _moved(self, sensors: Sensors) -> tuple[float, float, float]:
        """Acceleration, lagged speed and load as they are now; at the start, and after a gap, unfiltered."""
        config, state, rates = self.config, self._state, self._rates
        measured, lagged = sensors.longitudinal_acceleration_m_s2, state.lagged_speed_m_s
        if not state.settled:
            acceleration, lagged = measured or 0.0, sensors.vehicle_speed_m_s
        elif measured is not None:
            acceleration = state.acceleration_m_s2 + rates.sensor_share * (measured - state.acceleration_m_s2)
        else:
            # A signal that changes more rarely than the unit steps must not be cut at its jumps: so the speed is
            # differentiated by its distance from its own filter, and only that is bounded.
            slope = (sensors.vehicle_speed_m_s - lagged) / config.acceleration_filter_s
            acceleration = min(max(slope, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
            lagged += rates.acceleration_share * (sensors.vehicle_speed_m_s - lagged)
        load_n = sensors.vertical_load_n
        if load_n is None:
            load_n = self._static_load_n + self._load_by_acceleration * acceleration
        elif state.settled:
            load_n = state.load_n + rates.sensor_share * (load_n - state.load_n)
        return acceleration, lagged, max(load_n, LEAST_LOAD * self._static_load_n)

    def _with_frame(
        self,
        state: EstimatorState,
        frame: NDArray[np.uint8] | RoadClass | None,
        failed: bool,
        sensors: Sensors,
    ) -> EstimatorState:
        """The state with a new frame's verdict stamped onto the road ahead; a failed one's is that it knows nothing."""
        if frame is not None:
            state, outcome = self._judged(state, frame, sensors)
        elif failed and state.preview.stamps:
            surface = state.preview.stamps[-1].outcome.surface
            outcome = Outcome(surface, Q_v=0.0, flag=False, captured_s=state.time_s)
        else:
            return state._replace(frame_failed=True) if failed else state
        preview = add_frame(
            prune(state.preview, self._preview, state.position_m),
            self._preview,
            outcome,
            position_m=state.position_m,
            speed_m_s=sensors.vehicle_speed_m_s,
            frame_interval_s=1.0 / self.config.vision.camera.fps,
        )
        return state._replace(preview=preview, frame_failed=frame is None)

    def _judged(
        self, state: EstimatorState, frame: NDArray[np.uint8] | RoadClass, sensors: Sensors
    ) -> tuple[EstimatorState, Outcome]:
        """Classify a picture, or take a class as it comes."""
        if isinstance(frame, RoadClass):
            flag = frame.confidence > self.config.vision.flag_threshold
            return state, Outcome(frame.surface, frame.confidence, flag, state.time_s)
        if self._ife is None:
            raise TypeError("A picture came, but the estimator was made without an image estimator.")
        motion = Motion(
            sensors.vehicle_speed_m_s,
            state.acceleration_m_s2,
            sensors.steering_angle_rad,
            sensors.yaw_rate_rad_s,
        )
        memory, result = self._ife.process(state.ife, frame, motion)
        return state._replace(ife=memory), Outcome(result.surface, result.Q_v, result.flag, state.time_s)

    def _advance(
        self,
        state: EstimatorState,
        sensors: Sensors,
        step_s: float,
        acceleration_m_s2: float,
        lagged_speed_m_s: float,
        load_n: float,
    ) -> Estimate:
        """Run both estimators over the step with the road that lies under the wheel at its start."""
        config, known = self.config, self._wheel
        scheduler, gains = config.scheduler, config.gains
        readings, inputs, read_slip, smoothed_slip, locked_s = self._inputs(state, sensors, step_s, load_n)
        C_x = known.longitudinal_stiffness_n / (1.0 + state.line.compliance())
        wheel = Wheel(known.inertia_kg_m2, known.radius_m, C_x)
        fusion, dynamics = state.fusion, state.dynamics
        if not state.settled:
            fusion = settled(fusion, inputs, wheel, gains)
            dynamics = settled(dynamics, inputs, wheel, gains)
        outcome = covering(state.preview, self._preview, state.position_m - self._setback_m)
        flag = outcome is not None and outcome.flag and not state.frame_failed
        theta_img = config.class_theta[outcome.surface] if outcome is not None and flag else None
        look = look_at(inputs, C_x, scheduler)
        alone = fusion_step(dynamics, inputs, look, wheel, gains, scheduler, None, step_s)
        fused = alone
        if theta_img is not None or fusion != dynamics:
            fused = fusion_step(fusion, inputs, look, wheel, gains, scheduler, theta_img, step_s)
        theta = fused.state.theta_hat
        line, variance, lag, unasked_s = state.line, state.variance, state.lag, state.unasked_s + step_s
        changed = fused.state.theta_img != fusion.theta_img
        if changed or unasked_s >= config.sensor_filter_s:
            variance, lag = self._variance(state, fused, inputs, look, wheel, unasked_s)
            line = self._learned(state, alone, inputs, read_slip, unasked_s)
            unasked_s = 0.0
        position_m = state.position_m + inputs.way_m
        self._state = EstimatorState(
            fused.state,
            alone.state,
            readings,
            line,
            variance,
            lag,
            unasked_s,
            locked_s,
            state.time_s + step_s,
            position_m,
            sensors.vehicle_speed_m_s,
            acceleration_m_s2,
            smoothed_slip,
            lagged_speed_m_s,
            load_n,
            step_s or state.step_s,
            True,
            state.frame_failed,
            state.ife,
            state.preview,
        )
        theta_seen, Q_v, age_s = self._seen(outcome)
        self._last = Estimate(
            theta,
            flag,
            fused.K_v,
            fused.excited,
            fused.threshold,
            inputs.slip.size,
            fused.tyre_force_n,
            theta_seen,
            alone.state.theta_hat,
            peak_friction(theta, load_n, C_x),
            Q_v,
            age_s,
            math.sqrt(with_camera(config.confidence, variance, theta, theta_img)),
        )
        return self._last

    def _inputs(
        self, state: EstimatorState, sensors: Sensors, step_s: float, load_n: float
    ) -> tuple[Readings, WheelInputs, float, float, float]:
        """Filtered readings, what both estimators are given of them, slip as read, smoothed slip, time since locked."""
        config, rates, radius_m = self.config, self._rates, self._wheel.radius_m
        now = Readings(sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s)
        before, ratio = now, 0.0
        if state.settled:
            before = state.readings
            now = smoothed(before, sensors, rates.sensor_share)
            ratio = min(step_s / state.step_s, MOST_AHEAD) if state.step_s else 0.0
        omega, torque_nm, speed_m_s = now
        before_omega, before_torque_nm, _ = before
        floor_m_s = config.floor_m_s
        slip = wheel_slip(omega, speed_m_s, radius_m, floor_m_s)
        read_slip = signed = slip.size * slip.direction
        offset_variance, line = 0.0, state.line
        divisor_m_s = speed_m_s if speed_m_s > floor_m_s else floor_m_s
        if slip.direction or speed_m_s >= floor_m_s:
            offset_variance = line.offset_variance(divisor_m_s)
            signed = read_slip - line.offset(divisor_m_s, offset_variance)
            slip = Slip(
                min(abs(signed), GREATEST_SLIP), 1.0 if signed > 0.0 else -1.0 if signed < 0.0 else 0.0
            )
        smoothed_slip = signed
        if state.settled:
            smoothed_slip = state.smoothed_slip + rates.sensor_share * (signed - state.smoothed_slip)
        rolling_nm = 0.0
        if omega * radius_m >= floor_m_s:
            rolling_nm = config.vehicle.rolling_resistance * load_n * radius_m
        locked_s = state.locked_s + step_s
        if sensors.wheel_speed_rad_s * radius_m < LOCKED_M_S and sensors.vehicle_speed_m_s > floor_m_s:
            locked_s = 0.0
        noise = rates.noise_m_s / max(sensors.vehicle_speed_m_s, floor_m_s)
        inputs = WheelInputs(
            omega,
            ahead(omega, before_omega, ratio),
            ahead(torque_nm, before_torque_nm, ratio) - rolling_nm,
            slip,
            load_n,
            max(noise, math.sqrt(offset_variance)),
            abs(signed - smoothed_slip),
            sensors.vehicle_speed_m_s * step_s,
            locked_s > RELEASED * config.sensor_filter_s,
        )
        return now, inputs, read_slip, smoothed_slip, locked_s

    def _variance(
        self,
        state: EstimatorState,
        fused: FusionStep,
        inputs: WheelInputs,
        look: Look,
        wheel: Wheel,
        passed_s: float,
    ) -> tuple[float, float]:
        """Variance and lag of the fused estimate after a time."""
        config, theta_hat = self.config, fused.state.theta_hat
        way_m = state.speed_m_s * passed_s
        before, after = state.fusion.theta_img, fused.state.theta_img
        if (
            before is not None
            and after is not None
            and fused.theta_tyre is None
            and abs(after - theta_hat) > abs(before - theta_hat)
        ):
            # A class that is farther from the estimate than the one before: the road may be another.
            way_m += config.confidence.class_change_m
        size = inputs.slip.size
        if size == 0.0 or passed_s == 0.0 or not inputs.torque_known:
            return wandered(config.confidence, state.variance, theta_hat, way_m), 0.0
        speed_m_s = max(state.speed_m_s, config.floor_m_s)
        evidence = Evidence(
            fused.theta_tyre,
            fused.tyre_force_n * inputs.slip.direction / inputs.load_n,
            look.tyre,
            math.sqrt(state.line.slip_variance(size, speed_m_s)) / size,
            (self._rates.noise_m_s / speed_m_s + inputs.slip_change) / size,
            self._rates.noise_gain * config.confidence.torque_noise_nm / (wheel.radius_m * inputs.load_n),
        )
        return advanced_variance(
            config.confidence,
            state.variance,
            state.lag,
            theta_hat,
            evidence,
            self._averaged,
            config.gains.gamma,
            way_m,
            passed_s,
        )

    def _learned(
        self,
        state: EstimatorState,
        alone: FusionStep,
        inputs: WheelInputs,
        read_slip: float,
        passed_s: float,
    ) -> Any:
        """The elastic line with the slip that is read now."""
        config, speed_m_s = self.config, state.speed_m_s
        line = state.line.drifted(config.elastic, passed_s)
        if not (state.settled and inputs.torque_known and speed_m_s > config.floor_m_s):
            return line
        return learned(
            line,
            config.elastic,
            read_slip,
            speed_m_s,
            alone.tyre_force_n,
            inputs.load_n,
            self._wheel.longitudinal_stiffness_n,
            self._rates.noise_m_s / speed_m_s,
            inputs.slip_change,
        )

    def _seen(self, outcome: Outcome | None) -> tuple[float, float, float]:
        """Adhesion, confidence and age of what the camera side shows of the road under the wheel."""
        if outcome is None:
            return self._last.TRPAC_image, 0.0, -1.0
        theta = self.config.class_theta[outcome.surface]
        return theta, outcome.Q_v, self._state.time_s - outcome.captured_s

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
        passed_s = step_s if math.isfinite(step_s) and step_s > 0.0 else 0.0
        speed_m_s = state.speed_m_s
        if not implausible(sensors, MOTION):
            speed_m_s = sensors.vehicle_speed_m_s
            state = self._with_frame(state, frame, frame_failed, sensors)
        way_m = speed_m_s * passed_s
        theta = state.fusion.theta_hat
        self._state = state._replace(
            time_s=state.time_s + passed_s,
            position_m=state.position_m + way_m,
            speed_m_s=speed_m_s,
            variance=wandered(self.config.confidence, state.variance, theta, way_m),
            lag=0.0,
            settled=False,
        )
        outcome = covering(self._state.preview, self._preview, self._state.position_m - self._setback_m)
        theta_seen, Q_v, age_s = self._seen(outcome)
        self._last = replace(
            self._last,
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            TRPAC_image=theta_seen,
            image_confidence=Q_v,
            frame_age_s=age_s,
            TRPAC_std=math.sqrt(self._state.variance),
            problem=problem,
        )
        return self._last

    def state(self) -> dict[str, Any]:
        """All that is remembered as JSON-able values; floats survive the round trip bit by bit."""
        last = {field.name: getattr(self._last, field.name) for field in fields(Estimate)}
        return {"state": self._state.to_json(), "last": last}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Go back to what `state` gave."""
        self._state = EstimatorState.from_json(data["state"])
        self._last = Estimate(**data["last"])
