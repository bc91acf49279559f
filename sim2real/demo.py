"""A case to try the diagnosis on: logs of a car that differs from its simulation by one effect, which is sealed."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.files import (
    Manoeuvre,
    Pulse,
    RoadFile,
    RoadSegment,
    SensorNoise,
    SurfaceName,
    VehicleFile,
    load_vehicle,
)
from scenarios.library import shipped
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log, write_log
from scenarios.whole_files import written_whole
from scenarios.yaml_text import to_yaml
from trpac_core.files import parse_json, read_bytes

VEHICLE = shipped("vehicle")["four_in_wheel_motor_ev"]

HIDDEN: dict[str, dict[str, tuple[float, float]]] = {
    "accelerometer_bias": {"bias_m_s2": (0.15, 0.4)},
    "brake_drag": {"torque_nm": (10.0, 25.0)},
    "friction_offset": {"factor": (0.7, 0.85)},
    "mass_offset": {"mass_kg": (90.0, 250.0)},
    "road_grade": {"grade": (0.02, 0.05)},
    "torque_delay": {"delay_s": (0.03, 0.08)},
    "torque_gain": {"factor": (0.85, 0.94)},
    "torque_lag": {"time_constant_s": (0.04, 0.12)},
    "tyre_relaxation": {"length_m": (0.25, 0.7)},
    "tyre_stiffness_offset": {"stiffness_n": (30_000.0, 40_000.0)},
    "vehicle_speed_scale": {"factor": (1.015, 1.04)},
    "wheel_radius_offset": {"radius_m": (0.276, 0.284)},
    "wheel_speed_delay": {"delay_s": (0.03, 0.07)},
}
"""Effects that are drawn from, and the ranges of their parameters on the demonstration's car."""

NOISE = SensorNoise(wheel_speed_noise_rad_s=0.05, vehicle_speed_noise_m_s=0.02, accel_x_noise_m_s2=0.08)
LOGS = ("fit_1.csv", "fit_2.csv", "holdout.csv")
DURATION_S, STEP_S = 30.0, 0.005
FINE = 5
"""Steps of the plant per row of a log: the real car is not stepped by its logger."""
MOST_TRUTH_BYTES = 10_000
"""Size of truth.json [bytes]."""
ROAD_M = 1000.0
THETA: dict[SurfaceName, float] = {"dry": 0.9, "wet": 0.5, "snow_ice": 0.3}
STRETCHES: tuple[SurfaceName, ...] = ("dry", "dry", "wet", "snow_ice")
SLOW_M_S, FAST_M_S = 9.0, 20.0
"""Below the one the car is driven, above the other braked [m/s]."""


@dataclass(frozen=True)
class Case:
    """The files of a case, and the hash of its sealed truth.

    Attributes
    ----------
    vehicle, road : Path
        The simulation's vehicle.yaml, and the road.
    fit : tuple of Path
        Logs to fit to.
    holdout : Path
        The log that the gap is measured on.
    truth : Path
        What was hidden; the diagnosis is not told of it.
    seal : str
        SHA-256 of the truth's file.
    """

    vehicle: Path
    road: Path
    fit: tuple[Path, ...]
    holdout: Path
    truth: Path
    seal: str


@dataclass(frozen=True)
class Truth:
    """The effect that the logs' car has and its simulation lacks."""

    effect: str
    parameters: dict[str, float]


