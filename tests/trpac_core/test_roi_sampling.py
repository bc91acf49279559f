"""Grid corners, usable share, sampling and patches of known masks and pictures."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from trpac_core.vision.camera import Camera
from trpac_core.vision.roi_sampling import (
    LEAST_ROI_WIDTH_PX,
    TRIES,
    Corners,
    classify_corners,
    corners_in_ellipses,
    corners_in_lane,
    corners_in_strip,
    cut_patch,
    road_shares,
    roi_box,
    roi_width_px,
    sample,
    sample_across,
    with_most_road,
)
from trpac_core.vision.trajectory import CHI_SQUARE_95_2DOF, Ellipses

CAMERA = Camera()


def ellipses(centres_m, deviations_m=(0.1, 0.2)) -> Ellipses:
    centres = np.array(centres_m, dtype=float).reshape(-1, 2)
    covariance = np.tile(np.diag(np.square(deviations_m)), (len(centres), 1, 1))
    return Ellipses(np.arange(len(centres), dtype=float), centres, covariance)


def test_corners_are_the_grid_points_inside_any_ellipse_each_once():
    group = ellipses([[3.0, 0.5], [3.1, 0.55], [4.0, -0.3]])
    found = corners_in_ellipses([group], 0.05)
    x, y = np.meshgrid(np.arange(40, 100) * 0.05, np.arange(-40, 41) * 0.05, indexing="ij")
    grid = np.stack((x, y), axis=-1).reshape(-1, 2)
    off = (grid[:, None] - group.centre_m[None]) / [0.1, 0.2]
    expected = grid[(np.square(off).sum(axis=2) <= CHI_SQUARE_95_2DOF).any(axis=1)]
    assert found == pytest.approx(expected)


def test_number_of_corners_is_the_area_of_the_ellipse_over_that_of_a_cell():
    area = np.pi * CHI_SQUARE_95_2DOF * 0.1 * 0.2
    assert len(corners_in_ellipses([ellipses([[3.0, 0.0]])], 0.02)) == pytest.approx(area / 0.02**2, rel=0.02)


def test_tilted_ellipse():
    covariance = np.array([[[0.04, 0.03], [0.03, 0.04]]])
    found = corners_in_ellipses([Ellipses(np.zeros(1), np.array([[5.0, 0.0]]), covariance)], 0.02) - [
        5.0,
        0.0,
    ]
    assert np.cov(found.T) == pytest.approx(covariance[0] * CHI_SQUARE_95_2DOF / 4.0, rel=0.02)


def test_no_ellipses_no_corners():
    assert corners_in_ellipses([ellipses([])], 0.02).shape == (0, 2)
    assert classify_corners(np.empty((0, 2)), CAMERA, np.ones((160, 256), bool)).p_util == 0.0


@pytest.mark.parametrize("shadowed", [0.0, 0.25, 1.0])
def test_usable_share_of_a_mask_shadowed_to_the_left_of_a_line(shadowed):
    # The camera looks straight ahead: the road's y = 0 is the picture's middle column, a border of two cells.
    strip = corners_in_strip(4.0, 8.0, 1.0, 0.02)
    ground = strip[np.abs(strip[:, 1]) > 1e-9]
    split = np.quantile(ground[:, 1], 1.0 - shadowed)
    mask = np.ones((1200, 1920), bool)
    pixels = CAMERA.ground_to_image(ground[ground[:, 1] > split + 1e-9])
    mask[pixels[:, 1].round().astype(int), pixels[:, 0].round().astype(int)] = False
    corners = classify_corners(ground, CAMERA, mask)
    assert corners.n_ell == len(ground)
    assert corners.p_util == pytest.approx(1.0 - shadowed, abs=0.02)


def test_half_of_the_picture_in_shadow_is_half_of_the_road():
    mask = np.ones((160, 256), bool)
    mask[:, :128] = False
    ground = corners_in_strip(4.0, 8.0, 1.0, 0.02)
    left = int((ground[:, 1] > 1e-9).sum())
    corners = classify_corners(ground, CAMERA, mask)
    assert corners.n_rs == pytest.approx(left, abs=200), "up to the corners on the border itself"
    assert (corners.ground_m[corners.usable, 1] < 1e-9).all()


def test_corners_outside_the_picture_are_not_counted():
    ground = np.array([[1.0, 0.0], [10.0, 0.0], [4.0, 30.0], [-3.0, 0.0]])
    corners = classify_corners(ground, CAMERA, np.ones((160, 256), bool))
    assert corners.ground_m.tolist() == [[10.0, 0.0]]
    assert (corners.n_ell, corners.n_rs, corners.p_util) == (1, 0, 1.0)


@given(st.integers(0, 10**6), st.integers(0, 1000), st.integers(2, 8))
def test_sampling_repeats_and_draws_usable_corners_once(seed, frame, b):
    usable = np.random.default_rng(seed).random(300) > 0.7
    ground = np.column_stack((np.linspace(5.0, 9.0, 300), np.zeros(300)))
    corners = classify_corners(ground, CAMERA, np.ones((160, 256), bool))
    corners = type(corners)(corners.ground_m, corners.pixel, usable)
    drawn = sample(corners, b, (seed, frame))
    assert drawn.tolist() == sample(corners, b, (seed, frame)).tolist()
    assert len(set(drawn.tolist())) == len(drawn) == b
    assert usable[drawn].all()


@pytest.mark.parametrize(("left", "drawn"), [(0, 0), (1, 0), (2, 2), (3, 3), (9, 4)])
def test_a_group_with_one_usable_corner_is_skipped(left, drawn):
    usable = np.arange(20) < left
    corners = classify_corners(np.full((20, 2), [6.0, 0.0]), CAMERA, np.ones((160, 256), bool))
    assert len(sample(type(corners)(corners.ground_m, corners.pixel, usable), 4, (0,))) == drawn


def test_frames_draw_different_patches():
    corners = classify_corners(corners_in_strip(4.0, 8.0, 1.0, 0.02), CAMERA, np.ones((160, 256), bool))
    assert set(sample(corners, 8, (0, 1))) != set(sample(corners, 8, (0, 2)))


@given(st.floats(-0.12, 0.12), st.floats(1.0, 4.0))
def test_the_lane_bends_about_the_turns_centre(curvature_1_m, wheelbase_m):
    """The car's body turns about one point: a corner beside the way stays as far from it as at the front axle."""
    corners_m = corners_in_lane((4.5, 7.5), (-2.0, 2.0), curvature_1_m, wheelbase_m).reshape(40, 30, 2)
    lateral_m = np.arange(-20, 20) / 10.0
    if abs(curvature_1_m) < 1e-3:
        assert_allclose(corners_m[..., 1], lateral_m[:, None] + np.zeros(30), atol=0.1)
        return
    radius_m = 1.0 / curvature_1_m
    from_centre_m = np.hypot(corners_m[..., 0] + wheelbase_m, corners_m[..., 1] - radius_m)
    expected_m = np.hypot(wheelbase_m, radius_m - lateral_m)[:, None]
    assert_allclose(from_centre_m, expected_m + np.zeros(30), rtol=1e-6)


