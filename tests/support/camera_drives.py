"""Logs with perception columns by formulas of their own: neither the plant nor scenarios.perception makes them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenarios.files import RoadFile, VehicleFile, load_vehicle
from sim2real.logs import Log
from sim2real.perception.diagnose import diagnose_perception

CAR = load_vehicle(Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml")
FRONT_M = CAR.wheelbase_m - CAR.cog_to_rear_axle_m
CLASS_FRICTION = np.array([0.8, 0.6, 0.2])
NAMES = ("dry", "wet", "snow_ice")
BLIND = dict.fromkeys(("frame_id", "image_class", "image_confidence", "image_from_m", "image_to_m"))
SLOW_AND_FAST = (10.0, 10.0, 10.0, 10.0, 25.0, 25.0)
SPEEDS = ((10.0, 25.0), (5.0, 15.0, 8.0, 20.0), (12.0, 12.0), (20.0, 8.0, 3.0, 14.0), (25.0, 10.0))


@dataclass(frozen=True)
class Camera:
    """One camera chain with its faults; all zero is none."""

    fps: float = 40.0
    delay_s: float = 0.0
    distance_m: float = 0.0
    blur_s: float = 0.0
    dimmed: float = 1.0
    smear_m: float = 4.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wrong: float = 0.02
    share: float = 0.5
    """Share of its stamp that a class is for."""
    stamp_m: float | None = None
    """Length of stamps; None is the way driven since the picture before."""
    preview_m: float = 2.5 + FRONT_M
    flicker_m: float = 0.1
    confidence: float = 0.92
    roughness: float = 0.04


def road(spacing_m: float = 40.0, length_m: float = 2000.0, mu=CLASS_FRICTION, seed: int = 0) -> RoadFile:
    """Surfaces that change at every border; borders are not evenly spaced."""
    rng = np.random.default_rng([seed, 11])
    segments, at, kind = [], 0.0, 0
    while at < length_m:
        segments.append(
            {
                "start_m": round(at, 2),
                "mu_left": float(mu[kind]),
                "mu_right": float(mu[kind]),
                "surface": NAMES[kind],
            }
        )
        at += spacing_m * rng.uniform(0.8, 1.2)
        kind = (kind + int(rng.integers(1, 3))) % 3
    return RoadFile.model_validate({"schema": 1, "segments": segments})


def surface(road_file: RoadFile, place_m):
    starts = np.array([s.start_m for s in road_file.segments])
    kinds = np.array([NAMES.index(s.surface) for s in road_file.segments])
    return kinds[np.maximum(np.searchsorted(starts, place_m, side="right") - 1, 0)]


def drive(
    road_file: RoadFile,
    camera: Camera | None = None,
    speeds=(10.0, 25.0),
    duration_s: float = 40.0,
    rate_hz: float = 100.0,
    seed: int = 0,
    reference: str | None = "class",
) -> Log:
    """A log over a road, its speed going smoothly through the given ones.

    `reference`: what mu_reference follows: "class", "road", "peak" (4 % above the road), or None for no such column.
    """
    camera = Camera() if camera is None else camera
    rng = np.random.default_rng([seed, 5])
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    speed = np.interp(time, np.linspace(0.0, duration_s, len(speeds)), speeds)
    position = np.cumsum(speed) / rate_hz

    frame_s = np.arange(rng.uniform(0.0, 1.0 / camera.fps), duration_s, 1.0 / camera.fps)
    at, v = np.interp(frame_s, time, position), np.interp(frame_s, time, speed)
    begin = at + camera.preview_m
    length = v / camera.fps if camera.stamp_m is None else np.full(len(at), camera.stamp_m)
    beyond = v * camera.delay_s + camera.distance_m
    place = begin + camera.share * length - beyond + camera.flicker_m * rng.standard_normal(len(at))
    kinds = surface(road_file, place)
    wrong = rng.uniform(size=len(at)) < camera.wrong
    kinds = np.where(wrong, (kinds + rng.integers(1, 3, len(at))) % 3, kinds)
    sure = camera.confidence * camera.dimmed * np.exp(-v * camera.blur_s / camera.smear_m)
    sure = np.clip(sure * (1.0 + camera.roughness * rng.standard_normal(len(at))), 0.0, 1.0)

    newest = np.searchsorted(frame_s, time, side="right") - 1
    row, none = np.maximum(newest, 0), newest < 0
    held = {
        "frame_id": row + 1.0,
        "image_class": kinds[row].astype(float),
        "image_confidence": sure[row],
        "image_from_m": begin[row],
        "image_to_m": (begin + length)[row],
    }
    signals = {name: np.where(none, -1.0 if name == "image_class" else np.nan, x) for name, x in held.items()}
    signals |= {"position_m": position, "vehicle_speed_m_s": speed + 0.02 * rng.standard_normal(len(time))}
    if reference is not None:
        front = position + FRONT_M
        kind = surface(road_file, front)
        theta = np.array([s.mu_left for s in road_file.segments])
        starts = np.array([s.start_m for s in road_file.segments])
        here = theta[np.maximum(np.searchsorted(starts, front, side="right") - 1, 0)]
        mu = {"class": (CLASS_FRICTION + np.array(camera.offset))[kind], "road": here, "peak": 1.04 * here}
        signals["mu_reference"] = mu[reference] + 0.01 * rng.standard_normal(len(time))
    return log_of(time, signals, f"drive{seed}.csv")


def log_of(time, signals, name: str = "drive.csv", image_path=None, path: Path | None = None) -> Log:
    """A log of these signals."""
    rate = 1.0 / float(np.median(np.diff(time)))
    return Log(path or Path(name), name, time, signals, image_path, rate, (), frozenset(), (), (), "")


def changed(log: Log, **columns) -> Log:
    """The log with other columns; None takes one out."""
    signals = {**log.signals, **columns}
    return replace(log, signals={name: x for name, x in signals.items() if x is not None})


def car_with(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


BARE = car_with()


def diagnose(
    camera,
    seed=0,
    vehicle=BARE,
    spacing_m=40.0,
    mu=CLASS_FRICTION,
    damage=lambda log: log,
    exclude=(),
    lens=None,
    **kw,
):
    roads = [road(spacing_m, seed=3 * seed + i, mu=mu) for i in range(3)]
    logs = [damage(drive(r, camera, seed=10 * seed + i, **kw)) for i, r in enumerate(roads)]
    return diagnose_perception(logs[:2], logs[2], roads, vehicle, lens, exclude=exclude)


def candidate(finding, *effects):
    (found,) = [c for c in finding.candidates if set(c.effects) == set(effects)]
    return found


def any_camera(seed, **faults):
    """A camera chain like others: rate, mistakes, confidence, and what of a stamp its class is for."""
    rng = np.random.default_rng([seed, 99])
    plain = Camera(
        fps=float(rng.choice([8, 10, 20, 30, 40])),
        wrong=float(rng.uniform(0.0, 0.1)),
        share=float(rng.choice([0.0, 0.5, 1.0])),
        flicker_m=float(rng.choice([0.0, 0.05, 0.2])),
        confidence=float(rng.uniform(0.82, 0.98)),
        roughness=float(rng.uniform(0.0, 0.1)),
    )
    return replace(plain, **faults)
