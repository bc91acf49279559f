"""The frozen list of opened cases: what it covers, how it is judged, and that its cases are made as they were."""

from __future__ import annotations

import json

import pytest
from long import long
from numpy.testing import assert_allclose

from benchmarks.gap.withheld import frozen as module
from benchmarks.gap.withheld.frozen import COLUMNS, answered, expected_of, frozen, write_list
from benchmarks.gap.withheld.generator.camera_case import make_case
from benchmarks.gap.withheld.generator.camera_library import CAMERA_LIBRARY
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.table import Group

CASES = frozen()


def test_the_list_covers_effects_and_kinds_in_at_most_sixty_cases():
    assert len(CASES) <= 60
    assert len({(case.seed, case.spec.name) for case in CASES}) == len(CASES)
    blamed = {
        e
        for case in CASES
        if case.spec.group in (Group.RICH, Group.TYRE, Group.MILD)
        for e in case.spec.effects
    }
    assert blamed == {*LIBRARY, *CAMERA_LIBRARY}
    assert {case.spec.group for case in CASES} == set(Group) - {Group.TIMING}
    assert all(case.expected == expected_of(case.spec) for case in CASES)
    assert {case.right for case in CASES} <= {"yes", "no", ""}
    assert all(case.verdict for case in CASES if case.right)


def test_the_list_is_written_as_it_was_read(tmp_path, monkeypatch):
    before = module.LIST.read_text(encoding="utf-8")
    monkeypatch.setattr(module, "LIST", tmp_path / "frozen.csv")
    write_list(CASES)
    assert module.LIST.read_text(encoding="utf-8") == before
    assert before.splitlines()[0] == ",".join(COLUMNS)


@pytest.mark.parametrize(
    ("group", "said", "right"),
    [
        (Group.NO_GAP, ("no_gap", ()), "yes"),
        (Group.NO_GAP, ("unknown", ()), "no"),
        (Group.OUTSIDE, ("unknown", ()), "yes"),
        (Group.RICH, ("identified", ("torque_lag",)), "yes"),
        (Group.RICH, ("unknown", ("torque_lag",)), "no"),
        (Group.PAIR, ("compound", ("torque_delay", "wheel_speed_delay")), "yes"),
        (Group.REMOVED, ("identified", ("aero_drag",)), "no"),
    ],
)
def test_an_answer_is_held_to_the_right_one(group, said, right):
    names = {Group.RICH: "rich-torque_lag-1", Group.PAIR: "pair-torque_delay-wheel_speed_delay-0"}
    case = next(
        c
        for c in CASES
        if not c.spec.camera and c.spec.name == names.get(group, c.spec.name) and c.spec.group is group
    )
    verdict, causes = said
    seal = {"group": str(group), "effects": {e: {} for e in case.spec.effects}, "subsystems": [], "gap": 9.0}
    told = [{"effect": effect, "probability": 0.9, "parameters": {}} for effect in causes]
    diagnosis = {"verdict": verdict, "causes": told, "ambiguous_with": []}
    result = {"case": case.spec.name, "seal": seal, "diagnosis": diagnosis, "error": None}
    now = answered(case, json.loads(json.dumps(result)))
    assert (now.verdict, now.right) == (verdict, right)


MADE = {
    "no_gap-2-calm": (16325, [21.949654, 48.919623, 48.91052, 14.787047, 0.034232, 245.282206]),
    "rich-torque_lag-1": (4650, [-10.116511, 34.562968, 34.578502, 10.594491, 0.057089, 171.764645]),
}
"""Rows of the hold-out, and means of its torque, speeds, acceleration and place, as it was when it was opened."""


@pytest.mark.parametrize("name", MADE)
@long
def test_a_frozen_case_is_made_as_it_was(name):
    frozen_case = next(case for case in CASES if case.spec.name == name and not case.spec.camera)
    log = make_case(frozen_case.spec, frozen_case.seed, frozen_case.forms, frozen_case.attempt).logs[
        "holdout"
    ]
    rows, means = MADE[name]
    assert len(log) == rows
    columns = ["wheel_torque_fl_nm", "wheel_speed_fl_rad_s", "wheel_speed_rr_rad_s", "vehicle_speed_m_s"]
    told = log[[*columns, "accel_x_m_s2", "position_m"]].mean()
    assert_allclose(told, means, rtol=1e-5, atol=1e-5)
