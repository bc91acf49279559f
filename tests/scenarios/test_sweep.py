"""`trpac sweep`: files, draws, resuming, workers, report."""

import json
import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from distributed import Client, LocalCluster
from long import long
from report_page import require_report
from typer.testing import CliRunner

from scenarios.errors import ScenarioError
from scenarios.plant.pipeline import drive
from scenarios.sweep import execute as execute_module
from scenarios.sweep.camera import CERTAIN, measured_process, road_classes
from scenarios.sweep.draw import plan_run, run_keys
from scenarios.sweep.execute import execute, run_one
from scenarios.sweep.files import load_sweep
from scenarios.sweep.run import believed_config, run_plan, step_all
from scenarios.sweep.store import Parts, as_table, identity, write_table
from scenarios.sweep.summary import distribution, quantile, summarise
from scenarios.sweep.trackers import make_peer
from trpac_cli.main import app
from trpac_core.vision.classes import Surface

ROOT = Path(__file__).parents[2]
SCENARIO = ROOT / "scenarios" / "paper_simulation.yaml"
SHORT = {
    "schema": 1,
    "name": "short",
    "scenario": str(SCENARIO),
    "runs": 4,
    "seed": 5,
    "road": {"stretch_m": 3.0, "friction": {"dry": [0.7, 1.0], "snow_ice": [0.2, 0.35]}},
    "pedal": {},
}


@pytest.fixture
def sweep_of(tmp_path):
    """Writes a sweep file with these changes and reads it."""

    def make(**changes):
        path = tmp_path / "sweep.yaml"
        path.write_text(yaml.safe_dump(SHORT | changes))
        return load_sweep(path, allow_code=True)

    return make


class FixedPeer:
    """A plug-in that always says the same."""

    name = "fixed"

    def __init__(self, told):
        self.told = told

    def reset(self):
        self.steps = 0

    def step(self, step_s, sensors):
        self.steps += 1
        return self

    TRPAC, TRPAC_std, excited = 0.5, 0.1, True


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"runz": 3}, "runs"),
        ({"runs": 0}, "runs"),
        ({"scenario": "elsewhere.yaml"}, "elsewhere.yaml"),
        ({"pedal": None}, "pedal"),
        ({"estimators": ["DIFFE"]}, "DIFE"),
        ({"estimators": ["no.such.module:Peer"]}, "no.such.module"),
        ({"estimators": ["DE", "DE"]}, "twice"),
        ({"vary": [{"parameter": "believed.mas_factor", "levels": [1.0]}]}, "believed.mass_factor"),
        ({"vary": [{"parameter": "camera.lost_share", "levels": [1.5]}]}, "camera.lost_share"),
        ({"believed": {"mass_factor": {"uniform": [2.0, 1.0]}}}, "lowest, highest"),
        ({"believed": {"mass_factor": {"uniform": [0.9, 1.1], "choice": [1.0]}}}, "exactly one"),
        ({"road": {"friction": {"dry": [0.9, 2.0]}}}, "friction.dry"),
        ({"unit": {"estimator.gama": 2.0}}, "estimator.gamma"),
        ({"camera": {"source": "rendered", "confidence_factor": 0.5}}, "confidence_factor"),
    ],
)
def test_an_unusable_sweep_ends_with_one_message_and_nothing_written(changes, named, tmp_path):
    path, out = tmp_path / "sweep.yaml", tmp_path / "out"
    path.write_text(yaml.safe_dump(SHORT | changes))
    result = CliRunner().invoke(app, ["sweep", str(path), "--out", str(out)])
    assert result.exit_code == 2
    assert result.stderr.startswith("trpac sweep: ")
    assert named in result.stderr
    assert not out.exists()


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios" / "sweeps").glob("*.yaml")), ids=lambda p: p.stem)
def test_the_shipped_sweeps_can_be_read(path):
    sweep = load_sweep(path)
    assert len(run_keys(sweep)) >= sweep.file.runs


def test_a_run_is_the_same_whatever_was_drawn_before(sweep_of):
    sweep = sweep_of()
    keys = run_keys(sweep)
    alone = plan_run(sweep, keys[3])
    in_order = [plan_run(sweep, key) for key in keys][3]
    assert alone == in_order
    assert plan_run(sweep, keys[2]).scenario.road != alone.scenario.road


