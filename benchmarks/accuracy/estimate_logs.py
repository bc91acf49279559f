"""How far off are the estimator, DE and the peers on logs that others made, where the true peak friction is known?

    python -m benchmarks.accuracy.estimate_logs DIR [--write lab/2026-11-29_estimates_on_foreign_logs.md]

DIR is the folder that holds vehicle_logs/. With --write the tables between the markers of that document are replaced.
All wheels count row by row. One clock for all: the rows in which DE's excitation flag is up at the wheel.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.report import markdown, write_between
from scenarios.files import VehicleFile, load_vehicle
from scenarios.peers import PEER_NAMES
from sim2real.cases.case import FOLDER as CASES
from sim2real.cases.case import MAPPINGS, load_case, stages
from sim2real.logs import load_mapping, read_log
from sim2real.replay.camera import CameraSide
from sim2real.replay.inputs import Inputs, make_inputs
from sim2real.replay.run import DYNAMICS, OURS, Replay, Trace, replay
from sim2real.replay.score import score
from trpac_core.estimator import RoadClass
from trpac_core.vehicle import WHEELS
from trpac_core.vision.classes import CLASS_THETA, Surface
from trpac_core.vision.preview import PreviewConfig

Array = NDArray[np.float64]

PLANTS = {
    "ocd_nominal_pulses_snow": "open_car_dynamics",
    "ocd_nominal_cruise": "open_car_dynamics",
    "chrono_tmeasy_pulses_wet": "chrono",
    "m8_pulses_wet": "m8_model",
    "crmb1_accel_brake_jump": "commonroad",
}
"""Logs with true friction, and the case that holds their car."""
ELASTIC_SLIP = (0.002, 0.01)
"""Slips between which a simulator's own stiffness is read from its truth [-]."""
CAMERA_PERIOD_S = 0.05
CLASSES = f"{OURS}, right classes"

BMW_LOG = "bmw_m8_roadview/accel_coast_absbrake.csv"
BMW_PEAK = 1.15
"""Deceleration held over the ABS stop, 11.3 m/s^2 over 1 s, in g: ABS keeps the tyres near the peak, the road is dry
throughout, and air drag is below 0.03 of it [-]."""
UCD_LOG = "ucd_tvidano/LF_mu0.80.csv"
UCD_UNTIL_S = 2.02
"""After 0.15 s of braking the wheel is locked for good: the log is cut to the shortest that is read [s]."""
UCD_CAR = {"mass_kg": 2714.0, "wheel_radius_m": 0.4013, "wheel_inertia_kg_m2": 2.55, "stiffness_n": 133_000.0}
"""Quarter car: radius from free rolling, inertia from the wheel's equation in the log; C_x is 20 times the load."""
UCD_PEAK = 1.17
"""Greatest deceleration in the log, in g: the file's name says 0.80, its own car brakes harder [-]."""


@dataclass(frozen=True)
class Drive:
    """A log with its car, made ready, and the true peak friction under each wheel, shape (n, 4), NaN if unknown."""

    log: str
    car: str
    inputs: Inputs
    truth: Array


def plants(data: Path) -> Iterator[Drive]:
    """The simulators of others, with three cars: as published, as diagnosed, with the simulator's own stiffness."""
    folder = data / "vehicle_logs"
    for name, case_name in PLANTS.items():
        case = load_case(case_name)
        truth = pd.read_csv(folder / "plants" / f"{name}_truth.csv")
        published = load_vehicle(CASES / case_name / "vehicle.yaml")
        diagnosed = stages(case_name, folder)[-1].model.vehicle
        last = next((s.mapping for s in reversed(case.steps) if s.mapping), None)
        cars = (
            ("as published", published, case.mapping),
            ("as diagnosed", diagnosed, last or case.mapping),
            ("own C_x", _stiffened(diagnosed, truth), last or case.mapping),
        )
        for label, car, mapping in cars:
            own = CASES / case_name / mapping
            columns = load_mapping(own if own.exists() else MAPPINGS / mapping)
            inputs = make_inputs(read_log(folder / "plants" / f"{name}.csv", columns), car)
            peak = np.column_stack([np.interp(inputs.time_s, truth["t"], truth[f"mu_{w}"]) for w in WHEELS])
            yield Drive(name, label, inputs, peak)


def _stiffened(car: VehicleFile, truth: pd.DataFrame) -> VehicleFile:
    """The car with the mean stiffness that the simulator's own forces and slips have."""
    found = []
    for w in WHEELS:
        small = truth[f"kappa_{w}"].abs().between(*ELASTIC_SLIP)
        slope = np.polyfit(truth[f"kappa_{w}"][small], truth[f"Fx_{w}"][small], 1)[0]
        found.append(slope / 1.27)
    tyre = car.tyre.model_copy(update={"longitudinal_stiffness_n": float(np.mean(found))})
    return car.model_copy(update={"tyre": tyre})


