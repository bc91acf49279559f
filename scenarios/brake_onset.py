"""TRPAC at the onset of braking, with and without the camera, and the stopping distance that each plans.

A scenario that brakes on another road than it started on is run twice: as it stands, and without its camera. Plant,
seed and sensor noise are the same in both runs.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenarios.errors import ScenarioError
from scenarios.files import LONGEST_RUN_S, End, Scenario
from scenarios.plant.pipeline import PlantTrajectory, drive
from scenarios.progress import StageProgress, silent
from scenarios.runner import Run, run_scenario, wheel_position_m
from trpac_core.estimator_data import Method

GRAVITY_M_S2 = 9.81
"""Acceleration of free fall in the planned distances [m/s^2]."""
STANDSTILL_M_S = 0.01
"""Speed below which the simulated car has stopped [m/s]."""
SURFACES = {"dry": "dry road", "wet": "wet road", "snow_ice": "snow or ice"}


def stopping_distance_m(speed_m_s: float, friction: float) -> float:
    """The shortest distance to standstill, v^2 / (2 g theta) [m].

    The road is level, every wheel uses all of the friction from the first moment, and nothing else slows the car: no
    air drag, no rolling resistance, no delay of driver or brake.

    Parameters
    ----------
    speed_m_s : float
        Speed at the onset of braking [m/s].
    friction : float
        Peak friction theta [-]. Without friction the distance is infinite.

    References
    ----------
    Gillespie, T. D. (1992), Fundamentals of Vehicle Dynamics, chapter 3, constant deceleration.

    Examples
    --------
    >>> round(stopping_distance_m(15.0, 0.2), 1)
    57.3
    """
    if not (speed_m_s >= 0.0 and friction >= 0.0):
        raise ValueError(f"speed {speed_m_s:g} m/s, friction {friction:g}; expected 0 or more of both.")
    if speed_m_s == 0.0:
        return 0.0
    return speed_m_s**2 / (2.0 * GRAVITY_M_S2 * friction) if friction > 0.0 else math.inf


@dataclass(frozen=True)
class Plan:
    """TRPAC at the onset of braking and the stopping distances planned from it.

    Attributes
    ----------
    TRPAC, TRPAC_low, TRPAC_high : float
        The estimate and the ends of its 95 % interval [-].
    planned_stop_m, planned_stop_of_low_m, planned_stop_of_high_m : float
        Stopping distance planned from each; None where it is infinite [m].
    """

    TRPAC: float
    TRPAC_low: float
    TRPAC_high: float
    planned_stop_m: float | None
    planned_stop_of_low_m: float | None
    planned_stop_of_high_m: float | None

    @classmethod
    def of(cls, row: pd.Series, speed_m_s: float) -> Plan:
        """The plan of a row of the unit's outputs."""
        frictions = [float(row[name]) for name in ("TRPAC", "TRPAC_low", "TRPAC_high")]
        stops = [stopping_distance_m(speed_m_s, max(friction, 0.0)) for friction in frictions]
        return cls(*frictions, *(stop if math.isfinite(stop) else None for stop in stops))

    @property
    def stop_text(self) -> str:
        """The planned distance in words."""
        return "no stop" if self.planned_stop_m is None else f"{self.planned_stop_m:.0f} m"


@dataclass(frozen=True)
class Onset:
    """What is known at the last step before the brakes are applied.

    Attributes
    ----------
    scenario, seed, surface : str, int, str
        The drive, and the surface under the wheel.
    true_friction, speed_m_s, after_border_m : float
        Peak friction under the wheel [-], speed of the car [m/s], and distance of the wheel after the border [m].
    with_camera, without_camera : Plan
        What the two runs say.
    shortest_stop_m : float
        Stopping distance from the true friction [m].
    simulated_stop_m, simulated_stop_s : float or None
        Distance [m] and time [s] in which the simulated car stops; None where its manoeuvre does not stop it.
    """

    scenario: str
    seed: int
    surface: str
    true_friction: float
    speed_m_s: float
    after_border_m: float
    with_camera: Plan
    without_camera: Plan
    shortest_stop_m: float
    simulated_stop_m: float | None
    simulated_stop_s: float | None

    @property
    def road(self) -> str:
        """The surface in words."""
        return SURFACES[self.surface]

    @property
    def sentence(self) -> str:
        """The result in words."""
        seen, blind = self.with_camera, self.without_camera
        stopped = (
            ""
            if self.simulated_stop_m is None
            else f" The simulated car stops in {self.simulated_stop_m:.0f} m."
        )
        return (
            f"At brake onset on {self.road} (true peak friction {self.true_friction:.2f}) TRPAC is "
            f"{_interval(seen)} with the camera and {_interval(blind)} without it. At {self.speed_m_s:.1f} m/s a "
            f"controller plans a stop in {seen.stop_text} with the camera and {blind.stop_text} without it; "
            f"the road allows {self.shortest_stop_m:.0f} m at best.{stopped}"
        )

    def summary(self) -> dict[str, Any]:
        """The content for summary.json."""
        return asdict(self)