def test_levels_share_road_pedal_and_noise(sweep_of):
    sweep = sweep_of(vary=[{"parameter": "believed.mass_factor", "levels": [0.9, 1.1]}])
    keys = run_keys(sweep)
    assert [key.index for key in keys] == list(range(8))
    low, high = plan_run(sweep, keys[1]), plan_run(sweep, keys[5])
    assert (low.believed.mass_factor, high.believed.mass_factor) == (0.9, 1.1)
    assert low.scenario == high.scenario
    assert low.camera_seed == high.camera_seed


def test_drawn_friction_stays_within_each_classs_range_and_orders_differ(sweep_of):
    sweep = sweep_of(runs=40)
    roads = [plan_run(sweep, key).scenario.road.segments for key in run_keys(sweep)]
    for segments in roads:
        for segment in segments:
            low, high = SHORT["road"]["friction"][segment.surface]
            assert low <= segment.mu_left <= high
    assert len({tuple(s.surface for s in segments) for segments in roads}) == 2


def test_the_driver_excites_slippery_roads_and_lets_a_spinning_wheel_go(sweep_of):
    friction = {"dry": [0.8, 0.8], "snow_ice": [0.1, 0.3]}
    sweep = sweep_of(runs=6, road={"stretch_m": 12.0, "friction": friction})
    for key in run_keys(sweep):
        scenario = plan_run(sweep, key).scenario
        trajectory = drive(scenario)
        assert scenario.manoeuvre.peak_torque_nm() <= scenario.vehicle.motor_peak_torque_nm
        assert trajectory.position_m[-1] + 1.112 >= scenario.end.position_m - 0.1
        slippery = trajectory.theta[:, 0] < 0.5
        used = trajectory.tyre_force_n[:, 0] / trajectory.vertical_load_n[:, 0] / trajectory.theta[:, 0]
        assert used[slippery].max() > 0.65
        spinning = (trajectory.slip[:, 0] > 0.3) & (trajectory.speed_m_s > 1.0)
        assert spinning.sum() * scenario.step_s < 0.6


def test_the_camera_process_gives_what_was_measured(sweep_of):
    """Wrong verdicts as often as in the records, over many runs on one surface."""
    process = measured_process()
    shares = [
        np.mean(record.given != int(surface))
        for world in process.worlds
        for surface, record in world.items()
        if surface == Surface.SNOW_ICE
    ]
    sweep = sweep_of(runs=1, road={"stretch_m": 30.0, "friction": {"snow_ice": [0.3, 0.3]}})
    plan = plan_run(sweep, run_keys(sweep)[0])
    trajectory = drive(plan.scenario)
    moved = np.flatnonzero(trajectory.speed_m_s > 1.0)[0]
    found = []
    for seed in range(300):
        verdicts = road_classes(plan.scenario, trajectory, plan.camera, seed)
        found.append(np.mean([v.surface != Surface.SNOW_ICE for row, v in verdicts.items() if row > moved]))
    assert np.mean(found) == pytest.approx(np.mean(shares), abs=0.06)


def test_the_camera_sees_the_road_that_lies_ahead(sweep_of):
    sweep = sweep_of(
        runs=1, road={"stretch_m": 12.0, "order": "as_listed", "friction": SHORT["road"]["friction"]}
    )
    plan = plan_run(sweep, run_keys(sweep)[0])
    trajectory = drive(plan.scenario)
    clean = replace(
        measured_process(),
        worlds=tuple(
            {s: record._replace(given=np.full(4, int(s)), Q_v=np.ones(4)) for s, record in world.items()}
            for world in measured_process().worlds
        ),
    )
    verdicts = road_classes(plan.scenario, trajectory, plan.camera, 1, clean)
    front = trajectory.position_m + plan.scenario.vehicle.to_core().cog_to_front_axle_m
    for row, verdict in verdicts.items():
        assert verdict.surface == (Surface.DRY if front[row] + 3.5 < 12.0 else Surface.SNOW_ICE)


