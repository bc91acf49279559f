"""Dempster-Shafer fusion against brute force, hand-computed numbers and its invariances."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.vision.evidence import (
    EvidenceState,
    WeightLaw,
    basic_probability,
    combine,
    update_weights,
    visual_confidence,
)
from trpac_core.vision.networks import calibrated_probabilities

positive = st.floats(1e-4, 1.0)
mass = st.tuples(positive, positive, positive).map(lambda m: np.array(m) / sum(m))
patches = st.lists(mass, min_size=2, max_size=8).map(np.array)
weights = mass.map(lambda m: tuple(m.tolist()))


def dempster_by_enumeration(bodies):
    """Dempster's rule over all combinations of focal elements, sets of classes."""
    combined = {}
    for focal in product(range(3), repeat=len(bodies)):
        common = set.intersection(*({c} for c in focal))
        if common:
            (surface,) = common
            weight = np.prod([body[c] for body, c in zip(bodies, focal, strict=True)])
            combined[surface] = combined.get(surface, 0.0) + weight
    return np.array([combined.get(c, 0.0) for c in range(3)]) / sum(combined.values())


@given(mass, st.integers(1, 5))
def test_combination_is_dempsters_rule_by_enumeration(body, n):
    assert combine(body, n) == pytest.approx(dempster_by_enumeration([body] * n), rel=1e-9, abs=1e-300)


def test_combination_of_many_bodies_neither_under_nor_overflows():
    fused = combine(np.array([0.5, 0.5 - 1e-9, 1e-9]), 5000)
    assert np.isfinite(fused).all()
    assert fused.sum() == pytest.approx(1.0)
    assert combine(np.array([1.0, 0.0, 0.0]), 8)[0] == pytest.approx(1.0)


def test_basic_probability_by_hand():
    # Two patches say dry (weight 0.5), one says wet (0.3): (0.5 (0.8 + 0.6) + 0.3 0.1) / 1.3 for dry.
    evidence = np.array([[0.8, 0.1, 0.1], [0.6, 0.3, 0.1], [0.1, 0.7, 0.2]])
    expected = [0.73 / 1.3, (0.5 * 0.4 + 0.3 * 0.7) / 1.3, (0.5 * 0.2 + 0.3 * 0.2) / 1.3]
    assert basic_probability(evidence, (0.5, 0.3, 0.2)) == pytest.approx(expected)


@given(patches, weights, st.randoms())
def test_fusion_does_not_depend_on_the_order_of_patches(evidence, w, random):
    order = list(range(len(evidence)))
    random.shuffle(order)
    assert basic_probability(evidence[order], w) == pytest.approx(basic_probability(evidence, w))


@given(patches, weights)
def test_basic_probability_is_a_distribution_and_unanimity_survives(evidence, w):
    m = basic_probability(evidence, w)
    assert m.sum() == pytest.approx(1.0)
    assert (m >= evidence.min(axis=0) - 1e-12).all()
    assert (m <= evidence.max(axis=0) + 1e-12).all()
    if len(set(evidence.argmax(axis=1))) == 1:
        assert combine(m, len(evidence)).argmax() == evidence[0].argmax()


@given(patches, weights, st.permutations([0, 1, 2]))
def test_classes_are_treated_alike(evidence, w, order):
    if (np.diff(np.sort(evidence, axis=1)[:, 1:], axis=1) < 1e-9).any():
        return  # a patch's own class is not defined when its two largest are equal
    relabelled = basic_probability(evidence[:, order], tuple(w[i] for i in order))
    assert relabelled == pytest.approx(basic_probability(evidence, w)[list(order)])


def test_weight_update_in_the_printed_form_by_hand():
    # From thirds, 3 of 4 patches dry, 1 wet, sigma 0.5: arguments 0.541667, 0.291667, 0.166667.
    after = update_weights(EvidenceState(), np.array([0, 0, 1, 0]), WeightLaw(sigma=0.5))
    sigmoids = [0.632201, 0.572404, 0.541570]
    assert after.weights == pytest.approx([s / sum(sigmoids) for s in sigmoids], abs=1e-6)


@given(weights, st.lists(st.integers(0, 2), min_size=1, max_size=8), st.floats(0.0, 1.0))
def test_weights_are_a_distribution_and_in_the_printed_form_stay_in_its_band(w, classes, sigma):
    after = update_weights(EvidenceState(w), np.array(classes), WeightLaw(sigma)).weights
    assert sum(after) == pytest.approx(1.0)
    assert min(after) > 0.5 / (0.5 + 2 * 0.7311)
    assert max(after) < 0.7311 / (0.7311 + 2 * 0.5)


def test_history_tips_a_tie_towards_the_road_of_the_frames_before():
    state, law = EvidenceState(), WeightLaw()
    for _ in range(20):
        state = update_weights(state, np.array([2, 2, 2, 2]), law)
    tie = np.array([[0.7, 0.1, 0.2], [0.2, 0.1, 0.7]])
    assert state.weights[2] == max(state.weights)
    assert combine(basic_probability(tie, state.weights), 2).argmax() == 2


def test_steeper_sigmoid_gives_history_more_say():
    classes = np.array([1, 1, 1, 0])
    flat = update_weights(EvidenceState(), classes, WeightLaw())
    steep = update_weights(EvidenceState(), classes, WeightLaw(sigmoid_centre=1 / 3, sigmoid_slope=10.0))
    assert steep.weights[1] > flat.weights[1]


def test_weights_need_patches():
    with pytest.raises(ValueError, match="without patches"):
        update_weights(EvidenceState(), np.array([], dtype=int), WeightLaw())


def test_visual_confidence():
    assert visual_confidence(0.8, 0.9) == pytest.approx(0.72)


@given(st.lists(st.floats(-30, 30), min_size=3, max_size=3), st.floats(0.2, 10.0))
def test_temperature_never_changes_the_class_and_flattens_towards_thirds(logits, temperature):
    z = np.array([logits])
    p = calibrated_probabilities(z, temperature)
    assert p.sum() == pytest.approx(1.0)
    assert p[0, z.argmax()] == p.max()
    assert calibrated_probabilities(z, temperature * 2.0).max() <= p.max() + 1e-12
    assert calibrated_probabilities(z, 1e9) == pytest.approx(np.full((1, 3), 1 / 3), abs=1e-6)
