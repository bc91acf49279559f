"""A case: its car, road, deviation and logs, all drawn from the seed and the case's name."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator

from .car import Car, Road, draw_car, draw_road
from .driver import Drive, UndrivableError, drive
from .forms import ASPECTS, RATES_HZ, Forms, draw_forms, effect_in, form_of
from .sensors import Noise, draw_noise, make_log
from .severity import CEILING, Size, drive_or_none, find_severity, residual, size_of
from .table import Group, Spec
from .world import Parameters, World, nominal

LOGS = ("fit_1", "fit_2", "holdout", "fresh")
GOOD = {"wheel_rad_s": 0.02, "speed_m_s": 0.01, "accel_m_s2": 0.03}
"""Noise of test equipment, where a deviation would drown in anything else."""
MISMATCH_GAP = 2.0
"""Gap that the tyre's other curve alone may leave [noise floors]."""
MUST_SHOW = frozenset(Group) - {Group.MILD}
SHOWS = 5.0
"""Gap that each deviation of these groups has to reach at its severest [noise floors], or all is drawn anew."""
TRIES = 20


@dataclass(frozen=True)
class Truth:
    """What the seal hides."""

    effects: dict[str, Parameters]
    tyre: Parameters
    """Share and parameters of the foreign curve; empty for the simulation's own tyre."""
    gap: Size
    """On the hold-out [noise floors]."""
    gap_of: dict[str, float]
    """Each effect's gap alone, on the same road and by the same driver."""


@dataclass(frozen=True)
class Case:
    """All that a case is; `logs` are ready to be written, `drives` the truth behind them."""

    spec: Spec
    forms: Forms
    car: Car
    roads: dict[str, Road]
    noise: Noise
    rate_hz: float
    truth: Truth
    logs: dict[str, pd.DataFrame]
    drives: dict[str, Drive]
    base: dict[str, World]
    """The simulation's world on each log's road."""

    @property
    def subsystems(self) -> set[str]:
        """Right answers to where."""
        return {s for effect in self.truth.effects for s in effect_in(self.forms, effect).subsystems}

    def seal(self) -> dict[str, Any]:
        """What was hidden, as plain data."""
        truth = self.truth
        return {
            "case": self.spec.name,
            "group": str(self.spec.group),
            "effects": truth.effects,
            "subsystems": sorted(self.subsystems),
            "forms": dict(self.forms),
            "tyre": truth.tyre,
            "target": self.spec.target,
            "gap": truth.gap.total,
            "gap_signals": truth.gap.signals,
            "gap_of": truth.gap_of,
            "rate_hz": self.rate_hz,
            "noise": vars(self.noise),
            "modelled": self.car.modelled,
        }

    def write(self, folder: Path) -> None:
        """The files that the diagnosis gets (fresh.csv is shown to no fit), without any of the truth."""
        folder.mkdir(parents=True, exist_ok=True)
        self.car.write(folder / "vehicle.yaml")
        self.roads["fit_1"].write(folder / "road.yaml")
        self.roads["holdout"].write(folder / "road_holdout.yaml")
        for name, log in self.logs.items():
            log.to_csv(folder / f"{name}.csv", index=False)


def generator_of(seed: int, *names: str) -> Generator:
    """Independent of every other name's, and of the order in which cases are made."""
    return np.random.default_rng([seed, *(zlib.crc32(name.encode()) for name in names)])


def first_drivable(name: str, draw: Callable[[int], Case]) -> Case:
    """What the first of `TRIES` attempts gives that does not raise UndrivableError; that error where all do."""
    problems = []
    for attempt in range(TRIES):
        try:
            return draw(attempt)
        except UndrivableError as problem:
            problems.append(str(problem))
    raise UndrivableError(f"{name}: no drivable car in {TRIES} draws; the last: {problems[-1]}")


@dataclass(frozen=True)
class _Stage:
    """Where the severities are set: the hold-out's road and driver."""

    spec: Spec
    forms: Forms
    car: Car
    base: World
    duration_s: float
    seeds: tuple[int, str, str]

    def gap(self, world: World, noise: Noise) -> float:
        style = form_of("driver", self.forms["driver"])
        rng = generator_of(*self.seeds)
        driven = drive_or_none(self.car, world, self.spec.rich, self.duration_s, rng, style)
        return CEILING if driven is None else size_of(residual(world, self.base, driven), noise).total