def test_disturbances_of_the_camera_do_what_they_say(sweep_of):
    plan = plan_run(*(lambda s: (s, run_keys(s)[0]))(sweep_of()))
    trajectory = drive(plan.scenario)
    plain = road_classes(plan.scenario, trajectory, plan.camera, 3)
    late = road_classes(plan.scenario, trajectory, replace(plan.camera, late_s=0.25), 3)
    assert sorted(late) == [row + 250 for row in sorted(plain)]
    lost = road_classes(plan.scenario, trajectory, replace(plan.camera, lost_share=0.5), 3)
    assert set(lost) < set(plain)
    assert 0.25 * len(plain) < len(lost) < 0.75 * len(plain)
    assert {row: plain[row] for row in lost} == lost
    wrong = road_classes(plan.scenario, trajectory, replace(plan.camera, wrong_share=1.0), 3)
    front = trajectory.position_m + plan.scenario.vehicle.to_core().cog_to_front_axle_m
    for row, verdict in wrong.items():
        assert verdict.surface != plan.scenario.road.segment_at(front[row] + 3.5).surface_class
        assert verdict.confidence == CERTAIN
    unsure = road_classes(plan.scenario, trajectory, replace(plan.camera, confidence_factor=0.0), 3)
    assert {v.confidence for v in unsure.values()} == {0.0}


def test_with_the_flag_down_fusion_is_the_dynamics_estimator(sweep_of):
    sweep = sweep_of(camera={"confidence_factor": 0.0, "wrong_share": 1.0})
    plan = plan_run(sweep, run_keys(sweep)[0])
    trajectory = drive(plan.scenario)
    tracks = step_all(plan, trajectory, believed_config(plan, {}), ["DE", "DIFE"])
    np.testing.assert_array_equal(tracks.by_name["DIFE"].TRPAC, tracks.by_name["DE"].TRPAC)


def test_the_estimator_believes_what_the_sweep_says(sweep_of):
    believed = {"mass_factor": 1.1, "radius_factor": 0.95, "stiffness_factor": 0.9}
    sweep = sweep_of(believed=believed, sensors={"noise_factor": 2.0}, camera={"class_value_offset": -0.2})
    plan = plan_run(sweep, run_keys(sweep)[0])
    config = believed_config(plan, {"estimator.gamma": 3.0})
    true = plan.scenario.vehicle.to_core()
    assert config.vehicle.mass_kg == pytest.approx(1.1 * true.mass_kg)
    assert config.vehicle.wheel_radius_m == pytest.approx(0.95 * true.wheel_radius_m)
    assert config.vehicle.longitudinal_stiffness_n == pytest.approx(0.9 * true.longitudinal_stiffness_n)
    assert config.gains.gamma == 3.0
    assert config.class_theta == pytest.approx((0.6, 0.4, 0.02))
    assert config.sliding_speed_noise_m_s == pytest.approx(2.0 * np.hypot(0.003, 0.29 * 0.01))


@pytest.mark.parametrize("number", [15, 20, 22, 28, 56])
def test_what_a_brake_pulse_showed_is_not_lost_to_noise(number):
    """Drives on which DE once took noise on the elastic line for sliding and fell from 1.0 to 0.64.

    Within the first pulse of 0.375 s: the road is known while the tyre shows it, and stays known. Excited time says
    little here, for drive pulses count in it and show nothing.
    """
    sweep = load_sweep(ROOT / "scenarios" / "sweeps" / "road_test_brakes.yaml")
    rows = [r for r in run_plan(plan_run(sweep, run_keys(sweep)[number]), ["DE"], {}) if r["stretch"] == 0]
    assert rows[0]["shown_convergence_time_s"] < 0.3 < rows[0]["convergence_time_s"]
    assert rows[0]["steady_state_error"] < 0.005


def test_a_plugged_in_estimator_is_scored_beside_ours(sweep_of):
    sweep = sweep_of(estimators=["DIFE", f"{__name__}:FixedPeer"], runs=1)
    rows = run_one(sweep, run_keys(sweep)[0]).rows
    fixed = [row for row in rows if row["estimator"].endswith("FixedPeer")]
    assert len(fixed) == 2
    assert [row["error_end"] for row in fixed] == pytest.approx([0.5 - row["theta"] for row in fixed])
    assert all(row["std_end"] == 0.1 for row in fixed)


