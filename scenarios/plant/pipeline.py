"""The plant: from commanded torque through actuators and dynamics to a trajectory, at once or step by step."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenarios.effects import Effect
from scenarios.effects.base import of_each_wheel
from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, Scenario, VehicleFile
from scenarios.plant import dynamics
from scenarios.plant.parameters import FORCE, POSITION, SPEED, WHEEL, DynamicsParameters, RoadTable, Wheels
from trpac_core.vehicle import GRAVITY_M_S2

Array = NDArray[Any]

NO_SHAFT_NM_RAD = 1e4
"""Torsional stiffness without shafts, which then has no influence [N m/rad]."""


@dataclass(frozen=True)
class PlantTrajectory:
    """The true motion, one row per output step; wheel columns are fl, fr, rl, rr.

    Attributes
    ----------
    time_s, position_m, speed_m_s, accel_x_m_s2 : array, shape (n,)
        Time [s], position [m] and speed [m/s] of the centre of gravity, and what an ideal accelerometer there
        reads, (sum of tyre forces - drag) / m, and gravity's part along the road where the ground holds the car
        on a grade [m/s^2].
    wheel_speed_rad_s, wheel_torque_nm, slip, tyre_force_n, vertical_load_n, theta : array, shape (n, 4)
        Wheel speed [rad/s], commanded torque [N m], unsigned slip [-], F_x [N], F_z [N], adhesion theta at the
        contact [-].
    """

    time_s: Array
    position_m: Array
    speed_m_s: Array
    accel_x_m_s2: Array
    wheel_speed_rad_s: Array
    wheel_torque_nm: Array
    slip: Array
    tyre_force_n: Array
    vertical_load_n: Array
    theta: Array

    def __len__(self) -> int:
        return len(self.time_s)

    def rows(self, stop: int) -> PlantTrajectory:
        """The first `stop` rows."""
        return PlantTrajectory(**{f.name: getattr(self, f.name)[:stop] for f in fields(self)})


@dataclass(frozen=True)
class PlantSetup:
    """Constants of a simulation."""

    parameters: DynamicsParameters
    road: RoadTable


@dataclass(frozen=True)
class PlantState:
    """The plant at one time, for use step by step.

    Attributes
    ----------
    setup : PlantSetup
        Its constants.
    time_s, accel_x_m_s2 : float
        Time [s], and the accelerometer's reading [m/s^2].
    y : array, shape (18,)
        State of the compiled step, see `scenarios.plant.parameters`.
    wheel_torque_nm : tuple
        Torque at the wheels [N m].
    wheels : Wheels
        Forces, loads and slips of the tyres.
    """

    setup: PlantSetup
    time_s: float
    accel_x_m_s2: float
    y: Array
    wheel_torque_nm: tuple[float, float, float, float]
    wheels: Wheels

    @property
    def position_m(self) -> float:
        """Position of the centre of gravity [m]."""
        return float(self.y[POSITION])

    @property
    def speed_m_s(self) -> float:
        """Speed of the centre of gravity [m/s]."""
        return float(self.y[SPEED])

    @property
    def wheel_speed_rad_s(self) -> tuple[float, float, float, float]:
        """Speeds of the four wheels [rad/s]."""
        fl, fr, rl, rr = map(float, self.y[WHEEL:FORCE])
        return fl, fr, rl, rr


def make_setup(vehicle: VehicleFile, road: RoadFile) -> PlantSetup:
    """The dynamics stage of a vehicle and a road, the vehicle's effects on both included."""
    parameters = DynamicsParameters(
        mass_kg=float(vehicle.mass_kg),
        cog_to_front_axle_m=float(vehicle.wheelbase_m - vehicle.cog_to_rear_axle_m),
        cog_to_rear_axle_m=float(vehicle.cog_to_rear_axle_m),
        reference_load_n=0.25 * float(vehicle.mass_kg) * GRAVITY_M_S2,
        wheel_radius_m=of_each_wheel(vehicle.wheel_radius_m),
        lever_m=of_each_wheel(vehicle.wheel_radius_m),
        wheel_inertia_kg_m2=of_each_wheel(vehicle.wheel_inertia_kg_m2),
        longitudinal_stiffness_n=of_each_wheel(vehicle.tyre.longitudinal_stiffness_n),
        rolling_coefficient=of_each_wheel(0.0),
        drag_torque_nm=of_each_wheel(0.0),
        relaxation_m=of_each_wheel(0.0),
        shaft_stiffness_nm_rad=of_each_wheel(NO_SHAFT_NM_RAD),
    )
    table = RoadTable(
        start_m=np.array([s.start_m for s in road.segments], dtype=np.float64),
        theta=np.array([[s.mu_left, s.mu_right] for s in road.segments], dtype=np.float64),
    )
    for effect in vehicle.make_effects():
        parameters, table = effect.dynamics(parameters), effect.road(table)
    return PlantSetup(parameters.as_compiled(), table)


def actual_torque(vehicle: VehicleFile, time_s: Array, wheel_torque_nm: Array) -> Array:
    """Torque at the wheels for a commanded one, both shape (n, 4), at uniform times [N m]."""
    for effect in vehicle.make_effects():
        wheel_torque_nm = effect.actuate(time_s, wheel_torque_nm)
    return wheel_torque_nm


