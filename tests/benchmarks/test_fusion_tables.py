"""The road test's scenarios, a run in full, and the generator of lab/2026-11-29_fusion_over_many_drives.md."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from benchmarks.accuracy import fusion_tables
from benchmarks.accuracy.full_run import full_run
from benchmarks.accuracy.oracle import oracle_rows
from scenarios.figure17 import draw_figure17
from scenarios.files import load_scenario
from scenarios.plant.pipeline import drive
from scenarios.sweep.draw import plan_run, run_keys
from scenarios.sweep.execute import run_one
from scenarios.sweep.files import load_sweep
from scenarios.sweep.run import believed_config, identifiable, run_plan, step_all
from scenarios.sweep.store import Parts, identity
from scenarios.sweep.summary import summarise

ROOT = Path(__file__).parents[2]
TO_FRONT_M = 1.112


@pytest.fixture
def short_sweep(tmp_path):
    """Two runs over six metres."""
    content = {
        "schema": 1,
        "name": "short",
        "scenario": str(ROOT / "scenarios" / "paper_simulation.yaml"),
        "runs": 2,
        "road": {"stretch_m": 3.0, "friction": {"dry": [0.8, 0.9], "snow_ice": [0.2, 0.3]}},
        "pedal": {},
    }
    path = tmp_path / "short.yaml"
    path.write_text(yaml.safe_dump(content))
    return load_sweep(path)


def test_the_road_test_is_the_papers():
    scenario = load_scenario(ROOT / "scenarios" / "road_test.yaml")
    assert [(s.start_m, s.mu_left) for s in scenario.road.segments] == [(0.0, 1.0), (50.0, 0.8)]
    trajectory = drive(scenario)
    front_m = trajectory.position_m + TO_FRONT_M
    assert trajectory.time_s[np.argmax(front_m >= 50.0)] == pytest.approx(13.3, abs=0.2)
    assert trajectory.time_s[-1] == pytest.approx(20.0, abs=0.3)
    assert front_m[-1] == pytest.approx(150.0, abs=0.1)


def test_the_motors_show_nothing_of_the_road_tests_friction():
    scenario = load_scenario(ROOT / "scenarios" / "road_test.yaml")
    assert not identifiable(scenario, drive(scenario)).any()


def test_brake_pulses_show_both_parts_and_lock_no_wheel():
    scenario = load_scenario(ROOT / "scenarios" / "road_test_brakes.yaml")
    trajectory = drive(scenario)
    visible = identifiable(scenario, trajectory)
    for theta in (1.0, 0.8):
        assert visible[trajectory.theta[:, 0] == theta].sum() * scenario.step_s > 0.5
    assert trajectory.slip[trajectory.speed_m_s > 1.0, 0].max() < 0.15


def test_a_run_in_full_is_the_run_that_is_scored(short_sweep, tmp_path):
    plan = plan_run(short_sweep, run_keys(short_sweep)[0])
    full = full_run(plan)
    tracks = step_all(plan, drive(plan.scenario), believed_config(plan, {}), ["IFE", "DE", "DIFE", "robust"])
    np.testing.assert_array_equal(full.table["TRPAC"], tracks.by_name["robust"].TRPAC)
    np.testing.assert_array_equal(full.table["excitation_flag"], tracks.excited)
    draw_figure17(full, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_is_written_between_its_markers(short_sweep, tmp_path, monkeypatch):
    parts = Parts(tmp_path / "out" / "paper_simulation", identity(short_sweep))
    parts.open()
    for key in run_keys(short_sweep):
        parts.keep(key.index, run_one(short_sweep, key).rows, 0.25)
    page = tmp_path / "fusion.md"
    begin, end = "<!-- measured: begin -->", "<!-- measured: end -->"
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    monkeypatch.setattr(fusion_tables, "PAGE", page)
    monkeypatch.setattr(fusion_tables, "draw", lambda found: None)
    for _ in range(2):
        fusion_tables.write(tmp_path / "out")
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    assert "paper_simulation 2 of 2" in text
    assert "0.25 s (class_process)" in text
    table = parts.table()
    found = summarise(table)["levels"][0]["estimators"]["DIFE"]["coverage"]["all_time"]
    shares = [
        float(line.split("|")[4])
        for line in text.splitlines()
        if line.startswith("| paper_simulation | DIFE | all")
    ]
    assert shares == [pytest.approx(found, abs=1e-3)]


def test_the_oracle_beats_the_estimator_where_the_tyre_shows_the_road():
    sweep = load_sweep(fusion_tables.SWEEPS / "methods.yaml")
    plan = plan_run(sweep, run_keys(sweep)[0])
    told = [row for row in oracle_rows(plan) if row["surface"] != "dry"]
    ours = [
        row for row in run_plan(plan, ["DIFE"], {}) if row["surface"] != "dry" and row["estimator"] == "DIFE"
    ]
    for best, other in zip(told, ours, strict=True):
        assert best["steady_state_error"] < 0.003
        assert best["shown_convergence_time_s"] < other["shown_convergence_time_s"]


def test_the_papers_road_stands_beside_the_oracle(monkeypatch):
    monkeypatch.setattr(fusion_tables, "ORACLE_RUNS", 1)
    sweep = load_sweep(fusion_tables.SWEEPS / "methods.yaml")
    rows = run_plan(plan_run(sweep, run_keys(sweep)[0]), ["DE", "robust"], {})
    table = fusion_tables.papers_road({"table": pd.DataFrame(rows)})
    assert [line.split(" | ")[0].strip("| ") for line in table.splitlines()[2:]] == ["DE", "robust", "oracle"]
