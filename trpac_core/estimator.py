"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import paper as printed
from .dife import FusionState, VisualTerm, Wheel, fusion_step, settled, visual_gain
from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Method, Rates, RoadClass, Source
from .paper import PrintedWheel, printed_step
from .preprocessing import LOCKED_M_S, jumped, preprocess
from .road_buffer import take_frame
from .robust import roads
from .robust.belief import WheelModel
from .robust.messages import radius_message, tyre_message
from .robust.wheel import Sample, begun, claim, point, setup, stepped
from .sensors import (
    GREATEST_ACCELERATION_M_S2,
    LONGEST_STEP_S,
    FilteredReadings,
    Sensors,
    motion_plausible,
    unusable,
    unusable_text,
)
from .stationary_mean import NO_MEAN
from .tyre import onset_slip
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
        self._rates = Rates.at(config, 0.0, 0.0)
        self._least_load_n = LEAST_LOAD * self._static_load_n
        mean_load_n = 0.5 * (car.wheel_load(True) + car.wheel_load(False))
        self._known = setup(
            WheelModel(
                car.longitudinal_stiffness_n, mean_load_n, car.wheel_inertia_kg_m2, car.wheel_radius_m
            ),
            car.rolling_resistance,
            config.sliding_speed_noise_m_s,
            config.torque_noise_nm,
            config.tolerance,
            config.class_theta,
        )
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        theta, load_n, C_x = (
            self.config.theta_initial,
            self._static_load_n,
            self._wheel.longitudinal_stiffness_n,
        )
        start, robust = FusionState(theta, 0.0), begun(self._known)
        self._state = EstimatorState(start, start, FilteredReadings(0.0, 0.0, 0.0), robust)
        self._state.printed = self._state.printed_alone = printed.begun(theta)
        theta = self._point(theta, theta)
        of_belief = claim(robust.said, theta)
        self._last = Estimate(
            TRPAC=theta,
            flag=False,
            K_v=0.0,
            excitation_flag=False,
            excitation_threshold=onset_slip(robust.onset_theta, load_n, C_x, sensitivity=0.0),
            slip=0.0,
            tyre_force_n=0.0,
            TRPAC_image=theta,
            TRPAC_dynamics=theta,
            image_confidence=0.0,
            frame_age_s=-1.0,
            TRPAC_std=of_belief.deviation,
            load_n=load_n,
            longitudinal_stiffness_n=C_x,
            TRPAC_low=of_belief.low,
            TRPAC_high=of_belief.high,
            TRPAC_expected=robust.said.mean,
            TRPAC_expected_std=robust.said.std,
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
        """Run the estimator over the step with the road that lies under the wheel at its start."""
        config, state, gains, wheel = self.config, self._state, self.config.gains, self._wheel
        outcome = self._under_wheel()
        flag = outcome is not None and outcome.flag and not state.frame_failed
        theta_img = config.class_theta[outcome.surface] if outcome is not None and flag else None
        prepared = preprocess(config, self._rates, state, sensors, step_s, load_n)
        inputs, way_m = prepared.inputs, sensors.vehicle_speed_m_s * step_s
        if config.method is Method.AS_PRINTED:
            step = self._printed(sensors, load_n, theta_img, step_s)
        else:
            fusion, dynamics = state.fusion, state.dynamics
            if not state.settled:
                fusion = settled(fusion, inputs, wheel, gains)
                dynamics = settled(dynamics, inputs, wheel, gains)
            onset_theta = state.robust.onset_theta
            fused = alone = fusion_step(dynamics, inputs, wheel, gains, None, onset_theta, step_s)
            if theta_img is not None or fusion != dynamics:
                # A class has one value wherever it is: beside a tyre that has shown this road it says nothing new.
                unseen_img = theta_img if state.robust.stale else None
                fused = fusion_step(fusion, inputs, wheel, gains, unseen_img, onset_theta, step_s)
            state.fusion, state.dynamics = fused.state, alone.state
            sample = Sample(
                sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, load_n
            )
            road_class = int(outcome.surface) if outcome is not None and flag else roads.NONE
            shown = alone.theta_tyre is not None
            state.robust = stepped(state.robust, self._known, sample, road_class, step_s, way_m, shown)
            step = _Step(
                self._point(fused.state.theta_hat, alone.state.theta_hat),
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
        state.speed_m_s, state.lagged_speed_m_s = sensors.vehicle_speed_m_s, lagged_speed_m_s
        state.acceleration_m_s2, state.load_n = acceleration_m_s2, load_n
        state.step_s, state.settled = step_s or state.step_s, True
        image, said = self._image(outcome), state.robust.said
        of_belief = claim(said, step.theta)
        self._last = Estimate(
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
            load_n=load_n,
            longitudinal_stiffness_n=wheel.longitudinal_stiffness_n,
            TRPAC_low=of_belief.low,
            TRPAC_high=of_belief.high,
            TRPAC_expected=said.mean,
            TRPAC_expected_std=said.std,
            source=self._source(flag, step.excited),
        )
        return self._last

    def _point(self, fused: float, observer: float) -> float:
        """TRPAC of the method, with the estimates with and without the camera [-]."""
        if self.config.method is Method.ROBUST:
            return point(self._state.robust, observer)
        return fused

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
        printed_only = self.config.method is Method.AS_PRINTED
        tyre = excited if printed_only else not self._state.robust.stale
        return Source(tyre + 2 * flag)

    def _printed(self, sensors: Sensors, load_n: float, theta_img: float | None, step_s: float) -> _Step:
        """A step of Eqs. (12) to (19) with the camera, and beside it of the same without it."""
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
        read = sensors.wheel_speed_rad_s, sensors.wheel_torque_nm, sensors.vehicle_speed_m_s, load_n
        fused = printed_step(state.printed, constants, *read, theta_img, step_s)
        alone = printed_step(state.printed_alone, constants, *read, None, step_s)
        state.printed, state.printed_alone = fused.state, alone.state
        return _Step(
            fused.state.theta_hat,
            alone.state.theta_hat,
            fused.slip,
            fused.force_n,
            fused.threshold,
            fused.excited,
            fused.K_v,
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
        state.settled = False
        state.fusion = state.fusion._replace(mean=NO_MEAN)
        state.dynamics = state.dynamics._replace(mean=NO_MEAN)
        if step_s > LONGEST_STEP_S:
            state.robust = begun(self._known)
        elif self.config.method is not Method.AS_PRINTED:
            state.robust = stepped(
                state.robust, self._known, None, roads.NONE, passed_s, way_m, observed=False
            )
        image, said, theta = self._image(self._under_wheel()), state.robust.said, self._last.TRPAC
        of_belief = claim(said, theta)
        self._last = self._last._replace(
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
            source=self._source(False, False),
            problem=problem,
        )
        return self._last

    def messages(self) -> dict[str, str]:
        """Sentences on what the drive shows of a car that is not as told, by what they concern; none as printed."""
        state, known = self._state.robust, self._known
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


class _Step(NamedTuple):
    """What a method makes of a step; as in `Estimate`."""

    theta: float
    theta_alone: float
    slip: float
    tyre_force_n: float
    threshold: float
    excited: bool
    K_v: float