def test_the_lane_straight_ahead_is_a_grid_in_the_order_of_its_columns():
    corners_m = corners_in_lane((4.5, 7.5), (0.6, 2.0), 0.0, 2.3)
    assert corners_m[0].tolist() == pytest.approx([4.5, 0.6])
    assert corners_m[-1].tolist() == pytest.approx([7.4, 1.9])
    assert len(corners_m) == 30 * 14
    assert (np.diff(corners_m[:, 1]) > -1e-9).all()


@given(st.integers(0, 10**6), st.floats(0.3, 1.0), st.integers(2, 8))
def test_patches_drawn_across_lie_each_in_its_share_of_what_is_usable(seed, share, b):
    ground = corners_in_lane((4.5, 7.5), (-2.0, 2.0), 0.02, 2.3)
    usable = np.random.default_rng(seed).random(len(ground)) < share
    corners = Corners(ground, ground, usable)
    drawn = sample_across(corners, b, (seed,))
    assert drawn.tolist() == sample_across(corners, b, (seed,)).tolist()
    assert usable[drawn].all()
    assert len(set(drawn.tolist())) == len(drawn) == TRIES * b
    for tries, part in zip(drawn.reshape(TRIES, b).T, np.array_split(np.flatnonzero(usable), b), strict=True):
        assert set(tries.tolist()) <= set(part.tolist())


@pytest.mark.parametrize(("left", "drawn"), [(0, 0), (1, 0), (2, 2), (11, 11), (12, 12)])
def test_where_little_is_usable_all_of_it_is_drawn(left, drawn):
    usable = np.arange(50) < left
    corners = Corners(np.zeros((50, 2)), np.zeros((50, 2)), usable)
    assert len(sample_across(corners, 2, (0,))) == drawn


