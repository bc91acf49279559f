"""Braking on split friction: plant and four-wheel estimator as two units under fmpy.

``python -m scenarios.split_friction --plant P.fmu --estimator E.fmu --out DIR [--pictures] [--figure FILE.png]``

The car enters at 22 m/s a road whose left side, and later right side, is ice, and brakes in pulses to a share of each
wheel's theta F_z, as anti-lock control does. The camera side is the plant's class by bus, or rendered pictures.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from scenarios.camera.files import load_camera
from scenarios.camera.scene import Scene, SurfaceSegment
from scenarios.camera.split import SplitRenderer
from scenarios.files import load_road, load_vehicle
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.opening import Instance, opened
from trpac_core.car_friction import Friction, car_friction
from trpac_core.vehicle import WHEELS

HERE = Path(__file__).parent
ROAD = HERE / "roads" / "split_friction.yaml"
VEHICLE = HERE / "vehicles" / "four_in_wheel_motor_ev.yaml"
CAMERA = HERE / "cameras" / "paper.yaml"

PLANT, ESTIMATOR = "ReferencePlant", "TrpacEstimator4W"

STEP_S, FRAME_STEPS = 0.001, 50
"""Communication step [s], and steps per frame."""
START_M_S, END_M = 22.0, 95.0
"""Speed at the start [m/s], and position of the front axle at the end [m]."""
PULSE_S, PERIOD_S, RAMP_S = 0.4, 0.6, 0.05
"""Length, period and ramps of a braking pulse [s]."""
FIRST_PULSE_S = 0.3
USED_SHARE = 0.9
"""Share of theta F_z that each wheel is braked with in a pulse [-]."""
NOISE = {"wheel_speed": 0.01, "wheel_torque": 3.2, "vehicle_speed": 0.003, "longitudinal_acceleration": 0.05}
"""Standard deviations of the sensors as in the paper's scenario, in the units of the signals."""
NAMES = ("TRPAC", "TRPAC_std", "TRPAC_image", "excitation_flag", "flag")


def _at_wheels(unit: Instance, name: str) -> list[float]:
    """Values of a variable at the wheels fl, fr, rl, rr."""
    return [unit.get(f"{name}.{wheel}") for wheel in WHEELS]


def pulse(time_s: float) -> float:
    """Share of the full braking torque at a time, a trapezium per period [-]."""
    since = (time_s - FIRST_PULSE_S) % PERIOD_S
    if time_s < FIRST_PULSE_S:
        return 0.0
    return float(np.clip(min(since, PULSE_S - since) / RAMP_S, 0.0, 1.0))


