"""Where the camera puts the changes of class: late, tilted, or at odds with road.yaml."""

from __future__ import annotations

import numpy as np
import pytest
from camera_drives import (
    BARE,
    BLIND,
    FRONT_M,
    SLOW_AND_FAST,
    SPEEDS,
    Camera,
    any_camera,
    candidate,
    car_with,
    changed,
    diagnose,
    drive,
    road,
)
from long import beyond

from sim2real.perception.diagnose import diagnose_perception
from sim2real.perception.frames import of_one_camera, read_results
from sim2real.result import Verdict
from trpac_core.vision.camera import Camera as Lens


@pytest.mark.parametrize("share", beyond(1, [0.0, 0.5]))
@pytest.mark.parametrize(
    ("effect", "faults"), [("camera_latency", {"delay_s": 0.04}), ("camera_pitch", {"distance_m": 0.5})]
)
def test_delay_and_angle_are_told_apart_by_five_crossings_each_at_two_speeds(effect, faults, share):
    for seed in range(5):
        roads = [road(20.0, seed=3 * seed + i) for i in range(2)]
        camera = Camera(share=share, **faults)
        logs = [drive(r, camera, SLOW_AND_FAST, 18.0, seed=10 * seed + i) for i, r in enumerate(roads)]
        finding = diagnose_perception(logs[:1], logs[1], roads, BARE)
        assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, (effect,)), seed
        assert candidate(finding, effect).effective <= 28


@pytest.mark.parametrize("faults", beyond(1, [{"delay_s": 0.04}, {"distance_m": 0.5}]))
def test_at_one_speed_delay_and_angle_are_ambiguous(faults):
    for seed in range(4):
        finding = diagnose(Camera(**faults), seed, speeds=(15.0, 15.0))
        assert finding.verdict is Verdict.AMBIGUOUS
        assert [set(group) for group in finding.ambiguous_with] == [{"camera_latency", "camera_pitch"}]
        assert "10 and 25 m/s" in finding.next_step


@pytest.mark.long
def test_latency_is_found_with_its_delay_over_severities_and_cameras():
    inside, errors, found, shrinks = [], [], [], []
    for seed in range(20):
        delay = (0.06, 0.1, 0.15, 0.3, 0.6)[seed % 5]
        camera = any_camera(seed, delay_s=delay, fps=(20.0, 40.0)[seed % 2])
        finding = diagnose(camera, seed, speeds=SPEEDS[(0, 1, 4)[seed % 3]])
        found.append(finding.causes == ("camera_latency",))
        estimate = candidate(finding, "camera_latency").parameters["delay_s"]
        inside.append(estimate.low <= delay <= estimate.high)
        errors.append(abs(estimate.value - delay) * camera.fps)
        shrinks.append(candidate(finding, "camera_latency").shrink_percent.value)
    assert np.mean(found) >= 0.9
    assert np.mean(inside) >= 0.9
    assert np.median(shrinks) > 50.0
    assert max(errors) < 1.0  # frame intervals: half a stamp is not known


@pytest.mark.long
def test_pitch_is_found_with_its_angle():
    """The distance that stamps shift by, at a near end 2.9 m ahead of a lens 1.4 m high."""
    inside, found = [], []
    for seed in range(18):
        pitch = (-0.12, -0.07, 0.08, 0.12, 0.2, 0.25)[seed % 6]
        distance = 2.9 - 1.4 / np.tan(np.arctan(1.4 / 2.9) + pitch)
        camera = any_camera(seed, distance_m=distance, fps=40.0, share=0.5)
        finding = diagnose(camera, seed, speeds=SPEEDS[(0, 1, 4)[seed % 3]], lens=Lens())
        found.append(finding.causes == ("camera_pitch",))
        estimate = candidate(finding, "camera_pitch").parameters["pitch_rad"]
        inside.append(estimate.low <= pitch <= estimate.high)
        assert estimate.value == pytest.approx(pitch, abs=0.05)
    assert np.mean(found) >= 0.9
    assert np.mean(inside) >= 0.9


def test_a_delay_within_long_stamps_shows_by_going_with_speed():
    """As simulated a class is right anywhere in its stretch, which a distance may come of, and a delay may not."""
    late = diagnose(Camera(stamp_m=8.0, delay_s=0.15), 3, speeds=SPEEDS[0])
    assert late.causes == ("camera_latency",)
    estimate = candidate(late, "camera_latency").parameters["delay_s"]
    assert estimate.low <= 0.15 <= estimate.high
    for share in (0.1, 0.9):
        assert diagnose(Camera(stamp_m=8.0, share=share), 3, speeds=SPEEDS[0]).verdict is Verdict.NO_GAP


