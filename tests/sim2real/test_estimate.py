"""`trpac estimate`: from a recorded log to estimates, report and summary; and what it refuses."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
import schemas
from gap_drives import clean, noisy, trace
from gap_files import write_log as write_drive
from log_maker import make_frame, save
from report_page import require_report
from typer.testing import CliRunner

import trpac
from scenarios.camera.files import load_camera
from scenarios.files import load_scenario, load_vehicle
from scenarios.library import networks_folder
from scenarios.plant.pipeline import drive
from scenarios.plant.sensors import make_scenario_log
from sim2real.logs import load_mapping, read_log, write_log
from sim2real.replay import figures
from sim2real.replay.camera import camera_side
from sim2real.replay.estimate import TABLE_3, estimate_log
from sim2real.replay.inputs import make_inputs, white_noise
from sim2real.replay.run import OURS, _trusted, readings, replay
from sim2real.replay.score import score
from sim2real.replay.vehicle_level import vehicle_level
from trpac_cli.main import app
from trpac_core.car_friction import Friction, car_friction
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.four_wheels import FourWheelsConfig
from trpac_core.robust.messages import WRONG_INPUT
from trpac_core.vision.classes import Surface

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = ("estimates.csv", "report.html", "summary.json")
COLUMNS = ["time_s", "TRPAC", "TRPAC_std", "flag", "K_v", "excitation_flag"]
WHEELS = ("fl", "fr", "rl", "rr")
PREVIEW_M = 4.0
"""How far ahead of the front wheels the made-up camera stamps."""


def run(*arguments):
    """The command in this process; wide, so that nothing wraps."""
    return CliRunner(env={"COLUMNS": "250", "TERM": "dumb"}).invoke(app, ["estimate", *map(str, arguments)])


def refused(tmp_path, *arguments):
    """The one line of a refusal; nothing may be written."""
    out = tmp_path / "out"
    result = run(*arguments, "--out", out)
    assert result.exit_code == 2, result.output
    assert not out.exists()
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("trpac estimate: ")
    return lines[0]


@pytest.fixture(scope="module")
def driven():
    """The paper's drive at 100 Hz with its noise and reference."""
    scenario = replace(load_scenario(SCENARIOS / "paper_simulation.yaml"), seed=21)
    return make_scenario_log(scenario, drive(scenario)).iloc[::10].reset_index(drop=True)


@pytest.fixture(scope="module")
def with_classes(driven):
    """The same with a camera's classes, stamped where the road is as they say."""
    car, road = load_vehicle(TABLE_3).to_core(), load_scenario(SCENARIOS / "paper_simulation.yaml").road
    log = driven.copy()
    taken = np.repeat(np.arange(0, len(log), 5), 5)[: len(log)]
    ahead = log["position_m"].to_numpy()[taken] + car.cog_to_front_axle_m + PREVIEW_M
    log["frame_id"] = taken
    log["image_class"] = [int(road.segment_at(x).surface_class) for x in ahead]
    log["image_confidence"] = 0.9
    log["image_from_m"], log["image_to_m"] = ahead, ahead + 0.5
    return log


@pytest.fixture(scope="module")
def estimated(driven, tmp_path_factory):
    """The command's files for the drive, with peers, and what it said."""
    folder = tmp_path_factory.mktemp("estimate")
    log = save(driven, folder / "drive.csv")
    result = run(log, "--vehicle", TABLE_3, "--peers", "--out", folder / "out")
    assert result.exit_code == 0, result.output
    return folder / "out", result


