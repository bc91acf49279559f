"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .confidence import ConfidenceModel, advanced_variance
from .dife import FusionState, FusionStep, Gains, Wheel, WheelInputs, fusion_step, settled
from .excitation import FuzzyScheduler
from .slip import wheel_slip
from .tyre import peak_friction
from .vehicle import Vehicle
from .vision.classes import CLASS_THETA, Surface
from .vision.ife import Ife, IfeConfig, IfeState
from .vision.preview import Outcome, PreviewConfig, PreviewState, add_frame, covering, prune
from .vision.trajectory import Motion


@dataclass(frozen=True, slots=True)
class Sensors:
    """What the car measures now. What is None is not connected and is replaced as the estimator documents.

    Torque is positive where it drives, brakes included; steering angle of the front wheels and yaw rate are
    positive to the left.
    """

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float
    vertical_load_n: float | None = None
    steering_angle_rad: float = 0.0
    longitudinal_acceleration_m_s2: float | None = None
    yaw_rate_rad_s: float | None = None


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
    frame_interval_s : float
        Cycle time of the camera, for the first frame's stamp [s].
    flag_threshold : float
        Confidence above which a class from the bus sets the flag [-].
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
    frame_interval_s: float = 0.025
    flag_threshold: float = 0.5

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
    """Whether slip is above the threshold or the tyre visibly slides, so that the estimator runs."""
    excitation_threshold: float
    slip: float
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


GREATEST_ACCELERATION_M_S2 = 15.0
"""No road car's tyres give more: a steeper change of speed is a jump of the signal [m/s^2]."""


