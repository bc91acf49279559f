"""Camera geometry against hand-computed pinhole projections, and the lens model's limits."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from trpac_core.vision.camera import Camera
from trpac_core.vision.roi_sampling import project

WIDE_LENSES = [(-0.3, 0.1, 0.001, -0.001, 0.0), (-0.35, 0.12, 0.0, 0.0, -0.02), (0.2, 0.0, 0.0, 0.0, 0.0)]


def hand_pinhole(camera: Camera, x_m: float, y_m: float) -> tuple[float, float]:
    """Level-roll, straight-ahead camera: rotate by the pitch alone, divide by the depth."""
    ahead, up = x_m - camera.x_from_front_axle_m, -camera.height_m
    depth = ahead * np.cos(camera.pitch_rad) - up * np.sin(camera.pitch_rad)
    down = -ahead * np.sin(camera.pitch_rad) - up * np.cos(camera.pitch_rad)
    return (
        camera.cx_px - camera.fx_px * (y_m - camera.y_m) / depth,
        camera.cy_px + camera.fy_px * down / depth,
    )


@pytest.mark.parametrize("point_m", [(2.6, 0.0), (5.0, 1.5), (12.0, -3.0), (60.0, 4.0)])
def test_projection_matches_a_pinhole_computed_by_hand(point_m):
    camera = Camera(pitch_rad=0.12, y_m=0.2)
    pixel = camera.ground_to_image(np.array([point_m]))[0]
    assert pixel == pytest.approx(hand_pinhole(camera, *point_m), abs=1e-6)


def test_level_camera_sees_the_road_where_similar_triangles_say():
    camera = Camera(pitch_rad=0.0, x_from_front_axle_m=0.0)
    column, row = camera.ground_to_image(np.array([[10.0, 2.0]]))[0]
    assert column == pytest.approx(960.0 - 1650.0 * 2.0 / 10.0)
    assert row == pytest.approx(600.0 + 1650.0 * 1.4 / 10.0)


def test_bottom_of_the_default_picture_lies_at_the_preview_distance():
    bottom = Camera().image_to_ground(np.array([[960.0, 1199.5]]))[0]
    assert bottom[0] == pytest.approx(2.5, abs=0.05)


def test_signs_of_the_mounting_angles():
    point = np.array([[20.0, 0.0]])
    column, row = Camera(pitch_rad=0.0).ground_to_image(point)[0]
    assert Camera(pitch_rad=0.05).ground_to_image(point)[0, 1] < row, (
        "nose down lifts the road in the picture"
    )
    assert Camera(pitch_rad=0.0, yaw_rad=0.05).ground_to_image(point)[0, 0] > column, (
        "turned left: road to the right"
    )
    sides = Camera(pitch_rad=0.0, roll_rad=0.05).ground_to_image(np.array([[20.0, 3.0], [20.0, -3.0]]))
    assert sides[0, 1] > sides[1, 1], "right side down: the left of the road sinks in the picture"


@pytest.mark.parametrize("roll", [0.0, 0.2])
def test_optical_axis_points_where_yaw_and_pitch_say_whatever_the_roll(roll):
    camera = Camera(yaw_rad=0.3, pitch_rad=0.2, roll_rad=roll, x_from_front_axle_m=0.0)
    hit = camera.image_to_ground(np.array([[camera.cx_px, camera.cy_px]]))[0]
    reach = camera.height_m / np.tan(0.2)
    assert hit == pytest.approx([reach * np.cos(0.3), reach * np.sin(0.3)])


@given(
    pitch=st.floats(0.0, 0.3),
    yaw=st.floats(-0.2, 0.2),
    roll=st.floats(-0.1, 0.1),
    x=st.floats(3.0, 50.0),
    y=st.floats(-8.0, 8.0),
    lens=st.sampled_from([(0.0,) * 5, *WIDE_LENSES]),
)
def test_ground_to_image_and_back(pitch, yaw, roll, x, y, lens):
    camera = Camera(pitch_rad=pitch, yaw_rad=yaw, roll_rad=roll, distortion=lens)
    pixel = camera.ground_to_image(np.array([[x, y]]))
    assume(np.isfinite(pixel).all())
    assume(0 <= pixel[0, 0] < 1920 and 0 <= pixel[0, 1] < 1200)
    assert camera.image_to_ground(pixel)[0] == pytest.approx([x, y], abs=1e-6)


@pytest.mark.parametrize("lens", WIDE_LENSES)
def test_picture_corners_come_back_to_a_thousandth_of_a_pixel(lens):
    camera = Camera(distortion=lens)
    corners = np.array([[0.0, 1199.0], [1919.0, 1199.0], [0.0, 800.0]])
    assert camera.ground_to_image(camera.image_to_ground(corners)) == pytest.approx(corners, abs=1e-3)


def test_road_far_outside_a_barrel_lens_does_not_fold_into_the_picture():
    camera = Camera(distortion=(-0.35, 0.12, 0.0, 0.0, -0.02))
    beside = np.column_stack((np.full(200, 2.0), np.linspace(0.0, 60.0, 200)))
    columns = camera.ground_to_image(beside)[:, 0]
    seen = columns[np.isfinite(columns)]
    assert (np.diff(seen) < 0.0).all(), "further left on the road is further left in the picture, or nowhere"
    assert np.isnan(columns[-1])


def test_points_behind_the_lens_and_pixels_above_the_horizon_have_no_image():
    camera = Camera()
    assert np.isnan(camera.ground_to_image(np.array([[-5.0, 0.0]]))).all()
    assert np.isnan(camera.image_to_ground(np.array([[960.0, 0.0]]))).all()
    assert camera.ground_to_image(np.empty((0, 2))).shape == (0, 2)
    assert camera.image_to_ground(np.empty((0, 2))).shape == (0, 2)


def test_homography_is_the_projection_without_distortion():
    camera = Camera(yaw_rad=0.05, roll_rad=0.02)
    ground = np.random.default_rng(1).uniform([3.0, -5.0], [30.0, 5.0], (50, 2))
    assert project(ground, camera) == pytest.approx(camera.ground_to_image(ground), abs=1e-6)


def test_half_size_camera_sees_the_same_ground_at_the_same_place_of_the_picture():
    camera = Camera(yaw_rad=0.03)
    half = camera.scaled(0.5)
    ground = np.array([[4.0, 1.0], [20.0, -2.0]])
    assert (half.width_px, half.height_px) == (960, 600)
    # Pixel centres lie at whole numbers, so picture borders at -0.5 are what scales.
    assert (half.ground_to_image(ground) + 0.5) * 2.0 == pytest.approx(camera.ground_to_image(ground) + 0.5)
