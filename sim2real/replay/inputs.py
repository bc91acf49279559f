"""From a log and a car file to what the estimators of four wheels read, row by row."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenarios.effects.base import mean_of_wheels
from scenarios.files import RoadFile, RoadSegment, VehicleFile
from sim2real.adequacy import contradiction
from sim2real.logs import Log, LogError, resample, with_way
from sim2real.observing.drive import ACCEL, CHANNELS, SPEED, WHEEL, Drive, make_drive
from sim2real.observing.noise import RESOLUTION
from sim2real.observing.observer import Simulation
from trpac_core.estimator import LOCKED_M_S, EstimatorConfig
from trpac_core.local_speed import local_speeds
from trpac_core.vehicle import WHEELS, Vehicle

Array = NDArray[np.float64]

LEAST_MOVING_S = 1.0
"""A log whose car moves for less than this has nothing to estimate from [s]."""
SECOND_DIFFERENCE = 6.0**0.5
"""Standard deviation of the second difference of white noise of deviation 1 [-]."""
TO_SIGMA = 1.4826
"""From the median size of normal values to their standard deviation [-]."""
ANY_ROAD = RoadFile(schema=1, segments=[RoadSegment(start_m=0.0, mu_left=0.8, mu_right=0.8, surface="dry")])
"""The plant's parameters are asked for with a road, which changes nothing of the car's."""


@dataclass(frozen=True)
class Noise:
    """White noise per sample, read from the log.

    Attributes
    ----------
    wheel_speed_rad_s, vehicle_speed_m_s : float
        Of the wheel speeds (their median) and the vehicle speed [rad/s], [m/s].
    sliding_speed_m_s : array, shape (4,)
        Of omega R - v, wheel by wheel [m/s].
    """

    wheel_speed_rad_s: float
    vehicle_speed_m_s: float
    sliding_speed_m_s: Array


@dataclass(frozen=True)
class Inputs:
    """What the estimators are told; wheel columns are fl, fr, rl, rr.

    Attributes
    ----------
    vehicle : Vehicle
        The car with its file's effects in it.
    time_s, position_m, speed_m_s : array, shape (n,)
        Uniform time [s], place [m] and speed [m/s] of the centre of gravity.
    wheel_speed_rad_s, wheel_torque_nm : array, shape (n, 4)
        NaN where there is nothing to estimate from: lost samples, and the torque of a locked wheel.
    accel_m_s2 : array, shape (n,), or None
        Accelerometer; None where the log has none of its own.
    steering_angle_rad : array, shape (n,)
        0 where not measured: straight on.
    yaw_rate_rad_s : array, shape (n,)
        NaN where not measured: the steering angle tells the curve.
    mu_reference : array, shape (n,), or None
        Measured peak friction under the front wheels [-].
    noise : Noise
        Of the speeds.
    warnings : tuple of str
        What was made of the log, in sentences.
    contradiction : str or None
        The sentence that the torque does not fit the car, see `sim2real.adequacy.contradiction`.
    """

    vehicle: Vehicle
    time_s: Array
    position_m: Array
    speed_m_s: Array
    wheel_speed_rad_s: Array
    wheel_torque_nm: Array
    accel_m_s2: Array | None
    steering_angle_rad: Array
    yaw_rate_rad_s: Array
    mu_reference: Array | None
    noise: Noise
    warnings: tuple[str, ...]
    contradiction: str | None = None

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """Step [s]."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Rows in which slip can be told: the car is faster than the estimator's floor."""
        return np.nan_to_num(self.speed_m_s) > EstimatorConfig.floor_m_s

    @cached_property
    def local_speed_m_s(self) -> Array:
        """Speed of the road under each wheel, shape (n, 4): in a curve the wheels' are unlike [m/s]."""
        motion = np.column_stack([self.speed_m_s, self.steering_angle_rad, self.yaw_rate_rad_s]).tolist()
        return np.array(
            [
                local_speeds(self.vehicle, v, angle, None if math.isnan(yaw) else yaw)
                for v, angle, yaw in motion
            ]
        )

    def load_n(self) -> Array:
        """Vertical loads as the estimators without a load sensor reckon them, shape (n, 4) [N]."""
        measured = self.accel_m_s2
        accel = np.gradient(self.speed_m_s, self.step_s) if measured is None else measured
        filled = np.nan_to_num(accel)
        front, rear = (
            self.vehicle.wheel_load(is_front)
            + filled * (self.vehicle.wheel_load(is_front, 1.0) - self.vehicle.wheel_load(is_front))
            for is_front in (True, False)
        )
        return np.maximum(np.column_stack([front, front, rear, rear]), 1.0)


