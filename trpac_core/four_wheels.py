"""The estimators of all four wheels behind one camera, and one TRPAC for the car."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .car_friction import Friction, car_friction
from .estimator import Estimate, EstimatorConfig, RoadClass, TrpacEstimator
from .estimator_data import Source
from .local_speed import local_speeds, motion_known
from .sensors import LONGEST_STEP_S, PLAUSIBLE, Sensors
from .vehicle import WHEELS, Vehicle
from .vision.results import FrameResult
from .vision.sides import SidesIfe, SidesState
from .vision.trajectory import Motion

CAR = "car"
"""Whom a problem of a shared signal concerns."""
LIFTED_N = 1.0
"""Load of a wheel that lateral acceleration lifts: the tyre's equations need one above 0 [N]."""

_STEEPEST = PLAUSIBLE["longitudinal_acceleration_m_s2"]

Four = tuple[float, float, float, float]
OptionalFour = tuple[float | None, float | None, float | None, float | None]


_UNKNOWN: OptionalFour = (None, None, None, None)
_NO_LOADS: Four = (math.nan, math.nan, math.nan, math.nan)


class CarSensors(NamedTuple):
    """What the car measures now; what is None is not connected. Signs as in `Sensors`."""

    wheel_speed_rad_s: Four
    wheel_torque_nm: Four
    vehicle_speed_m_s: float
    """At the middle of the rear axle."""
    vertical_load_n: OptionalFour = _UNKNOWN
    steering_angle_rad: float = 0.0
    longitudinal_acceleration_m_s2: float | None = None
    lateral_acceleration_m_s2: float | None = None
    """Positive to the left; counts only beside a longitudinal one."""
    yaw_rate_rad_s: float | None = None


class SideClasses(NamedTuple):
    """Surface classes that another classifier found on the left and on the right, in place of a picture."""

    left: RoadClass | None
    right: RoadClass | None


@dataclass(frozen=True)
class FourWheelsConfig:
    """Settings of the four estimators.

    Parameters
    ----------
    wheel : EstimatorConfig
        Of each wheel; which wheel it is, is set for each.
    axle_deviation : float
        How far friction may differ between the wheels of one side, a wheelbase apart: the standard deviation of the
        road's change over that distance, about 0.05 per root of a metre [-].
    """

    wheel: EstimatorConfig = field(default_factory=EstimatorConfig)
    axle_deviation: float = 0.08

    def of_wheel(self, name: str) -> EstimatorConfig:
        """Settings of the wheel fl, fr, rl or rr."""
        return replace(self.wheel, front_axle=name.startswith("f"), left_side=name.endswith("l"))


class CarEstimate(NamedTuple):
    """Outputs of the estimators at a step."""

    wheels: tuple[Estimate, Estimate, Estimate, Estimate]
    TRPAC: float
    """The car's adhesion, see `car_friction` [-]."""
    TRPAC_std: float
    """Its standard deviation [-]."""
    TRPAC_low: float
    """The same rule applied to the wheels' lower bounds [-]."""
    TRPAC_high: float
    """The same rule applied to the wheels' upper bounds [-]."""
    TRPAC_expected: float
    """The same rule applied to the wheels' expected frictions [-]."""
    TRPAC_expected_std: float
    """Its standard deviation [-]."""
    source: Source
    """What any of the wheels' estimates rests on."""
    problems: tuple[tuple[str, str], ...] = ()
    """Who could not be estimated (a wheel's name, or `CAR` where all could not), and why."""


class CarSetup(NamedTuple):
    """What the settings make of the car."""

    static_n: Four
    """Loads at rest [N]."""
    front_roll_kg: float
    rear_roll_kg: float
    """Load that lateral acceleration moves between the wheels of an axle [kg]."""


def car_setup(car: Vehicle) -> CarSetup:
    """The set-up of a car."""
    front_n, rear_n = car.wheel_load(True), car.wheel_load(False)
    per_m_s2 = car.mass_kg * car.cog_height_m / (car.track_m * car.wheelbase_m)
    return CarSetup(
        (front_n, front_n, rear_n, rear_n),
        per_m_s2 * car.cog_to_rear_axle_m,
        per_m_s2 * car.cog_to_front_axle_m,
    )


