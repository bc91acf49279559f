"""The best that anyone could do: an estimator that is told the tyre, the loads, the noise and where the road changes.

A Bayes filter over a fine grid of theta, anew from each change of road: its likelihood is that of the used friction in
10 ms means, by the described curve at the measured slip. What it misses, noise hides.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarios.plant.pipeline import PlantTrajectory, drive
from scenarios.sweep.draw import RunPlan
from scenarios.sweep.run import Array, Track, Tracks, identifiable, rows_of, signals_of
from trpac_core.estimator_data import EstimatorConfig
from trpac_core.robust.blocks import Means, reading
from trpac_core.robust.tyres import dugoff
from trpac_core.vehicle import WHEELS

NAME = "oracle"
GRID = np.arange(0.05, 1.2, 0.0005)
"""Cells of theta [-]."""
BLOCK = 10
"""Steps of 1 ms in a mean."""
LEAST_M_S = 1.0
"""Speed below which slip is not read [m/s]."""


def oracle_rows(plan: RunPlan) -> list[dict[str, Any]]:
    """The oracle's scores per stretch of a run, as `scenarios.sweep.run.run_plan` gives those of others."""
    trajectory = drive(plan.scenario)
    theta = over(plan, trajectory)
    tracks = Tracks(
        {NAME: Track(theta, np.full(len(theta), np.nan))}, identifiable(plan.scenario, trajectory)
    )
    return rows_of(plan, trajectory, tracks, float(theta[0]))


def over(plan: RunPlan, trajectory: PlantTrajectory) -> Array:
    """The likeliest theta by all that was read since the last change of road, shape (n,) [-]."""
    scenario, column = plan.scenario, WHEELS.index(plan.scenario.wheel)
    truth, load = trajectory.theta[:, column], trajectory.vertical_load_n[:, column]
    car, noise = scenario.vehicle.to_core(), scenario.sensors
    omega, torque, speed, _ = (np.array(signal) for signal in signals_of(plan, trajectory))
    radius_m, inertia = car.wheel_radius_m, car.wheel_inertia_kg_m2
    said, likely, friction = np.full(len(truth), EstimatorConfig().theta_initial), np.zeros(len(GRID)), 0.0
    before: Means | None = None
    for start in range(0, len(truth) - BLOCK, BLOCK):
        rows = slice(start, start + BLOCK)
        means = (float(signal[rows].mean()) for signal in (omega, torque, speed, load))
        now = Means(*means, BLOCK * scenario.step_s, BLOCK)
        if start and truth[start - BLOCK] != truth[start + BLOCK - 1]:
            likely, before = np.zeros(len(GRID)), None
        if before is not None and before.vehicle_speed_m_s > LEAST_M_S:
            read = reading(before, now, friction, inertia, radius_m, car.rolling_resistance)
            friction, arm_nm = read.friction, radius_m * read.load_n
            curve = dugoff(GRID, np.abs(read.slip), read.load_n, car.longitudinal_stiffness_n)
            spun = 2.0 * (inertia / read.duration_s * noise.wheel_speed_noise_rad_s) ** 2
            of_force = (noise.wheel_torque_noise_nm**2 + spun) / (BLOCK * arm_nm**2)
            of_rim = (radius_m * noise.wheel_speed_noise_rad_s) ** 2 + noise.vehicle_speed_noise_m_s**2
            of_slip = of_rim / (BLOCK * read.speed_m_s**2)
            variance = of_force + curve.by_slip**2 * of_slip
            error = read.friction - np.copysign(curve.friction, read.slip)
            likely = likely - 0.5 * (error**2 / variance + np.log(variance))
        if likely.any():
            said[start + BLOCK :] = GRID[likely.argmax()]
        before = now
    return said