def make_case(folder: Path, seed: int) -> Case:
    """Draw an effect, drive the car that has it, and write all but the effect openly.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng)
    vehicle = load_vehicle(VEHICLE)
    real = with_effect(vehicle, truth)
    road = draw_road(rng)
    with written_whole(folder) as made:
        (made / "vehicle.yaml").write_bytes(VEHICLE.read_bytes())
        (made / "road.yaml").write_text(to_yaml(road.model_dump(by_alias=True)))
        for number, name in enumerate(LOGS):
            speed_m_s = float(rng.uniform(8.0, 14.0))
            fine_s = STEP_S / FINE
            time_s = np.linspace(0.0, DURATION_S, round(DURATION_S / fine_s), endpoint=False)
            torque_nm = draw_manoeuvre(rng, vehicle, speed_m_s).torque(time_s)
            trajectory = simulate(real, road, torque_nm, fine_s, initial_speed_m_s=speed_m_s)
            # the friction reference would give a hidden friction effect away, and few cars have one
            log = make_log(trajectory, real, NOISE, seed=1000 * seed + number).drop(columns="mu_reference")
            write_log(log.iloc[::FINE], made / name)
        text = json.dumps({"effect": truth.effect, "parameters": truth.parameters}, indent=1) + "\n"
        (made / "truth.json").write_text(text, encoding="utf-8")
    return Case(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        tuple(folder / name for name in LOGS[:-1]),
        folder / LOGS[-1],
        folder / "truth.json",
        _hash(text.encode()),
    )


def open_seal(case: Case) -> Truth:
    """What was hidden; raises ScenarioError where the file is not the one that was sealed."""
    data = read_bytes(case.truth, MOST_TRUTH_BYTES, "the sealed truth of a demonstration")
    if _hash(data) != case.seal:
        raise ScenarioError(
            f"{case.truth}: changed since it was sealed; expected SHA-256 {case.seal}. Run the demonstration again."
        )
    return Truth(**parse_json(data, str(case.truth)))


def draw_truth(rng: np.random.Generator) -> Truth:
    """One of the effects with parameters in their ranges."""
    effect = str(rng.choice(list(HIDDEN)))
    values = {name: float(f"{rng.uniform(*span):.3g}") for name, span in HIDDEN[effect].items()}
    return Truth(effect, values)


def with_effect(vehicle: VehicleFile, truth: Truth) -> VehicleFile:
    """The vehicle with a further effect."""
    effects = {**vehicle.effects, truth.effect: truth.parameters}
    return VehicleFile.model_validate({**vehicle.model_dump(by_alias=True), "effects": effects})


def draw_road(rng: np.random.Generator) -> RoadFile:
    """Stretches of 25 to 60 m; of any four, two are dry, one is wet and one icy, in drawn order."""
    segments, start_m = [], 0.0
    while start_m < ROAD_M:
        for i in rng.permutation(len(STRETCHES)):
            surface = STRETCHES[i]
            theta = THETA[surface]
            segments.append(
                RoadSegment(start_m=round(start_m, 1), mu_left=theta, mu_right=theta, surface=surface)
            )
            start_m += float(rng.uniform(25.0, 60.0))
    return RoadFile(schema=1, segments=segments)


def draw_manoeuvre(rng: np.random.Generator, vehicle: VehicleFile, speed_m_s: float) -> Manoeuvre:
    """Accelerate, coast, tip in and out, brake lightly and to the grip limit, in drawn order and strength.

    The speed that decides what comes next is a forecast without losses: it need not be right.
    """
    pulses: list[Pulse] = []
    at_s = 1.0
    while at_s < DURATION_S - 3.5:
        new = _phase(rng, str(rng.choice(_kinds(speed_m_s))), at_s, vehicle.motor_peak_torque_nm)
        impulse = sum(p.torque_nm * (p.end_s - p.start_s - p.ramp_s) for p in new)
        speed_m_s += 4.0 * impulse / (vehicle.wheel_radius_m * vehicle.mass_kg)
        pulses += new
        at_s = new[-1].end_s + float(rng.choice([0.1, 1.5]))
    return Manoeuvre(schema=1, name="demonstration", pulses=pulses)


def _kinds(speed_m_s: float) -> list[str]:
    """Phases to draw from at a speed."""
    if speed_m_s < SLOW_M_S:
        return ["drive"]
    return ["brake", "limit"] if speed_m_s > FAST_M_S else ["drive", "drive", "brake", "limit", "tip"]


def _phase(rng: np.random.Generator, kind: str, at_s: float, peak_nm: float) -> list[Pulse]:
    """The pulses of one phase that starts at a time."""

    def pulse(start_s: float, hold_s: float, torque_nm: float, ramp_s: float) -> Pulse:
        return Pulse(
            start_s=start_s, end_s=start_s + hold_s + 2.0 * ramp_s, torque_nm=torque_nm, ramp_s=ramp_s
        )

    if kind == "drive":
        return [pulse(at_s, float(rng.uniform(1.0, 2.5)), float(rng.uniform(0.4, 1.0)) * peak_nm, 0.2)]
    if kind == "brake":
        return [pulse(at_s, float(rng.uniform(0.6, 1.4)), -float(rng.uniform(120.0, 400.0)), 0.2)]
    if kind == "limit":
        return [pulse(at_s, float(rng.uniform(0.3, 0.6)), -float(rng.uniform(500.0, 800.0)), 0.15)]
    strength = float(rng.uniform(0.5, 1.0)) * peak_nm
    return [pulse(at_s + 0.4 * i, 0.3, strength if i % 2 == 0 else -0.5 * strength, 0.04) for i in range(5)]


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
