"""Diagnoses with a unit as the user's own model: which withheld effects are found.

`python -m benchmarks.gap.own_model ReferencePlant.fmu [--build] [--seeds 10] [--only SEED]`. Of each seed one effect is
drawn, a car that has it is driven over a road of dry, wet and icy stretches, and the unit is run without it. With
`--build` the car and the unit have another tyre and more rolling resistance than the nominal model's vehicle.yaml.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from scenarios.files import VehicleFile, load_vehicle
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log, write_log
from scenarios.yaml_text import to_yaml
from sim2real.demo import (
    DURATION_S,
    FINE,
    HIDDEN,
    LOGS,
    NOISE,
    STEP_S,
    VEHICLE,
    Truth,
    draw_manoeuvre,
    draw_road,
    with_effect,
)
from sim2real.diagnose import diagnose_files
from trpac_core.vehicle import WHEELS

BUILD = {
    "tyre_stiffness_offset": {"stiffness_n": 42_000.0},
    "tyre_relaxation": {"length_m": 0.3},
    "rolling_resistance": {"coefficient": 0.02},
}
"""How the car and the unit differ from the nominal model's vehicle.yaml with `--build`."""


def signals(car: VehicleFile) -> dict[str, Any]:
    """The signals file of ReferencePlant for a car."""
    front_m = car.wheelbase_m - car.cog_to_rear_axle_m
    return {
        "schema": 1,
        "inputs": {f"wheel_torque.{w}": {"signal": f"wheel_torque_{w}_nm"} for w in WHEELS},
        "outputs": {
            "vehicle_speed_m_s": "vehicle_speed",
            "accel_x_m_s2": "longitudinal_acceleration",
            "position_m": {"column": "position", "offset": -front_m},
            **{f"wheel_speed_{w}_rad_s": f"wheel_speed.{w}" for w in WHEELS},
        },
        "initial": {
            "initial.vehicle_speed": {"signal": "vehicle_speed_m_s"},
            "initial.position": {"signal": "position_m", "offset": front_m},
        },
        "start": {"vehicle_path": "theirs.yaml", "road_path": "road.yaml"},
    }


def make_case(folder: Path, seed: int, build: bool) -> Truth:
    """Files of a case; returns what was hidden. Every effect is drawn once before one is drawn again."""
    rng = np.random.default_rng(seed)
    effect = list(HIDDEN)[seed % len(HIDDEN)]
    values = {name: float(f"{rng.uniform(*span):.3g}") for name, span in HIDDEN[effect].items()}
    truth = Truth(effect, values)
    nominal = load_vehicle(VEHICLE)
    effects = {**nominal.effects, **(BUILD if build else {})}
    theirs = VehicleFile.model_validate({**nominal.model_dump(by_alias=True), "effects": effects})
    real = with_effect(theirs, truth)
    road = draw_road(rng)
    (folder / "vehicle.yaml").write_bytes(VEHICLE.read_bytes())
    (folder / "theirs.yaml").write_text(to_yaml(theirs.model_dump(by_alias=True)), encoding="utf-8")
    (folder / "road.yaml").write_text(to_yaml(road.model_dump(by_alias=True)), encoding="utf-8")
    (folder / "signals.yaml").write_text(yaml.safe_dump(signals(nominal)), encoding="utf-8")
    for number, name in enumerate(LOGS):
        speed_m_s = float(rng.uniform(8.0, 14.0))
        time_s = np.linspace(0.0, DURATION_S, round(DURATION_S * FINE / STEP_S), endpoint=False)
        torque_nm = draw_manoeuvre(rng, nominal, speed_m_s).torque(time_s)
        run = simulate(real, road, torque_nm, STEP_S / FINE, initial_speed_m_s=speed_m_s)
        log = make_log(run, real, NOISE, seed=1000 * seed + number).drop(columns="mu_reference")
        write_log(log.iloc[::FINE], folder / name)
    return truth


def main() -> None:
    """Diagnose drawn cases and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("unit", type=Path)
    parser.add_argument("--build", action="store_true")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    print(
        "| seed | hidden | verdict | first (prob.) | in the set | gap | after | floor | through the unit | runs | s |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for seed in [options.only] if options.only is not None else range(options.seeds):
        with tempfile.TemporaryDirectory() as place:
            print(_line(Path(place), seed, options), flush=True)


def _line(folder: Path, seed: int, options: argparse.Namespace) -> str:
    truth = make_case(folder, seed, options.build)
    begun = time.perf_counter()
    said = diagnose_files(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        [str(folder / name) for name in LOGS[:-1]],
        str(folder / LOGS[-1]),
        model=options.unit,
        signals=folder / "signals.yaml",
        jobs=options.jobs,
    )
    first, own = said.causes[0], said.own_model
    assert own is not None
    alike = first.effect == truth.effect or any(truth.effect in group for group in said.ambiguous_with)
    exact = "-" if own.gap_after is None else f"{own.gap_after:.2f}"
    return (
        f"| {seed} | {truth.effect} | {said.verdict} | {first.effect} ({first.probability:.2f}) | "
        f"{'yes' if alike else 'no'} | {said.gap.before.total:.2f} | {said.gap.after.total:.2f} | "
        f"{said.gap.noise_floor:.2f} | {exact} | {own.runs} | {time.perf_counter() - begun:.0f} |"
    )


if __name__ == "__main__":
    main()
