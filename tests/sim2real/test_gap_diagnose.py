"""The diagnosis as a whole: from files on disk to what it says, and what it refuses."""

import ast
import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from gap_drives import DRY, MODEL, clean, noisy, pulses, random_drives, remeasured, road_of, trace
from gap_files import write_log, write_road

import sim2real
from scenarios.effects import EFFECTS, FORMS
from scenarios.errors import ScenarioError
from scenarios.files import load_road, load_vehicle
from sim2real.demo import VEHICLE
from sim2real.diagnose import diagnose, diagnose_files, shrink_on
from sim2real.logs import read_log
from sim2real.observing.drive import CHANNELS, RECOVERY_S, WHEEL, backward, make_drive
from sim2real.reporting.report import jsonable
from sim2real.result import Diagnosis, Verdict
from sim2real.sources import Given, make_source, put_together, read_source, read_sources, split
from trpac_core.vehicle import WHEELS

PAYLOAD = {"mass_offset": {"mass_kg": 180.0}}
FEW = ("mass_offset", "torque_gain", "torque_lag", "aero_drag", "accelerometer_bias", "tyre_stiffness_offset")
EXCLUDE = set(EFFECTS) - set(FEW)
ICY = road_of(0.9, 0.4, 0.9, 0.4, length_m=45.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Logs of a car with 180 kg more: two to fit to, on two roads, and a hold-out on the second."""
    path = tmp_path_factory.mktemp("case")
    shutil.copy(VEHICLE, path / "vehicle.yaml")
    car = yaml.safe_load((path / "vehicle.yaml").read_text(encoding="utf-8"))
    car["effects"] = {}
    (path / "vehicle.yaml").write_text(yaml.safe_dump(car), encoding="utf-8")
    write_road(DRY, path / "dry.yaml")
    write_road(ICY, path / "icy.yaml")
    for number, (name, road) in enumerate((("fit_1", DRY), ("fit_2", ICY), ("holdout", ICY))):
        torque = (1.0 + 0.2 * number) * pulses(9.0)
        write_log(noisy(clean(torque, 13.0, road, PAYLOAD), number), path / f"{name}.csv")
    return path


def ask(folder, **more) -> Diagnosis:
    return diagnose_files(
        folder / "vehicle.yaml",
        folder / "icy.yaml",
        [f"{folder}/fit_1.csv@{folder}/dry.yaml", f"{folder}/fit_2.csv"],
        f"{folder}/holdout.csv",
        **{"exclude": EXCLUDE, **more},
    )


@pytest.fixture(scope="module")
def said(folder):
    """What is said of these logs, and the stages that were told on the way."""
    stages = []
    return ask(folder, progress=lambda stage, done, total: stages.append(stage)), stages


# --- from files to a verdict


def test_the_payload_is_found(said):
    found, _ = said
    assert found.verdict is Verdict.IDENTIFIED
    top = found.causes[0]
    assert top.effect == "mass_offset"
    assert top.probability > 0.9
    mass = top.parameters["mass_kg"]
    assert mass.low <= 180.0 <= mass.high
    assert mass.high - mass.low < 40.0
    assert top.shrink_percent.low > 50.0
    assert "mass_offset" in found.sentence


def test_the_gap_goes_down_to_the_noise_floor(said):
    gap = said[0].gap
    assert gap.before.total > 2.0
    assert gap.after.total == pytest.approx(gap.noise_floor, abs=0.1)
    assert gap.noise_floor == pytest.approx(1.0, abs=0.1)
    assert gap.measured_on == "holdout"


def test_every_candidate_is_listed_and_probabilities_leave_room(said):
    causes = said[0].causes
    assert {c.effect for c in causes} == set(FEW)
    assert sum(c.probability for c in causes) <= 1.0
    assert [c.probability for c in causes] == sorted((c.probability for c in causes), reverse=True)


def test_a_diagnosis_says_how_far_it_is(said):
    assert said[1][0] == "reading"
    assert {"effects, first round", "effects"} <= set(said[1])


def test_where_the_gap_is_lies_within_the_hold_out(said):
    places = said[0].where
    assert places
    for place in places:
        assert 0.0 <= place.from_s < place.to_s <= 9.2
        assert 0.0 < place.share <= 1.0
        assert place.log == "holdout.csv"
    assert [p.share for p in places] == sorted((p.share for p in places), reverse=True)


def test_provenance_names_the_files_and_their_hashes(said, folder):
    told = said[0].provenance
    assert told["seed"] == 0
    assert [row["path"] for row in told["fit"]] == [str(folder / "fit_1.csv"), str(folder / "fit_2.csv")]
    assert told["fit"][0]["road"]["path"].endswith("dry.yaml")
    assert told["holdout"]["road"]["path"].endswith("icy.yaml")
    assert len(told["holdout"]["sha256"]) == 64
    assert told["holdout"]["rate_hz"] == pytest.approx(125.0)


def test_the_json_is_the_contracts(said):
    data = json.loads(json.dumps(jsonable(said[0].to_json()), allow_nan=False))
    assert data["schema"] == 1
    assert data["verdict"] in {"identified", "partial", "ambiguous", "compound", "unknown", "no_gap"}
    assert set(data["gap"]) >= {"before", "after", "noise_floor", "measured_on"}
    assert set(data["gap"]["before"]) >= {"total", "signals"}
    assert set(data["gap"]["before"]["signals"]) >= {"wheel_speed", "vehicle_speed", "accel_x"}
    for row in data["where"]:
        assert set(row) >= {"signal", "subsystem", "regime", "from_s", "to_s", "share"}
    for row in data["causes"]:
        assert set(row) >= {"effect", "probability", "parameters", "gap_after", "shrink_percent"}
        assert row["effect"] in EFFECTS
        assert set(row["parameters"]) in [
            {p.name for p in kind.parameters()} for kind in FORMS[row["effect"]]
        ]
        for value in (*row["parameters"].values(), row["shrink_percent"]):
            assert value["low"] <= value["value"] <= value["high"]
    assert list(data["budget"]) == ["effect:mass_offset", "structure", "noise"]
    assert sum(data["budget"].values()) == pytest.approx(1.0)
    assert data["budget"]["effect:mass_offset"] > 0.7 > 0.05 > data["budget"]["structure"]
    assert all(low <= data["budget"][key] <= high for key, (low, high) in data["budget_intervals"].items())
    assert data["ambiguous_with"] == []
    assert data["next_manoeuvre"] is None
    assert data["unexplained"] is None


def same(a: Diagnosis, b: Diagnosis) -> bool:
    return json.dumps(jsonable(a.to_json()), sort_keys=True) == json.dumps(
        jsonable(b.to_json()), sort_keys=True
    )


@pytest.mark.long
def test_the_same_seed_says_the_same_with_any_number_of_jobs(said, folder):
    assert same(said[0], ask(folder, jobs=2))


@pytest.mark.long
def test_another_seed_changes_the_resampling_alone(said, folder):
    other = ask(folder, seed=1)
    assert other.provenance["seed"] == 1
    top, again = said[0].causes[0], other.causes[0]
    assert again.parameters == top.parameters
    assert again.shrink_percent.value == top.shrink_percent.value
    assert (again.shrink_percent.low, again.shrink_percent.high) != (
        top.shrink_percent.low,
        top.shrink_percent.high,
    )


def test_what_is_excluded_is_not_named(folder):
    found = ask(folder, exclude=EXCLUDE | {"mass_offset"})
    assert "mass_offset" not in {c.effect for c in found.causes}
    assert found.causes[0].probability < 0.9 or found.verdict is not Verdict.IDENTIFIED


def test_what_was_found_shrinks_a_log_that_was_never_seen(said, folder, tmp_path):
    write_log(noisy(clean(pulses(7.0), 20.0, ICY, PAYLOAD), 9), tmp_path / "further.csv")
    shrunk = shrink_on(said[0], tmp_path / "further.csv", folder / "icy.yaml")
    assert shrunk > 50.0
    write_log(noisy(clean(pulses(7.0), 20.0, ICY), 9), tmp_path / "another_car.csv")
    assert shrink_on(said[0], tmp_path / "another_car.csv", folder / "icy.yaml") < 0.0


def test_a_log_that_the_simulation_already_explains_has_no_gap(folder, tmp_path):
    """The payload in vehicle.yaml: then nothing is missing."""
    car = yaml.safe_load((folder / "vehicle.yaml").read_text(encoding="utf-8"))
    car["effects"] = PAYLOAD
    (tmp_path / "loaded.yaml").write_text(yaml.safe_dump(car), encoding="utf-8")
    found = diagnose_files(
        tmp_path / "loaded.yaml",
        folder / "icy.yaml",
        [f"{folder}/fit_1.csv@{folder}/dry.yaml"],
        f"{folder}/holdout.csv",
        exclude=set(EFFECTS) - {"torque_gain", "mass_offset"},
    )
    assert found.verdict is Verdict.NO_GAP
    assert found.gap.before == found.gap.after
    assert found.where == ()
    assert sum(c.probability for c in found.causes) < 0.1


def test_names_and_units_of_another_tool_are_mapped(said, folder, tmp_path):
    """The same logs in km/h under other names say the same."""
    for name in ("fit_1", "fit_2", "holdout"):
        frame = pd.read_csv(folder / f"{name}.csv")
        frame["VehSpd"] = 3.6 * frame.pop("vehicle_speed_m_s")
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    rows = {name: name for name in pd.read_csv(folder / "fit_1.csv").columns if name != "vehicle_speed_m_s"}
    mapping = {"schema": 1, "columns": {**rows, "vehicle_speed_m_s": {"column": "VehSpd", "unit": "km/h"}}}
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping["columns"]), encoding="utf-8")
    found = diagnose_files(
        folder / "vehicle.yaml",
        folder / "icy.yaml",
        [f"{tmp_path}/fit_1.csv@{folder}/dry.yaml", f"{tmp_path}/fit_2.csv"],
        f"{tmp_path}/holdout.csv",
        mapping=tmp_path / "mapping.yaml",
        exclude=set(EFFECTS) - {"torque_gain", "mass_offset"},
    )
    value, expected = (d.causes[0].parameters["mass_kg"].value for d in (found, said[0]))
    assert value == pytest.approx(expected, abs=1.0)


# --- verdicts of whole diagnoses, from drives


def test_what_logs_cannot_tell_apart_comes_with_the_next_manoeuvre():
    torque = trace((0, 0), (2, 40), (6, 40), (8, -40), (10, -40), duration_s=10.0)
    real = {"mass_offset": {"mass_kg": 60.0}}
    logs = [noisy(clean(f * torque, 12.0, effects=real), seed) for seed, f in enumerate((1.0, 0.8))]
    found = diagnose(MODEL, logs[:1], logs[1], exclude=set(EFFECTS) - {"mass_offset", "torque_gain"})
    assert found.verdict is Verdict.AMBIGUOUS
    assert set(found.ambiguous_with[0]) == {"mass_offset", "torque_gain"}
    assert found.next_manoeuvre is not None
    assert found.next_manoeuvre.power_sigma > max(5.0, found.next_manoeuvre.power_now_sigma)
    told = found.to_json()["next_manoeuvre"]
    assert len(told["time_s"]) == len(told["wheel_torque_nm"])


@pytest.mark.long
def test_two_effects_stand_first_with_their_joint_parameters():
    real = {"torque_lag": {"time_constant_s": 0.12}, "mass_offset": {"mass_kg": 180.0}}
    logs = random_drives(real, count=2, seed=1, duration_s=8.0)
    found = diagnose(MODEL, logs[:1], logs[1], exclude=EXCLUDE, jobs=2)
    assert found.verdict is Verdict.COMPOUND
    assert {c.effect for c in found.causes[:2]} == set(real)
    values = {c.effect: next(iter(c.parameters.values())).value for c in found.causes[:2]}
    assert values == pytest.approx({"torque_lag": 0.12, "mass_offset": 180.0}, rel=0.05)
    assert found.gap.after.total == pytest.approx(1.0, abs=0.15)


def test_what_no_effect_explains_is_unknown_and_told():
    """A bias of the accelerometer, left out of the library."""
    real = {"accelerometer_bias": {"bias_m_s2": 0.5}}
    logs = [noisy(clean(f * pulses(8.0), 14.0, effects=real), seed) for seed, f in enumerate((1.0, 0.8))]
    found = diagnose(MODEL, logs[:1], logs[1], exclude=EXCLUDE | {"accelerometer_bias"}, jobs=2)
    assert found.verdict is Verdict.UNKNOWN
    assert found.unexplained is not None
    assert found.unexplained.subsystem == "accelerometer"
    np.testing.assert_allclose(found.unexplained.y, 0.5, atol=0.05)
    assert found.gap.after == found.gap.before
    assert max(c.probability for c in found.causes) < 0.1


def test_a_pulse_counter_is_named_by_its_lattice():
    real = {"wheel_speed_quantisation": {"teeth": 48.0, "window_s": 0.04}}
    logs = random_drives(real, count=2, seed=2)
    excluded = set(EFFECTS) - {"wheel_speed_quantisation", "wheel_speed_delay", "mass_offset"}
    found = diagnose(MODEL, logs[:1], logs[1], exclude=excluded)
    assert found.verdict is Verdict.IDENTIFIED
    assert found.causes[0].effect == "wheel_speed_quantisation"
    teeth = found.causes[0].parameters["teeth"]
    assert teeth.low <= 48.0 <= teeth.high


def test_columns_that_are_not_measured_are_no_evidence():
    drive = clean(pulses(5.0), 13.0)
    columns = dict(zip(CHANNELS, drive.measured.T, strict=True))
    columns["accel_x_m_s2"] = np.full(len(drive), np.nan)
    columns |= {f"wheel_torque_{w}_nm": drive.torque_nm[:, i] for i, w in enumerate(WHEELS)}
    made = make_drive("x", DRY, drive.time_s, columns, without=frozenset({"position_m"}))
    assert made.counted.tolist() == [False, True, True, True, True, True, False]


def test_lost_samples_of_the_command_are_bridged():
    drive = clean(pulses(5.0), 13.0)
    columns = dict(zip(CHANNELS, drive.measured.T, strict=True))
    columns |= {f"wheel_torque_{w}_nm": drive.torque_nm[:, i].copy() for i, w in enumerate(WHEELS)}
    columns["wheel_torque_fl_nm"][100:110] = np.nan
    made = make_drive("x", DRY, drive.time_s, columns)
    np.testing.assert_allclose(made.torque_nm[:, 0], drive.torque_nm[:, 0], atol=30.0)
    np.testing.assert_array_equal(made.torque_nm[:, 1], drive.torque_nm[:, 1])


# --- what is refused


def test_a_log_names_its_road_after_an_at(tmp_path):
    common = Path("common.yaml")
    assert split("a.csv@b.yaml", common) == Given(Path("a.csv"), Path("b.yaml"))
    assert split("a.csv", common) == Given(Path("a.csv"), common)
    assert split("me@home/a.csv", common) == Given(Path("me@home/a.csv"), common)
    assert split("me@home/a.csv@b.yml", None) == Given(Path("me@home/a.csv"), Path("b.yml"))
    assert split("a.csv@b.YAML", None) == Given(Path("a.csv"), Path("b.YAML"))
    folder = tmp_path / "me@lab"
    folder.mkdir()
    (folder / "a.csv").touch()
    assert split(f"{folder}/a.csv@{folder}/b.yaml", None) == Given(folder / "a.csv", folder / "b.yaml")
    with pytest.raises(ScenarioError, match=r"a\.csv: names no road; expected LOG@ROAD\.yaml, or --road"):
        split("a.csv", None)


def test_a_log_names_its_window_after_an_at(tmp_path):
    common = Path("common.yaml")
    assert split("a.csv@3:5.2", common) == Given(Path("a.csv"), common, 3.0, 5.2)
    assert split("a.csv@:5", common) == Given(Path("a.csv"), common, -math.inf, 5.0)
    assert split("a.csv@b.yaml@.5:", None) == Given(Path("a.csv"), Path("b.yaml"), 0.5, math.inf)
    odd = tmp_path / "a@1:2"
    odd.touch()
    assert split(str(odd), common) == Given(odd, common)
    with pytest.raises(ScenarioError, match=r"a\.csv@5:3: the window ends before it begins"):
        split("a.csv@5:3", common)


def test_windows_of_one_log_are_fitted_and_held_out(folder):
    log, road = folder / "fit_1.csv", folder / "dry.yaml"
    whole = read_source(f"{log}@{road}", None).log
    middle = 0.5 * (whole.time_s[0] + whole.time_s[-1])
    for fitted, overlaps in ((f"{log}@:{middle}", False), (f"{log}@:{middle + 1.0}", True)):
        read = read_sources(folder / "vehicle.yaml", road, [fitted], f"{log}@{middle}:")
        assert read.holdout.log.time_s[0] >= middle
        assert read.fit[0].log.time_s[-1] < middle + overlaps
        assert any("is a fit log, too" in text for text in read.holdout.log.warnings) is overlaps
        assert read.fit[0].log.name.startswith("fit_1.csv from 0 to ")
    with pytest.raises(ScenarioError, match="fewer than two rows from 1000 to 1001 s"):
        read_source(f"{log}@1000:1001", road)


def test_all_that_is_wrong_is_told_at_once(folder, tmp_path):
    (tmp_path / "vehicle.yaml").write_text("schema: 1\nname: x\nmass_kg: -3\n", encoding="utf-8")
    with pytest.raises(ScenarioError) as refused:
        read_sources(
            tmp_path / "vehicle.yaml",
            tmp_path / "no_road.yaml",
            [f"{tmp_path}/no_fit.csv@{folder}/dry.yaml", f"{folder}/fit_2.csv"],
            f"{tmp_path}/no_holdout.csv",
            tmp_path / "no_mapping.yaml",
        )
    text = str(refused.value)
    for name in ("mass_kg", "no_road.yaml", "no_fit.csv", "no_holdout.csv", "no_mapping.yaml"):
        assert name in text


def test_the_same_problem_is_told_once(folder, tmp_path):
    with pytest.raises(ScenarioError) as refused:
        read_sources(
            folder / "vehicle.yaml",
            tmp_path / "no_road.yaml",
            [f"{folder}/fit_1.csv"] * 2,
            f"{folder}/holdout.csv",
        )
    assert str(refused.value).count("no_road.yaml") == 1


def test_a_diagnosis_needs_a_log_to_fit_to(folder):
    with pytest.raises(ScenarioError, match="No log to fit to; expected at least one --fit"):
        read_sources(folder / "vehicle.yaml", folder / "dry.yaml", [], f"{folder}/holdout.csv")


def test_logs_of_one_name_are_told_apart(folder, tmp_path):
    logs = []
    for day in ("mon", "tue"):
        (tmp_path / day).mkdir()
        logs.append(tmp_path / day / "log.csv")
        write_log(noisy(clean(pulses(4.0), 13.0), len(logs)), logs[-1])
    fit = [*map(str, logs), str(logs[0]), f"{folder}/fit_1.csv"]
    found = read_sources(folder / "vehicle.yaml", folder / "dry.yaml", fit, f"{folder}/holdout.csv")
    names = [s.log.name for s in found.all]
    assert names == ["mon/log.csv (1)", "tue/log.csv", "mon/log.csv (2)", "fit_1.csv", "holdout.csv"]
    assert [s.drive.name for s in found.all] == names


@pytest.mark.parametrize(("yaw_rate", "turns"), [(0.005, False), (0.2, True)])
def test_curves_are_told_where_the_yaw_rate_is_measured(folder, tmp_path, yaw_rate, turns):
    drive = noisy(clean(pulses(4.0), 13.0))
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(drive))
    write_log(drive, tmp_path / "curve.csv", yaw_rate_rad_s=yaw_rate + noise)
    found = read_sources(
        folder / "vehicle.yaml", folder / "dry.yaml", [f"{tmp_path}/curve.csv"], f"{folder}/holdout.csv"
    )
    assert any("the car turns in 4" in text for text in found.fit[0].log.warnings) is turns
    assert not any("turns" in text for text in found.holdout.log.warnings)


def test_a_log_without_a_needed_column_names_it(folder, tmp_path):
    drive = noisy(clean(pulses(4.0), 13.0))
    write_log(drive, tmp_path / "bad.csv", wheel_torque_rl_nm=None)
    with pytest.raises(ScenarioError, match=r"(?s)bad\.csv.*wheel_torque_rl_nm"):
        read_sources(
            folder / "vehicle.yaml", folder / "dry.yaml", [f"{tmp_path}/bad.csv"], f"{folder}/holdout.csv"
        )


def test_what_the_logger_wrote_before_the_sensors_woke_is_left_out_and_said(folder, tmp_path):
    drive = noisy(clean(pulses(6.0), 13.0))
    measured = drive.measured.copy()
    measured[:125] = np.nan
    write_log(remeasured(drive, measured), tmp_path / "waking.csv")
    found = read_sources(
        folder / "vehicle.yaml", folder / "dry.yaml", [f"{tmp_path}/waking.csv"], f"{folder}/holdout.csv"
    )
    assert found.fit[0].drive.time_s[0] == pytest.approx(1.0)
    assert (
        "the first 1 s are left out: the speed of the car is not measured there." in found.fit[0].log.warnings
    )
    assert not any("left out" in text for text in found.holdout.log.warnings)


def test_the_estimate_is_held_to_the_reference_of_its_own_rows_where_sensors_wake_late(
    folder, tmp_path, monkeypatch
):
    drive = noisy(clean(pulses(9.0), 13.0, ICY, PAYLOAD), 2)
    measured = drive.measured.copy()
    measured[:125] = np.nan
    reference = 0.5 + 0.01 * drive.time_s
    write_log(remeasured(drive, measured), tmp_path / "waking.csv", mu_reference=reference)
    asked = []
    monkeypatch.setattr(
        "sim2real.diagnose.trpac_error", lambda car, drive, added, mu: asked.append((drive.time_s, mu))
    )
    diagnose_files(
        folder / "vehicle.yaml",
        folder / "icy.yaml",
        [f"{folder}/fit_2.csv"],
        f"{tmp_path}/waking.csv",
        exclude=EXCLUDE,
    )
    ((time_s, mu),) = asked
    assert time_s[0] == pytest.approx(1.0)
    assert mu == pytest.approx(0.5 + 0.01 * time_s, abs=1e-6)


@pytest.mark.parametrize(
    ("speed_m_s", "known", "said"),
    [
        (13.0, 200, r"in its last 1\.59 s only; expected at least 2 s"),
        (0.0, 200, "never moves forward on all wheels"),
    ],
)
def test_sensors_that_wake_too_late_or_on_a_parked_car_are_refused(folder, tmp_path, speed_m_s, known, said):
    drive = clean(
        trace((0, 0), (1, 100), duration_s=3.0) if speed_m_s else trace((0, 0), duration_s=3.0), speed_m_s
    )
    measured = drive.measured.copy()
    measured[:-known] = np.nan
    write_log(remeasured(drive, measured), tmp_path / "late.csv")
    with pytest.raises(ScenarioError, match=said):
        read_sources(
            folder / "vehicle.yaml", folder / "dry.yaml", [f"{folder}/fit_1.csv"], f"{tmp_path}/late.csv"
        )


def test_a_car_that_never_moves_is_refused(folder, tmp_path):
    standing = clean(trace((0, 0), duration_s=5.0), 0.0)
    write_log(standing, tmp_path / "parked.csv")
    with pytest.raises(ScenarioError, match=r"never moves forward on all wheels; expected a log of driving"):
        read_sources(
            folder / "vehicle.yaml", folder / "dry.yaml", [f"{folder}/fit_1.csv"], f"{tmp_path}/parked.csv"
        )


# --- what is left out and said


def test_a_hold_out_that_is_a_fit_log_is_said(folder):
    files = [f"{folder}/fit_1.csv", f"{folder}/fit_2.csv"]
    same = read_sources(folder / "vehicle.yaml", folder / "dry.yaml", files, files[1])
    assert any("is a fit log, too" in text for text in same.holdout.log.warnings)
    other = read_sources(folder / "vehicle.yaml", folder / "dry.yaml", files[:1], files[1])
    assert not other.holdout.log.warnings


def test_windows_of_one_log_may_be_fitted_to_and_held_out(folder):
    """Regression: every window of the hold-out's file was called a fit log."""
    vehicle, road = load_vehicle(folder / "vehicle.yaml"), load_road(folder / "dry.yaml")
    log = read_log(folder / "fit_1.csv")
    begin, end = log.time_s[[0, -1]]
    middle = 0.5 * (begin + end)
    early, late, across = log.window(begin, middle), log.window(middle, end), log.window(begin + 1.0, end)

    def warnings(fit, holdout):
        return put_together(
            vehicle, None, [make_source(part, road) for part in (fit, holdout)]
        ).holdout.log.warnings

    assert not warnings(early, late)
    assert not warnings(late, early)
    assert any("is a fit log, too" in text for text in warnings(across, late))


def test_wheels_that_turn_back_are_left_out_and_said(folder, tmp_path):
    drive = noisy(clean(pulses(9.0), 13.0), 3)
    measured = drive.measured.copy()
    back = (drive.time_s > 3.0) & (drive.time_s < 3.4)
    measured[back, WHEEL.start] = -8.0
    write_log(replace(drive, measured=measured), tmp_path / "back.csv")
    found = read_sources(
        folder / "vehicle.yaml", folder / "dry.yaml", [f"{tmp_path}/back.csv"], f"{folder}/fit_1.csv"
    )
    time_s, moving = found.fit[0].drive.time_s, found.fit[0].drive.moving
    assert not moving[(time_s > 3.05) & (time_s < 3.35 + RECOVERY_S)].any()
    assert moving[(time_s < 2.9) | (time_s > 3.5 + RECOVERY_S)].all()
    assert any("a wheel turns back" in text for text in found.fit[0].log.warnings)
    assert not any("turns back" in text for text in found.holdout.log.warnings)


def test_noise_of_a_locked_wheel_is_no_wheel_that_turns_back():
    rng = np.random.default_rng(0)
    time_s = np.arange(1000) / 125.0
    assert not backward(time_s, 0.4 * rng.standard_normal((1000, 4))).any()
    one = np.zeros((1000, 4))
    one[500] = -20.0  # a sample that is wrong
    assert not backward(time_s, one).any()


# --- the folder


def imported(path):
    """Modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


@pytest.mark.parametrize("path", sorted(Path(sim2real.__file__).parent.rglob("*.py")), ids=lambda p: p.name)
def test_the_diagnosis_imports_no_benchmark_and_no_test(path):
    ours = {name.split(".")[0] for name in imported(path)}
    assert not ours & {"benchmarks", "tests", "trpac_cli", "conftest"}
