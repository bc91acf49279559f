"""The camera's results in a log: one row per result, damage left out and said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.files import RoadFile, VehicleFile
from sim2real.logs import Log
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import CLASS_THETA, Surface

Array = NDArray[np.float64]

NEEDED = ("image_class", "image_from_m", "image_to_m")
"""Without these it is not known which stretch of road a result is for."""
LONGEST_STAMP_M = 50.0
FARTHEST_STAMP_M = 200.0
"""A stretch longer than the one, or farther from the car than the other, is no displacement stamp [m]."""
LEAST_AHEAD_M = 0.5
"""Stamps nearer to the lens than this do not tell at which angle the camera looked [m]."""
USUAL_AHEAD_M = 2.9
"""Distance then assumed: the preview distance of 2.5 m with the lens 0.4 m behind the front axle [m]."""
RUN_UP_S = 2.0
"""Time before the log's begin for which its first speed is assumed: late results look back there [s]."""
MOST_STAMPS = 400
"""Stamps out of a log that tell how long results take to arrive."""
LEAST_SPEED_SPREAD_M_S = 1.0
"""Standard deviation of speed from which on they can tell [m/s]."""
LONGEST_WORK_S = 0.5
"""No result is taken to arrive later than this after its picture, if it is stamped right [s]."""
STUCK_RESULTS = 3
"""With fewer different frame_id while stamps go on, frame_id is taken for stuck."""


@dataclass(frozen=True)
class Modelled:
    """What vehicle.yaml's effects make the simulation model already of the camera chain; the defaults are nothing."""

    delay_s: float = 0.0
    pitch_rad: float = 0.0
    exposure_s: float = 0.0
    stops: float = 0.0
    class_value: tuple[float, ...] = tuple(CLASS_THETA.values())

    @classmethod
    def of(cls, vehicle: VehicleFile) -> Modelled:
        """From a vehicle's effects."""
        effects = vehicle.effects
        value = effects.get("class_friction_offset", {})
        return cls(
            delay_s=effects.get("camera_latency", {}).get("delay_s", 0.0),
            pitch_rad=effects.get("camera_pitch", {}).get("pitch_rad", 0.0),
            exposure_s=effects.get("motion_blur", {}).get("exposure_s", 0.0),
            stops=effects.get("exposure_shift", {}).get("stops", 0.0),
            class_value=tuple(value.get(s.label, theta) for s, theta in CLASS_THETA.items()),
        )


@dataclass(frozen=True, eq=False)  # so that what is reckoned from it can be kept by its identity
class Results:
    """What the camera chain said during one log, one row per result, in order of arrival.

    Attributes
    ----------
    log : str
        The log's name.
    road : RoadFile
        Where it was driven.
    time_s, speed_m_s : array, shape (n,)
        When the result arrived, and the speed then [s], [m/s].
    from_m, to_m : array, shape (n,)
        Its stamp [m].
    beyond_m : array, shape (n,)
        Distance of its stamp's middle from the lens by the camera file when it arrived [m].
    ahead_m : float
        The same when the picture was taken, the median; as `of_one_camera` finds it, before that when it arrived [m].
    classes : array, shape (n,)
        Class index.
    confidence : array, shape (n,)
        Q_v; NaN where not measured [-].
    picture : array of str, shape (n,)
        Its file relative to the log, "" for none.
    drive_time_s, drive_position_m : array, shape (m,)
        The car's way [s], [m].
    """

    log: str
    road: RoadFile
    time_s: Array
    speed_m_s: Array
    from_m: Array
    to_m: Array
    beyond_m: Array
    ahead_m: float
    classes: NDArray[np.intp]
    confidence: Array
    picture: NDArray[np.str_]
    drive_time_s: Array
    drive_position_m: Array

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def begin_s(self) -> float:
        """When the log begins [s]."""
        return float(self.drive_time_s[0] + RUN_UP_S)

    @property
    def begin_m(self) -> float:
        """Where the log begins [m]."""
        return float(np.interp(self.begin_s, self.drive_time_s, self.drive_position_m))

    def driven_m(self, time_s: Array, age_s: Array) -> Array:
        """Way driven during ages before times, shape (len(time_s), len(age_s)) [m]."""
        then = np.interp(time_s[:, None] - age_s, self.drive_time_s, self.drive_position_m)
        return np.interp(time_s, self.drive_time_s, self.drive_position_m)[:, None] - then


