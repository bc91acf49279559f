"""One run of a sweep: plant, sensors, camera and estimators in Python, and scores per stretch of road."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenarios.files import Scenario
from scenarios.fmu_client.estimator import parameters
from scenarios.metrics import ESTIMATORS, score_run
from scenarios.peers import PeerSetup
from scenarios.plant.pipeline import PlantTrajectory, drive
from scenarios.plant.sensors import make_scenario_log
from scenarios.runner import segment_starts, under_the_wheel
from scenarios.sweep.camera import RenderedFrames, road_classes
from scenarios.sweep.draw import RunPlan
from scenarios.sweep.trackers import METHODS, make_peer
from scenarios.vision_overlay import image_estimator
from trpac_core.dife import LEAST_SENSITIVITY
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.settings import ESTIMATOR_PARAMETERS
from trpac_core.sensors import Sensors
from trpac_core.tyre import GREATEST_THETA, LEAST_THETA, friction_by_theta
from trpac_core.vehicle import WHEELS, Vehicle
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife

Array = NDArray[np.float64]
Frames = dict[int, RoadClass] | RenderedFrames

BAND = 0.02
"""Error within which an estimate has converged, whatever the step of friction: the paper's steady-state error [-]."""
COVERAGE_DEVIATIONS = 2.0
"""Half width of the interval whose coverage is scored, in standard deviations [-]."""


@dataclass(frozen=True)
class Track:
    """One estimator over a run: estimate and its standard deviation (NaN without one), shape (n,) each [-]."""

    TRPAC: Array
    TRPAC_std: Array


@dataclass(frozen=True)
class Tracks:
    """All estimators over a run, and DIFE's start/stop flag, by which times of all are counted, shape (n,)."""

    by_name: dict[str, Track]
    excited: NDArray[np.bool_]


def run_plan(plan: RunPlan, estimators: list[str], unit: dict[str, float]) -> list[dict[str, Any]]:
    """Rows of a run: a score per stretch of road and estimator."""
    trajectory = drive(plan.scenario)
    config = believed_config(plan, unit)
    tracks = step_all(plan, trajectory, config, estimators)
    return rows_of(plan, trajectory, tracks, config.theta_initial)


def believed_config(plan: RunPlan, unit: dict[str, float]) -> EstimatorConfig:
    """The estimator's configuration as in the unit, with the run's wrong assumptions."""
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
    """Sensor signals of the wheel: wheel speed, torque, vehicle speed and acceleration, n values each."""
    log, wheel = make_scenario_log(plan.scenario, trajectory), plan.scenario.wheel
    torque = log[f"wheel_torque_{wheel}_nm"].to_numpy() * plan.believed.torque_factor
    speed = log["vehicle_speed_m_s"].to_numpy() + plan.speed_bias_m_s
    columns = (log[f"wheel_speed_{wheel}_rad_s"].to_numpy(), torque, speed, log["accel_x_m_s2"].to_numpy())
    return [column.tolist() for column in columns]


def step_all(
    plan: RunPlan, trajectory: PlantTrajectory, config: EstimatorConfig, estimators: list[str]
) -> Tracks:
    """Estimates of ours and of the peers over the run; raises ValueError where one is not finite."""
    frames, ife = camera_of(plan, trajectory)
    estimator = TrpacEstimator(replace(config, method=Method.DIFE), ife)
    step_s = plan.scenario.step_s
    methods = {
        name: TrpacEstimator(replace(config, method=Method.of(name)), ife)
        for name in estimators
        if name in METHODS
    }
    peers = {
        name: make_peer(name, peer_setup(plan, config))
        for name in estimators
        if name not in (*ESTIMATORS, *METHODS)
    }
    names = [*ESTIMATORS, *methods, *peers]
    theta = np.empty((len(trajectory), len(names)))
    std = np.full((len(trajectory), len(names)), np.nan)
    excited = np.empty(len(trajectory), dtype=bool)
    fused = names.index("DIFE")
    for row, (omega, torque, speed, acceleration) in enumerate(
        zip(*signals_of(plan, trajectory), strict=True)
    ):
        sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        frame = frames.get(row)
        estimate = estimator.step(step_s, sensors, frame)
        theta[row, : len(ESTIMATORS)] = estimate.TRPAC_image, estimate.TRPAC_dynamics, estimate.TRPAC
        std[row, fused] = estimate.TRPAC_std
        excited[row] = estimate.excitation_flag
        for column, other in enumerate(methods.values(), start=len(ESTIMATORS)):
            its = other.step(step_s, sensors, frame)
            theta[row, column], std[row, column] = its.TRPAC, its.TRPAC_std
        for column, peer in enumerate(peers.values(), start=len(ESTIMATORS) + len(methods)):
            of_peer = peer.step(step_s, sensors)
            theta[row, column], std[row, column] = of_peer.TRPAC, of_peer.TRPAC_std
    strange = [name for i, name in enumerate(names) if not np.isfinite(theta[:, i]).all()]
    if strange:
        raise ValueError(f"{strange[0]} gives an estimate that is no finite number.")
    chosen = {name: Track(theta[:, i], std[:, i]) for i, name in enumerate(names) if name in estimators}
    return Tracks(chosen, excited)


