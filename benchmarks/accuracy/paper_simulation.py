"""Accuracy of IFE, DE and DIFE on the paper's simulation, over seeds, tyre stiffness, gains and noise.

Each case is the whole chain: plant, freshly rendered and disturbed pictures of another world, the built unit under
fmpy. Nothing is tuned on any of these cases but for what docs/theory/dynamics.md says. Prints a table, writes JSON.

.venv/bin/python -m benchmarks.accuracy.paper_simulation [--out FILE.json]
"""

import argparse
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.files import Scenario, load_scenario
from scenarios.runner import run_scenario

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "paper_simulation.yaml"


@dataclass(frozen=True)
class Case:
    name: str
    seed: int = 1
    stiffness_n: float = 50_000.0
    noise: float = 1.0
    unit: Mapping[str, float] = field(default_factory=dict)


CASES = (
    *(Case(f"seed {seed}", seed) for seed in range(1, 12)),
    *(Case(f"C_x {stiffness / 1e3:g} kN", stiffness_n=stiffness) for stiffness in (20e3, 40e3, 60e3)),
    Case("noise x 3", noise=3.0),
    Case("gamma 2 1/s", unit={"estimator.gamma": 2.0}),
)


def scenario_of(case: Case, base: Scenario) -> Scenario:
    tyre = base.vehicle.tyre.model_copy(update={"longitudinal_stiffness_n": case.stiffness_n})
    noise = {name: case.noise * value for name, value in base.sensors.model_dump().items()}
    return replace(
        base,
        seed=case.seed,
        vehicle=base.vehicle.model_copy(update={"tyre": tyre}),
        sensors=base.sensors.model_copy(update=noise),
    )


def measure(case: Case, base: Scenario, unit: Path) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="trpac_") as scratch:
        run = run_scenario(scenario_of(case, base), unit, Path(scratch), overrides=case.unit)
    table = run.table
    seen = table["frame_age"] >= 0.0
    class_theta = {"dry": 0.8, "wet": 0.6, "snow_ice": 0.2}
    truth = table["segment"].map(lambda i: class_theta[run.scenario.road.segments[i].surface])
    right = (table["TRPAC_image"] == truth)[seen]
    return {
        "case": case.name,
        "class_right_share": float(right.mean()),
        "class_right_share_where_flagged": float(right[table["flag"][seen]].mean()),
        "flag_share": float(table["flag"][seen].mean()),
        "estimators": run.summary["estimators"],
    }


def shown(results: list[dict[str, Any]]) -> Table:
    table = Table(title="Steady-state error / excited convergence time [s], per stretch")
    for heading in ("case", "class right", "DE 0.3", "DIFE 0.3", "DE 0.5", "DIFE 0.5"):
        table.add_column(heading, justify="left" if heading == "case" else "right")
    for result in results:
        cells = [result["case"], f"{result['class_right_share']:.2f}"]
        for stretch in (1, 2):
            for name in ("DE", "DIFE"):
                score = result["estimators"][name][stretch]
                error, time = score["steady_state_error"], score["convergence_time_s"]
                error_text = "–" if error is None else f"{error:.4f}"
                cells.append(f"{error_text} / {'–' if time is None else f'{time:.2f}'}")
        table.add_row(*cells)
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/accuracy.json"), help="(default: %(default)s)")
    parser.add_argument("--only", help="run the cases whose name contains this")
    options = parser.parse_args()
    base = load_scenario(SCENARIO)
    cases = [case for case in CASES if options.only is None or options.only in case.name]
    with tempfile.TemporaryDirectory(prefix="trpac_") as scratch:
        unit = build_unit(UNITS["TrpacEstimator"], Path(scratch) / "TrpacEstimator.fmu")
        results = [measure(case, base, unit) for case in track(cases, "running")]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    Console().print(shown(results))


if __name__ == "__main__":
    main()
