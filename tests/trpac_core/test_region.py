"""Patches beside lines across the road: none lies on one, and each side speaks for its own ground."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from foresight_drive import CONFIG, at, drive, road
from hypothesis import given
from hypothesis import strategies as st
from ife_scene import CAMERA, DRY, PAINT, SNOW, WET, Masks, Middle, paint
from long import beyond
from numpy.testing import assert_allclose, assert_array_equal

from trpac_core.vision.evidence import WeightLaw, basic_probability, combine
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.networks import PatchVerdicts
from trpac_core.vision.region import BODIES_OF_SECTION, Region, Way
from trpac_core.vision.roi_sampling import MOST_ASPECT, Corners, roi_box, roi_boxes
from trpac_core.vision.surface_edges import KNOWN_WITHIN_M
from trpac_core.vision.trajectory import Motion

REACH_M = (0.5, 7.5)
ROAD = np.ones((160, 256), bool)


class Whole(Middle):
    """A classifier that reads the paint of the whole patch: half dry, half snow looks wet."""

    def verdicts(self, patches):
        grey = patches.mean(axis=(1, 2, 3))
        logits = self.certainty * np.eye(3)[np.abs(grey[:, None] - PAINT).argmin(axis=1)]
        return PatchVerdicts(logits, np.ones(len(grey)))


def look(ife, state, image, way_m):
    return ife.look(state, image, at(way_m), CAMERA, Masks().masks, ROAD)


def region(ways_m, lines_m, own_m=(3.0, 4.0)) -> Region:
    """A region whose ground and patches lie so far ahead."""
    ground_m = np.column_stack((np.repeat(ways_m, 20), np.zeros(20 * len(ways_m))))
    corners = Corners(ground_m, np.zeros_like(ground_m), np.ones(len(ground_m), bool))
    boxes, own = np.zeros((len(own_m), 4), np.int64), np.array(own_m)
    return Region(corners, Way((), np.array(lines_m)), (), len(own_m), boxes, own)


@given(
    st.floats(-100, 2020),
    st.floats(-100, 1300),
    st.floats(48, 1500),
    st.lists(st.floats(-200, 1400), min_size=2, max_size=2, unique=True).map(sorted),
)
def test_a_region_lies_between_the_ends_of_its_road_or_as_if_there_were_none(column, row, width, ends):
    ((left, top, right, bottom),) = roi_boxes(
        CAMERA, np.array([(column, row)]), np.array([width]), np.array([ends])
    )
    free = roi_box(CAMERA.width_px, CAMERA.height_px, (column, row), width)
    assert 0 <= left < right <= CAMERA.width_px
    assert 0 <= top < bottom <= CAMERA.height_px
    if (left, top, right, bottom) != free:
        assert ends[0] <= top < bottom <= ends[1]
        assert right - left <= free[2] - free[0]
        assert bottom - top <= free[3] - free[1]
        assert (right - left) / (bottom - top) <= MOST_ASPECT + 0.05


def test_a_region_is_shifted_before_it_is_made_lower():
    centre, width = np.array([(900.0, 700.0)]), np.array([300.0])
    assert_array_equal(
        roi_boxes(CAMERA, centre, width, np.array([(-np.inf, 720.0)])), [(750, 520, 1050, 720)]
    )
    assert_array_equal(roi_boxes(CAMERA, centre, width, np.array([(640.0, 760.0)])), [(750, 640, 1050, 760)])
    assert_array_equal(roi_boxes(CAMERA, centre, width, np.array([(680.0, 740.0)])), [(810, 680, 990, 740)])
    assert_array_equal(roi_boxes(CAMERA, centre, width, np.array([(695.0, 705.0)])), [(750, 600, 1050, 800)])


def test_no_patch_lies_on_a_line_that_is_known():
    ife, border_m = Ife(CONFIG, Masks(), Middle()), 9.0
    state, _ = ife.process(IfeState(), road(border_m - 5.0), at(5.0))
    (near, *_) = look(ife, state, road(border_m - 5.5), 5.5)
    assert_allclose(near.way.lines_m, [3.5], atol=0.05)
    row = CAMERA.ground_to_image(np.array([(3.5, 0.0)]))[0, 1]
    above, below = near.boxes[:, 3] <= row + 10, near.boxes[:, 1] >= row - 10
    assert (above | below).all()
    assert_array_equal(near.ahead_m > 3.5, above)


@pytest.mark.parametrize("first_m", beyond(1, [0.25, 0.05, 0.45]))
@pytest.mark.parametrize("law", [WeightLaw(), WeightLaw(sigmoid_centre=1 / 3, sigmoid_slope=10.0)])
def test_the_verdict_changes_with_most_of_the_ground(first_m, law):
    """To twice the step of the rows in which lines are looked for, however much what the road was before weighs."""
    ways = np.arange(0.0, 12.0, 0.5) + first_m
    _, seen = drive(replace(CONFIG, weight_law=law), Whole(), ways, border_m=10.0, before=DRY)
    _, unseen = drive(replace(CONFIG, use_lines=False), Whole(), ways, border_m=10.0, before=DRY)
    ahead = 10.0 - ways
    assert [r.surface for r in seen] == [DRY if border_m > 3.5 else SNOW for border_m in ahead]
    assert WET in {r.surface for r in unseen}, "patches on the border look wet"


def test_what_looks_like_a_line_once_or_goes_with_the_car_is_none():
    ife, state = Ife(CONFIG, Masks(), Middle()), IfeState()
    for way_m in np.arange(0.0, 4.0, 0.5):
        image = road(6.0)
        (near, *_) = look(ife, state, image, way_m)
        assert not len(near.way.lines_m), way_m
        assert_allclose(near.way.doubtful_m, [6.0], atol=0.1)
        state, _ = ife.process(state, image, at(way_m))


def test_without_a_way_no_line_is_known_and_none_is_remembered():
    ife = Ife(CONFIG, Masks(), Middle())
    state, _ = ife.process(IfeState(), road(4.0), at(1.0))
    assert_allclose(state.lines_m, [5.0], atol=0.05)
    assert IfeState.from_json(json.loads(json.dumps(state.to_json()))) == state
    assert state.elsewhere().lines_m == ()
    unknown, _ = ife.process(state, road(4.0), at(None))
    assert unknown.lines_m == ()


def test_the_view_shows_the_lines_over_the_width_that_was_read():
    ife = Ife(CONFIG, Masks(), Middle())
    state, first = ife.process(IfeState(), road(4.0), at(5.0), with_view=True)
    assert first.view.lines_px.shape == (0, 2, 2), "not known yet"
    _, second = ife.process(state, road(3.5), at(5.5), with_view=True)
    ((left, right),) = CAMERA.image_to_ground(second.view.lines_px.reshape(-1, 2)).reshape(-1, 2, 2)
    assert_allclose((left, right), [(3.5, 1.2), (3.5, -1.2)], atol=0.05)


def test_a_line_that_parts_nothing_changes_nothing():
    """Dry road that gets a little darker at one place stays dry, as sure as it was."""

    def shown(way_m):
        image = paint(lambda x, y: np.where(x < 9.0 - way_m, DRY, DRY)).astype(float)
        darker = paint(lambda x, y: np.where(x < 9.0 - way_m, DRY, SNOW)) > 150
        return np.where(darker, 0.8 * image, image).astype(np.uint8)

    ife, state = Ife(CONFIG, Masks(), Middle()), IfeState()
    for way_m in np.arange(3.0, 7.5, 0.5):
        state, result = ife.process(state, shown(way_m), at(way_m))
        assert result.surface is DRY
        assert result.near.m_0 > 0.9
    assert_allclose(state.lines_m, [9.0], atol=0.05)


def test_patches_on_one_side_share_its_ground():
    near = region(np.arange(2.5, 4.5, 0.1), [3.0], own_m=(2.7, 4.0))
    say = near.say(np.array([2.7, 4.0, 3.3, 3.9]), np.array([True, True, True, False]))
    assert_allclose(say, [6.0, 8.0, 8.0, 0.0], err_msg="5 and 15 corners, and the two patches' own places")


def test_the_closest_patch_speaks_for_ground_that_none_of_the_groups_lies_on():
    near = region(np.arange(2.5, 4.5, 0.1), [3.0], own_m=(2.7,))
    say = near.say(np.array([2.7, 5.9, 4.8]), np.array([True, False, False]))
    assert_allclose(say, [6.0, 0.0, 15.0])


def test_without_lines_all_of_the_group_say_as_much():
    inside = np.array([True, False, True])
    assert_array_equal(region([3.0], []).say(np.array([3.0, 5.0, 4.0]), inside), inside)


def test_half_the_ground_weighs_as_half_the_ground_though_it_is_told_less_surely():
    near = region(np.arange(2.5, 4.5, 0.1), [3.35])
    places_m = np.array([3.0, 4.0])
    shown = np.array([(0.0, 0.02, 0.98), (0.1, 0.8, 0.1)])
    say = near.say(places_m, np.ones(2, bool))
    combined = near.by_section(places_m, shown, say)
    assert_allclose(combined, [combine(triple, BODIES_OF_SECTION) for triple in shown])
    weights = (1 / 3, 1 / 3, 1 / 3)
    assert basic_probability(shown, weights, say).argmax() == SNOW
    assert basic_probability(combined, weights, say).argmax() == WET
    alone = region(np.arange(2.5, 4.5, 0.1), []).heard(places_m, shown, np.ones(2, bool))
    assert not alone.parted
    assert_array_equal(alone.probabilities, shown)


def test_lines_are_looked_for_from_standstill_too():
    state, result = Ife(CONFIG, Masks(), Middle()).process(IfeState(), road(4.0), Motion(0.0, way_m=0.0))
    assert_allclose(state.lines_m, [4.0], atol=0.05)
    assert result.near.n_roi == 4


@given(st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=12), st.integers(0, 2**32 - 1))
def test_remembered_lines_stay_few_however_the_car_moves(steps_m, seed):
    rng, small = np.random.default_rng(seed), CAMERA.scaled(0.1)
    ife, state, way_m = Ife(replace(CONFIG, camera=small), Masks(), Middle()), IfeState(), 0.0
    for step_m in steps_m:
        way_m += step_m
        rows = rng.integers(0, 256, (small.height_px, 1, 1))
        image = np.broadcast_to(rows, (small.height_px, small.width_px, 3)).astype(np.uint8)
        state, _ = ife.process(state, np.ascontiguousarray(image), at(way_m))
        assert len(state.lines_m) <= (REACH_M[1] - REACH_M[0]) / KNOWN_WITHIN_M
        assert all(way_m + REACH_M[0] <= line < way_m + REACH_M[1] for line in state.lines_m)
