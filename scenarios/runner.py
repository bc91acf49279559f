"""One scenario from the files to the scores: plant, pictures, unit, metrics."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.files import Scenario
from scenarios.fmu_client.estimator import parameters, run_unit
from scenarios.metrics import estimators, score_run
from scenarios.pictures import record
from scenarios.plant.pipeline import PlantTrajectory, drive
from scenarios.plant.sensors import make_scenario_log
from scenarios.progress import StageProgress, silent
from trpac_core.estimator_data import Method, Source
from trpac_core.files import file_sha256
from trpac_core.robust.belief import MOST_SLIP
from trpac_core.vehicle import WHEELS

PACKAGES = (
    "trpac-fmu",
    "fmpy",
    "pythonfmu",
    "numpy",
    "numba",
    "scipy",
    "onnxruntime",
    "opencv-python-headless",
    "albumentations",
)


@dataclass(frozen=True)
class Run:
    """A finished scenario.

    Attributes
    ----------
    scenario : Scenario
        The scenario.
    trajectory : PlantTrajectory
        The plant's motion.
    frames : DataFrame
        The pictures, see `pictures.record`.
    table : DataFrame
        One row per step: the sensors' log, the unit's outputs, theta and segment under the wheel.
    summary : dict
        Content of summary.json.
    """

    scenario: Scenario
    trajectory: PlantTrajectory
    frames: pd.DataFrame
    table: pd.DataFrame
    summary: dict[str, Any]


def run_scenario(
    scenario: Scenario,
    fmu: Path,
    frames_folder: Path,
    progress: StageProgress = silent,
    overrides: Mapping[str, float] | None = None,
    method: Method = Method.ROBUST,
) -> Run:
    """Results of a scenario: plant, pictures, unit and scores.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    fmu : Path
        The estimator unit.
    frames_folder : Path
        Folder of the pictures.
    progress : callable
        Called with the stage, and how many of how many of its items are done.
    overrides : mapping, optional
        Parameters of the unit by variable name, in place of the scenario's and the default ones.
    method : Method
        Estimator of the unit.

    Raises
    ------
    ScenarioError
        If a file of the scenario cannot be used.
    """
    trajectory = drive(scenario)
    log = make_scenario_log(scenario, trajectory)
    frames = record(scenario, trajectory, frames_folder, lambda d, n: progress("drawing pictures", d, n))
    chosen = {"estimator.method": method.value}
    settings = parameters(scenario) | chosen | dict(overrides or {})
    outputs = run_unit(
        fmu,
        settings,
        unit_signals(log, scenario.wheel),
        frames,
        scenario.step_s,
        lambda done, total: progress("stepping the unit", done, total),
    )
    table = pd.concat([log, outputs, under_the_wheel(scenario, trajectory)], axis=1)
    return Run(scenario, trajectory, frames, table, summarise(scenario, table, fmu, method))


def unit_signals(log: pd.DataFrame, wheel: str) -> pd.DataFrame:
    """Inputs of the unit of one wheel from a log, by the unit's names."""
    return pd.DataFrame(
        {
            "wheel_speed": log[f"wheel_speed_{wheel}_rad_s"],
            "wheel_torque": log[f"wheel_torque_{wheel}_nm"],
            "vehicle_speed": log["vehicle_speed_m_s"],
            "longitudinal_acceleration": log["accel_x_m_s2"],
        }
    )


def under_the_wheel(scenario: Scenario, trajectory: PlantTrajectory) -> pd.DataFrame:
    """Columns theta_true and segment: adhesion and index of the road's stretch at the wheel's contact."""
    starts, column = segment_starts(scenario), WHEELS.index(scenario.wheel)
    segment = np.clip(
        np.searchsorted(starts, wheel_position_m(scenario, trajectory), side="right") - 1, 0, None
    )
    return pd.DataFrame({"theta_true": trajectory.theta[:, column], "segment": segment})


def wheel_position_m(scenario: Scenario, trajectory: PlantTrajectory) -> NDArray[np.float64]:
    """Position of the wheel's contact on the road at each row [m]."""
    car = scenario.vehicle.to_core()
    offset_m = car.cog_to_front_axle_m if scenario.wheel.startswith("f") else -car.cog_to_rear_axle_m
    return np.asarray(trajectory.position_m + offset_m, dtype=np.float64)


def segment_starts(scenario: Scenario) -> NDArray[np.float64]:
    """Where the road's stretches begin [m]."""
    return np.array([s.start_m for s in scenario.road.segments])


def summarise(scenario: Scenario, table: pd.DataFrame, fmu: Path, method: Method) -> dict[str, Any]:
    """The content of summary.json: scores of a run, and what is needed to repeat it."""
    scores = score_run(
        segment_starts(scenario),
        table["segment"].to_numpy(),
        table["theta_true"].to_numpy(),
        float(table["TRPAC_dynamics"].iloc[0]),
        {name: table[column].to_numpy() for name, column in estimators(method).items()},
        table["excitation_flag"].to_numpy(),
        scenario.step_s,
    )
    return {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "wheel": scenario.wheel,
        "method": method.label,
        "longitudinal_stiffness_n": scenario.vehicle.tyre.longitudinal_stiffness_n,
        "excited_time_of": f"{method.title}'s start/stop flag, one clock for all estimators",
        "scenario_sha256": file_sha256(scenario.path),
        "fmu_sha256": file_sha256(fmu),
        "versions": {package: version(package) for package in PACKAGES},
        "estimators": scores,
        "at_the_end": [_at_the_end(rows, scenario.step_s) for _, rows in table.groupby("segment")],
    }


def _at_the_end(rows: pd.DataFrame, step_s: float) -> dict[str, Any]:
    """TRPAC at the end of a stretch, what it rests on, and how long the tyre showed the road there [s]."""
    last, tyre = rows.iloc[-1], rows["TRPAC_source"].to_numpy(int) & Source.TYRE > 0
    shown = tyre & rows["excitation_flag"].to_numpy(bool)
    return {
        **{name: float(last[name]) for name in ("TRPAC", "TRPAC_std", "TRPAC_low", "TRPAC_high")},
        "shown_s": float(np.count_nonzero(shown)) * step_s,
        "camera": bool(int(last["TRPAC_source"]) & Source.CAMERA),
        "spun": bool((rows["slip"] > MOST_SLIP).any()),
    }


def write_run(run: Run, out: Path) -> None:
    """Write log.csv and summary.json of a run."""
    out.mkdir(parents=True, exist_ok=True)
    run.table.to_csv(out / "log.csv", index=False)
    (out / "summary.json").write_text(json.dumps(run.summary, indent=2) + "\n", encoding="utf-8")
