"""Gaps of the camera chain that have a law of their own, which no effect of the library has, and their near misses."""

from __future__ import annotations

import numpy as np
import pytest
from camera_drives import BARE, Camera, changed, diagnose, drive, road
from long import beyond

from sim2real.perception.crossings import Crossings
from sim2real.perception.diagnose import camera_shrink, diagnose_perception
from sim2real.perception.drifting import find_drift
from sim2real.perception.late_reference import DEAD_TIMES_S, FILTERS_S, Course, _left
from sim2real.perception.likelihood import likeliest
from sim2real.result import Verdict

UP_AND_DOWN = (12.0, 22.0, 12.0, 22.0, 12.0)
QUIET = Camera(roughness=0.02)


def says(finding, words: str) -> bool:
    return finding.verdict is Verdict.UNKNOWN and any(words in text for text in finding.unexplained)


def told_by(share: float):
    """An odometer that counts so much too far from the log's begin on; stamps are in its coordinate."""

    def damage(log):
        begin = log.signals["position_m"][0]
        return changed(
            log,
            **{
                name: log.signals[name] + share * (log.signals[name] - begin)
                for name in ("position_m", "image_from_m", "image_to_m")
            },
        )

    return damage


@pytest.mark.parametrize("share", [0.012, -0.008])
def test_an_odometer_with_a_wrong_scale_is_named(share):
    finding = diagnose(Camera(), 3, speeds=UP_AND_DOWN, damage=told_by(share))
    assert says(finding, "whether the scale of position_m is wrong"), finding.unexplained
    assert any(f"{share:+.1%}"[:4] in text for text in finding.unexplained), finding.unexplained
    assert finding.odd[0].signal == "image_place"
    assert finding.odd[0].sign == ("later" if share > 0.0 else "earlier")
    assert finding.before.signals["image_place"] > 3.0


def test_a_clock_that_runs_away_is_named():
    def damage(log):
        late_m = 0.006 * log.time_s * log.signals["vehicle_speed_m_s"]
        return changed(log, **{n: log.signals[n] + late_m for n in ("image_from_m", "image_to_m")})

    finding = diagnose(Camera(), 3, speeds=UP_AND_DOWN, damage=damage)
    assert says(finding, "whether the clocks of camera and logger"), finding.unexplained


def test_stamps_that_are_carried_on_at_the_last_speed_are_named():
    """From a second before: they miss what the car has gained or lost meanwhile."""

    def damage(log):
        speed, position = log.signals["vehicle_speed_m_s"], log.signals["position_m"]
        before = np.maximum(log.time_s - 1.0, 0.0)
        carried = np.interp(before, log.time_s, position) + np.interp(before, log.time_s, speed) * 1.0
        off = np.where(log.time_s > 1.0, carried - position, 0.0)
        return changed(log, **{n: log.signals[n] + off for n in ("image_from_m", "image_to_m")})

    speeds = (12.0, 12.0, 25.0, 25.0, 12.0, 20.0, 20.0, 10.0)
    finding = diagnose(Camera(), 3, speeds=speeds, damage=damage, spacing_m=25.0)
    assert says(finding, "extrapolated with the last speed"), finding.unexplained
    assert any("-0.5" in text or "-0.4" in text for text in finding.unexplained), finding.unexplained


@pytest.mark.parametrize("faults", [{"delay_s": 0.15}, {"distance_m": 1.5}])
def test_a_steady_delay_or_angle_does_not_grow(faults):
    finding = diagnose(Camera(**faults), 4, speeds=UP_AND_DOWN)
    assert finding.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS), finding.unexplained


def crossings(count: int, shift_m: np.ndarray) -> Crossings:
    """Of one log at steady speed, a border every 30 m, each within 5 cm of the shift that is given."""
    border = 30.0 * np.arange(1.0, count + 1.0)
    numbers = {name: np.zeros(count) for name in ("low_length_m", "high_length_m")}
    return Crossings(
        log=np.full(count, "a"),
        time_s=border / 15.0,
        speed_m_s=np.full(count, 15.0),
        border_m=border,
        accel_m_s2=np.zeros(count),
        since_s=border / 15.0,
        since_m=border,
        low_m=shift_m - 0.05,
        high_m=shift_m + 0.05,
        way_m=np.zeros((count, 201)),
        ahead_m=np.full(count, 3.0),
        **numbers,
    )


