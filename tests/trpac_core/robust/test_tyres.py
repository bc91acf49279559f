"""The curves of the tyre hypotheses: their shape by what it is said to be, their slopes by differences."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from trpac_core import tyre
from trpac_core.robust.tyres import FORMULAS, TOLD, TYRES, curves, dugoff, peaked, sliding

THETA = st.floats(0.05, 1.2)
SLIP = st.floats(0.001, 0.9)
SIGNED = SLIP | SLIP.map(lambda slip: -slip)
LOAD = st.floats(1500.0, 6000.0)
STIFFNESS = st.floats(20_000.0, 120_000.0)
PEAK = st.floats(2.05, 4.0)
FALL = st.floats(0.0, 1.0)
STEP = 1e-6
PEAKS, FALLS = ([[getattr(t, name)] for t in TYRES] for name in ("peak", "fall"))


def curves_at(theta, slip, softness, load=3000.0, stiffness=5e4, mean_load=3000.0):
    """Of all tyres in one cell."""
    whole = np.full((len(TYRES), 1), 1.0)
    of = np.array([theta]), whole * slip, whole * softness
    return curves(*of, load, stiffness, mean_load, np.array(PEAKS), np.array(FALLS))


def one_peaked(theta, slip, stiffness, peak, fall):
    return peaked(*map(np.array, (theta, slip, stiffness, peak, fall)))


@given(THETA, SLIP, LOAD, STIFFNESS)
def test_dugoff_is_the_told_formula(theta, slip, load, stiffness):
    found = dugoff(np.array(theta), np.array(slip), load, np.array(stiffness))
    assert found.friction == pytest.approx(tyre.used_friction(theta, slip, load, stiffness), rel=1e-12)
    slope = tyre.friction_by_slip(theta, slip, load, stiffness)
    assert found.by_slip == pytest.approx(slope, rel=1e-9, abs=1e-9)


@given(THETA, SIGNED, st.floats(-0.5, 0.5), LOAD, STIFFNESS)
def test_slopes_of_all_tyres_agree_with_differences(theta, slip, softness, load, stiffness):
    def friction(slip, softness):
        return curves_at(theta, slip, softness, load, stiffness, 3500.0).friction[:, 0]

    edge = STEP * math.copysign(1.0, slip)
    around = [friction(slip + k * edge, softness) for k in (-3, -1, 0, 1, 3)]
    # A formula has no slope where its two branches meet.
    assume((np.abs(around[0] - 2.0 * around[2] + around[4]) < 1e-7).all())
    by_slip = (around[3] - around[1]) / (2.0 * STEP)
    by_stiffness = (friction(slip, softness - STEP) - friction(slip, softness + STEP)) / (2.0 * STEP)
    found = curves_at(theta, slip, softness, load, stiffness, 3500.0)
    assert found.by_slip[:, 0] == pytest.approx(by_slip, rel=1e-3, abs=1e-3)
    assert found.by_stiffness[:, 0] == pytest.approx(by_stiffness, rel=1e-3, abs=1e-4)


@given(THETA, SLIP)
def test_the_direction_matters_only_by_what_slip_is_taken_over(theta, slip):
    """A driven wheel's slip is over the rim's speed; the curves with a peak are over the road's."""
    drives, brakes = curves_at(theta, slip, 0.0).friction, curves_at(theta, -slip, 0.0).friction
    assert drives[:FORMULAS] == pytest.approx(brakes[:FORMULAS], rel=1e-12)
    over_road = slip / (1.0 - slip)
    if over_road < 0.98:
        other = curves_at(theta, -over_road, 0.0).friction
        assert drives[FORMULAS:] == pytest.approx(other[FORMULAS:], rel=1e-9)


def test_the_stiffness_goes_with_the_load_but_for_the_tyre_that_is_as_told():
    """At little slip the force is C lambda, at a load of twice the mean twice as much; the told C_x stays."""
    light, heavy = (curves_at(0.9, -1e-5, 0.0, load, mean_load=3000.0) for load in (3000.0, 6000.0))
    force = [3000.0 * light.friction[:, 0], 6000.0 * heavy.friction[:, 0]]
    assert force[1] / force[0] == pytest.approx([1.0, 2.0, 2.0, 2.0], rel=1e-3)
    assert force[0] == pytest.approx(5e4 * 1e-5 * np.array([1.27, 1.27, 1.0, 1.0]), rel=1e-3)


def test_softness_is_the_logarithm_of_told_stiffness_over_stiffness():
    soft, told = curves_at(0.9, -1e-5, 0.3).friction, curves_at(0.9, -1e-5, 0.0).friction
    assert soft / told == pytest.approx(math.exp(-0.3), rel=1e-4)


