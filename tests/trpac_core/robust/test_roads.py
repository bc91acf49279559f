"""The cells, the camera's priors and its memory: what they promise in words, as numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from trpac_core.robust.roads import NONE, ClassUnderWheel, advanced, cells, of_class, prior_of, priors, unseen

DRY, WET, SNOW = range(3)
VALUES = (0.8, 0.6, 0.2)
THETA = cells()
KNOWN = priors(THETA, VALUES)
CLASSES = [(KNOWN.new, 0.15, 0.2), (KNOWN.stood, 0.13, 0.1)]
"""Priors of each class, their scatter and the probability that the class says nothing."""


def test_the_cells_reach_from_wet_ice_to_a_racing_tyre_and_are_narrow_enough():
    assert THETA[0] == 0.02
    assert THETA[-2] < 1.2 == THETA[-1]
    assert np.diff(THETA)[:-1] == pytest.approx(np.maximum(0.006, 0.025 * THETA[:-2]), rel=1e-9)


def test_without_a_camera_all_frictions_are_alike_but_wet_ice():
    density = unseen(THETA) / np.gradient(THETA)
    assert density.max() / density.min() == pytest.approx(5.0)
    assert (density[THETA < 0.05] < 0.5 * density[-1]).all()
    assert density[THETA >= 0.05] == pytest.approx(density[-1])


@pytest.mark.parametrize("prior", [*KNOWN.new, *KNOWN.stood, KNOWN.none])
def test_every_prior_is_a_probability(prior):
    assert prior.shape == THETA.shape
    assert prior.sum() == pytest.approx(1.0, abs=1e-12)
    assert (prior > 0.0).all()


@pytest.mark.parametrize(("rows", "scatter", "wrong"), CLASSES)
def test_a_class_is_a_normal_distribution_and_a_share_that_says_nothing(rows, scatter, wrong):
    for value, prior in list(zip(VALUES, rows, strict=True))[1:]:
        edges = np.concatenate([[0.017], 0.5 * (THETA[1:] + THETA[:-1]), [1.5 * THETA[-1] - 0.5 * THETA[-2]]])
        mass = np.diff(norm.cdf(edges, value, scatter))
        assert prior == pytest.approx((1.0 - wrong) * mass / mass.sum() + wrong * unseen(THETA), abs=4e-4)
        inside = prior[np.abs(THETA - value) < 0.15].sum()
        assert inside > 0.55


@pytest.mark.parametrize(("rows", "scatter", "wrong"), CLASSES)
def test_above_the_greatest_class_all_frictions_are_alike(rows, scatter, wrong):
    likely = (rows[DRY] - wrong * unseen(THETA)) / np.gradient(THETA)
    above = likely[THETA >= 0.8]
    assert above == pytest.approx(above[0], rel=1e-9)
    low = int(np.argmin(np.abs(THETA - 0.6)))
    off = (THETA[low] - 0.8) / scatter
    assert likely[low] / above[0] == pytest.approx(math.exp(-0.5 * off * off), rel=1e-9)


def test_which_class_is_the_greatest_does_not_depend_on_their_order():
    other = priors(THETA, VALUES[::-1])
    assert (other.new[::-1] == KNOWN.new).all()
    assert (other.stood[::-1] == KNOWN.stood).all()


def test_a_class_that_is_not_the_greatest_is_even_about_its_value():
    found = of_class(np.linspace(0.0, 1.2, 121), 0.6, False, 0.1, 0.0)
    assert found == pytest.approx(found[::-1], rel=1e-9)


# Memory


def over(memory, *stretches, step_m=0.0625):
    """Memory after stretches of (class, way [m]), with the greatest share, and the ways at which a class stood."""
    share, stood, way_m = 0.0, [], 0.0
    for given_class, length_m in stretches:
        for _ in range(round(length_m / step_m)):
            way_m += step_m
            change = advanced(memory, given_class, step_m)
            memory, share = change.memory, max(share, change.share)
            stood += [way_m] if change.stood else []
    return memory, share, stood


@given(st.floats(0.0, 100.0), st.floats(0.0, 100.0))
def test_the_road_changes_the_more_the_longer_the_way(a, b):
    shares = [advanced(ClassUnderWheel(), NONE, way).share for way in sorted((a, b))]
    assert 0.0 <= shares[0] <= shares[1] < 1.0


def test_without_a_camera_the_road_changes_every_50_m():
    share = advanced(ClassUnderWheel(), NONE, 50.0).share
    assert share == pytest.approx(1.0 - math.exp(-1.0))
    kept = 1.0
    for _ in range(50):
        kept *= 1.0 - advanced(ClassUnderWheel(), NONE, 1.0).share
    assert kept == pytest.approx(1.0 - share, rel=1e-12)
    assert advanced(ClassUnderWheel(), NONE, -1.0).share == advanced(ClassUnderWheel(), NONE, 1.0).share


def test_a_new_class_counts_a_little_and_one_that_has_stood_4_m_much():
    first = advanced(ClassUnderWheel(), SNOW, 0.05)
    assert first.share == pytest.approx(0.36)
    assert not first.stood
    assert prior_of(first.memory, SNOW, KNOWN) is not KNOWN.none
    assert (prior_of(first.memory, SNOW, KNOWN) == KNOWN.new[SNOW]).all()
    memory, share, _ = over(first.memory, (SNOW, 3.8))
    assert share < 0.01
    assert memory.stood == NONE
    memory, share, stood = over(memory, (SNOW, 5.0))
    assert len(stood) == 1
    assert share == pytest.approx(0.9)
    assert (prior_of(memory, SNOW, KNOWN) == KNOWN.stood[SNOW]).all()
    assert (prior_of(memory, NONE, KNOWN) == KNOWN.stood[SNOW]).all()


def test_a_class_stands_after_4_m():
    assert over(ClassUnderWheel(), (WET, 6.0))[2] == [4.0]
    assert advanced(ClassUnderWheel(WET, 3.5), WET, -0.5).stood
    assert not advanced(ClassUnderWheel(WET, 3.5), WET, 0.4).stood


def test_a_burst_of_wrong_pictures_turns_little_and_leaves_what_stood():
    memory, _, _ = over(ClassUnderWheel(), (DRY, 6.0))
    after, share, stood = over(memory, (SNOW, 3.0))
    assert share == pytest.approx(0.36)
    assert (stood, after.stood) == ([], DRY)
    assert (prior_of(after, SNOW, KNOWN) == KNOWN.new[SNOW]).all()
    # Back to what stood nothing has changed.
    back, share, stood = over(after, (DRY, 10.0))
    assert share < 0.01
    assert (stood, back.stood) == ([], DRY)
    assert (prior_of(after, DRY, KNOWN) == KNOWN.stood[DRY]).all()


def test_bursts_that_change_never_stand():
    bursts = [(SNOW, 1.0), (WET, 1.0)] * 10
    memory, _, stood = over(ClassUnderWheel(), *bursts)
    assert (stood, memory.stood) == ([], NONE)


def test_gaps_between_pictures_do_not_set_a_class_back():
    memory, share, stood = over(ClassUnderWheel(), *[(WET, 0.5), (NONE, 0.5)] * 10)
    assert stood == [pytest.approx(7.5)]
    assert (memory.stood, share) == (WET, pytest.approx(0.9))


def test_a_class_that_stood_is_forgotten_after_4_m_without_any():
    memory, _, _ = over(ClassUnderWheel(), (SNOW, 5.0))
    kept, share, _ = over(memory, (NONE, 3.9))
    assert (kept.stood, share) == (SNOW, pytest.approx(1.0 - math.exp(-0.02 * 0.0625)))
    lost, share, stood = over(kept, (NONE, 0.3))
    assert (lost.stood, stood) == (NONE, [])
    assert share < 0.01
    assert (prior_of(lost, NONE, KNOWN) == KNOWN.none).all()
    # A class in between starts the count anew.
    kept, _, _ = over(memory, (NONE, 3.9), (SNOW, 0.1), (NONE, 3.9))
    assert kept.stood == SNOW


def test_another_class_stands_in_place_of_the_first():
    memory, _, _ = over(ClassUnderWheel(), (DRY, 5.0))
    memory, share, stood = over(memory, (SNOW, 6.0))
    assert (memory.stood, len(stood), share) == (SNOW, 1, pytest.approx(0.9))


def test_a_long_way_in_one_step_counts_as_such():
    """A way after which the road has changed anyway outweighs what the camera turns."""
    assert advanced(ClassUnderWheel(), SNOW, 300.0).share == pytest.approx(1.0 - math.exp(-6.0))