class TestCommand:
    def test_it_writes_its_three_files_and_nothing_else(self, estimated):
        out, _ = estimated
        assert sorted(p.name for p in out.iterdir()) == sorted(NAMES)
        assert [p.name for p in out.parent.iterdir() if p.name.startswith(".")] == []

    def test_the_table_has_the_contracts_columns_first_and_a_row_per_sample(self, estimated, driven):
        table = pd.read_csv(estimated[0] / "estimates.csv")
        assert list(table)[:6] == COLUMNS
        assert list(table)[6:10] == [f"TRPAC_{w}" for w in WHEELS]
        assert len(table) == len(driven)
        assert table["time_s"].to_numpy() == pytest.approx(driven["time_s"].to_numpy(), abs=1e-5)
        assert set(table["flag"]) == {0}
        assert set(table["excitation_flag"]) == {0, 1}

    def test_it_finds_the_low_friction_of_the_plant(self, estimated, driven):
        """0.3 within the paper's 0.03 at a front wheel at the end of that stretch, and in the car's interval."""
        table = pd.read_csv(estimated[0] / "estimates.csv")
        mu = driven["mu_reference"].to_numpy()
        low = table.iloc[np.flatnonzero(mu == mu.min())[-60:]]
        assert low["TRPAC_fl"].mean() == pytest.approx(0.3, abs=0.03)
        assert (low["TRPAC_low"] < 0.3).all()
        assert (low["TRPAC"] < 0.5).all()

    def test_the_summary_holds_the_errors_of_all_estimators(self, estimated):
        summary = json.loads((estimated[0] / "summary.json").read_text())
        schemas.validate("estimate_summary", summary)
        assert summary["errors"]["compared"] == "TRPAC_peak"
        for name in ("robust", "DE", "slip-slope", "EKF", "UKF"):
            assert set(summary["errors"][name]) == {"excited", "seen", "all"}
        ours = summary["errors"]["robust"]
        assert ours["seen"]["time_s"] <= ours["excited"]["time_s"] <= ours["all"]["time_s"]
        assert summary["excitation"]["seen_share"] > 0.1

    def test_errors_are_those_of_the_table(self, estimated, driven):
        table = pd.read_csv(estimated[0] / "estimates.csv")
        summary = json.loads((estimated[0] / "summary.json").read_text())
        moving = driven["vehicle_speed_m_s"].to_numpy() > 1.0
        error = np.abs(table["TRPAC_peak"] - driven["mu_reference"])[moving]
        assert summary["errors"]["robust"]["all"]["mean_abs"] == pytest.approx(error.mean(), abs=1e-3)

    def test_the_report_needs_nothing_beside_it(self, estimated):
        page = require_report((estimated[0] / "report.html").read_text())
        assert "http" not in page.source
        assert "drive.csv" in page.text
        names = {trace["name"] for spec in page.specs for trace in spec["data"]}
        assert {"fl", "fr", "rl", "rr", "mu_reference", "EKF", "UKF", "slip-slope", "95 % interval"} <= names

    def test_the_axes_of_the_report_hold_all_lines(self, estimated):
        page = require_report((estimated[0] / "report.html").read_text())
        names = set()
        for spec in page.specs:
            if (ends := spec["layout"]["yaxis"].get("range")) is None:
                continue
            for series in spec["data"]:
                y = np.frombuffer(b64decode(series["y"]["bdata"]), dtype="<f4")
                assert np.nanmax(y) <= ends[1], series["name"]
                names.add(series["name"])
        assert {"TRPAC (robust)", "TRPAC_peak", "95 % interval", "fl"} <= names

    def test_it_says_what_it_found(self, estimated):
        said = " ".join(estimated[1].stdout.split())
        assert "the tyres showed the road for" in said
        assert require_report((estimated[0] / "report.html").read_text()).verdict in said
        assert "TRPAC_peak against mu_reference" in said

    @pytest.mark.parametrize("method", ["as_printed", "robust"])
    def test_another_method_is_named_in_all_three_files(self, driven, tmp_path, method):
        log, title = save(driven, tmp_path / "drive.csv"), Method.of(method).title
        result = run(log, "--vehicle", TABLE_3, "--method", method, "--out", tmp_path / "out")
        assert result.exit_code == 0, result.output
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["method"] == method
        assert title in summary["errors"]
        assert "DIFE" not in summary["errors"]
        assert f'<th scope="row">{title}</th>' in (tmp_path / "out" / "report.html").read_text()
        table = pd.read_csv(tmp_path / "out" / "estimates.csv")
        python = trpac.estimate(driven, TABLE_3, method=method).frame
        for name in ("TRPAC", "TRPAC_low", "TRPAC_high", "TRPAC_expected", "TRPAC_high_rr"):
            assert table[name].to_numpy() == pytest.approx(python[name].to_numpy(), rel=1e-4, abs=1e-6)
        assert list(table["TRPAC_source"]) == list(python["TRPAC_source"])

    def test_the_help_tells_what_is_needed(self):
        text = " ".join(run("--help").output.split())
        for word in ("mapping file", "mu_reference", "TRPAC_std", "Exit codes", "--peers", "Example"):
            assert word in text

    @pytest.mark.parametrize("suffix", [".parquet", ".mf4"])
    def test_other_formats_give_the_same(self, driven, estimated, tmp_path, suffix):
        write_log(driven, tmp_path / f"drive{suffix}")
        result = run(tmp_path / f"drive{suffix}", "--vehicle", TABLE_3, "--out", tmp_path / "out")
        assert result.exit_code == 0, result.output
        one, other = (pd.read_csv(f / "estimates.csv")[COLUMNS] for f in (estimated[0], tmp_path / "out"))
        pd.testing.assert_frame_equal(one, other, atol=1e-6)

    def test_a_mapping_translates(self, driven, estimated, tmp_path):
        log = driven.rename(columns={"vehicle_speed_m_s": "VehSpd"}).assign(
            VehSpd=lambda d: d["VehSpd"] * 3.6
        )
        (tmp_path / "map.yaml").write_text("vehicle_speed_m_s: {column: VehSpd, unit: km/h}\n")
        result = run(
            save(log, tmp_path / "d.csv"),
            "--vehicle",
            TABLE_3,
            "--map",
            tmp_path / "map.yaml",
            "--out",
            tmp_path / "o",
        )
        assert result.exit_code == 0, result.output
        one, other = (pd.read_csv(f / "estimates.csv")["TRPAC"] for f in (estimated[0], tmp_path / "o"))
        assert one.to_numpy() == pytest.approx(other.to_numpy(), abs=1e-5)

    @pytest.mark.parametrize("factor", [1.0, 2.5])
    def test_torque_of_another_car_is_the_first_thing_said(self, factor, tmp_path):
        """A launch at 5 m/s2 whose torque is logged 2.5 times too large."""
        car = load_vehicle(TABLE_3)
        torque = trace((0.0, 560.0), (3.5, 440.0), (3.8, -70.0), (6.0, -70.0), duration_s=6.0)
        driven = noisy(clean(torque, 3.0, car=car), 0)
        logged = {f"wheel_torque_{w}_nm": factor * driven.torque_nm[:, i] for i, w in enumerate(WHEELS)}
        write_drive(driven, tmp_path / "drive.csv", **logged)
        done = trpac.estimate(tmp_path / "drive.csv", TABLE_3)
        said = "The estimate cannot be trusted"
        assert done.verdict.startswith(said) == (factor > 2.0)
        assert done.summary["torque_fits_car"] == (factor < 2.0)
        assert any(said in text for text in done.warnings) == (factor > 2.0)
        if factor > 2.0:
            assert re.fullmatch(
                r"The logged torque would accelerate this car at 1\d m/s2 where it accelerates at [45]\.?\d* m/s2: "
                r"torque scale, gear or mass is wrong\. The estimate cannot be trusted\.",
                done.warnings[0],
            )

    def test_a_guessed_car_is_said(self, tmp_path):
        result = run(save(make_frame(duration_s=2.5), tmp_path / "d.csv"), "--out", tmp_path / "out")
        assert result.exit_code == 0, result.output
        assert "no vehicle file was given" in result.stdout
        assert json.loads((tmp_path / "out" / "summary.json").read_text())["errors"] is None


