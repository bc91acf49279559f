"""The files of a diagnosis: vehicle, roads and logs, read and made ready."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, VehicleFile, load_road, load_vehicle
from sim2real.logs import Log, Mapping, load_mapping, read_log, resample, with_way
from sim2real.logs.checks import MIN_DURATION_S
from sim2real.logs.contract import POSITION
from sim2real.observing.drive import (
    SPEED,
    WHEEL,
    Drive,
    awake,
    backward,
    grid_step,
    make_drive,
    untold_torque,
)
from sim2real.observing.evidence import SETTLING_S
from sim2real.observing.lattice import find_lattice
from sim2real.observing.observer import Simulation
from sim2real.observing.reference import OTHER_TORQUE, By, covered, held_against, other_torque
from trpac_core.vehicle import WHEELS

Array = NDArray[np.float64]

TURNS, LEAST_TURNING_S = 0.005, 1.0
"""A wheel is so much faster or slower than the car, by its yaw rate averaged over the second, from which on it turns
[-], and for how long in all that is told [s]."""
LEAST_APART_M_S = 0.02
"""Less is the noise of a slow car's yaw rate [m/s]."""
LEAST_UNCOVERED_S = 0.1
"""From so much time without a reference on it is told [s]."""
YAML = (".yaml", ".yml")
"""How the name of a log's own road ends."""
WINDOW = re.compile(r"@(\d*\.?\d*):(\d*\.?\d*)$")
"""The part of a log that is meant, from one time of its clock up to another [s]."""
EVER = (-math.inf, math.inf)


@dataclass(frozen=True)
class Given:
    """A log as a user names it: its file, its road, and from when to when it counts, by its own clock [s]."""

    log: Path
    road: Path
    from_s: float = -math.inf
    to_s: float = math.inf

    def cut(self, log: Log) -> Log:
        """The part of the log that is meant, named by its times; raises LogError where it is shorter than two rows."""
        if (self.from_s, self.to_s) == EVER:
            return log
        part = log.window(self.from_s, self.to_s)
        return replace(part, name=f"{log.name} from {part.time_s[0]:.4g} to {part.time_s[-1]:.4g} s")


@dataclass(frozen=True)
class Source:
    """One log with the road that it was driven on."""

    log: Log
    road: RoadFile
    road_path: Path | None
    drive: Drive
    reference: Log | None = None
    """What the drive's residuals are held against, see `sim2real.observing.reference`."""

    def on_rows(self, signal: str) -> Array:
        """A signal of the log on the drive's rows: the last ones, where the drive begins as its sensors wake."""
        return on_grid(self.log)[1][signal][-len(self.drive) :]


@dataclass(frozen=True)
class Sources:
    """All that a diagnosis reads."""

    vehicle: VehicleFile
    vehicle_path: Path | None
    fit: tuple[Source, ...]
    holdout: Source
    baseline: tuple[Source, ...] = ()
    """Logs of the same car without the fault, of any manoeuvre."""

    @property
    def all(self) -> tuple[Source, ...]:
        """Fit logs, then the hold-out."""
        return (*self.fit, self.holdout)


@dataclass(frozen=True)
class Pairing:
    """Reference logs, one for each log of a diagnosis: the fit logs' in their order, the hold-out's last.

    Attributes
    ----------
    logs : tuple
        The same manoeuvres without the fault, or the user's own simulation of them, as logs are given.
    by : "time" or "position"
        What says that rows of a log and of its reference are the same point of the manoeuvre.
    option : str
        Where they were given, for messages.
    """

    logs: tuple[Any, ...]
    by: By = "time"
    option: str = "paired"

    def require(self, count: int) -> None:
        """Raise ScenarioError where there are not as many references as logs."""
        if len(self.logs) != count:
            raise ScenarioError(
                f"{self.option}: {len(self.logs)} reference logs for {count} logs; expected one for each, those of the "
                "fit logs in their order and the hold-out's last. Without one for the hold-out, cut a pair in two, and "
                "fit to the first part alone."
            )