def simulate(
    vehicle: VehicleFile,
    road: RoadFile,
    wheel_torque_nm: ArrayLike,
    step_s: float,
    initial_speed_m_s: float = 0.0,
    initial_position_m: float = 0.0,
) -> PlantTrajectory:
    """The trajectory of a vehicle, at first freely rolling, under a torque history.

    Parameters
    ----------
    vehicle, road : VehicleFile, RoadFile
        The vehicle with its effects, and the road.
    wheel_torque_nm : array, shape (n, 4)
        Commanded torque at the output times, linear between them; below 0 it brakes and holds at rest [N m].
    step_s : float
        Output step [s].
    initial_speed_m_s, initial_position_m : float
        Speed [m/s] and position [m] of the centre of gravity at time 0; the front axle is
        cog_to_front_axle_m ahead of it.

    Raises
    ------
    ScenarioError
        Torque of another shape or not finite; a step that is not positive; a negative initial speed.
    """
    torque = np.ascontiguousarray(wheel_torque_nm, dtype=np.float64)
    problems = _problems(step_s, initial_speed_m_s)
    if torque.ndim != 2 or torque.shape[1] != 4 or len(torque) == 0:
        problems.append(f"wheel_torque_nm has shape {torque.shape}; expected (n, 4) for fl, fr, rl, rr.")
    elif not np.isfinite(torque).all():
        row = int(np.flatnonzero(~np.isfinite(torque).all(axis=1))[0])
        problems.append(f"wheel_torque_nm is not finite at row {row}; expected numbers in N m.")
    if problems:
        raise ScenarioError("\n".join(problems))
    setup = make_setup(vehicle, road)
    time_s: Array = np.arange(len(torque)) * step_s
    actual = actual_torque(vehicle, time_s, torque)
    start = dynamics.initial_y(float(initial_speed_m_s), float(initial_position_m), setup.parameters)
    states, accel, slip, force_n, load_n, theta = dynamics.run(
        start, np.ascontiguousarray(actual), float(step_s), setup.parameters, setup.road
    )
    return PlantTrajectory(
        time_s=time_s,
        position_m=states[:, POSITION],
        speed_m_s=states[:, SPEED],
        accel_x_m_s2=accel,
        wheel_speed_rad_s=states[:, WHEEL:FORCE],
        wheel_torque_nm=torque,
        slip=slip,
        tyre_force_n=force_n,
        vertical_load_n=load_n,
        theta=theta,
    )


def initial_state(
    vehicle: VehicleFile, road: RoadFile, initial_speed_m_s: float = 0.0, initial_position_m: float = 0.0
) -> PlantState:
    """The freely rolling plant at time 0 without torque; raises ScenarioError for a negative speed."""
    problems = _problems(1.0, initial_speed_m_s)
    problems += [
        f"effect {e.id} acts in the actuators and needs the whole torque history; use simulate."
        for e in vehicle.make_effects()
        if type(e).actuate is not Effect.actuate
    ]
    if problems:
        raise ScenarioError("\n".join(problems))
    setup = make_setup(vehicle, road)
    y = dynamics.initial_y(float(initial_speed_m_s), float(initial_position_m), setup.parameters)
    first, _ = dynamics.new_wheels()
    accel = dynamics.refresh(y, 0.0, setup.parameters, setup.road, first)
    return PlantState(setup, 0.0, accel, y, (0.0, 0.0, 0.0, 0.0), first)


def advance(state: PlantState, wheel_torque_nm: ArrayLike, step_s: float) -> PlantState:
    """The plant one step later, with torque going linearly from the state's to this one, shape (4,) [N m]."""
    torque = np.array(wheel_torque_nm, dtype=np.float64)
    problems = _problems(step_s, 0.0)
    if torque.shape != (4,) or not np.isfinite(torque).all():
        problems.append(f"wheel_torque_nm is {wheel_torque_nm!r}; expected four finite numbers in N m.")
    if problems:
        raise ScenarioError("\n".join(problems))
    setup, y = state.setup, state.y.copy()
    first, second = dynamics.new_wheels()
    for own, given in zip(first, state.wheels, strict=True):
        own[:] = given
    accel, _ = dynamics.advance(
        y,
        np.empty_like(y),
        np.array(state.wheel_torque_nm),
        torque,
        float(step_s),
        state.accel_x_m_s2,
        setup.parameters,
        setup.road,
        first,
        second,
        float(step_s),
        1.0,
    )
    fl, fr, rl, rr = map(float, torque)
    return PlantState(setup, state.time_s + step_s, accel, y, (fl, fr, rl, rr), first)


def drive(scenario: Scenario) -> PlantTrajectory:
    """The trajectory of a scenario from standstill, with the front axle at position 0, until its end."""
    time_s: Array = np.arange(round(scenario.end.time_s / scenario.step_s) + 1) * scenario.step_s
    to_front_m = scenario.vehicle.wheelbase_m - scenario.vehicle.cog_to_rear_axle_m
    whole = simulate(
        scenario.vehicle,
        scenario.road,
        scenario.manoeuvre.torque(time_s),
        scenario.step_s,
        initial_position_m=-to_front_m,
    )
    reached = np.flatnonzero(whole.position_m + to_front_m >= scenario.end.position_m)
    return whole.rows(int(reached[0]) + 1) if len(reached) else whole


def _problems(step_s: float, initial_speed_m_s: float) -> list[str]:
    problems = []
    if not (np.isfinite(step_s) and step_s > 0.0):
        problems.append(f"step_s is {step_s}; expected a positive number of seconds.")
    if not (np.isfinite(initial_speed_m_s) and initial_speed_m_s >= 0.0):
        problems.append(
            f"initial_speed_m_s is {initial_speed_m_s}; expected 0 or more, the plant drives forward."
        )
    return problems
