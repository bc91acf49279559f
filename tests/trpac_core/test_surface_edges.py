"""Lines across the road: found where brightness or tint steps over the whole width, and nowhere else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ife_scene import CAMERA, ground
from numpy.testing import assert_allclose

from trpac_core.vision.camera import Camera
from trpac_core.vision.surface_edges import (
    HALF_WIDTH_M,
    KNOWN_PLAINNESS,
    LEAST_PLAINNESS,
    SAMPLE_M,
    SIDE_M,
    SLANTS,
    lines_across,
    plainness,
)
from trpac_core.vision.trajectory import wheel_track

REACH_M = (2.0, 7.5)
WHEELBASE_M = 2.305
GRAIN = 12.0


def picture(grey_at, camera: Camera = CAMERA, grain: float = GRAIN, seed: int = 0):
    """Grainy road whose grey is a function of the ground point."""
    grey = np.nan_to_num(grey_at(*ground(camera).T), nan=128.0)
    grey = grey.reshape(camera.height_px // 2, camera.width_px // 2)
    grey = grey + np.random.default_rng(seed).normal(0.0, grain, grey.shape)
    whole = np.clip(grey.repeat(2, axis=0).repeat(2, axis=1), 0, 255).astype(np.uint8)
    return np.repeat(whole[..., None], 3, axis=2)


def lines(image, curvature_1_m=0.0, known_m=(), reach_m=REACH_M):
    return lines_across(image, CAMERA, reach_m, curvature_1_m, WHEELBASE_M, known_m)


@pytest.mark.parametrize("border_m", [2.6, 3.4, 5.0, 6.9])
@pytest.mark.parametrize("brighter", [0.8, 1.25])
def test_a_border_is_found_where_it_is(border_m, brighter):
    found = lines(picture(lambda x, y: np.where(x < border_m, 100.0, brighter * 100.0)))
    assert_allclose(found, [border_m], atol=0.05)


@pytest.mark.parametrize("curvature_1_m", [-0.1, 0.04, 0.1])
@pytest.mark.parametrize("slant_rad", [-0.06, 0.0, 0.06])
def test_a_border_is_found_on_a_curve_and_aslant(curvature_1_m, slant_rad):
    way_m = 4.0
    (place_m,) = wheel_track(np.array([way_m]), curvature_1_m, WHEELBASE_M, 0.0)
    heading = curvature_1_m * way_m + slant_rad

    def grey(x, y):
        beyond = (x - place_m[0]) * np.cos(heading) + (y - place_m[1]) * np.sin(heading)
        return np.where(beyond < 0.0, 90.0, 130.0)

    assert_allclose(lines(picture(grey), curvature_1_m), [way_m], atol=0.1)


def tinted(image, beyond, blue_over_red):
    """The picture with more blue and less red where a function of the ground point says, as bright as before."""
    there = beyond(*ground(CAMERA).T).reshape(CAMERA.height_px // 2, CAMERA.width_px // 2)
    there = there.repeat(2, axis=0).repeat(2, axis=1)[..., None]
    factor = np.array([blue_over_red, 1.0, 1.0 / blue_over_red])
    shifted = np.where(there, image * factor, image.astype(float))
    shifted *= image.mean(axis=2, keepdims=True) / shifted.mean(axis=2, keepdims=True)
    return np.round(shifted).astype(np.uint8)


@pytest.mark.parametrize("blue_over_red", [0.97, 1.03])
def test_a_border_as_bright_on_both_sides_is_found_by_its_tint(blue_over_red):
    image = tinted(picture(lambda x, y: np.full_like(x, 110.0)), lambda x, y: x > 4.2, blue_over_red)
    assert_allclose(lines(image), [4.2], atol=0.05)


def test_a_tint_that_changes_over_half_of_the_lane_is_no_line():
    image = tinted(picture(lambda x, y: np.full_like(x, 110.0)), lambda x, y: (x > 4.2) & (y > 0.0), 1.03)
    assert not len(lines(image))


@pytest.mark.parametrize(("step", "found"), [(1.03, 0), (1.06, 1)])
def test_on_a_road_without_grain_a_faint_step_of_brightness_is_no_line(step, found):
    image = picture(lambda x, y: np.where(x < 4.2, 150.0, 150.0 * step), grain=0.0)
    assert len(lines(image)) == found


@pytest.mark.parametrize(("step", "found"), [(1.01, 0), (1.03, 1)])
def test_on_a_road_without_grain_a_faint_step_of_tint_is_no_line(step, found):
    even = picture(lambda x, y: np.full_like(x, 150.0), grain=0.0)
    assert len(lines(tinted(even, lambda x, y: x > 4.2, step**0.5))) == found


def blotches(x, y):
    """Puddles: brighter where waves of different ways add up."""
    waves = np.sin(5.0 * x + 1.0) + np.sin(4.0 * y + 2.0 * x) + np.sin(7.0 * y - 3.0 * x + 0.5)
    return np.where(waves > 0.8, 150.0, 100.0)


@pytest.mark.parametrize(
    "grey",
    [
        pytest.param(lambda x, y: np.full_like(x, 110.0), id="plain"),
        pytest.param(lambda x, y: np.where(np.abs(y - 0.9) < 0.08, 220.0, 90.0), id="lane mark"),
        pytest.param(lambda x, y: np.where((x > 4.0) & (y > 0.0), 180.0, 90.0), id="one half of the lane"),
        pytest.param(lambda x, y: np.where((x > 4.0) == (y > 0.0), 180.0, 90.0), id="chequered"),
        pytest.param(lambda x, y: 60.0 + 12.0 * x, id="brighter with the distance"),
        pytest.param(blotches, id="puddles"),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_what_does_not_end_across_the_lane_is_no_line(grey, seed):
    assert not len(lines(picture(grey, seed=seed)))


def test_the_exposure_does_not_matter():
    def dim(factor):
        return picture(lambda x, y: factor * np.where(x < 4.2, 100.0, 130.0), grain=factor * GRAIN)

    assert_allclose(lines(dim(0.6)), lines(dim(1.6)), atol=SAMPLE_M)


def stepped(step, scatter, rows=80, bands=12):
    """Brightness that steps in the middle, by other amounts in every second band."""
    steps = step + scatter * np.where(np.arange(bands) % 2, 1.0, -1.0)
    return np.where(np.arange(rows)[:, None] < rows // 2, 0.0, steps)


def test_plainness_is_the_step_over_its_standard_error():
    found = plainness(stepped(0.2, 0.1), 0.03)
    assert found.argmax() == 40
    assert found.max() == pytest.approx(0.2 / (0.1 / np.sqrt(12) + 0.03))


@pytest.mark.parametrize("seed", range(3))
def test_plainness_counted_out_one_by_one(seed):
    rng = np.random.default_rng(seed)
    rows, bands, side = 40, 6, round(SIDE_M / SAMPLE_M)
    brightness = rng.normal(0.0, 1.0, (rows, bands))
    expected = np.zeros(rows)
    for row in range(side, rows - side):
        for slant in SLANTS:
            steps = []
            for band in range(bands):
                aside = (band - (bands - 1) / 2.0) * 2.0 * HALF_WIDTH_M / bands
                at = min(max(row + round(slant * aside / SAMPLE_M), side), rows - side)
                before, after = brightness[at - side : at, band], brightness[at : at + side, band]
                steps.append(after.mean() - before.mean())
            plain = abs(np.mean(steps)) / (np.std(steps) / np.sqrt(bands) + 0.02)
            expected[row] = max(expected[row], plain)
    assert_allclose(plainness(brightness, 0.02), expected, atol=1e-9)


def test_a_line_seen_before_may_be_fainter():
    def grey(x, y):
        return 110.0 + 7.0 * (x > 4.2) + 2.0 * np.sin(9.0 * y) * (x > 4.2)

    for grain in np.arange(10.0, 80.0, 2.0):
        image = picture(grey, grain=grain)
        if not len(lines(image)) and len(lines(image, known_m=[4.2])):
            assert_allclose(lines(image, known_m=[4.2]), [4.2], atol=0.15)
            assert not len(lines(image, known_m=[6.0]))
            break
    else:
        pytest.fail(f"no grain hides the line from {LEAST_PLAINNESS} and not from {KNOWN_PLAINNESS}")


def test_no_road_in_view_has_no_lines():
    image = picture(lambda x, y: np.full_like(x, 90.0))
    assert not len(lines(image, reach_m=(3.0, 3.0)))
    assert not len(lines(image, reach_m=(0.0, 2.0))), "nearer than the picture's end"
    assert not len(lines(np.zeros_like(image)))
    assert not len(lines(np.full_like(image, 255)))


@given(st.integers(0, 2**32 - 1), st.floats(-0.4, 0.4))
def test_lines_ascend_within_reach_whatever_the_picture_shows(seed, curvature_1_m):
    small = CAMERA.scaled(0.1)
    image = np.random.default_rng(seed).integers(0, 256, (small.height_px, small.width_px, 3), dtype=np.uint8)
    found = lines_across(image, small, REACH_M, curvature_1_m, WHEELBASE_M)
    assert ((REACH_M[0] <= found) & (found < REACH_M[1])).all()
    assert all(a < b for a, b in pairwise(found))