def test_the_rate_of_a_growing_shift_is_found():
    known, unseen = (crossings(n, 0.01 * 30.0 * np.arange(1.0, n + 1.0)) for n in (20, 12))
    plain = float(likeliest(known.joined(unseen), np.zeros(32), shifted=False))
    found = find_drift(known, unseen, plain, 0.0)
    assert found is not None
    assert "+1.0% of the distance" in found.odd.sentence
    assert (found.odd.depends_on, found.odd.sign) == ("distance since the start of the log", "later")
    assert found.scale == 1.0


def test_a_library_effect_that_takes_most_of_it_stands():
    known, unseen = (crossings(n, 0.01 * 30.0 * np.arange(1.0, n + 1.0)) for n in (20, 12))
    plain = float(likeliest(known.joined(unseen), np.zeros(32), shifted=False))
    assert not find_drift(known, unseen, plain, 1000.0)


def test_few_borders_or_a_slight_growth_are_no_drift():
    plain = -1000.0
    assert not find_drift(crossings(5, np.arange(5.0)), crossings(5, np.arange(5.0)), plain, 0.0)
    slight = [crossings(n, 5e-4 * 30.0 * np.arange(1.0, n + 1.0)) for n in (20, 12)]
    assert not find_drift(*slight, plain, 0.0)


def test_a_camera_that_shakes_when_the_car_brakes_or_pulls():
    def damage(log):
        accel = np.gradient(log.signals["vehicle_speed_m_s"], log.time_s)
        smooth = np.convolve(np.abs(accel), np.ones(50) / 50.0, mode="same")
        return changed(log, image_confidence=log.signals["image_confidence"] * np.exp(-0.25 * smooth))

    speeds = (12.0, 12.0, 25.0, 25.0, 12.0, 12.0, 20.0, 20.0)
    finding = diagnose(QUIET, 5, speeds=speeds, damage=damage)
    assert says(finding, "falls with acceleration"), finding.unexplained
    assert diagnose(QUIET, 5, speeds=speeds).verdict is Verdict.NO_GAP


def test_a_camera_that_is_unsure_when_the_car_is_slow():
    def damage(log):
        speed = log.signals["vehicle_speed_m_s"]
        return changed(log, image_confidence=log.signals["image_confidence"] * np.exp(-0.03 * (25.0 - speed)))

    finding = diagnose(QUIET, 9, speeds=UP_AND_DOWN, damage=damage)
    assert says(finding, "the reverse of blur"), finding.unexplained


@pytest.mark.parametrize(("factor", "shunned"), [(0.6, True), (0.85, False)])
def test_a_camera_that_is_dazzled_on_one_class(factor, shunned):
    def damage(log):
        on_wet = log.signals["image_class"] == 1.0
        return changed(log, image_confidence=np.where(on_wet, factor, 1.0) * log.signals["image_confidence"])

    finding = diagnose(QUIET, 6, speeds=UP_AND_DOWN, damage=damage)
    assert says(finding, "on wet and") is shunned, finding.unexplained


def test_a_low_confidence_scatters_more_by_its_logarithm_and_is_not_restless():
    """Blur at speed: the same steps of the last digit are larger shares of what is left."""

    def damage(log):
        seconds = np.floor(log.time_s).astype(int) % 97
        off = 0.07 * np.random.default_rng(1).standard_normal(97)[seconds]
        return changed(log, image_confidence=np.clip(log.signals["image_confidence"] + off, 0.02, 1.0))

    finding = diagnose(Camera(blur_s=0.2), 7, speeds=UP_AND_DOWN, damage=damage)
    assert finding.causes == ("motion_blur",)
    assert finding.verdict is Verdict.IDENTIFIED, finding.unexplained


