"""What of a log the camera's verdict rests on: not on names, computed columns, or what is simulated already."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from camera_drives import (
    BARE,
    BLIND,
    SLOW_AND_FAST,
    Camera,
    candidate,
    car_with,
    changed,
    diagnose,
    drive,
    log_of,
    road,
)
from long import beyond

from scenarios.effects.exposure_shift import share_left
from scenarios.files import RoadFile
from sim2real.auxiliary import camera_verdict
from sim2real.perception.diagnose import diagnose_perception
from sim2real.perception.frames import read_results
from sim2real.result import Verdict
from trpac_core.vision import camera as vision

ROAD = road()
ONE_SURFACE = RoadFile.model_validate(
    {"schema": 1, "segments": [{"start_m": 0.0, "mu_left": 0.8, "mu_right": 0.8, "surface": "dry"}]}
)
STOPS = 3.0
DARK = Camera(dimmed=share_left(STOPS), wrong=1.0 - 0.98 * share_left(STOPS))
BLURRED = Camera(blur_s=0.1, wrong=1.0 - 0.98 * np.exp(-17.0 * 0.1 / 4.0))


def logs(camera, on=ROAD, speeds=SLOW_AND_FAST, count=3, **more):
    return [drive(on, camera, speeds, seed=i, **more) for i in range(count)]


def judged(read, on=ROAD, car=BARE, **more):
    return diagnose_perception(read[:-1], read[-1], [on] * len(read), car, **more)


@pytest.mark.parametrize(
    ("camera", "effects"),
    beyond(
        1, [(BLURRED, {"motion_blur": {"exposure_s": 0.1}}), (DARK, {"exposure_shift": {"stops": STOPS}})]
    ),
    ids=["blur", "exposure"],
)
def test_class_errors_of_a_modelled_effect_are_no_gap(camera, effects):
    read = logs(camera)
    (effect,) = effects
    assert effect in judged(read).causes
    modelled = judged(read, car=car_with(**effects))
    assert (modelled.verdict, modelled.causes) == (Verdict.NO_GAP, ()), modelled.unexplained


@pytest.mark.parametrize(
    "effects",
    [{"motion_blur": {"exposure_s": 0.001}}, {"exposure_shift": {"stops": 0.1}}],
    ids=["blur", "stops"],
)
def test_a_modelled_effect_that_takes_next_to_nothing_excuses_no_wrong_class(effects):
    """Old pictures now and then, beside a shutter that is open for a millisecond as every one is."""

    def hanging(log, for_s=1.4, every_s=4.0):
        since = np.mod(log.time_s, every_s)
        begun = np.searchsorted(log.time_s, log.time_s - since)
        old = log.signals["image_class"][np.minimum(begun, len(log) - 1)]
        return changed(log, image_class=np.where(since < for_s, old, log.signals["image_class"]))

    finding = diagnose(Camera(wrong=0.01), 1, damage=hanging, vehicle=car_with(**effects))
    assert finding.verdict is Verdict.UNKNOWN


@pytest.mark.parametrize("column", beyond(1, [None, "computed"]))
def test_a_modelled_blur_excuses_wrong_classes_where_no_confidence_is_measured(column):
    def without(log):
        if column is None:
            return changed(log, image_confidence=None)
        return replace(log, derived=frozenset({"image_confidence"}))

    def confused(log):
        place = 0.5 * (log.signals["image_from_m"] + log.signals["image_to_m"])
        seen = log.signals["image_class"].copy()
        for one, after in pairwise(ROAD.segments[3:40:4]):
            seen[(place > one.start_m) & (place < min(one.start_m + 30.0, after.start_m))] = (
                int(one.surface_class) + 1
            ) % 3
        return changed(log, image_class=seen)

    read = [without(confused(x)) for x in logs(Camera())]
    assert judged(read).verdict is Verdict.UNKNOWN
    blurred = car_with(motion_blur={"exposure_s": 0.15})
    assert "reports another class than road.yaml" not in " ".join(judged(read, car=blurred).unexplained)


@pytest.mark.parametrize("confidence", beyond(1, [0.95, 1.0]))
def test_a_chain_that_is_always_as_sure_does_not_freeze(confidence):
    steady = Camera(wrong=0.0, confidence=confidence, roughness=0.0)
    assert judged(logs(steady, ONE_SURFACE), ONE_SURFACE).verdict is Verdict.NO_GAP
    assert judged(logs(steady)).verdict is Verdict.NO_GAP


@pytest.mark.parametrize(
    ("column", "value"), beyond(1, [("mu_reference", 0.8), ("image_confidence", 0.5), ("image_class", 2.0)])
)
def test_what_a_mapping_computes_is_no_reading(column, value):
    def made(log, derived):
        made_up = changed(log, **{column: np.full(len(log), value)})
        return replace(made_up, derived=frozenset({column}) if derived else frozenset())

    measured, computed = (judged([made(x, d) for x in logs(Camera())]) for d in (False, True))
    assert measured.verdict is not Verdict.NO_GAP
    assert computed is None or computed.verdict is Verdict.NO_GAP


def test_without_camera_results_nothing_is_said_of_class_values():
    off = [changed(x, **BLIND) for x in logs(Camera(offset=(-0.2, 0.1, 0.15)))]
    finding = judged(off)
    assert finding.verdict is Verdict.UNKNOWN
    assert not finding.causes
    assert finding.odd[0].depends_on == "surface"


def test_a_hold_out_without_a_camera_tells_nothing_of_the_shrink():
    read = logs(Camera(delay_s=0.06))
    read[-1] = changed(read[-1], **BLIND)
    finding = judged(read)
    assert finding.causes == ("camera_latency",)
    late = candidate(finding, "camera_latency")
    assert np.isnan(late.after.total)
    assert np.isnan(late.shrink_percent.value)
    assert any("hold-out has no data of image_place" in text for text in late.evidence_against)
    side = camera_verdict(finding)
    assert "does not show by how much" in side.sentence
    assert "from" not in side.sentence


def test_an_unknown_gap_is_as_large_after_as_before():
    def slow_and_unsure(log):
        dim = np.exp(-0.03 * (25.0 - log.signals["vehicle_speed_m_s"]))
        return changed(log, image_confidence=log.signals["image_confidence"] * dim)

    finding = diagnose(Camera(delay_s=0.1), 1, damage=slow_and_unsure)
    assert finding.verdict is Verdict.UNKNOWN
    assert finding.after == finding.before
    odd = camera_verdict(finding).unexplained
    assert (odd.signal, odd.depends_on, odd.sign) == ("image_confidence", "speed", "less at low speed")
    assert np.isnan(odd.share)


def test_borders_passed_mostly_at_the_top_speed_are_told_in_numbers():
    finding = judged(logs(Camera(delay_s=0.06), speeds=(8.0, 25.0, 25.0, 25.0, 25.0, 25.0)))
    for one in finding.candidates:
        assert not any("nan" in text for text in one.evidence_for)


def test_a_frame_id_that_is_lost_for_long_loses_no_results():
    def lost(log):
        numbers = log.signals["frame_id"].copy()
        numbers[len(numbers) // 4 :] = np.nan
        return changed(log, frame_id=numbers)

    (log,) = logs(Camera(delay_s=0.06), count=1)
    whole, _ = read_results(log, ROAD, BARE, vision.Camera())
    part, _ = read_results(lost(log), ROAD, BARE, vision.Camera())
    np.testing.assert_array_equal(part.time_s, whole.time_s)
    np.testing.assert_array_equal(part.classes, whole.classes)


def test_single_lost_frame_ids_split_no_result():
    (log,) = logs(Camera(fps=10.0), count=1)
    whole, _ = read_results(log, ROAD, BARE, vision.Camera())
    numbers = log.signals["frame_id"].copy()
    numbers[np.random.default_rng(1).uniform(size=len(numbers)) < 0.3] = np.nan
    part, _ = read_results(changed(log, frame_id=numbers), ROAD, BARE, vision.Camera())
    assert len(part) == len(whole)
    np.testing.assert_array_equal(part.from_m, whole.from_m)


@pytest.mark.parametrize(
    ("ids", "stamps", "results"),
    [
        ([1, 1, 1, None, 2, 2, 3], [5, 5, None, 6, 6, 6, 7], 3),
        ([2, 2, None, 3, 4], [5, 5, 5, 5, 5], 3),
        ([None, None, None, None, 4, 5], [5, 5, 6, 6, 7, 8], 4),
        ([1, None, None, 2, None, 3], [5, None, None, 6, None, 7], 3),
    ],
)
def test_results_are_told_apart_by_what_is_left_of_number_and_stamp(ids, stamps, results):
    rows = len(ids)
    numbers, near = np.array(ids, dtype=float), np.array(stamps, dtype=float)
    short = log_of(
        0.1 * np.arange(rows),
        {
            "position_m": np.linspace(0.0, 1.0, rows),
            "vehicle_speed_m_s": np.full(rows, 2.0),
            "frame_id": numbers,
            "image_class": np.where(np.isfinite(numbers) | np.isfinite(near), 0.0, np.nan),
            "image_from_m": near,
            "image_to_m": near + 1.0,
        },
    )
    found, _ = read_results(short, ROAD, BARE, vision.Camera())
    assert len(found) == results


def test_a_picture_may_be_named_in_any_row_of_its_result():
    (log,) = logs(Camera(fps=10.0), count=1)
    numbers = np.nan_to_num(log.signals["frame_id"], nan=-1.0)
    first = np.concatenate(([True], np.diff(numbers) != 0.0))
    named = replace(log, image_path=np.where(first, "", "a.png"))
    results, _ = read_results(named, ROAD, BARE, vision.Camera())
    assert (results.picture == "a.png").all()


def test_confidence_without_classes_is_told():
    (log,) = logs(Camera(), count=1)
    bare = changed(log, image_class=None, image_from_m=None, image_to_m=None)
    results, warnings = read_results(bare, ROAD, BARE, vision.Camera())
    assert results is None
    assert "image_class, image_from_m, image_to_m is missing" in warnings[0]
