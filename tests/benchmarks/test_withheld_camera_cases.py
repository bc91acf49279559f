"""Cases of the camera: their files and seals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from camera_stand_ins import check_log
from long import beyond, long

from benchmarks.gap.withheld.generator import driver
from benchmarks.gap.withheld.generator.camera_forms import CAMERA_FORMS
from benchmarks.gap.withheld.generator.camera_outside import ALL_EFFECTS, CAMERA_OUTSIDE
from benchmarks.gap.withheld.generator.camera_road import CLASS_FRICTION, SURFACES
from benchmarks.gap.withheld.generator.cases import SHOWS
from benchmarks.gap.withheld.generator.forms import NEWEST
from benchmarks.gap.withheld.generator.kernel import ANGLE, RECORD_STEP_S, N, V, W, X
from benchmarks.gap.withheld.generator.making import make_case
from benchmarks.gap.withheld.generator.table import Group, table

CASES = {spec.name: spec for spec in table("camera", NEWEST)}
LATER_OUTSIDE = [name for name, (since, _) in CAMERA_OUTSIDE.items() if since == 3]
HARDEST_M_S2 = 4.0
"""Of a car that has no wheels to slide on."""


def glide(
    physics: Any, y: np.ndarray, start: int, rows: int, split: int, command: np.ndarray, out: np.ndarray
) -> None:
    """In place of `kernel.integrate`: a mass that its motors push, on wheels that roll."""
    first, steps = start // driver.ROWS_PER_COMMAND, rows // driver.ROWS_PER_COMMAND
    pushed = command[first : first + steps + 1].sum(axis=1) / (physics.radius * physics.mass)
    along = np.arange(1, rows + 1) / driver.ROWS_PER_COMMAND
    accel = np.clip(np.interp(along, np.arange(steps + 1), pushed), -HARDEST_M_S2, HARDEST_M_S2)
    speed = np.maximum(y[V] + RECORD_STEP_S * np.cumsum(accel), 0.0)
    place = y[X] + RECORD_STEP_S * np.cumsum(speed)
    there = out[start + 1 : start + 1 + rows]
    there[:, V], there[:, X], there[:, N] = speed, place, accel
    there[:, W : W + 4] = (speed / physics.radius)[:, None]
    there[:, ANGLE : ANGLE + 4] = (place / physics.radius)[:, None]
    y[:] = there[-1, :N]


@pytest.fixture(autouse=True)
def _gliding(monkeypatch):
    monkeypatch.setattr(driver, "integrate", glide)


NAMES = [
    "rich-camera_latency-0",
    "rich-class_friction_offset-1",
    "mild-class_friction_offset-1",
    "no_gap-0-rich",
    "pair-motion_blur-class_friction_offset-0",
    f"outside-{LATER_OUTSIDE[0]}-0",
    "rich-camera_pitch-3",
    "rich-exposure_shift-1",
    "rich-motion_blur-3",
    "no_gap-2-calm",
    "no_gap-6-rich",
    *(f"outside-{name}-0" for name in LATER_OUTSIDE[1:]),
]


@pytest.mark.parametrize("name", beyond(6, NAMES))
@long
def test_files_keep_the_contract_and_the_secret(name, tmp_path):
    made = make_case(CASES[name], 1, NEWEST)
    made.write(tmp_path)
    seal = json.loads(json.dumps(made.seal()))
    assert seal["camera"]["edition"] == 3
    assert set(seal["camera"]["chain"]["forms"]) == set(CAMERA_FORMS)
    assert list(seal["effects"]) == list(seal["camera"]["hidden"]) == list(CASES[name].effects)
    if made.spec.group is Group.NO_GAP:
        assert made.truth.gap.total == 1.0
        assert not seal["subsystems"]
    else:
        assert made.truth.gap.total >= SHOWS or made.spec.group is Group.MILD
        assert set(seal["subsystems"]) <= {"camera", "road"}
    for log in ("fit_1", "holdout"):
        check_log(pd.read_csv(tmp_path / f"{log}.csv"))
    check_road(tmp_path, seal)
    for path in tmp_path.iterdir():
        text = path.read_text(encoding="utf-8")
        assert not [e for e in ALL_EFFECTS if e in text]


def check_road(folder: Path, seal: dict[str, Any]) -> None:
    """With a reference, road.yaml has the friction that is there, in the mean of each class over its stretches."""
    if "mu_reference" not in pd.read_csv(folder / "fit_1.csv", nrows=1):
        return
    segments = yaml.safe_load((folder / "road.yaml").read_text(encoding="utf-8"))["segments"]
    friction = dict(zip(SURFACES, CLASS_FRICTION, strict=True))
    friction |= seal["effects"].get("class_friction_offset", {})
    for surface in {segment["surface"] for segment in segments}:
        values = [s["mu_left"] for s in segments if s["surface"] == surface]
        assert np.mean(values) == pytest.approx(friction[surface], abs=0.02)


@pytest.mark.long
def test_where_nothing_is_hidden_classes_change_at_the_borders():
    """Over all such cases the median border is where road.yaml has it, to less than what a picture is apart."""
    for name in ("no_gap-0-rich", "no_gap-1-rich", "no_gap-3-rich", "no_gap-4-rich"):
        made = make_case(CASES[name], 1, NEWEST)
        log, borders = made.logs["holdout"], np.array(made.roads["holdout"].start_m[1:])
        seen = log[log["frame_id"].diff().fillna(1.0) != 0.0].dropna(subset=["image_class", "image_from_m"])
        middle = 0.5 * (seen["image_from_m"] + seen["image_to_m"]).to_numpy()
        changes = np.flatnonzero(np.diff(seen["image_class"].to_numpy()))
        there = 0.5 * (middle[changes] + middle[changes + 1])
        off = there - borders[np.argmin(np.abs(borders - there[:, None]), axis=1)]
        apart = np.median(np.diff(middle)[np.diff(middle) > 0.0])
        near = off[np.abs(off) < 2.0 * apart + 0.5]
        assert abs(np.median(near)) < 0.5 * apart + 0.25, name


def test_a_case_repeats_and_a_removed_one_has_the_same_logs():
    rich = CASES["rich-exposure_shift-1"]
    first, again = (make_case(rich, 1, NEWEST) for _ in range(2))
    removed = make_case(CASES["removed-exposure_shift-1"], 1, NEWEST)
    for name, log in first.logs.items():
        pd.testing.assert_frame_equal(log, again.logs[name])
        pd.testing.assert_frame_equal(log, removed.logs[name])
    assert first.seal() == again.seal()
