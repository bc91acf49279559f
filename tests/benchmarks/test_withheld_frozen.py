"""The frozen list of opened cases: what it covers, how it is judged, and that its cases are made as they were."""

from __future__ import annotations

import json

import pytest
from long import long
from numpy.testing import assert_allclose

from benchmarks.gap.withheld import frozen as module
from benchmarks.gap.withheld.frozen import COLUMNS, answered, expected_of, frozen, write_list
from benchmarks.gap.withheld.generator.camera_library import CAMERA_LIBRARY
from benchmarks.gap.withheld.generator.cases import make_case
from benchmarks.gap.withheld.generator.forms import Edition
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.table import Group, table

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
    seal["forms"] = dict.fromkeys(case.spec.effects, "as_told")
    told = [{"effect": effect, "probability": 0.9, "parameters": {}} for effect in causes]
    diagnosis = {"verdict": verdict, "causes": told, "ambiguous_with": []}
    result = {"case": case.spec.name, "seal": seal, "diagnosis": diagnosis, "error": None}
    now = answered(case, json.loads(json.dumps(result)))
    assert (now.verdict, now.right) == (verdict, right)


MADE = [
    (
        1,
        2590,
        [2.654038, 5.794179, 73.006508, 73.008343, 73.0164, 73.017294, 22.752997, 0.036643, 313.767558],
    ),
    (
        5,
        2590,
        [4.700745, 1.201473, 73.33288, 73.329822, 73.319396, 73.319787, 22.852346, 0.023536, 313.361189],
    ),
    (
        9,
        3885,
        [-3.358301, 4.494723, 72.829255, 72.830309, 72.857891, 72.857666, 22.705442, 0.004159, 315.407296],
    ),
]
"""Edition, rows, and means of the columns of a second log as it was made when the edition was opened."""


@pytest.mark.parametrize(("edition", "rows", "means"), MADE)
@long
def test_editions_make_the_logs_that_they_made(edition, rows, means):
    spec = next(spec for spec in table("full") if spec.name == "no_gap-2-calm")
    log = make_case(spec, 1, Edition(edition, 1)).logs["fit_2"]
    assert len(log) == rows
    told = log.drop(columns=["time_s", "wheel_torque_fr_nm", "wheel_torque_rr_nm"]).mean()
    assert_allclose(told, means, rtol=1e-5, atol=1e-5)
