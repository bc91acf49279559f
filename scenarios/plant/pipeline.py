"""The plant as a whole: commanded torque through actuators and dynamics to a trajectory, or step by step."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenarios.effects import Effect
from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, Scenario, VehicleFile
from scenarios.plant import dynamics
from scenarios.plant.dynamics import DynamicsParameters, RoadTable, Wheels

Array = NDArray[Any]


@dataclass(frozen=True)
class PlantTrajectory:
    """The true motion, one row per output step; wheel columns are fl, fr, rl, rr.

    Attributes
    ----------
    time_s, position_m, speed_m_s, accel_x_m_s2 : array, shape (n,)
        Time [s], position [m] and speed [m/s] of the centre of gravity, and what an ideal accelerometer there
        reads, (sum of tyre forces - drag) / m [m/s^2].
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
    """What stays constant while the plant runs."""

    parameters: DynamicsParameters
    road: RoadTable


@dataclass(frozen=True)
class PlantState:
    """The plant at one time, for use step by step; wheels holds what the tyres do then, in arrays to read."""

    setup: PlantSetup
    time_s: float
    position_m: float
    speed_m_s: float
    accel_x_m_s2: float
    wheel_speed_rad_s: tuple[float, float, float, float]
    wheel_torque_nm: tuple[float, float, float, float]
    wheels: Wheels


def make_setup(vehicle: VehicleFile, road: RoadFile) -> PlantSetup:
    """The dynamics stage of a vehicle, its effects included, on a road."""
    parameters = DynamicsParameters(
        mass_kg=float(vehicle.mass_kg),
        cog_to_front_axle_m=float(vehicle.wheelbase_m - vehicle.cog_to_rear_axle_m),
        cog_to_rear_axle_m=float(vehicle.cog_to_rear_axle_m),
        wheel_radius_m=float(vehicle.wheel_radius_m),
        wheel_inertia_kg_m2=float(vehicle.wheel_inertia_kg_m2),
        longitudinal_stiffness_n=float(vehicle.tyre.longitudinal_stiffness_n),
    )
    for effect in vehicle.make_effects():
        parameters = effect.dynamics(parameters)
    table = RoadTable(
        start_m=np.array([s.start_m for s in road.segments], dtype=np.float64),
        theta=np.array([[s.mu_left, s.mu_right] for s in road.segments], dtype=np.float64),
    )
    return PlantSetup(DynamicsParameters(*map(float, parameters)), table)


def simulate(
    vehicle: VehicleFile,
    road: RoadFile,
    wheel_torque_nm: ArrayLike,
    step_s: float,
    initial_speed_m_s: float = 0.0,
    initial_position_m: float = 0.0,
) -> PlantTrajectory:
    """Drive a vehicle, at first freely rolling, with a given torque history.

    Parameters
    ----------
    vehicle, road : VehicleFile, RoadFile
        What is driven, with its effects, and where.
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
    actual = torque
    for effect in vehicle.make_effects():
        actual = effect.actuate(time_s, actual)
    start = np.empty(6)
    start[0], start[1] = initial_position_m, initial_speed_m_s
    start[2:] = initial_speed_m_s / setup.parameters.wheel_radius_m
    states, accel, slip, force_n, load_n, theta = dynamics.run(
        start, np.ascontiguousarray(actual), float(step_s), setup.parameters, setup.road
    )
    return PlantTrajectory(
        time_s=time_s,
        position_m=states[:, 0],
        speed_m_s=states[:, 1],
        accel_x_m_s2=accel,
        wheel_speed_rad_s=states[:, 2:],
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
    wheel = float(initial_speed_m_s) / setup.parameters.wheel_radius_m
    first, _ = dynamics.new_wheels()
    y = np.array([initial_position_m, initial_speed_m_s, wheel, wheel, wheel, wheel], dtype=np.float64)
    dynamics.look_up_theta(y[0], setup.parameters, setup.road, first.theta)
    accel = dynamics.forces(y, 0.0, setup.parameters, first)
    return _state(setup, 0.0, y, accel, np.zeros(4), first)


def advance(state: PlantState, wheel_torque_nm: ArrayLike, step_s: float) -> PlantState:
    """The plant one step later, with torque going linearly from the state's to this one, shape (4,) [N m]."""
    torque = np.array(wheel_torque_nm, dtype=np.float64)
    problems = _problems(step_s, 0.0)
    if torque.shape != (4,) or not np.isfinite(torque).all():
        problems.append(f"wheel_torque_nm is {wheel_torque_nm!r}; expected four finite numbers in N m.")
    if problems:
        raise ScenarioError("\n".join(problems))
    setup = state.setup
    y = np.array([state.position_m, state.speed_m_s, *state.wheel_speed_rad_s])
    first, second = dynamics.new_wheels()
    for own, given in zip(first, state.wheels, strict=True):
        own[:] = given
    accel = dynamics.advance(
        y,
        np.empty(6),
        np.array(state.wheel_torque_nm),
        torque,
        float(step_s),
        state.accel_x_m_s2,
        setup.parameters,
        setup.road,
        first,
        second,
    )
    return _state(setup, state.time_s + step_s, y, accel, torque, first)


def _state(
    setup: PlantSetup, time_s: float, y: Array, accel: float, torque: Array, wheels: Wheels
) -> PlantState:
    omega, command = tuple(map(float, y[2:])), tuple(map(float, torque))
    return PlantState(
        setup=setup,
        time_s=time_s,
        position_m=float(y[0]),
        speed_m_s=float(y[1]),
        accel_x_m_s2=accel,
        wheel_speed_rad_s=(omega[0], omega[1], omega[2], omega[3]),
        wheel_torque_nm=(command[0], command[1], command[2], command[3]),
        wheels=wheels,
    )


def drive(scenario: Scenario) -> PlantTrajectory:
    """Drive a scenario from standstill with the front axle at the road's zero until its end."""
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
