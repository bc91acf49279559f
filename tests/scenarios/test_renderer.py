"""Rendered pictures: geometry against hand formulas, exact labels, a world that stays in place."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.camera.renderer import Renderer, fresnel_reflectance
from scenarios.camera.scene import HOUSE_RISE, Scene, SurfaceSegment
from scenarios.camera.sky import AZIMUTH_RAD, LOWEST_RAD, ROOFS, build_panorama
from scenarios.camera.textures import build_ripmap
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface

SMALL = Camera().scaled(0.2)
PLAIN = Scene(trees_per_100_m=0, poles_per_100_m=0, walls_per_100_m=0, bridges_per_100_m=0)
SHADED = Scene(
    seed=4, trees_per_100_m=0, poles_per_100_m=0, walls_per_100_m=0, bridges_per_100_m=4, patches_per_100_m=0
)


def renderer(camera=SMALL, look=PLAIN, surface=Surface.DRY):
    return Renderer(camera, [SurfaceSegment(0.0, surface)], look)


def row_of_distance(camera, x_m):
    """Pinhole row of a ground point straight ahead, by hand: fy tan(depression - pitch) below the centre."""
    depression = math.atan2(camera.height_m, x_m - camera.x_from_front_axle_m)
    return camera.cy_px + camera.fy_px * math.tan(depression - camera.pitch_rad)


@settings(max_examples=15, deadline=None)
@given(position=st.floats(0.0, 3000.0), ahead=st.floats(4.0, 25.0))
def test_a_class_change_appears_at_its_row(position, ahead):
    segments = [
        SurfaceSegment(-10.0, Surface.DRY),
        SurfaceSegment(position + ahead, Surface.SNOW_ICE),
        SurfaceSegment(position + 200.0, Surface.WET),
    ]
    surface = Renderer(SMALL, segments, PLAIN).frame(position).surface
    column = surface[:, round(SMALL.cx_px)]
    first_snow_row = np.flatnonzero(column == Surface.SNOW_ICE).max()
    last_dry_row = np.flatnonzero(column == Surface.DRY).min()
    assert last_dry_row == first_snow_row + 1
    assert first_snow_row + 0.5 == pytest.approx(row_of_distance(SMALL, ahead), abs=1.0)


def test_the_class_change_moves_with_the_car_and_shows_in_the_picture():
    segments = [SurfaceSegment(0.0, Surface.DRY), SurfaceSegment(100.0, Surface.SNOW_ICE)]
    look = replace(
        PLAIN, asphalt_albedo=0.08, snow_cover=1.5, snow_dirt=0.0, track_clearing=0.0, edge_lines=False
    )
    scene = Renderer(SMALL, segments, look)
    for position in (82.0, 90.0, 95.0):
        frame = scene.frame(position)
        row = round(row_of_distance(SMALL, 100.0 - position))
        column = round(SMALL.cx_px)
        beyond, before = frame.image[row - 3, column].mean(), frame.image[row + 3, column].mean()
        assert beyond > before + 40


@pytest.mark.parametrize("lateral_m", [0.0, 0.7, -0.4])
def test_drivable_ends_at_the_road_edges(lateral_m):
    look = replace(PLAIN, lanes=3, own_lane=1, lane_width_m=3.2, shoulder_m=0.5)
    half_width_m = 3 * 3.2 / 2 + 0.5
    assert look.road_edges_m == pytest.approx((-half_width_m, half_width_m))
    drivable = renderer(look=look).frame(20.0, lateral_m=lateral_m).drivable
    for x_m in (12.0, 20.0):
        row = round(row_of_distance(SMALL, x_m))
        depth = math.cos(SMALL.pitch_rad) * (x_m + 0.4) + math.sin(SMALL.pitch_rad) * SMALL.height_m
        edges = [SMALL.cx_px - SMALL.fx_px * (y - lateral_m) / depth for y in (half_width_m, -half_width_m)]
        columns = np.flatnonzero(drivable[row])
        tolerance = 1.0 + 0.5 * SMALL.fx_px * half_width_m / depth / (row - row_of_distance(SMALL, 1e9))
        assert columns.min() == pytest.approx(max(edges[0], 0), abs=tolerance)
        assert columns.max() == pytest.approx(min(edges[1], SMALL.width_px - 1), abs=tolerance)
        assert len(columns) == columns.max() - columns.min() + 1


def test_labels_agree_with_each_other():
    frame = renderer(look=SHADED).frame(30.0)
    assert np.array_equal(frame.surface >= 0, frame.drivable)
    assert not (frame.shadow & ~frame.drivable).any()
    assert frame.image.dtype == np.uint8
    assert frame.image.shape == (*frame.drivable.shape, 3) == (SMALL.height_px, SMALL.width_px, 3)


def test_nothing_is_road_above_the_horizon():
    horizon = SMALL.cy_px - SMALL.fy_px * math.tan(SMALL.pitch_rad)
    drivable = renderer().frame(0.0).drivable
    first_row = np.flatnonzero(drivable.any(axis=1)).min()
    assert horizon < first_row <= horizon + 2.0


@pytest.mark.parametrize("surface", list(Surface))
def test_the_world_stays_in_place_while_the_car_moves(surface):
    """The same ground point, found through the camera geometry, looks alike from two places; another does not."""
    look = replace(
        PLAIN, seed=9, stains=0.6, cracks=0.9, water_film=0.05, puddles=0.0, visibility_m=1e6, snow_cover=0.7
    )
    scene = renderer(Camera().scaled(0.5), look, surface)
    move_m, sideways_m, heading_rad = 3.0, 0.3, 0.02
    start = np.array([50.0, 0.0])
    points = np.stack(np.meshgrid(np.linspace(10, 13, 50), np.linspace(-1.4, 1.4, 60)), -1).reshape(-1, 2)

    def seen(position_m, lateral_m, heading, road_points):
        image = scene.frame(position_m, lateral_m, heading).image.mean(axis=2)
        away = road_points - np.array([position_m, lateral_m])
        turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
        pixels = np.round(scene.camera.ground_to_image(away @ turn)).astype(int)
        return image[pixels[:, 1], pixels[:, 0]]

    before = seen(50.0, 0.0, 0.0, points + start)
    after = seen(50.0 + move_m, sideways_m, heading_rad, points + start)
    elsewhere = seen(50.0 + move_m, sideways_m, heading_rad, points + start + np.array([move_m, 0.0]))
    assert np.corrcoef(before, after)[0, 1] > 0.6
    assert abs(np.corrcoef(before, elsewhere)[0, 1]) < np.corrcoef(before, after)[0, 1] - 0.25
    assert after.mean() == pytest.approx(before.mean(), rel=0.1)


def test_the_same_look_gives_the_same_bytes_and_survives_pickling():
    look = Scene.random(np.random.default_rng(3))
    first, second = renderer(look=look), renderer(look=look)
    copy = pickle.loads(pickle.dumps(first))
    for other in (second, copy):
        for a, b in zip(vars(first.frame(12.3)).values(), vars(other.frame(12.3)).values(), strict=True):
            assert np.array_equal(a, b)
    another = renderer(look=replace(look, seed=look.seed + 1))
    assert (another.frame(12.3).image != first.frame(12.3).image).mean() > 0.2


@pytest.mark.parametrize("surface", list(Surface))
def test_shadows_darken_the_road_where_the_mask_says(surface):
    look = replace(SHADED, water_film=0.3, puddles=0.0)  # a mirror has no shadow to show
    lit_look = replace(look, bridges_per_100_m=0.0)
    positions = range(0, 240, 12)
    shaded_scene, lit_scene = renderer(look=look, surface=surface), renderer(look=lit_look, surface=surface)
    ratios_in, ratios_out, share = [], [], []
    for position in positions:
        shaded, lit = shaded_scene.frame(position), lit_scene.frame(position)
        assert not lit.shadow.any()
        near = np.zeros_like(shaded.drivable)
        near[int(SMALL.height_px * 0.55) :] = True
        ratio = shaded.image.mean(axis=2) / np.maximum(lit.image.mean(axis=2), 1.0)
        share.append((shaded.shadow & near).sum() / near.sum())
        ratios_in.extend(ratio[shaded.shadow & near])
        ratios_out.extend(ratio[shaded.drivable & ~shaded.shadow & near])
    assert 0.05 < np.mean(share) < 0.9
    assert np.mean(np.array(ratios_in) < 0.9) > 0.97
    assert np.mean(np.array(ratios_out) > 0.9) > 0.93


def test_no_shadow_labels_under_an_overcast_sky():
    look = replace(SHADED, sky="overcast", sun_share=0.0)
    assert not any(renderer(look=look).frame(position).shadow.any() for position in range(0, 240, 40))


@pytest.mark.parametrize("surface", [Surface.DRY, Surface.SNOW_ICE])
def test_in_open_shade_the_road_has_the_skys_light_and_no_shadow(surface):
    """With the exposure held, a matt road's linear light falls to the share that the sun does not bring."""
    sunny = replace(
        PLAIN, auto_exposure=0.0, sun_share=0.6, visibility_m=1e9, ice_gloss=0.0, exposure_ev=-1.5
    )
    shade = replace(sunny, open_shade=True)
    lit, shaded = (renderer(look=look, surface=surface).frame(5.0) for look in (sunny, shade))
    assert not shaded.shadow.any()
    road = lit.drivable & (lit.surface == surface)
    ratio = _linear(shaded.image[road]).mean(axis=0) / _linear(lit.image[road]).mean(axis=0)
    fill, sun = 0.4 * np.array([1.22, 1.0, 0.86]), 0.6 * np.array([0.9, 1.0, 1.06])
    assert ratio == pytest.approx(fill / (fill + sun), rel=0.05)  # bytes of a dark road are 2 % of its light


