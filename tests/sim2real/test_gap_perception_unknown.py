"""What of the camera chain is no gap after all, and what is one that no effect of the library explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_drives import BARE, Camera, changed, diagnose, drive, road
from long import beyond

from sim2real.perception.blocks import Blocks
from sim2real.perception.chain import Account, Chain
from sim2real.perception.confidence import ConfidenceFit, ConfidenceModel
from sim2real.perception.confidence_chain import rest_of
from sim2real.perception.diagnose import _unexplained, diagnose_perception
from sim2real.result import Interval, Verdict


@pytest.mark.parametrize("seed", beyond(1, range(4)))
def test_scatter_on_the_hold_out_alone_is_no_gap(seed):
    roads = [road(seed=3 * seed + i) for i in range(3)]
    careful, careless = Camera(fps=40.0), Camera(fps=40.0, flicker_m=1.5, wrong=0.05)
    cameras = (careful, careful, careless)
    logs = [drive(r, c, seed=10 * seed + i) for i, (r, c) in enumerate(zip(roads, cameras, strict=True))]
    finding = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert finding.verdict is Verdict.NO_GAP, finding.unexplained


def test_results_repeated_to_the_last_digit_are_a_gap():
    def frozen(log):
        """Results of every tenth second are repeated for half a second."""
        held = (log.time_s % 10.0) < 0.5
        first = np.flatnonzero(held & ~np.roll(held, 1))
        signals = {}
        for name in ("image_class", "image_confidence"):
            column = log.signals[name].copy()
            for start in first:
                column[start : start + 50] = column[start]
            signals[name] = column
        return changed(log, **signals)

    finding = diagnose(Camera(fps=40.0, roughness=0.05), 2, damage=frozen)
    assert finding.verdict is Verdict.UNKNOWN
    assert any("repeats a result to the last digit" in text for text in finding.unexplained)


def hanging(log, for_s=1.4, every_s=4.0):
    """Classes of an old picture for a while, again and again, under new numbers and stamps, as sure as the others."""
    since = np.mod(log.time_s, every_s)
    begun = np.searchsorted(log.time_s, log.time_s - since)
    old = log.signals["image_class"][np.minimum(begun, len(log) - 1)]
    return changed(log, image_class=np.where(since < for_s, old, log.signals["image_class"]))


@pytest.mark.parametrize("seed", range(3))
def test_a_camera_that_hands_out_old_pictures_now_and_then_is_a_gap(seed):
    finding = diagnose(Camera(wrong=0.01), seed=seed, damage=hanging)
    assert finding.verdict is Verdict.UNKNOWN
    assert any("old" in text for text in finding.unexplained)


@pytest.mark.parametrize(("spacing_m", "seed"), [(20.0, 1), (40.0, 2)])
def test_a_camera_that_errs_for_metres_everywhere_is_no_gap(spacing_m, seed):
    """Short stretches are wholly wrong, or five of 51 borders late and one early: chance, of so many."""

    def streaky(log, share=0.11, mean_m=6.0):
        rng = np.random.default_rng(int(log.signals["vehicle_speed_m_s"].sum()) + 40_001)
        number, begin = log.signals["frame_id"], log.signals["image_from_m"]
        first = np.flatnonzero(np.diff(number, prepend=number[0] - 1.0) > 0.0)
        place, classes = begin[first], log.signals["image_class"][first]
        at = np.nanmin(place)
        while at < np.nanmax(place):
            at += rng.exponential(mean_m / share)
            inside = (place > at) & (place < at + rng.exponential(mean_m)) & (classes >= 0.0)
            classes[inside] = (classes[inside] + rng.integers(1, 3)) % 3.0
        row = np.searchsorted(first, np.arange(len(log)), side="right") - 1
        return changed(log, image_class=classes[row])

    finding = diagnose(Camera(fps=20.0, wrong=0.0), seed, damage=streaky, spacing_m=spacing_m)
    assert finding.verdict is Verdict.NO_GAP, finding.unexplained


def test_a_late_camera_that_is_fast_for_a_while_does_not_hang():
    """Its few fast borders lie far beyond the many slow ones, but not beyond its delay."""
    finding = diagnose(Camera(delay_s=0.6), seed=1, speeds=(6.0, 6.0, 6.0, 6.0, 6.0, 25.0))
    assert finding.verdict is Verdict.IDENTIFIED, finding.unexplained
    assert finding.causes == ("camera_latency",)


@pytest.mark.parametrize("digits", [1, 2])
def test_rounded_or_saturated_confidence_is_no_repeated_result(digits):
    def rounded(log):
        sure = np.minimum(np.round(log.signals["image_confidence"], digits), 0.9)
        return changed(log, image_confidence=sure)

    assert diagnose(Camera(fps=40.0, roughness=0.05), 2, damage=rounded).verdict is Verdict.NO_GAP


@pytest.mark.parametrize(
    ("faults", "effect", "words"),
    beyond(
        1,
        [
            ({"offset": (0.2, 0.0, 0.0)}, "class_friction_offset", "explains mu_reference"),
            ({"blur_s": 0.03}, "motion_blur", "how the confidence depends on speed"),
            ({"dimmed": 0.4}, "exposure_shift", "how low the confidence is"),
        ],
    ),
)
def test_what_only_an_effect_that_is_left_out_explains_is_unknown(faults, effect, words):
    camera = replace(Camera(confidence=0.9), **faults)
    assert diagnose(camera, 4).causes == (effect,)
    finding = diagnose(camera, 4, exclude=(effect,))
    assert finding.verdict is Verdict.UNKNOWN
    assert effect not in finding.causes
    assert any(words in text for text in finding.unexplained), finding.unexplained
    assert diagnose(Camera(), 4, exclude=(effect,)).verdict is Verdict.NO_GAP


def test_a_reference_that_goes_with_speed_is_no_offset_of_the_classes():
    def with_speed(log):
        lower = 0.012 * (log.signals["vehicle_speed_m_s"] - 17.0)
        return changed(log, mu_reference=log.signals["mu_reference"] - lower)

    finding = diagnose(Camera(), 5, damage=with_speed, spacing_m=25.0)
    assert finding.verdict is Verdict.UNKNOWN
    assert any("mu_reference" in text for text in finding.unexplained)


def test_a_reference_that_is_filtered_is_no_gap():
    """A moving mean over 0.9 s: on short stretches it tells of the one before for most of the way."""

    def filtered(log):
        values = log.signals["mu_reference"]
        sums = np.cumsum(np.concatenate((np.full(90, values[0]), values)))
        return changed(log, mu_reference=(sums[90:] - sums[:-90]) / 90.0)

    finding = diagnose(Camera(), 6, damage=filtered, spacing_m=25.0)
    assert finding.verdict is Verdict.NO_GAP, (finding.causes, finding.unexplained)


def test_streaks_of_errors_longer_than_the_scatter_excuse_it():
    """A camera that errs for some ten metres at a time, at borders as elsewhere; borders are passed once."""

    def streaky(log):
        rng = np.random.default_rng(len(log.name) + int(log.time_s[-1]))
        begin, classes = log.signals["image_from_m"], log.signals["image_class"].copy()
        for start in np.arange(20.0, np.nanmax(begin), 30.0) + rng.uniform(0.0, 15.0):
            inside = (begin > start) & (begin < start + rng.uniform(6.0, 14.0)) & (classes >= 0.0)
            classes[inside] = (classes[inside] + 1.0) % 3.0
        return changed(log, image_class=classes)

    finding = diagnose(Camera(fps=20.0, wrong=0.0), 7, damage=streaky, spacing_m=60.0)
    assert not any("away from road.yaml's borders" in text for text in finding.unexplained)


@pytest.mark.parametrize(("speeds", "creeps"), [((10.0, 25.0, 10.0, 25.0), True), ((10.0, 25.0), False)])
def test_a_confidence_that_falls_over_every_log_is_no_effect_of_the_library(speeds, creeps):
    """But one that falls as the car gets faster over the log is blur."""

    def fogging(log):
        share = log.time_s / log.time_s[-1]
        return changed(log, image_confidence=log.signals["image_confidence"] * np.exp(-0.4 * share))

    if not creeps:
        assert diagnose(Camera(blur_s=0.05), 8, speeds=speeds).causes == ("motion_blur",)
        return
    finding = diagnose(Camera(roughness=0.03), 8, speeds=speeds, damage=fogging)
    assert finding.verdict is Verdict.UNKNOWN
    assert any("falls over every log" in text for text in finding.unexplained), finding.unexplained


def blocks_of(classes, loss) -> Blocks:
    """Seconds of one log at one speed."""
    count = len(classes)
    steady = np.full(count, 15.0)
    names = np.full(count, "a.csv")
    return Blocks(names, np.arange(count) * 1.0, steady, 0.0 * steady, np.array(loss), np.array(classes))


def test_a_class_that_the_fit_logs_hardly_have_sets_its_own_level():
    learnt = blocks_of([0] * 10 + [1], [0.1] * 10 + [0.6])
    seen = blocks_of([0] * 5 + [1] * 5, [0.1] * 5 + [0.25] * 5)
    plain = ConfidenceFit((), 0.0, 0.0, 0.0, Interval(0.0, 0.0, 0.0), Interval(0.0, 0.0, 0.0))
    z = rest_of(seen, learnt, plain, ConfidenceModel(0.03, 1.0))
    assert z == pytest.approx(np.zeros(10), abs=1e-9)
    lower = rest_of(blocks_of([0] * 5, [0.25] * 5), learnt, plain, ConfidenceModel(0.03, 1.0))
    assert lower == pytest.approx(np.full(5, 5.0))


def test_what_the_hold_out_does_not_show_is_no_blur():
    """4 ms, which the fit logs alone would call blur."""
    roads = [road(seed=50 + i) for i in range(3)]
    cameras = (Camera(blur_s=0.004), Camera(blur_s=0.004), Camera())
    logs = [drive(r, c, seed=50 + i) for i, (r, c) in enumerate(zip(roads, cameras, strict=True))]
    assert diagnose_perception(logs[:2], logs[2], roads, BARE).verdict is Verdict.NO_GAP


@pytest.mark.parametrize(
    ("before", "left", "signal", "explained"),
    [
        (8.0, 2.6, "image_confidence", True),  # an eighth of the square
        (5.0, 2.6, "image_confidence", False),
        (20.0, 3.2, "image_confidence", False),
        (3.0, 2.4, "image_confidence", True),
        (3.0, 1.6, "mu_reference", False),
        (8.0, 1.6, "mu_reference", True),
    ],
)
def test_an_effect_may_leave_an_eighth_of_what_there_was(before, left, signal, explained):
    nothing, blamed = (
        Account(effects, 1, 0.0, 0.0, 0.0, {}, np.full(20, size))
        for effects, size in (((), before), (("motion_blur",), left))
    )
    chain = Chain(signal, 100, 20.0, nothing, (blamed,))
    assert (_unexplained(chain, blamed) is None) is explained
    assert _unexplained(chain, nothing)


def test_a_change_of_confidence_by_less_than_a_tenth_is_none():
    steady = Account((), 0, 0.0, 0.0, 0.0, {}, np.full(20, 4.0))
    assert _unexplained(Chain("image_confidence", 100, 20.0, steady, ()), steady)
    assert not _unexplained(Chain("image_confidence", 100, 20.0, steady, (), noticed=0.1 / 0.02), steady)


@pytest.mark.parametrize(("dimmed", "verdict"), [(1.0, Verdict.UNKNOWN), (0.55, Verdict.IDENTIFIED)])
def test_a_surface_that_a_sure_camera_takes_for_another_is_no_exposure(dimmed, verdict):
    """Snow is called wet in three of five results; bad pictures would make the camera less sure, too."""

    def slush(log):
        rng = np.random.default_rng(len(log))
        classes, ids = log.signals["image_class"].copy(), log.signals["frame_id"]
        mistaken = np.isin(ids, rng.permutation(np.unique(ids))[: int(0.6 * len(np.unique(ids)))])
        classes[(classes == 2.0) & mistaken] = 1.0
        return changed(log, image_class=classes)

    finding = diagnose(Camera(dimmed=dimmed), damage=slush)
    assert finding.verdict is verdict, finding.unexplained
    if verdict is Verdict.UNKNOWN:
        assert "road.yaml has snow" in finding.unexplained[0]
        assert "exposure_shift" not in finding.causes
    else:
        assert finding.causes == ("exposure_shift",)