class Readings(NamedTuple):
    """Filtered wheel speed [rad/s], wheel torque [N m] and vehicle speed [m/s]."""

    wheel_speed_rad_s: float
    wheel_torque_nm: float
    vehicle_speed_m_s: float


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
    slip_before: float = 0.0
    settled: bool = False
    """Whether the force observers follow the wheel; not so at the start and after a gap in the input."""
    frame_failed: bool = False
    ife: IfeState = field(default_factory=IfeState)
    preview: PreviewState = field(default_factory=PreviewState)


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
        self._setback_m = 0.0 if config.front_axle else car.wheelbase_m
        self._preview = replace(config.preview, behind_m=max(config.preview.behind_m, self._setback_m))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        theta = self.config.theta_initial
        start = FusionState(theta, 0.0)
        self._state = EstimatorState(
            fusion=start,
            dynamics=start,
            readings=Readings(0.0, 0.0, 0.0),
            variance=self.config.confidence.unknown**2,
        )
        load_n = self.config.vehicle.wheel_load(self.config.front_axle)
        self._last = Estimate(
            TRPAC=theta,
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            excitation_threshold=self.config.scheduler.threshold(
                None, load_n, self._wheel.longitudinal_stiffness_n, self._slip_deviation(0.0, 0.001)
            ),
            slip=0.0,
            tyre_force_n=0.0,
            TRPAC_image=theta,
            TRPAC_dynamics=theta,
            TRPAC_peak=peak_friction(theta, load_n, self._wheel.longitudinal_stiffness_n),
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
        """One step: what the sensors read at its start is held over it.

        Parameters
        ----------
        step_s : float
            Step; 0 takes in a frame and lets no time pass [s].
        sensors : Sensors
            Readings.
        frame : array of uint8, shape (height, width, 3), or RoadClass, optional
            A new picture (BGR), or a new class in its place.
        frame_failed : bool
            A new picture came and could not be read: the flag stays down until a good one comes.

        Returns
        -------
        Estimate
            With `problem` set, where the readings were unusable: then the last good estimate with the flag down.

        Raises
        ------
        ImageError
            If the picture does not fit the camera; nothing has changed then.
        """
        problem = unusable(step_s, sensors, self.config.floor_m_s)
        if problem is None and isinstance(frame, RoadClass) and not 0.0 <= frame.confidence <= 1.0:
            problem = f"Class confidence is {frame.confidence}; expected a number between 0 and 1."
        if problem is not None:
            return self._hold(step_s, problem)
        state = self._state
        acceleration = self._acceleration(state, sensors, step_s)
        if frame is not None:
            state = self._take_in(state, frame, sensors, acceleration)
        elif frame_failed:
            state = replace(state, frame_failed=True)
        return self._advance(state, sensors, acceleration, step_s)

    def _acceleration(self, state: EstimatorState, sensors: Sensors, step_s: float) -> float:
        """Longitudinal acceleration, measured or differentiated, through a first-order filter. [m/s^2]."""
        if step_s == 0.0 or not state.settled:
            return state.acceleration_m_s2
        raw, time_constant_s = sensors.longitudinal_acceleration_m_s2, self.config.sensor_filter_s
        if raw is None:
            raw = (sensors.vehicle_speed_m_s - state.speed_m_s) / step_s
            raw = min(max(raw, -GREATEST_ACCELERATION_M_S2), GREATEST_ACCELERATION_M_S2)
            time_constant_s = self.config.acceleration_filter_s
        share = 1.0 - math.exp(-step_s / time_constant_s)
        return state.acceleration_m_s2 + share * (raw - state.acceleration_m_s2)

    def _filtered(self, state: EstimatorState, sensors: Sensors, step_s: float) -> Readings:
        """Readings through the common filter, which starts at the first ones."""
        now = Readings(sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s)
        if not state.settled:
            return now
        share, before = 1.0 - math.exp(-step_s / self.config.sensor_filter_s), state.readings
        return Readings(
            before.wheel_speed_rad_s + share * (now.wheel_speed_rad_s - before.wheel_speed_rad_s),
            before.wheel_torque_nm + share * (now.wheel_torque_nm - before.wheel_torque_nm),
            before.vehicle_speed_m_s + share * (now.vehicle_speed_m_s - before.vehicle_speed_m_s),
        )

    def _lagged_slip(self, state: EstimatorState, signed_slip: float, step_s: float) -> float:
        """Slip one filter time constant ago [-]."""
        if not state.settled:
            return signed_slip
        share = 1.0 - math.exp(-step_s / self.config.sensor_filter_s)
        return state.slip_before + share * (signed_slip - state.slip_before)

    def _slip_deviation(self, speed_m_s: float, step_s: float) -> float:
        """Standard deviation of the filtered slip: white noise through a discrete first-order filter [-]."""
        share = 1.0 - math.exp(-step_s / self.config.sensor_filter_s)
        filtered_m_s = self.config.sliding_speed_noise_m_s * math.sqrt(share / (2.0 - share))
        return filtered_m_s / max(speed_m_s, self.config.floor_m_s)

    def _rolling_moment(self, readings: Readings, load_n: float) -> float:
        """Moment of rolling resistance on a wheel that turns forwards [N m]."""
        if readings.wheel_speed_rad_s * self._wheel.radius_m < self.config.floor_m_s:
            return 0.0
        return self.config.vehicle.rolling_resistance * load_n * self._wheel.radius_m

    def _take_in(
        self,
        state: EstimatorState,
        frame: NDArray[np.uint8] | RoadClass,
        sensors: Sensors,
        acceleration_m_s2: float,
    ) -> EstimatorState:
        """Classify a picture, or take a class as it comes, and stamp it onto the road ahead."""
        ife_state = state.ife
        if isinstance(frame, RoadClass):
            outcome = Outcome(
                surface=frame.surface,
                confidence=frame.confidence,
                Q_v=frame.confidence,
                flag=frame.confidence > self.config.flag_threshold,
                captured_s=state.time_s,
            )
        elif self._ife is None:
            raise TypeError("A picture came, but the estimator was made without an image estimator.")
        else:
            motion = Motion(
                sensors.vehicle_speed_m_s,
                acceleration_m_s2,
                sensors.steering_angle_rad,
                sensors.yaw_rate_rad_s,
            )
            ife_state, result = self._ife.process(state.ife, frame, motion)
            outcome = Outcome(result.surface, result.P_fusion, result.Q_v, result.flag, state.time_s)
        preview = add_frame(
            state.preview,
            self._preview,
            outcome,
            position_m=state.position_m,
            speed_m_s=sensors.vehicle_speed_m_s,
            frame_interval_s=self.config.frame_interval_s,
        )
        return replace(state, ife=ife_state, preview=preview, frame_failed=False)

    def _advance(
        self, state: EstimatorState, sensors: Sensors, acceleration_m_s2: float, step_s: float
    ) -> Estimate:
        """Run both estimators over the step with the road that lies under the wheel at its start."""
        config, wheel = self.config, self._wheel
        readings = self._filtered(state, sensors, step_s)
        slip = wheel_slip(
            readings.wheel_speed_rad_s, readings.vehicle_speed_m_s, wheel.radius_m, config.floor_m_s
        )
        signed_slip = slip.size * slip.direction
        slip_before = self._lagged_slip(state, signed_slip, step_s)
        load_n = sensors.vertical_load_n
        if load_n is None:
            load_n = config.vehicle.wheel_load(config.front_axle, acceleration_m_s2)
        load_n = max(load_n, LEAST_LOAD * config.vehicle.wheel_load(config.front_axle))
        inputs = WheelInputs(
            readings.wheel_speed_rad_s,
            readings.wheel_torque_nm - self._rolling_moment(readings, load_n),
            slip,
            load_n,
            self._slip_deviation(sensors.vehicle_speed_m_s, step_s),
            abs(signed_slip - slip_before),
        )
        if not state.settled:
            state = replace(
                state,
                fusion=settled(state.fusion.theta_hat, inputs, wheel, config.gains),
                dynamics=settled(state.dynamics.theta_hat, inputs, wheel, config.gains),
                settled=True,
            )
        outcome = covering(state.preview, self._preview, state.position_m - self._setback_m)
        theta_seen = None if outcome is None else config.class_theta[outcome.surface]
        flag = outcome is not None and outcome.flag and not state.frame_failed
        theta_img = theta_seen if flag else None
        fused = self._fusion_step(state.fusion, inputs, theta_img, step_s)
        alone = self._fusion_step(state.dynamics, inputs, None, step_s)
        variance = advanced_variance(
            config.confidence,
            state.variance,
            fused.state.theta_hat,
            fused.sensitivity,
            inputs,
            wheel,
            config.gains.gamma,
            sensors.vehicle_speed_m_s,
            step_s,
        )
        position_m = state.position_m + sensors.vehicle_speed_m_s * step_s
        self._state = EstimatorState(
            time_s=state.time_s + step_s,
            position_m=position_m,
            speed_m_s=sensors.vehicle_speed_m_s,
            acceleration_m_s2=acceleration_m_s2,
            readings=readings,
            slip_before=slip_before,
            fusion=fused.state,
            dynamics=alone.state,
            settled=True,
            variance=variance,
            frame_failed=state.frame_failed,
            ife=state.ife,
            preview=prune(state.preview, self._preview, position_m),
        )
        theta = fused.state.theta_hat
        self._last = Estimate(
            TRPAC=theta,
            flag=flag,
            K_v=fused.K_v,
            excitation_flag=fused.excited,
            excitation_threshold=fused.threshold,
            slip=slip.size,
            tyre_force_n=fused.tyre_force_n,
            TRPAC_image=self._last.TRPAC_image if theta_seen is None else theta_seen,
            TRPAC_dynamics=alone.state.theta_hat,
            TRPAC_peak=peak_friction(theta, load_n, wheel.longitudinal_stiffness_n),
            image_confidence=0.0 if outcome is None else outcome.Q_v,
            frame_age_s=-1.0 if outcome is None else self._state.time_s - outcome.captured_s,
            TRPAC_std=math.sqrt(variance),
        )
        return self._last

    def _fusion_step(
        self, state: FusionState, inputs: WheelInputs, theta_img: float | None, step_s: float
    ) -> FusionStep:
        gains, scheduler = self.config.gains, self.config.scheduler
        return fusion_step(state, inputs, self._wheel, gains, scheduler, theta_img, step_s)

    def _hold(self, step_s: float, problem: str) -> Estimate:
        """Keep the last good estimate through unusable readings; the way goes on at the last good speed."""
        state = self._state
        if math.isfinite(step_s) and step_s > 0.0:
            state = replace(
                state,
                time_s=state.time_s + step_s,
                position_m=state.position_m + state.speed_m_s * step_s,
            )
        self._state = replace(state, settled=False)
        self._last = replace(self._last, flag=False, K_v=0.0, excitation_flag=False, problem=problem)
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
        values["fusion"], values["dynamics"] = (
            FusionState(*values["fusion"]),
            FusionState(*values["dynamics"]),
        )
        values["readings"] = Readings(*values["readings"])
        values["ife"] = IfeState.from_json(values["ife"])
        values["preview"] = PreviewState.from_json(values["preview"])
        self._state = EstimatorState(**values)
        self._last = Estimate(**data["last"])


PLAUSIBLE = {
    "wheel_speed_rad_s": 1000.0,
    "wheel_torque_nm": 20_000.0,
    "vehicle_speed_m_s": 150.0,
    "vertical_load_n": 50_000.0,
    "steering_angle_rad": 1.5,
    "longitudinal_acceleration_m_s2": 50.0,
    "yaw_rate_rad_s": 20.0,
}
"""Sizes beyond which a reading of a road car is a fault or in another unit, in the unit of its name."""
LEAST_LOAD = 0.05
"""Share of its static load below which a wheel's load is not taken [-]: the tyre's equations divide by it."""


def unusable(step_s: float, sensors: Sensors, floor_m_s: float) -> str | None:
    """One sentence on what makes a step's input unusable, None where it is good."""
    if not math.isfinite(step_s) or step_s < 0.0:
        return f"Step size is {step_s} s; expected a finite number of seconds, 0 or above."
    bad = [
        f"{name} is {value:g}, expected a number within +-{limit:g}"
        for name, limit in PLAUSIBLE.items()
        if (value := getattr(sensors, name)) is not None and not abs(value) <= limit
    ]
    if bad:
        return f"{'; '.join(bad)}. Check the signal's source and unit."
    if sensors.vertical_load_n is not None and sensors.vertical_load_n <= 0.0:
        return f"vertical_load_n is {sensors.vertical_load_n:g}: a wheel without load has no friction to estimate."
    if sensors.vehicle_speed_m_s < -floor_m_s:
        return "The car rolls backwards: the camera looks the other way, and the estimate is held."
    if sensors.wheel_speed_rad_s < 0.0 and sensors.vehicle_speed_m_s > floor_m_s:
        return "The wheel turns backwards while the car drives forwards; check the sign of wheel_speed_rad_s."
    return None
