"""The plant as an observer along a log: its states follow the measurements softly, its residuals show its errors.

An open-loop simulation drifts from the log, and at a locking or spinning wheel it runs away from it; a simulation that
is set to the measured state at each row hides what builds up slowly. In between, each state is drawn to its
measurement with a memory of `MEMORY_S`: with the right model the residuals are sensor noise, and a wrong acceleration
shows as a residual of itself times the memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import EFFECTS, Effect
from scenarios.effects.base import mean_of_wheels
from scenarios.effects.wheel_speed_quantisation import WheelSpeedQuantisation
from scenarios.files import RoadFile, VehicleFile
from scenarios.plant import dynamics
from scenarios.plant.parameters import DynamicsParameters, RoadTable
from scenarios.plant.pipeline import make_setup
from sim2real.observing.drive import ACCEL, CHANNELS, Drive
from sim2real.observing.lattice import SmoothCounter

Array = NDArray[np.float64]

MEMORY_S = np.array([1.0, 1.0, 0.1, 0.1, 0.1, 0.1])
"""Memory of position, vehicle speed and wheel speeds [s]: the wheels' is short, since they diverge within
tenths of a second where the tyre slides."""
COUNTED_S_PER_RAD_S, LONGEST_COUNTED_S = 0.4, 1.0
"""Memory of wheels that a counter rounds: so much for each rad/s of a step, since steps that a wheel is drawn to would
push the car by its tyres, and the longest [s]."""


@dataclass(frozen=True)
class Push:
    """An input from outside the model, over the rows of one drive: what an unknown term would do.

    Attributes
    ----------
    torque_nm : array, shape (n, 4)
        On top of the wheels' torque [N m].
    accel_m_s2 : array, shape (n,)
        On top of the car's acceleration; `felt` says whether the accelerometer reads it (a force does, gravity
        does not) [m/s^2].
    felt : bool
        See there.
    offset : array, shape (n, 7)
        On top of what the sensors read, in each channel's unit.
    """

    torque_nm: Array
    accel_m_s2: Array
    felt: bool
    offset: Array


@dataclass(frozen=True)
class Towards:
    """Models that a model varies towards, along one drive: they differ from it in the values of its effects.

    Attributes
    ----------
    models : tuple of Simulation
        m of them.
    shares : array, shape (n, m)
        How far it is towards each, row by row: 0 itself, 1 the other, beyond as well [-].
    """

    models: tuple[Simulation, ...]
    shares: Array

    def mixed(self, columns: Sequence[dict[str, Array]]) -> dict[str, Array]:
        """Columns of the model itself and of the others, as they are between them."""
        own, *others = columns
        if not others:
            return own
        mixed = {}
        for name, values in own.items():
            shares = self.shares.reshape(len(values), -1, *(1,) * (values.ndim - 1))
            steps = np.stack([other[name] - values for other in others], axis=1)
            mixed[name] = values + np.sum(shares * steps, axis=1)
        return mixed


@dataclass(frozen=True)
class Prediction:
    """What the model predicts row by row from all rows before.

    Attributes
    ----------
    channels : array, shape (n, 7)
        The channels as their sensors would read them.
    states : array, shape (n, 6)
        Position [m], vehicle speed [m/s], wheel speeds [rad/s], before any sensor.
    slip, force_n, load_n, theta : array, shape (n, 4)
        Of the tyres: unsigned slip [-], F_x [N], F_z [N], theta [-].
    """

    channels: Array
    states: Array
    slip: Array
    force_n: Array
    load_n: Array
    theta: Array


class Simulation:
    """The simulation model of a car: its file, and effects on top of those that the file switches on.

    Parameters
    ----------
    vehicle : VehicleFile
        The car; its own effects are kept unless `effects` holds one of the same id.
    effects : iterable of Effect
        What is added.
    """

    def __init__(self, vehicle: VehicleFile, effects: Iterable[Effect] = ()) -> None:
        chosen = {effect.id: _foretold(effect) for effect in (*vehicle.make_effects(), *effects)}
        self.vehicle = vehicle
        self.effects = tuple(chosen[key] for key in EFFECTS if key in chosen)
        self._bare = vehicle.model_copy(update={"effects": {}, "forms": {}})

    def has(self, effect_id: str) -> bool:
        """Whether the model has an effect already."""
        return any(effect.id == effect_id for effect in self.effects)

    def with_effects(self, *effects: Effect) -> Simulation:
        """The model with these effects added."""
        return Simulation(self.vehicle, (*self.effects, *effects))

    def setup(self, road: RoadFile) -> tuple[DynamicsParameters, RoadTable]:
        """The compiled step's inputs on a road."""
        bare = make_setup(self._bare, road)
        parameters, table = bare.parameters, bare.road
        for effect in self.effects:
            parameters, table = effect.dynamics(parameters), effect.road(table)
        return parameters.as_compiled(), table

    def predict(self, drive: Drive, push: Push | None = None, towards: Towards | None = None) -> Prediction:
        """Follow a drive."""
        blend = towards or Towards((), np.zeros((len(drive), 0)))
        models = (self, *blend.models)
        setups = [model.setup(drive.road) for model in models]
        seen = drive.measured - push.offset if push else drive.measured
        measured = {name: seen[:, i] for i, name in enumerate(CHANNELS)}
        columns = blend.mixed([model.corrected(drive.time_s, measured) for model in models])
        torque = blend.mixed([{"": model.actuated(drive.time_s, drive.torque_nm)} for model in models])[""]
        states, accel, slip, force_n, load_n, theta = dynamics.follow(
            start(columns, drive.step_s, setups[0][0]),
            np.ascontiguousarray(torque + push.torque_nm if push else torque),
            push.accel_m_s2 if push else np.zeros(len(drive)),
            np.column_stack([columns[name] for name in CHANNELS[:6]]),
            self._memory_s,
            drive.step_s,
            np.array([parameters.as_row() for parameters, _ in setups]),
            setups[0][1].start_m,
            np.array([table.theta for _, table in setups]),
            blend.shares,
        )
        if push and push.felt:
            accel = accel + push.accel_m_s2
        said = blend.mixed([model.sensed(drive.time_s, states, accel) for model in models])
        channels = np.column_stack([said[name] for name in CHANNELS])
        if push:
            channels = channels + push.offset
        return Prediction(channels, states, slip, force_n, load_n, theta)

    @property
    def _memory_s(self) -> Array:
        """Memory of position, speed and wheel speeds [s]."""
        steps = [effect.step_rad_s for effect in self.effects if isinstance(effect, SmoothCounter)]
        memory_s = MEMORY_S.copy()
        memory_s[2:] = np.clip(COUNTED_S_PER_RAD_S * max(steps, default=0.0), MEMORY_S[2:], LONGEST_COUNTED_S)
        return memory_s

    def actuated(self, time_s: Array, torque_nm: Array) -> Array:
        """What the actuators make of a commanded torque, shape (n, 4) [N m]."""
        for effect in self.effects:
            torque_nm = effect.actuate(time_s, torque_nm)
        return torque_nm

    def corrected(self, time_s: Array, columns: dict[str, Array]) -> dict[str, Array]:
        """What ideal sensors would have read in place of these."""
        for effect in reversed(self.effects):
            columns = effect.correct(time_s, columns)
        return columns

    def sensed(self, time_s: Array, states: Array, accel: Array) -> dict[str, Array]:
        """What the sensors read of these states, shape (n, 6), and this acceleration."""
        columns = {name: states[:, i] for i, name in enumerate(CHANNELS[:6])}
        columns[CHANNELS[ACCEL]] = accel
        for effect in self.effects:
            columns = effect.sense(time_s, columns)
        return columns


