"""What stands in for a car's drive and for a diagnosis in the tests of the camera's cases, and a plain chain."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

from benchmarks.blind.generator.car import Car
from benchmarks.blind.generator.driver import Drive, Style
from benchmarks.blind.generator.kernel import N, V, W, X
from benchmarks.blind.generator.world import World

PLAIN = {
    "captures": "even",
    "work": "steady",
    "lateness": "constant",
    "mounting": "firm",
    "stamp": "window",
    "belongs": "centre",
    "kept": "to_nothing",
    "reference_filter": "none",
    "reference_lost": "none",
}
"""Forms of a chain that does nothing of its own."""


def rolled(car: Car, world: World, rich: bool, duration_s: float, rng: Generator, style: Style) -> Drive:
    """A drive without forces, in no time: the files of a case do not depend on how the car is moved."""
    clock = np.arange(round(1000 * duration_s) + 1) * 1e-3
    speed = 15.0 + rng.uniform(4.0, 6.0) * np.sin(0.5 * clock + rng.uniform(0.0, 6.0))
    path = np.zeros((clock.size, N + 1))
    path[:, X], path[:, V] = rng.uniform(0.0, 20.0) + np.cumsum(speed) * 1e-3, speed
    path[:, W : W + 4] = speed[:, None] / world.physics.radius
    return Drive(path, np.zeros((round(100 * duration_s) + 1, 4)))


class Said:
    """A diagnosis that always blames the camera's delay."""

    def to_json(self) -> dict[str, Any]:
        cause = {"effect": "camera_latency", "probability": 0.9, "parameters": {}, "gap_after": 1.0}
        return {"verdict": "identified", "causes": [cause | {"fit_bic": 1.0}], "ambiguous_with": []}


def blaming(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put `Said` in the place of every diagnosis."""
    fake = ModuleType("sim2real.diagnose")
    fake.diagnose_files, fake.shrink_on = lambda *files, **options: Said(), lambda *files: 80.0
    monkeypatch.setitem(sys.modules, "sim2real.diagnose", fake)
