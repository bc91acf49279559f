"""Damage of the perception columns is said and changes no verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_drives import BARE, Camera, candidate, changed, diagnose, drive, road
from long import beyond

from sim2real.perception.diagnose import diagnose_perception
from sim2real.result import Verdict


def damaged(name, log):
    """The log with one kind of damage."""
    rng = np.random.default_rng(1)
    columns = {key: values.copy() for key, values in log.signals.items()}
    some = rng.uniform(size=len(log)) < 0.3
    if name == "no class for a third":
        columns["image_class"][some] = -1.0
    elif name == "stamps lost":
        lost = np.isin(columns["frame_id"] % 4, (1, 2))
        columns["image_from_m"][some | lost] = np.nan
    elif name == "stamps swapped":
        columns["image_from_m"], columns["image_to_m"] = columns["image_to_m"], columns["image_from_m"]
    elif name == "frame_id stuck":
        columns["frame_id"][:] = 7.0
    elif name == "frame_id missing":
        del columns["frame_id"]
    elif name == "frame_id counts down":
        columns["frame_id"] = 1e6 - columns["frame_id"]
    elif name == "frame_id lost here and there":
        columns["frame_id"][some] = np.nan
    elif name == "position lost here and there":
        columns["position_m"][some] = np.nan
        columns["vehicle_speed_m_s"][some] = np.nan
    elif name == "a class that does not exist":
        columns["image_class"][some] = 5.0
    elif name == "stamps of another coordinate":
        columns["image_from_m"][some] += 1000.0
        columns["image_to_m"][some] += 1000.0
    elif name == "confidence in per cent":
        columns["image_confidence"] *= 100.0
    return replace(log, signals=columns)


WARNED = {
    "stamps lost": "have lost their stamp",
    "stamps swapped": "beyond image_to_m",
    "frame_id stuck": "does not change",
    "frame_id missing": "is missing",
    "a class that does not exist": "no known class",
    "stamps of another coordinate": "200 m from the car",
    "confidence in per cent": "per cent",
}


@pytest.mark.parametrize(
    "name",
    beyond(
        4,
        [
            *WARNED,
            "no class for a third",
            "frame_id counts down",
            "frame_id lost here and there",
            "position lost here and there",
        ],
    ),
)
def test_damage_is_said_and_changes_no_verdict(name):
    for delay, causes in ((0.0, ()), (0.15, ("camera_latency",))):
        # ten pictures a second in a log of a hundred rows: each result has several rows to survive in
        finding = diagnose(Camera(delay_s=delay, fps=10.0), damage=lambda log: damaged(name, log))
        assert finding.causes == causes
        if name in WARNED:
            assert any(WARNED[name] in text for text in finding.warnings), finding.warnings
        else:
            assert finding.warnings == ()


def test_results_that_are_all_unusable_are_said():
    finding = diagnose(Camera(), damage=lambda log: changed(log, image_class=np.full(len(log), -1.0)))
    assert finding.verdict is Verdict.NO_GAP
    assert any("none of the camera's results is usable" in text for text in finding.warnings)
    assert "image_place" not in finding.before.signals


def test_half_the_columns_are_not_enough():
    finding = diagnose(Camera(), damage=lambda log: changed(log, image_to_m=None))
    assert any("image_to_m is missing" in text for text in finding.warnings)


def test_a_stretch_that_the_camera_sees_otherwise_is_said():
    roads = [road(seed=i) for i in range(3)]
    logs = [drive(r, Camera(), seed=i) for i, r in enumerate(roads)]
    renamed = [
        s.model_copy(update={"surface": "wet"}) if i == 4 else s for i, s in enumerate(roads[2].segments)
    ]
    wrong = roads[2].model_copy(update={"segments": renamed})
    finding = diagnose_perception(logs[:2], logs[2], [*roads[:2], wrong], BARE)
    said = [text for text in finding.warnings if "where road.yaml has wet" in text]
    assert (len(said) == 1) == (roads[2].segments[4].surface != "wet")


def test_thirty_per_cent_wrong_classes_do_not_hide_a_delay():
    for seed in range(3):
        finding = diagnose(Camera(delay_s=0.2, wrong=0.3), seed)
        assert finding.causes == ("camera_latency",)
        assert candidate(finding, "camera_latency").parameters["delay_s"].value == pytest.approx(
            0.2, abs=0.03
        )