@pytest.mark.parametrize("spared", [2.0, 1.0])
def test_pictures_too_light_or_too_dark_spare_the_class_that_looks_so_anyhow(spared):
    """Snow stays white, wet asphalt stays dark; most of the rest is taken for it, and unsure of."""

    def damage(log):
        true, number = log.signals["image_class"], np.nan_to_num(log.signals["frame_id"]).astype(int) % 997
        flips = np.random.default_rng(3).random(997)[number] < 0.6
        poor = true != spared
        return changed(
            log,
            image_class=np.where(poor & flips, spared, true),
            image_confidence=np.where(poor, 0.42, 0.9) * log.signals["image_confidence"] / 0.9,
        )

    finding = diagnose(QUIET, 6, speeds=UP_AND_DOWN, damage=damage)
    assert finding.unexplained == ()
    assert finding.causes == ("exposure_shift",)


def late(by_s: float):
    def damage(log):
        then = np.interp(log.time_s - by_s, log.time_s, np.arange(len(log.time_s)))
        return changed(log, mu_reference=log.signals["mu_reference"][np.round(then).astype(int)])

    return damage


@pytest.mark.parametrize(("by_s", "is_late"), [(0.7, True), (0.2, False)])
def test_a_reference_that_follows_the_road_late(by_s, is_late):
    finding = diagnose(Camera(), 8, damage=late(by_s))
    assert says(finding, "mu_reference follows the road 0.7 s late") is is_late, finding.unexplained


@pytest.mark.parametrize(("dead_s", "lag_s"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (0.6, 0.2)])
def test_dead_time_and_filter_are_told_apart(dead_s, lag_s):
    """A reference that scipy's own step response makes; each is best explained by what made it."""
    step = 0.02
    clock = np.arange(0.0, 40.0, step)
    kind = (clock // 4.0).astype(int) % 3
    levels = np.array([0.8, 0.6, 0.2])
    course = levels[kind[np.maximum(np.arange(len(clock)) - round(dead_s / step), 0)]]
    if lag_s:
        kernel = np.exp(-clock / lag_s)
        padded = np.concatenate((np.full(len(clock), course[0]), course))
        course = np.convolve(padded, kernel / kernel.sum())[len(clock) : 2 * len(clock)]
    found = Course(course, np.eye(3)[kind])
    left = {(d, f): _left([found], d, f) for d in DEAD_TIMES_S for f in FILTERS_S}
    assert min(left, key=lambda key: left[key]) == pytest.approx((dead_s, lag_s))


@pytest.mark.parametrize(
    ("camera", "added"),
    beyond(
        1,
        [
            (Camera(delay_s=0.2), {"camera_latency": {"delay_s": 0.2}}),
            (Camera(blur_s=0.1), {"motion_blur": {"exposure_s": 0.1}}),
            (
                Camera(offset=(0.0, 0.15, 0.0)),
                {"class_friction_offset": {"dry": 0.8, "wet": 0.75, "snow_ice": 0.2}},
            ),
        ],
    ),
)
def test_an_effect_in_the_vehicle_file_takes_the_gap_off_a_further_log(camera, added):
    """As far as the floor; the wrong one by as much takes nothing off, and a log without a gap has none to take."""
    track = road(seed=21)
    log, quiet = (drive(track, one, speeds=UP_AND_DOWN, seed=21) for one in (camera, Camera()))
    left = diagnose_perception([log], log, [track, track], BARE).before.total
    assert camera_shrink(log, track, BARE, added) == pytest.approx(100.0 * (1.0 - 1.0 / left), abs=6.0)
    assert left > 1.5
    assert camera_shrink(log, track, BARE, {"camera_pitch": {"pitch_rad": -0.1}}) < 5.0
    assert camera_shrink(quiet, track, BARE, added) < 0.0


def test_without_a_camera_there_is_no_shrink():
    track = road(seed=21)
    bare = changed(drive(track, reference=None), image_class=None, image_from_m=None, image_to_m=None)
    assert np.isnan(camera_shrink(bare, track, BARE, {"camera_latency": {"delay_s": 0.2}}))
