"""What stands in for a car's drive and for a diagnosis in the tests of the camera's cases, and a plain chain."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.random import Generator

from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS
from benchmarks.gap.withheld.generator.camera_road import CLASS_FRICTION, CameraRoad, Passage
from benchmarks.gap.withheld.generator.car import Car
from benchmarks.gap.withheld.generator.driver import Drive, Style
from benchmarks.gap.withheld.generator.kernel import N, V, W, X
from benchmarks.gap.withheld.generator.world import World

PLAIN = {aspect: next(iter(forms)) for aspect, forms in CAMERA_FORMS.items()}
PLAIN |= {"stamp": "window", "begins": "before"}
"""Forms of a chain that does nothing of its own."""

ROAD = CameraRoad(
    (0.0, *(45.0 + 31.7 * np.arange(60))),
    tuple(CLASS_FRICTION[i % 3] for i in range(61)),
    tuple(i % 3 for i in range(61)),
)
"""Dry, wet and snow in turn."""


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
        cause = {"effect": "camera_latency", "probability": 0.9, "parameters": {}}
        return {"verdict": "identified", "causes": [cause], "ambiguous_with": []}


def blaming(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put `Said` in the place of every diagnosis."""
    fake = ModuleType("sim2real.diagnose")
    fake.diagnose_files, fake.shrink_on = lambda *files, **options: Said(), lambda *files: 80.0
    monkeypatch.setitem(sys.modules, "sim2real.diagnose", fake)


def check_log(log: pd.DataFrame) -> None:
    """Columns of the contract; a result's stay the same as long as its number does."""
    assert np.all(np.diff(log["time_s"]) > 0.0)
    seen = log.filter(regex="^(image|frame)").dropna(how="all")
    assert set(seen["image_class"]) <= {-1, 0, 1, 2}
    told = seen[seen["image_class"] >= 0]
    assert len(told) > 0.6 * len(seen)
    assert told["image_confidence"].between(0.0, 1.0).all()
    assert (told["image_to_m"] > told["image_from_m"]).all()
    same = np.diff(seen["frame_id"]) == 0.0
    before, after = (part[same].reset_index(drop=True) for part in (seen.iloc[:-1], seen.iloc[1:]))
    pd.testing.assert_frame_equal(before, after)


def steady(speed_m_s: float, seconds: float = 40.0) -> Passage:
    """A way at one speed."""
    clock = np.arange(round(1000 * seconds) + 1) * 1e-3
    return Passage(2.0 + speed_m_s * clock, np.full(clock.size, speed_m_s))