def pairing_of(paired: Sequence[Any], simulated: Sequence[Any], by: By = "time") -> Pairing | None:
    """The reference logs of the options `paired` and `simulated`, of which one may be used; None without any."""
    if paired and simulated:
        raise ScenarioError(
            "paired and simulated are both given; expected one of them: a log has one reference. Leave one out."
        )
    if simulated and by != "time":
        raise ScenarioError(
            "simulated logs are matched by time, since their inputs are the log's; leave `by` out."
        )
    if paired:
        return Pairing(tuple(paired), by)
    return Pairing(tuple(simulated), "time", "simulated") if simulated else None


def read_sources(
    vehicle: Path,
    road: Path | None,
    fit: Sequence[str],
    holdout: str,
    mapping: Path | None = None,
    pairing: Pairing | None = None,
    baseline: Sequence[str] = (),
    dbc: Sequence[Path] = (),
) -> Sources:
    """Read everything, all problems of all files in one error.

    Parameters
    ----------
    vehicle, road : Path
        vehicle.yaml, and the road of the logs that name none.
    fit, holdout : sequence of str, str
        Logs, each `log.csv`, `log.csv@road.yaml`, or with a window in seconds, `log.csv@3:5.2`.
    mapping : Path, optional
        How the logs' columns become the contract's.
    pairing : Pairing, optional
        Reference logs; on the road of their log where they name none.
    baseline : sequence of str
        Logs of the same car without the fault.
    dbc : sequence of Path
        DBC files that say what the frames of a bus mean.

    Raises
    ------
    ScenarioError
        With everything that is wrong.
    """
    problems: list[str] = []
    car, columns = None, None
    try:
        car = load_vehicle(vehicle)
    except ScenarioError as error:
        problems.append(str(error))
    try:
        columns = load_mapping(mapping) if mapping else None
    except ScenarioError as error:
        problems.append(str(error))
    found: list[Source] = []
    references: list[Source] = []
    if not fit:
        problems.append("No log to fit to; expected at least one --fit LOG.")
    try:
        if pairing:
            pairing.require(len(fit) + 1)
    except ScenarioError as error:
        problems.append(str(error))
    faultless: list[Source] = []
    wanted = [*((text, found) for text in (*fit, holdout)), *((text, faultless) for text in baseline)]
    for text, into in wanted:
        try:
            into.append(read_source(text, road, columns, dbc))
        except ScenarioError as error:
            problems.append(str(error))
    for text, log in zip(pairing.logs if pairing else (), (*fit, holdout), strict=False):
        try:
            references.append(read_source(text, _road_of(log, road), columns, dbc))
        except ScenarioError as error:
            problems.append(str(error))
    if problems or car is None:
        raise ScenarioError("\n".join(dict.fromkeys(problems)))
    sources = put_together(car, vehicle, found, references, pairing.by if pairing else "time")
    return replace(sources, baseline=tuple(faultless))


def put_together(
    car: VehicleFile,
    vehicle_path: Path | None,
    found: Sequence[Source],
    references: Sequence[Source] = (),
    by: By = "time",
) -> Sources:
    """A diagnosis' sources: the fit logs and, the last one, the hold-out; each with a reference, or none."""
    named = told_apart(found)
    if references:
        model = Simulation(car)
        named = [paired_with(s, r, model, by) for s, r in zip(named, references, strict=True)]
    *fitted, held = (with_turns_told(source, car) for source in named)
    if any(s.log.sha256 == held.log.sha256 and _overlap(s.log, held.log) for s in fitted):
        told = "is a fit log, too: its gap is not that of an independent drive, since parameters were fitted to it."
        held = replace(held, log=held.log.warned(told))
    return Sources(car, vehicle_path, tuple(fitted), held)


def _overlap(one: Log, other: Log) -> bool:
    """Whether two parts of a log have time in common."""
    return max(one.time_s[0], other.time_s[0]) <= min(one.time_s[-1], other.time_s[-1])


