"""Draws a nominal car, the build that it has in truth, its courses, its sensors' noise and its fault.

The recorded car is the project's own plant with another tyre formula, stiffness by load, relaxation, shafts, centre of
gravity, drag and pitch. The diagnosis is told of the nominal car alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.effects import EFFECTS
from scenarios.files import RoadFile, RoadSegment, SensorNoise, SurfaceName, VehicleFile
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log, write_log
from scenarios.yaml_text import to_yaml
from trpac_core.vehicle import GRAVITY_M_S2

Array = NDArray[np.float64]
Values = dict[str, float]

COURSES = ("dry", "mu", "long", "steps")
FIT_S, HOLDOUT_S = 36.0, 22.0
FINE_S, EVERY = 0.002, 5
"""Step of the plant [s], and how many of its rows make one of the log."""
SURFACES: dict[float, SurfaceName] = {0.9: "dry", 0.6: "wet", 0.5: "wet", 0.3: "snow_ice"}


@dataclass(frozen=True)
class Build:
    """The car as it is: effects on top of the nominal car's, their forms, and what its body's pitch adds."""

    effects: dict[str, Values]
    forms: dict[str, str]
    pitch: float


@dataclass(frozen=True)
class Fault:
    """An effect of the library; `lacking` where the simulation forgets what is true of every such car."""

    effect: str
    values: Values
    lacking: bool = False


def draw_nominal(rng: np.random.Generator) -> VehicleFile:
    """A car as its simulation believes it to be: resistances and load transfer are modelled."""
    mass = float(rng.uniform(1000.0, 2300.0))
    wheelbase = float(rng.uniform(2.3, 3.1))
    car = {
        "schema": 1,
        "name": "drawn",
        "mass_kg": mass,
        "wheelbase_m": wheelbase,
        "track_m": 1.5,
        "cog_height_m": float(rng.uniform(0.45, 0.75)),
        "cog_to_rear_axle_m": float(rng.uniform(0.42, 0.58)) * wheelbase,
        "wheel_radius_m": float(rng.uniform(0.28, 0.36)),
        "wheel_inertia_kg_m2": float(rng.uniform(0.8, 2.5)),
        "motor_peak_torque_nm": 0.25 * mass,
        "tyre": {
            "model": "modified_dugoff",
            "longitudinal_stiffness_n": float(rng.uniform(14.0, 26.0)) * mass * GRAVITY_M_S2 / 4.0,
        },
    }
    car["effects"] = {
        "aero_drag": {"drag_area_m2": float(rng.uniform(0.5, 0.95))},
        "rolling_resistance": {"coefficient": float(rng.uniform(0.008, 0.016))},
        "load_transfer": {"cog_height_m": car["cog_height_m"]},
    }
    return VehicleFile.model_validate(car)


def draw_build(rng: np.random.Generator, car: VehicleFile) -> Build:
    """Another tyre, other compliances, resistances that are off by a little."""
    effects = {key: dict(values) for key, values in car.effects.items()}
    forms: dict[str, str] = {}
    effects["tyre_formula"] = {
        "share": 1.0,
        "shape": float(rng.uniform(1.1, 1.75)),
        "curvature": float(rng.uniform(-2.5, 0.6)),
    }
    effects["tyre_stiffness_offset"] = {
        "stiffness_n": car.tyre.longitudinal_stiffness_n * float(np.exp(rng.normal(0.0, 0.2))),
        "by_load": float(rng.uniform(0.4, 1.1)),
    }
    forms["tyre_stiffness_offset"] = "with load"
    effects["tyre_relaxation"] = {"length_m": float(rng.uniform(0.01, 0.12))}
    effects["friction_offset"] = {"factor": float(np.exp(rng.normal(0.0, 0.07)))}
    effects["load_transfer"] = {"cog_height_m": car.cog_height_m * float(rng.uniform(0.9, 1.15))}
    effects["aero_drag"]["drag_area_m2"] *= float(np.exp(rng.normal(0.0, 0.07)))
    effects["rolling_resistance"]["coefficient"] *= float(np.exp(rng.normal(0.0, 0.12)))
    effects["wheel_radius_offset"] = {"radius_m": car.wheel_radius_m * float(1.0 + rng.normal(0.0, 0.0015))}
    effects["mass_offset"] = {"mass_kg": car.mass_kg * float(rng.normal(0.0, 0.006))}
    effects["torque_gain"] = {"factor": float(rng.normal(1.0, 0.006))}
    effects["wheel_inertia_offset"] = {
        "inertia_kg_m2": car.wheel_inertia_kg_m2 * float(np.exp(rng.normal(0.0, 0.1)))
    }
    if rng.random() < 0.4:
        effects["driveline_compliance"] = {
            "stiffness_nm_rad": float(rng.uniform(8e3, 3e4)),
            "damping_nm_s_rad": float(rng.uniform(10.0, 40.0)),
            "motor_inertia_kg_m2": 0.3 * car.wheel_inertia_kg_m2,
        }
    return Build(effects, forms, float(rng.uniform(0.0, 0.04)))


SIZES: dict[str, tuple[tuple[float, float], ...]] = {
    "mass_offset": ((0.08, 0.25), (-0.15, -0.08)),
    "torque_gain": ((0.75, 0.92), (1.08, 1.2)),
    "road_grade": ((0.012, 0.04), (-0.04, -0.012)),
    "torque_lag": ((0.05, 0.15),),
    "torque_delay": ((0.04, 0.12),),
    "wheel_radius_offset": ((0.95, 0.98), (1.02, 1.05)),
    "tyre_stiffness_offset": ((0.45, 0.65),),
    "tyre_relaxation": ((0.3, 0.8),),
    "vehicle_speed_scale": ((0.96, 0.985), (1.015, 1.04)),
    "vehicle_speed_delay": ((0.08, 0.25),),
    "wheel_speed_delay": ((0.04, 0.1),),
    "accelerometer_bias": ((0.15, 0.4), (-0.4, -0.15)),
    "brake_drag": ((15.0, 50.0),),
    "friction_offset": ((0.5, 0.7),),
    "wheel_inertia_offset": ((1.6, 2.6),),
    "aero_drag": ((0.0, 0.0),),
    "rolling_resistance": ((1.8, 3.0),),
}
"""Effects that are drawn as faults, and spans of their sizes: factors of the nominal value, or values."""


def draw_fault(rng: np.random.Generator, car: VehicleFile, effect: str) -> Fault:
    """An effect's parameters within its spans."""
    spans = SIZES[effect]
    size = float(rng.uniform(*spans[int(rng.integers(len(spans)))]))
    name = EFFECTS[effect].parameters()[0].name
    nominal = {
        "mass_offset": car.mass_kg,
        "wheel_radius_offset": car.wheel_radius_m,
        "tyre_stiffness_offset": car.tyre.longitudinal_stiffness_n,
        "wheel_inertia_offset": car.wheel_inertia_kg_m2,
        "rolling_resistance": car.effects["rolling_resistance"]["coefficient"],
    }
    return Fault(effect, {name: size * nominal.get(effect, 1.0)}, lacking=effect == "aero_drag")


