"""`trpac log check`: what is shown of a log, what is written, and the exit codes."""

import cv2
import numpy as np
import pytest
import yaml
from command_line import run, words
from gap_drives import BARE, clean, noisy, trace
from gap_files import write_log
from log_maker import make_frame, save

import trpac
from sim2real.logs import load_mapping, read_log
from sim2real.logs.proposal import candidates, proposed_mapping
from sim2real.logs.table import Table

WHEELS = {"fl": "VL", "fr": "VR", "rl": "HL", "rr": "HR"}
GERMAN = {"time_s": "Zeit [s]", "vehicle_speed_m_s": "Geschw [km/h]", "accel_x_m_s2": "Beschl_x [m/s²]"}
GERMAN |= {f"wheel_speed_{w}_rad_s": f"Drehzahl {theirs} [1/min]" for w, theirs in WHEELS.items()}
GERMAN |= {f"wheel_torque_{w}_nm": f"Moment {theirs} [Nm]" for w, theirs in WHEELS.items()}


@pytest.fixture
def frame():
    return make_frame()


@pytest.fixture
def german(frame, tmp_path):
    theirs = frame.drop(columns="position_m").rename(columns=GERMAN)
    theirs["Geschw [km/h]"] *= 3.6
    for name in theirs:
        if name.endswith("[1/min]"):
            theirs[name] *= 30.0 / np.pi
    theirs.to_csv(tmp_path / "messung.csv", sep=";", decimal=",", index=False, encoding="cp1252")
    return tmp_path / "messung.csv"


def test_a_plain_log_is_fit(frame, tmp_path):
    done = run("log", "check", save(frame, tmp_path / "log.csv"))
    assert done.exit_code == 0
    text = words(done.output)
    assert "301 rows, read as: plain table" in text
    assert "For trpac estimate: usable." in text
    assert "For trpac gap diagnose: usable." in text


@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_with_a_car_file_the_torque_is_compared(factor, tmp_path):
    driven = noisy(clean(trace((0.0, 560.0), (3.5, 440.0), (5.0, 0.0), duration_s=5.0), 3.0))
    logged = {f"wheel_torque_{w}_nm": factor * driven.torque_nm[:, i] for i, w in enumerate(WHEELS)}
    write_log(driven, tmp_path / "log.csv", **logged)
    (tmp_path / "car.yaml").write_text(yaml.safe_dump(BARE.model_dump(by_alias=True)), encoding="utf-8")
    done = run("log", "check", tmp_path / "log.csv", "--vehicle", tmp_path / "car.yaml")
    assert done.exit_code == 0, done.output
    text = words(done.output)
    assert ("For trpac estimate: usable." in text) == (factor == 1.0)
    assert ("readable, but the torque does not fit the car" in text) == (factor > 1.0)
    assert ("The logged torque would accelerate this car at 1" in text) == (factor > 1.0)
    assert "--vehicle" not in text


def test_a_mapping_is_proposed_corrected_by_nobody_and_good(frame, german, tmp_path):
    proposed, picture, out = tmp_path / "map.yaml", tmp_path / "a.png", tmp_path / "normal.parquet"
    done = run("log", "check", german, "--propose", proposed, "--out", out, "--picture", picture)
    assert done.exit_code == 1
    assert "required columns missing: time_s" in words(done.output)
    assert not out.exists()
    assert picture.exists()
    assert set(load_mapping(proposed).columns) == set(GERMAN)
    assert "# position_m: {integrate: {copy: vehicle_speed_m_s}}" in proposed.read_text(encoding="utf-8")
    done = run("log", "check", german, "--map", proposed, "--out", out, "--picture", picture)
    assert done.exit_code == 0, done.output
    text = words(done.output)
    assert "read as: CP1252; semicolons; decimal comma" in text
    assert "vehicle_speed_m_s Geschw [km/h] km/h 0.277778 100" in text
    assert "usable on a road of one stretch, since no position is measured" in text
    log = read_log(out)
    assert log.warnings == ()
    for name in set(log.signals) - {"position_m"}:
        assert np.allclose(log.signals[name], frame[name], rtol=1e-12), name
    assert cv2.imread(str(picture)).shape[0] > 500


