"""A case of the camera: the car is its simulation's, and what is hidden lies in its camera's chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from .camera_chain import results
from .camera_faults import jumps_m
from .camera_forms import CAMERA_FORMS
from .camera_gap import Stage, crossings, gap_of
from .camera_layouts import SPEEDS, draw_laid_road
from .camera_library import Scene
from .camera_outside import ALL_EFFECTS
from .camera_outside_faults import shrunk, wandered_m
from .camera_reference import friction_of, measured_at, reference
from .camera_road import CLASS_FRICTION, CameraRoad, Passage, draw_camera_road, passage_of
from .camera_system import Chain, Fault, draw_chain
from .camera_telling import columns
from .car import Car, draw_car
from .cases import LOGS, MUST_SHOW, SHOWS, Case, Truth, draw_case, first_drivable, generator_of
from .driver import Drive, Style, UndrivableError, drive
from .forms import ASPECTS, RATES_HZ, Forms, draw_forms, form_of
from .kernel import RECORD_STEP_S
from .sensors import draw_noise, make_log
from .severity import find_severity
from .table import Spec
from .world import Parameters, nominal

Array = NDArray[np.floating[Any]]

LEAST_BORDERS = {True: 8, False: 2}
"""Of each log, rich or not."""
FASTER = 1.5
"""Fastest border over the slowest one, when rich [-]."""
DRIVEN_M = 8.0
"""Least distance on a class that counts as driven on."""
POSITION_STEP_M, POSITIONS_LOST, POSITION_NOISE_M = 0.05, 0.01, 0.03
"""Of a coarse odometer; share of samples without a position; of a receiver's."""


@dataclass(frozen=True)
class CameraCase(Case):
    """A case with what its camera is."""

    chain: Chain

    @property
    def subsystems(self) -> set[str]:
        """Right answers to where."""
        return {s for effect in self.truth.effects for s in ALL_EFFECTS[effect].subsystems}

    def seal(self) -> dict[str, Any]:
        """As a car's; `effects` hold what can be found without pictures, `camera` all that is hidden, and the chain."""
        effects = {
            effect: {name: given[name] for name in ALL_EFFECTS[effect].found}
            for effect, given in self.truth.effects.items()
        }
        camera = {"hidden": self.truth.effects, "chain": asdict(self.chain)}
        return super().seal() | {"effects": effects, "camera": camera}


def make_case(spec: Spec, seed: int, forms: Forms | None = None, attempt: int | None = None) -> Case:
    """A case of the car or of the camera on one, drawn anew until it can be driven; or one attempt, with given forms.

    Raises
    ------
    UndrivableError
        No draw gives a car that can be driven and a deviation that shows.
    """
    draw = draw_camera_case if spec.camera else draw_case
    if attempt is not None:
        return draw(spec, seed, attempt, forms)
    return first_drivable(spec.name, lambda attempt: draw(spec, seed, attempt, forms))


@dataclass(frozen=True)
class _Ground:
    """What a case's logs are driven with, and on."""

    spec: Spec
    car: Car
    style: Style
    roads: dict[str, CameraRoad]
    durations: dict[str, float]
    seeds: tuple[int, str]

    def drive(self, roads: dict[str, CameraRoad]) -> dict[str, tuple[Drive, Generator]]:
        """All logs' drives, each with the generator that its sensors go on with; the hold-out, which decides, first."""
        driven = {}
        for name in sorted(LOGS, key="holdout".__ne__):
            own, world = generator_of(*self.seeds, name), nominal(self.car, roads[name])
            done = drive(self.car, world, self.spec.rich, self.durations[name], own, self.style)
            _check_borders(passage_of(done.path, self.car), roads[name], self.spec.rich)
            driven[name] = (done, own)
        return driven


