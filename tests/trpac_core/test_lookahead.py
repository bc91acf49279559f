"""Road seen before it is near: remembered by its place, and by nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from foresight_drive import CONFIG, at, drive, road
from hypothesis import given
from hypothesis import strategies as st
from ife_scene import CAMERA, DRY, SNOW, WET, Masks, Middle, half, paint, plain
from numpy.testing import assert_allclose, assert_array_equal

from trpac_core.vision.ife import PATCHES_AHEAD, Ife, IfeState
from trpac_core.vision.lookahead import BEHIND_M, LOOK_EVERY_M, Look, due, recalled, within_reach
from trpac_core.vision.roi_sampling import LANE_HALF_WIDTH_M, TRIES, sample
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.surface_hmm import passed_by
from trpac_core.vision.trajectory import Motion

NEAR_M, REACH_M = (2.5, 4.5), (2.5, 7.5)
STILL_HEARD_M = (2.5 - BEHIND_M, 7.5)
ONE = np.array([[0.7, 0.2, 0.1]])


def test_a_patch_is_recalled_while_its_ground_is_near_and_never_else():
    look = Look.of(10.0, np.array([5.0]), ONE)
    for way_m, near in (
        (10.0, False),
        (10.4, False),
        (10.6, True),
        (12.4, True),
        (12.6, False),
        (9.0, False),
    ):
        ahead_m, shown = recalled([look], way_m, NEAR_M)
        assert len(ahead_m) == len(shown) == near, way_m
        assert_allclose(ahead_m, [15.0 - way_m] * near)
    assert_allclose(recalled([look], 11.0, NEAR_M)[1], ONE)
    assert within_reach([look], 12.4, REACH_M) == (look,)
    assert within_reach([look], 12.6, REACH_M) == ()
    assert within_reach([look], 7.4, REACH_M) == (), "a car that has rolled back forgets what is far ahead"


@given(st.lists(st.floats(-3.0, 3.0), max_size=200))
def test_what_is_remembered_stays_bounded_however_the_car_moves(steps_m):
    looks: tuple[Look, ...] = ()
    way_m = 0.0
    for step_m in steps_m:
        way_m += step_m
        if due(looks, way_m):
            looks = (*looks, Look.of(way_m, np.array([4.5, 6.0, 7.5]), np.repeat(ONE, 3, axis=0)))
        looks = within_reach(looks, way_m, STILL_HEARD_M)
        places = sorted(look.at_m for look in looks)
        assert all(b - a >= LOOK_EVERY_M for a, b in pairwise(places))
        assert len(looks) <= 1 + (STILL_HEARD_M[1] - STILL_HEARD_M[0] + 3.0) / LOOK_EVERY_M


def test_a_patch_counts_where_its_middle_shows_the_road_though_the_picture_ends_nearer():
    image, low = road(3.1), CAMERA.height_px
    usable = np.ones((160, 256), bool)
    (near,) = Ife(CONFIG, Masks(), Middle()).look(
        IfeState(), image, Motion(10.0), CAMERA, Masks().masks, usable
    )
    cut = near.boxes[:, 3] == low
    assert 0 < cut.sum() < len(cut), "a patch that the picture's end shifts, and one that it does not"
    middle_m = CAMERA.image_to_ground((near.boxes[:, :2] + near.boxes[:, 2:] - 1.0) / 2.0)[:, 0]
    assert_allclose(near.ahead_m, middle_m, atol=0.02)
    tried = sample(near.corners, TRIES * near.drawn, (CONFIG.seed, 0, 0, 2))
    own_m = near.corners.ground_m[tried[: near.drawn]][:, 0]  # where all is road, the first of each
    assert_allclose(near.ahead_m[~cut], own_m[~cut], atol=0.02)
    assert (near.ahead_m[cut] > own_m[cut] + 0.02).all()
    shown = Middle().verdicts(np.stack(near.patches)).logits.argmax(axis=1)
    far = np.abs(near.ahead_m - 3.1) > 0.05
    assert_array_equal(shown[far] == SNOW, near.ahead_m[far] > 3.1)


class Grazing(Middle):
    """Takes wet road for dry where a patch comes from the four of the near group, as a network may."""

    def verdicts(self, patches):
        found = super().verdicts(patches)
        logits = found.logits.copy()
        near = np.arange(len(logits)) < 4
        logits[near & (logits.argmax(axis=1) == int(WET))] = (0.6, 0.4, 0.0)
        return replace(found, logits=logits)


def test_what_was_plain_from_afar_mends_a_verdict_from_near():
    _, results = drive(CONFIG, Grazing(), np.arange(0.0, 6.0, 0.5))
    assert [r.surface for r in results] == [WET] * len(results), "from the first frame's own look ahead on"
    assert [r.near.n_roi for r in results] == [4] * len(results), "no more bodies of evidence"
    _, without = drive(replace(CONFIG, use_foresight=False), Grazing(), np.arange(0.0, 6.0, 0.5))
    assert {r.surface for r in without} == {DRY}


class Fickle(Middle):
    """Takes every patch of some pictures for wet, as a network may against a low sun."""

    def __init__(self, fooled):
        super().__init__()
        self.fooled = iter(fooled)

    def verdicts(self, patches):
        found = super().verdicts(patches)
        return replace(found, logits=found.logits * 0 + (1.0, 2.0, 0.0)) if next(self.fooled) else found


def test_pictures_far_apart_are_read_together():
    """On a dry road, one picture in eight is misread, 10 m from the one before: a surface goes on."""
    ways_m, fooled = np.arange(0.0, 240.0, 10.0), np.arange(24) % 8 == 5
    state, results = drive(CONFIG, Fickle(fooled), ways_m, border_m=1e4, before=DRY)
    assert {r.surface for r in results} == {DRY}
    _, alone = drive(replace(CONFIG, use_foresight=False), Fickle(fooled), ways_m, border_m=1e4, before=DRY)
    assert [r.surface for r in alone] == [WET if misread else DRY for misread in fooled]
    assert state.passed.end_m == pytest.approx(ways_m[-1] + STILL_HEARD_M[0])


def test_a_border_stays_where_it_is():
    """Looks at snow beyond a border must not make the dry road before it snow, nor the other way round."""
    ways = np.arange(0.0, 12.0, 0.5)
    _, seen = drive(CONFIG, Middle(), ways, border_m=10.0, before=DRY)
    _, alone = drive(replace(CONFIG, use_foresight=False), Middle(), ways, border_m=10.0, before=DRY)
    for way_m, one, other in zip(ways, seen, alone, strict=True):
        if way_m + NEAR_M[1] < 9.5 or way_m + NEAR_M[0] > 10.5:
            assert one.surface == other.surface == (DRY if way_m < 6.0 else SNOW), way_m


def test_a_car_that_stands_or_whose_way_is_unknown_remembers_no_more():
    ife = Ife(CONFIG, Masks(), Middle())
    state, first = ife.process(IfeState(), road(100.0), at(3.0))
    assert len(state.looks) == 1
    again, _ = ife.process(state, road(100.0), at(3.1))
    assert again.looks == state.looks
    unknown, result = ife.process(state, road(100.0), at(None))
    assert unknown.looks == ()
    assert unknown.passed is None
    assert result.surface == first.surface
    assert state.elsewhere().looks == ()
    assert state.elsewhere().evidence == state.evidence


def test_verdicts_do_not_depend_on_how_many_groups_have_one():
    ways = np.arange(0.0, 5.0, 0.7)
    _, near = drive(CONFIG, Grazing(), ways)
    near_state, _ = drive(CONFIG, Grazing(), ways)
    all_state, everything = drive(replace(CONFIG, groups_looked_at=3), Grazing(), ways)
    assert [r.near for r in near] == [r.near for r in everything]
    assert [len(r.groups) for r in (near[0], everything[0])] == [1, 3]
    assert near_state.looks == all_state.looks


def test_memory_survives_json_and_goes_on_alike():
    for ways_m in ((0.0, 0.5, 1.0), (0.0, 5.0, 10.0)):
        state, _ = drive(CONFIG, Middle(), ways_m)
        restored = IfeState.from_json(json.loads(json.dumps(state.to_json())))
        assert restored == state
        assert len(state.looks) == (3 if ways_m[-1] < 5.0 else 2)
        assert (state.passed is None) == (ways_m[-1] < 5.0)
        ife, next_m = Ife(CONFIG, Masks(), Middle()), ways_m[-1] + 0.5
        assert ife.process(restored, road(5.0), at(next_m)) == ife.process(state, road(5.0), at(next_m))


def test_each_patch_passed_counts_once_and_lines_passed_count_too():
    """What is carried on is what all patches passed, kept to the end, would tell."""
    ife, state, looks = Ife(CONFIG, Masks(), Middle(certainty=0.4)), IfeState(), {}
    for way_m in np.arange(0.0, 14.0, 0.5):
        state, _ = ife.process(state, road(9.0 - way_m, WET, DRY), at(way_m))
        looks |= {look.at_m: look for look in state.looks}
    ways_m, shown = recalled(list(looks.values()), 0.0, (-np.inf, state.passed.end_m))
    assert len(ways_m) > 40
    told, without = (passed_by(None, ways_m, shown, lines_m, state.passed.end_m) for lines_m in ([9.0], []))
    assert_allclose(state.passed.probabilities, told.probabilities, atol=0.01)
    assert np.abs(np.subtract(told.probabilities, without.probabilities)).max() > 0.03


def test_a_car_that_rolls_back_has_not_passed_the_road_before_it():
    state, _ = drive(CONFIG, Middle(), np.arange(0.0, 12.0, 0.5))
    assert state.passed.end_m == pytest.approx(11.5 + STILL_HEARD_M[0])
    assert state.passed.probabilities[WET] > 0.9
    ife = Ife(CONFIG, Masks(), Middle())
    little, _ = ife.process(state, road(100.0), at(10.0))
    assert little.passed == state.passed
    far, _ = ife.process(state, road(100.0), at(9.0))
    assert far.passed is None
    assert state.elsewhere().passed is None


def test_what_is_remembered_was_seen_all_across_the_lane():
    """Tracks that gloss between matt stone: half of the lane is as each says, and no draw has them all in one."""
    for half_m in (0.0, -1.0):
        state, _ = Ife(CONFIG, Masks(), Middle()).process(
            IfeState(), paint(lambda x, y, half_m=half_m: np.where(y > half_m, SNOW, DRY)), at(0.0)
        )
        (look,) = state.looks
        shown = np.argmax(look.probabilities, axis=1)
        # Patches end where the picture does, and their middle is told in steps of the grid.
        share = (LANE_HALF_WIDTH_M - half_m) / (2.0 * LANE_HALF_WIDTH_M)
        assert len(shown) == PATCHES_AHEAD
        assert np.count_nonzero(shown == SNOW) == pytest.approx(PATCHES_AHEAD * share, abs=0.6)


def test_road_in_the_shadow_is_not_remembered():
    split = paint(lambda x, y: np.where(y > 0.0, SNOW, DRY))
    state, _ = Ife(CONFIG, Masks(shadow=half(left=True)), Middle()).process(IfeState(), split, at(0.0))
    assert_array_equal(np.argmax(state.looks[0].probabilities, axis=1), int(DRY))


def test_each_frame_remembers_other_places():
    seen = [
        Ife(CONFIG, Masks(), Middle()).process(replace(IfeState(), frame_count=n), plain(DRY), at(0.0))[0]
        for n in (0, 0, 1)
    ]
    ways_m = [state.looks[0].ways_m for state in seen]
    assert ways_m[0] == ways_m[1] != ways_m[2]


@pytest.mark.parametrize("yaw_rate_rad_s", [-0.9, 0.9])
def test_on_a_bend_the_lane_is_remembered_that_the_car_will_drive(yaw_rate_rad_s):
    """Snow from 2.2 m beside the way of the car's middle on, which is up to 2 m away from straight on."""
    speed_m_s, long_m = 10.0, CONFIG.wheelbase_m
    radius_m = speed_m_s / yaw_rate_rad_s

    def beside(x, y):
        to_centre_m = np.hypot(x + long_m, y - radius_m)
        return np.abs(to_centre_m - np.hypot(radius_m, long_m)) > 2.2

    motion = Motion(speed_m_s, yaw_rate_rad_s=yaw_rate_rad_s, way_m=0.0)
    picture = paint(lambda x, y: np.where(beside(x, y), SNOW, DRY))
    state, _ = Ife(CONFIG, Masks(), Middle()).process(IfeState(), picture, motion)
    assert_array_equal(np.argmax(state.looks[0].probabilities, axis=1), int(DRY))