def test_a_plug_in_of_the_wrong_shape_is_named():
    with pytest.raises(TypeError, match="name, reset and step"):
        make_peer("builtins:str", None)


def test_table_parts_and_resuming(sweep_of, tmp_path):
    """What is there is not run again; what was lost is; the table is the same."""
    sweep, out = sweep_of(runs=3), tmp_path / "out"
    parts = Parts(out, identity(sweep))
    assert parts.open() == set()
    for key in reversed(run_keys(sweep)):
        parts.keep(key.index, run_one(sweep, key).rows, 0.1)
    first = parts.table()
    kept = {path.name: path.stat().st_mtime_ns for path in (out / "parts").iterdir()}
    (out / "parts" / "0000001.json").unlink()
    (out / "parts" / "0000002.json.part").write_text("[{")
    again, failures = execute(sweep, out, jobs=1)
    assert not failures
    pd.testing.assert_frame_equal(again.table(), first, check_exact=True)
    for name, time in kept.items():
        assert ((out / "parts" / name).stat().st_mtime_ns == time) == (name != "0000001.json")


def test_an_unknown_key_of_a_drawn_number_is_named(tmp_path):
    # pydantic puts the type that it tried among the keys; the search for it ended in a StopIteration.
    path = tmp_path / "sweep.yaml"
    path.write_text(
        "schema: 1\nname: x\ndescription: x\nscenario: s.yaml\nruns: 1\nseed: 1\n"
        "pedal: {pulse_s: {unifoorm: [0.3, 0.5]}, grip_use: {uniform: [0.3, 0.x]}}\n"
    )
    with pytest.raises(ScenarioError) as error:
        load_sweep(path)
    lines = str(error.value).splitlines()
    assert any(
        f"{path}: pedal.pulse_s.unifoorm: unknown key; did you mean 'uniform'?" in line for line in lines
    )
    assert any(line.startswith(f"{path}: pedal.grip_use.uniform[1]: is '0.x'; ") for line in lines)
    assert not any("Drawn" in line or ".float" in line for line in lines)


ROW = {"run": 0, "number": 0, "seed": 1, "stretch": 0, "parameter": "", "surface": "dry", "estimator": "DE"}


@pytest.mark.parametrize(
    "part",
    [
        {"cpu_s": 1.5},
        {"cpu_s": "1.5", "rows": [ROW]},
        {"cpu_s": 1.5, "rows": [{**ROW, "error_end": "dry"}]},
        {"cpu_s": 1.5, "rows": [{**ROW, "stretch": [0]}]},
        {"cpu_s": 1.5, "rows": [{name: ROW[name] for name in ROW if name != "surface"}]},
        [1.5, [ROW]],
    ],
)
def test_a_damaged_part_is_named(tmp_path, part):
    parts = Parts(tmp_path / "out", {})
    parts.open()
    parts.keep(0, [{**ROW, "error_end": 0.1, "convergence_time_s": None, "level": None}], 1.5)
    assert (len(parts.table()), parts.cpu_s()) == (1, [1.5])
    (tmp_path / "out" / "parts" / "0000001.json").write_text(json.dumps(part))
    with pytest.raises(ScenarioError, match=r"0000001\.json: damaged.*delete it and run the sweep again"):
        parts.table()


def test_a_folder_of_another_sweep_is_refused(sweep_of, tmp_path):
    Parts(tmp_path / "out", identity(sweep_of())).open()
    with pytest.raises(ScenarioError, match="another sweep"):
        Parts(tmp_path / "out", identity(sweep_of(seed=6))).open()


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [("sweep.json", "[1]", "no sweep's identity"), ("parts/notes.json", "{}", "no run of this sweep")],
)
def test_files_of_others_in_the_folder_are_named(sweep_of, tmp_path, name, text, named):
    Parts(tmp_path / "out", identity(sweep_of())).open()
    (tmp_path / "out" / name).write_text(text)
    with pytest.raises(ScenarioError, match=rf"{name}: is {named}"):
        Parts(tmp_path / "out", identity(sweep_of())).open()


