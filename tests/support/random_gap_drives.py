"""Random drives of the product's own plant with known effects, on the diagnosis' grid.

They flatter the diagnosis, since plant and library share their forms: its gates were set on opened cases of
`benchmarks/gap/withheld`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.files import RoadFile, VehicleFile, load_vehicle
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import sense
from sim2real.observing.drive import CHANNELS, Drive, grid_step, make_drive
from sim2real.observing.lattice import find_lattice

Array = NDArray[np.float64]
CAR = load_vehicle(Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml")
BARE = CAR.model_copy(update={"effects": {}})


@dataclass(frozen=True)
class Levels:
    """White noise: wheel speed [rad/s], vehicle speed [m/s], accelerometer [m/s^2], position [m]."""

    wheel: float = 0.05
    speed: float = 0.02
    accel: float = 0.08
    position: float = 0.02
    memory_s: float = 0.0


@dataclass(frozen=True)
class Case:
    effects: dict[str, dict[str, float]]
    rich: bool = True
    seed: int = 0
    duration_s: float = 30.0
    rate_hz: float = 500.0
    levels: Levels = field(default_factory=Levels)
    nuisance: dict[str, dict[str, float]] = field(default_factory=dict)
    """Small further effects of the real car that nobody asks for."""


def roads(rich: bool, rng: np.random.Generator) -> RoadFile:
    starts, at = [0.0], 0.0
    while at < 1500.0:
        at += rng.uniform(40.0, 120.0)
        starts.append(round(at, 2))
    kinds = {"dry": 0.9, "wet": 0.5, "snow_ice": 0.3}
    surfaces = [str(rng.choice(list(kinds), p=[0.5, 0.3, 0.2])) if rich else "dry" for _ in starts]
    return RoadFile.model_validate(
        {
            "schema": 1,
            "segments": [
                {"start_m": s, "mu_left": kinds[k], "mu_right": kinds[k], "surface": k}
                for s, k in zip(starts, surfaces, strict=True)
            ],
        }
    )


def torque(rich: bool, duration_s: float, step_s: float, rng: np.random.Generator, v0: float) -> Array:
    """Random phases of drive, coast and brake with the speed kept between 3 and 30 m/s."""
    time = np.arange(round(duration_s / step_s) + 1) * step_s
    knots_t, knots = [0.0], [np.zeros(4)]
    t, v = 0.0, v0

    def phase(hold: float, ramp: float, wheel: Array) -> None:
        nonlocal t, v
        for dt, to in ((ramp, wheel), (hold, wheel)):
            knots_t.append(t + dt)
            knots.append(to)
            t += dt
            v = float(np.clip(v + wheel.sum() / 0.29 / 1400.0 * dt, 0.0, 40.0))

    front = np.array([1.0, 1.0, 1.0, 1.0])
    while t < duration_s:
        if rich:
            kind = rng.choice(
                ["drive", "brake", "limit", "tip", "coast", "multi"], p=[0.3, 0.15, 0.15, 0.15, 0.1, 0.15]
            )
            if v < 6.0:
                kind = "drive"
            elif v > 26.0:
                kind = rng.choice(["brake", "limit"])
            if kind == "drive":
                phase(rng.uniform(0.8, 2.5), rng.uniform(0.1, 0.5), front * rng.uniform(100, 320))
            elif kind == "brake":
                phase(rng.uniform(0.5, 1.5), 0.2, -np.array([1.2, 1.2, 0.8, 0.8]) * rng.uniform(100, 500))
            elif kind == "limit":
                phase(rng.uniform(0.3, 0.8), 0.2, -np.array([1.2, 1.2, 0.8, 0.8]) * rng.uniform(500, 900))
            elif kind == "coast":
                phase(rng.uniform(1.0, 2.5), 0.2, front * 0.0)
            elif kind == "tip":
                for _ in range(3):
                    phase(0.25, 0.05, front * rng.uniform(150, 320))
                    phase(0.25, 0.05, front * rng.uniform(-150, 50))
            else:
                for _ in range(3):
                    phase(rng.uniform(0.3, 0.8), 0.1, front * rng.uniform(-200, 320))
        else:
            level = rng.uniform(10, 60) if v < 15.0 else rng.uniform(-60, 20)
            phase(rng.uniform(2.0, 5.0), 1.0, front * level)
    return np.column_stack([np.interp(time, knots_t, np.array(knots)[:, i]) for i in range(4)])


def drives(case: Case, count: int = 3) -> list[Drive]:
    """The case's logs, already on the diagnosis' grid."""
    rng = np.random.default_rng(case.seed)
    car = VehicleFile.model_validate(
        {**BARE.model_dump(by_alias=True), "effects": {**case.nuisance, **case.effects}}
    )
    out = []
    for number in range(count):
        out.append(_drive(case, car, rng, f"log{number}"))
    return out


def _drive(case: Case, car: VehicleFile, rng: np.random.Generator, name: str) -> Drive:
    fine = 1e-3
    road = roads(case.rich, rng)
    v0 = float(rng.uniform(3.0, 20.0))
    commanded = torque(case.rich, case.duration_s, fine, rng, v0)
    run = simulate(car, road, commanded, fine, v0, 0.0)
    columns = {
        "position_m": run.position_m,
        "vehicle_speed_m_s": run.speed_m_s,
        **{
            f"wheel_speed_{w}_rad_s": run.wheel_speed_rad_s[:, i]
            for i, w in enumerate(("fl", "fr", "rl", "rr"))
        },
        "accel_x_m_s2": run.accel_x_m_s2,
    }
    columns = sense(car, run.time_s, columns)
    every = round(1.0 / case.rate_hz / fine)
    time, commanded = run.time_s[::every], commanded[::every]
    levels = case.levels
    deviation = [levels.position, levels.speed, *[levels.wheel] * 4, levels.accel]
    measured = {}
    for key, sd in zip(CHANNELS, deviation, strict=True):
        noise = rng.standard_normal(len(time))
        if levels.memory_s:
            rho = np.exp(-1.0 / case.rate_hz / levels.memory_s)
            for k in range(1, len(noise)):
                noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho * rho) * noise[k]
        measured[key] = columns[key][::every] + sd * noise
    table = {
        **measured,
        **{f"wheel_torque_{w}_nm": commanded[:, i] for i, w in enumerate(("fl", "fr", "rl", "rr"))},
    }
    wheels = [table[f"wheel_speed_{w}_rad_s"] for w in ("fl", "fr", "rl", "rr")]
    lattice = find_lattice(time, wheels)
    factor = max(round(grid_step(case.rate_hz) * case.rate_hz), 1)
    n = len(time) // factor
    time, table = _means(time, n, factor), {key: _means(values, n, factor) for key, values in table.items()}
    return make_drive(name, road, time, table, lattice=lattice)


def _means(values: Array, n: int, factor: int) -> Array:
    return values[: n * factor].reshape(n, factor).mean(axis=1)


SEVERITY = {
    "aero_drag": lambda s: {"drag_area_m2": 3.0 * s},
    "rolling_resistance": lambda s: {"coefficient": 0.1 * s},
    "road_grade": lambda s: {"grade": 0.2 * s},
    "mass_offset": lambda s: {"mass_kg": 600.0 * s},
    "wheel_radius_offset": lambda s: {"radius_m": 0.29 * (1.0 - 0.15 * s)},
    "wheel_inertia_offset": lambda s: {"inertia_kg_m2": 1.2 * (1.0 + 3.0 * s)},
    "load_transfer": lambda s: {"cog_height_m": 0.9 * s},
    "tyre_relaxation": lambda s: {"length_m": 1.2 * s},
    "tyre_stiffness_offset": lambda s: {"stiffness_n": 50e3 * (1.0 - 0.7 * s)},
    "friction_falloff": lambda s: {"falloff_s_m": 0.3 * s, "floor": 0.5},
    "friction_offset": lambda s: {"factor": 1.0 - 0.6 * s},
    "torque_lag": lambda s: {"time_constant_s": 0.4 * s},
    "torque_delay": lambda s: {"delay_s": 0.25 * s},
    "torque_gain": lambda s: {"factor": 1.0 - 0.4 * s},
    "brake_drag": lambda s: {"torque_nm": 80.0 * s},
    "driveline_compliance": lambda s: {
        "stiffness_nm_rad": 20000.0 * (1.0 - 0.95 * s), "damping_nm_s_rad": 10.0, "motor_inertia_kg_m2": 0.8},
    "wheel_speed_delay": lambda s: {"delay_s": 0.2 * s},
    "vehicle_speed_delay": lambda s: {"delay_s": 0.3 * s},
    "vehicle_speed_scale": lambda s: {"factor": 1.0 + 0.15 * s},
    "accelerometer_bias": lambda s: {"bias_m_s2": 1.5 * s},
    "wheel_speed_quantisation": lambda s: {"teeth": max(round(60 / s / 10), 1), "window_s": 0.04},
    "mu_split": lambda s: {"left_factor": 1.0 - 0.7 * s, "right_factor": 1.0},
}  # fmt: skip
"""One direction of each effect from nothing (0) to a lot (1)."""