def wheel_speeds(car: Vehicle, sensors: CarSensors) -> Four:
    """Speed of the road under each wheel [m/s]."""
    speed, yaw = sensors.vehicle_speed_m_s, sensors.yaw_rate_rad_s
    if sensors.steering_angle_rad != 0.0 or (yaw is not None and yaw != 0.0):
        return local_speeds(car, speed, sensors.steering_angle_rad, yaw)
    return (speed, speed, speed, speed)


class CarLoads(NamedTuple):
    """Vertical loads [N]."""

    loads_n: Four
    """For the car's sum."""
    given_n: OptionalFour
    """What the wheels are given of them."""


def lateral_plausible(sensors: CarSensors) -> bool:
    """Whether the lateral acceleration is no reading, or one of a road car."""
    lateral = sensors.lateral_acceleration_m_s2
    return lateral is None or abs(lateral) <= _STEEPEST


def car_loads(car: Vehicle, known: CarSetup, sensors: CarSensors) -> CarLoads:
    """Vertical loads.

    A wheel computes the load itself, from the filtered acceleration, unless a sensor or a lateral transfer gives it.
    Where the lateral acceleration is no good reading all are NaN, which no wheel takes, used or not.
    """
    loads = known.static_n
    given, accel = sensors.vertical_load_n, sensors.longitudinal_acceleration_m_s2
    lateral = sensors.lateral_acceleration_m_s2
    if not lateral_plausible(sensors):
        return CarLoads(loads, _known(_NO_LOADS))
    if accel is not None and abs(accel) <= _STEEPEST:
        front_n, rear_n = car.wheel_load(True, accel), car.wheel_load(False, accel)
        loads = (front_n, front_n, rear_n, rear_n)
        if lateral is not None:
            loads = _leaning(known, front_n, rear_n, lateral)
            given = _known(_first_known(given, loads))
    if _none_known(given):
        return CarLoads(loads, given)
    total = _first_known(given, loads)
    return CarLoads(total if _all_loaded(total) else known.static_n, given)


def _leaning(known: CarSetup, front_n: float, rear_n: float, lateral_m_s2: float) -> Four:
    """Loads under lateral acceleration [N]."""
    front, rear = known.front_roll_kg * lateral_m_s2, known.rear_roll_kg * lateral_m_s2
    return (
        max(front_n - front, LIFTED_N),
        max(front_n + front, LIFTED_N),
        max(rear_n - rear, LIFTED_N),
        max(rear_n + rear, LIFTED_N),
    )


def _all_loaded(loads_n: Four) -> bool:
    """Whether all loads are finite and above 0."""
    fl, fr, rl, rr = loads_n
    return 0.0 < fl < math.inf and 0.0 < fr < math.inf and 0.0 < rl < math.inf and 0.0 < rr < math.inf


def _first_known(measured: OptionalFour, other: Four) -> Four:
    """Each wheel's measured value, or the other one where there is none."""
    fl, fr, rl, rr = measured
    other_fl, other_fr, other_rl, other_rr = other
    return (
        other_fl if fl is None else fl,
        other_fr if fr is None else fr,
        other_rl if rl is None else rl,
        other_rr if rr is None else rr,
    )


def _none_known(measured: OptionalFour) -> bool:
    """Whether no wheel's value is there."""
    fl, fr, rl, rr = measured
    return fl is None and fr is None and rl is None and rr is None


def _known(values: Four) -> OptionalFour:
    """Values that are there."""
    fl, fr, rl, rr = values
    return (fl, fr, rl, rr)


class CarClaim(NamedTuple):
    """The car's part of `CarEstimate`."""

    TRPAC: float
    TRPAC_std: float
    TRPAC_low: float
    TRPAC_high: float
    TRPAC_expected: float
    TRPAC_expected_std: float
    source: Source


def _by_rule(theta: Four, deviation: Four, loads_n: Four, axle_deviation: float) -> Friction:
    """The car's value of one output of its wheels, each with its standard deviation [-]."""
    fl, fr, rl, rr = theta
    of_fl, of_fr, of_rl, of_rr = deviation
    wheels = (Friction(fl, of_fl), Friction(fr, of_fr), Friction(rl, of_rl), Friction(rr, of_rr))
    return car_friction(wheels, loads_n, axle_deviation)