class TestRefusals:
    def test_no_log(self, tmp_path):
        assert "nowhere.csv: cannot be read" in refused(tmp_path, tmp_path / "nowhere.csv")

    def test_a_log_without_torque(self, tmp_path):
        log = make_frame().drop(columns="wheel_torque_rl_nm")
        assert "wheel_torque_rl_nm" in refused(tmp_path, save(log, tmp_path / "d.csv"))

    def test_a_wrong_mapping(self, tmp_path):
        (tmp_path / "map.yaml").write_text("vehicle_speed_m_s: {column: VehSpd, unit: furlong}\n")
        log = save(make_frame(), tmp_path / "d.csv")
        assert "furlong" in refused(tmp_path, log, "--map", tmp_path / "map.yaml")

    def test_a_wrong_car(self, tmp_path):
        (tmp_path / "car.yaml").write_text("schema: 1\nname: nothing\n")
        log = save(make_frame(), tmp_path / "d.csv")
        assert "mass_kg: missing" in refused(tmp_path, log, "--vehicle", tmp_path / "car.yaml")

    def test_a_camera_file_for_a_log_without_pictures(self, tmp_path):
        log = save(make_frame(), tmp_path / "d.csv")
        assert "no column image_path" in refused(
            tmp_path, log, "--camera", SCENARIOS / "cameras" / "paper.yaml"
        )

    def test_a_car_that_stands(self, tmp_path):
        log = make_frame()
        log[[c for c in log if "speed" in c]] = 0.0
        log["position_m"] = 0.0
        assert "at least 1 s of driving" in refused(tmp_path, save(log, tmp_path / "d.csv"))

    def test_pictures_that_are_none(self, tmp_path):
        log = save(make_frame(duration_s=2.0, camera=True), tmp_path / "d.csv")
        said = refused(tmp_path, log, "--camera", SCENARIOS / "cameras" / "paper.yaml")
        assert "none of its" in said

    def test_a_file_where_the_folder_should_be(self, tmp_path):
        out = tmp_path / "out"
        out.write_text("mine")
        result = run(save(make_frame(), tmp_path / "d.csv"), "--out", out)
        assert result.exit_code == 2
        assert out.read_text() == "mine"


