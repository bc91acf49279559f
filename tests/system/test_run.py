"""A scenario through the command line, from files to report, on the real unit."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import schemas
import yaml
from report_page import require_report
from typer.testing import CliRunner

from fmu_src.kinds import NATIVE, build
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.errors import ScenarioError
from scenarios.files import load_scenario
from scenarios.fmu_client.estimator import INPUTS, run_unit
from scenarios.pictures import frame_name, record
from scenarios.plant.pipeline import drive
from scenarios.runner import run_scenario
from trpac_cli.main import app
from trpac_core.errors import TrpacError
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors

ROOT = Path(__file__).parents[2]

SHORT_ROAD = {
    "schema": 1,
    "segments": [
        {"start_m": 0.0, "mu_left": 0.9, "mu_right": 0.9, "surface": "dry"},
        {"start_m": 4.0, "mu_left": 0.3, "mu_right": 0.3, "surface": "snow_ice"},
    ],
}
STRANGE = "short <i>$x_{$ [/bold]"
"""A name that is no markup, no mathematics and no HTML."""
SCORE_KEYS = {
    "start_m",
    "theta",
    "steady_state_error",
    "max_error_after_convergence",
    "convergence_time_s",
    "wall_convergence_time_s",
    "excited_time_s",
}
PULSES = {
    "schema": 1,
    "name": "launch and pulse",
    "pulses": [
        {"start_s": 0.02, "end_s": 1.3, "torque_nm": 300.0, "ramp_s": 0.05},
        {"start_s": 1.7, "end_s": 2.4, "torque_nm": 250.0, "ramp_s": 0.05},
    ],
}


@pytest.fixture
def scenario_file(tmp_path):
    """Seven metres of road, a quarter of the paper's picture size."""
    root = ROOT / "scenarios"
    camera = yaml.safe_load((root / "cameras" / "paper.yaml").read_text())
    for key in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"):
        camera[key] = camera[key] / 4
    camera |= {"width_px": 480, "height_px": 300}
    files = {
        "camera.yaml": camera,
        "road.yaml": SHORT_ROAD,
        "manoeuvre.yaml": PULSES,
        "vehicle.yaml": yaml.safe_load((root / "vehicles" / "four_in_wheel_motor_ev.yaml").read_text()),
        "scenario.yaml": {
            "schema": 1,
            "name": STRANGE,
            "vehicle": "vehicle.yaml",
            "road": "road.yaml",
            "camera": "camera.yaml",
            "manoeuvre": "manoeuvre.yaml",
            "step_s": 0.001,
            "end": {"position_m": 9.0, "time_s": 2.6},
            "sensors": {"vehicle_speed_noise_m_s": 0.003, "wheel_speed_noise_rad_s": 0.01},
            "pictures": {"disturbance": "paper", "fps": 10.0},
            "seed": 4,
        },
    }
    for name, content in files.items():
        (tmp_path / name).write_text(yaml.safe_dump(content))
    return tmp_path / "scenario.yaml"


@pytest.mark.e2e
def test_run_writes_report_figure_log_and_scores(scenario_file, unit_file, tmp_path):
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["run", str(scenario_file), "--fmu", str(unit_file), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.iterdir()) == ["figure17.png", "log.csv", "report.html", "summary.json"]
    summary = json.loads((out / "summary.json").read_text())
    schemas.validate("run_summary", summary)
    assert set(summary["estimators"]) == {"IFE", "DE", "robust"}
    assert {"fmu_sha256", "seed", "versions"} <= set(summary)
    for scores in summary["estimators"].values():
        assert [set(score) for score in scores] == [SCORE_KEYS, SCORE_KEYS]
    slippery = summary["estimators"]["robust"][1]
    assert slippery["theta"] == 0.3
    assert slippery["steady_state_error"] < 0.02
    log = pd.read_csv(out / "log.csv")
    assert {"time_s", "TRPAC", "flag", "K_v", "theta_true"} <= set(log.columns)
    assert np.isfinite(log["TRPAC"]).all()
    page = require_report((out / "report.html").read_text())
    assert "short &lt;i&gt;" in page.source
    assert "<i>" not in page.source
    assert page.source.count("data:image/") == 1
    assert len(page.specs) == 7
    assert page.verdict in " ".join(result.stdout.split())
    assert page.verdict.startswith(
        "0.9 stretch from 0 m: not known, the wheel torque was too small to show it"
    )