def test_an_out_that_is_a_file_ends_before_the_work(tmp_path):
    path, out = tmp_path / "sweep.yaml", tmp_path / "out"
    path.write_text(yaml.safe_dump(SHORT))
    out.write_text("mine")
    result = CliRunner().invoke(app, ["sweep", str(path), "--out", str(out / "deeper")])
    assert result.exit_code == 2
    assert f"{out}: a file" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_failed_runs_are_told_in_order_however_they_ended(monkeypatch, sweep_of, tmp_path):
    class Failed:
        status = "error"

    monkeypatch.setattr(
        execute_module, "_stream", lambda client, sweep, todo: [(k, Failed) for k in todo[::-1]]
    )
    monkeypatch.setattr(execute_module, "_why", lambda future: "as was wished")
    monkeypatch.setattr(execute_module, "connected", lambda scheduler, jobs: nullcontext())
    _, failures = execute(sweep_of(), tmp_path / "out", None, 1)
    assert [failure.run for failure in failures] == [0, 1, 2, 3]


def test_normal_draws_stay_within_what_their_quantity_can_be(sweep_of):
    sweep = sweep_of(camera={"source": "class_process", "lost_share": {"normal": [0.01, 0.5]}}, runs=20)
    drawn = [plan_run(sweep, key).camera.lost_share for key in run_keys(sweep)]
    assert min(drawn) == 0.0
    assert 0.0 < max(drawn) <= 1.0


def test_a_scheduler_that_does_not_answer_is_said(sweep_of, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.sweep.cluster.CONNECT_S", 0.5)
    with pytest.raises(ScenarioError, match=r"127\.0\.0\.1:9"):
        execute(sweep_of(), tmp_path / "out", scheduler="tcp://127.0.0.1:9")


@pytest.mark.long
@pytest.mark.e2e
def test_a_cluster_by_address_loses_no_run_when_a_worker_dies(sweep_of, tmp_path):
    """Killed half-way, the rest goes on; the bytes are those of runs done here one after the other."""
    sweep = sweep_of(runs=8)
    rows = [
        row for key in run_keys(sweep) for row in run_plan(plan_run(sweep, key), ["IFE", "DE", "DIFE"], {})
    ]
    write_table(as_table(rows), tmp_path / "here.parquet")
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0
    ) as cluster:
        victims = [cluster.workers[0].pid]

        def kill_one(done, total):
            if done >= 2 and victims:
                os.kill(victims.pop(), signal.SIGKILL)

        parts, failures = execute(sweep, tmp_path / "out", cluster.scheduler_address, progress=kill_one)
    assert not victims
    assert not failures
    write_table(parts.table(), tmp_path / "there.parquet")
    assert (tmp_path / "there.parquet").read_bytes() == (tmp_path / "here.parquet").read_bytes()


@pytest.mark.e2e
@long
def test_the_command_writes_table_and_report(tmp_path):
    path, out = tmp_path / "sweep.yaml", tmp_path / "out"
    axis = {"parameter": "camera.wrong_share", "levels": [0.0, 1.0]}
    path.write_text(yaml.safe_dump(SHORT | {"runs": 2, "vary": [axis]}))
    result = CliRunner().invoke(app, ["sweep", str(path), "--out", str(out), "--jobs", "1"])
    assert result.exit_code == 0, result.output
    table = pd.read_parquet(out / "runs.parquet")
    assert len(table) == 2 * 2 * 2 * 3
    assert table["run"].is_monotonic_increasing
    page = require_report((out / "report.html").read_text())
    assert "Degradation over camera.wrong_share" in page.text
    assert page.verdict.startswith("Of 4 runs: ")
    assert page.verdict in " ".join(result.stdout.split())
    levels = json.loads((out / "summary.json").read_text())["levels"]
    assert [level["level"] for level in levels] == [0.0, 1.0]


def test_the_number_of_runs_may_be_given(sweep_of):
    axis = {"parameter": "camera.wrong_share", "levels": [0.0, 1.0]}
    path = sweep_of(vary=[axis]).path
    assert len(run_keys(load_sweep(path))) == 2 * SHORT["runs"]
    asked = load_sweep(path, runs=7)
    assert len(run_keys(asked)) == 14
    assert plan_run(asked, run_keys(asked)[3]) == plan_run(load_sweep(path), run_keys(load_sweep(path))[3])
    for runs in (0, 500_001):
        with pytest.raises(ScenarioError, match=f"--runs is {runs}; expected 1 to 500000 for 2 levels"):
            load_sweep(path, runs=runs)


