"""The estimator unit in a host: imported, parameterised and stepped through fmpy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from fmpy.fmi1 import FMICallException

from scenarios.camera.files import load_camera
from scenarios.camera_computer import CameraComputer, CarMotion, unit_settings
from scenarios.files import Scenario, ScenarioError
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.opening import Instance, opened
from scenarios.pictures import frame_steps
from scenarios.progress import Progress, silent
from trpac_core.vehicle import Vehicle
from trpac_core.vision.camera import Camera
from trpac_core.vision.images import decode_image

UNIT = "TrpacEstimator"
Values = dict[str, float | str]
"""Values by variable name."""
INPUTS = ("wheel_speed", "wheel_torque", "vehicle_speed", "longitudinal_acceleration")


def parameters(scenario: Scenario) -> dict[str, float | int | bool]:
    """Parameters of the unit for the scenario's car, camera and sensors, by variable name."""
    car, noise = scenario.vehicle.to_core(), scenario.sensors
    values: dict[str, float | int | bool] = car_parameters(car, scenario.wheel) | {
        "estimator.torque_noise": noise.wheel_torque_noise_nm,
        "estimator.sliding_speed_noise": float(
            np.hypot(noise.vehicle_speed_noise_m_s, car.wheel_radius_m * noise.wheel_speed_noise_rad_s)
        ),
    }
    if scenario.camera_path is not None:
        values |= _camera_parameters(load_camera(scenario.camera_path))
        values["camera.fps"] = 1.0 / (frame_steps(scenario) * scenario.step_s)
    return values


def car_parameters(car: Vehicle, wheel: str) -> dict[str, float | int | bool]:
    """Parameters of the unit of one wheel for a car, by variable name."""
    return {
        "wheel.front": wheel.startswith("f"),
        "wheel.left": wheel.endswith("l"),
        "vehicle.mass": car.mass_kg,
        "vehicle.wheelbase": car.wheelbase_m,
        "vehicle.track": car.track_m,
        "vehicle.cog_height": car.cog_height_m,
        "vehicle.cog_to_rear_axle": car.cog_to_rear_axle_m,
        "vehicle.wheel_radius": car.wheel_radius_m,
        "vehicle.wheel_inertia": car.wheel_inertia_kg_m2,
        "tyre.rolling_resistance": car.rolling_resistance,
        "tyre.longitudinal_stiffness": car.longitudinal_stiffness_n,
    }


def _camera_parameters(camera: Camera) -> dict[str, float | int | bool]:
    lens = dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True))
    return {
        "camera.width": camera.width_px,
        "camera.height": camera.height_px,
        "camera.fx": camera.fx_px,
        "camera.fy": camera.fy_px,
        "camera.cx": camera.cx_px,
        "camera.cy": camera.cy_px,
        **{f"camera.{name}": value for name, value in lens.items()},
        "camera.height_above_road": camera.height_m,
        "camera.x_from_front_axle": camera.x_from_front_axle_m,
        "camera.y": camera.y_m,
        "camera.pitch": camera.pitch_rad,
        "camera.yaw": camera.yaw_rad,
        "camera.roll": camera.roll_rad,
    }


def run_unit(
    fmu: Path,
    settings: Mapping[str, float | int | bool],
    signals: pd.DataFrame,
    frames: pd.DataFrame,
    step_s: float,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Outputs of the unit over recorded signals and pictures.

    Parameters
    ----------
    fmu : Path
        The unit's archive.
    settings : mapping
        Parameters by variable name.
    signals : DataFrame
        One row per step with the columns `INPUTS`, in the unit's units.
    frames : DataFrame
        row, frame and path of each picture, which is set with that row's signals; a native unit is given its class and
        confidence, which are found here.
    step_s : float
        Communication step [s].
    progress : callable
        Called with how many of how many steps are done.

    Returns
    -------
    DataFrame
        One row per step: the unit's outputs at the step's end.

    Raises
    ------
    ScenarioError
        If the archive is damaged, holds another unit, or cannot be unpacked or instantiated here, and if the unit
        refuses a setting or a step.
    ImageError, ModelError
        If a picture, or a network, cannot be used beside a native unit.
    """
    try:
        with opened(fmu, UNIT, settings) as unit:
            by_class = unit.native and len(frames) > 0
            pictures = _classes(settings, signals, frames, step_s) if by_class else _paths(signals, frames)
            table = _step_all(unit, signals, pictures, step_s, progress)
            unit.slave.terminate()
    except UnitFileError as error:
        raise ScenarioError(str(error)) from error
    except FMICallException as error:
        raise ScenarioError(
            f"{fmu}: refuses the scenario's settings or a step ({error}); its own words are above. Their ranges "
            "stand in docs/reference/fmu_variables.md."
        ) from error
    return table


def _paths(signals: pd.DataFrame, frames: pd.DataFrame) -> Iterator[Values]:
    """What each row sets for a unit that reads pictures."""
    pictures = _by_row(frames)
    for row in range(len(signals)):
        if row in pictures:
            path, number = pictures[row]
            yield {"image_path": path, "frame_id": number}
        else:
            yield {}


def _classes(
    settings: Mapping[str, float | int | bool], signals: pd.DataFrame, frames: pd.DataFrame, step_s: float
) -> Iterator[Values]:
    """What each row sets for a unit that takes classes: those of the pictures."""
    config, pictures = unit_settings(settings), _by_row(frames)
    vision = config.image_settings
    computer, motion = CameraComputer(vision, (vision.side,)), CarMotion(step_s, config.sensor_filter_s)
    readings = signals[["vehicle_speed", "longitudinal_acceleration"]].to_numpy(dtype=float).tolist()
    for row, (speed_m_s, acceleration_m_s2) in enumerate(readings):
        moving = motion.next(speed_m_s, acceleration_m_s2)
        if row in pictures:
            path, number = pictures[row]
            (road,) = computer.classes(decode_image(path), moving)
            found = {"road_class": int(road.surface), "road_class_confidence": road.confidence}
            yield {**found, "frame_id": number}
        else:
            yield {}


def _by_row(frames: pd.DataFrame) -> dict[int, tuple[str, int]]:
    """Path and number of each picture, by its row."""
    return {int(row): (str(path), int(frame)) for row, path, frame in frames[["row", "path", "frame"]].values}


def _step_all(
    unit: Instance, signals: pd.DataFrame, pictures: Iterator[Values], step_s: float, progress: Progress
) -> pd.DataFrame:
    real_names, whole_names, flag_names = (
        [v.name for v in unit.variables if v.causality == "output" and v.type == kind]
        for kind in ("Real", "Integer", "Boolean")
    )
    inputs, reals, whole, flags = map(unit.references, (INPUTS, real_names, whole_names, flag_names))
    slave = unit.slave
    values = signals[list(INPUTS)].to_numpy(dtype=float)
    results = np.empty((len(values), len(reals) + len(whole) + len(flags)))
    for row, (readings, given) in enumerate(zip(values, pictures, strict=True)):
        unit.set(given)
        slave.setReal(inputs, readings)
        slave.doStep(currentCommunicationPoint=row * step_s, communicationStepSize=step_s)
        results[row] = [*slave.getReal(reals), *slave.getInteger(whole), *slave.getBoolean(flags)]
        if row % 500 == 0 or row == len(values) - 1:
            progress(row + 1, len(values))
    table = pd.DataFrame(results, columns=[*real_names, *whole_names, *flag_names])
    return table.astype(dict.fromkeys(whole_names, int) | dict.fromkeys(flag_names, bool))
