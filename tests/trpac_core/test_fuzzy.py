"""The fuzzy sets against the whole of Table 2."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.dife import DIFFERENCE_SETS, Gains, visual_gain
from trpac_core.fuzzy import K_V_LIMIT, Partition
from trpac_core.paper import THETA_SETS

TABLE_2 = (("SS", "SM", "SB"), ("MS", "MM", "MB"), ("BS", "BM", "BB"))
LETTER = {"S": 0, "M": 1, "B": 2}


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.2))
def test_two_interpolations_are_the_nine_rules(theta_img, difference):
    """Product inference over all nine rules of Table 2, centre of gravity over one value per output set."""
    rows, columns = THETA_SETS.memberships(theta_img), DIFFERENCE_SETS.memberships(difference)
    K_v = total = 0.0
    for row, rules in zip(rows, TABLE_2, strict=True):
        for column, rule in zip(columns, rules, strict=True):
            K_v += row * column * Gains().K_v_values[LETTER[rule[1]]]
            total += row * column
    assert total == pytest.approx(1.0)
    assert visual_gain(Gains(), 0.0, difference) == pytest.approx(K_v / total, abs=1e-12)


def test_the_gain_rises_to_its_limit_and_leaves_the_scatter_of_roads_about_their_class_alone():
    found = [visual_gain(Gains(), 0.8, 0.8 - 0.05 * step) for step in range(25)]
    assert found == sorted(found)
    assert found[:4] == [0.0, 0.0, 0.0, pytest.approx(0.0)]
    assert found[12] == pytest.approx(K_V_LIMIT)
    assert visual_gain(Gains(), 0.2, 0.6) == pytest.approx(visual_gain(Gains(), 0.6, 0.2))


def test_sets_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match=r"0\.5, 0\.4, 0\.8"):
        Partition(0.5, 0.4, 0.8)
