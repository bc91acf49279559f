"""What a camera says of clear road: what borders take of its confidence is no exposure's."""

from __future__ import annotations

import numpy as np
import pytest
from camera_drives import BARE, FRONT_M, Camera, changed, diagnose, drive, road

from sim2real.perception.clear import FEWEST, taken_by_borders
from sim2real.perception.diagnose import diagnose_perception
from sim2real.perception.frames import read_results
from sim2real.result import Verdict
from trpac_core.vision.camera import Camera as Lens

PREVIEW_M = 2.5 + FRONT_M


def unsure_at_borders(road_file, share, reach_m=6.0):
    """A chain that borders make less sure, the less the farther they are."""
    starts = np.array([segment.start_m for segment in road_file.segments[1:]])

    def damage(log):
        place_m = log.signals["position_m"] + PREVIEW_M
        apart_m = np.abs(place_m[:, None] - starts).min(axis=1)
        sure = log.signals["image_confidence"] * (1.0 - share * np.exp(-((apart_m / reach_m) ** 2)))
        return changed(log, image_confidence=sure)

    return damage


def drives_on_patches(camera, share, spacing_m=20.0):
    roads = [road(spacing_m, seed=seed) for seed in range(3)]
    logs = [drive(r, camera, (20.0, 8.0, 15.0), 60.0, seed=seed) for seed, r in enumerate(roads)]
    return [unsure_at_borders(r, share)(log) for r, log in zip(roads, logs, strict=True)], roads


def results_of(logs, roads):
    found = (read_results(log, r, BARE, Lens())[0] for log, r in zip(logs, roads, strict=True))
    return [one for one in found if one is not None]


@pytest.mark.parametrize(("confidence", "share", "spacing_m"), [(0.86, 0.45, 20.0), (0.92, 0.5, 18.0)])
def test_a_chain_that_is_unsure_at_borders_is_not_ill_exposed(confidence, share, spacing_m):
    """On patches its mean confidence is that of an exposure that is 2.5 stops off."""
    logs, roads = drives_on_patches(Camera(fps=20.0, confidence=confidence), share, spacing_m)
    sure = np.concatenate([log.signals["image_confidence"] for log in logs])
    assert np.exp(np.nanmean(np.log(sure))) < 0.66
    finding = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert finding.verdict is Verdict.NO_GAP, (finding.causes, finding.unexplained)


def test_what_borders_take_is_measured_beside_speed_and_class():
    logs, roads = drives_on_patches(Camera(blur_s=0.03), 0.5)
    assert taken_by_borders(results_of(logs, roads)) > 0.1
    logs, roads = drives_on_patches(Camera(blur_s=0.03), 0.0)
    assert taken_by_borders(results_of(logs, roads)) < 0.02


def test_too_few_results_and_a_road_without_borders_tell_nothing_of_them():
    plain = road(5000.0)
    log = drive(plain, Camera())
    assert taken_by_borders(results_of([log], [plain])) < 0.01
    few = log.time_s < 0.9 * FEWEST / Camera().fps
    short = changed(log, image_confidence=np.where(few, log.signals["image_confidence"], np.nan))
    assert taken_by_borders(results_of([short], [plain])) == 0.0
    assert taken_by_borders([]) == 0.0


def test_a_level_below_all_that_was_seen_is_asked_about():
    """Neither proven nor normal: with pictures it is, and a look at them is what it asks for."""
    finding = diagnose(Camera(dimmed=0.85))
    assert (finding.verdict, finding.causes) == (Verdict.AMBIGUOUS, ("exposure_shift",))
    assert finding.ambiguous_with == (("exposure_shift",),)
    assert "Record the pictures" in finding.next_step
    assert finding.before.total > finding.after.total


def test_what_is_left_out_of_the_library_is_not_asked_about():
    finding = diagnose(Camera(dimmed=0.85), exclude=("exposure_shift",))
    assert (finding.verdict, finding.causes) == (Verdict.NO_GAP, ())
