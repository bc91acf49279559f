"""The second family of the camera's forms: what it adds, what parameters still mean, and that the first stays as it was."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.random import Generator

from benchmarks.blind.generator import camera_case
from benchmarks.blind.generator.car import Car
from benchmarks.blind.generator.driver import Drive, Style
from benchmarks.blind.generator.forms import Family
from benchmarks.blind.generator.kernel import N, V, W, X
from benchmarks.blind.generator.making import make_case
from benchmarks.blind.generator.table import table
from benchmarks.blind.generator.world import World

TENTH = Family.TENTH
FIRST_CASES = {spec.name: spec for spec in table("camera")}


def rolled(car: Car, world: World, rich: bool, duration_s: float, rng: Generator, style: Style) -> Drive:
    """A drive without forces, in no time: the files of a case do not depend on how the car is moved."""
    clock = np.arange(round(1000 * duration_s) + 1) * 1e-3
    speed = 15.0 + rng.uniform(4.0, 6.0) * np.sin(0.5 * clock + rng.uniform(0.0, 6.0))
    path = np.zeros((clock.size, N + 1))
    path[:, X], path[:, V] = rng.uniform(0.0, 20.0) + np.cumsum(speed) * 1e-3, speed
    path[:, W : W + 4] = speed[:, None] / world.physics.radius
    return Drive(path, np.zeros((round(100 * duration_s) + 1, 4)))


# --- the first family stays as it was

FIRST_DIGESTS = {
    "rich-camera_latency-0": "843a379aded2ad5b",
    "rich-camera_pitch-1": "5e92482348cb049d",
    "rich-exposure_shift-2": "ff7a32c8657a361e",
    "rich-motion_blur-0": "9f5321b415de037d",
    "rich-class_friction_offset-0": "5f801c27e2f6ee53",
    "no_gap-0-rich": "f0d302cf0a469ebc",
    "no_gap-2-calm": "cf63a8c7d29629fc",
    "pair-camera_latency-class_friction_offset-0": "3fe6b0a068d2dcd2",
    "outside-map_borders_off-0": "de450599c4fd59cd",
    "outside-camera_freezes-1": "57cb0a71d4316b2e",
}
"""SHA-256 over the files and the seal of cases, as the first family made them before there was a second."""


def digest_of(name: str, folder: Path) -> str:
    case = make_case(FIRST_CASES[name], 1, TENTH)
    case.write(folder)
    seal = json.loads(json.dumps(case.seal()), parse_float=lambda x: f"{float(x):.6g}")
    seal["camera"].pop("family", None)
    total = hashlib.sha256(json.dumps(seal, sort_keys=True).encode())
    for path in sorted(folder.iterdir()):
        total.update(path.name.encode() + path.read_bytes())
    return total.hexdigest()[:16]


@pytest.mark.parametrize("name", FIRST_DIGESTS)
def test_the_first_familys_cases_stay_what_they_were(name, tmp_path, monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    assert digest_of(name, tmp_path) == FIRST_DIGESTS[name]
