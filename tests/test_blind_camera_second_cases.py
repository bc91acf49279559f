"""Cases of the camera with the second family's forms: their files and seals; and that the first's stay as they were."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from camera_stand_ins import blaming, check_log, digest_of, rolled

from benchmarks.gap.withheld import runner
from benchmarks.gap.withheld.generator import camera_case
from benchmarks.gap.withheld.generator.camera_family import (
    SECOND,
    CameraFamily,
    is_new,
)
from benchmarks.gap.withheld.generator.camera_further import ALL_EFFECTS
from benchmarks.gap.withheld.generator.cases import SHOWS
from benchmarks.gap.withheld.generator.forms import Family
from benchmarks.gap.withheld.generator.making import make_case
from benchmarks.gap.withheld.generator.table import Group, table
from benchmarks.gap.withheld.scorer import score_run

pytestmark = pytest.mark.long

TENTH = Family.TENTH
FIRST_CASES = {spec.name: spec for spec in table("camera")}


SECOND_CASES = {spec.name: spec for spec in table("camera", TENTH, CameraFamily.SECOND)}


NAMES = [
    "rich-class_friction_offset-1",
    "no_gap-1-rich",
    "outside-map_labels_old-0",
    "rich-camera_latency-0",
    "mild-motion_blur-1",
    "no_gap-2-calm",
    "outside-position_jumps-1",
    "pair-camera_pitch-class_friction_offset-0",
]


@pytest.mark.parametrize("name", NAMES)
def test_files_keep_the_contract_and_the_secret(name, tmp_path, monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    made = make_case(SECOND_CASES[name], 1, TENTH, CameraFamily.SECOND)
    made.write(tmp_path)
    seal = json.loads(json.dumps(made.seal()))
    assert seal["camera"]["family"] == "second"
    assert set(seal["camera"]["chain"]["forms"]) == set(SECOND)
    assert made.truth.gap.total >= SHOWS or made.spec.group in (Group.MILD, Group.NO_GAP)
    for log in ("fit_1", "holdout"):
        check_log(pd.read_csv(tmp_path / f"{log}.csv"))
    for path in tmp_path.iterdir():
        text = path.read_text(encoding="utf-8")
        assert not [e for e in ALL_EFFECTS if e in text]


def test_a_case_repeats_and_a_removed_one_has_the_same_logs(monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    rich = SECOND_CASES["rich-exposure_shift-1"]
    first, again = (make_case(rich, 1, TENTH, CameraFamily.SECOND) for _ in range(2))
    removed = make_case(SECOND_CASES["removed-exposure_shift-1"], 1, TENTH, CameraFamily.SECOND)
    for name, log in first.logs.items():
        pd.testing.assert_frame_equal(log, again.logs[name])
        pd.testing.assert_frame_equal(log, removed.logs[name])
    assert first.seal() == again.seal()


def test_a_folder_keeps_to_one_family_of_the_cameras_forms(tmp_path):
    runner.seal_run(tmp_path, "camera_small", 1, TENTH, CameraFamily.SECOND)
    runner.seal_run(tmp_path, "camera_small", 1, TENTH, CameraFamily.SECOND)
    assert json.loads((tmp_path / "run.json").read_text())["camera_forms"] == "second"
    with pytest.raises(runner.RunError, match="camera_forms: second there, first now"):
        runner.seal_run(tmp_path, "camera_small", 1, TENTH, CameraFamily.FIRST)


def test_a_run_is_scored_with_a_line_on_new_forms(tmp_path, monkeypatch):
    blaming(monkeypatch)
    monkeypatch.setattr(camera_case, "drive", rolled)
    runner.seal_run(tmp_path, "camera_small", 1, TENTH, CameraFamily.SECOND)
    spec = SECOND_CASES["rich-camera_latency-0"]
    assert runner.run_case(spec, 1, TENTH, tmp_path, False, CameraFamily.SECOND)["error"] is None
    scores = score_run(tmp_path)
    assert len(scores.pending) == len(table("camera_small", TENTH, CameraFamily.SECOND)) - 1
    seal = json.loads((tmp_path / "results" / f"{spec.name}.json").read_text())["seal"]
    line = next(line for line in scores.asides if "camera's first family" in line.text)
    assert line.n == is_new(seal["camera"]["chain"]["forms"], "camera_latency")


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


@pytest.mark.parametrize("name", FIRST_DIGESTS)
def test_the_first_familys_cases_stay_what_they_were(name, tmp_path, monkeypatch):
    monkeypatch.setattr(camera_case, "drive", rolled)
    assert digest_of(make_case(FIRST_CASES[name], 1, TENTH), tmp_path) == FIRST_DIGESTS[name]