def test_an_angle_holds_other_places_of_the_lens_where_nobody_says_where_it_is():
    """The same distance, seen from a lens 1.25 m high at the centre of gravity: another angle."""
    ahead_m, height_m = 3.5 + FRONT_M, 1.25
    for pitch in (-0.06, 0.06):
        distance = ahead_m - height_m / np.tan(np.arctan(height_m / ahead_m) + pitch)
        camera = Camera(distance_m=distance, preview_m=ahead_m)
        untold, told = (diagnose(camera, 5, lens=lens) for lens in (None, Lens()))
        assert untold.causes == told.causes == ("camera_pitch",)
        wide, narrow = (candidate(f, "camera_pitch").parameters["pitch_rad"] for f in (untold, told))
        assert wide.low <= pitch <= wide.high
        assert not narrow.low <= pitch <= narrow.high
        assert wide.value == narrow.value
        assert wide.low * wide.high > 0.0


@pytest.mark.parametrize("arrives_s", [0.0, 0.15])
def test_results_that_arrive_late_with_the_right_stamp_leave_the_angle_alone(arrives_s):
    """The car has come nearer to the stamp by then; the angle is one at the distance when the picture was taken."""

    def late(log):
        then = np.round(np.interp(log.time_s - arrives_s, log.time_s, np.arange(len(log.time_s)))).astype(int)
        names = ("frame_id", "image_class", "image_confidence", "image_from_m", "image_to_m")
        return changed(log, **{name: log.signals[name][then] for name in names})

    ahead_m, pitch = 8.0, 0.05
    distance = ahead_m - 1.4 / np.tan(np.arctan(1.4 / ahead_m) + pitch)
    camera = Camera(distance_m=distance, preview_m=ahead_m + FRONT_M - 0.4)
    finding = diagnose(camera, 3, damage=late, lens=Lens())
    assert finding.causes == ("camera_pitch",)
    estimate = candidate(finding, "camera_pitch").parameters["pitch_rad"]
    assert estimate.low <= pitch <= estimate.high
    assert estimate.value == pytest.approx(pitch, abs=0.006)
    assert diagnose(Camera(preview_m=ahead_m), 3, damage=late).verdict is Verdict.NO_GAP


def nearly_one_speed_each(ahead_m, arrives_s):
    """Roads and logs of a camera whose results arrive late and whose stamps, 0.5 m long, scatter by 1 m."""
    camera = Camera(preview_m=ahead_m + FRONT_M - 0.4, fps=10.0, stamp_m=0.5)
    roads, logs = [], []
    for number, speeds in enumerate([(14.0, 18.0), (18.0, 22.0), (22.0, 26.0)]):
        roads.append(road(seed=number))
        log = drive(roads[-1], camera, speeds, seed=number)
        then = np.round(np.interp(log.time_s - arrives_s, log.time_s, np.arange(len(log.time_s)))).astype(int)
        off = np.random.default_rng(number).standard_normal(1000)
        result = np.nan_to_num(log.signals["frame_id"][then]).astype(int)
        late = {name: log.signals[name][then] for name in BLIND}
        late |= {name: late[name] + off[result] for name in ("image_from_m", "image_to_m")}
        logs.append(changed(log, **late))
    return roads, logs


def test_logs_driven_at_nearly_one_speed_each_tell_together_how_far_the_camera_looks():
    """A log's own distance is off by up to a metre, and an angle's shift with it, which then looks like a delay."""
    roads, logs = nearly_one_speed_each(ahead_m=9.0, arrives_s=0.1)
    read = [read_results(log, r, BARE, Lens())[0] for log, r in zip(logs, roads, strict=True)]
    alone = [of_one_camera([one])[0][0] for one in read]
    assert np.ptp([one.ahead_m for one in alone]) > 0.8
    alike, odd = of_one_camera(read)
    assert [one.ahead_m for one in alike] == pytest.approx([9.25] * 3, abs=0.35)
    assert odd == ()


def test_a_delay_and_an_angle_together_are_a_compound():
    for seed in range(4):
        finding = diagnose(Camera(delay_s=0.1, distance_m=-0.9), seed)
        assert finding.verdict is Verdict.COMPOUND
        assert set(finding.causes) == {"camera_latency", "camera_pitch"}
        both = candidate(finding, "camera_latency", "camera_pitch").parameters
        assert both["delay_s"].low <= 0.1 <= both["delay_s"].high
        assert both["delay_s"].value == pytest.approx(0.1, abs=0.03)


