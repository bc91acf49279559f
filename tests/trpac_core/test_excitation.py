"""The fuzzy scheduler against the whole of Table 2."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trpac_core.excitation import K_V_LIMIT, THRESHOLD_LIMIT, FuzzyScheduler, Partition

from trpac_core import tyre

TABLE_2 = (("SS", "SM", "SB"), ("MS", "MM", "MB"), ("BS", "BM", "BB"))
LETTER = {"S": 0, "M": 1, "B": 2}
SCHEDULER = FuzzyScheduler()


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.2))
def test_two_interpolations_are_the_nine_rules(theta_img, difference):
    """Product inference over all nine rules of Table 2, centre of gravity over one value per output set."""
    rows = SCHEDULER.theta_sets.memberships(theta_img)
    columns = SCHEDULER.difference_sets.memberships(difference)
    K_v = total = 0.0
    for row, rules in zip(rows, TABLE_2, strict=True):
        for column, rule in zip(columns, rules, strict=True):
            K_v += row * column * SCHEDULER.K_v_values[LETTER[rule[1]]]
            total += row * column
    assert total == pytest.approx(1.0)
    assert SCHEDULER.K_v(difference) == pytest.approx(K_v / total, abs=1e-12)


@given(st.floats(0.0, 1.0), st.floats(1000.0, 6000.0), st.floats(20e3, 100e3))
def test_outputs_keep_to_their_domains(theta_img, load, stiffness):
    assert 0.0 < SCHEDULER.threshold(theta_img, load, stiffness, 0.001) <= THRESHOLD_LIMIT
    assert all(0.0 <= SCHEDULER.K_v(d) <= K_V_LIMIT for d in np.linspace(0.0, 1.2, 7))


def test_surfaces_rise_and_the_class_values_own_scatter_is_left_alone():
    thresholds = [SCHEDULER.threshold(t, 3000.0, 5e4, 0.0) for t in np.linspace(0.0, 1.0, 21)]
    gains = [SCHEDULER.K_v(d) for d in np.linspace(0.0, 1.2, 25)]
    assert thresholds == sorted(thresholds)
    assert gains == sorted(gains)
    assert SCHEDULER.K_v(0.1) == 0.0
    assert SCHEDULER.K_v(0.15) == 0.0
    assert SCHEDULER.K_v(0.6) == K_V_LIMIT


@pytest.mark.parametrize("load", [2000.0, 2900.0, 4000.0])
@pytest.mark.parametrize("stiffness", [20e3, 40e3, 50e3, 60e3])
def test_threshold_follows_the_tyre_at_hand(stiffness, load):
    """On a wet road the estimator starts where a road 0.1 more slippery than its class begins to show."""
    slip = SCHEDULER.threshold(0.6, load, stiffness, 0.0)
    assert tyre.friction_by_theta(0.5, slip, load, stiffness) == pytest.approx(0.1, abs=0.05)


def test_middle_friction_road_at_50_kN_lies_where_the_tyre_shows_it():
    """At 50 kN on 0.5 the tyre shows theta from slip 0.014 to 0.02 on."""
    assert 0.014 < SCHEDULER.threshold(0.6, 2895.0, 50e3, 0.0) < 0.02


def test_noise_keeps_the_threshold_up_and_without_a_picture_the_road_may_be_slippery():
    quiet, noisy = (SCHEDULER.threshold(None, 3000.0, 5e4, deviation) for deviation in (0.0, 0.004))
    assert quiet == SCHEDULER.threshold(0.2, 3000.0, 5e4, 0.0) < SCHEDULER.threshold(0.6, 3000.0, 5e4, 0.0)
    assert noisy == pytest.approx(3.0 * 0.004)


def test_sets_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match=r"0\.5, 0\.4, 0\.8"):
        Partition(0.5, 0.4, 0.8)