def test_a_column_is_proposed_for_its_own_wheel_and_quantity_alone(tmp_path):
    names = (
        "Time",
        "Speed",
        "Yaw angle",
        "Motor torque limit FL",
        "Wheel speed rear left",
        "WhlTrqFR",
        "pressure",
    )
    table = Table(
        names,
        {},
        {},
        np.arange(0),
        units={"Speed": "km/h", "Wheel speed rear left": "km/h", "WhlTrqFR": "bar"},
    )
    found = {name: one.column for name, one in candidates(table).items()}
    assert found == {
        "time_s": "Time",
        "vehicle_speed_m_s": "Speed",
        "wheel_torque_fl_nm": "Motor torque limit FL",
        "wheel_speed_rl_rad_s": "Wheel speed rear left",
    }
    text = proposed_mapping(table, "a.csv")
    assert 'wheel_speed_rl_rad_s: {column: "Wheel speed rear left", radius_m: RADIUS}   # in km/h' in text
    assert "  # wheel_torque_fr_nm: {column: NAME, unit: UNIT}   # no column found" in text


def test_torques_of_engine_and_brake_are_proposed_as_sums(tmp_path):
    names = ("t", "engine_torque_at_wheels", "brake_torque_demand", "engine_torque_limit", "net_torque")
    text = proposed_mapping(Table(names, {}, {}, np.arange(0)), "a.csv")
    for wheel in ("fl", "fr", "rl", "rr"):
        assert (
            f'  # wheel_torque_{wheel}_nm: {{sum: [{{column: "engine_torque_at_wheels", unit: Nm, scale: SHARE}}, '
            '{column: "brake_torque_demand", unit: Nm, scale: SHARE}]}'
        ) in text
    filled = tmp_path / "map.yaml"
    filled.write_text(
        "\n".join(
            line.replace("# wheel_torque", "wheel_torque").replace("SHARE}", "0.25}")
            for line in text.splitlines()
        )
    )
    assert "wheel_torque_fl_nm" in load_mapping(filled).columns
    assert "only needed for a road of several stretches" in text


def test_without_propose_the_mapping_is_shown_and_nothing_written(german, tmp_path):
    before = sorted(tmp_path.iterdir())
    done = run("log", "check", german)
    assert done.exit_code == 1
    assert 'wheel_speed_rl_rad_s: {column: "Drehzahl HL [1/min]"} # in 1/min' in words(done.output)
    assert sorted(tmp_path.iterdir()) == before


def test_the_python_package_uses_no_proposal_by_itself(german):
    with pytest.raises(trpac.TrpacError, match="required columns missing"):
        trpac.read_log(german)


def test_what_is_odd_is_told(frame, tmp_path):
    frame.loc[10:14, "wheel_speed_fl_rad_s"] = 655.35
    frame.loc[100, "time_s"] = frame.loc[99, "time_s"]
    done = run("log", "check", save(frame, tmp_path / "log.csv"))
    assert done.exit_code == 0
    text = words(done.output)
    assert "5 samples from row 12 on are 655.35" in text
    assert "row 102 repeats the time above" in text
    assert "wheel_speed_fl_rad_s 100 2.0%" in text


@pytest.mark.parametrize(
    ("content", "said"), [(None, "No such file"), (b"", "is empty"), (b"PAR1", "cannot be read as Parquet")]
)
def test_what_cannot_be_read(tmp_path, content, said):
    path = tmp_path / "log.csv" if content != b"PAR1" else tmp_path / "log.parquet"
    if content is not None:
        path.write_bytes(content)
    done = run("log", "check", path, "--picture", tmp_path / "a.png", "--propose", tmp_path / "map.yaml")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "a.png").exists()
    assert not (tmp_path / "map.yaml").exists()