@given(THETA, STIFFNESS, PEAK, FALL)
def test_the_peak_is_theta_at_the_normalised_slip_p(theta, stiffness, peak, fall):
    at = peak * theta / stiffness
    top = one_peaked(theta, at, stiffness, peak, fall)
    assert top.friction == pytest.approx(theta, rel=1e-12)
    assert top.by_slip == pytest.approx(0.0, abs=1e-9 * stiffness)
    for share in (0.5, 0.9, 0.999, 1.001, 1.1, 3.0):
        assert one_peaked(theta, share * at, stiffness, peak, fall).friction <= theta * (1.0 + 1e-12)


@given(THETA, STIFFNESS, PEAK, FALL)
def test_the_curve_starts_with_its_stiffness_and_is_continuous_at_its_peak(theta, stiffness, peak, fall):
    assert one_peaked(theta, 0.0, stiffness, peak, fall).by_slip == pytest.approx(stiffness, rel=1e-12)
    at = peak * theta / stiffness
    before, after = (one_peaked(theta, at * s, stiffness, peak, fall) for s in (1.0 - 1e-9, 1.0 + 1e-9))
    assert before.friction == pytest.approx(after.friction, rel=1e-8)
    assert before.by_slip == pytest.approx(after.by_slip, abs=1e-6 * stiffness)


@given(THETA, STIFFNESS, PEAK, st.floats(1.2, 20.0))
def test_beyond_the_peak_fall_is_the_share_of_the_bare_curves_loss(theta, stiffness, peak, beyond):
    at = beyond * peak * theta / stiffness
    bare, none, some = (one_peaked(theta, at, stiffness, peak, f).friction for f in (1.0, 0.0, 0.8))
    assert bare == pytest.approx(theta * peak * beyond / (1.0 + beyond * (beyond + peak - 2.0)), rel=1e-9)
    assert none == pytest.approx(theta, rel=1e-12)
    assert theta - some == pytest.approx(0.8 * (theta - bare), rel=1e-9)


def test_the_hypotheses_are_as_documented():
    """A steep magic formula has lost 0.4 at three times its peak's slip, and all curves start near the told one."""
    bare = one_peaked(1.0, 3.0 * TYRES[2].peak, 1.0, TYRES[2].peak, 1.0).friction
    assert bare == pytest.approx(0.6, abs=0.02)
    assert [t.weight for t in TYRES] == [0.35, 0.15, 0.30, 0.20]
    assert [t.peak for t in TYRES] == [0.0, 0.0, 2.15, 3.0]
    assert [t.fall for t in TYRES] == [0.0, 0.0, 0.8, 0.4]
    assert [t.softness for t in TYRES] == [0.05, 0.15, 0.2, 0.2]
    assert [t.slip_offset for t in TYRES] == [0.003, 0.005, 0.005, 0.005]
    slopes = 1.27 * np.array([1.0, math.exp(0.1) / 1.27])  # exp(0.1) lies between the two slopes at slip 0
    assert slopes[1] == pytest.approx(math.sqrt(1.27), abs=0.03)
    assert [t.mean_softness for t in TYRES] == [0.0, 0.0, -0.1, -0.1]
    assert (TOLD, FORMULAS) == (0, 2)


def test_how_far_a_tyre_slides_by_its_normalised_slip():
    """Half at 5, about twice the peak's; the same measure for all curves."""
    assert sliding(np.array([0.0, 5.0, 1e9])) == pytest.approx([0.0, 0.5, 1.0])
    assert sliding(np.array([2.5])) == pytest.approx(0.2)
    elastic = 5e4 * 0.1 / 0.9 / 3000.0
    found = curves_at(0.5, 0.1, 0.0).sliding[:, 0]
    assert found == pytest.approx(float(sliding(np.array(elastic / 0.5))), rel=1e-9)


@pytest.mark.parametrize(("slip", "same"), [(0.0, 1e-9), (1.5, 0.99), (-3.0, -0.99), (1e-12, 1e-9)])
def test_slips_beyond_the_formulas_are_taken_at_their_bounds(slip, same):
    for found, wanted in zip(curves_at(0.6, slip, 0.0), curves_at(0.6, same, 0.0), strict=True):
        if slip != 0.0:
            assert found == pytest.approx(wanted, rel=1e-12)
        assert np.isfinite(found).all()
    assert curves_at(0.6, 0.0, 0.0).friction == pytest.approx(0.0, abs=1e-6)