@pytest.mark.parametrize("lanes", [1.0, 1.5])
def test_a_patch_as_wide_as_the_lane_leaves_a_side_nothing_to_remember(lanes):
    wide = replace(CONFIG, roi_width_m=lanes * 2.0 * LANE_HALF_WIDTH_M, side="left")
    state, result = Ife(wide, Masks(), Middle()).process(IfeState(), plain(DRY), at(0.0))
    assert result.surface is DRY
    assert state.looks == ()


@pytest.mark.parametrize("side", ["left", "right"])
def test_each_side_remembers_its_own_track(side):
    split = paint(lambda x, y: np.where(y > 0.0, SNOW, DRY))
    sides, state = SidesIfe(CONFIG, Masks(), Middle()), SidesState()
    own, own_state = Ife(replace(CONFIG, side=side), Masks(), Middle()), IfeState()
    for way_m in np.arange(0.0, 4.0, 0.5):
        state, *results = sides.process(state, split, at(way_m))
        own_state, alone = own.process(own_state, split, at(way_m))
        assert results[side == "right"].near == alone.near
    assert getattr(state, side) == own_state
    shown = np.argmax([p for look in own_state.looks for p in look.probabilities], axis=1)
    assert_array_equal(shown, int(SNOW if side == "left" else DRY))
