"""The unit with its real networks on rendered roads: other pictures, other outputs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from fmu_unit import DRIVING, STEP_S, Unit

from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import CLASS_THETA, Surface

pytestmark = pytest.mark.e2e

SPEED_M_S = DRIVING["vehicle_speed"]
FRAMES = 36
FRAME_STEPS = round(1.0 / Camera().fps / STEP_S)
WAY_M = SPEED_M_S * FRAMES * FRAME_STEPS * STEP_S


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> dict[Surface, list[Path]]:
    """Pictures of a drive over a road of each surface, frame by frame at the same places."""
    folder = tmp_path_factory.mktemp("pictures")
    camera = Camera().scaled(0.5)
    paths: dict[Surface, list[Path]] = {}
    for surface in Surface:
        renderer = Renderer(camera, [SurfaceSegment(0.0, surface)], Scene(seed=4))
        paths[surface] = []
        for frame in range(FRAMES):
            path = folder / f"{surface.label}_{frame:03d}.jpg"
            cv2.imwrite(str(path), renderer.frame(frame * WAY_M / FRAMES).image)
            paths[surface].append(path)
    return paths


def drive(unit: Unit, paths: list[Path]) -> list[dict[str, float | bool]]:
    """Outputs at the end of each frame's time."""
    trace = []
    for path in paths:
        unit.step({**DRIVING, "image_path": str(path)}, count=FRAME_STEPS)
        trace.append(unit.outputs())
    return trace


@pytest.mark.parametrize(
    "surface",
    [
        Surface.DRY,
        Surface.WET,
        Surface.SNOW_ICE,
    ],
)
def test_a_road_of_one_surface_is_seen_as_such(
    open_unit: Callable[..., Unit], pictures: dict[Surface, list[Path]], surface: Surface
) -> None:
    unit = open_unit()
    last = drive(unit, pictures[surface])[-1]
    assert last["TRPAC_image"] == CLASS_THETA[surface]
    assert last["flag"]
    assert unit.log == []


def test_swapped_pictures_swap_what_the_unit_says(
    open_unit: Callable[..., Unit], pictures: dict[Surface, list[Path]]
) -> None:
    """Early enough for all road that was remembered from the first pictures to be behind at the end."""
    swap = FRAMES // 3
    dry, snow = pictures[Surface.DRY], pictures[Surface.SNOW_ICE]
    onto_snow = drive(open_unit(), dry[:swap] + snow[swap:])
    onto_dry = drive(open_unit(), snow[:swap] + dry[swap:])
    seen = [(trace[swap]["TRPAC_image"], trace[-1]["TRPAC_image"]) for trace in (onto_snow, onto_dry)]
    high, low = CLASS_THETA[Surface.DRY], CLASS_THETA[Surface.SNOW_ICE]
    assert seen == [(high, low), (low, high)]


def test_blinded_camera_lowers_the_flag(
    open_unit: Callable[..., Unit], pictures: dict[Surface, list[Path]], tmp_path: Path
) -> None:
    half = FRAMES // 2
    black = tmp_path / "black.png"
    cv2.imwrite(str(black), np.zeros((600, 960, 3), np.uint8))
    unit = open_unit()
    flags = [state["flag"] for state in drive(unit, pictures[Surface.DRY][:half])]
    assert any(flags)
    blinded = []
    for frame_id in range(1, FRAMES - half):
        unit.set({"frame_id": frame_id})
        blinded += drive(unit, [black])
    assert not blinded[-1]["flag"]
    assert unit.log == [], "a dark picture is a good input that shows nothing"