def _linear(image):
    """Light of display bytes below the tone curve's shoulder, the inverse of sRGB's curve."""
    display = image / 255.0
    return np.where(display < 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


def test_a_camera_in_open_shade_exposes_longer():
    dark = replace(PLAIN, auto_exposure=0.0, open_shade=True)
    evened = replace(dark, auto_exposure=0.9)
    lit = [replace(look, open_shade=False) for look in (dark, evened)]
    means = [renderer(look=look).frame(5.0).image[200:].mean() for look in (dark, evened, *lit)]
    assert means[1] / means[3] > 1.2 * means[0] / means[2]


def test_streets_have_houses_on_one_side_or_both_and_else_the_look_that_they_were_given():
    look = Scene.random(np.random.default_rng(5))
    streets = [look.in_a_street(np.random.default_rng(seed)) for seed in range(400)]
    assert all(street.open_shade for street in streets)
    assert all(replace(street, open_shade=False, house_rise=(0.0, 0.0)) == look for street in streets)
    rises = np.array([street.house_rise for street in streets])
    one_side = (rises == 0.0).any(axis=1)
    assert rises.max() <= HOUSE_RISE[1]
    assert (rises.max(axis=1) >= HOUSE_RISE[0]).all()
    assert 0.4 < one_side.mean() < 0.6  # a half each way, four standard deviations
    assert 0.35 < (rises[one_side, 0] == 0.0).mean() < 0.65


@pytest.mark.parametrize(("left", "right"), [(1.0, 0.0), (0.0, 1.0), (0.6, 1.8)])
def test_a_row_of_houses_stands_as_high_as_its_rise_says(left, right):
    """A wall h high at the distance d aside reaches the elevation atan(h sin(azimuth) / d)."""
    open_land = replace(PLAIN, hills=0.0, tree_line=0.0)
    px_rad = 0.004
    free, street = (
        build_panorama(look, px_rad).sharp
        for look in (open_land, replace(open_land, house_rise=(left, right)))
    )
    hidden = (free != street).any(axis=2)
    elevation = LOWEST_RAD + (np.arange(hidden.shape[0]) + 0.5) * px_rad
    azimuth = AZIMUTH_RAD - (np.arange(hidden.shape[1]) + 0.5) * px_rad
    roof = np.where(hidden.any(axis=0), elevation[-1 - hidden[::-1].argmax(axis=0)], 0.0)
    by_hand = np.where(azimuth > 0.0, left, right) * np.abs(np.sin(azimuth))
    assert (np.tan(roof) <= ROOFS[1] * by_hand + px_rad).all()
    below_top = np.arctan(ROOFS[0] * by_hand) < elevation[-1]
    assert (np.tan(roof) >= ROOFS[0] * by_hand - 2 * px_rad)[below_top].all()


def test_dry_wet_and_snow_of_one_look_differ():
    means = [renderer(surface=s).frame(5.0).image[200:, 150:230].mean() for s in Surface]
    assert means[Surface.SNOW_ICE] > means[Surface.DRY] + 30
    images = [renderer(surface=s).frame(5.0).image[200:, 150:230].astype(int) for s in Surface]
    assert np.abs(images[Surface.DRY] - images[Surface.WET]).mean() > 5


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), surface=st.sampled_from(list(Surface)))
def test_any_random_look_gives_a_picture_with_content(seed, surface):
    look = Scene.random(np.random.default_rng(seed), surface)
    frame = renderer(look=look, surface=surface).frame(seed % 500, 0.2, 0.01)
    road = frame.image[frame.drivable]
    assert frame.drivable.mean() > 0.1
    assert 3 < road.mean() < 254
    assert road.std() > 1.0
    assert set(np.unique(frame.surface)) == {-1, surface}


