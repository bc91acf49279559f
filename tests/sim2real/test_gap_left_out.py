"""What is left out of a log, or of a search, and is said: wheels that turn back, a hold-out that is a fit log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml
from gap_drives import DRY, MODEL, clean, noisy, pulses
from gap_files import write_log, write_road

from sim2real.demo import VEHICLE
from sim2real.observing.drive import RECOVERY_S, WHEEL, backward
from sim2real.observing.evidence import gather
from sim2real.sources import read_sources
from sim2real.which.contest import Contest, as_it_is, enter
from sim2real.which.fitting import FULL_STEPS, Candidate
from sim2real.which.pairs import deepened


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("case")
    car = yaml.safe_load(VEHICLE.read_text(encoding="utf-8"))
    (path / "vehicle.yaml").write_text(yaml.safe_dump({**car, "effects": {}}), encoding="utf-8")
    write_road(DRY, path / "road.yaml")
    for seed in range(2):
        write_log(noisy(clean(pulses(9.0), 13.0), seed), path / f"log_{seed}.csv")
    return path


def test_a_hold_out_that_is_a_fit_log_is_said(folder):
    files = [f"{folder}/log_0.csv", f"{folder}/log_1.csv"]
    same = read_sources(folder / "vehicle.yaml", folder / "road.yaml", files, files[1])
    assert any("is a fit log, too" in text for text in same.holdout.log.warnings)
    other = read_sources(folder / "vehicle.yaml", folder / "road.yaml", files[:1], files[1])
    assert not other.holdout.log.warnings


def test_wheels_that_turn_back_are_left_out_and_said(folder):
    drive = noisy(clean(pulses(9.0), 13.0), 3)
    measured = drive.measured.copy()
    back = (drive.time_s > 3.0) & (drive.time_s < 3.4)
    measured[back, WHEEL.start] = -8.0
    write_log(replace(drive, measured=measured), folder / "back.csv")
    found = read_sources(
        folder / "vehicle.yaml", folder / "road.yaml", [f"{folder}/back.csv"], f"{folder}/log_1.csv"
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


def test_an_effect_is_fitted_again_from_where_a_pair_has_it():
    """Its own fit has stopped far off; a pair that holds it stands at its best."""
    logs = [noisy(clean(pulses(9.0), 13.0, effects={"mass_offset": {"mass_kg": 120.0}}), s) for s in range(2)]
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    mass = enter(Candidate(MODEL, ("mass_offset",)), fit_to, held, np.array([60.0]), FULL_STEPS)
    off = np.array([60.0])
    z = fit_to.whitened(fit_to.residuals(mass.fitted.candidate.model(off)))
    z_hold = held.whitened(held.residuals(mass.fitted.candidate.model(off)))
    stuck = replace(mass, fit=replace(mass.fitted, x=off, z=z), z_fit=z, z_hold=z_hold)
    both = Candidate(MODEL, ("aero_drag", "mass_offset"))
    pair = enter(both, fit_to, held, np.array([0.01, 119.0]), FULL_STEPS)
    contest = Contest(as_it_is(MODEL, fit_to, held), (stuck,), pairs=(pair,))
    (better,) = deepened(contest, fit_to, held).singles
    assert better.fitted.x == pytest.approx([120.0], abs=5.0)
    assert better.loss < stuck.loss
    assert deepened(replace(contest, singles=(mass,), pairs=()), fit_to, held).singles == (mass,)