def test_region_width_is_focal_length_times_width_over_depth():
    depth = (10.0 + 0.4) * np.cos(0.1) + 1.4 * np.sin(0.1)
    assert roi_width_px(CAMERA, (10.0, 1.0), 1.2) == pytest.approx(1650.0 * 1.2 / depth)
    assert roi_width_px(CAMERA, (200.0, 0.0), 1.2) == LEAST_ROI_WIDTH_PX


@given(
    st.floats(-500, 2500),
    st.floats(-500, 2000),
    st.floats(1, 4000),
    st.integers(64, 2000),
    st.integers(64, 1300),
)
def test_region_lies_in_the_picture_with_aspect_3_to_2(column, row, width, picture_width, picture_height):
    left, top, right, bottom = roi_box(picture_width, picture_height, (column, row), width)
    assert 0 <= left < right <= picture_width
    assert 0 <= top < bottom <= picture_height
    assert (right - left) / (bottom - top) == pytest.approx(1.5, rel=0.03)
    assert right - left >= LEAST_ROI_WIDTH_PX


def test_region_is_centred_and_shifted_only_at_the_border():
    assert roi_box(1920, 1200, (500, 700), 300) == (350, 600, 650, 800)
    assert roi_box(1920, 1200, (10, 1190), 300) == (0, 1000, 300, 1200)


def test_patch_is_the_area_mean_of_its_region():
    image = np.random.default_rng(0).integers(0, 256, (400, 600, 3), dtype=np.uint8)
    patch = cut_patch(image, (300, 200), 192)
    left, top, right, bottom = roi_box(600, 400, (300, 200), 192)
    blocks = image[top:bottom, left:right].reshape(64, 2, 96, 2, 3).mean(axis=(1, 3))
    assert patch.shape == (64, 96, 3)
    assert patch.dtype == np.uint8
    assert np.abs(patch - blocks).max() <= 0.51


@pytest.mark.parametrize("seed", range(3))
def test_the_share_of_road_in_a_region_is_that_of_the_mask_cells_that_it_touches(seed):
    rng = np.random.default_rng(seed)
    drivable = rng.random((160, 256)) < 0.6
    columns, rows = rng.integers(0, 1700, 20), rng.integers(0, 1000, 20)
    boxes = np.column_stack(
        (columns, rows, columns + rng.integers(48, 220, 20), rows + rng.integers(32, 200, 20))
    )
    cells = [
        drivable[int(top / 7.5) : math.ceil(bottom / 7.5), int(left / 7.5) : math.ceil(right / 7.5)]
        for left, top, right, bottom in boxes
    ]
    assert_allclose(road_shares(boxes, drivable, 1920, 1200), [cell.mean() for cell in cells])


def test_the_share_of_road_holds_for_regions_at_the_ends_of_the_picture():
    drivable = np.ones((160, 256), bool)
    boxes = np.array([(0, 0, 960, 600), (0, 0, 48, 32), (960 - 48, 600 - 32, 960, 600)])
    assert_array_equal(road_shares(boxes, drivable, 960, 600), 1.0)
    assert len(road_shares(np.empty((0, 4), np.int64), drivable, 960, 600)) == 0


def test_of_the_regions_tried_the_first_with_road_enough_is_taken_else_the_one_with_most():
    shares = np.array([(0.75, 0.2, 0.71), (1.0, 0.69, 0.1), (0.99, 0.5, 1.0)]).ravel()
    assert_array_equal(with_most_road(shares, 3), [0, 4, 2])
    assert_array_equal(with_most_road(shares[:4], 3), [0, 1, 2])
    assert_array_equal(with_most_road(shares[:2], 3), [0, 1])
    assert_array_equal(with_most_road(np.empty(0), 0), [])


@given(st.lists(st.floats(0.0, 1.0), max_size=40), st.integers(1, 9))
def test_each_region_taken_is_of_its_own_kind_and_has_no_less_road_than_the_first_tried(shares, count):
    taken = with_most_road(np.array(shares), count)
    assert len(taken) == min(len(shares), count)
    assert_array_equal(taken % count, np.arange(len(taken)))
    assert (np.array(shares)[taken] >= np.minimum(np.array(shares)[: len(taken)], 0.7)).all()