def _interval(plan: Plan) -> str:
    return f"{plan.TRPAC:.2f} (95 % interval {plan.TRPAC_low:.2f} to {plan.TRPAC_high:.2f})"


@dataclass(frozen=True)
class Comparison:
    """A drive with and without its camera.

    Attributes
    ----------
    table : DataFrame
        One row per step: after_border_m, theta_true, and TRPAC, TRPAC_low and TRPAC_high of both runs with the endings
        _with_camera and _without_camera.
    onset : Onset
        What is known when the brakes are applied.
    """

    table: pd.DataFrame
    onset: Onset


def onset_row(scenario: Scenario, trajectory: PlantTrajectory) -> int:
    """The last row before the first one with a braking torque; raises ScenarioError where there is none."""
    braking = np.flatnonzero((trajectory.wheel_torque_nm < 0.0).any(axis=1))
    if len(braking) == 0 or braking[0] == 0:
        raise ScenarioError(
            f"{scenario.path}: the drive has no onset of braking; expected a torque below 0 after its start."
        )
    return int(braking[0]) - 1


def simulated_stop(scenario: Scenario, row: int) -> tuple[float | None, float | None]:
    """Distance [m] and time [s] from a row to standstill if the manoeuvre goes on beyond the scenario's end."""
    last_s = min(LONGEST_RUN_S, max((pulse.end_s for pulse in scenario.manoeuvre.pulses), default=0.0))
    whole = drive(replace(scenario, end=End(position_m=1e6, time_s=max(last_s, scenario.end.time_s))))
    stopped = np.flatnonzero(whole.speed_m_s[row:] < STANDSTILL_M_S)
    if len(stopped) == 0:
        return None, None
    end = row + int(stopped[0])
    return float(whole.position_m[end] - whole.position_m[row]), float(whole.time_s[end] - whole.time_s[row])


def require_comparable(scenario: Scenario) -> None:
    """Raise a ScenarioError where a scenario has no camera, no onset of braking, or no border of the road before it."""
    if scenario.camera_path is None:
        raise ScenarioError(
            f"{scenario.path}: camera: missing; expected one, to run the drive with and without it."
        )
    trajectory = drive(scenario)
    if wheel_position_m(scenario, trajectory)[onset_row(scenario, trajectory)] < _last_border_m(scenario):
        raise ScenarioError(
            f"{scenario.path}: brakes before the road's last border; expected the onset of braking after it."
        )


def compare(
    scenario: Scenario,
    fmu: Path,
    frames_folder: Path,
    progress: StageProgress = silent,
    method: Method = Method.ROBUST,
) -> Comparison:
    """A scenario with and without its camera, both on the real unit.

    Raises
    ------
    ScenarioError
        As `require_comparable` and `run_scenario` do.
    """
    require_comparable(scenario)

    def named(what: str) -> StageProgress:
        return lambda stage, done, total: progress(f"{scenario.name}, {what}: {stage}", done, total)

    seen = run_scenario(scenario, fmu, frames_folder, named("camera"), method=method)
    blind = run_scenario(
        replace(scenario, camera_path=None), fmu, frames_folder, named("no camera"), method=method
    )
    return comparison(seen, blind)


def comparison(seen: Run, blind: Run) -> Comparison:
    """The comparison of a run with a camera and one without."""
    scenario, trajectory = seen.scenario, seen.trajectory
    row = onset_row(scenario, trajectory)
    after_border_m = wheel_position_m(scenario, trajectory) - _last_border_m(scenario)
    theta_true = seen.table["theta_true"].to_numpy()
    speed_m_s, friction = float(trajectory.speed_m_s[row]), float(theta_true[row])
    stop_m, stop_s = simulated_stop(scenario, row)
    onset = Onset(
        scenario=scenario.name,
        seed=scenario.seed,
        surface=scenario.road.segments[int(seen.table["segment"].iloc[row])].surface,
        true_friction=friction,
        speed_m_s=speed_m_s,
        after_border_m=float(after_border_m[row]),
        with_camera=Plan.of(seen.table.iloc[row], speed_m_s),
        without_camera=Plan.of(blind.table.iloc[row], speed_m_s),
        shortest_stop_m=stopping_distance_m(speed_m_s, friction),
        simulated_stop_m=stop_m,
        simulated_stop_s=stop_s,
    )
    columns = ["TRPAC", "TRPAC_low", "TRPAC_high"]
    table = pd.concat(
        [
            pd.DataFrame({"after_border_m": after_border_m, "theta_true": theta_true}),
            seen.table[columns].add_suffix("_with_camera"),
            blind.table[columns].add_suffix("_without_camera"),
        ],
        axis=1,
    )
    return Comparison(table, onset)


def _last_border_m(scenario: Scenario) -> float:
    """Where the road changes for the last time [m]; raises ScenarioError where it never does."""
    if len(scenario.road.segments) < 2:
        raise ScenarioError(
            f"{scenario.path}: road: has one stretch; expected a border before the onset of braking."
        )
    return float(scenario.road.segments[-1].start_m)