def camera_of(plan: RunPlan, trajectory: PlantTrajectory) -> tuple[Frames, Ife | None]:
    """Frames by step, and the image estimator where they are pictures."""
    scenario, camera = plan.scenario, plan.camera
    if camera.source == "none":
        return {}, None
    if camera.source == "rendered":
        cv2.setNumThreads(1)
        return RenderedFrames(scenario, trajectory, camera, plan.camera_seed), image_estimator(scenario)
    return road_classes(scenario, trajectory, camera, plan.camera_seed), None


def peer_setup(plan: RunPlan, config: EstimatorConfig) -> PeerSetup:
    """Settings of the peers, equal to those of our estimator."""
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
    """Scores per stretch of road and estimator, with the true values."""
    scenario, key = plan.scenario, plan.key
    under = under_the_wheel(scenario, trajectory)
    theta, segment = under["theta_true"].to_numpy(), under["segment"].to_numpy()
    estimates = {name: track.TRPAC for name, track in tracks.by_name.items()}
    scores = score_run(
        segment_starts(scenario), segment, theta, theta_initial, estimates, tracks.excited, scenario.step_s
    )
    identified = identifiable(scenario, trajectory)
    by_shown_time = score_run(
        segment_starts(scenario), segment, theta, theta_initial, estimates, identified, scenario.step_s
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
            "shown_s": float(identified[here].sum()) * scenario.step_s,
            "time_s": float(here.sum()) * scenario.step_s,
        }
        for name, track in tracks.by_name.items():
            part = Track(track.TRPAC[here], track.TRPAC_std[here])
            measures = extra_scores(
                part, theta[here], tracks.excited[here], identified[here], scenario.step_s
            )
            measures["shown_convergence_time_s"] = by_shown_time[name][position]["convergence_time_s"]
            rows.append(truth | {"estimator": name} | scores[name][position] | measures)
    return rows


def identifiable(scenario: Scenario, trajectory: PlantTrajectory) -> NDArray[np.bool_]:
    """Whether theta is identifiable from the wheel's true slip and load, d mu / d theta at least 0.1, shape (n,)."""
    column, car = WHEELS.index(scenario.wheel), scenario.vehicle.to_core()
    values = (trajectory.theta[:, column], trajectory.slip[:, column], trajectory.vertical_load_n[:, column])
    return np.array(
        [_is_identifiable(t, s, f, car) for t, s, f in zip(*(v.tolist() for v in values), strict=True)]
    )


def _is_identifiable(theta: float, slip: float, load_n: float, car: Vehicle) -> bool:
    if not 0.0 < slip < 1.0 or load_n <= 0.0:
        return False
    return friction_by_theta(theta, slip, load_n, car.longitudinal_stiffness_n) >= LEAST_SENSITIVITY


def extra_scores(
    track: Track, theta: Array, excited: NDArray[np.bool_], identified: NDArray[np.bool_], step_s: float
) -> dict[str, float | None]:
    """Further scores: time to a fixed band, error in the identifiable time, coverage of the standard deviation."""
    error = np.abs(track.TRPAC - theta)
    outside = np.flatnonzero(error > BAND)
    first = int(outside[-1]) + 1 if len(outside) else 0
    clock = np.cumsum(excited) * step_s
    late = identified & (np.cumsum(identified) > 0.7 * identified.sum())
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
        "covered_share_shown": float(covered[identified].mean()) if stated and identified.any() else None,
        "covered_end": float(covered[-1]) if stated else None,
    }