def draw_case(spec: Spec, seed: int, attempt: int, forms: Forms | None = None) -> Case:
    """A case of the car, with these forms or drawn ones; raises UndrivableError."""
    key = f"{spec.data}/{attempt}"
    rng, forms = generator_of(seed, key), forms or draw_forms(generator_of(seed, key, "forms"), ASPECTS)
    car = draw_car(rng, spec.effects)
    road, elsewhere = draw_road(rng, spec.rich), draw_road(rng, spec.rich)
    hold = elsewhere if rng.random() < 0.25 else road
    roads = {"fit_1": road, "fit_2": road, "holdout": hold, "fresh": hold}
    base = {name: nominal(car, place) for name, place in roads.items()}
    timing = spec.group is Group.TIMING
    durations = {name: 60.0 if timing else float(rng.uniform(24.0, 34.0)) for name in LOGS}
    noise = draw_noise(rng)
    rate = 1000.0 if timing else float(rng.choice(list(RATES_HZ), p=list(RATES_HZ.values())))
    stage = _Stage(spec, forms, car, base["holdout"], durations["holdout"], (seed, key, "holdout"))
    parts, gap_of, noise = _deviations(stage, noise, rng)
    tyre = _tyre(stage, noise, rng) if spec.group is Group.TYRE else {}
    pulses = int(rng.integers(2**31))
    worlds, logs, drives = {}, {}, {}
    for name in LOGS:
        world = (
            form_of("foreign_tyre", forms["foreign_tyre"]).apply(base[name], **tyre) if tyre else base[name]
        )
        for effect, parameters in parts.items():
            world = effect_in(forms, effect).apply(world, parameters)
        worlds[name] = world.sensed(seed=pulses)
        own = generator_of(seed, key, name)
        driven = drive(car, world, spec.rich, durations[name], own, form_of("driver", forms["driver"]))
        log = make_log(
            driven.path,
            driven.command,
            worlds[name].sensors,
            noise,
            rate,
            own,
            form_of("noise", forms["noise"]),
        )
        drives[name], logs[name] = driven, form_of("digits", forms["digits"])(log)
    gap = size_of(residual(worlds["holdout"], base["holdout"], drives["holdout"]), noise)
    return Case(spec, forms, car, roads, noise, rate, Truth(parts, tyre, gap, gap_of), logs, drives, base)


def _deviations(
    stage: _Stage, noise: Noise, rng: Generator
) -> tuple[dict[str, Parameters], dict[str, float], Noise]:
    """Parameters of each effect at the wanted gap, that gap, and the noise: better sensors where it is out of reach."""
    spec = stage.spec
    deviations = {effect: effect_in(stage.forms, effect) for effect in spec.effects}
    chosen = {effect: deviation.at(stage.car, rng) for effect, deviation in deviations.items()}

    def gap_with(effect: str, noise: Noise) -> Callable[[float], float]:
        apply, at = deviations[effect].apply, chosen[effect]
        return lru_cache(lambda severity: stage.gap(apply(stage.base, at(severity)), noise))

    gaps = {effect: gap_with(effect, noise) for effect in chosen}
    if any(gap(1.0) < spec.target for gap in gaps.values()):
        noise = replace(noise, **GOOD)
        gaps = {effect: gap_with(effect, noise) for effect in chosen}
    if spec.group in MUST_SHOW and any(gap(1.0) < SHOWS for gap in gaps.values()):
        raise UndrivableError("nothing in the drive shows the deviation")
    severities = {effect: find_severity(gap, spec.target) for effect, gap in gaps.items()}
    parts = {effect: chosen[effect](severity) for effect, severity in severities.items()}
    return parts, {effect: gaps[effect](severity) for effect, severity in severities.items()}, noise


def _tyre(stage: _Stage, noise: Noise, rng: Generator) -> Parameters:
    """A share of the foreign curve that leaves `MISMATCH_GAP` at most, and the curve's own parameters."""
    foreign = form_of("foreign_tyre", stage.forms["foreign_tyre"])
    own = foreign.draw(rng)
    share = find_severity(
        lambda share: stage.gap(foreign.apply(stage.base, share, **own), noise), MISMATCH_GAP
    )
    return {"share": share, **own}