def run(
    plant_file: Path,
    estimator_file: Path,
    out: Path,
    *,
    pictures: bool = False,
    seed: int = 1,
    road: Path = ROAD,
) -> pd.DataFrame:
    """Simulate both units on a road; returns one row per step.

    Raises
    ------
    UnitFileError
        If one of the units cannot be used.
    """
    out.mkdir(parents=True, exist_ok=True)
    radius_m = load_vehicle(VEHICLE).wheel_radius_m
    settings: dict[str, float | str] = {
        "tyre.rolling_resistance": 0.0065,
        "camera.fps": 1.0 / (FRAME_STEPS * STEP_S),
    }
    start: dict[str, float | str] = {"road_path": str(road), "initial.vehicle_speed": START_M_S}
    rng = np.random.default_rng([seed, 3])
    world = _world(road, seed) if pictures else None
    rows = []
    with (
        opened(plant_file, PLANT, start) as plant,
        opened(estimator_file, ESTIMATOR, settings) as estimator,
    ):
        step = 0
        while plant.get("position") < END_M and plant.get("vehicle_speed") > 2.0:
            share = USED_SHARE * pulse(step * STEP_S)
            loads, thetas = _at_wheels(plant, "vertical_load"), _at_wheels(plant, "theta")
            torques = [-share * theta * load * radius_m for theta, load in zip(thetas, loads, strict=True)]
            estimator.set(_measured(plant, torques, rng))
            if step % FRAME_STEPS == 0:
                estimator.set(_frame(plant, world, out / "frames", step // FRAME_STEPS + 1))
            # Both at the same time: the current measurements, and the torque from now on.
            estimator.slave.doStep(step * STEP_S, STEP_S)
            rows.append(_row(step * STEP_S, plant, estimator, loads, thetas))
            plant.set({f"wheel_torque.{w}": torque for w, torque in zip(WHEELS, torques, strict=True)})
            plant.slave.doStep(step * STEP_S, STEP_S)
            step += 1
    return pd.DataFrame(rows)


def _measured(plant: Instance, torques: list[float], rng: np.random.Generator) -> dict[str, float | str]:
    """Inputs of the estimator: the plant's outputs with noise, and the torque commanded for the next step."""
    values: dict[str, float | str] = {}
    for wheel, torque, speed in zip(WHEELS, torques, _at_wheels(plant, "wheel_speed"), strict=True):
        values[f"wheel_torque.{wheel}"] = torque + NOISE["wheel_torque"] * rng.standard_normal()
        values[f"wheel_speed.{wheel}"] = speed + NOISE["wheel_speed"] * rng.standard_normal()
    for name in ("vehicle_speed", "longitudinal_acceleration"):
        values[name] = plant.get(name) + NOISE[name] * rng.standard_normal()
    return values


def _world(road: Path, seed: int) -> SplitRenderer:
    segments = load_road(road).segments
    left, right = ([SurfaceSegment(s.start_m, s.surface_classes[side]) for s in segments] for side in (0, 1))
    scene = Scene(seed=seed, sky="overcast", sun_share=0.0, trees_per_100_m=0.0, bridges_per_100_m=0.0)
    return SplitRenderer(load_camera(CAMERA), _joined(left), _joined(right), scene)


def _joined(segments: list[SurfaceSegment]) -> list[SurfaceSegment]:
    """The segments with consecutive ones of the same surface joined."""
    return [s for i, s in enumerate(segments) if i == 0 or s.surface != segments[i - 1].surface]


def _frame(plant: Instance, world: SplitRenderer | None, folder: Path, number: int) -> dict[str, float | str]:
    """Inputs of a new frame: a picture's path, or the plant's class of each side."""
    if world is None:
        sides = ("left", "right")
        classes = {f"road_class.{side}": int(plant.get(f"road_class.{side}")) for side in sides}
        return {**classes, **{f"road_class_confidence.{side}": 0.95 for side in sides}, "frame_id": number}
    folder.mkdir(exist_ok=True)
    path = folder / f"{number:05d}.jpg"
    if not cv2.imwrite(str(path), world.frame(plant.get("position")).image):
        raise OSError(f"{path}: the picture could not be written; is the disk full?")
    return {"image_path": str(path.resolve()), "frame_id": number}


def _row(
    time_s: float, plant: Instance, estimator: Instance, loads: list[float], thetas: list[float]
) -> dict[str, float]:
    row = {"time_s": time_s, "position_m": plant.get("position"), "speed_m_s": plant.get("vehicle_speed")}
    for name in NAMES:
        row |= {
            f"{name}.{wheel}": value for wheel, value in zip(WHEELS, _at_wheels(estimator, name), strict=True)
        }
    row |= {f"theta.{wheel}": theta for wheel, theta in zip(WHEELS, thetas, strict=True)}
    row |= {f"vertical_load.{wheel}": load for wheel, load in zip(WHEELS, loads, strict=True)}
    row |= {name: estimator.get(name) for name in ("TRPAC.vehicle", "TRPAC_std.vehicle")}
    fl, fr, rl, rr = (Friction(theta, 0.0) for theta in thetas)
    row["theta.vehicle"] = car_friction((fl, fr, rl, rr), _four(loads), 0.0).theta
    return row


def _four(values: list[float]) -> tuple[float, float, float, float]:
    fl, fr, rl, rr = values
    return fl, fr, rl, rr


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for option, name in (("--plant", PLANT), ("--estimator", ESTIMATOR)):
        file = Path("dist") / f"{name}.fmu"
        text = f"unit that build_fmu.py --slave {name} makes (default: %(default)s)"
        parser.add_argument(option, type=Path, default=file, help=text)
    parser.add_argument(
        "--out", type=Path, default=Path("out/split_friction"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--pictures", action="store_true", help="rendered pictures instead of classes by bus")
    parser.add_argument("--figure", type=Path, help="picture file; default: split_friction.png in the folder")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    from scenarios.split_figure import draw_split

    try:
        table = run(
            options.plant, options.estimator, options.out, pictures=options.pictures, seed=options.seed
        )
    except UnitFileError as error:
        parser.error(str(error))
    table.to_csv(options.out / "log.csv", index=False)
    figure = options.figure or options.out / "split_friction.png"
    draw_split(table, figure)
    print(f"{options.out / 'log.csv'}\n{figure}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