@pytest.mark.e2e
@pytest.mark.parametrize("method", ["as_printed", "robust"])
def test_another_method_is_that_of_the_unit_and_of_the_report(scenario_file, unit_file, tmp_path, method):
    """Without pictures: the unit's outputs are those of the core over the log's own signals."""
    content = yaml.safe_load(scenario_file.read_text())
    del content["camera"], content["pictures"]
    scenario_file.write_text(yaml.safe_dump(content))
    out = tmp_path / "out"
    command = ["run", str(scenario_file), "--fmu", str(unit_file), "--method", method, "--out", str(out)]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    summary, log = json.loads((out / "summary.json").read_text()), pd.read_csv(out / "log.csv")
    title = Method.of(method).title
    assert (summary["method"], list(summary["estimators"])) == (method, ["IFE", "DE", title])
    assert title in result.output
    assert "DIFE" not in result.output
    page = require_report((out / "report.html").read_text())
    assert "no picture gave a class of the road under the wheel" in page.text
    assert "the camera's class is not used" in page.text
    assert len(page.specs) == 4 + log["excitation_flag"].any()
    scenario = load_scenario(scenario_file)
    noise = scenario.sensors
    config = EstimatorConfig(
        scenario.vehicle.to_core(),
        method=Method.of(method),
        torque_noise_nm=noise.wheel_torque_noise_nm,
        sliding_speed_noise_m_s=float(
            np.hypot(
                noise.vehicle_speed_noise_m_s, scenario.vehicle.wheel_radius_m * noise.wheel_speed_noise_rad_s
            )
        ),
    )
    core = TrpacEstimator(config)
    for row in log.itertuples():
        estimate = core.step(
            0.001,
            Sensors(
                row.wheel_speed_fl_rad_s,
                row.wheel_torque_fl_nm,
                row.vehicle_speed_m_s,
                longitudinal_acceleration_m_s2=row.accel_x_m_s2 or None,
            ),
        )
    last = log.iloc[-1]
    for name in ("TRPAC", "TRPAC_low", "TRPAC_high", "TRPAC_expected", "TRPAC_expected_std"):
        assert last[name] == pytest.approx(getattr(estimate, name), rel=1e-9)
    assert last["TRPAC_source"] == estimate.source


@pytest.mark.e2e
def test_pictures_are_classified_beside_a_native_unit_whose_outputs_are_the_same_bits(
    scenario_file, unit_file, native_file, tmp_path
):
    """All but the confidence where the flag is down: by bus it is then no more than the threshold."""
    scenario = load_scenario(scenario_file)
    python, native = (run_scenario(scenario, unit, tmp_path / "frames") for unit in (unit_file, native_file))
    down = ~python.table["flag"]
    kept = python.table["image_confidence"].mask(down, np.minimum(python.table["image_confidence"], 0.5))
    expected = python.table.assign(image_confidence=kept)
    pd.testing.assert_frame_equal(native.table, expected, check_exact=True)
    assert set(python.table["flag"]) == {False, True}
    assert python.table["TRPAC_image"].nunique() > 1


@pytest.mark.e2e
def test_a_wrong_setting_or_picture_of_a_native_unit_is_said(native_file, tmp_path):
    frames = pd.DataFrame({"row": [0], "path": [str(tmp_path / "none.jpg")], "frame": [1]})
    with pytest.raises(TrpacError, match=r"none\.jpg"):
        run_unit(native_file, {}, ONE_ROW, frames, 0.001)
    with pytest.raises(TrpacError, match=r"camera\.fx"):
        run_unit(native_file, {"camera.fx": -1.0}, ONE_ROW, frames, 0.001)