def paired_with(source: Source, reference: Source, model: Simulation, by: By = "time") -> Source:
    """The source held against a reference log, with warnings of what that does not cover or was driven otherwise.

    Raises LogError where the two have too little in common.
    """
    drive = held_against(model, source.drive, reference.drive, by)
    apart = other_torque(drive, reference.drive, by)
    found = with_reference(source, drive, reference.log)
    if apart <= OTHER_TORQUE:
        return found
    told = (
        f"the torque of {reference.log.name} differs by {100.0 * apart:.0f} % of this log's (root mean square): "
        "the common model error cancels only if both drives are alike. Match by position, or repeat the drive."
    )
    return replace(found, log=found.log.warned(told))


def with_reference(source: Source, drive: Drive, reference: Log) -> Source:
    """The source with a drive that has a reference, with a warning of what that does not cover."""
    assert drive.reference is not None
    counts = drive.moving & (drive.time_s >= drive.time_s[0] + SETTLING_S)
    without_s = (1.0 - covered(drive.reference, counts)) * float(counts.sum()) * drive.step_s
    log = source.log
    if without_s > LEAST_UNCOVERED_S:
        log = log.warned(f"{without_s:.3g} s are left out: {reference.name} is no reference there.")
    return replace(source, log=log, drive=drive, reference=reference)


def with_turns_told(source: Source, vehicle: VehicleFile) -> Source:
    """The source with a warning where its yaw rate tells of curves, which the model does not drive."""
    log, drive = source.log, source.drive
    if "yaw_rate_rad_s" not in log.signals:
        return source
    rows = drive.rows_in(LEAST_TURNING_S)
    yaw, speed = (
        uniform_filter1d(np.nan_to_num(values), rows, mode="nearest")
        for values in (source.on_rows("yaw_rate_rad_s"), drive.measured[:, SPEED])
    )
    apart_m_s = 0.5 * vehicle.track_m * np.abs(yaw)
    turns = drive.moving & (apart_m_s > np.maximum(TURNS * speed, LEAST_APART_M_S))
    turning_s = float(turns.sum() * drive.step_s)
    if turning_s < LEAST_TURNING_S:
        return source
    told = (
        f"the car turns in {turning_s:.0f} s of it; the model drives straight, so a curve can appear as another "
        "fault, such as one of the left or right wheel sensors. Leave such stretches out if they are long."
    )
    return replace(source, log=log.warned(told))


def told_apart(sources: Sequence[Source]) -> list[Source]:
    """The sources with names of their own: files of one name in several folders get their folder's, else a number."""

    def named(source: Source, name: str) -> Source:
        return replace(source, log=replace(source.log, name=name), drive=replace(source.drive, name=name))

    names = [s.log.name for s in sources]
    longer = [f"{s.log.path.resolve().parent.name}/{s.log.name}" for s in sources]
    names = [long if names.count(name) > 1 else name for name, long in zip(names, longer, strict=True)]
    numbered = [
        f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]
    return [named(s, name) for s, name in zip(sources, numbered, strict=True)]


def read_source(
    text: str, road: Path | None, columns: Mapping | None = None, dbc: Sequence[Path] = ()
) -> Source:
    """Read one log, `log.csv@road.yaml@3:5.2`, and its road; raises ScenarioError with all problems of both."""
    given = split(text, road)
    problems: list[str] = []
    course, log = None, None
    try:
        course = load_road(given.road)
    except ScenarioError as error:
        problems.append(str(error))
    try:
        log = given.cut(read_log(given.log, columns, dbc))
    except ScenarioError as error:
        problems.append(str(error))
    if course is None or log is None:
        raise ScenarioError("\n".join(problems))
    return make_source(log, course, given.road)