def car_claim(
    fl: Estimate, fr: Estimate, rl: Estimate, rr: Estimate, loads_n: Four, axle_deviation: float
) -> CarClaim:
    """The car's adhesion from the estimates of its wheels, see `car_friction`."""
    std = (fl.TRPAC_std, fr.TRPAC_std, rl.TRPAC_std, rr.TRPAC_std)
    expected_std = (
        fl.TRPAC_expected_std,
        fr.TRPAC_expected_std,
        rl.TRPAC_expected_std,
        rr.TRPAC_expected_std,
    )
    fused = _by_rule((fl.TRPAC, fr.TRPAC, rl.TRPAC, rr.TRPAC), std, loads_n, axle_deviation)
    low = _by_rule((fl.TRPAC_low, fr.TRPAC_low, rl.TRPAC_low, rr.TRPAC_low), std, loads_n, axle_deviation)
    high = _by_rule(
        (fl.TRPAC_high, fr.TRPAC_high, rl.TRPAC_high, rr.TRPAC_high), std, loads_n, axle_deviation
    )
    expected = _by_rule(
        (fl.TRPAC_expected, fr.TRPAC_expected, rl.TRPAC_expected, rr.TRPAC_expected),
        expected_std,
        loads_n,
        axle_deviation,
    )
    return CarClaim(
        fused.theta,
        fused.deviation,
        low.theta,
        high.theta,
        expected.theta,
        expected.deviation,
        Source(int(fl.source) | int(fr.source) | int(rl.source) | int(rr.source)),
    )


