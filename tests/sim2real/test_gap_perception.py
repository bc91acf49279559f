"""The camera's part of the diagnosis as a whole: no alarm without a gap, several faults at once, the plant."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from camera_drives import (
    BARE,
    BLIND,
    CLASS_FRICTION,
    SLOW_AND_FAST,
    SPEEDS,
    Camera,
    any_camera,
    candidate,
    car_with,
    changed,
    diagnose,
    drive,
    log_of,
    road,
)
from long import beyond

from scenarios.perception import perceive
from scenarios.plant.pipeline import simulate
from scenarios.plant.sensors import make_log
from sim2real.auxiliary import UNKNOWN_BELIEF, camera_verdict
from sim2real.perception.diagnose import diagnose_perception
from sim2real.result import Verdict


@pytest.mark.parametrize("drives", beyond(1, [12, 60]))
def test_no_gap_raises_no_alarm_in_many_drives(drives):
    alarms = []
    for seed in range(drives):
        finding = diagnose(
            any_camera(seed),
            seed,
            spacing_m=(20.0, 40.0, 80.0)[seed % 3],
            speeds=SPEEDS[seed % 5],
            duration_s=20.0,
            reference=("class", "road", "peak", None)[seed % 4],
            mu=(CLASS_FRICTION, (0.9, 0.5, 0.3))[seed % 4 == 0],
        )
        if finding.verdict is not Verdict.NO_GAP:
            alarms.append((seed, finding.verdict, finding.causes, finding.unexplained))
        else:
            assert finding.causes == finding.ambiguous_with == ()
            assert finding.after == finding.before
    assert len(alarms) <= drives / 60, alarms


def test_pictures_that_fall_alike_on_every_border_are_no_shift():
    """Borders every 40 m at 20 m/s and 10 pictures a second: all crossings show the same phase."""
    even = road()
    segments = [s.model_copy(update={"start_m": 40.0 * i}) for i, s in enumerate(even.segments)]
    even = even.model_copy(update={"segments": segments})
    for seed in range(6):
        camera = Camera(fps=10.0, flicker_m=0.0, share=(0.0, 0.5)[seed % 2])
        logs = [drive(even, camera, speeds=(20.0, 20.0), seed=10 * seed + i) for i in range(3)]
        assert diagnose_perception(logs[:2], logs[2], [even] * 3, BARE).verdict is Verdict.NO_GAP


def test_without_perception_columns_or_reference_nothing_is_said():
    bare = [changed(drive(road(), reference=None), **BLIND) for _ in range(2)]
    assert diagnose_perception(bare[:1], bare[1], [road()] * 2, BARE) is None


def test_faults_of_several_signals_are_a_compound():
    finding = diagnose(Camera(delay_s=0.15, blur_s=0.03, offset=(-0.2, 0.0, 0.0)))
    assert finding.verdict is Verdict.COMPOUND
    assert set(finding.causes) == {"camera_latency", "motion_blur", "class_friction_offset"}
    every = candidate(finding, *finding.causes)
    assert every.after.total == pytest.approx(finding.after.total)
    assert every.after.total < 1.3 < finding.before.total
    assert every.score == pytest.approx(sum(candidate(finding, e).score for e in finding.causes))
    assert {p.signal for p in finding.places} == {"image_place", "image_confidence", "mu_reference"}
    assert all(0.0 < p.share <= 1.0 and p.to_s > p.from_s for p in finding.places)


@pytest.mark.parametrize(
    ("faults", "effect"),
    beyond(
        2,
        [
            ({"distance_m": 1.0}, "camera_pitch"),
            ({"dimmed": 0.4}, "exposure_shift"),
            ({"delay_s": 0.15}, "camera_latency"),
            ({"blur_s": 0.04}, "motion_blur"),
            ({"offset": (0.0, -0.2, 0.0)}, "class_friction_offset"),
        ],
    ),
)
def test_an_excluded_effect_is_never_named(faults, effect):
    roads = [road(seed=i) for i in range(3)]
    logs = [drive(r, Camera(**faults), seed=i) for i, r in enumerate(roads)]
    finding = diagnose_perception(logs[:2], logs[2], roads, BARE, exclude=(effect,))
    assert effect not in finding.causes
    assert all(effect not in c.effects for c in finding.candidates)
    assert finding.verdict is not Verdict.NO_GAP


def test_the_same_seed_gives_the_same_finding():
    assert diagnose(Camera(delay_s=0.1)) == diagnose(Camera(delay_s=0.1))


def test_numbers_go_to_json():
    finding = diagnose(Camera(delay_s=0.1, blur_s=0.02))
    for c in finding.candidates:
        json.dumps({name: value.to_json() for name, value in c.parameters.items()})


def test_an_unknown_finding_does_not_believe_in_its_best_effect():
    blamed = diagnose(Camera(delay_s=0.25), speeds=SLOW_AND_FAST)
    unknown = diagnose(Camera(delay_s=0.25), exclude=("camera_latency",), speeds=SLOW_AND_FAST)
    assert unknown.verdict is Verdict.UNKNOWN
    assert sum(c.probability for c in camera_verdict(unknown).causes) <= UNKNOWN_BELIEF + 1e-9
    assert camera_verdict(blamed).causes[0].probability > 0.8


def test_a_blamed_effect_is_told_with_its_values_and_what_it_does():
    told = camera_verdict(diagnose(Camera(delay_s=0.25), speeds=SLOW_AND_FAST)).sentence
    assert re.match(
        r"with delay_s 0\.2\d+ s the camera's gap decreases from \d+\.\d to 1\.\d times the noise floor\.",
        told,
    )
    assert camera_verdict(diagnose(Camera(), speeds=SLOW_AND_FAST)).sentence == ""


def plant_log(road_file, seed, **effects):
    rng = np.random.default_rng([seed, 3])
    time = np.arange(4001) / 100.0
    torque = np.interp(
        time, np.arange(0.0, 44.0, 4.0), np.where(np.arange(11) % 3, rng.uniform(-60, 110, 11), 90.0)
    )
    trajectory = simulate(BARE, road_file, np.repeat(torque[:, None], 4, axis=1), 0.01, 8.0)
    columns = perceive(trajectory, road_file, car_with(**effects), fps=20.0, seed=seed)
    table = make_log(trajectory, BARE)
    signals = {name: table[name].to_numpy() for name in ("vehicle_speed_m_s", "position_m", "mu_reference")}
    return log_of(trajectory.time_s, {**signals, **columns}, f"plant{seed}.csv")


@pytest.mark.parametrize(
    ("effect", "values"),
    beyond(
        3,
        [
            ("camera_pitch", {"pitch_rad": 0.2}),
            ("exposure_shift", {"stops": 3.5}),
            ("class_friction_offset", {"dry": 0.7, "wet": 0.6, "snow_ice": 0.35}),
            ("camera_latency", {"delay_s": 0.08}),
            ("motion_blur", {"exposure_s": 0.03}),
            (None, {}),
        ],
    ),
)
def test_each_effect_of_the_plant_is_found_in_its_logs(effect, values):
    for seed in range(2):
        roads = [road(seed=3 * seed + i) for i in range(3)]
        effects = {effect: values} if effect else {}
        logs = [plant_log(r, 10 * seed + i, **effects) for i, r in enumerate(roads)]
        finding = diagnose_perception(logs[:2], logs[2], roads, BARE)
        assert finding.causes == ((effect,) if effect else ())
        if effect:
            assert finding.verdict is Verdict.IDENTIFIED
            for name, truth in values.items():
                estimate = candidate(finding, effect).parameters[name]
                assert estimate.low <= truth <= estimate.high
