"""How sure the camera is: blurred or ill exposed."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from camera_drives import BARE, Camera, any_camera, candidate, changed, diagnose, drive, road
from long import beyond

from sim2real.perception.diagnose import diagnose_perception
from sim2real.result import Verdict


@pytest.mark.parametrize("seed", beyond(3, range(12)))
def test_blur_is_found_whatever_the_normal_confidence(seed):
    exposure = (0.02, 0.03, 0.05)[seed % 3]
    camera = any_camera(seed, blur_s=exposure, confidence=(0.75, 0.98)[seed % 2])
    finding = diagnose(camera, seed)
    assert "motion_blur" in finding.causes
    estimate = candidate(finding, "motion_blur").parameters["exposure_s"]
    assert estimate.low <= exposure <= estimate.high
    assert estimate.value == pytest.approx(exposure, rel=0.35, abs=0.002)


def test_another_networks_answer_to_blur_is_in_the_interval():
    for smear_m in (2.0, 8.0):
        finding = diagnose(Camera(blur_s=0.03, smear_m=smear_m))
        estimate = candidate(finding, "motion_blur").parameters["exposure_s"]
        assert finding.causes == ("motion_blur",)
        assert estimate.low <= 0.03 <= estimate.high


def test_confidence_low_at_all_speeds_is_exposure():
    finding = diagnose(Camera(dimmed=0.5, confidence=0.95))
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("exposure_shift",))
    estimate = candidate(finding, "exposure_shift").parameters["stops"]
    truth = 4.3 * np.sqrt(-np.log(0.5))
    assert estimate.value == pytest.approx(truth, rel=0.15)
    assert estimate.low <= -truth <= truth <= estimate.high  # without pictures the sign is open


def test_low_confidence_at_one_speed_is_ambiguous():
    finding = diagnose(Camera(dimmed=0.45), speeds=(20.0, 20.0))
    assert finding.verdict is Verdict.AMBIGUOUS
    assert [set(group) for group in finding.ambiguous_with] == [{"motion_blur", "exposure_shift"}]
    assert "at low and at high speed" in finding.next_step


def test_a_moderately_low_confidence_cannot_rule_exposure_out():
    finding = diagnose(Camera(dimmed=0.9))
    assert finding.verdict is Verdict.NO_GAP
    assert "exposure_shift" in finding.cannot_rule_out


def picture_drive(folder, stops, seed, name, dimmed=1.0):
    """A drive whose log names pictures of a rough grey road, exposed by so many stops."""
    rng = np.random.default_rng(seed)
    sure = dimmed * float(np.exp(-((stops / 4.3) ** 2)))
    log = drive(road(seed=seed), Camera(fps=5.0, dimmed=sure), seed=seed)
    ids = log.signals["frame_id"]
    images = np.full(len(log), "", dtype="<U40")
    (folder / name).mkdir()
    for number in np.unique(ids[np.isfinite(ids)])[::8]:
        light = 0.14 * np.exp(0.3 * rng.standard_normal((120, 192))) * 2.0**stops
        grey = np.round(255.0 * np.clip(light, 0.0, 1.0) ** (1.0 / 2.2)).astype(np.uint8)
        file = f"{name}/{int(number)}.png"
        cv2.imwrite(str(folder / file), np.repeat(grey[:, :, None], 3, axis=2))
        images[ids == number] = file
    return replace(log, image_path=images, path=folder / f"{name}.csv")


def test_pictures_alone_tell_their_exposure(tmp_path):
    logs = [picture_drive(tmp_path, 4.0, seed, f"d{seed}") for seed in range(3)]
    logs = [changed(log, image_confidence=None) for log in logs]
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    assert finding.causes == ("exposure_shift",)
    assert candidate(finding, "exposure_shift").parameters["stops"].low > 0.0


def test_wrong_classes_and_low_confidence_together_are_bad_pictures():
    """Either alone is within what cameras do."""
    assert diagnose(Camera(dimmed=0.9)).verdict is Verdict.NO_GAP
    assert diagnose(Camera(wrong=0.14)).verdict is Verdict.NO_GAP
    finding = diagnose(Camera(dimmed=0.75, wrong=0.3))
    assert finding.causes == ("exposure_shift",)
    assert "differs from road.yaml in" in " ".join(candidate(finding, "exposure_shift").evidence_for)


@pytest.mark.parametrize("stops", [-3.0, 0.0, 3.0])
def test_pictures_tell_overexposed_from_underexposed(tmp_path, stops):
    logs = [picture_drive(tmp_path, stops, seed, f"d{seed}") for seed in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    if stops == 0.0:
        assert finding.verdict is Verdict.NO_GAP
        assert "exposure_shift" not in finding.cannot_rule_out
        return
    assert finding.causes == ("exposure_shift",)
    estimate = candidate(finding, "exposure_shift").parameters["stops"]
    assert np.sign(estimate.value) == np.sign(stops)
    assert estimate.low <= stops <= estimate.high
    assert "stops from usual" in " ".join(candidate(finding, "exposure_shift").evidence_for)


def test_well_exposed_pictures_answer_for_a_low_confidence(tmp_path):
    logs = [picture_drive(tmp_path, 0.0, seed, f"d{seed}", dimmed=0.85) for seed in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    assert finding.verdict is Verdict.NO_GAP


@pytest.mark.parametrize("stops", [-3.0, 3.0])
def test_pictures_of_the_hold_out_alone_tell_the_sign(tmp_path, stops):
    logs = [picture_drive(tmp_path, stops, seed, f"d{seed}") for seed in range(3)]
    logs[:2] = [replace(log, image_path=None) for log in logs[:2]]
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    assert finding.causes == ("exposure_shift",)
    found = candidate(finding, "exposure_shift")
    assert np.sign(found.parameters["stops"].value) == np.sign(stops)
    assert not any("names no pictures" in text for text in found.evidence_against)


def test_pictures_that_cannot_be_read_are_said(tmp_path):
    logs = [picture_drive(tmp_path, 0.0, seed, f"d{seed}") for seed in range(3)]
    for file in (tmp_path / "d0").iterdir():
        file.write_bytes(b"no picture")
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    assert finding.verdict is Verdict.NO_GAP
    (warning,) = [w for w in finding.warnings if "pictures looked at" in w]
    assert "neither JPEG nor PNG" in warning


def test_blur_that_costs_little_at_first_is_blur():
    def squared(log):
        speed, sure = log.signals["vehicle_speed_m_s"], log.signals["image_confidence"]
        return changed(log, image_confidence=sure * np.exp(-((speed * 0.15 / 4.0) ** 2)))

    finding = diagnose(Camera(), damage=squared, speeds=(5.0, 15.0, 8.0, 25.0))
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("motion_blur",))
    exposure = candidate(finding, "motion_blur").parameters["exposure_s"]
    assert exposure.value == pytest.approx(0.15, rel=0.1)
    assert finding.after.signals["image_confidence"] < 1.5


def test_a_confidence_that_comes_and_goes_is_no_exposure():
    def blinded(log):
        seen = np.where((log.time_s // 4.0) % 2.0 == 0.0, 1.0, 0.35)
        return changed(log, image_confidence=seen * log.signals["image_confidence"])

    finding = diagnose(Camera(), damage=blinded)
    assert finding.verdict is Verdict.UNKNOWN
    assert any("varies by a factor of" in text for text in finding.unexplained)
