"""`trpac run --compare-camera` on the real unit: the report's first picture, the summary, the printed sentence."""

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
import yaml
from long import long
from report_page import require_report
from typer.testing import CliRunner

from scenarios.brake_onset import compare
from scenarios.files import load_scenario
from trpac_cli.main import app

ROOT = Path(__file__).parents[2] / "scenarios"


@pytest.fixture
def short_scenario(tmp_path):
    """A launch, a border after 3 m and a brake, through a camera of a quarter of the size."""
    camera = yaml.safe_load((ROOT / "cameras" / "paper.yaml").read_text())
    for key in ("fx_px", "fy_px", "cx_px", "cy_px"):
        camera[key] /= 4
    camera |= {"width_px": 480, "height_px": 300}
    files = {
        "camera.yaml": camera,
        "road.yaml": {
            "schema": 1,
            "segments": [
                {"start_m": start_m, "mu_left": mu, "mu_right": mu, "surface": surface}
                for start_m, mu, surface in ((0.0, 0.9, "dry"), (3.0, 0.2, "snow_ice"))
            ],
        },
        "manoeuvre.yaml": {
            "schema": 1,
            "name": "launch and brake",
            "pulses": [
                {"start_s": 0.02, "end_s": 1.2, "torque_nm": 300.0, "ramp_s": 0.05},
                {"start_s": 1.7, "end_s": 4.0, "torque_nm": -150.0, "ramp_s": 0.05},
            ],
        },
        "scenario.yaml": {
            "schema": 1,
            "name": "short <i>",
            "vehicle": str(ROOT / "vehicles" / "four_in_wheel_motor_ev.yaml"),
            "road": "road.yaml",
            "camera": "camera.yaml",
            "manoeuvre": "manoeuvre.yaml",
            "step_s": 0.002,
            "end": {"position_m": 9.0, "time_s": 1.9},
            "sensors": {"vehicle_speed_noise_m_s": 0.003, "wheel_speed_noise_rad_s": 0.01},
            "pictures": {"disturbance": "paper", "fps": 10.0},
        },
    }
    for name, content in files.items():
        (tmp_path / name).write_text(yaml.safe_dump(content))
    return tmp_path / "scenario.yaml"


@pytest.mark.e2e
def test_the_report_begins_with_the_brake_onset(short_scenario, unit_file, tmp_path):
    out = tmp_path / "out"
    given = ["run", str(short_scenario), "--compare-camera", str(short_scenario), "--fmu", str(unit_file)]
    result = CliRunner().invoke(app, [*given, "--out", str(out)])
    assert result.exit_code == 0, result.output
    names = ["brake_onset.png", "figure17.png", "log.csv", "report.html", "summary.json"]
    assert sorted(p.name for p in out.iterdir()) == names
    (onset,) = json.loads((out / "summary.json").read_text())["brake_onset"]
    assert onset["true_friction"] == 0.2
    log = pd.read_csv(out / "log.csv")  # of the same scenario with its camera
    last = log[log["time_s"] <= 1.7 + 1e-9].iloc[-1]
    for name in ("TRPAC", "TRPAC_low", "TRPAC_high"):
        assert onset["with_camera"][name] == pytest.approx(last[name])
    assert {"TRPAC", "TRPAC_low", "TRPAC_high", "planned_stop_m"} <= set(onset["with_camera"])
    assert onset["simulated_stop_m"] > 0.9 * onset["shortest_stop_m"]
    report = require_report((out / "report.html").read_text()).source
    assert report.count("data:image/") == 2
    assert report.index("<img") < report.index("At brake onset") < report.index("Scores per stretch of road")
    assert "At brake onset" in result.output


@long
@pytest.mark.e2e
def test_on_rendered_snow_trpac_is_lower_with_the_camera_before_the_brakes_act(unit_file, tmp_path):
    scenario = load_scenario("cruise_onto_snow")
    short = replace(scenario, seed=2, end=scenario.end.model_copy(update={"time_s": 7.6}))
    onset = compare(short, unit_file, tmp_path / "frames").onset
    assert onset.with_camera.TRPAC < 0.4 < 0.6 < onset.without_camera.TRPAC
