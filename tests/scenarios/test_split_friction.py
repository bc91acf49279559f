"""Split friction with plant and estimator as units under fmpy: each wheel finds its own side's road."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios import split_friction
from scenarios.camera.scene import Scene, SurfaceSegment
from scenarios.camera.split import SplitRenderer
from scenarios.files import load_road
from scenarios.split_figure import draw_split
from scenarios.split_friction import ROAD, run
from trpac_core.vehicle import WHEELS
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.trajectory import Motion

MODELS = Path(__file__).parents[2] / "models"
STEADY_EXCITED_S = 0.5
"""Excited time on a stretch after which an estimate has converged (the project's mark of the 95th percentile)."""
ERROR = 0.04
"""A steady estimate, 95th percentile. The observer's is within half of that; the belief's bounds, which take the tyre's
curve for uncertain, may hold it off by the rest."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    folder = tmp_path_factory.mktemp("split")
    plant, estimator = (
        build_unit(UNITS[name], folder / f"{name}.fmu")
        for name in (split_friction.PLANT, split_friction.ESTIMATOR)
    )
    return run(plant, estimator, folder)


def steady(drive: pd.DataFrame, wheel: str) -> pd.DataFrame:
    """Rows in which a wheel has been excited long enough on the road that it is on."""
    theta = drive[f"theta.{wheel}"]
    stretch = (theta != theta.shift()).cumsum()
    excited = drive[f"excitation_flag.{wheel}"].groupby(stretch).cumsum() * split_friction.STEP_S
    return drive[excited > STEADY_EXCITED_S]


@pytest.mark.long
@pytest.mark.e2e
@pytest.mark.parametrize("wheel", WHEELS)
def test_each_excited_wheel_goes_to_its_own_sides_friction(drive: pd.DataFrame, wheel: str) -> None:
    rows = steady(drive, wheel)
    on_ice = rows[rows[f"theta.{wheel}"] == 0.3]
    on_dry = rows[rows[f"theta.{wheel}"] == 0.8]
    assert len(on_ice) > 500
    assert len(on_dry) > 500
    for part in (on_ice, on_dry):
        error = (part[f"TRPAC.{wheel}"] - part[f"theta.{wheel}"]).abs()
        assert error.quantile(0.95) < ERROR


@pytest.mark.long
@pytest.mark.e2e
def test_the_camera_tells_each_side_its_own_class(drive: pd.DataFrame) -> None:
    for wheel in WHEELS:
        flagged = drive[drive[f"flag.{wheel}"] > 0.5]
        expected = np.where(flagged[f"theta.{wheel}"] == 0.3, 0.2, 0.8)
        # A class comes with a frame, so that a border may be told up to a frame's way late.
        assert np.mean(flagged[f"TRPAC_image.{wheel}"] == expected) > 0.97


@pytest.mark.long
@pytest.mark.e2e
def test_the_cars_value_follows_the_rule(drive: pd.DataFrame) -> None:
    both = [set(steady(drive, wheel).index) for wheel in WHEELS]
    rows = drive.loc[sorted(set.intersection(*both))]
    assert len(rows) > 500
    front, rear = rows["vertical_load.fl"], rows["vertical_load.rl"]
    expected = ((0.3 + 0.8) * front + 2.0 * 0.3 * rear) / (2.0 * (front + rear))
    assert (rows["TRPAC.vehicle"] - expected).abs().quantile(0.95) < ERROR
    assert (rows["theta.vehicle"] - expected).abs().max() < 1e-9


@pytest.mark.long
@pytest.mark.e2e
def test_the_car_stays_on_the_drive_that_was_meant(drive: pd.DataFrame) -> None:
    assert drive["position_m"].iloc[-1] > load_road(ROAD).segments[-1].start_m + 5.0
    assert not drive.isna().any().any()


def test_figure_is_written(tmp_path: Path) -> None:
    names = [f"{name}.{place}" for name in split_friction.NAMES for place in WHEELS]
    names += [f"theta.{place}" for place in (*WHEELS, "vehicle")]
    names += ["time_s", "speed_m_s", "TRPAC.vehicle", "TRPAC_std.vehicle"]
    table = pd.DataFrame({name: np.linspace(0.0, 1.0, 50) for name in names})
    draw_split(table, tmp_path / "split.png")
    assert min(cv2.imread(str(tmp_path / "split.png")).shape[:2]) > 500


def test_braking_comes_in_pulses() -> None:
    assert split_friction.pulse(0.1) == 0.0
    assert split_friction.pulse(0.5) == 1.0
    assert split_friction.pulse(0.3 + 0.5) == 0.0
    assert math.isclose(split_friction.pulse(0.3 + 0.025), 0.5)


@pytest.fixture(scope="module")
def split_world() -> SplitRenderer:
    look = Scene(seed=1, sky="overcast", sun_share=0.0, trees_per_100_m=0.0, bridges_per_100_m=0.0)
    ice, dry = [SurfaceSegment(0.0, Surface.SNOW_ICE)], [SurfaceSegment(0.0, Surface.DRY)]
    return SplitRenderer(Camera().scaled(0.5), ice, dry, look)


def test_a_split_picture_shows_each_side_its_surface(split_world: SplitRenderer) -> None:
    frame = split_world.frame(30.0)
    camera = Camera().scaled(0.5)
    for y, surface in ((0.68, Surface.SNOW_ICE), (-0.68, Surface.DRY)):
        ((column, row),) = camera.ground_to_image(np.array([[4.0, y]])).astype(int)
        assert frame.surface[row, column] == surface
    assert frame.image.shape == (600, 960, 3)


def test_trained_networks_tell_the_sides_of_split_pictures_apart(split_world: SplitRenderer) -> None:
    networks = (Segmenter(MODELS / "segmenter.onnx"), SurfaceClassifier(MODELS / "surface.onnx"))
    sides, state, told = SidesIfe(IfeConfig(), *networks), SidesState(), []
    for place in range(8):
        state, left, right = sides.process(state, split_world.frame(10.0 * place).image, Motion(15.0))
        told.append((left.surface, right.surface))
    # The nets take whole patches, 1.2 m wide, so that a few reach over the border in the middle.
    assert np.mean([left is Surface.SNOW_ICE for left, _ in told]) >= 0.75
    assert np.mean([right is Surface.DRY for _, right in told]) >= 0.75