def read_results(
    log: Log, road: RoadFile, vehicle: VehicleFile, camera: Camera
) -> tuple[Results | None, tuple[str, ...]]:
    """The results in a log, and what is odd about them.

    Returns
    -------
    Results or None, tuple of str
        None where the log has no perception columns, or no usable row in them.
    """
    missing = [name for name in NEEDED if name not in log.signals]
    if len(missing) == len(NEEDED) and not {"image_confidence", "frame_id"} & set(log.signals):
        return None, ()
    if missing:
        return None, (
            f"{log.name}: the camera's results are left out: {', '.join(missing)} is missing or computed; expected all "
            f"of {', '.join(NEEDED)}.",
        )
    table, warnings = _one_row_per_result(log)
    table, more = _plausible(table, log)
    warnings += more
    if table.empty:
        return None, (*warnings, f"{log.name}: none of the camera's results is usable.")
    time_s = table["time_s"].to_numpy()
    drive_time_s, position_m = _finite(log.time_s, log.signals["position_m"])
    clock, speed = _finite(log.time_s, log.signals["vehicle_speed_m_s"])
    speed_m_s = np.interp(time_s, clock, speed)
    lens_m = vehicle.to_core().cog_to_front_axle_m + camera.x_from_front_axle_m
    middle_m = 0.5 * (table["from"].to_numpy() + table["to"].to_numpy())
    beyond_m = middle_m - np.interp(time_s, drive_time_s, position_m) - lens_m
    results = Results(
        log=log.name,
        road=road,
        time_s=time_s,
        speed_m_s=speed_m_s,
        from_m=table["from"].to_numpy(),
        to_m=table["to"].to_numpy(),
        beyond_m=beyond_m,
        ahead_m=float(np.median(beyond_m)),
        classes=table["class"].to_numpy().astype(np.intp),
        confidence=table["confidence"].to_numpy(),
        picture=table["picture"].to_numpy().astype(np.str_),
        drive_time_s=np.concatenate(([drive_time_s[0] - RUN_UP_S], drive_time_s)),
        drive_position_m=np.concatenate(([position_m[0] - RUN_UP_S * speed[0]], position_m)),
    )
    return results, tuple(warnings)


def of_one_camera(results: Sequence[Results]) -> tuple[list[Results], tuple[str, ...]]:
    """The results of several logs at the distance that all of them tell together, and what is odd about it.

    A log alone, driven at nearly one speed, cannot say how long results take to arrive, nor how far the camera looks.
    """
    if not results:
        return [], ()
    ahead_m = _ahead_when_taken(
        np.concatenate([_thinned(one.beyond_m) for one in results]),
        np.concatenate([_thinned(one.speed_m_s) for one in results]),
    )
    if ahead_m >= LEAST_AHEAD_M:
        return [replace(one, ahead_m=ahead_m) for one in results], ()
    told = (
        f"The camera's stamps lie {ahead_m:.1f} m ahead of the lens; the pitch is calculated for "
        f"{USUAL_AHEAD_M:g} m instead."
    )
    return [replace(one, ahead_m=USUAL_AHEAD_M) for one in results], (told,)


def _thinned(values: Array) -> Array:
    """As many of them as tell enough, evenly."""
    return values[np.linspace(0, len(values) - 1, min(len(values), MOST_STAMPS)).astype(np.intp)]


