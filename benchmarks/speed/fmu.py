"""Cost of set-3, doStep, get-3 through fmpy: ``python -m benchmarks.speed.fmu [--out FILE.json]``.

Three things take turns in one run, so that a busy machine slows all of them alike: an empty pythonfmu slave, the
unit, and the estimator's own step without FMI. Figures are medians over rounds [us].
"""

from __future__ import annotations

import argparse
import itertools
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
from pythonfmu import FmuBuilder

from benchmarks.report import machine
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.files import file_sha256
from trpac_core.sensors import Sensors

STEP_S = 0.001
STEPS = 2000
ROUNDS = 9
SIGNALS = (52.0, 150.0, 15.0)
INPUTS = ("wheel_speed", "wheel_torque", "vehicle_speed")
OUTPUTS = ("TRPAC", "K_v", "slip")

EMPTY_SLAVE = f"""
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Empty(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for name in {INPUTS + OUTPUTS}:
            setattr(self, name, 0.0)
            causality = Fmi2Causality.input if name in {INPUTS} else Fmi2Causality.output
            self.register_variable(Real(name, causality=causality))

    def do_step(self, current_time, step_size):
        return True
"""


def build_empty(folder: Path) -> Path:
    """An empty pythonfmu slave with the same three inputs and outputs, unpacked."""
    script = folder / "empty_slave.py"
    script.write_text(EMPTY_SLAVE)
    return unpack_unit(FmuBuilder.build_FMU(script, dest=folder), folder / "empty")


def opened(folder: Path) -> tuple[FMU2Slave, dict[str, int]]:
    """An initialised instance and its value references by name."""
    description = read_model_description(str(folder), validate=False)
    unit = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=folder.name,
    )
    started = time.perf_counter()
    unit.instantiate()
    print(f"{folder.name}: instantiated in {(time.perf_counter() - started) * 1e3:.0f} ms", file=sys.stderr)
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    return unit, {v.name: v.valueReference for v in description.modelVariables}


def through_fmi(unit: FMU2Slave, references: dict[str, int]) -> Callable[[], None]:
    """One round of set, step, get."""
    inputs, outputs = [references[n] for n in INPUTS], [references[n] for n in OUTPUTS]
    steps = itertools.count()

    def work() -> None:
        for index in itertools.islice(steps, STEPS):
            unit.setReal(inputs, SIGNALS)
            unit.doStep(index * STEP_S, STEP_S)
            unit.getReal(outputs)

    return work


def without_fmi() -> Callable[[], None]:
    """One round of the estimator's own steps."""
    estimator = TrpacEstimator(EstimatorConfig())

    def work() -> None:
        for _ in range(STEPS):
            estimator.step(STEP_S, Sensors(*SIGNALS))

    return work


def medians_us(rounds: dict[str, Callable[[], None]]) -> dict[str, float]:
    """Median cost of a step of each [us]; they take turns."""
    times: dict[str, list[float]] = {name: [] for name in rounds}
    for turn in range(ROUNDS + 1):
        for name, work in rounds.items():
            started = time.perf_counter()
            work()
            if turn:
                times[name].append((time.perf_counter() - started) / STEPS * 1e6)
    return {name: round(statistics.median(values), 2) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="JSON file; standard output by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bench-fmu-") as name:
        folder = Path(name)
        archive = build_unit(UNITS["TrpacEstimator"], folder / "TrpacEstimator.fmu")
        empty, unit = opened(build_empty(folder)), opened(unpack_unit(archive, folder / "unit"))
        cost = medians_us(
            {
                "empty_slave": through_fmi(*empty),
                "unit": through_fmi(*unit),
                "estimator": without_fmi(),
            }
        )
        result = {
            "what": "set-3, doStep, get-3 through fmpy; medians over rounds [us]",
            "cost_us": cost,
            "unit_over_empty_slave_us": round(cost["unit"] - cost["empty_slave"], 2),
            "boundary_us": round(cost["unit"] - cost["estimator"], 2),
            "boundary_over_empty_slave_us": round(cost["unit"] - cost["estimator"] - cost["empty_slave"], 2),
            "steps": STEPS,
            "rounds": ROUNDS,
            "unit_sha256": file_sha256(archive),
            "machine": machine(),
            "versions": {p: version(p) for p in ("fmpy", "pythonfmu")},
        }
        for instance, _ in (empty, unit):
            instance.terminate()
            instance.freeInstance()
    text = json.dumps(result, indent=2)
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(text + "\n")
    else:
        print(text)


if __name__ == "__main__":
    main()
