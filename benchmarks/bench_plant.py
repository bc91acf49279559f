"""Speed of the plant on the paper's simulation scenario, all its effects on; prints JSON.

python benchmarks/bench_plant.py
"""

import json
import time
from pathlib import Path

import numpy as np

from scenarios.files import load_scenario
from scenarios.plant import simulate

SCENARIO = Path(__file__).parents[1] / "scenarios" / "paper_simulation.yaml"
DURATION_S = 9.8  # the manoeuvre, without the coasting after it
ROUNDS = 30


def main() -> None:
    scenario = load_scenario(SCENARIO)
    steps = round(DURATION_S / scenario.step_s)
    torque_nm = scenario.manoeuvre.torque(np.arange(steps + 1) * scenario.step_s)
    begin = time.perf_counter()
    simulate(scenario.vehicle, scenario.road, torque_nm, scenario.step_s)  # compiles, or loads from the cache
    first_s = time.perf_counter() - begin
    durations = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        simulate(scenario.vehicle, scenario.road, torque_nm, scenario.step_s)
        durations.append(time.process_time() - begin)
    best_s, median_s = min(durations), sorted(durations)[ROUNDS // 2]
    print(
        json.dumps(
            {
                "scenario": scenario.name,
                "step_s": scenario.step_s,
                "steps": steps,
                "first_call_s": round(first_s, 3),
                "steps_per_s": {"median": round(steps / median_s), "best": round(steps / best_s)},
                "times_real_time": {
                    "median": round(steps * scenario.step_s / median_s),
                    "best": round(steps * scenario.step_s / best_s),
                },
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