def test_a_delay_that_the_simulation_models_already_is_no_gap():
    modelled = car_with(camera_latency={"delay_s": 0.2})
    assert diagnose(Camera(delay_s=0.2), vehicle=modelled).verdict is Verdict.NO_GAP
    finding = diagnose(Camera(delay_s=0.3), vehicle=modelled)
    assert finding.causes == ("camera_latency",)
    assert candidate(finding, "camera_latency").parameters["delay_s"].value == pytest.approx(0.3, abs=0.02)


def test_no_border_passed_is_said():
    finding = diagnose(Camera(delay_s=0.2), spacing_m=5000.0)
    assert finding.verdict is Verdict.NO_GAP
    assert {"camera_latency", "camera_pitch"} <= set(finding.cannot_rule_out)
    assert "no border" in finding.cannot_rule_out["camera_latency"]


def test_borders_in_other_places_than_road_yaml_are_unknown():
    roads = [road(seed=i) for i in range(3)]
    logs = [drive(r, Camera(), seed=i) for i, r in enumerate(roads)]
    rng = np.random.default_rng(0)
    moved = [
        r.model_copy(
            update={
                "segments": [
                    s.model_copy(update={"start_m": s.start_m + 4.0 * (i > 0) * rng.uniform(-1.0, 1.0)})
                    for i, s in enumerate(r.segments)
                ]
            }
        )
        for r in roads
    ]
    finding = diagnose_perception(logs[:2], logs[2], moved, BARE)
    assert finding.verdict is Verdict.UNKNOWN
    assert "away from road.yaml's borders" in finding.unexplained[0]


def moved(road_file, by_m, seed):
    rng = np.random.default_rng(seed)
    segments = [
        s.model_copy(update={"start_m": s.start_m + by_m * (i > 0) * rng.uniform(-1.0, 1.0)})
        for i, s in enumerate(road_file.segments)
    ]
    return road_file.model_copy(update={"segments": segments})


@pytest.mark.parametrize("seed", beyond(1, range(4)))
def test_a_careless_chains_scatter_is_no_gap(seed):
    finding = diagnose(Camera(fps=12.0, flicker_m=1.5, wrong=0.08), seed, duration_s=60.0)
    assert finding.verdict is Verdict.NO_GAP, finding.unexplained


def test_borders_that_lie_elsewhere_are_so_each_time():
    same = road(seed=3)
    logs = [drive(same, Camera(), seed=i, duration_s=60.0) for i in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [moved(same, 2.5, 1)] * 3, BARE)
    assert finding.verdict is Verdict.UNKNOWN
    assert "equal each time that a border is passed" in finding.unexplained[0]


def test_a_position_that_drifts_puts_neighbouring_borders_off_alike():
    def drifting(log):
        drift_m = 2.5 * np.sin(2.0 * np.pi * log.time_s / 20.0)
        names = ("position_m", "image_from_m", "image_to_m")
        return changed(log, **{name: log.signals[name] + drift_m for name in names})

    finding = diagnose(Camera(), 1, damage=drifting, duration_s=60.0, reference=None)
    assert finding.verdict is Verdict.UNKNOWN
    assert "similar at neighbouring borders" in finding.unexplained[0]


def test_classes_that_keep_contradicting_road_yaml_are_a_gap_and_one_that_does_is_a_warning():
    def confused(most):
        def damage(log):
            classes = log.signals["image_class"]
            far = (log.signals["image_from_m"] > 100.0) & (log.signals["image_from_m"] < most)
            return changed(log, image_class=np.where(far & (classes == 1.0), 0.0, classes))

        return damage

    finding = diagnose(Camera(wrong=0.0), 2, damage=confused(500.0))
    assert finding.verdict is Verdict.UNKNOWN
    assert any("reports another class than road.yaml" in text for text in finding.unexplained)
    one = diagnose(Camera(wrong=0.0), 2, damage=confused(170.0))
    assert one.verdict is Verdict.NO_GAP
    assert any("road.yaml has wet" in text for text in one.warnings)


@pytest.mark.parametrize(
    ("faults", "law"),
    [({"delay_s": 0.25}, "is proportional to speed"), ({"distance_m": 2.0}, "does not depend on speed")],
)
def test_a_twin_is_not_blamed_for_a_law_that_is_not_its_own(faults, law):
    true = {"delay_s": "camera_latency", "distance_m": "camera_pitch"}[next(iter(faults))]
    finding = diagnose(Camera(**faults), exclude=(true,), speeds=SLOW_AND_FAST)
    assert finding.verdict is Verdict.UNKNOWN
    assert all(true not in c.effects for c in finding.candidates)
    assert law in finding.unexplained[0]