def real(data: Path, scratch: Path) -> Iterator[Drive]:
    """The real car whose peak can be argued, and the quarter car of which one run obeys the wheel's equation."""
    folder = data / "vehicle_logs"
    columns = load_mapping(MAPPINGS / "bmw_m8_roadview.yaml")
    for label, car in (
        ("as published", load_vehicle(CASES / "bmw_m8" / "vehicle.yaml")),
        ("as diagnosed", stages("bmw_m8", folder)[-1].model.vehicle),
    ):
        inputs = make_inputs(read_log(folder / BMW_LOG, columns), car)
        yield Drive("bmw_m8 (real)", label, inputs, np.full((len(inputs), 4), BMW_PEAK))
    raw = pd.read_csv(folder / UCD_LOG)
    raw = raw[raw["t"] <= UCD_UNTIL_S]
    inputs = make_inputs(read_log(_quarter_car(raw, scratch)), _ucd_vehicle())
    yield Drive("ucd LF_mu0.80", "from the log", inputs, np.full((len(inputs), 4), UCD_PEAK))


def _quarter_car(raw: pd.DataFrame, scratch: Path) -> Path:
    """One wheel's log as four alike wheels; acceleration and position from the speed."""
    step_s = float(np.median(np.diff(raw["t"])))
    table = {"time_s": raw["t"], **{f"wheel_torque_{w}_nm": raw["T"] for w in WHEELS}}
    table |= {f"wheel_speed_{w}_rad_s": raw["w"] for w in WHEELS}
    table |= {
        "vehicle_speed_m_s": raw["U"],
        "accel_x_m_s2": np.gradient(raw["U"], step_s),
        "position_m": np.cumsum(raw["U"]) * step_s,
    }
    path = scratch / "quarter_car.parquet"
    pd.DataFrame(table).to_parquet(path)
    return path


def _ucd_vehicle() -> VehicleFile:
    """Four quarter cars: the same load on all wheels, none shifted."""
    values = load_vehicle(CASES / "open_car_dynamics" / "vehicle.yaml").model_dump(by_alias=True)
    own = {k: v for k, v in UCD_CAR.items() if k != "stiffness_n"}
    values |= own | {
        "name": "quarter-car",
        "cog_height_m": 0.0,
        "cog_to_rear_axle_m": values["wheelbase_m"] / 2.0,
    }
    values["tyre"] = {"model": "modified_dugoff", "longitudinal_stiffness_n": UCD_CAR["stiffness_n"]}
    return VehicleFile.model_validate(values)


def with_classes(d: Drive) -> Replay:
    """Our estimator with a camera that is always right: the class nearest to the truth, a preview distance ahead."""
    preview = PreviewConfig()
    place = np.nan_to_num(d.inputs.position_m)
    every = max(round(CAMERA_PERIOD_S / d.inputs.step_s), 1)
    frames: dict[int, RoadClass | None] = {}
    for row in range(0, len(d.inputs), every):
        ahead = min(int(np.searchsorted(place, place[row] + preview.P_0_m)), len(place) - 1)
        frames[row] = RoadClass(min(Surface, key=lambda s: abs(CLASS_THETA[s] - d.truth[ahead, 0])), 0.9)
    return replay(d.inputs, CameraSide("made from the truth", frames, frames, preview))


def judged(d: Drive, name: str, trace: Trace, clock: NDArray[np.bool_], seen: NDArray[np.bool_]) -> dict:
    """A row of the table."""
    moving = np.repeat(d.inputs.moving[:, None], len(WHEELS), axis=1)
    step_s = d.inputs.step_s

    def over(rows: NDArray[np.bool_]) -> dict:
        return asdict(score(trace.peak, trace.peak_std, d.truth, rows & moving, step_s))

    return {
        "log": d.log,
        "car": d.car,
        "estimator": name,
        "excited_share": float((trace.excited & moving).sum() / moving.sum()),
        "excited": over(clock),
        "seen": over(seen),
        "not_seen": over(~seen),
        "all": over(np.ones_like(moving)),
    }


def measure(drives: Iterator[Drive]) -> Iterator[dict]:
    for d in drives:
        print(f"{d.log}, {d.car}: {len(d.inputs)} rows", file=sys.stderr, flush=True)
        done = replay(d.inputs, peers=True)
        clock, seen = done.traces[DYNAMICS].excited, done.seen
        yield judged(d, f"{OURS}, no camera", done.traces[OURS], clock, seen)
        for name in PEER_NAMES:
            yield judged(d, name, done.traces[name], clock, seen)
        fused = with_classes(d)
        yield judged(d, CLASSES, fused.traces[OURS], clock, seen)


def table(rows: list[dict]) -> str:
    """The rows as a table of markdown."""
    heads = (
        "log",
        "car",
        "estimator",
        "excited",
        "error, excited",
        "within 2 std",
        "error, seen",
        "within 2 std",
        "std, seen",
        "error, not seen",
        "within 2 std",
        "std, not seen",
    )
    lines, before = [], ("", "")
    for row in rows:
        head = (row["log"], row["car"])
        cells = [*(head if head != before else ("", "")), row["estimator"], _percent(row["excited_share"])]
        for part in ("excited", "seen", "not_seen"):
            of = row[part]
            cells += [_number(of["mean_abs"]), _percent(of["within_2_std"])]
            cells += [_number(of["mean_std"])] if part != "excited" else []
        lines.append(cells)
        before = head
    return markdown(heads, lines)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.0f} %"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder that holds vehicle_logs/")
    parser.add_argument("--write", type=Path, help="document whose tables are replaced")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        driven = list(measure(real(arguments.data, Path(scratch))))
        simulated = list(measure(plants(arguments.data)))
    text = f"Simulators of others:\n\n{table(simulated)}\n\nArgued peaks:\n\n{table(driven)}"
    print(text)
    if arguments.write is not None:
        write_between(arguments.write, text)


if __name__ == "__main__":
    main()
