"""The example files: complete, usable by each command, and what their page says of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import trpac
from sim2real.logs import load_mapping
from trpac_cli.main import app


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("example") / "new" / "example"
    done = CliRunner().invoke(app, ["example", str(folder)])
    assert done.exit_code == 0, done.output
    assert "20 pictures" in done.output
    return folder


def test_every_file_that_is_named_is_there_and_no_other(folder):
    named = [word for word in trpac.example.__doc__.replace(",", " ").split() if "." in word[1:-1]]
    files = {path.name for path in folder.iterdir() if path.is_file()}
    assert files == {name for name in named if name.endswith((".yaml", ".csv"))}
    assert len(list((folder / "frames").glob("*.jpg"))) == 20


def test_the_foreign_log_is_the_drive_in_other_names_and_units(folder):
    ours = trpac.read_log(folder / "drive.csv")
    foreign = trpac.read_log(folder / "foreign.csv", mapping=load_mapping(folder / "mapping.yaml"))
    assert set(ours.signals) - set(foreign.signals) == {"position_m", "mu_reference"}
    for name, values in foreign.signals.items():
        np.testing.assert_allclose(values, ours.signals[name], rtol=1e-9, atol=1e-12)


def test_the_car_of_the_fit_logs_lags(folder):
    """The same torque, its lag put into the car: the speeds are those of the log; without it they are not."""
    log = trpac.read_log(folder / "holdout.csv").to_frame()
    columns = ["time_s", *(f"wheel_torque_{w}_nm" for w in ("fl", "fr", "rl", "rr"))]
    car, road = trpac.Vehicle.load(folder / "car.yaml"), trpac.Road.load(folder / "road.yaml")
    off = {}
    for lag_s in (0.0, 0.08):
        effects = [trpac.effects.TorqueLag(time_constant_s=lag_s)] if lag_s else []
        again = trpac.simulate(car, road, torque=log[columns], effects=effects)
        off[lag_s] = float(np.sqrt(np.mean((again - log)["wheel_speed_fl_rad_s"] ** 2)))
    assert off[0.08] == pytest.approx(0.02, abs=0.004)  # the sensor's noise
    assert off[0.0] > 10.0 * off[0.08]


def test_the_pictures_are_dry_then_snow(folder):
    frames = sorted((folder / "frames").iterdir())
    assert [str(trpac.classify(frames[i]).surface) for i in (0, -1)] == ["dry", "snow_ice"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    done = CliRunner().invoke(app, ["example", str(tmp_path / "file" / "example")])
    assert done.exit_code == 2
    assert done.stderr.startswith("trpac example: ")
    assert len(done.stderr.strip().splitlines()) == 1
