"""Patches along the road: read forwards and backwards as every sequence of classes, counted out one by one, says."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trpac_core.vision.surface_hmm import (
    CELL_M,
    CHANGES_AT_LINE,
    CHANGES_PER_M,
    LEAST_PROBABILITY,
    OWN_SHARE,
    SAY,
    SAY_BEFORE,
    Passed,
    among_neighbours,
    passed_by,
)

DRY, WET, DOUBTFUL = (0.9, 0.08, 0.02), (0.1, 0.85, 0.05), (0.3, 0.6, 0.1)

places = st.lists(st.floats(-3.0, 8.0), min_size=1, max_size=12)
triples = st.tuples(*[st.floats(0.0, 1.0)] * 3).filter(lambda p: sum(p) > 0.1)


def drawn(data, ahead_m):
    found = np.array(data.draw(st.lists(triples, min_size=len(ahead_m), max_size=len(ahead_m))))
    return found / found.sum(axis=1, keepdims=True)


def counted(ahead_m, probabilities, lines_m=(), first_cell=(1.0, 1.0, 1.0), before=0):
    """Sum over all sequences of classes of the cells, each as likely as its changes and what is seen make it."""
    first, last = (int(np.floor(end / CELL_M)) for end in (min(ahead_m), max(ahead_m)))
    ends = {CELL_M * number: CHANGES_PER_M * CELL_M for number in range(first + 1, last + 1)}
    ends |= {line: CHANGES_AT_LINE for line in lines_m if min(ahead_m) < line <= max(ahead_m)}
    cells = [sum(end <= ahead for end in ends) for ahead in ahead_m]
    changes = [ends[end] for end in sorted(ends)]
    likely = probabilities.clip(LEAST_PROBABILITY)
    likely = likely / likely.sum(axis=1, keepdims=True)
    own = len(likely) - before
    likely = np.concatenate((likely[:own] ** SAY, likely[own:] ** SAY_BEFORE))
    found = np.zeros((len(ends) + 1, 3))
    for classes in product(range(3), repeat=len(found)):
        steps = zip(pairwise(classes), changes, strict=True)
        weight = np.prod([1.0 - change if a == b else change / 2.0 for (a, b), change in steps])
        weight *= np.prod([triple[classes[cell]] for cell, triple in zip(cells, likely, strict=True)])
        weight *= first_cell[classes[0]]
        found[np.arange(len(found)), classes] += weight
    found /= found.sum(axis=1, keepdims=True)
    return OWN_SHARE * probabilities + (1.0 - OWN_SHARE) * found[cells]


@pytest.mark.parametrize(("seed", "before"), [(0, 0), (1, 1), (2, 2), (3, 6)])
@pytest.mark.parametrize("lines_m", [(), (2.6,), (2.0, 2.55, 3.1)])
def test_it_is_the_sum_over_all_sequences_of_classes(seed, before, lines_m):
    rng = np.random.default_rng(seed)
    ahead_m = rng.uniform(2.05, 2.0 + 6 * CELL_M, 6)
    probabilities = rng.dirichlet((0.5, 0.5, 0.5), 6)
    found = among_neighbours(ahead_m, probabilities, lines_m, before=before)
    assert_allclose(found, counted(ahead_m, probabilities, lines_m, before=before), rtol=1e-9)


def test_a_class_ends_rather_at_a_line():
    """A doubtful patch between two surfaces goes with those that no line parts it from."""
    ahead_m = np.array([2.1, 2.4, 2.7, 3.2, 3.6, 3.9])
    probabilities = np.array([DRY, DRY, DRY, (0.45, 0.45, 0.1), WET, WET])
    before, after = (among_neighbours(ahead_m, probabilities, [line])[3] for line in (2.9, 3.4))
    assert before[1] > after[1] + 0.05
    assert after.argmax() == 0


@given(places, st.data())
def test_probabilities_stay_such_whatever_is_seen(ahead_m, data):
    found = among_neighbours(np.array(ahead_m), drawn(data, ahead_m))
    assert found.shape == (len(ahead_m), 3)
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert_allclose(found.sum(axis=1), 1.0)


@given(places, st.data())
def test_neither_the_order_of_patches_nor_of_classes_matters(ahead_m, data):
    ahead_m = np.array(ahead_m)
    probabilities = drawn(data, ahead_m)
    order = np.array(data.draw(st.permutations(range(len(ahead_m)))))
    classes = list(data.draw(st.permutations(range(3))))
    found = among_neighbours(ahead_m[order], probabilities[order][:, classes])
    assert_allclose(found, among_neighbours(ahead_m, probabilities)[order][:, classes], atol=1e-12)


def test_the_road_around_mends_a_lone_mistake_and_leaves_a_border():
    ahead_m = np.arange(0.1, 6.0, 0.25)
    dry_then_wet = np.array([DRY if x < 3.0 else WET for x in ahead_m])
    mistaken = dry_then_wet.copy()
    mistaken[4] = DOUBTFUL
    found = among_neighbours(ahead_m, mistaken).argmax(axis=1)
    assert (found == dry_then_wet.argmax(axis=1)).all()


def test_what_lies_far_off_says_less():
    """A doubtful patch hears a sure one the less the further it is: the road may have changed between."""
    heard = [
        among_neighbours(np.array([0.0, far_m]), np.array([(1 / 3, 1 / 3, 1 / 3), WET]))[0, 1]
        for far_m in (0.3, 3.0, 30.0, 3000.0)
    ]
    assert np.all(np.diff(heard) < 0.0)
    assert heard[-1] == pytest.approx(1.0 / 3.0, abs=0.01)


def test_nothing_seen_is_nothing_said():
    assert among_neighbours(np.empty(0), np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("way_m", "lines_m"), [(0.0, ()), (4.0, ()), (0.3, (1.9, 2.6)), (60.0, (2.3,))])
def test_road_passed_counts_as_a_first_cell_that_far_behind(seed, way_m, lines_m):
    rng = np.random.default_rng(seed)
    ahead_m = np.append(2.05, rng.uniform(2.05, 2.0 + 5 * CELL_M, 4))
    probabilities, told = rng.dirichlet((0.5, 0.5, 0.5), 5), rng.dirichlet((0.5, 0.5, 0.5))
    passed = Passed(2.05 - way_m, tuple(told))
    # Of many small changes one after the other, as a matrix to a power.
    step_m, crossed = 1e-3, sum(passed.end_m < line <= 2.05 for line in lines_m)
    once = changing(CHANGES_PER_M * step_m)
    moved = told @ np.linalg.matrix_power(once, round(way_m / step_m))
    moved = moved @ np.linalg.matrix_power(changing(CHANGES_AT_LINE), crossed)
    found = among_neighbours(ahead_m, probabilities, lines_m, passed)
    assert_allclose(found, counted(ahead_m, probabilities, lines_m, moved), rtol=1e-4)


def changing(change):
    """How likely each class follows each other."""
    return np.full((3, 3), change / 2.0) + (1.0 - 1.5 * change) * np.eye(3)


@pytest.mark.parametrize("lines_m", [(), (0.6,), (1.4, 2.6)])
def test_patches_passed_tell_of_the_road_to_come_what_they_would_tell_if_they_were_kept(lines_m):
    rng = np.random.default_rng(5)
    ahead_m = np.sort(rng.uniform(0.0, 4.0, 20))
    probabilities = rng.dirichlet((4.0, 4.0, 4.0), 20)
    before = ahead_m < 2.0
    passed = passed_by(None, ahead_m[before], probabilities[before], lines_m, 2.0)
    apart = among_neighbours(
        ahead_m[~before], probabilities[~before], lines_m, passed, before=np.count_nonzero(~before)
    )
    together = among_neighbours(ahead_m, probabilities, lines_m, before=len(ahead_m))
    assert_allclose(apart, together[~before], atol=2e-4)
    twice = passed_by(None, ahead_m[:4], probabilities[:4], lines_m, ahead_m[3])
    twice = passed_by(twice, ahead_m[4:][before[4:]], probabilities[4:][before[4:]], lines_m, 2.0)
    assert_allclose(twice.probabilities, passed.probabilities, atol=2e-4)


def test_road_passed_mends_a_doubtful_patch_the_less_the_longer_ago_it_was():
    dry = Passed(0.0, (0.98, 0.01, 0.01))
    heard = [
        among_neighbours(np.array([way_m]), np.array([DOUBTFUL]), (), dry)[0, 0]
        for way_m in (0.1, 10.0, 100.0, 1e4)
    ]
    assert np.all(np.diff(heard) < 0.0)
    assert heard[0] > 0.6
    assert heard[-1] == pytest.approx(among_neighbours(np.array([0.0]), np.array([DOUBTFUL]))[0, 0], abs=1e-6)


@given(places, st.data(), st.floats(0.0, 100.0), st.tuples(*[st.floats(0.01, 1.0)] * 3))
def test_road_passed_is_never_sure(ahead_m, data, further_m, told):
    passed = Passed(min(ahead_m) - 1.0, tuple(np.array(told) / sum(told)))
    end_m = max(ahead_m) + further_m
    found = passed_by(passed, np.array(ahead_m), drawn(data, ahead_m), (), end_m)
    assert found.end_m == end_m
    assert sum(found.probabilities) == pytest.approx(1.0)
    assert min(found.probabilities) >= LEAST_PROBABILITY / (1.0 + 2.0 * LEAST_PROBABILITY)


def test_road_passed_without_patches_only_moves_on():
    assert passed_by(Passed(1.0, (0.5, 0.3, 0.2)), np.empty(0), np.empty((0, 3)), (), 1.0) == Passed(
        1.0, (0.5, 0.3, 0.2)
    )
