"""`trpac gap`: what the commands take, say, write and refuse; and the demonstration's cases."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import made_up_diagnosis as made_up
import numpy as np
import pandas as pd
import pytest
import schemas
from command_line import run, words

from scenarios.effects import EFFECTS
from scenarios.errors import ScenarioError
from scenarios.files import load_road, load_vehicle
from scenarios.plant.pipeline import simulate
from sim2real import demo
from sim2real.logs import read_log
from sim2real.result import Interval
from trpac_cli import gap

DIAGNOSE = ["gap", "diagnose", "--vehicle", "car.yaml", "--road", "road.yaml", "--fit", "a.csv"]


@pytest.fixture
def fake(monkeypatch):
    """Stands in for the diagnosis; returns what it was called with, and what it will say."""
    calls, says = [], {"identified": replace(made_up.identified(), traces=())}

    def diagnose_files(vehicle, road, fit, holdout, **options):
        options.pop("progress")("effects", 3, 22)
        calls.append({"vehicle": vehicle, "road": road, "fit": fit, "holdout": holdout, **options})
        return next(iter(says.values()))

    monkeypatch.setattr("sim2real.diagnose.diagnose_files", diagnose_files)
    return calls, says


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return demo.make_case(tmp_path_factory.mktemp("case"), seed=5)


class TestDiagnose:
    def test_it_passes_on_what_it_is_told(self, fake, tmp_path):
        options = [
            "--fit",
            "b.mf4@other.yaml",
            "--holdout",
            "c.parquet",
            "--map",
            "m.yaml",
            "--dbc",
            "car.dbc",
            "--seed",
            "7",
            "--jobs",
            "2",
            "--baseline",
            "sound.csv@other.yaml",
        ]
        assert run(*DIAGNOSE, *options, "--out", tmp_path / "out").exit_code == 0
        assert fake[0] == [
            {
                "vehicle": Path("car.yaml"),
                "road": Path("road.yaml"),
                "fit": ["a.csv", "b.mf4@other.yaml"],
                "holdout": "c.parquet",
                "mapping": Path("m.yaml"),
                "dbc": [Path("car.dbc")],
                "baseline": ["sound.csv@other.yaml"],
                "paired": (),
                "simulated": (),
                "by": "time",
                "model": None,
                "signals": None,
                "seed": 7,
                "jobs": 2,
            }
        ]

    def test_it_writes_both_files_and_nothing_else(self, fake, tmp_path):
        assert run(*DIAGNOSE, "--holdout", "c.csv", "--out", tmp_path / "out").exit_code == 0
        assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")) == [
            "out",
            "out/diagnosis.json",
            "out/report.html",
        ]
        assert json.loads((tmp_path / "out/diagnosis.json").read_text())["verdict"] == "identified"

    @pytest.mark.parametrize("name", made_up.ALL)
    def test_the_terminal_says_verdict_sizes_and_causes(self, fake, tmp_path, name):
        said = replace(made_up.ALL[name](), traces=())
        fake[1]["identified"] = said
        result = run(*DIAGNOSE, "--holdout", "c.csv", "--out", tmp_path / "out")
        text = words(result.stdout)
        assert result.exit_code == 0
        assert said.sentence in text
        assert f"gap {said.gap.before.total:.2f}" in text
        assert (said.causes[0].effect in text) == (name != "no_gap")
        assert (name == "ambiguous") == ("To separate them" in text)
        assert ("of the squared gap: " in text) == (name != "no_gap")
        if name == "partial":
            assert "of the squared gap: mass_offset 62 %, structure 34 %, noise 4 %" in text
        assert str(tmp_path / "out" / "report.html") in result.stdout

    def test_square_brackets_in_a_sentence_are_no_markup(self, fake, tmp_path):
        fake[1]["identified"] = replace(made_up.no_gap(), sentence="lags in [rad/s] and [/bold]", traces=())
        result = run(*DIAGNOSE, "--holdout", "c.csv", "--out", tmp_path / "out")
        assert "lags in [rad/s] and [/bold]" in words(result.stdout)

    def test_all_problems_are_one_line_and_nothing_is_written(self, monkeypatch, tmp_path):
        def refuse(*_, **__):
            raise ScenarioError("\n".join(f"a.csv: row {i} is bad." for i in range(100)))

        monkeypatch.setattr("sim2real.diagnose.diagnose_files", refuse)
        result = run(*DIAGNOSE, "--holdout", "c.csv", "--out", tmp_path / "out")
        assert result.exit_code == 2
        assert result.stderr.count("\n") == 1
        assert result.stderr.startswith("trpac gap diagnose: a.csv: row 0 is bad. a.csv: row 1 is bad.")
        assert "more problems." in result.stderr
        assert list(tmp_path.iterdir()) == []

    def test_a_file_in_the_folder_s_place_is_refused_before_the_work(self, fake, tmp_path):
        (tmp_path / "out").write_text("mine")
        for out in (tmp_path / "out", tmp_path / "out" / "deeper"):
            result = run(*DIAGNOSE, "--holdout", "c.csv", "--out", out)
            assert result.exit_code == 2
            assert "Expected a folder" in result.stderr
        assert fake[0] == []
        assert (tmp_path / "out").read_text() == "mine"

    def test_a_disk_that_is_full_is_a_message(self, fake, monkeypatch, tmp_path):
        def full(*_):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("sim2real.reporting.report.write_diagnosis", full)
        result = run(*DIAGNOSE, "--holdout", "c.csv", "--out", tmp_path / "out")
        assert result.exit_code == 2
        assert "No space left on device" in result.stderr

    def test_help_teaches_by_an_example(self):
        text = words(run("gap", "diagnose", "--help").stdout)
        assert "Example: trpac gap diagnose --vehicle" in text
        assert all(o in text for o in ("--fit", "--holdout", "--road", "--map", "--seed", "--jobs", "--out"))

    @pytest.mark.parametrize("missing", ["--vehicle", "--fit", "--holdout", "--out"])
    def test_what_is_required_is_required(self, fake, missing, tmp_path):
        given = {"--vehicle": "v", "--fit": "f", "--holdout": "h", "--out": str(tmp_path / "out")}
        given.pop(missing)
        result = run("gap", "diagnose", *[word for pair in given.items() for word in pair])
        assert result.exit_code == 2
        assert missing in result.stderr


class TestUnusableInput:
    """Through the real diagnosis, as far as it gets; each ends in one line that names file and place."""

    @pytest.mark.parametrize(
        ("damage", "named"),
        [
            (lambda d: d.drop(columns="accel_x_m_s2"), "accel_x_m_s2"),
            (lambda d: d.assign(vehicle_speed_m_s=np.nan), "vehicle_speed_m_s"),
            (lambda d: d.iloc[::-1], "time_s"),
            (lambda d: d.assign(wheel_speed_fl_rad_s="fast"), "wheel_speed_fl_rad_s"),
            (lambda d: d.iloc[:0], "fit.csv"),
        ],
    )
    def test_a_damaged_log(self, case, tmp_path, damage, named):
        bad = tmp_path / "fit.csv"
        damage(pd.read_csv(case.holdout)).to_csv(bad, index=False)
        result = self.refused(case, tmp_path, fit=bad)
        assert str(bad) in result.stderr
        assert named in result.stderr

    def test_a_log_that_is_not_there(self, case, tmp_path):
        assert "nowhere.csv" in self.refused(case, tmp_path, fit="nowhere.csv").stderr

    def test_no_road_at_all(self, case, tmp_path):
        assert "--road" in self.refused(case, tmp_path, road=None).stderr

    def test_a_road_that_is_none(self, case, tmp_path):
        (tmp_path / "road.yaml").write_text("schema: 1\nsegments: []\n")
        assert "segments" in self.refused(case, tmp_path, road=tmp_path / "road.yaml").stderr

    def test_a_folder_as_log(self, case, tmp_path):
        assert str(tmp_path) in self.refused(case, tmp_path, fit=tmp_path).stderr

    @staticmethod
    def refused(case, tmp_path, **changed):
        given = {
            "vehicle": case.vehicle,
            "road": case.road,
            "fit": case.fit[0],
            "holdout": case.holdout,
            **changed,
        }
        options = [w for k, v in given.items() if v is not None for w in (f"--{k}", v)]
        result = run("gap", "diagnose", *options, "--out", tmp_path / "out")
        assert result.exit_code == 2, result.output
        assert result.stderr.startswith("trpac gap diagnose: ")
        assert result.stderr.count("\n") == 1
        assert not list(tmp_path.glob("*out*"))
        return result


class TestCase:
    def test_the_same_seed_makes_the_same_case(self, case, tmp_path):
        again = demo.make_case(tmp_path, seed=5)
        assert again.seal == case.seal
        assert again.holdout.read_bytes() == case.holdout.read_bytes()

    def test_seeds_draw_every_effect(self):
        drawn = {demo.draw_truth(np.random.default_rng(seed)).effect for seed in range(200)}
        assert drawn == set(demo.HIDDEN)

    @pytest.mark.parametrize("effect", demo.HIDDEN)
    def test_what_may_be_hidden_is_an_effect_of_the_plant(self, effect):
        vehicle = load_vehicle(demo.VEHICLE)
        assert effect in EFFECTS
        assert effect not in vehicle.effects
        for end in (0, 1):
            values = {name: span[end] for name, span in demo.HIDDEN[effect].items()}
            assert effect in demo.with_effect(vehicle, demo.Truth(effect, values)).effects

    @pytest.mark.parametrize("seed", range(6))
    def test_the_drive_is_rich(self, seed):
        rng = np.random.default_rng(seed)
        vehicle, road = load_vehicle(demo.VEHICLE), demo.draw_road(rng)
        torque = demo.draw_manoeuvre(rng, vehicle, 10.0).torque(np.arange(0.0, demo.DURATION_S, demo.STEP_S))
        seen = simulate(vehicle, road, torque, demo.STEP_S, initial_speed_m_s=10.0)
        assert torque.max() <= vehicle.motor_peak_torque_nm
        assert {0.3, 0.5, 0.9} <= set(np.unique(seen.theta))
        assert seen.position_m[-1] < road.segments[-1].start_m
        used = np.abs(seen.tyre_force_n / seen.vertical_load_n) / seen.theta
        assert used.max() > 0.85
        assert np.mean(seen.speed_m_s < 0.5) < 0.2

    def test_the_logs_show_the_hidden_effect_and_noise(self, case):
        truth = demo.open_seal(case)
        vehicle, road = load_vehicle(case.vehicle), load_road(case.road)
        log = pd.read_csv(case.holdout)
        torque = log[[f"wheel_torque_{w}_nm" for w in ("fl", "fr", "rl", "rr")]].to_numpy()
        speed = log.vehicle_speed_m_s
        left = {}
        for name, car in {"without": vehicle, "with": demo.with_effect(vehicle, truth)}.items():
            start = float(1.5 * speed[:100].mean() - 0.5 * speed[100:200].mean())  # the car coasts until 1 s
            run = simulate(car, road, torque, demo.STEP_S, initial_speed_m_s=start)
            left[name] = np.abs(run.speed_m_s - speed).mean()
        assert left["with"] < 0.5 * left["without"]

    def test_the_logs_are_the_contract_s(self, case):
        for path in (*case.fit, case.holdout):
            log = read_log(path)
            assert log.rate_hz == pytest.approx(1.0 / demo.STEP_S)
            assert "mu_reference" not in log.signals

    def test_a_seal_that_was_tampered_with_does_not_open(self, tmp_path):
        mine = demo.make_case(tmp_path, seed=2)
        assert demo.open_seal(mine).effect in demo.HIDDEN
        mine.truth.write_text('{"effect": "aero_drag", "parameters": {}}')
        with pytest.raises(ScenarioError, match="changed since it was sealed"):
            demo.open_seal(mine)


class TestDemo:
    def test_it_walks_through_and_never_hands_over_the_truth(self, fake, tmp_path):
        result = run("gap", "demo", "--out", tmp_path / "out", "--seed", "3")
        assert result.exit_code == 0, result.output
        text = words(result.stdout)
        steps = [text.index(f"{n}. ") for n in range(1, 6)]
        assert steps == sorted(steps)
        truth = json.loads((tmp_path / "out/truth.json").read_text())
        assert f"Hidden was {truth['effect']}" in text
        assert "truth.json" not in str(fake[0])
        assert {p.name for p in (tmp_path / "out").iterdir()} == {
            "vehicle.yaml",
            "road.yaml",
            *demo.LOGS,
            "truth.json",
            "diagnosis.json",
            "report.html",
        }

    def test_its_help_lists_what_may_be_hidden(self):
        text = words(run("gap", "demo", "--help").stdout)
        listed = re.search(r"drawn from: ([a-z0-9_, ]+)\.", text).group(1)
        assert set(listed.split(", ")) == set(demo.HIDDEN)

    def test_a_found_parameter_is_held_against_the_hidden_one(self, fake, tmp_path, monkeypatch):
        monkeypatch.setattr(demo, "draw_truth", lambda rng: demo.Truth("tyre_relaxation", {"length_m": 0.31}))
        assert "hidden 0.31, found 0.30 m (0.25 to 0.36); the truth is inside" in words(
            run("gap", "demo", "--out", tmp_path / "a").stdout
        )
        said = fake[1]["identified"]
        off = replace(said.causes[0], parameters={"length_m": Interval(0.5, 0.4, 0.6, "m")})
        fake[1]["identified"] = replace(said, causes=(off, *said.causes[1:]))
        assert "the truth is outside" in words(run("gap", "demo", "--out", tmp_path / "b").stdout)

    @pytest.mark.parametrize(
        ("hidden", "diagnosis", "says"),
        [
            ("tyre_relaxation", "identified", "[green]right"),
            ("torque_lag", "identified", "[red]not right"),
            ("torque_gain", "ambiguous", "cannot separate"),
            ("tyre_relaxation", "unknown", "not[/red] fit it"),
            ("mass_offset", "partial", "[green]right"),
            ("torque_lag", "no_gap", "says 'no_gap' and ranks the hidden effect 1 of 3"),
        ],
    )
    def test_it_judges_itself_honestly(self, hidden, diagnosis, says):
        assert says in gap.judge(hidden, made_up.ALL[diagnosis]())


@pytest.mark.parametrize(("wish", "given"), [(None, "1"), ("3", "3")])
def test_matrix_products_take_one_thread_unless_the_user_says_otherwise(wish, given):
    """Said before NumPy is loaded, which reads it once."""
    code = "import os, sys, trpac_cli; print(os.environ['OPENBLAS_NUM_THREADS'], 'numpy' in sys.modules)"
    rest = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    env = rest | ({"OPENBLAS_NUM_THREADS": wish} if wish else {})
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert said.stdout.split() == [given, "False"]


@pytest.mark.long
@pytest.mark.e2e
def test_the_demonstration_as_a_newcomer_runs_it(tmp_path):
    """The real command in a process of its own; right first, as all but few seeds are."""
    command = [
        sys.executable,
        "-c",
        "from trpac_cli.main import app; app()",
        "gap",
        "demo",
        "--out",
        tmp_path / "out",
    ]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads((tmp_path / "out/diagnosis.json").read_text())
    schemas.validate("diagnosis", said)
    truth = json.loads((tmp_path / "out/truth.json").read_text())
    assert said["causes"][0]["effect"] == truth["effect"]
    assert said["gap"]["after"]["total"] < said["gap"]["before"]["total"]
