"""One run of a sweep: plant, sensors, camera, estimators stepped in Python, scores per stretch of road."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.files import Scenario
from scenarios.fmu_client.estimator import parameters
from scenarios.metrics import score_run
from scenarios.peers import PeerSetup
from scenarios.plant.pipeline import PlantTrajectory, drive
from scenarios.plant.sensors import make_scenario_log
from scenarios.runner import segment_starts, under_the_wheel
from scenarios.sweep.camera import RenderedFrames, road_classes
from scenarios.sweep.draw import RunPlan
from scenarios.sweep.trackers import OWN, make_peer
from scenarios.vision_overlay import image_estimator
from trpac_core.dife import GREATEST_THETA, LEAST_SENSITIVITY, LEAST_THETA
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.settings import ESTIMATOR_PARAMETERS
from trpac_core.readings import Sensors
from trpac_core.tyre import friction_by_theta
from trpac_core.vehicle import WHEELS, Vehicle
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife

Array = NDArray[np.float64]
Frames = dict[int, RoadClass] | RenderedFrames

BAND = 0.02
"""The paper's steady-state error, and a band in which an estimate counts as there whatever the step was [-]."""
COVERAGE_DEVIATIONS = 2.0


@dataclass(frozen=True)
class Track:
    """One estimator over a run: estimate, its standard deviation (NaN where it states none), shape (n,) each [-]."""

    TRPAC: Array
    TRPAC_std: Array


@dataclass(frozen=True)
class Tracks:
    """All estimators over a run, and DIFE's start/stop flag, the one clock, shape (n,)."""

    by_name: dict[str, Track]
    excited: NDArray[np.bool_]


def run_plan(plan: RunPlan, estimators: list[str], unit: dict[str, float]) -> list[dict[str, Any]]:
    """One run's rows: a score per stretch of road and estimator.

    Parameters
    ----------
    plan : RunPlan
        The run.
    estimators : list of str
        Which estimators are scored.
    unit : dict
        Parameters of ours by the unit's names, in place of the delivered ones.
    """
    trajectory = drive(plan.scenario)
    config = believed_config(plan, unit)
    tracks = step_all(plan, trajectory, config, estimators)
    return rows_of(plan, trajectory, tracks, config.theta_initial)


def believed_config(plan: RunPlan, unit: dict[str, float]) -> EstimatorConfig:
    """The estimator's configuration as the unit's would be, with what the run has it believe wrongly."""
    believed = plan.believed
    settings = dict(parameters(replace(plan.scenario, sensors=believed.noise)))
    settings["vehicle.mass"] *= believed.mass_factor
    settings["vehicle.wheel_radius"] *= believed.radius_factor
    settings["tyre.longitudinal_stiffness"] *= believed.stiffness_factor
    values: dict[str, Any] = {v.name: v.start for v in ESTIMATOR_PARAMETERS} | settings | unit
    for surface in Surface:
        name = f"estimator.theta_{surface.label}"
        values[name] = min(max(values[name] + plan.camera.class_value_offset, LEAST_THETA), GREATEST_THETA)
    return configuration(ESTIMATOR_PARAMETERS, values, EstimatorConfig())


def signals_of(plan: RunPlan, trajectory: PlantTrajectory) -> list[list[float]]:
    """What the wheel's sensors read at each step: wheel speed, torque, vehicle speed, acceleration."""
    log, wheel = make_scenario_log(plan.scenario, trajectory), plan.scenario.wheel
    torque = log[f"wheel_torque_{wheel}_nm"].to_numpy() * plan.believed.torque_factor
    speed = log["vehicle_speed_m_s"].to_numpy() + plan.speed_bias_m_s
    columns = (log[f"wheel_speed_{wheel}_rad_s"].to_numpy(), torque, speed, log["accel_x_m_s2"].to_numpy())
    return [column.tolist() for column in columns]


def step_all(
    plan: RunPlan, trajectory: PlantTrajectory, config: EstimatorConfig, estimators: list[str]
) -> Tracks:
    """Step ours and the peers over the run's signals; raises ValueError where an estimate is not finite."""
    frames, ife = camera_of(plan, trajectory)
    estimator, step_s = TrpacEstimator(config, ife), plan.scenario.step_s
    peers = {name: make_peer(name, peer_setup(plan, config)) for name in estimators if name not in OWN}
    names = [*OWN, *peers]
    theta = np.empty((len(trajectory), len(names)))
    std = np.full((len(trajectory), len(names)), np.nan)
    excited = np.empty(len(trajectory), dtype=bool)
    fused = names.index("DIFE")
    for row, (omega, torque, speed, acceleration) in enumerate(
        zip(*signals_of(plan, trajectory), strict=True)
    ):
        sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        estimate = estimator.step(step_s, sensors, frames.get(row))
        theta[row, : len(OWN)] = estimate.TRPAC_image, estimate.TRPAC_dynamics, estimate.TRPAC
        std[row, fused] = estimate.TRPAC_std
        excited[row] = estimate.excitation_flag
        for column, peer in enumerate(peers.values(), start=len(OWN)):
            peer_estimate = peer.step(step_s, sensors)
            theta[row, column], std[row, column] = peer_estimate.TRPAC, peer_estimate.TRPAC_std
    strange = [name for i, name in enumerate(names) if not np.isfinite(theta[:, i]).all()]
    if strange:
        raise ValueError(f"{strange[0]} gives an estimate that is no finite number.")
    chosen = {name: Track(theta[:, i], std[:, i]) for i, name in enumerate(names) if name in estimators}
    return Tracks(chosen, excited)


