"""Does the interval hold on cars that differ from their description, on other tyres, and before the tyre slips?

    python -m benchmarks.accuracy.robust [--drives 50] [--first 7000] [--logs DIR] [--out FILE.json]

Prints a table of the methods dife and robust over sets of drives. `covered` is the share of rows whose interval holds
the true friction, `worst` that of the worst drive; `sure, wrong` the share of rows with an interval below 0.4 that does
not; `useful` the share of rows with an interval below 0.3 among those in which more than 0.7 of the peak is used;
`narrow, right` the share of rows with an interval below 0.3 that holds the truth; `error` the mean error of TRPAC.
DIR is the folder that holds vehicle_logs/ with logs of other simulators; `ucd_tvidano` is left out: its loads and
torques do not fit its own forces. They are described exactly, or with a fault or a guessed stiffness.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from rich.progress import track

from benchmarks.accuracy.estimate_logs import plants
from benchmarks.accuracy.random_drives import (
    CAR_FILE,
    COLUMNS,
    FRAME_S,
    NEAR_M,
    NOISE,
    STEP_S,
    CarError,
    Drive,
    Tyre,
    make_drive,
    told,
)
from benchmarks.report import markdown
from scenarios.files import RoadFile, load_road, load_vehicle
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log
from sim2real.logs import read_log
from sim2real.replay.inputs import Inputs, make_inputs
from sim2real.replay.run import readings
from trpac_core.estimator import EstimatorConfig, RoadClass, Sensors, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.vision.classes import Surface

METHODS = (Method.DIFE, Method.ROBUST)
EVERY = 10
"""Of the rows of a drive of 1 ms steps one in so many counts: they are alike."""
LEAST_M_S = 1.5
"""Rows of a slower car do not count: slip is not used there [m/s]."""
SURE, NARROW, HARD = 0.4, 0.3, 0.7
"""Widths of an interval that claims much, and that is of use; share of the peak from which a wheel is driven hard."""
OFF = CarError(mass=0.05, radius=0.01, stiffness=0.3)
"""Errors of a car that is off in all three, either way."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """What an estimator did on a drive; shares of rows."""

    covered: float
    sure_wrong: float
    useful: float
    narrow_right: float
    error: float


@dataclass(frozen=True)
class Rows:
    """Estimates and truth, shape (n,) each."""

    theta: Array
    low: Array
    high: Array
    truth: Array
    used: Array

    def score(self) -> Score:
        """The shares; NaN where no row counts."""
        inside = (self.low <= self.truth) & (self.truth <= self.high)
        width, hard = self.high - self.low, self.used > HARD * self.truth
        narrow = width < NARROW
        return Score(
            _mean(inside),
            _mean((width < SURE) & ~inside),
            _mean(narrow[hard]),
            _mean(inside[narrow]),
            _mean(np.abs(self.theta - self.truth)),
        )


def _mean(values: NDArray[np.generic]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def over(drive: Drive, method: Method, camera: bool) -> Rows:
    """The estimator over a drive of the front left wheel."""
    estimator = TrpacEstimator(replace(told(drive.noise), method=method))
    said = []
    for row, (omega, torque, speed, acceleration) in enumerate(drive.rows.tolist()):
        sensors = Sensors(omega, torque, max(speed, 0.0), longitudinal_acceleration_m_s2=acceleration)
        e = estimator.step(STEP_S, sensors, drive.frames.get(row) if camera else None)
        if row % EVERY == EVERY - 1 and speed > LEAST_M_S:
            used = abs(e.tyre_force_n) / e.load_n
            said.append((e.TRPAC, e.TRPAC_low, e.TRPAC_high, drive.theta[row], used))
    return Rows(*np.array(said).T)


def drawn_car(seed: int) -> Drive:
    return make_drive(seed)


def car_off(seed: int) -> Drive:
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], 3)
    return make_drive(
        seed,
        CarError(mass=signs[0] * OFF.mass, radius=signs[1] * OFF.radius, stiffness=signs[2] * OFF.stiffness),
    )


def other_formula(seed: int) -> Drive:
    return make_drive(seed, tyre=Tyre.drawn(np.random.default_rng(seed), foreign=False))


def foreign_tyre(seed: int) -> Drive:
    return make_drive(seed, CarError(), tyre=Tyre.drawn(np.random.default_rng(seed), foreign=True))


SETS: dict[str, tuple[Callable[[int], Drive], bool]] = {
    "tolerances drawn, camera": (drawn_car, True),
    "all three off, camera": (car_off, True),
    "other formula, camera": (other_formula, True),
    "tolerances drawn": (drawn_car, False),
    "all three off": (car_off, False),
    "other formula": (other_formula, False),
    "foreign tyre": (foreign_tyre, False),
}
"""How a drive is made, and whether a camera looks."""


def on_drive(make: Callable[[int], Drive], camera: bool, seed: int) -> dict[str, Score]:
    """Scores by method on a drive."""
    drive = make(seed)
    return {method.label: over(drive, method, camera).score() for method in METHODS}


@dataclass(frozen=True)
class Recorded:
    """A car of another simulator: whether it is described exactly, and what it read with the truth, shape (n, 4)."""

    truly: bool
    parts: tuple[tuple[Inputs, Array], ...]


def recorded_case(folder: Path) -> Recorded:
    """A case of CommonRoad's multi-body car: fit and hold-out; that friction is another changes nothing of the car."""
    car = load_vehicle(folder / "vehicle.yaml")
    told_of = json.loads((folder.parent / "truth.json").read_text(encoding="utf-8"))[folder.name]
    factor, parts = np.broadcast_to(told_of["fault"].pop("mu_factor", 1.0), 4), []
    for part in ("fit", "holdout"):
        inputs = make_inputs(read_log(folder / f"{part}.csv"), car)
        road, core = load_road(folder / f"road_{part}.yaml"), inputs.vehicle
        under = [
            [road.segment_at(x + ahead_m).mu_left for x in inputs.position_m]
            for ahead_m in (core.cog_to_front_axle_m, -core.cog_to_rear_axle_m)
        ]
        parts.append((inputs, np.repeat(under, 2, axis=0).T * factor))
    return Recorded(not (told_of["fault"] or told_of["not_in_vehicle_yaml"]), tuple(parts))


