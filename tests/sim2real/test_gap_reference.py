"""Reference logs: pairs of the same manoeuvre, and the user's own simulation in the nominal model's place."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from gap_drives import DRY, MODEL, SIGMA, clean, noisy, pulses, rms
from gap_files import write_log, write_road
from typer.testing import CliRunner

import trpac
from scenarios.effects import EFFECTS
from scenarios.errors import ScenarioError
from sim2real.demo import VEHICLE
from sim2real.diagnose import diagnose, diagnose_files
from sim2real.how_far.gap import measure, noise_floor
from sim2real.logs.errors import LogError
from sim2real.observing.drive import CHANNELS, SPEED, WHEEL
from sim2real.observing.evidence import gather, residuals
from sim2real.observing.reference import covered, held_against, other_torque, way
from sim2real.result import Verdict
from trpac_cli.main import app

BUILD = {"tyre_stiffness_offset": {"stiffness_n": 33_000.0}, "tyre_relaxation": {"length_m": 0.4}}
"""What stands in for a car that is built otherwise: tyres that are softer and follow later."""
DRAG = {"brake_drag": {"torque_nm": 20.0}}
FEW = {"brake_drag", "torque_gain", "torque_lag", "aero_drag", "accelerometer_bias"}
EXCLUDE = set(EFFECTS) - FEW


def pair(seconds=9.0, seed=0, scale=1.0):
    """A log with dragging brakes and one without, of a car that is built otherwise."""
    torque = scale * pulses(seconds)
    faulty = noisy(clean(torque, 13.0, DRY, BUILD | DRAG), seed)
    sound = noisy(clean(torque, 13.0, DRY, BUILD), seed + 100)
    return faulty, sound


# --- residuals minus residuals


def test_what_both_logs_leave_cancels():
    _, sound = pair()
    again = noisy(clean(pulses(9.0), 13.0, DRY, BUILD), 7)
    alone, held = residuals(MODEL, again), residuals(MODEL, held_against(MODEL, again, sound))
    assert rms(alone)[WHEEL].min() > 1.5 * SIGMA[WHEEL].max()
    assert rms(held) == pytest.approx(np.sqrt(2.0) * SIGMA, rel=0.2)


def test_without_a_reference_nothing_changes():
    drive, _ = pair()
    nothing = replace(drive, reference=np.zeros((len(drive), len(CHANNELS))))
    np.testing.assert_array_equal(residuals(MODEL, drive), residuals(MODEL, nothing))


def test_a_right_model_of_a_pair_is_at_its_noise_floor():
    faulty, sound = pair()
    evidence = gather(MODEL, [held_against(MODEL, faulty, sound)])
    right = MODEL.with_effects(EFFECTS["brake_drag"](20.0))
    size, floor = measure(evidence, evidence.residuals(right)).total, noise_floor(right, evidence, 0)
    assert size == pytest.approx(floor, rel=0.1)
    assert measure(evidence, evidence.residuals(MODEL)).total > 1.3 * floor


def test_rows_that_the_reference_does_not_reach_are_no_evidence():
    faulty, sound = pair()
    short = sound.time_s < 6.0
    cut = replace(
        sound,
        time_s=sound.time_s[short],
        torque_nm=sound.torque_nm[short],
        measured=sound.measured[short],
        moving=sound.moving[short],
    )
    held = held_against(MODEL, faulty, cut)
    assert covered(held.reference, faulty.moving) == pytest.approx(0.63, abs=0.05)
    assert np.isnan(residuals(MODEL, held)[faulty.time_s > 6.1]).all()


def test_by_position_a_log_that_began_earlier_is_matched():
    faulty, sound = pair()
    late = replace(sound, time_s=sound.time_s + 3.0)
    with pytest.raises(LogError, match="covers 0 % of its rows"):
        held_against(MODEL, faulty, replace(sound, time_s=sound.time_s + 20.0))
    by_place = held_against(MODEL, faulty, late, "position")
    by_time = held_against(MODEL, faulty, sound)
    apart = rms(residuals(MODEL, by_place) - residuals(MODEL, by_time))
    assert apart[SPEED] < 2.0 * SIGMA[SPEED]
    assert covered(by_place.reference, faulty.moving) > 0.8


def test_position_never_falls_and_has_to_be_known():
    faulty, _ = pair()
    assert np.all(np.diff(way(faulty)) >= 0.0)
    blind = faulty.measured.copy()
    blind[:, 0] = np.nan
    with pytest.raises(LogError, match="position_m has no values"):
        way(replace(faulty, measured=blind))


def test_another_torque_is_told():
    faulty, sound = pair()
    assert other_torque(faulty, sound) < 0.01
    assert other_torque(faulty, replace(sound, torque_nm=2.0 * sound.torque_nm)) == pytest.approx(1.0)


# --- the diagnosis


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two pairs of logs as files; `sim_*` are the sound car's without noise."""
    path = tmp_path_factory.mktemp("pairs")
    shutil.copy(VEHICLE, path / "vehicle.yaml")
    car = yaml.safe_load((path / "vehicle.yaml").read_text(encoding="utf-8"))
    (path / "vehicle.yaml").write_text(yaml.safe_dump(car | {"effects": {}}), encoding="utf-8")
    write_road(DRY, path / "road.yaml")
    for number, name in enumerate(("fit", "hold")):
        faulty, sound = pair(12.0, number, 1.0 + 0.2 * number)
        write_log(faulty, path / f"{name}.csv")
        write_log(sound, path / f"{name}_before.csv")
        plain = clean((1.0 + 0.2 * number) * pulses(12.0), 13.0, DRY, BUILD)
        write_log(plain, path / f"{name}_sim.csv")
    return path