class FourWheels:
    """Four one-wheel estimators that share a camera; each continues when the sensors of another fail.

    A picture is segmented once; the patches of the left and of the right track are classified in one run, and each
    side's verdict goes to its two wheels. A rear wheel reaches the road that was seen a wheelbase later.

    Parameters
    ----------
    config : FourWheelsConfig
        Settings.
    ife : SidesIfe or None
        Classifies pictures; None where only classes come, or nothing.

    Notes
    -----
    In a curve each wheel rolls at the speed of its own place on the rigid car, turned by yaw rate or else steering. A
    measured lateral acceleration moves load between the sides of each axle in the share of the axle's mass.
    """

    def __init__(self, config: FourWheelsConfig, ife: SidesIfe | None = None) -> None:
        self.config = config
        self._ife = ife
        self._wheels = tuple(TrpacEstimator(config.of_wheel(name)) for name in WHEELS)
        self._car = config.wheel.vehicle
        self._known = car_setup(self._car)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        for wheel in self._wheels:
            wheel.reset()
        self._camera = SidesState()
        self._last = self._together([wheel.last for wheel in self._wheels], self._known.static_n, ())

    @property
    def last(self) -> CarEstimate:
        """The estimate of the step before."""
        return self._last

    def step(
        self,
        step_s: float,
        sensors: CarSensors,
        frame: NDArray[np.uint8] | SideClasses | None = None,
        *,
        frame_failed: bool = False,
    ) -> CarEstimate:
        """One step of all wheels; parameters as in `TrpacEstimator.step`, for the whole car.

        Returns
        -------
        CarEstimate
            A wheel whose readings are unusable holds its last good estimate; `problems` has the reason.

        Raises
        ------
        ImageError
            If the picture does not fit the camera; nothing has changed then.
        """
        if step_s > LONGEST_STEP_S:
            self._camera = self._camera.elsewhere()
        left, right = (None, None) if frame is None else self._classes(sensors, frame)
        steering, yaw = sensors.steering_angle_rad, sensors.yaw_rate_rad_s
        speeds_m_s = wheel_speeds(self._car, sensors)
        loads_n, given_n = car_loads(self._car, self._known, sensors)
        estimates, problems = [], []
        for name, wheel, side, omega, torque_nm, wheel_m_s, load_n in zip(
            WHEELS,
            self._wheels,
            (left, right, left, right),
            sensors.wheel_speed_rad_s,
            sensors.wheel_torque_nm,
            speeds_m_s,
            given_n,
            strict=True,
        ):
            accel = sensors.longitudinal_acceleration_m_s2
            of_wheel = Sensors(omega, torque_nm, wheel_m_s, load_n, steering, accel, yaw)
            estimate = wheel.step(step_s, of_wheel, side, frame_failed)
            estimates.append(estimate)
            if estimate.problem is not None:
                problems.append((name, estimate.problem))
        by_subject = self._by_subject(sensors, problems) if problems else ()
        self._last = self._together(estimates, loads_n, by_subject)
        return self._last

    def _together(
        self, estimates: list[Estimate], loads_n: Four, problems: tuple[tuple[str, str], ...]
    ) -> CarEstimate:
        """The wheels' estimates and the car's."""
        fl, fr, rl, rr = estimates
        car = car_claim(fl, fr, rl, rr, loads_n, self.config.axle_deviation)
        return CarEstimate((fl, fr, rl, rr), *car, problems)

    def _by_subject(
        self, sensors: CarSensors, problems: list[tuple[str, str]]
    ) -> tuple[tuple[str, str], ...]:
        """Problems by whom they concern; one that all wheels share is the car's."""
        lateral = sensors.lateral_acceleration_m_s2
        if lateral is not None and not lateral_plausible(sensors):
            expected = f"expected a number within +-{_STEEPEST:g}. Check the signal's source and unit."
            return ((CAR, f"lateral_acceleration_m_s2 is {lateral:g}, {expected}"),)
        texts = {text for _, text in problems}
        if len(problems) == len(WHEELS) and len(texts) == 1:
            return ((CAR, texts.pop()),)
        return tuple(problems)

    def _classes(
        self, sensors: CarSensors, frame: NDArray[np.uint8] | SideClasses | None
    ) -> tuple[RoadClass | None, RoadClass | None]:
        """Results of a new frame for the left and the right track; none where the motion of the car is unknown."""
        if frame is None or isinstance(frame, SideClasses):
            return frame or (None, None)
        if self._ife is None:
            raise TypeError("A picture came, but the estimator was made without an image estimator.")
        if not motion_known(sensors.vehicle_speed_m_s, sensors.steering_angle_rad, sensors.yaw_rate_rad_s):
            return None, None
        accel = sensors.longitudinal_acceleration_m_s2
        front_left, front_right, *_ = self._wheels
        motion = Motion(
            sensors.vehicle_speed_m_s,
            accel if accel is not None and abs(accel) <= _STEEPEST else 0.0,
            sensors.steering_angle_rad,
            sensors.yaw_rate_rad_s,
            0.5 * (front_left.way_m + front_right.way_m),
        )
        self._camera, left, right = self._ife.process(self._camera, frame, motion)
        return self._as_class(left), self._as_class(right)

    def _as_class(self, result: FrameResult) -> RoadClass:
        """A verdict in the form that a wheel takes: its flag is up where the confidence is above the threshold."""
        return RoadClass(result.surface, result.told_by_bus(self.config.wheel.vision.flag_threshold))

    def messages(self) -> dict[str, str]:
        """Warnings about a car that differs from its description, once per axle and subject."""
        fl, fr, rl, rr = (wheel.messages() for wheel in self._wheels)
        return fr | fl | rr | rl

    def state(self) -> dict[str, Any]:
        """All that is remembered as JSON-able values; floats survive the round trip bit by bit."""
        return {
            "wheels": [wheel.state() for wheel in self._wheels],
            "camera": self._camera.to_json(),
            "car": {name: value for name, value in self._last._asdict().items() if name != "wheels"},
        }

    def restore(self, data: Mapping[str, Any]) -> None:
        """Go back to what `state` gave."""
        camera = SidesState.from_json(data["camera"])
        for wheel, saved in zip(self._wheels, data["wheels"], strict=True):
            wheel.restore(saved)
        self._camera = camera
        fl, fr, rl, rr = (wheel.last for wheel in self._wheels)
        car = data["car"]
        source = Source(car["source"])
        problems = tuple((subject, text) for subject, text in car["problems"])
        self._last = CarEstimate(
            **{**car, "wheels": (fl, fr, rl, rr), "source": source, "problems": problems}
        )
