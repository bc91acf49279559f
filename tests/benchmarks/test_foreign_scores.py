"""Scores of the diagnosis on cars of other simulators."""

import pytest

from benchmarks.gap.foreign.__main__ import Answer, interval, score


def answer(effects, verdict, ranked, named=(), probability=0.93):
    return Answer("case", tuple(effects), verdict, tuple(named), tuple(ranked), probability, 1.0)


def lines(*answers):
    return {what: (hits, cases) for what, hits, cases, _ in score(answers)}


def test_a_set_with_the_truth_in_it_is_found_and_is_no_wrong_answer():
    found = lines(
        answer(["mass_offset"], "ambiguous", ["torque_gain", "mass_offset"], ["torque_gain", "mass_offset"])
    )
    assert found["true effect first or in the set"] == (1, 1)
    assert found["surely wrong"] == (0, 1)


def test_what_is_ranked_first_but_not_blamed_is_not_found():
    found = lines(answer(["mass_offset"], "unknown", ["mass_offset"]))
    assert found["true effect first or in the set"] == (0, 1)
    assert found["true effect in the first two"] == (0, 1)


def test_one_wrong_name_is_surely_wrong_on_any_case():
    wrong = answer(["mass_offset"], "partial", ["aero_drag", "mass_offset"])
    calm = answer([], "identified", ["aero_drag"])
    outside = answer(["unknown"], "partial", ["aero_drag"])
    found = lines(wrong, calm, outside)
    assert found["surely wrong"] == (3, 3)
    assert found["no fault: an effect blamed"] == (1, 1)
    assert found["outside the library: blamed surely"] == (1, 1)
    assert found["true effect in the first two"] == (1, 1)
    assert found["told with 0.9 and more: right"] == (0, 3)


def test_both_of_two_effects_stand_among_the_first_three():
    pair = answer(["mass_offset", "torque_lag"], "compound", ["torque_lag", "torque_gain", "mass_offset"])
    assert lines(pair)["two effects: both in the first three"] == (1, 1)


@pytest.mark.parametrize(
    ("hits", "cases", "low", "high"), [(0, 10, 0.0, 0.3085), (10, 10, 0.6915, 1.0), (5, 10, 0.1871, 0.8129)]
)
def test_intervals_are_those_of_clopper_and_pearson(hits, cases, low, high):
    assert interval(hits, cases) == pytest.approx((low, high), abs=1e-4)