def _ahead_when_taken(beyond_m: Array, speed_m_s: Array) -> float:
    """How far beyond the lens stamps lie when their pictures are taken [m].

    A result arrives some time after its picture, and the car has come nearer to the stamp by then, the more the faster
    it is: how the distance falls with speed is that time.
    """
    from scipy.stats import theilslopes  # here, since its import is slow

    worked_s = 0.0
    if speed_m_s.std() >= LEAST_SPEED_SPREAD_M_S:
        slope = float(theilslopes(beyond_m, speed_m_s).slope)
        worked_s = min(max(-slope, 0.0), LONGEST_WORK_S)
    return float(np.median(beyond_m + worked_s * speed_m_s))


def _one_row_per_result(log: Log) -> tuple[pd.DataFrame, list[str]]:
    """Each result's first readable values: a sample of it may be lost."""
    nothing = np.full(len(log), np.nan)
    rows = pd.DataFrame(
        {
            "time_s": log.time_s,
            "id": log.signals.get("frame_id", nothing),
            "class": log.signals["image_class"],
            "from": log.signals["image_from_m"],
            "to": log.signals["image_to_m"],
            "confidence": log.signals.get("image_confidence", nothing),
            "picture": "" if log.image_path is None else log.image_path,
        }
    )
    warnings: list[str] = []
    stamp = ["from", "to"]
    if rows["id"].nunique() < STUCK_RESULTS:
        if rows[stamp].drop_duplicates().shape[0] > STUCK_RESULTS:
            why = "is missing" if rows["id"].isna().all() else "does not change"
            warnings.append(f"{log.name}: frame_id {why}; a new stamp is used as a new result.")
        rows["id"] = np.nan
    rows["picture"] = rows["picture"].replace("", None)
    rows = rows[rows["id"].notna() | rows[stamp].notna().all(axis=1)]
    # where a frame_id is lost, it is that of the rows with the same stamp, else a new stamp is a new result
    held = rows[stamp].ffill()
    of_stamp = (held != held.shift()).any(axis=1).cumsum()
    ids = rows.groupby(of_stamp)["id"].ffill()
    ids = ids.groupby(of_stamp).bfill()
    numbered = ids.notna() & ids.shift().notna()
    new = np.where(numbered, ids != ids.shift(), of_stamp != of_stamp.shift())
    found = rows.groupby(np.cumsum(new)).first()
    return found.assign(picture=found["picture"].fillna("")), warnings


def _plausible(table: pd.DataFrame, log: Log) -> tuple[pd.DataFrame, list[str]]:
    """The rows that say something; what was left out or put right, in sentences."""
    warnings: list[str] = []

    def tell(count: int, text: str) -> None:
        if count:
            warnings.append(f"{log.name}: {count} of {len(table)} camera results {text}")

    known = table["class"].isin([int(s) for s in Surface])
    tell(
        int((~known & table["class"].notna() & (table["class"] != -1)).sum()),
        "have no known class: left out.",
    )
    stamped = table[["from", "to"]].notna().all(axis=1)
    tell(int((known & ~stamped).sum()), "have lost their stamp: left out.")
    turned = table["from"] > table["to"]
    tell(int(turned.sum()), "have image_from_m beyond image_to_m: both swapped.")
    near, far = table[["from", "to"]].min(axis=1), table[["from", "to"]].max(axis=1)
    place = np.interp(table["time_s"], *_finite(log.time_s, log.signals["position_m"]))
    sane = (far - near < LONGEST_STAMP_M) & ((near - place).abs() < FARTHEST_STAMP_M)
    tell(
        int((known & stamped & ~sane).sum()),
        f"are stamped more than {FARTHEST_STAMP_M:g} m from the car, or longer than {LONGEST_STAMP_M:g} m: "
        "left out. Stamps are expected in position_m's coordinate.",
    )
    trusted = table["confidence"].between(0.0, 1.0)
    tell(
        int((~trusted & table["confidence"].notna()).sum()),
        "have a confidence outside 0 to 1: not used. Is it in per cent?",
    )
    table = table.assign(**{"from": near, "to": far, "confidence": table["confidence"].where(trusted)})
    return table[known & stamped & sane], warnings


def _finite(time_s: Array, values: Array) -> tuple[Array, Array]:
    there = np.isfinite(values)
    return time_s[there], values[there]