def make_source(log: Log, road: RoadFile, road_path: Path | None = None) -> Source:
    """A log with its road, made ready; raises ScenarioError where it tells of no driving."""
    if POSITION not in log.signals and len(road.segments) > 1:
        raise ScenarioError(
            f"{log.path}: column {POSITION} is missing; expected the distance from the road's zero, since "
            f"{road_path or 'the road'} has {len(road.segments)} stretches. Where the log begins at that zero, a "
            f"mapping file can say `{POSITION}: {{integrate: {{copy: vehicle_speed_m_s}}}}`."
        )
    log = with_way(log)
    grid = on_grid(log)
    whole = drive_of(log, road, grid)
    drive = awake(whole)
    if not drive.moving.any():
        raise ScenarioError(
            f"{log.path}: the car never moves forward on all wheels; expected a log of driving."
        )
    told_s = float(drive.time_s[-1] - drive.time_s[0])
    if told_s < MIN_DURATION_S:
        raise ScenarioError(
            f"{log.path}: has the speed of the car in its last {told_s:.3g} s only; expected at least "
            f"{MIN_DURATION_S:g} s."
        )
    asleep_s = float(drive.time_s[0] - whole.time_s[0])
    if asleep_s > 0.0:
        left_out = f"the first {asleep_s:.3g} s are left out: the speed of the car is not measured there."
        log = log.warned(left_out)
    untold_s = _untold_s(*grid)
    if untold_s > 0.0:
        log = log.warned(
            f"{untold_s:.3g} s are left out: the torque of a wheel is missing there or shortly before."
        )
    back_s = float(backward(drive.time_s, drive.measured[:, WHEEL]).sum() * drive.step_s)
    if back_s > 0.0:
        log = log.warned(
            f"{back_s:.3g} s are left out: a wheel turns backwards there or shortly before, which the model's never do."
        )
    return Source(log, road, road_path, drive)


def _untold_s(time_s: Array, signals: dict[str, Array]) -> float:
    torque = np.column_stack([signals[f"wheel_torque_{w}_nm"] for w in WHEELS])
    return float(untold_torque(time_s, torque).sum() * (time_s[1] - time_s[0]))


def on_grid(log: Log) -> tuple[Array, dict[str, Array]]:
    """Time [s] and signals of a log on the diagnosis' grid."""
    return resample(log, grid_step(log.rate_hz))


def drive_of(log: Log, road: RoadFile, grid: tuple[Array, dict[str, Array]]) -> Drive:
    """All of a log `on_grid`, with what its wheel speeds tell of a counter at their own rate."""
    wheels = [log.signals[f"wheel_speed_{w}_rad_s"] for w in WHEELS]
    return make_drive(log.name, road, *grid, log.derived, find_lattice(log.time_s, wheels))


def _road_of(text: str, road: Path | None) -> Path | None:
    """The road that a log's reference is on where it names none: the log's."""
    return split(text, road).road if road is not None or "@" in text else None


def split(text: str, road: Path | None) -> Given:
    """Log, road and window of `log.csv@road.yaml@3:5.2`; road and window may be left out, either path may hold an @."""
    whole = text
    window = WINDOW.search(text)
    if window is not None and not Path(text).is_file():
        text = text[: window.start()]
        from_s, to_s = (
            float(end) if end else default for end, default in zip(window.groups(), EVER, strict=True)
        )
        if not from_s < to_s:
            raise ScenarioError(
                f"{whole}: the window ends before it begins; expected LOG@FROM:TO in seconds."
            )
        bounds = (from_s, to_s)
    else:
        bounds = EVER
    marks = [i for i, letter in enumerate(text) if letter == "@"] if text.lower().endswith(YAML) else []
    if marks:
        mark = next((i for i in marks if Path(text[:i]).is_file()), marks[-1])
        return Given(Path(text[:mark]), Path(text[mark + 1 :]), *bounds)
    if road is None:
        raise ScenarioError(f"{text}: names no road; expected LOG@ROAD.yaml, or --road for all logs.")
    return Given(Path(text), road, *bounds)
