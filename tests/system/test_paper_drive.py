"""The paper's drive without pictures: classes by bus, at several step sizes, held to accuracy."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from scenarios.files import SensorNoise, load_scenario
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.sensors import Sensors

SCENARIO = load_scenario(Path(__file__).parents[2] / "scenarios" / "paper_simulation.yaml")
NEAR_M = 3.5
"""Where ahead of the front wheel a picture's verdict comes from."""


@lru_cache
def driven(noisy, every=1, seed=1, wrong=False):
    """True theta, and DIFE and DE, at each step of `every` milliseconds."""
    scenario = replace(SCENARIO, seed=seed, sensors=SCENARIO.sensors if noisy else SensorNoise())
    trajectory = drive(scenario)
    log = make_scenario_log(scenario, trajectory).iloc[::every]
    front_m = trajectory.position_m[::every] + scenario.vehicle.to_core().cog_to_front_axle_m
    noise_m_s = float(np.hypot(0.003, 0.29 * 0.01)) if noisy else 1e-6
    estimator = TrpacEstimator(
        EstimatorConfig(vehicle=scenario.vehicle.to_core(), sliding_speed_noise_m_s=noise_m_s)
    )
    columns = ["wheel_speed_fl_rad_s", "wheel_torque_fl_nm", "vehicle_speed_m_s", "accel_x_m_s2"]
    rows = []
    for row, (omega, torque, speed, acceleration) in enumerate(log[columns].to_numpy()):
        frame = None
        if row % max(1, 50 // every) == 0:
            surface = scenario.road.segment_at(front_m[row] + NEAR_M).surface_class
            frame = RoadClass(type(surface)((surface + 1) % 3) if wrong else surface, 0.9)
        sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        estimate = estimator.step(every * scenario.step_s, sensors, frame)
        rows.append((estimate.TRPAC, estimate.TRPAC_dynamics, estimate.excitation_flag))
    return trajectory.theta[::every, 0], np.array(rows, dtype=float)


def late_error(theta, estimate, excited, road):
    """Mean error over the last third of the excited time on a stretch."""
    here = np.flatnonzero((theta == road) & (excited > 0))
    last = here[-len(here) // 3 :]
    return float(np.abs(estimate[last] - road).mean())


@pytest.mark.parametrize("every", [1, 2, 5, 10])
@pytest.mark.parametrize("road", [0.3, 0.5])
def test_without_noise_the_step_size_hardly_matters(every, road):
    """A wheel that gains speed over a step must not be taken for one that bears more force."""
    theta, rows = driven(noisy=False, every=every)
    for estimate in rows[:, :2].T:
        assert late_error(theta, estimate, rows[:, 2], road) < 0.005


@pytest.mark.parametrize("every", [1, 10])
def test_on_the_high_friction_dynamics_alone_hold_their_start(every):
    theta, rows = driven(noisy=False, every=every)
    assert rows[theta == 0.9, 1].min() > 0.75


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("road", [0.3, 0.5])
def test_with_the_scenarios_noise_fusion_settles_within_the_papers_error(seed, road):
    theta, rows = driven(noisy=True, seed=seed)
    assert late_error(theta, rows[:, 0], rows[:, 2], road) < 0.02


@pytest.mark.parametrize("road", [0.3, 0.5])
def test_classes_that_are_all_wrong_do_not_spoil_what_the_tyre_shows(road):
    theta, rows = driven(noisy=True, wrong=True)
    assert late_error(theta, rows[:, 0], rows[:, 2], road) < 0.02
