import json
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from camera_drives import CAR, CLASS_FRICTION, FRONT_M, NAMES, Camera, changed, drive, log_of, road

from scenarios.effects import make_effect
from scenarios.files import VehicleFile
from scenarios.perception import perceive
from scenarios.plant import make_log, simulate
from sim2real.merge import UNKNOWN_BELIEF, camera_side
from sim2real.perception.diagnose import diagnose_perception
from sim2real.result import Verdict

SLOW_AND_FAST = (10.0, 10.0, 10.0, 10.0, 25.0, 25.0)
SPEEDS = ((10.0, 25.0), (5.0, 15.0, 8.0, 20.0), (12.0, 12.0), (20.0, 8.0, 3.0, 14.0), (25.0, 10.0))


def car_with(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


BARE = car_with()


def diagnose(
    camera,
    seed=0,
    vehicle=BARE,
    spacing_m=40.0,
    mu=CLASS_FRICTION,
    damage=lambda log: log,
    exclude=(),
    **kw,
):
    roads = [road(spacing_m, seed=3 * seed + i, mu=mu) for i in range(3)]
    logs = [damage(drive(r, camera, seed=10 * seed + i, **kw)) for i, r in enumerate(roads)]
    return diagnose_perception(logs[:2], logs[2], roads, vehicle, exclude=exclude)


def candidate(finding, *effects):
    (found,) = [c for c in finding.candidates if set(c.effects) == set(effects)]
    return found


def any_camera(seed, **faults):
    """A camera chain like others: rate, mistakes, confidence, and what of a stamp its class is for."""
    rng = np.random.default_rng([seed, 99])
    plain = Camera(
        fps=float(rng.choice([8, 10, 20, 30, 40])),
        wrong=float(rng.uniform(0.0, 0.1)),
        share=float(rng.choice([0.0, 0.5, 1.0])),
        flicker_m=float(rng.choice([0.0, 0.05, 0.2])),
        confidence=float(rng.uniform(0.7, 0.98)),
        roughness=float(rng.uniform(0.0, 0.1)),
    )
    return replace(plain, **faults)


# no gap


def test_no_gap_raises_no_alarm_in_sixty_drives():
    alarms = []
    for seed in range(60):
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
    assert len(alarms) <= 1, alarms


def test_pictures_that_fall_alike_on_every_border_are_no_shift():
    """Borders every 40 m at 20 m/s and 10 pictures a second: all crossings show the same phase."""
    even = road()
    segments = [s.model_copy(update={"start_m": 40.0 * i}) for i, s in enumerate(even.segments)]
    even = even.model_copy(update={"segments": segments})
    for seed in range(6):
        camera = Camera(fps=10.0, flicker_m=0.0, share=(0.0, 0.5)[seed % 2])
        logs = [drive(even, camera, speeds=(20.0, 20.0), seed=10 * seed + i) for i in range(3)]
        assert diagnose_perception(logs[:2], logs[2], [even] * 3, BARE).verdict is Verdict.NO_GAP


@pytest.mark.parametrize("follows", ["road", "peak"])
def test_a_reference_that_follows_road_yaml_says_that_the_classes_values_are_wrong_for_it(follows):
    """The contract: with a camera the simulation predicts the class's value, whatever friction road.yaml has."""
    finding = diagnose(Camera(), reference=follows, mu=(0.9, 0.5, 0.3))
    assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
    estimate = candidate(finding, "class_friction_offset").parameters
    off = np.array([0.1, -0.1, 0.1]) + (0.04 * np.array([0.9, 0.5, 0.3]) if follows == "peak" else 0.0)
    assert [estimate[name].value for name in NAMES] == pytest.approx(off, abs=0.01)


def test_without_a_camera_a_reference_that_follows_road_yaml_is_no_gap_whatever_the_classes_say():
    for follows in ("road", "peak"):
        finding = diagnose(
            Camera(), reference=follows, mu=(0.9, 0.5, 0.3), damage=lambda log: changed(log, **BLIND)
        )
        assert finding.verdict is Verdict.NO_GAP
        assert candidate(finding, "class_friction_offset").score < 0.0


BLIND = dict.fromkeys(("frame_id", "image_class", "image_confidence", "image_from_m", "image_to_m"))


def test_without_perception_columns_or_reference_nothing_is_said():
    bare = [changed(drive(road(), reference=None), **BLIND) for _ in range(2)]
    assert diagnose_perception(bare[:1], bare[1], [road()] * 2, BARE) is None


# late or tilted


@pytest.mark.parametrize("share", [0.0, 0.5])
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


@pytest.mark.parametrize("faults", [{"delay_s": 0.04}, {"distance_m": 0.5}])
def test_at_one_speed_delay_and_angle_are_ambiguous(faults):
    for seed in range(4):
        finding = diagnose(Camera(**faults), seed, speeds=(15.0, 15.0))
        assert finding.verdict is Verdict.AMBIGUOUS
        assert [set(group) for group in finding.ambiguous_with] == [{"camera_latency", "camera_pitch"}]
        assert "10 and 25 m/s" in finding.next_step


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


def test_pitch_is_found_with_its_angle():
    """The distance that stamps shift by, at a near end 2.9 m ahead of a lens 1.4 m high."""
    inside, found = [], []
    for seed in range(18):
        pitch = (-0.12, -0.07, 0.08, 0.12, 0.2, 0.25)[seed % 6]
        distance = 2.9 - 1.4 / np.tan(np.arctan(1.4 / 2.9) + pitch)
        camera = any_camera(seed, distance_m=distance, fps=40.0, share=0.5)
        finding = diagnose(camera, seed, speeds=SPEEDS[(0, 1, 4)[seed % 3]])
        found.append(finding.causes == ("camera_pitch",))
        estimate = candidate(finding, "camera_pitch").parameters["pitch_rad"]
        inside.append(estimate.low <= pitch <= estimate.high)
        assert estimate.value == pytest.approx(pitch, abs=0.05)
    assert np.mean(found) >= 0.9
    assert np.mean(inside) >= 0.9


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
    finding = diagnose(camera, 3, damage=late)
    assert finding.causes == ("camera_pitch",)
    estimate = candidate(finding, "camera_pitch").parameters["pitch_rad"]
    assert estimate.low <= pitch <= estimate.high
    assert estimate.value == pytest.approx(pitch, abs=0.006)
    assert diagnose(Camera(preview_m=ahead_m), 3, damage=late).verdict is Verdict.NO_GAP


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
    assert "No border" in finding.cannot_rule_out["camera_latency"]


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
    assert "beside road.yaml's borders" in finding.unexplained[0]


# blurred or ill exposed


def test_blur_is_found_whatever_the_normal_confidence():
    for seed in range(12):
        exposure = (0.02, 0.03, 0.05)[seed % 3]
        camera = any_camera(seed, blur_s=exposure, confidence=(0.75, 0.98)[seed % 2])
        finding = diagnose(camera, seed)
        assert "motion_blur" in finding.causes, seed
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
    assert "slowly and fast" in finding.next_step


def test_a_moderately_low_confidence_cannot_rule_exposure_out():
    finding = diagnose(Camera(dimmed=0.85))
    assert finding.verdict is Verdict.NO_GAP
    assert "exposure_shift" in finding.cannot_rule_out


def picture_drive(folder, stops, seed, name):
    """A drive whose log names pictures of a rough grey road, exposed by so many stops."""
    rng = np.random.default_rng(seed)
    log = drive(road(seed=seed), Camera(fps=5.0, dimmed=float(np.exp(-((stops / 4.3) ** 2)))), seed=seed)
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
    assert diagnose(Camera(dimmed=0.8)).verdict is Verdict.NO_GAP
    assert diagnose(Camera(wrong=0.14)).verdict is Verdict.NO_GAP
    finding = diagnose(Camera(dimmed=0.75, wrong=0.3))
    assert finding.causes == ("exposure_shift",)
    assert "not road.yaml's in" in " ".join(candidate(finding, "exposure_shift").evidence_for)


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


def test_pictures_that_cannot_be_read_are_said(tmp_path):
    logs = [picture_drive(tmp_path, 0.0, seed, f"d{seed}") for seed in range(3)]
    for file in (tmp_path / "d0").iterdir():
        file.write_bytes(b"no picture")
    finding = diagnose_perception(logs[:2], logs[2], [road(seed=i) for i in range(3)], BARE)
    assert finding.verdict is Verdict.NO_GAP
    (warning,) = [w for w in finding.warnings if "pictures looked at" in w]
    assert "neither JPEG nor PNG" in warning


# wrong about the classes' friction


def test_class_offsets_are_found_per_class():
    for seed, offset in enumerate(
        [(0.0, -0.2, 0.0), (-0.15, 0.0, 0.2), (-0.3, 0.1, 0.1), (0.15, -0.15, 0.0)]
    ):
        finding = diagnose(Camera(offset=offset), seed)
        assert (finding.verdict, finding.causes) == (Verdict.IDENTIFIED, ("class_friction_offset",))
        estimate = candidate(finding, "class_friction_offset").parameters
        for name, truth in zip(NAMES, offset, strict=True):
            assert estimate[name].low <= truth <= estimate[name].high
            assert estimate[name].value == pytest.approx(truth, abs=0.02)


def test_a_class_that_was_not_driven_on_is_left_open():
    dry = road(5000.0)
    logs = [drive(dry, Camera(offset=(-0.2, 0.0, 0.0)), seed=i) for i in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [dry] * 3, BARE)
    estimate = candidate(finding, "class_friction_offset").parameters
    assert (estimate["wet"].low, estimate["wet"].high) == (-0.5, 0.7)
    assert estimate["dry"].low <= -0.2 <= estimate["dry"].high


def test_one_factor_on_the_roads_friction_is_the_dynamics_own():
    """The reference follows road.yaml times 0.7: one parameter does what three offsets would."""
    roads = [road(seed=i, mu=(0.9, 0.5, 0.3)) for i in range(3)]
    logs = [drive(r, Camera(), seed=i, reference="road") for i, r in enumerate(roads)]
    logs = [changed(log, mu_reference=0.7 * log.signals["mu_reference"]) for log in logs]
    finding = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert finding.causes == ("friction_offset",)
    assert candidate(finding, "friction_offset").parameters["factor"].value == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(
    ("effect", "values"),
    [("friction_offset", {"factor": 0.7}), ("mu_split", {"left_factor": 0.5, "right_factor": 1.0})],
)
def test_a_reference_that_agrees_with_what_the_dynamics_show_is_no_gap_of_the_camera(effect, values):
    roads = [road(seed=i, mu=(0.9, 0.5, 0.3)) for i in range(3)]
    torque = np.full((2001, 4), 40.0)
    logs = []
    for i, r in enumerate(roads):
        trajectory = simulate(car_with(**{effect: values}), r, torque, 0.01, 8.0)
        table = make_log(trajectory, CAR, seed=i)
        signals = {n: table[n].to_numpy() for n in ("vehicle_speed_m_s", "position_m", "mu_reference")}
        logs.append(log_of(trajectory.time_s, signals, f"drive{i}.csv"))
    alone = diagnose_perception(logs[:2], logs[2], roads, BARE)
    assert alone.verdict is not Verdict.NO_GAP
    shown = make_effect(effect, values, BARE.to_core())
    assert diagnose_perception(logs[:2], logs[2], roads, BARE, found=[shown]).verdict is Verdict.NO_GAP


# several at once, and what is left out


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
    [
        ({"delay_s": 0.15}, "camera_latency"),
        ({"distance_m": 1.0}, "camera_pitch"),
        ({"blur_s": 0.04}, "motion_blur"),
        ({"dimmed": 0.4}, "exposure_shift"),
        ({"offset": (0.0, -0.2, 0.0)}, "class_friction_offset"),
    ],
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


# damage


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
    [
        *WARNED,
        "no class for a third",
        "frame_id counts down",
        "frame_id lost here and there",
        "position lost here and there",
    ],
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


# the product's own plant and perception


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
    [
        ("camera_latency", {"delay_s": 0.08}),
        ("camera_pitch", {"pitch_rad": 0.2}),
        ("motion_blur", {"exposure_s": 0.03}),
        ("exposure_shift", {"stops": 3.5}),
        ("class_friction_offset", {"dry": -0.1, "wet": 0.0, "snow_ice": 0.15}),
        (None, {}),
    ],
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


# what comes again, and what does not


def moved(road_file, by_m, seed):
    rng = np.random.default_rng(seed)
    segments = [
        s.model_copy(update={"start_m": s.start_m + by_m * (i > 0) * rng.uniform(-1.0, 1.0)})
        for i, s in enumerate(road_file.segments)
    ]
    return road_file.model_copy(update={"segments": segments})


@pytest.mark.parametrize("seed", range(4))
def test_a_careless_chains_scatter_is_no_gap(seed):
    finding = diagnose(Camera(fps=12.0, flicker_m=1.5, wrong=0.08), seed, duration_s=60.0)
    assert finding.verdict is Verdict.NO_GAP, finding.unexplained


def test_borders_that_lie_elsewhere_are_so_each_time():
    same = road(seed=3)
    logs = [drive(same, Camera(), seed=i, duration_s=60.0) for i in range(3)]
    finding = diagnose_perception(logs[:2], logs[2], [moved(same, 2.5, 1)] * 3, BARE)
    assert finding.verdict is Verdict.UNKNOWN
    assert "the same each time that a border is passed" in finding.unexplained[0]


def test_a_position_that_drifts_puts_neighbouring_borders_off_alike():
    def drifting(log):
        drift_m = 2.5 * np.sin(2.0 * np.pi * log.time_s / 20.0)
        names = ("position_m", "image_from_m", "image_to_m")
        return changed(log, **{name: log.signals[name] + drift_m for name in names})

    finding = diagnose(Camera(), 1, damage=drifting, duration_s=60.0, reference=None)
    assert finding.verdict is Verdict.UNKNOWN
    assert "neighbours alike" in finding.unexplained[0]


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
    assert any("comes and goes by a factor of" in text for text in finding.unexplained)


def test_classes_that_keep_contradicting_road_yaml_are_a_gap_and_one_that_does_is_a_warning():
    def confused(most):
        def damage(log):
            classes = log.signals["image_class"]
            far = (log.signals["image_from_m"] > 100.0) & (log.signals["image_from_m"] < most)
            return changed(log, image_class=np.where(far & (classes == 1.0), 0.0, classes))

        return damage

    finding = diagnose(Camera(wrong=0.0), 2, damage=confused(500.0))
    assert finding.verdict is Verdict.UNKNOWN
    assert any("keeps seeing another class than road.yaml" in text for text in finding.unexplained)
    one = diagnose(Camera(wrong=0.0), 2, damage=confused(170.0))
    assert one.verdict is Verdict.NO_GAP
    assert any("road.yaml has wet" in text for text in one.warnings)


@pytest.mark.parametrize(
    ("faults", "law"),
    [({"delay_s": 0.25}, "goes with speed"), ({"distance_m": 2.0}, "does not depend on speed")],
)
def test_a_twin_is_not_blamed_for_a_law_that_is_not_its_own(faults, law):
    true = {"delay_s": "camera_latency", "distance_m": "camera_pitch"}[next(iter(faults))]
    finding = diagnose(Camera(**faults), exclude=(true,), speeds=SLOW_AND_FAST)
    assert finding.verdict is Verdict.UNKNOWN
    assert all(true not in c.effects for c in finding.candidates)
    assert law in finding.unexplained[0]


def test_an_unknown_finding_does_not_believe_in_its_best_effect():
    blamed = diagnose(Camera(delay_s=0.25), speeds=SLOW_AND_FAST)
    unknown = diagnose(Camera(delay_s=0.25), exclude=("camera_latency",), speeds=SLOW_AND_FAST)
    assert unknown.verdict is Verdict.UNKNOWN
    assert sum(c.probability for c in camera_side(unknown).causes) <= UNKNOWN_BELIEF + 1e-9
    assert camera_side(blamed).causes[0].probability > 0.8


def test_a_blamed_effect_is_told_with_its_values_and_what_it_does():
    told = camera_side(diagnose(Camera(delay_s=0.25), speeds=SLOW_AND_FAST)).sentence
    assert re.match(
        r"with delay_s 0\.2\d+ s the camera's gap goes from \d+\.\d to 1\.\d times the noise floor\.", told
    )
    assert camera_side(diagnose(Camera(), speeds=SLOW_AND_FAST)).sentence == ""