def make_inputs(log: Log, vehicle: VehicleFile) -> Inputs:
    """The estimators' inputs of a log.

    The effects that the car file switches on are put where the estimator has a place for them: into its vehicle, on the
    torque, or undone on the readings, as `sim2real.how_far.trpac_error` does. Load transfer is always there; its height
    is that of the file's centre of gravity where the effect does not say another.

    Raises
    ------
    LogError
        The car hardly moves.
    """
    log = with_way(log)
    step_s = float(np.median(np.diff(log.time_s)))
    time_s, signals = resample(log, step_s)
    drive = make_drive(log.name, ANY_ROAD, time_s, signals, log.derived)
    model = Simulation(vehicle)
    parameters, _ = model.setup(ANY_ROAD)
    columns = {name: drive.measured[:, i] for i, name in enumerate(CHANNELS)}
    for effect in reversed(model.effects):
        columns = effect.correct(time_s, columns)
    torque_nm = _known_torque(signals)
    for effect in model.effects:
        torque_nm = effect.actuate(time_s, torque_nm)
    wheels = np.column_stack([columns[name] for name in CHANNELS[WHEEL]])
    speed = columns[CHANNELS[SPEED]]
    torque_nm = torque_nm - np.where(wheels > 0.0, mean_of_wheels(parameters.drag_torque_nm), 0.0)
    car = replace(
        vehicle.to_core(),
        mass_kg=parameters.mass_kg,
        cog_height_m=parameters.transfer_height_m or vehicle.cog_height_m,
        wheel_radius_m=mean_of_wheels(parameters.wheel_radius_m),
        wheel_inertia_kg_m2=mean_of_wheels(parameters.wheel_inertia_kg_m2),
        longitudinal_stiffness_n=mean_of_wheels(parameters.longitudinal_stiffness_n),
        rolling_resistance=mean_of_wheels(parameters.rolling_coefficient),
    )
    locked = (wheels * car.wheel_radius_m < LOCKED_M_S) & (speed > EstimatorConfig.floor_m_s)[:, None]
    zero = np.zeros(len(time_s))
    made = Inputs(
        vehicle=car,
        time_s=time_s,
        position_m=signals["position_m"],
        speed_m_s=speed,
        wheel_speed_rad_s=wheels,
        wheel_torque_nm=np.where(locked, np.nan, torque_nm),
        accel_m_s2=columns[CHANNELS[ACCEL]] if drive.counted[ACCEL] else None,
        steering_angle_rad=np.nan_to_num(signals.get("steering_angle_rad", zero)),
        yaw_rate_rad_s=signals.get("yaw_rate_rad_s", np.full(len(time_s), np.nan)),
        mu_reference=signals.get("mu_reference"),
        noise=_noise(drive, wheels, speed, car.wheel_radius_m),
        warnings=_warnings(log, locked, step_s),
        contradiction=contradiction(
            model, drive, whole=not any(name.startswith("wheel_torque") for name in log.derived)
        ),
    )
    moved_s = np.count_nonzero(made.moving) * step_s
    if moved_s < LEAST_MOVING_S:
        raise LogError(
            f"{log.path}: the car is faster than {EstimatorConfig.floor_m_s:g} m/s for {moved_s:.2g} s; expected at "
            f"least {LEAST_MOVING_S:g} s of driving."
        )
    return made


def _known_torque(signals: dict[str, Array]) -> Array:
    return np.column_stack([signals[f"wheel_torque_{w}_nm"] for w in WHEELS])


def _noise(drive: Drive, wheels: Array, speed: Array, radius_m: float) -> Noise:
    moving = drive.moving
    floor_wheel, floor_speed = float(RESOLUTION[WHEEL][0]), float(RESOLUTION[SPEED])
    of_wheels = [white_noise(wheels[moving, i]) for i in range(len(WHEELS))]
    sliding = [white_noise((wheels[:, i] * radius_m - speed)[moving]) for i in range(len(WHEELS))]
    return Noise(
        max(float(np.median(of_wheels)), floor_wheel),
        max(white_noise(speed[moving]), floor_speed),
        np.maximum(sliding, np.hypot(floor_speed, radius_m * floor_wheel)),
    )


def white_noise(values: Array) -> float:
    """Standard deviation of a signal's noise from row to row, whatever slow course it rides on.

    The median size of second differences: what a car does changes slowly or rarely from sample to sample. A signal
    that stands still most of the time is rounded: then the rounding's own deviation.
    """
    values = values[np.isfinite(values)]
    if len(values) < 3:
        return 0.0
    jump = np.abs(np.diff(values))
    if np.median(jump) == 0.0:
        return float(np.median(jump[jump > 0.0])) / 12.0**0.5 if jump.any() else 0.0
    return TO_SIGMA * float(np.median(np.abs(np.diff(values, 2)))) / SECOND_DIFFERENCE


def _warnings(log: Log, locked: NDArray[np.bool_], step_s: float) -> tuple[str, ...]:
    said = list(log.warnings)
    locked_s = np.count_nonzero(locked, axis=0) * step_s
    if locked_s.any():
        said.append(
            "wheels lock for "
            + ", ".join(f"{s:.1f} s ({w})" for w, s in zip(WHEELS, locked_s, strict=True) if s)
            + ": the brake torque of a locked wheel is not its tyre torque, so the estimate is held."
        )
    constant = sorted(name for name in log.derived if name.startswith("wheel_torque"))
    if constant:
        said.append(
            f"{', '.join(constant)}: not measured, so there is no estimate from tyre forces at that wheel."
        )
    return tuple(said)