class TestCamera:
    def side(self, log, tmp_path):
        car = load_vehicle(TABLE_3)
        read = read_log(save(log, tmp_path / "d.csv"))
        inputs = make_inputs(read, car)
        return inputs, camera_side(read, inputs, car, None, networks_folder())

    def test_classes_of_the_log_are_used(self, with_classes, tmp_path):
        inputs, side = self.side(with_classes, tmp_path)
        done = replay(inputs, side)
        assert side.source == "class columns of the log"
        assert done.flag.any(axis=0).all()
        assert (done.K_v > 0.0).any()

    def test_a_class_comes_under_the_front_wheel_where_its_stamp_says(self, with_classes, tmp_path):
        """One result says snow, 4 m ahead: the wheel must meet it there, not a standard preview distance ahead."""
        log = with_classes.copy()
        log["image_class"] = int(Surface.DRY)
        row = int(np.searchsorted(log["position_m"], 25.0))
        frame = log["frame_id"][row]
        here = log["frame_id"] == frame
        log.loc[here, "image_class"] = int(Surface.SNOW_ICE)
        stamp_m = float(log.loc[here, "image_from_m"].iloc[0])
        inputs, side = self.side(log, tmp_path)
        estimator, met = TrpacEstimator(EstimatorConfig(inputs.vehicle, preview=side.preview)), None
        for k, sensors in enumerate(readings(inputs, 0)):
            e = estimator.step(inputs.step_s, sensors, side.left.get(k))
            if e.TRPAC_image == 0.2:
                met = inputs.position_m[k] + inputs.vehicle.cog_to_front_axle_m
                break
        assert met == pytest.approx(stamp_m, abs=0.3)

    def test_classes_without_confidence_are_left_out_and_said(self, with_classes, tmp_path):
        _, side = self.side(with_classes.drop(columns="image_confidence"), tmp_path)
        assert side.left == {}
        assert "column image_confidence is missing" in " ".join(side.warnings)

    def test_pictures_are_classified_and_a_damaged_one_is_said(self, with_classes, tmp_path):
        log = with_classes.iloc[:300].copy()
        names = np.array(["a.jpg", "b.jpg", "c.jpg"])[np.minimum(np.arange(300) // 100, 2)]
        log["image_path"] = names
        rng = np.random.default_rng(0)
        for name in ("a.jpg", "b.jpg"):
            cv2.imwrite(str(tmp_path / name), rng.integers(0, 255, (1200, 1920, 3), dtype=np.uint8))
        (tmp_path / "c.jpg").write_bytes(b"no picture")
        done, summary = estimate_log(
            read_log(save(log, tmp_path / "d.csv")), load_vehicle(TABLE_3), load_camera("paper")
        )
        assert summary["camera"] == "pictures of the log"
        assert len(done.camera.left) == len(done.camera.right) == 3
        assert sum(frame is None for frame in done.camera.left.values()) == 1
        assert any("1 of 3 pictures could not be used" in text for text in summary["warnings"])


class TestInputs:
    def test_lost_samples_hold_the_estimate(self, driven, tmp_path):
        log = driven.copy()
        log.loc[700:720, "wheel_speed_fl_rad_s"] = np.nan
        inputs = make_inputs(read_log(save(log, tmp_path / "d.csv")), load_vehicle(TABLE_3))
        done = replay(inputs)
        assert not done.usable[705:715, 0].any()
        assert done.usable[705:715, 1:].all()
        assert np.ptp(done.traces[OURS].theta[702:719, 0]) == 0.0

    def test_a_locked_wheels_torque_is_not_taken(self, tmp_path):
        log = make_frame(duration_s=4.0)
        log.loc[100:150, "wheel_speed_rl_rad_s"] = 0.0
        inputs = make_inputs(read_log(save(log, tmp_path / "d.csv")), load_vehicle(TABLE_3))
        assert np.isnan(inputs.wheel_torque_nm[101:149, 2]).all()
        assert np.isfinite(inputs.wheel_torque_nm[:, :2]).all()
        assert any("0.5 s (rl)" in text for text in inputs.warnings)

    def test_the_cars_effects_go_into_the_estimators_car(self, driven, tmp_path):
        car = load_vehicle(TABLE_3)
        heavier = car.model_copy(update={"effects": {**car.effects, "mass_offset": {"mass_kg": 200.0}}})
        inputs = make_inputs(read_log(save(driven, tmp_path / "d.csv")), heavier)
        assert inputs.vehicle.mass_kg == pytest.approx(car.mass_kg + 200.0)
        assert inputs.vehicle.rolling_resistance == pytest.approx(0.0065)

    @pytest.mark.parametrize("sigma", [0.01, 0.3])
    def test_noise_is_read_under_whatever_the_car_does(self, sigma):
        t = np.arange(0.0, 20.0, 0.01)
        signal = 15.0 + 3.0 * np.sin(t) + sigma * np.random.default_rng(3).standard_normal(len(t))
        assert white_noise(signal) == pytest.approx(sigma, rel=0.1)

    def test_a_rounded_signal_has_its_roundings_noise(self):
        t = np.arange(0.0, 20.0, 0.001)
        rounded = np.round((15.0 + 0.5 * np.sin(t)) / 0.1) * 0.1
        assert white_noise(rounded) == pytest.approx(0.1 / np.sqrt(12.0), rel=0.01)
        assert white_noise(np.ones(100)) == 0.0


def test_an_axle_with_wrong_readings_is_given_no_advice():
    said = {
        "Front wheels": "Front wheels do not have the expected radius. Adjust it.",
        "Front tyres": f"Front tyres: {WRONG_INPUT}",
        "Rear wheels": "Rear wheels do not have the expected radius. Adjust it.",
    }
    assert _trusted(said) == (said["Front tyres"], said["Rear wheels"])


class TestAxes:
    def test_an_axis_holds_its_greatest_value(self):
        values = np.array([0.0, np.nan, 3.7, 1.0])
        assert figures._end(values) == pytest.approx(1.05 * 3.7)
        assert figures._label("used friction", values) == "used friction [-]"
        assert figures._end(np.array([np.nan])) > 0.0

    def test_a_few_spikes_are_cut_off_and_the_label_says_so(self):
        values = np.append(np.ones(1000), 50.0)
        assert figures._end(values) == pytest.approx(1.05)
        assert figures._label("slip", values) == "slip, cut off at 1.1 [-]"


class TestVehicleLevel:
    LOADS = np.array([[3500.0, 3500.0, 3000.0, 3000.0]])

    def test_rows_follow_the_rule_of_the_car(self):
        theta, std = np.array([[0.3, 0.8, 0.8, 0.8]]), np.array([[0.01, 0.29, 0.29, 0.29]])
        found = vehicle_level(
            np.repeat(theta, 2, axis=0), np.repeat(std, 2, axis=0), np.repeat(self.LOADS, 2, axis=0)
        )
        wheels = tuple(Friction(t, s) for t, s in zip(theta[0], std[0], strict=True))
        rule = car_friction(wheels, tuple(self.LOADS[0]), FourWheelsConfig().axle_deviation)
        assert [(t, s) for t, s in zip(*found, strict=True)] == [pytest.approx(rule)] * 2

    def test_wheels_that_agree_are_no_surer_together(self):
        theta, std = vehicle_level(np.full((1, 4), 0.5), np.full((1, 4), 0.1), self.LOADS)
        assert theta[0] == pytest.approx(0.5)
        assert std[0] >= 0.09

    def test_the_rear_axle_counts_with_its_slippery_side(self):
        theta, _ = vehicle_level(np.array([[0.2, 0.8, 0.2, 0.8]]), np.full((1, 4), 0.01), self.LOADS)
        assert theta[0] == pytest.approx((3500 * 0.2 + 3500 * 0.8 + 6000 * 0.2) / 13000, abs=1e-6)


def test_a_score_counts_only_rows_that_have_a_reference():
    peak, reference = np.array([0.5, 0.6, 0.7, 0.9]), np.array([0.5, np.nan, 0.5, 0.5])
    found = score(peak, np.full(4, 0.15), reference, np.array([True, True, True, False]), 0.1)
    assert found.time_s == pytest.approx(0.2)
    assert (found.mean, found.mean_abs) == pytest.approx((0.1, 0.1))
    assert found.within_2_std == pytest.approx(1.0)
    assert score(peak, np.full(4, np.nan), reference, np.full(4, True), 0.1).within_2_std is None


@pytest.mark.data
def test_a_simulator_of_others_that_slides_shows_its_friction(trpac_data, tmp_path):
    """On snow at the limit, slip above 0.15, the force is near the peak: what no tyre model can get far wrong."""
    folder = trpac_data / "vehicle_logs" / "plants"
    cases = Path(__file__).parents[2] / "sim2real"
    done, _ = estimate_log(
        read_log(folder / "ocd_nominal_pulses_snow.csv", load_mapping(cases / "mappings" / "plants.yaml")),
        load_vehicle(cases / "cases" / "open_car_dynamics" / "vehicle.yaml"),
    )
    truth = pd.read_csv(folder / "ocd_nominal_pulses_snow_truth.csv")
    for i, wheel in enumerate(WHEELS):
        sliding = (done.slip[:, i] > 0.15) & done.seen[:, i]
        true = np.interp(done.inputs.time_s, truth["t"], truth[f"mu_{wheel}"])
        error = np.abs(done.traces[OURS].peak[:, i] - true)[sliding]
        assert len(error) > 50
        assert error.mean() < 0.05


@pytest.mark.data
def test_a_real_cars_log_runs_through(trpac_data, tmp_path):
    """The recorded run brakes into ABS with a torque that is only a demand: it must run, and say what it did."""
    cases = Path(__file__).parents[2] / "sim2real"
    result = run(
        trpac_data / "vehicle_logs" / "bmw_m8_roadview" / "accel_coast_absbrake.csv",
        "--vehicle",
        cases / "cases" / "bmw_m8" / "vehicle.yaml",
        "--map",
        cases / "mappings" / "bmw_m8_roadview.yaml",
        "--out",
        tmp_path / "out",
    )
    assert result.exit_code == 0, result.output
    table = pd.read_csv(tmp_path / "out" / "estimates.csv")
    assert np.isfinite(table.select_dtypes("number").to_numpy()).all()
    assert table["TRPAC"].between(0.0, 1.2 + 1e-9).all()