def real_car(told: VehicleFile, build: Build, fault: Fault | None) -> VehicleFile:
    """The car that is recorded: its build, and the fault on top of it."""
    effects = {key: dict(values) for key, values in build.effects.items()}
    if fault is not None and not fault.lacking:
        kind = EFFECTS[fault.effect]
        for p in kind.parameters():
            own, value = effects.setdefault(fault.effect, {}), fault.values[p.name]
            neutral = p.neutral_value(told.to_core())
            before = own.get(p.name, neutral)
            if fault.effect == "rolling_resistance":
                own[p.name] = value
            else:  # on top of the build's: by a factor where the neutral value is one to multiply with
                own[p.name] = before * value / neutral if neutral else before + value
    values = told.model_dump(by_alias=True) | {"effects": effects, "forms": build.forms}
    return VehicleFile.model_validate(values)


def told_car(car: VehicleFile, fault: Fault | None) -> VehicleFile:
    """What the user of the simulation believes: without what he forgets, where that is the fault."""
    if fault is None or not fault.lacking:
        return car
    left = {key: values for key, values in car.effects.items() if key != fault.effect}
    return VehicleFile.model_validate(car.model_dump(by_alias=True) | {"effects": left})


def draw_road(rng: np.random.Generator, course: str) -> RoadFile:
    """Dry, or patches of 40 to 90 m where the course is one of them."""
    if course != "mu":
        theta = 0.9 if course != "steps" or rng.random() < 0.5 else 0.6
        surface = SURFACES[theta]
        return RoadFile(
            schema=1, segments=[RoadSegment(start_m=0.0, mu_left=theta, mu_right=theta, surface=surface)]
        )
    segments, start = [], 0.0
    while start < 1500.0:
        theta = float(rng.choice([0.9, 0.9, 0.5, 0.3]))
        segments.append(
            RoadSegment(start_m=round(start, 1), mu_left=theta, mu_right=theta, surface=SURFACES[theta])
        )
        start += float(rng.uniform(40.0, 90.0))
    return RoadFile(schema=1, segments=segments)


