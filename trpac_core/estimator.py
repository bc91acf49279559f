"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .confidence import ConfidenceModel, advanced_variance, wandered
from .dife import FusionState, Gains, Wheel, WheelInputs, fusion_step, settled
from .excitation import FuzzyScheduler
from .readings import (
    GREATEST_ACCELERATION_M_S2,
    MOTION,
    Readings,
    Sensors,
    ahead,
    filter_share,
    implausible,
    smoothed,
    unusable,
)
from .slip import wheel_slip
from .tyre import peak_friction
from .vehicle import Vehicle
from .vision.classes import CLASS_THETA, Surface
from .vision.ife import Ife, IfeConfig, IfeState
from .vision.preview import Outcome, PreviewConfig, PreviewState, add_frame, covering, prune
from .vision.trajectory import Motion


@dataclass(frozen=True)
class RoadClass:
    """A surface class that another classifier found, in place of a picture; confidence is its Q_v."""

    surface: Surface
    confidence: float


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of one wheel's estimator.

    Parameters
    ----------
    vehicle : Vehicle
        What is known of the car.
    front_axle : bool
        Whether the wheel is a front wheel: its load and when it reaches the road seen ahead.
    left_side : bool
        Whether it is on the left: which wheel's track the camera follows.
    vision : IfeConfig
        Settings of the image estimator but for what the vehicle and the wheel already say, see `image_settings`.
    gains, scheduler, preview, confidence
        Settings of the parts.
    class_theta : tuple of 3 floats
        Adhesion of dry, wet, snow and ice [-].
    theta_initial : float
        Estimate before anything is known: a dry road [-].
    floor_m_s : float
        Speed below which slip says nothing. At 1 m/s a speed error of 0.014 m/s is a slip of 0.014, as
        large as the excitation threshold [m/s].
    sensor_filter_s : float
        Time constant of the filter on wheel speed, torque, vehicle speed and measured acceleration. The tyre's curve
        is bent: noise that reached it unfiltered would lower its mean force, and theta_hat would rise to make up for
        it. One filter for all keeps Eq. (12) true between the filtered signals [s].
    sliding_speed_noise_m_s : float
        Standard deviation of the sliding speed omega R - v per sample: that of the car's sensors [m/s].
    acceleration_filter_s : float
        Time constant for the acceleration that the load follows where it is differentiated from speed [s].
    """

    vehicle: Vehicle = field(default_factory=Vehicle)
    front_axle: bool = True
    left_side: bool = True
    vision: IfeConfig = field(default_factory=IfeConfig)
    gains: Gains = field(default_factory=Gains)
    scheduler: FuzzyScheduler = field(default_factory=FuzzyScheduler)
    preview: PreviewConfig = field(default_factory=PreviewConfig)
    confidence: ConfidenceModel = field(default_factory=ConfidenceModel)
    class_theta: tuple[float, float, float] = (
        CLASS_THETA[Surface.DRY],
        CLASS_THETA[Surface.WET],
        CLASS_THETA[Surface.SNOW_ICE],
    )
    theta_initial: float = 0.8
    floor_m_s: float = 1.0
    sensor_filter_s: float = 0.010
    sliding_speed_noise_m_s: float = 0.0042
    acceleration_filter_s: float = 0.05

    @property
    def image_settings(self) -> IfeConfig:
        """Settings of the image estimator for this vehicle and wheel."""
        return replace(
            self.vision,
            track_m=self.vehicle.track_m,
            wheelbase_m=self.vehicle.wheelbase_m,
            side="left" if self.left_side else "right",
        )


@dataclass(frozen=True, slots=True)
class Estimate:
    """What the estimator says at a step."""

    TRPAC: float
    """Fused estimate theta_hat (DIFE) [-]."""
    flag: bool
    """Epsilon: whether the camera's verdict on the road under the wheel is used."""
    K_v: float
    """Visual gain [-] or [1/s], after Eq. (17) or (18)."""
    excitation_flag: bool
    """Whether DIFE runs: slip is above the threshold, or the tyre visibly slides."""
    excitation_threshold: float
    """Slip above which DIFE runs in any case [-]."""
    slip: float
    """Longitudinal slip, unsigned and filtered [-]."""
    tyre_force_n: float
    """Observed longitudinal force F_hat [N]."""
    TRPAC_image: float
    """Adhesion of the class that the camera gave the road under the wheel, whatever its flag [-]."""
    TRPAC_dynamics: float
    """The same estimator without the camera (DE) [-]."""
    TRPAC_peak: float
    """Maximum of the tyre's curve at TRPAC: what a brake test measures [-]."""
    image_confidence: float
    """Q_v of the road under the wheel, 0 where there is no verdict [-]."""
    frame_age_s: float
    """Time since the picture of the road under the wheel was taken; -1 where there is none [s]."""
    TRPAC_std: float
    """Standard deviation of TRPAC [-]."""
    problem: str | None = None
    """One sentence where the input was unusable and the last good estimate is held."""