def camera_of(plan: RunPlan, trajectory: PlantTrajectory) -> tuple[Frames, Ife | None]:
    """What comes from the camera at each step, and what judges it where it is pictures."""
    scenario, camera = plan.scenario, plan.camera
    if camera.source == "none":
        return {}, None
    if camera.source == "rendered":
        cv2.setNumThreads(1)
        return RenderedFrames(scenario, trajectory, camera, plan.camera_seed), image_estimator(scenario)
    return road_classes(scenario, trajectory, camera, plan.camera_seed), None


def peer_setup(plan: RunPlan, config: EstimatorConfig) -> PeerSetup:
    """What peers are told: what ours is told."""
    noise = plan.believed.noise
    return PeerSetup(
        vehicle=config.vehicle,
        front_axle=config.front_axle,
        wheel_speed_noise_rad_s=noise.wheel_speed_noise_rad_s,
        vehicle_speed_noise_m_s=noise.vehicle_speed_noise_m_s,
        wheel_torque_noise_nm=noise.wheel_torque_noise_nm,
        theta_initial=config.theta_initial,
        floor_m_s=config.floor_m_s,
    )


def rows_of(
    plan: RunPlan, trajectory: PlantTrajectory, tracks: Tracks, theta_initial: float
) -> list[dict[str, Any]]:
    """Scores per stretch of road and estimator, with the truth that they are held against."""
    scenario, key = plan.scenario, plan.key
    under = under_the_wheel(scenario, trajectory)
    theta, segment = under["theta_true"].to_numpy(), under["segment"].to_numpy()
    estimates = {name: track.TRPAC for name, track in tracks.by_name.items()}
    scores = score_run(
        segment_starts(scenario), segment, theta, theta_initial, estimates, tracks.excited, scenario.step_s
    )
    visible = shown(scenario, trajectory)
    by_shown_time = score_run(
        segment_starts(scenario), segment, theta, theta_initial, estimates, visible, scenario.step_s
    )
    rows = []
    for position, index in enumerate(np.unique(segment)):
        here = segment == index
        road = scenario.road.segments[int(index)]
        truth = {
            "run": key.index,
            "parameter": key.parameter,
            "level": None if math.isnan(key.level) else key.level,
            "number": key.number,
            "seed": scenario.seed,
            "stretch": int(index),
            "surface": road.surface,
            "theta_before": theta_initial if position == 0 else float(theta[np.argmax(here) - 1]),
            "shown_s": float(visible[here].sum()) * scenario.step_s,
            "time_s": float(here.sum()) * scenario.step_s,
        }
        for name, track in tracks.by_name.items():
            part = Track(track.TRPAC[here], track.TRPAC_std[here])
            measures = extra_scores(part, theta[here], tracks.excited[here], visible[here], scenario.step_s)
            measures["shown_convergence_time_s"] = by_shown_time[name][position]["convergence_time_s"]
            rows.append(truth | {"estimator": name} | scores[name][position] | measures)
    return rows


def shown(scenario: Scenario, trajectory: PlantTrajectory) -> NDArray[np.bool_]:
    """Whether the wheel's true slip and load show theta at all, d mu / d theta at least 0.1, shape (n,).

    It is the plant's truth, no estimator's view: where it is false nobody could tell the road's friction from force
    and slip.
    """
    column, car = WHEELS.index(scenario.wheel), scenario.vehicle.to_core()
    values = (trajectory.theta[:, column], trajectory.slip[:, column], trajectory.vertical_load_n[:, column])
    return np.array([_shows(t, s, f, car) for t, s, f in zip(*(v.tolist() for v in values), strict=True)])


def _shows(theta: float, slip: float, load_n: float, car: Vehicle) -> bool:
    if not 0.0 < slip < 1.0 or load_n <= 0.0:
        return False
    return friction_by_theta(theta, slip, load_n, car.longitudinal_stiffness_n) >= LEAST_SENSITIVITY


def extra_scores(
    track: Track, theta: Array, excited: NDArray[np.bool_], visible: NDArray[np.bool_], step_s: float
) -> dict[str, float | None]:
    """Scores beside those of a single run: a fixed band, the shown time, coverage of the standard deviation."""
    error = np.abs(track.TRPAC - theta)
    outside = np.flatnonzero(error > BAND)
    first = int(outside[-1]) + 1 if len(outside) else 0
    clock = np.cumsum(excited) * step_s
    late = visible & (np.cumsum(visible) > 0.7 * visible.sum())
    covered = error <= COVERAGE_DEVIATIONS * track.TRPAC_std
    stated = bool(np.isfinite(track.TRPAC_std).all())
    return {
        "error_end": float(track.TRPAC[-1] - theta[-1]),
        "error_mean": float(error.mean()),
        "error_shown_late": float(error[late].mean()) if late.any() else None,
        "band_time_s": float(clock[first]) if first < len(error) else None,
        "std_end": float(track.TRPAC_std[-1]) if stated else None,
        "std_mean": float(track.TRPAC_std.mean()) if stated else None,
        "covered_share": float(covered.mean()) if stated else None,
        "covered_share_shown": float(covered[visible].mean()) if stated and visible.any() else None,
        "covered_end": float(covered[-1]) if stated else None,
    }