def ask(folder, **more):
    return diagnose_files(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        [f"{folder}/fit.csv"],
        f"{folder}/hold.csv",
        exclude=EXCLUDE,
        **more,
    )


@pytest.mark.parametrize("option", ["paired", "simulated"])
def test_with_references_the_fault_is_named_though_the_car_is_built_otherwise(folder, option):
    tail = {"paired": "before", "simulated": "sim"}[option]
    said = ask(folder, **{option: [f"{folder}/fit_{tail}.csv", f"{folder}/hold_{tail}.csv"]})
    assert said.verdict in (Verdict.IDENTIFIED, Verdict.PARTIAL)
    assert said.causes[0].effect == "brake_drag"
    torque = said.causes[0].parameters["torque_nm"]
    assert torque.low <= 20.0 <= torque.high
    assert said.gap.after.total <= 1.2 * said.gap.noise_floor
    assert said.provenance["holdout"]["reference"]["path"].endswith(f"hold_{tail}.csv")


def test_a_pair_without_a_fault_has_no_gap(folder):
    other = noisy(clean(pulses(12.0), 13.0, DRY, BUILD), 50)
    held = noisy(clean(1.2 * pulses(12.0), 13.0, DRY, BUILD), 51)
    references = [noisy(d, 60 + i) for i, d in enumerate((other, held))]
    pairs = [held_against(MODEL, d, r) for d, r in zip((other, held), references, strict=True)]
    assert diagnose(MODEL, pairs[:1], pairs[1], exclude=EXCLUDE).verdict is Verdict.NO_GAP


def test_the_front_door_takes_them_too(folder, monkeypatch):
    read = []
    monkeypatch.setattr("sim2real.diagnose.diagnose_sources", lambda sources, **_: read.append(sources))
    frames = {name: pd.read_csv(folder / f"{name}.csv") for name in ("fit", "hold", "fit_sim", "hold_sim")}
    trpac.diagnose(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        fit=[frames["fit"]],
        holdout=frames["hold"],
        simulated=[frames["fit_sim"], frames["hold_sim"]],
    )
    (sources,) = read
    for source in sources.all:
        assert source.reference is not None
        assert covered(source.drive.reference, source.drive.moving) > 0.9


def test_the_command_tells_how_many_there_have_to_be(folder, tmp_path):
    options = {"vehicle": "vehicle.yaml", "road": "road.yaml", "fit": "fit.csv", "holdout": "hold.csv"}
    line = [text for key, name in options.items() for text in (f"--{key}", str(folder / name))]
    line += ["--out", str(tmp_path / "out"), "--paired", str(folder / "fit_before.csv")]
    result = CliRunner().invoke(app, ["gap", "diagnose", *line])
    assert result.exit_code == 2
    assert "1 reference logs for 2 logs" in " ".join(result.output.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"paired": ["fit_before.csv"]}, "1 reference logs for 2 logs"),
        ({"paired": ["a.csv", "b.csv"], "simulated": ["a.csv", "b.csv"]}, "both given"),
        ({"simulated": ["a.csv", "b.csv"], "by": "position"}, "matched by time"),
        ({"paired": ["no.csv", "hold_before.csv"]}, "no.csv"),
    ],
)
def test_what_cannot_be_is_refused(folder, more, message):
    given = {
        key: [str(folder / v) for v in value] if isinstance(value, list) else value
        for key, value in more.items()
    }
    with pytest.raises(ScenarioError, match=message):
        ask(folder, **given)