def recorded(data: Path) -> list[Recorded]:
    """The cases, and the logs of the other simulators: told their own stiffness, and told what is published."""
    cases = sorted((data / "vehicle_logs" / "foreign_commonroad").glob("case_*"))
    others = [d for d in plants(data) if d.car in ("own C_x", "as published")]
    return [
        *map(recorded_case, cases),
        *(Recorded(d.car == "own C_x", ((d.inputs, d.truth),)) for d in others),
    ]


def on_record(record: Recorded) -> dict[str, Score]:
    """Scores by method of one front and one rear wheel without a camera."""
    scores = {}
    for method in METHODS:
        rows = []
        for inputs, truth in record.parts:
            for wheel in (0, 2):
                config = EstimatorConfig(
                    method=method,
                    vehicle=inputs.vehicle,
                    front_axle=wheel < 2,
                    sliding_speed_noise_m_s=float(inputs.noise.sliding_speed_m_s[wheel]),
                )
                estimator = TrpacEstimator(config)
                for sensors, mu in zip(readings(inputs, wheel), truth[:, wheel], strict=True):
                    e = estimator.step(inputs.step_s, sensors)
                    if sensors.vehicle_speed_m_s > LEAST_M_S:
                        used = abs(e.tyre_force_n) / e.load_n
                        rows.append((e.TRPAC, e.TRPAC_low, e.TRPAC_high, mu, used))
        scores[method.label] = Rows(*np.array(rows).T).score()
    return scores


ONSETS = (
    ("dry", 0.9, "snow_ice", 0.2),
    ("dry", 0.9, "wet", 0.5),
    ("snow_ice", 0.2, "dry", 0.9),
)
"""Roads before and after the change, with their friction."""
CHANGE_M, ONSET_M = 40.0, 66.0
"""Where the road changes, and where the driver brakes [m]."""


@dataclass(frozen=True)
class Onset:
    """TRPAC and its interval at the onset of braking, and the truth [-]."""

    right_class: bool
    error: float
    inside: bool