@dataclass(frozen=True, slots=True)
class EstimatorState:
    """All that the estimator remembers."""

    fusion: FusionState
    dynamics: FusionState
    readings: Readings
    variance: float
    time_s: float = 0.0
    position_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    smoothed_slip: float = 0.0
    """Signed slip through the sensor filter once more."""
    lagged_speed_m_s: float = 0.0
    """Speed behind the filter that differentiates it."""
    load_n: float = 0.0
    """Vertical load, filtered where it is measured."""
    step_s: float = 0.0
    settled: bool = False
    """Whether the force observers follow the wheel; not so at the start and after a gap in the input."""
    frame_failed: bool = False
    ife: IfeState = field(default_factory=IfeState)
    preview: PreviewState = field(default_factory=PreviewState)


LEAST_LOAD = 0.05
"""Share of its static load below which a wheel's load is not taken [-]: the tyre's equations divide by it."""
MOST_AHEAD = 2.0
"""Most that a step may be longer than the one before for the readings' trend to be trusted over it [-]."""


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
        self._setback_m = 0.0 if config.front_axle else car.wheelbase_m
        self._preview = replace(config.preview, behind_m=max(config.preview.behind_m, self._setback_m))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        theta, stiffness_n = self.config.theta_initial, self._wheel.longitudinal_stiffness_n
        start = FusionState(theta, 0.0)
        self._state = EstimatorState(start, start, Readings(0.0, 0.0, 0.0), self.config.confidence.unknown**2)
        self._last = Estimate(
            TRPAC=theta,
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            excitation_threshold=self.config.scheduler.threshold(None, self._static_load_n, stiffness_n, 0.0),
            slip=0.0,
            tyre_force_n=0.0,
            TRPAC_image=theta,
            TRPAC_dynamics=theta,
            TRPAC_peak=peak_friction(theta, self._static_load_n, stiffness_n),
            image_confidence=0.0,
            frame_age_s=-1.0,
            TRPAC_std=self.config.confidence.unknown,
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
        problem = unusable(step_s, sensors, self._wheel.radius_m, self.config.floor_m_s)
        if isinstance(frame, RoadClass) and not 0.0 <= frame.confidence <= 1.0:
            problem = problem or f"Class confidence is {frame.confidence}; expected a number between 0 and 1."
            frame, frame_failed = None, True
        if problem is not None:
            return self._hold(step_s, sensors, frame, frame_failed, problem)
        state = self._with_frame(self._moved(step_s, sensors), frame, frame_failed, sensors)
        return self._advance(state, sensors, step_s)

    def _moved(self, step_s: float, sensors: Sensors) -> EstimatorState:
        """The state with acceleration and load as they are now; at the start, and after a gap, unfiltered."""
        config, state = self.config, self._state
        measured, lagged = sensors.longitudinal_acceleration_m_s2, state.lagged_speed_m_s
        if not state.settled:
            acceleration, lagged = measured or 0.0, sensors.vehicle_speed_m_s
        elif measured is not None:
            share = filter_share(step_s, config.sensor_filter_s)
            acceleration = state.acceleration_m_s2 + share * (measured - state.acceleration_m_s2)
        else:
            # A signal that changes more rarely than the unit steps must not be cut at its jumps: so the speed is
            # differentiated by its distance from its own filter, and only that is bounded.
            slope = (sensors.vehicle_speed_m_s - lagged) / config.acceleration_filter_s
            acceleration = min(max(slope, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
            share = filter_share(step_s, config.acceleration_filter_s)
            lagged += share * (sensors.vehicle_speed_m_s - lagged)
        load_n = sensors.vertical_load_n
        if load_n is None:
            load_n = config.vehicle.wheel_load(config.front_axle, acceleration)
        elif state.settled:
            load_n = state.load_n + filter_share(step_s, config.sensor_filter_s) * (load_n - state.load_n)
        return replace(
            state,
            acceleration_m_s2=acceleration,
            lagged_speed_m_s=lagged,
            load_n=max(load_n, LEAST_LOAD * self._static_load_n),
        )

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
            return replace(state, frame_failed=True) if failed else state
        preview = add_frame(
            state.preview,
            self._preview,
            outcome,
            position_m=state.position_m,
            speed_m_s=sensors.vehicle_speed_m_s,
            frame_interval_s=1.0 / self.config.vision.camera.fps,
        )
        return replace(state, preview=preview, frame_failed=frame is None)

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
        return replace(state, ife=memory), Outcome(result.surface, result.Q_v, result.flag, state.time_s)

    def _advance(self, state: EstimatorState, sensors: Sensors, step_s: float) -> Estimate:
        """Run both estimators over the step with the road that lies under the wheel at its start."""
        config, wheel = self.config, self._wheel
        readings, inputs, smoothed_slip = self._inputs(state, sensors, step_s)
        if not state.settled:
            state = replace(
                state,
                fusion=settled(state.fusion.theta_hat, state.fusion.unseen_m, inputs, wheel, config.gains),
                dynamics=settled(
                    state.dynamics.theta_hat, state.dynamics.unseen_m, inputs, wheel, config.gains
                ),
            )
        outcome = self._under_wheel(state)
        flag = outcome is not None and outcome.flag and not state.frame_failed
        theta_img = config.class_theta[outcome.surface] if outcome is not None and flag else None
        fused = fusion_step(state.fusion, inputs, wheel, config.gains, config.scheduler, theta_img, step_s)
        alone = fusion_step(state.dynamics, inputs, wheel, config.gains, config.scheduler, None, step_s)
        variance = advanced_variance(
            config.confidence,
            state.variance,
            fused.state.theta_hat,
            fused.sensitivity,
            inputs,
            wheel,
            config.gains.gamma,
            inputs.way_m,
            step_s,
        )
        position_m = state.position_m + inputs.way_m
        self._state = replace(
            state,
            fusion=fused.state,
            dynamics=alone.state,
            readings=readings,
            variance=variance,
            time_s=state.time_s + step_s,
            position_m=position_m,
            speed_m_s=sensors.vehicle_speed_m_s,
            smoothed_slip=smoothed_slip,
            step_s=step_s or state.step_s,
            settled=True,
            preview=prune(state.preview, self._preview, position_m),
        )
        theta = fused.state.theta_hat
        theta_seen, Q_v, age_s = self._seen(outcome)
        self._last = Estimate(
            TRPAC=theta,
            flag=flag,
            K_v=fused.K_v,
            excitation_flag=fused.excited,
            excitation_threshold=fused.threshold,
            slip=inputs.slip.size,
            tyre_force_n=fused.tyre_force_n,
            TRPAC_dynamics=alone.state.theta_hat,
            TRPAC_peak=peak_friction(theta, inputs.load_n, wheel.longitudinal_stiffness_n),
            TRPAC_image=theta_seen,
            image_confidence=Q_v,
            frame_age_s=age_s,
            TRPAC_std=math.sqrt(variance),
        )
        return self._last

    def _inputs(
        self, state: EstimatorState, sensors: Sensors, step_s: float
    ) -> tuple[Readings, WheelInputs, float]:
        """Filtered readings, what both estimators are given of them, and the slip smoothed once more."""
        config, radius_m = self.config, self._wheel.radius_m
        now = Readings(sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s)
        before, ratio = now, 0.0
        passed = filter_share(step_s, config.sensor_filter_s)
        if state.settled:
            before = state.readings
            now = smoothed(before, sensors, passed)
            ratio = min(step_s / state.step_s, MOST_AHEAD) if state.step_s else 0.0
        slip = wheel_slip(now.wheel_speed_rad_s, now.vehicle_speed_m_s, radius_m, config.floor_m_s)
        signed = slip.size * slip.direction
        smoothed_slip = signed
        if state.settled:
            smoothed_slip = state.smoothed_slip + passed * (signed - state.smoothed_slip)
        rolling_nm = 0.0
        if now.wheel_speed_rad_s * radius_m >= config.floor_m_s:
            rolling_nm = config.vehicle.rolling_resistance * state.load_n * radius_m
        # White noise per sample through a discrete first-order filter; a step of 0 keeps the last one's
        share = passed or filter_share(state.step_s, config.sensor_filter_s)
        noise_m_s = config.sliding_speed_noise_m_s * math.sqrt(share / (2.0 - share))
        inputs = WheelInputs(
            now.wheel_speed_rad_s,
            ahead(now.wheel_speed_rad_s, before.wheel_speed_rad_s, ratio),
            ahead(now.wheel_torque_nm, before.wheel_torque_nm, ratio) - rolling_nm,
            slip,
            state.load_n,
            noise_m_s / max(sensors.vehicle_speed_m_s, config.floor_m_s),
            abs(signed - smoothed_slip),
            sensors.vehicle_speed_m_s * step_s,
        )
        return now, inputs, smoothed_slip

    def _under_wheel(self, state: EstimatorState) -> Outcome | None:
        return covering(state.preview, self._preview, state.position_m - self._setback_m)

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
        self._state = replace(
            state,
            time_s=state.time_s + passed_s,
            position_m=state.position_m + way_m,
            speed_m_s=speed_m_s,
            variance=wandered(self.config.confidence, state.variance, way_m),
            settled=False,
        )
        theta_seen, Q_v, age_s = self._seen(self._under_wheel(self._state))
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
        state, last = self._state, self._last
        values = {name: getattr(state, name) for name in EstimatorState.__slots__}
        for name in ("fusion", "dynamics", "readings"):
            values[name] = list(values[name])
        values["ife"], values["preview"] = state.ife.to_json(), state.preview.to_json()
        return {"state": values, "last": {name: getattr(last, name) for name in Estimate.__slots__}}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Go back to what `state` gave."""
        values = dict(data["state"])
        values["fusion"], values["dynamics"] = (FusionState(*values[name]) for name in ("fusion", "dynamics"))
        values["readings"] = Readings(*values["readings"])
        values["ife"] = IfeState.from_json(values["ife"])
        values["preview"] = PreviewState.from_json(values["preview"])
        self._state = EstimatorState(**values)
        self._last = Estimate(**data["last"])
