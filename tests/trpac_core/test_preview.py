"""Displacement stamps: which frame speaks of the road under the wheel now."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.vision.classes import Surface
from trpac_core.vision.preview import (
    MOST_STAMPS,
    Outcome,
    PreviewConfig,
    PreviewState,
    Stamp,
    add_frame,
    covering,
    prune,
)

CONFIG = PreviewConfig()


def outcome(frame: int, surface: Surface = Surface.DRY) -> Outcome:
    return Outcome(surface, 0.8, True, captured_s=float(frame))


def drive(positions_m, config=CONFIG, speed_m_s=10.0) -> PreviewState:
    state = PreviewState()
    for frame, position in enumerate(positions_m):
        add_frame(
            state, config, outcome(frame), position_m=position, speed_m_s=speed_m_s, frame_interval_s=0.025
        )
    return state


def frame_at(state, position_m, config=CONFIG) -> float | None:
    found = covering(state, config, position_m)
    return None if found is None else found.captured_s


def test_first_stamp_is_equation_11():
    # P_1 = 7, P_0 = 2.5, 10 m/s for 25 ms.
    (stamp,) = drive([7.0]).stamps
    assert (stamp.X_lb_m, stamp.X_ub_m) == pytest.approx((9.5, 9.75))


def test_steady_frames_tile_the_road_without_gap_or_overlap():
    stamps = drive([0.0, 0.25, 0.5, 0.75]).stamps
    assert [s.X_lb_m for s in stamps] == pytest.approx([2.5, 2.75, 3.0, 3.25])
    assert [s.X_ub_m for s in stamps[:-1]] == pytest.approx([s.X_lb_m for s in stamps[1:]])


def test_road_before_the_first_stamp_is_unknown():
    state = drive([0.0])
    assert frame_at(state, 2.499) is None
    assert frame_at(state, 2.5) == 0.0


def test_surface_changes_under_the_wheel_where_it_was_seen_to_change():
    state = PreviewState()
    for frame in range(80):
        position = 0.25 * frame
        surface = Surface.DRY if position + 2.5 < 10.0 else Surface.SNOW_ICE
        add_frame(
            state,
            CONFIG,
            outcome(frame, surface),
            position_m=position,
            speed_m_s=10.0,
            frame_interval_s=0.025,
        )
    assert covering(state, CONFIG, 9.99).surface is Surface.DRY
    assert covering(state, CONFIG, 10.0).surface is Surface.SNOW_ICE


def test_result_holds_over_lost_frames_for_the_hold_distance_and_no_further():
    state = drive([0.0, 0.25, 5.0])
    # Frame 1: [2.75, 3.0) and 2 m of hold; frame 2 starts at 7.5.
    assert frame_at(state, 4.99) == 1.0
    assert frame_at(state, 5.0) is None
    assert frame_at(state, 7.5) == 2.0
    strict = PreviewConfig(hold_m=0.0)
    assert frame_at(drive([0.0, 0.25, 5.0], strict), 3.0, strict) is None


def test_newest_frame_wins_where_stamps_overlap():
    state = drive([0.0, 2.0, 1.0])  # rolled back by a metre
    assert frame_at(state, 3.6) == 2.0
    assert frame_at(state, 4.6) == 2.0, "covered by frame 1's stamp too"


def test_older_longer_stamp_does_not_come_back_when_a_newer_one_has_ended():
    config = PreviewConfig(resolution_m=0.0)
    state = drive([0.0, 3.0, 3.1], config)
    # Frame 1 reaches to 8.5 + 2, frame 2 begins at 5.6 and reaches to 5.7 + 2.
    assert frame_at(state, 7.6, config) == 2.0
    assert frame_at(state, 7.8, config) is None
    prune(state, config, 7.8)
    assert frame_at(state, 7.8, config) is None


def test_standing_car_keeps_one_stamp_with_the_newest_result():
    state = drive([3.0] * 500, speed_m_s=0.0)
    assert len(state.stamps) == 1
    assert frame_at(state, 5.5) == 499.0


def test_frame_that_shares_a_stamp_does_not_shorten_it():
    (_, shared) = drive([0.0, 1.0, 1.01]).stamps
    assert (shared.X_lb_m, shared.X_ub_m) == pytest.approx((3.5, 4.5))
    assert shared.outcome.captured_s == 2.0


def test_creeping_car_does_not_pile_up_stamps_nor_drag_the_first_along():
    state = drive([0.001 * k for k in range(3000)], speed_m_s=0.04)
    assert len(state.stamps) <= 3.0 / CONFIG.resolution_m + 1
    assert state.stamps[0].X_lb_m == 2.5
    for position in (2.6, 3.3, 5.4):
        assert frame_at(state, position) == pytest.approx((position - 2.5) * 1000, abs=25)


@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_shunts_does_not_pile_up_stamps(seed):
    rng = np.random.default_rng(seed)
    there_and_back = 0.3 * np.sin(np.linspace(0.0, 60.0, 6000)) + 1e-3 * rng.standard_normal(6000)
    rolling_back = -0.00025 * np.arange(6000)
    for positions in (there_and_back, rolling_back):
        state = drive(positions.tolist(), speed_m_s=0.0)
        assert len(state.stamps) <= np.ptp(positions) / CONFIG.resolution_m + 2
        begins = sorted(stamp.X_lb_m for stamp in state.stamps)
        assert np.diff(begins).min(initial=1.0) >= CONFIG.resolution_m - 1e-12
        newest = frame_at(state, positions[-1] + CONFIG.P_0_m + CONFIG.resolution_m)
        assert newest == 5999.0


@given(st.lists(st.floats(0.0, 1.5), min_size=1, max_size=30), st.floats(0.0, 40.0))
def test_forward_drive_finds_the_newest_frame_that_began_before(steps, probe):
    config = PreviewConfig(resolution_m=0.0)
    positions = [sum(steps[: k + 1]) for k in range(len(steps))]
    found = frame_at(drive(positions, config), probe, config)
    begun = [k for k, position in enumerate(positions) if position + config.P_0_m <= probe]
    if not begun:
        assert found is None
    elif found is not None:
        assert found == begun[-1]
    else:
        assert probe - (positions[begun[-1]] + config.P_0_m) >= config.hold_m - 1e-9


@given(st.lists(st.floats(-1.0, 2.0), min_size=1, max_size=30), st.floats(0.0, 6.0), st.floats(0.0, 3.0))
def test_pruning_changes_no_answer_ahead_of_the_rear_wheel(steps, ahead, behind):
    config = PreviewConfig(behind_m=behind)
    positions = [sum(steps[: k + 1]) for k in range(len(steps))]
    state = drive(positions, config)
    pruned = copy.deepcopy(state)
    prune(pruned, config, positions[-1])
    for probe in (positions[-1] + ahead, positions[-1] - behind):
        assert covering(pruned, config, probe) == covering(state, config, probe)
    assert len(pruned.stamps) <= len(state.stamps)


def test_pruning_bounds_a_long_drive():
    state = PreviewState()
    for frame in range(4000):
        position = 0.1 * frame
        add_frame(state, CONFIG, outcome(frame), position_m=position, speed_m_s=4.0, frame_interval_s=0.025)
        prune(state, CONFIG, position)
    assert len(state.stamps) <= (CONFIG.P_0_m + CONFIG.hold_m) / 0.1 + 3


@given(
    st.lists(st.floats(-1e6, 1e6), max_size=10),
    st.floats(0, 1),
    st.sampled_from(list(Surface)),
    st.booleans(),
)
def test_state_survives_json_bit_for_bit(bounds, confidence, surface, flag):
    said = Outcome(surface, confidence / 3.0, flag, 0.1 + 0.2)
    state = PreviewState.of((Stamp(b, b + 0.1, said) for b in bounds), bounds[-1] if bounds else None)
    back = PreviewState.from_json(json.loads(json.dumps(state.to_json())))
    assert back == state
    assert all(isinstance(stamp.outcome.surface, Surface) for stamp in back.stamps)


def test_negative_distances_are_refused():
    with pytest.raises(ValueError, match="negative"):
        PreviewConfig(hold_m=-1.0)


@given(st.lists(st.floats(0.0, 20.0), max_size=12).map(sorted), st.floats(0.0, 25.0))
def test_forward_drive_is_searched_as_any_other(positions_m, asked_m):
    state = drive(positions_m)
    assert state.ascending
    assert covering(state, CONFIG, asked_m) == covering(replace(state, ascending=False), CONFIG, asked_m)


def test_a_rolled_back_drive_is_known_as_one_after_json_too():
    state = drive([0.0, 1.0, 0.5])
    assert not state.ascending
    assert not PreviewState.from_json(json.loads(json.dumps(state.to_json()))).ascending


def test_of_more_stamps_than_fit_the_oldest_go_and_the_order_stays():
    config = PreviewConfig(resolution_m=0.0, hold_m=1e6)
    state = drive([float(k) for k in range(MOST_STAMPS + 100)], config)
    assert state.count == MOST_STAMPS
    assert [stamp.outcome.captured_s for stamp in state.stamps] == list(range(100, MOST_STAMPS + 100))
    assert frame_at(state, 101.9, config) is None
    assert frame_at(state, 102.6, config) == 100.0
    assert frame_at(state, 1e4, config) == MOST_STAMPS + 99
