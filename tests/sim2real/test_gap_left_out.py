"""What is left out of a log, or of a search, and is said: wheels that turn back, a hold-out that is a fit log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml
from gap_drives import DRY, clean, noisy, pulses
from gap_files import write_log, write_road

from sim2real.demo import VEHICLE
from sim2real.observing.drive import RECOVERY_S, WHEEL, backward
from sim2real.sources import read_sources


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