@pytest.mark.e2e
def test_the_command_takes_the_number_of_runs_and_counts_them_first(tmp_path):
    path, out = tmp_path / "sweep.yaml", tmp_path / "out"
    path.write_text(yaml.safe_dump(SHORT))
    result = CliRunner().invoke(app, ["sweep", str(path), "--runs", "1", "--out", str(out), "--jobs", "1"])
    assert result.exit_code == 0, result.output
    assert pd.read_parquet(out / "runs.parquet")["run"].nunique() == 1
    assert "Of 1 run: " in result.output
    refused = CliRunner().invoke(app, ["sweep", str(path), "--runs", "0", "--out", str(out)])
    assert refused.exit_code == 2


def test_a_run_that_never_converges_counts_as_the_slowest():
    times = pd.Series([0.3, 0.1, 0.2, np.nan, np.nan])
    assert quantile(times, 0.5, never=True) == 0.3
    assert quantile(times, 0.95, never=True) is None
    assert quantile(times, 0.95) == 0.3


def test_coverage_is_weighted_by_time(sweep_of):
    sweep = sweep_of(runs=1)
    table = as_table(run_one(sweep, run_keys(sweep)[0]).rows)
    fused = table[table["estimator"] == "DIFE"]
    found = summarise(table)["levels"][0]["estimators"]["DIFE"]
    share = np.average(fused["covered_share"], weights=fused["time_s"])
    assert found["coverage"]["all_time"] == pytest.approx(share)
    assert summarise(table)["levels"][0]["estimators"]["DE"]["coverage"] is None
    assert distribution(fused)["stretches"] == 2


@pytest.mark.long
@pytest.mark.e2e
def test_rendered_pictures_go_through_the_image_estimator(tmp_path):
    """A short drive on dry road at a quarter of the camera's size: verdicts come from the networks."""
    camera = yaml.safe_load((ROOT / "scenarios" / "cameras" / "paper.yaml").read_text())
    camera |= {key: camera[key] / 4 for key in ("fx_px", "fy_px", "cx_px", "cy_px")}
    camera |= {"width_px": 480, "height_px": 300}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(camera))
    scenario = yaml.safe_load(SCENARIO.read_text()) | {"camera": str(tmp_path / "camera.yaml")}
    scenario["pictures"] = {"disturbance": "paper", "fps": 4.0}
    for key in ("vehicle", "road", "manoeuvre"):
        scenario[key] = str(SCENARIO.parent / scenario[key])
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(scenario))
    road = {"stretch_m": 5.0, "friction": {"snow_ice": [0.3, 0.3]}}
    changes = {"scenario": "scenario.yaml", "road": road, "camera": {"source": "rendered"}, "runs": 1}
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(SHORT | changes))
    sweep = load_sweep(tmp_path / "sweep.yaml")
    plan = plan_run(sweep, run_keys(sweep)[0])
    trajectory = drive(plan.scenario)
    tracks = step_all(plan, trajectory, believed_config(plan, {}), ["IFE", "DIFE"])
    again = step_all(plan, trajectory, believed_config(plan, {}), ["IFE", "DIFE"])
    np.testing.assert_array_equal(tracks.by_name["IFE"].TRPAC, again.by_name["IFE"].TRPAC)
    front = trajectory.position_m + plan.scenario.vehicle.to_core().cog_to_front_axle_m
    judged = tracks.by_name["IFE"].TRPAC[front > 2.6]
    assert set(np.unique(judged)) <= {0.2, 0.6, 0.8}
    assert (judged == 0.2).mean() > 0.5


def test_no_run_is_lost_between_those_handed_out_ahead_and_the_rest(monkeypatch, sweep_of):
    monkeypatch.setattr(execute_module, "run_one", lambda sweep, key: key.index)
    keys = run_keys(sweep_of(runs=3 * execute_module.AHEAD))
    with Client(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as client:
        done = [(key.index, future.result()) for key, future in execute_module._stream(client, None, keys)]
    assert sorted(done) == [(i, i) for i in range(len(keys))]
