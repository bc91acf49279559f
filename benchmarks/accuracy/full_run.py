"""One run of a sweep in full: every output of the estimator at every step, for figures."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from fmu_src.estimate_outputs import OF_ESTIMATE
from scenarios.metrics import ESTIMATORS, score_run
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from scenarios.runner import Run, segment_starts, under_the_wheel
from scenarios.sweep.draw import RunPlan
from scenarios.sweep.run import believed_config, camera_of, signals_of
from trpac_core.estimator import TrpacEstimator
from trpac_core.sensors import Sensors


def full_run(plan: RunPlan, unit: Mapping[str, float] | None = None) -> Run:
    """A run as `runner.run_scenario` gives it, stepped in Python with the sweep's camera.

    Parameters
    ----------
    plan : RunPlan
        The run.
    unit : mapping, optional
        Parameters by the unit's names, in place of the delivered ones.
    """
    trajectory = drive(plan.scenario)
    frames, ife = camera_of(plan, trajectory)
    estimator = TrpacEstimator(believed_config(plan, dict(unit or {})), ife)
    rows = []
    signals = zip(*signals_of(plan, trajectory), strict=True)
    for row, (omega, torque, speed, acceleration) in enumerate(signals):
        sensors = Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        rows.append(estimator.step(plan.scenario.step_s, sensors, frames.get(row)))
    outputs = pd.DataFrame([{name: read(e) for name, read in OF_ESTIMATE.items()} for e in rows])
    parts = [
        make_scenario_log(plan.scenario, trajectory),
        outputs,
        under_the_wheel(plan.scenario, trajectory),
    ]
    table = pd.concat(parts, axis=1)
    scores = score_run(
        segment_starts(plan.scenario),
        table["segment"].to_numpy(),
        table["theta_true"].to_numpy(),
        float(table["TRPAC_dynamics"].iloc[0]),
        {name: table[column].to_numpy() for name, column in ESTIMATORS.items()},
        table["excitation_flag"].to_numpy(),
        plan.scenario.step_s,
    )
    summary = {"estimators": scores, "method": estimator.config.method.label}
    return Run(plan.scenario, trajectory, pd.DataFrame(), table, summary)