def test_random_looks_differ_but_repeat_from_their_seed():
    assert Scene.random(np.random.default_rng(1)) == Scene.random(np.random.default_rng(1))
    assert Scene.random(np.random.default_rng(1)) != Scene.random(np.random.default_rng(2))


def test_a_wrong_order_of_segments_is_refused():
    with pytest.raises(ValueError, match="expected at least one, each beyond the one before"):
        Renderer(SMALL, [SurfaceSegment(5.0, Surface.DRY), SurfaceSegment(5.0, Surface.WET)], PLAIN)
    with pytest.raises(ValueError, match="at least one"):
        Renderer(SMALL, [], PLAIN)


def test_a_mounting_with_roll_yaw_and_distortion_keeps_labels_on_the_ground():
    """Every road pixel, taken to the ground by the camera, lies between the road's edges."""
    camera = replace(SMALL, roll_rad=0.03, yaw_rad=-0.05, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
    frame = renderer(camera).frame(7.0, lateral_m=0.5)
    rows, columns = np.nonzero(np.ones_like(frame.drivable))
    ground = camera.image_to_ground(np.column_stack((columns, rows)).astype(float))
    right, left = PLAIN.road_edges_m
    near = (ground[:, 0] > camera.x_from_front_axle_m) & (ground[:, 0] < 200.0)
    inside = (ground[:, 1] + 0.5 > right) & (ground[:, 1] + 0.5 < left)
    clear_of_edge = np.abs(ground[:, 1] + 0.5 - np.where(ground[:, 1] > 0, left, right)) > 1e-3
    checked = near & clear_of_edge
    assert np.array_equal(frame.drivable[rows, columns][checked], inside[checked])


def test_ripmap_levels_keep_the_mean():
    texture = np.random.default_rng(0).integers(0, 256, (64, 32, 4), dtype=np.uint8)
    ripmap = build_ripmap(texture, (4, 3))
    texels = ripmap.texels.view(np.uint8).reshape(-1, 4)
    for i in range(4):
        for j in range(3):
            size = (64 >> i) * (32 >> j)
            level = texels[ripmap.offsets[i, j] : ripmap.offsets[i, j] + size]
            assert level.mean(axis=0) == pytest.approx(texture.mean(axis=(0, 1)), abs=2.0)
    assert len(texels) == ripmap.offsets[3, 2] + (64 >> 3) * (32 >> 2)


def test_fresnel_limits():
    assert fresnel_reflectance(np.array([1.0, 0.0])) == pytest.approx([0.0201, 1.0], abs=1e-3)
