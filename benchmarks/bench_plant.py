"""Speed of the plant on the paper's simulation scenario; prints JSON.

python benchmarks/bench_plant.py
"""

import json
import time
from pathlib import Path

from scenarios.files import load_scenario
from scenarios.plant import drive

SCENARIO = Path(__file__).parents[1] / "scenarios" / "paper_simulation.yaml"
ROUNDS = 30


def main() -> None:
    scenario = load_scenario(SCENARIO)
    begin = time.perf_counter()
    drive(scenario)  # compiles, or loads what an earlier run compiled
    first_s = time.perf_counter() - begin
    # The whole of end.time_s is simulated and cut afterwards.
    steps = round(scenario.end.time_s / scenario.step_s)
    durations = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        drive(scenario)
        durations.append(time.perf_counter() - begin)
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
