"""The plant's sensors: from the true trajectory to a log with the columns of the log format."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.files import Scenario, SensorNoise, VehicleFile
from scenarios.plant.pipeline import PlantTrajectory
from trpac_core.tyre import peak_friction
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

IDEAL = SensorNoise()
"""Sensors without noise."""


def make_log(
    trajectory: PlantTrajectory,
    vehicle: VehicleFile,
    noise: SensorNoise = IDEAL,
    seed: int = 0,
) -> pd.DataFrame:
    """The log of a trajectory by the vehicle's sensors.

    Parameters
    ----------
    trajectory, vehicle : PlantTrajectory, VehicleFile
        The motion, and its vehicle.
    noise : SensorNoise
        Standard deviations of the white Gaussian noise of each channel.
    seed : int
        Seed of the noise; every column has its own random stream.

    Returns
    -------
    DataFrame
        time_s, wheel_torque_{fl,fr,rl,rr}_nm, wheel_speed_{fl,fr,rl,rr}_rad_s, vehicle_speed_m_s,
        accel_x_m_s2, position_m, and mu_reference: the tyre curve's maximum at the front wheels' theta, not theta
        itself [-].
    """
    signals: dict[str, NDArray[np.float64]] = {
        **{f"wheel_torque_{w}_nm": trajectory.wheel_torque_nm[:, i] for i, w in enumerate(WHEELS)},
        **{f"wheel_speed_{w}_rad_s": trajectory.wheel_speed_rad_s[:, i] for i, w in enumerate(WHEELS)},
        "vehicle_speed_m_s": trajectory.speed_m_s,
        "accel_x_m_s2": trajectory.accel_x_m_s2,
        "position_m": trajectory.position_m,
        "mu_reference": mu_reference(trajectory, vehicle),
    }
    signals = sense(vehicle, trajectory.time_s, signals)
    streams = np.random.SeedSequence(seed).spawn(len(signals))
    for (name, signal), stream in zip(signals.items(), streams, strict=True):
        deviation = _deviation(name, noise)
        if deviation > 0.0:
            signals[name] = signal + deviation * np.random.default_rng(stream).standard_normal(len(signal))
    return pd.DataFrame({"time_s": trajectory.time_s, **signals})


def sense(vehicle: VehicleFile, time_s: Array, signals: dict[str, Array]) -> dict[str, Array]:
    """Readings of the sensors for true signals, without noise, by log column, shape (n,) each."""
    for effect in vehicle.make_effects():
        signals = effect.sense(time_s, signals)
    return signals


def correct(vehicle: VehicleFile, time_s: Array, signals: dict[str, Array]) -> dict[str, Array]:
    """True signals by the inverse of `sense`; lost samples, and the end of delayed signals, are NaN."""
    for effect in reversed(vehicle.make_effects()):
        signals = effect.correct(time_s, signals)
    return signals


def make_scenario_log(scenario: Scenario, trajectory: PlantTrajectory) -> pd.DataFrame:
    """The log of a scenario's trajectory with the scenario's noise and seed."""
    return make_log(trajectory, scenario.vehicle, scenario.sensors, scenario.seed)


def write_log(log: pd.DataFrame, path: str | Path) -> None:
    """Write a log as CSV, with numbers that are read back unchanged."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    log.to_csv(path, index=False)


def mu_reference(trajectory: PlantTrajectory, vehicle: VehicleFile) -> NDArray[np.float64]:
    """Peak friction under the front wheels (mean of left and right, at static load), shape (n,) [-]."""
    core = vehicle.to_core()
    load_n = core.wheel_load(front=True)

    @lru_cache
    def peak(theta: float) -> float:
        return peak_friction(theta, load_n, core.longitudinal_stiffness_n)

    return np.array([0.5 * (peak(left) + peak(right)) for left, right in trajectory.theta[:, :2]])


def _deviation(column: str, noise: SensorNoise) -> float:
    if column.startswith("wheel_speed_"):
        return noise.wheel_speed_noise_rad_s
    if column.startswith("wheel_torque_"):
        return noise.wheel_torque_noise_nm
    if column == "vehicle_speed_m_s":
        return noise.vehicle_speed_noise_m_s
    return noise.accel_x_noise_m_s2 if column == "accel_x_m_s2" else 0.0
