"""Sensors and pictures in; TRPAC, flag and K_v out: the estimator of one wheel that the co-simulation unit wraps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .estimator_data import Estimate, EstimatorConfig, EstimatorState, Rates, RoadClass, Source
from .preprocessing import LOCKED_M_S
from .robust.messages import radius_message, tyre_message
from .sensors import LONGEST_STEP_S, Sensors, Unusable, motion_plausible, unusable_text
from .vision.ife import Ife
from .vision.preview import Outcome
from .vision.trajectory import Motion
from .wheel_step import (
    Frame,
    first_estimate,
    first_state,
    held,
    moved,
    outcome_of,
    rates_of,
    stepped,
    unusable_input,
    wheel_setup,
)

__all__ = [
    "LOCKED_M_S",
    "Estimate",
    "EstimatorConfig",
    "EstimatorState",
    "RoadClass",
    "Sensors",
    "TrpacEstimator",
]


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
        self._known = wheel_setup(config)
        self._rates = Rates.at(config, 0.0, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._state = first_state(self.config, self._known)
        self._last = first_estimate(self.config, self._known, self._state)

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
        """The estimate after one step; sensors are read at its start and held over it.

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
        config, known, state = self.config, self._known, self._state
        road_class = frame if isinstance(frame, RoadClass) else None
        reason = unusable_input(config, step_s, sensors, road_class)
        if step_s > LONGEST_STEP_S:
            state.ife = state.ife.elsewhere()
        if reason is Unusable.NOTHING:
            self._rates = rates_of(self._rates, config, step_s, state.step_s)
        seen, picture = None, None if isinstance(frame, RoadClass) else frame
        if road_class is not None and 0.0 <= road_class.confidence <= 1.0:
            seen = outcome_of(config, road_class, state.time_s)
        elif picture is not None and motion_plausible(sensors):
            seen = self._classified(picture, sensors, reason is Unusable.NOTHING)
        given = Frame(frame is not None or frame_failed, seen)
        if reason is Unusable.NOTHING:
            estimate = stepped(state, self._last, config, known, self._rates, sensors, given, step_s)
        else:
            estimate = held(state, self._last, config, known, sensors, given, step_s)
            confidence = 0.0 if road_class is None else road_class.confidence
            estimate = estimate._replace(problem=unusable_text(reason, step_s, sensors, confidence))
        self._last = estimate
        return estimate

    def _classified(self, picture: NDArray[np.uint8], sensors: Sensors, usable: bool) -> Outcome:
        """The result of a picture; usable readings give the motion of the car."""
        if self._ife is None:
            raise TypeError("A picture came, but the estimator was made without an image estimator.")
        state, acceleration_m_s2 = self._state, self._state.acceleration_m_s2
        if usable:
            acceleration_m_s2 = moved(state, self._known, self._rates, sensors).acceleration_m_s2
        motion = Motion(
            sensors.vehicle_speed_m_s,
            acceleration_m_s2,
            sensors.steering_angle_rad,
            sensors.yaw_rate_rad_s,
            state.position_m,
        )
        state.ife, result = self._ife.process(state.ife, picture, motion)
        return Outcome(result.surface, result.Q_v, result.flag, state.time_s)

    def messages(self) -> dict[str, str]:
        """Warnings about a car that differs from its description, by subject; none for the method as printed."""
        state, known = self._state.robust, self._known.robust
        axle = "Front" if self.config.front_axle else "Rear"
        texts = {
            f"{axle} tyres": tyre_message(state, known, axle, self._known.static_load_n),
            f"{axle} wheels": radius_message(state, known, axle, self._known.static_load_n),
        }
        return {about: text for about, text in texts.items() if text is not None}

    def state(self) -> dict[str, Any]:
        """All that is remembered as JSON-able values; floats survive the round trip bit by bit."""
        return {"state": self._state.to_json(), "last": self._last._asdict()}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Go back to what `state` gave."""
        self._state = EstimatorState.from_json(data["state"])
        self._last = Estimate(**{**data["last"], "source": Source(data["last"]["source"])})
