"""Speed of the plant on the paper's simulation, for several sets of effects."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.files import Scenario, VehicleFile, load_scenario
from scenarios.plant.pipeline import simulate

SCENARIO = Path(__file__).parents[2] / "scenarios" / "paper_simulation.yaml"
DURATION_S = 9.8  # the manoeuvre, without the coasting after it
ROUNDS = 30
LAG = {"tyre_relaxation": {"length_m": 0.3}}
SHAFT = {
    "driveline_compliance": {"stiffness_nm_rad": 1e4, "damping_nm_s_rad": 10.0, "motor_inertia_kg_m2": 0.4}
}


def with_effects(vehicle: VehicleFile, effects: dict[str, dict[str, float]]) -> VehicleFile:
    return VehicleFile.model_validate({**vehicle.model_dump(by_alias=True), "effects": effects})


def measure(scenario: Scenario, vehicle: VehicleFile) -> dict[str, float]:
    steps = round(DURATION_S / scenario.step_s)
    torque_nm = scenario.manoeuvre.torque(np.arange(steps + 1) * scenario.step_s)
    begin = time.perf_counter()
    simulate(vehicle, scenario.road, torque_nm, scenario.step_s)  # compiles, or loads from the cache
    first_s = time.perf_counter() - begin
    durations = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        simulate(vehicle, scenario.road, torque_nm, scenario.step_s)
        durations.append(time.process_time() - begin)
    median_s = sorted(durations)[ROUNDS // 2]
    return {
        "first_call_s": round(first_s, 3),
        "steps_per_s": round(steps / median_s),
        "times_real_time": round(DURATION_S / median_s),
        "times_real_time_best": round(DURATION_S / min(durations)),
    }


def measure_all() -> dict[str, Any]:
    """The paper's scenario with and without effects."""
    scenario = load_scenario(SCENARIO)
    own = dict(scenario.vehicle.effects)
    sets = {
        "as in the paper's scenario": own,
        "no effects": {},
        "with relaxation": {**own, **LAG},
        "with driveline": {**own, **SHAFT},
        "with both": {**own, **LAG, **SHAFT},
    }
    rows = {
        name: measure(scenario, with_effects(scenario.vehicle, effects)) for name, effects in sets.items()
    }
    return {"scenario": scenario.name, "step_s": scenario.step_s, "effects": rows}
