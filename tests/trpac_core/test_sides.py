"""One picture, two verdicts: each side as its own estimator would judge it, at the cost of one."""

from __future__ import annotations

import pytest
from ife_scene import CAMERA, DRY, SNOW, SPLIT, Masks, Middle, paint, split_road

from trpac_core.vision import ife as ife_module
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.surface_edges import lines_across
from trpac_core.vision.trajectory import Motion

STRAIGHT = Motion(12.0)


class Counting(Middle):
    """The classifier that reads the paint, and counts its runs."""

    runs = 0

    def verdicts(self, patches):
        self.runs += 1
        return super().verdicts(patches)


def test_each_side_gets_its_own_surface_from_one_segmentation_and_one_run():
    masks, classifier = Masks(), Counting()
    sides = SidesIfe(IfeConfig(camera=CAMERA), masks, classifier)
    _, left, right = sides.process(SidesState(), split_road(), STRAIGHT)
    assert (left.surface, right.surface) == (SNOW, DRY)
    assert left.flag
    assert right.flag
    assert (masks.calls, classifier.runs) == (1, 1)
    assert len(classifier.patches) == 2 * 4, "the near groups' patches alone"


@pytest.mark.parametrize("yaw_rate", [0.0, 0.2, -0.2])
def test_verdicts_are_those_of_two_estimators_bit_by_bit(yaw_rate):
    picture = split_road(0.3)
    motion = Motion(12.0, yaw_rate_rad_s=yaw_rate)
    sides, state = SidesIfe(IfeConfig(camera=CAMERA), Masks(), Middle()), SidesState()
    alone = {side: Ife(IfeConfig(camera=CAMERA, side=side), Masks(), Middle()) for side in ("left", "right")}
    states = dict.fromkeys(alone, IfeState())
    for _ in range(3):
        state, *verdicts = sides.process(state, picture, motion)
        for (side, ife), verdict in zip(alone.items(), verdicts, strict=True):
            states[side], own = ife.process(states[side], picture, motion)
            assert verdict.near == own.near
    for side, one in (("left", state.left), ("right", state.right)):
        assert one.evidence[0] == states[side].evidence[0]


def test_lines_across_the_road_are_looked_for_once_and_are_those_of_each_side(monkeypatch):
    """A border across the road on two frames: the first sees it, the second knows it."""
    found = []
    monkeypatch.setattr(ife_module, "lines_across", lambda *a: found.append(1) or lines_across(*a))
    sides, state = SidesIfe(IfeConfig(camera=CAMERA), Masks(), Middle()), SidesState()
    alone, own = Ife(IfeConfig(camera=CAMERA, side="right"), Masks(), Middle()), IfeState()
    for way_m in (0.0, 0.5):
        picture = paint(lambda x, y, border_m=4.0 - way_m: SPLIT[(x > border_m).astype(int)])
        motion = Motion(12.0, way_m=way_m)
        state, _, right = sides.process(state, picture, motion)
        assert len(found) == 1
        own, verdict = alone.process(own, picture, motion)
        assert right.near == verdict.near
        assert state.left.lines_m == state.right.lines_m == own.lines_m != ()
        found.clear()


def test_state_survives_json():
    sides = SidesIfe(IfeConfig(camera=CAMERA), Masks(), Middle())
    after, *_ = sides.process(SidesState(), split_road(), STRAIGHT)
    assert SidesState.from_json(after.to_json()) == after
    assert after != SidesState()


@pytest.mark.parametrize(("certainty", "flag"), [(3.0, True), (0.4, False)])
def test_a_receiver_that_knows_q_v_alone_sets_the_same_flag(certainty, flag):
    """Patches that hardly prefer a class: Q_v is above its threshold after the combination, the flag is down."""
    sides = SidesIfe(IfeConfig(camera=CAMERA), Masks(), Middle(certainty=certainty))
    _, left, _ = sides.process(SidesState(), split_road(), STRAIGHT)
    assert left.Q_v > 0.5
    assert left.flag is flag
    assert (left.told_by_bus(0.5) > 0.5) is flag