def _ground(spec: Spec, key: str, seed: int, driver: str, chain: Chain, rng: Generator) -> _Ground:
    few = not spec.rich and rng.random() < 0.5
    speeds = SPEEDS[chain.forms["speeds"]]
    style = form_of("driver", driver) if (rng.random() < 0.4 if spec.rich else few) else speeds
    road, elsewhere = (draw_camera_road(rng, "few" if few else "usual") for _ in range(2))
    layout = chain.forms["layout"]
    if layout != "usual" and not few:
        laid = generator_of(seed, key, "camera layout")
        road, elsewhere = (draw_laid_road(laid, layout) for _ in range(2))
    if chain.reference_noise is None:  # else what is measured would not be the class's value
        own = tuple(float(value) for value in np.round(CLASS_FRICTION * rng.uniform(0.85, 1.15, 3), 2))
        road, elsewhere = road.with_friction(own), elsewhere.with_friction(own)
    hold = elsewhere if rng.random() < 0.25 else road
    roads = {"fit_1": road, "fit_2": road, "holdout": hold, "fresh": hold}
    durations = {name: float(rng.uniform(24.0, 60.0)) for name in LOGS}
    return _Ground(spec, draw_car(rng, ()), style, roads, durations, (seed, key))


def draw_camera_case(spec: Spec, seed: int, attempt: int, forms: Forms | None = None) -> CameraCase:
    """A case of the camera, with these forms or drawn ones; raises UndrivableError."""
    key = f"{spec.data}/{attempt}"
    forms = forms or draw_forms(generator_of(seed, key, "forms"), ASPECTS | CAMERA_FORMS)
    rng = generator_of(seed, key, "camera")
    chain = draw_chain(rng, forms)
    if "class_friction_offset" in spec.effects and chain.reference_noise is None:
        raise UndrivableError("nothing measures the friction")
    ground = _ground(spec, key, seed, forms["driver"], chain, rng)
    car, roads, noise = ground.car, ground.roads, draw_noise(rng)
    rate = float(rng.choice(list(RATES_HZ), p=list(RATES_HZ.values())))
    driven = ground.drive(roads)
    passages = {name: passage_of(driven[name][0].path, car) for name in LOGS}
    driven_on = (c for c in range(3) if all(_driven(chain, passages[n], roads[n], n, c) for n in LOGS))
    scene = Scene(chain, tuple(driven_on))
    if "class_friction_offset" in spec.effects and not scene.driven:
        raise UndrivableError("no class is measured in every log")
    stage = Stage(chain, passages["holdout"], roads["holdout"], "holdout")
    parts, alone, fault = _deviations(spec, stage, scene, rng)
    if fault.friction != CLASS_FRICTION:  # road.yaml tells the friction that is there, so the car has no gap
        roads = {name: road.with_mu(friction_of(chain, road, fault)) for name, road in roads.items()}
        driven = ground.drive(roads)
        passages = {name: passage_of(driven[name][0].path, car) for name in LOGS}
    told = {name: _told(chain, road, fault) for name, road in roads.items()}
    logs = {}
    for name in LOGS:
        done, own = driven[name]
        sensors = nominal(car, told[name]).sensors
        log = make_log(done.path, done.command, sensors, noise, rate, own, form_of("noise", forms["noise"]))
        log = _with_camera(log, chain, passages[name], roads[name], fault, name)
        logs[name] = form_of("digits", forms["digits"])(log)
    gap = gap_of(Stage(chain, passages["holdout"], roads["holdout"], "holdout"), fault, told["holdout"])
    if spec.group in MUST_SHOW and spec.effects and gap.total < SHOWS:
        raise UndrivableError("the deviations cancel")
    drives = {name: done for name, (done, _) in driven.items()}
    base = {name: nominal(car, road) for name, road in told.items()}
    truth = Truth(parts, {}, gap, alone)
    return CameraCase(spec, forms, car, dict(told), noise, rate, truth, logs, drives, base, chain)


def _check_borders(passage: Passage, road: CameraRoad, rich: bool) -> None:
    """Enough of them, and when rich at speeds that tell a time from a distance."""
    there = crossings(passage, road)
    if there.size < LEAST_BORDERS[rich]:
        raise UndrivableError("too few borders")
    speeds = np.interp(there, passage.front_m, passage.speed_m_s)
    if rich and speeds.max() < FASTER * speeds.min():
        raise UndrivableError("one speed at all borders")


def _driven(chain: Chain, passage: Passage, road: CameraRoad, log: str, surface: int) -> bool:
    """Whether a drive tells anything of a class: how far it goes on it where there is a reference."""
    step = np.diff(passage.front_m, append=passage.front_m[-1])
    measured = measured_at(chain, passage, np.arange(step.size) * RECORD_STEP_S, log)
    return bool(step[(road.class_at(passage.front_m) == surface) & measured].sum() > DRIVEN_M)