@pytest.mark.long
@pytest.mark.e2e
def test_a_run_repeats_bit_by_bit(scenario_file, unit_file, tmp_path):
    scenario = load_scenario(scenario_file)
    first, second = (run_scenario(scenario, unit_file, tmp_path / name) for name in ("a", "b"))
    pd.testing.assert_frame_equal(first.table, second.table, check_exact=True)
    assert first.summary == second.summary


@pytest.mark.long
@pytest.mark.e2e
def test_pictures_are_of_the_place_and_repeat(scenario_file, tmp_path):
    scenario = load_scenario(scenario_file)
    trajectory = drive(scenario)
    once, again = (record(scenario, trajectory, tmp_path / name) for name in ("a", "b"))
    assert list(once["frame"]) == list(again["frame"])
    assert len(once) == len(trajectory) // 100 + 1
    front = trajectory.position_m + scenario.vehicle.to_core().cog_to_front_axle_m
    assert once["front_axle_m"].to_numpy() == pytest.approx(front[once["row"]])
    for number in (1, len(once)):
        first, second = ((tmp_path / name / frame_name(number)).read_bytes() for name in ("a", "b"))
        assert first == second


@pytest.mark.parametrize(
    ("edit", "named"),
    [
        ({"road": "elsewhere.yaml"}, "elsewhere.yaml"),
        ({"stepp_s": 0.001}, "step_s"),
        ({"step_s": -1.0}, "step_s"),
    ],
)
def test_unusable_scenarios_end_with_one_message_and_nothing_written(scenario_file, tmp_path, edit, named):
    content = yaml.safe_load(scenario_file.read_text()) | edit
    scenario_file.write_text(yaml.safe_dump(content))
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["run", str(scenario_file), "--out", str(out)])
    assert result.exit_code == 2
    assert named in result.stderr
    assert not out.exists()


def test_a_missing_unit_is_said(scenario_file, tmp_path):
    arguments = [
        "run",
        str(scenario_file),
        "--fmu",
        str(tmp_path / "none.fmu"),
        "--out",
        str(tmp_path / "out"),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "none.fmu" in result.stderr
    assert "such as `trpac fmu build` makes" in result.stderr


ONE_ROW = pd.DataFrame({name: [1.0] for name in INPUTS})
NO_FRAMES = pd.DataFrame({"row": [], "path": [], "frame": []})


def test_another_unit_of_ours_is_said(tmp_path):
    archive = build_unit(UNITS["TrpacEstimator4W"], tmp_path / "other.fmu")
    with pytest.raises(ScenarioError, match=r"other\.fmu: is TrpacEstimator4W; expected TrpacEstimator"):
        run_unit(archive, {}, ONE_ROW, NO_FRAMES, 0.001)


def test_a_unit_for_another_version_of_fmi_is_said(native_file, tmp_path):
    archive = build("TrpacEstimator", tmp_path, kind=NATIVE, fmi=3, everywhere=False)
    with pytest.raises(ScenarioError, match=r"_fmi3\.fmu: is for FMI 3\.0; expected a unit for FMI 2\.0"):
        run_unit(archive, {}, ONE_ROW, NO_FRAMES, 0.001)


def test_settings_that_the_unit_refuses_are_said(unit_file):
    with pytest.raises(ScenarioError, match="refuses the scenario's settings or a step"):
        run_unit(unit_file, {"tyre.longitudinal_stiffness": 1.0}, ONE_ROW, NO_FRAMES, 0.001)


def test_an_output_that_is_a_file_is_said_before_the_work(scenario_file, tmp_path):
    out = tmp_path / "out"
    out.write_text("mine")
    result = CliRunner().invoke(app, ["run", str(scenario_file), "--out", str(out)])
    assert result.exit_code == 2
    assert out.read_text() == "mine"
