"""The interval against numpy on drawn beliefs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import norm

from trpac_core.robust.belief import hypotheses, unread
from trpac_core.robust.interval import interval
from trpac_core.robust.roads import cells
from trpac_core.robust.tyres import TYRES

THETA = cells()
EMPTY = unread(hypotheses(TYRES), np.full(len(THETA), 1.0 / len(THETA)))


def of(road, tyre):
    """Interval of a belief, and the probability of each cell."""
    road, tyre = np.asarray(road), np.asarray(tyre)
    road, tyre = road / road.sum(axis=1, keepdims=True), tyre / tyre.sum()
    belief = type(EMPTY)(tyre, road, *[EMPTY.offset] * 5)
    return interval(belief, THETA), tyre @ road


BELIEFS = st.tuples(
    arrays(float, (4, len(THETA)), elements=st.floats(1e-6, 1.0)),
    arrays(float, 4, elements=st.floats(0.01, 1.0)),
)


@given(BELIEFS)
def test_mean_and_deviation_are_numpys(belief):
    said, likely = of(*belief)
    assert said.mean == pytest.approx(np.average(THETA, weights=likely), rel=1e-9)
    variance = np.average((THETA - said.mean) ** 2, weights=likely)
    assert said.std == pytest.approx(np.sqrt(variance), rel=1e-6)


@given(BELIEFS)
def test_the_bounds_hold_their_quantiles_and_no_more_than_a_cell_beyond(belief):
    said, likely = of(*belief)
    low, high = said.low / 0.86, said.high / 1.06
    assert high == pytest.approx(said.unmoved_high)
    for bound, quantile in ((low, 0.005), (said.clip, 0.025)):
        at = int(np.argmin(np.abs(THETA - bound)))
        assert THETA[at] == pytest.approx(bound)
        assert likely[: at + 1].sum() <= quantile + 1e-12 or at == 0
        assert likely[: at + 2].sum() > quantile - 1e-12
    at = int(np.argmin(np.abs(THETA - high)))
    assert THETA[at] == pytest.approx(high)
    last = len(THETA) - 1
    assert likely[:at].sum() >= 0.965 - 1e-12 or at == last
    assert likely[: at - 1].sum() < 0.965 + 1e-12 or at == last


@given(BELIEFS)
def test_the_bounds_are_in_order(belief):
    said, _ = of(*belief)
    assert said.low < said.clip <= said.mean <= said.unmoved_high < said.high


@given(BELIEFS, st.integers(0, 60))
def test_a_better_road_does_not_move_a_bound_down(belief, up):
    """All of it some cells up; what would leave the cells stays in the last one."""
    road, tyre = belief
    road = road / road.sum(axis=1, keepdims=True)
    better = np.zeros_like(road)
    better[:, up:] = road[:, : len(THETA) - up]
    better[:, -1] += road[:, len(THETA) - up :].sum(axis=1)
    worse, moved = of(road, tyre)[0], of(better, tyre)[0]
    for name in ("low", "high", "clip", "mean"):
        assert getattr(moved, name) >= getattr(worse, name) - 1e-9


@pytest.mark.parametrize("at", [0, 50, len(THETA) - 1])
def test_a_sure_belief_has_the_next_cells_as_bounds(at):
    road = np.zeros((4, len(THETA)))
    road[:, at] = 1.0
    said, _ = of(road, np.ones(4))
    assert (said.mean, said.std) == (pytest.approx(THETA[at]), pytest.approx(0.0, abs=1e-7))
    assert said.low == pytest.approx(0.86 * THETA[max(at - 1, 0)])
    assert said.clip == THETA[max(at - 1, 0)]
    assert said.unmoved_high == THETA[min(at + 1, len(THETA) - 1)]


def test_a_normal_belief_has_a_normal_distributions_bounds():
    """0.5 % lies 2.58 deviations below, 97.5 % lies 1.96 above; a bound is up to one and a half cells beyond."""
    road = norm.pdf(THETA, 0.5, 0.1) * np.gradient(THETA)
    said, _ = of(np.tile(road, (4, 1)), np.ones(4))
    low, clip, high = norm.ppf([0.005, 0.025, 0.965], 0.5, 0.1)
    for beyond, at in (
        (low - said.low / 0.86, low),
        (clip - said.clip, clip),
        (said.unmoved_high - high, high),
    ):
        assert 0.0 < beyond < 1.5 * max(0.006, 0.025 * at) * 1.03


def test_a_tyre_that_is_not_believed_has_no_say():
    road = np.full((4, len(THETA)), 1e-9)
    road[0, 20], road[1:, 90] = 1.0, 1.0
    assert of(road, [1.0, 0.0, 0.0, 0.0])[0].mean == pytest.approx(THETA[20], abs=1e-4)
    assert of(road, [0.5, 0.5, 0.0, 0.0])[0].mean == pytest.approx(0.5 * (THETA[20] + THETA[90]), abs=1e-4)