def _foretold(effect: Effect) -> Effect:
    """An effect as a prediction can take it."""
    if isinstance(effect, WheelSpeedQuantisation) and not isinstance(effect, SmoothCounter):
        return SmoothCounter(effect.teeth, effect.window_s)
    return effect


def start(columns: dict[str, Array], step_s: float, p: DynamicsParameters) -> Array:
    """The plant's state at the first row: straight lines through the first tenth of a second of each channel."""
    count = max(round(0.1 / step_s), 5)
    position_m, speed, *wheels = _at_first_row(
        np.column_stack([columns[name][:count] for name in CHANNELS[:6]])
    )
    if not np.isfinite(position_m):
        position_m = _before_first_fix(columns["position_m"], columns["vehicle_speed_m_s"], step_s, count)
    rims_m_s = np.array(wheels) * mean_of_wheels(p.wheel_radius_m)
    if not np.isfinite(speed) and np.isfinite(rims_m_s).any():  # not measured yet: as fast as the wheels roll
        speed = float(np.nanmean(rims_m_s))
    y = dynamics.initial_y(max(np.nan_to_num(speed), 0.0), position_m, p)
    for i, value in enumerate(wheels):
        if np.isfinite(value):
            y[2 + i] = max(value, 0.0)
    return y


def _before_first_fix(position_m: Array, speed_m_s: Array, step_s: float, count: int) -> float:
    """Position at the first row, from the first few that are known and the way to them; 0 where none is [m]."""
    fixes = np.flatnonzero(np.isfinite(position_m))[:count]
    known = np.flatnonzero(np.isfinite(speed_m_s))
    if not len(fixes):
        return 0.0
    way_m = np.zeros(len(position_m))
    if len(known):
        speed = np.interp(np.arange(len(position_m)), known, speed_m_s[known])
        way_m[1:] = np.cumsum(0.5 * (speed[1:] + speed[:-1])) * step_s
    return float(np.mean(position_m[fixes] - way_m[fixes]))


def _at_first_row(values: Array) -> list[float]:
    """Each column at its first row by a straight line through all of it; NaN where fewer than three are there."""
    good = np.isfinite(values)
    number = np.maximum(good.sum(axis=0), 1)
    known = np.where(good, values, 0.0)
    row = good * np.arange(len(values))[:, None]
    middle, mean = row.sum(axis=0) / number, known.sum(axis=0) / number
    apart = np.where(good, row - middle, 0.0)
    slope = (apart * known).sum(axis=0) / np.maximum((apart**2).sum(axis=0), 1e-12)
    return [float(v) for v in np.where(number >= 3, mean - slope * middle, np.nan)]