def draw_torque(
    rng: np.random.Generator, course: str, car: VehicleFile, road: RoadFile, duration_s: float
) -> tuple[float, Array]:
    """Speed at the start [m/s] and torques, shape (n, 4) [N m], by a driver who only forecasts the speed."""
    n = round(duration_s / FINE_S)
    wanted = np.zeros(n)
    speed = float(rng.uniform(19.0, 26.0) if course == "long" else rng.uniform(8.0, 15.0))
    first, at, v, place = speed, 0, speed, 0.0
    starts = np.array([s.start_m for s in road.segments])
    while at < n:
        hold = round(float(rng.uniform(0.8, 3.0)) / FINE_S)
        here = road.segments[max(int(np.searchsorted(starts, place + 10.0)) - 1, 0)].mu_left
        most = {"dry": 6.0, "mu": 1.05 * here * GRAVITY_M_S2, "long": 2.0, "steps": 4.0}[course]
        brake = v > {"long": 30.0}.get(course, 22.0) or (v > 7.0 and rng.random() < 0.5)
        if v < {"long": 18.0}.get(course, 6.0):
            brake = False
        size = float(rng.uniform(0.15, 1.0)) * (most if brake else min(most, 3.0))
        if rng.random() < 0.25:
            size = 0.0  # coasting
        accel = -size if brake else size
        if course == "steps":
            t = np.arange(hold) * FINE_S
            wanted[at : at + hold] = (accel * np.sign(np.sin(2 * np.pi * rng.uniform(0.3, 3.0) * t)))[
                : n - at
            ]
        else:
            wanted[at : at + hold] = accel
            v = max(v + accel * hold * FINE_S, 3.0)
            if brake:  # not to a halt
                floor = 3.0
                if v <= floor:
                    hold = round(0.5 / FINE_S)
        place += v * hold * FINE_S
        at += hold
    smooth = max(round(float(rng.uniform(0.05, 0.25)) / FINE_S), 1)
    wanted = np.convolve(wanted, np.ones(smooth) / smooth, "same")
    drag = 0.6 * 0.7 * 15.0**2 + 0.012 * car.mass_kg * GRAVITY_M_S2
    total = (car.mass_kg * wanted + np.where(wanted != 0.0, drag, 0.0)) * car.wheel_radius_m
    front = np.where(total < 0.0, rng.uniform(0.55, 0.68), rng.choice([0.5, 0.5, 1.0, 0.0]))
    return first, np.column_stack([0.5 * front, 0.5 * front, 0.5 * (1 - front), 0.5 * (1 - front)]) * total[
        :, None
    ]


def draw_noise(rng: np.random.Generator) -> SensorNoise:
    """Sensors between good and poor ones."""
    size = np.exp(rng.uniform(-0.7, 0.7, 3))
    return SensorNoise(
        wheel_speed_noise_rad_s=0.035 * size[0],
        vehicle_speed_noise_m_s=0.03 * size[1],
        accel_x_noise_m_s2=0.06 * size[2],
    )


def record(
    car: VehicleFile, road: RoadFile, drive: tuple[float, Array], build: Build, noise: SensorNoise, seed: int
) -> pd.DataFrame:
    """The log of one drive."""
    speed, torque = drive
    trajectory = simulate(car, road, torque, FINE_S, initial_speed_m_s=speed)
    log = make_log(trajectory, car, noise, seed).drop(columns="mu_reference")
    log["accel_x_m_s2"] += build.pitch * trajectory.accel_x_m_s2
    return log.iloc[::EVERY]


def write_case(folder: Path, seed: int, effect: str, course: str) -> Mapping[str, object]:
    """Files of one case in the layout of foreign cases: a vehicle, two roads, two logs; returns its truth."""
    rng = np.random.default_rng(seed)
    nominal = draw_nominal(rng)
    build, noise = draw_build(rng, nominal), draw_noise(rng)
    fault = draw_fault(rng, nominal, effect) if effect else None
    told = told_car(nominal, fault)
    car = real_car(nominal, build, fault)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.yaml").write_text(to_yaml(told.model_dump(by_alias=True)), encoding="utf-8")
    for name, seconds, number in (("fit", FIT_S, 0), ("holdout", HOLDOUT_S, 1)):
        road = draw_road(rng, course)
        drive = draw_torque(rng, course, nominal, road, seconds)
        log = record(car, road, drive, build, noise, 10 * seed + number)
        write_log(log, folder / f"{name}.csv")
        (folder / f"road_{name}.yaml").write_text(to_yaml(road.model_dump(by_alias=True)), encoding="utf-8")
    return {
        "effects": [effect] if effect else [],
        "excitation": course,
        "fault": fault.values if fault else {},
        "not_in_vehicle_yaml": [effect] if fault and fault.lacking else [],
        "build": {"effects": build.effects, "pitch": build.pitch},
    }