def _told(chain: Chain, road: CameraRoad, fault: Fault) -> CameraRoad:
    """road.yaml of a road: as it is, but for borders that a bad map has elsewhere, or surfaces that it has wrong."""
    if fault.relabelled > 0.0:
        rng, surface = chain.rng(str(len(road.surface)), 31), np.array(road.surface)
        old = rng.random(surface.size) < fault.relabelled
        other = (surface + rng.integers(1, 3, surface.size)) % 3
        return replace(road, surface=tuple(int(s) for s in np.where(old, other, surface)))
    if fault.shrunk_m > 0.0:
        return shrunk(road, fault.shrunk_m)
    if fault.map_m == 0.0:
        return road
    borders = road.borders
    room = 0.4 * np.diff(np.concatenate([[0.0], borders, [borders[-1] + 50.0]]))
    off = fault.map_m * chain.rng(str(borders.size), 14).standard_normal(borders.size)
    return road.with_borders(borders + np.clip(off, -room[:-1], room[1:]))


def _with_camera(
    log: pd.DataFrame, chain: Chain, passage: Passage, road: CameraRoad, fault: Fault, name: str
) -> pd.DataFrame:
    """The log with the perception columns, and the friction's reference where there is one."""
    time_s = log["time_s"].to_numpy()
    seen = columns(chain, results(chain, passage, road, fault, name), time_s, name)
    measured = reference(chain, passage, road, fault, time_s, name)
    log = log.assign(
        position_m=_position(chain, log["position_m"].to_numpy(), fault, time_s, passage.end_s, name)
    )
    if measured is not None:
        log = log.assign(mu_reference=measured)
    return pd.concat([log, seen], axis=1)


def _position(chain: Chain, position_m: Array, fault: Fault, time_s: Array, end_s: float, name: str) -> Array:
    """As the log has it [m]."""
    if fault.odometer != 0.0:
        position_m = np.round(position_m * (1.0 + fault.odometer), 4)
    if fault.jumped_m != 0.0:
        position_m = np.round(position_m + jumps_m(chain, fault, time_s, end_s, name), 4)
    if fault.wandered_m != 0.0:
        position_m = np.round(position_m + wandered_m(chain, fault, time_s, name), 4)
    kind = chain.forms["position"]
    if kind == "steps":
        position_m = np.round(np.round(position_m / POSITION_STEP_M) * POSITION_STEP_M, 4)
    elif kind == "noisy":
        noise = POSITION_NOISE_M * chain.rng(name, 38).standard_normal(position_m.size)
        position_m = np.round(position_m + noise, 4)
    elif kind == "lost_samples":
        position_m = np.where(
            chain.rng(name, 38).random(position_m.size) < POSITIONS_LOST, np.nan, position_m
        )
    return position_m


def _deviations(
    spec: Spec, stage: Stage, scene: Scene, rng: Generator
) -> tuple[dict[str, Parameters], dict[str, float], Fault]:
    """Parameters of each effect at the wanted gap, that gap, and all of them in one chain."""
    chosen = {effect: ALL_EFFECTS[effect].at(scene, rng) for effect in spec.effects}

    def gap_with(effect: str) -> Callable[[float], float]:
        def gap(severity: float) -> float:
            fault = ALL_EFFECTS[effect].apply(Fault(), chosen[effect](severity))
            return gap_of(stage, fault, _told(stage.chain, stage.road, fault)).total

        return lru_cache(gap)

    gaps = {effect: gap_with(effect) for effect in spec.effects}
    if spec.group in MUST_SHOW and any(gap(1.0) < SHOWS for gap in gaps.values()):
        raise UndrivableError("nothing in the drive shows the deviation")
    severities = {effect: find_severity(gap, spec.target) for effect, gap in gaps.items()}
    parts = {effect: chosen[effect](severity) for effect, severity in severities.items()}
    fault = Fault()
    for effect, given in parts.items():
        fault = ALL_EFFECTS[effect].apply(fault, given)
    return parts, {effect: gaps[effect](severity) for effect, severity in severities.items()}, fault