def at_onset(seed: int) -> dict[str, list[Onset]]:
    """Estimates as the driver begins to brake, coasting or cruising before, the class right or wrong."""
    rng = np.random.default_rng(seed)
    before, mu_before, after, mu_after = ONSETS[seed % len(ONSETS)]
    mu_after *= rng.uniform(0.9, 1.1)
    speed_m_s, torque_nm = rng.uniform(10.0, 30.0), float(rng.choice([0.0, 30.0]))
    car = load_vehicle(CAR_FILE)
    core = car.to_core()
    parts = [
        {"start_m": 0.0, "mu_left": mu_before, "mu_right": mu_before, "surface": before},
        {"start_m": CHANGE_M, "mu_left": mu_after, "mu_right": mu_after, "surface": after},
    ]
    road = RoadFile.model_validate({"schema": 1, "segments": parts})
    count = round(ONSET_M / speed_m_s * 1.2 / STEP_S)
    run = simulate(
        car,
        road,
        np.full((count, 4), torque_nm),
        STEP_S,
        speed_m_s,
        initial_position_m=-core.cog_to_front_axle_m,
    )
    front_m = run.position_m + core.cog_to_front_axle_m
    rows = make_log(run, car, NOISE, seed)[COLUMNS].to_numpy()
    true = Surface[after.upper()]
    wrong = Surface((true + rng.integers(1, 3)) % 3)
    told_of: dict[str, list[Onset]] = {method.label: [] for method in METHODS}
    for method in METHODS:
        for said_class in (true, wrong):
            estimator = TrpacEstimator(replace(told(), method=method))
            for row, (omega, torque, speed, acceleration) in enumerate(rows.tolist()):
                seen = road.segment_at(front_m[row] + NEAR_M)
                surface = said_class if seen.start_m == CHANGE_M else seen.surface_class
                frame = RoadClass(surface, 0.9) if row % round(FRAME_S / STEP_S) == 0 else None
                sensors = Sensors(omega, torque, max(speed, 0.0), longitudinal_acceleration_m_s2=acceleration)
                e = estimator.step(STEP_S, sensors, frame)
                if front_m[row] >= ONSET_M:
                    break
            inside = e.TRPAC_low <= mu_after <= e.TRPAC_high
            told_of[method.label].append(Onset(said_class == true, abs(e.TRPAC - mu_after), inside))
    return told_of


def line(name: str, method: str, scores: Sequence[Score]) -> list[str]:
    """A row of the table: means over the drives, NaN left out, and the worst drive's coverage."""
    means = {
        f.name: np.nanmean([getattr(s, f.name) for s in scores])
        if any(not np.isnan(getattr(s, f.name)) for s in scores)
        else float("nan")
        for f in fields(Score)
    }
    return [
        name,
        method,
        str(len(scores)),
        f"{means['covered']:.3f}",
        f"{min(s.covered for s in scores):.2f}",
        *(f"{100.0 * means[part]:.1f} %" for part in ("sure_wrong", "useful", "narrow_right")),
        f"{means['error']:.3f}",
    ]


def onset_line(method: str, onsets: Sequence[Onset]) -> list[str]:
    """A row of the table of onsets."""
    right, wrong = [o for o in onsets if o.right_class], [o for o in onsets if not o.right_class]
    shares = [f"{_mean(np.array([o.inside for o in part])):.2f}" for part in (right, wrong)]
    return [method, f"{np.median([o.error for o in right]):.3f}", *shares]


ONSET_HEADS = ("at the onset of braking", "median error, class right", "inside", "inside, class wrong")
HEADS = ("set", "method", "drives", "covered", "worst", "sure, wrong", "useful", "narrow, right", "error")


def in_parallel(work: Callable[..., object], jobs: int, todo: Iterable[object], name: str) -> list:
    """Results of the work on each item, in order."""
    todo = list(todo)
    results = Parallel(n_jobs=jobs, return_as="generator")(delayed(work)(item) for item in todo)
    return list(track(results, name, len(todo), disable=not sys.stderr.isatty()))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=50, help="drives of each set")
    parser.add_argument("--first", type=int, default=7000, help="first seed")
    parser.add_argument("--sets", nargs="*", default=[*SETS, "onset"], help="names of sets, and onset")
    parser.add_argument("--logs", type=Path, help="folder that holds vehicle_logs/")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="JSON file for all scores")
    options = parser.parse_args()
    seeds, table, all_scores = range(options.first, options.first + options.drives), [], {}

    def add(name: str, found: list[dict[str, Score]]) -> None:
        all_scores[name] = [{m: asdict(s) for m, s in each.items()} for each in found]
        table.extend(line(name, m.label, [each[m.label] for each in found]) for m in METHODS)

    for name in options.sets:
        if name == "onset":
            continue
        add(name, in_parallel(partial(on_drive, *SETS[name]), options.jobs, seeds, name))
    records = [] if options.logs is None else recorded(options.logs)
    for name, truly in (("simulators of others, described exactly", True), ("with faults", False)):
        todo = [record for record in records if record.truly == truly]
        if todo:
            add(name, in_parallel(on_record, options.jobs, todo, name))
    print(markdown(HEADS, table))
    if "onset" in options.sets:
        onsets = in_parallel(at_onset, options.jobs, seeds, "onset of braking")
        rows = [onset_line(m.label, [o for each in onsets for o in each[m.label]]) for m in METHODS]
        print()
        print(markdown(ONSET_HEADS, rows))
    if options.out is not None:
        options.out.write_text(json.dumps(all_scores, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
