"""Cars and roads as their files describe them: what the simulation is given, and what the real car deviates from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import yaml
from numpy.random import Generator

Effects = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Car:
    """vehicle.yaml; SI units."""

    mass_kg: float = 1343.8
    wheelbase_m: float = 2.305
    cog_height_m: float = 0.54
    cog_to_rear_axle_m: float = 1.193
    wheel_radius_m: float = 0.29
    wheel_inertia_kg_m2: float = 1.2
    motor_peak_torque_nm: float = 320.0
    stiffness_n: float = 50_000.0
    modelled: Effects = field(default_factory=dict)
    """Effects that the simulation has already, with their true parameters."""

    def write(self, path: Path) -> None:
        """As the contract's file."""
        content = {
            "schema": 1,
            "name": "withheld-car",
            "mass_kg": self.mass_kg,
            "wheelbase_m": self.wheelbase_m,
            "track_m": 1.45,
            "cog_height_m": self.cog_height_m,
            "cog_to_rear_axle_m": self.cog_to_rear_axle_m,
            "wheel_radius_m": self.wheel_radius_m,
            "wheel_inertia_kg_m2": self.wheel_inertia_kg_m2,
            "motor_peak_torque_nm": self.motor_peak_torque_nm,
            "tyre": {"model": "modified_dugoff", "longitudinal_stiffness_n": self.stiffness_n},
            "effects": self.modelled,
        }
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


@dataclass(frozen=True)
class Road:
    """road.yaml: friction from each start on, equal left and right."""

    start_m: tuple[float, ...] = (0.0,)
    mu: tuple[float, ...] = (0.9,)

    def write(self, path: Path) -> None:
        """As the contract's file."""
        segments = [
            {"start_m": start, "mu_left": mu, "mu_right": mu, "surface": _surface(mu)}
            for start, mu in zip(self.start_m, self.mu, strict=True)
        ]
        path.write_text(
            yaml.safe_dump({"schema": 1, "segments": segments}, sort_keys=False), encoding="utf-8"
        )


def _surface(mu: float) -> str:
    return "dry" if mu >= 0.75 else "wet" if mu >= 0.42 else "snow_ice"


def draw_car(rng: Generator, without: tuple[str, ...]) -> Car:
    """A passenger car; the simulation of every other one models resistances and load transfer, but those `without`."""
    wheelbase = rng.uniform(2.3, 2.8)
    height = rng.uniform(0.48, 0.62)
    modelled: Effects = {}
    if rng.random() < 0.5:
        modelled = {
            "load_transfer": {"cog_height_m": round(height, 3)},
            "aero_drag": {"drag_area_m2": round(rng.uniform(0.55, 0.85), 3)},
            "rolling_resistance": {"coefficient": round(rng.uniform(0.006, 0.013), 5)},
        }
    mass = rng.uniform(1100.0, 1800.0)
    return Car(
        mass_kg=round(mass, 1),
        wheelbase_m=round(wheelbase, 3),
        cog_height_m=round(height, 3),
        cog_to_rear_axle_m=round(wheelbase * rng.uniform(0.47, 0.56), 3),
        wheel_radius_m=round(rng.uniform(0.285, 0.33), 4),
        wheel_inertia_kg_m2=round(rng.uniform(0.9, 1.7), 3),
        motor_peak_torque_nm=round(mass * rng.uniform(0.24, 0.34), 1),
        stiffness_n=round(mass * rng.uniform(33.0, 48.0), -2),
        modelled={name: given for name, given in modelled.items() if name not in without},
    )


def draw_road(rng: Generator, rich: bool) -> Road:
    """Rich: dry stretches broken by wet and icy ones. Mild: dry, sometimes with a wet stretch."""
    starts, mus = [0.0], [round(rng.uniform(0.85, 0.95), 2)]
    end = 1500.0 if rich else 150.0 * rng.integers(0, 3)
    while starts[-1] < end:
        dry = mus[-1] > 0.8
        starts.append(round(starts[-1] + rng.uniform(*((50.0, 120.0) if dry else (40.0, 100.0))), 1))
        slippery = float(rng.choice([0.5, 0.3])) if rich else 0.5
        mus.append(round(slippery * rng.uniform(0.93, 1.07) if dry else rng.uniform(0.85, 0.95), 2))
    return Road(tuple(starts), tuple(mus))
