"""The runs of a sweep, each drawn from its own number alone.

Every run's random numbers come from numpy's SeedSequence of the sweep's seed and the run's number within its level, so
they depend neither on the order of the runs nor on the worker. Levels of a varied quantity share them: run 7 has the
same road and noise at all levels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarios.files import RoadFile, RoadSegment, Scenario, SensorNoise
from scenarios.sweep.files import RoadDraw, Sweep, drawn_numbers, sample
from scenarios.sweep.pedal import drive_pedal

STREAMS = ("numbers", "road", "pedal", "noise", "camera")
"""Random streams of a run; new ones are appended, so that the others do not change."""


@dataclass(frozen=True)
class RunKey:
    """A run: its number in the sweep, varied parameter and level, and number within the level."""

    index: int
    parameter: str
    level: float
    number: int


@dataclass(frozen=True)
class Believed:
    """The estimator's assumptions: factors on the true values [-], and the sensors' noise."""

    mass_factor: float
    radius_factor: float
    stiffness_factor: float
    torque_factor: float
    noise: SensorNoise


@dataclass(frozen=True)
class Camera:
    """The camera side and its disturbances; see `files.CameraDraw`."""

    source: str
    wrong_share: float
    wrong_length_m: float
    lost_share: float
    late_s: float
    class_value_offset: float
    confidence_factor: float


@dataclass(frozen=True)
class RunPlan:
    """One run with all drawn values.

    Attributes
    ----------
    key : RunKey
        The run.
    scenario : Scenario
        Car, road, pedal, sensors and seed of this run; the noise is the true one.
    believed : Believed
        The estimator's assumptions.
    speed_bias_m_s : float
        Error of the vehicle speed [m/s].
    camera : Camera
        The camera side.
    camera_seed : int
        Seed of the camera's stream.
    """

    key: RunKey
    scenario: Scenario
    believed: Believed
    speed_bias_m_s: float
    camera: Camera
    camera_seed: int


def run_keys(sweep: Sweep) -> list[RunKey]:
    """All runs of a sweep in order."""
    file = sweep.file
    levels = [(axis.parameter, level) for axis in file.vary for level in axis.levels] or [("", float("nan"))]
    return [
        RunKey(index * file.runs + number, parameter, level, number)
        for index, (parameter, level) in enumerate(levels)
        for number in range(file.runs)
    ]


def plan_run(sweep: Sweep, key: RunKey) -> RunPlan:
    """The drawn values of one run."""
    file = sweep.file
    seeds = np.random.SeedSequence(file.seed, spawn_key=(key.number,)).spawn(len(STREAMS))
    stream = dict(zip(STREAMS, seeds, strict=True))
    numbers = _numbers(sweep, key, stream["numbers"])
    believed = Believed(
        **{
            name: numbers[f"believed.{name}"]
            for name in ("mass_factor", "radius_factor", "stiffness_factor", "torque_factor")
        },
        noise=_noise(sweep.scenario.sensors, numbers["sensors.noise_known_factor"]),
    )
    camera = Camera(
        source=file.camera.source,
        wrong_length_m=file.camera.wrong_length_m,
        **{
            name: numbers[f"camera.{name}"]
            for name in ("wrong_share", "lost_share", "late_s", "class_value_offset", "confidence_factor")
        },
    )
    return RunPlan(
        key=key,
        scenario=_scenario(sweep, numbers, stream),
        believed=believed,
        speed_bias_m_s=numbers["sensors.speed_bias_m_s"],
        camera=camera,
        camera_seed=_seed(stream["camera"]),
    )


def _noise(noise: SensorNoise, factor: float) -> SensorNoise:
    return SensorNoise(**{name: factor * value for name, value in noise.model_dump().items()})


def _seed(stream: np.random.SeedSequence) -> int:
    return int(stream.generate_state(1)[0])


def _numbers(sweep: Sweep, key: RunKey, stream: np.random.SeedSequence) -> dict[str, float]:
    """Numbers that are drawn once per run, each from its own stream, by their paths in the sweep file."""
    drawn = drawn_numbers(sweep.file)
    values = {}
    for (name, number), own in zip(drawn.items(), stream.spawn(len(drawn)), strict=True):
        value = sample(name, number, np.random.default_rng(own))
        values[name] = key.level if name == key.parameter else value
    if sweep.file.sensors.noise_known_factor is None and key.parameter != "sensors.noise_known_factor":
        values["sensors.noise_known_factor"] = values["sensors.noise_factor"]
    return values


def _scenario(sweep: Sweep, numbers: dict[str, float], stream: dict[str, np.random.SeedSequence]) -> Scenario:
    base, vehicle = sweep.scenario, sweep.scenario.vehicle
    tyre, factor = vehicle.tyre, numbers["vehicle.stiffness_factor"]
    tyre = tyre.model_copy(update={"longitudinal_stiffness_n": tyre.longitudinal_stiffness_n * factor})
    vehicle = vehicle.model_copy(
        update={"tyre": tyre, "mass_kg": vehicle.mass_kg * numbers["vehicle.mass_factor"]}
    )
    noise = _noise(base.sensors, numbers["sensors.noise_factor"])
    scenario = replace(base, vehicle=vehicle, sensors=noise, seed=_seed(stream["noise"]))
    if sweep.file.road is not None:
        road, length_m = draw_road(sweep.file.road, np.random.default_rng(stream["road"]))
        end = scenario.end.model_copy(update={"position_m": length_m})
        scenario = replace(scenario, road=road, end=end)
    if sweep.file.pedal is not None:
        random = np.random.default_rng(stream["pedal"])
        scenario = replace(scenario, manoeuvre=drive_pedal(scenario, sweep.file.pedal, random))
    return scenario


def draw_road(draw: RoadDraw, random: np.random.Generator) -> tuple[RoadFile, float]:
    """A drawn road with one stretch per surface, and its length [m]."""
    surfaces = list(draw.friction)
    if draw.order == "random":
        surfaces = [surfaces[i] for i in random.permutation(len(surfaces))]
    segments = []
    for index, surface in enumerate(surfaces):
        low, high = draw.friction[surface]
        mu = float(random.uniform(low, high))
        segments.append(RoadSegment(start_m=index * draw.stretch_m, mu_left=mu, mu_right=mu, surface=surface))
    return RoadFile(schema=1, segments=segments), len(segments) * draw.stretch_m
