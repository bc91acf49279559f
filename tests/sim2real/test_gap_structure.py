"""Tyres of another curve: the plant's force and slopes, and that alone they are no effect of the library."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, clean, noisy, road_of, trace

from scenarios.effects import EFFECTS
from scenarios.effects.mu_split import MuSplit
from scenarios.plant import dynamics
from scenarios.plant.pipeline import make_setup
from sim2real.diagnose import find
from sim2real.discrepancy.verdict import beside_another_build
from sim2real.hypotheses.contest import enter, first_round, hold_contest
from sim2real.hypotheses.selection import decide
from sim2real.observing.evidence import gather
from sim2real.result import Verdict

SHAPE = {"knee": -0.08, "crest": 0.06, "sliding": -0.1}
FORMULA = {"share": 1.0, "shape": 1.5, "curvature": -0.8}
ROAD = road_of(0.9, 0.5, 0.9, 0.5, 0.9, 0.5)


def only(*keys):
    return set(EFFECTS) - set(keys)


@pytest.fixture(scope="module")
def parameters():
    return make_setup(MODEL.vehicle, ROAD).parameters


def shaped(p, slip, load_n=3000.0, theta=0.5):
    tyre = dynamics.tyre_force(theta, slip, load_n, p.longitudinal_stiffness_n[0])
    return dynamics.reshaped(tyre, theta, slip, load_n, p.longitudinal_stiffness_n[0], p)


def test_a_shape_keeps_the_initial_slope_and_shifts_the_sliding_force(parameters):
    p = parameters._replace(**SHAPE)
    small, plain = 1e-5, dynamics.tyre_force(0.5, 1e-5, 3000.0, p.longitudinal_stiffness_n[0])[0]
    assert shaped(p, small)[0] == pytest.approx(plain, rel=1e-4)
    locked = dynamics.tyre_force(0.5, 1.0, 3000.0, p.longitudinal_stiffness_n[0])[0]
    # At a stretch of 33 the two bumps have died away, and all but 2 % of the sliding part is there.
    assert shaped(p, 1.0)[0] / locked == pytest.approx(1.0 + SHAPE["sliding"], abs=5e-3)


@pytest.mark.parametrize("slip", [0.003, 0.012, 0.03, 0.08, 0.3])
def test_its_slopes_are_those_of_its_force(parameters, slip):
    p = parameters._replace(**SHAPE)
    _, by_slip, by_load = shaped(p, slip)
    h = 1e-6
    assert by_slip == pytest.approx((shaped(p, slip + h)[0] - shaped(p, slip - h)[0]) / (2 * h), rel=1e-4)
    up, down = shaped(p, slip, 3000.5)[0], shaped(p, slip, 2999.5)[0]
    assert by_load == pytest.approx(up - down, rel=1e-3, abs=1e-6)


def by_formula(p, slip, load_n=3000.0, theta=0.5):
    stiffness_n = p.longitudinal_stiffness_n[0]
    tyre = dynamics.tyre_force(theta, slip, load_n, stiffness_n)
    return dynamics.by_formula(tyre, theta, slip, load_n, stiffness_n, p)


@pytest.mark.parametrize("theta", [0.1, 0.3, 0.8, 1.2])
@pytest.mark.parametrize("load_n", [500.0, 3000.0, 9000.0])
def test_the_peak_is_the_greatest_force_of_all_slips(theta, load_n):
    forces_n = [
        dynamics.tyre_force(theta, slip, load_n, 50_000.0)[0] for slip in np.linspace(1e-4, 1.0, 4000)
    ]
    assert dynamics.peak_force(theta, load_n, 50_000.0)[0] == pytest.approx(max(forces_n), rel=1e-5)


@pytest.mark.parametrize("theta", [2.1, 2.2, 2.5, 4.0])
def test_beyond_all_roads_the_peak_stays_a_number_near_the_greatest_force(theta):
    """A fit may try factors on friction there; at a slope that never falls the peak is at the greatest slip taken."""
    forces_n = [
        dynamics.tyre_force(theta, slip, 4000.0, 60_000.0)[0] for slip in np.linspace(1e-4, 0.6, 2000)
    ]
    assert dynamics.peak_force(theta, 4000.0, 60_000.0)[0] == pytest.approx(max(forces_n), rel=0.08)


@pytest.mark.parametrize("theta", [0.2, 0.8])
def test_a_formula_keeps_initial_slope_and_peak_and_is_the_published_one(parameters, theta):
    p = parameters._replace(**{f"formula_{name}": value for name, value in FORMULA.items()})
    plain = dynamics.tyre_force(theta, 1e-6, 3000.0, p.longitudinal_stiffness_n[0])[0]
    assert by_formula(p, 1e-6, theta=theta)[0] == pytest.approx(plain, rel=1e-4)
    slips = np.linspace(1e-4, 1.0, 4000)
    forces_n = np.array([by_formula(p, slip, theta=theta)[0] for slip in slips])
    peak_n, _ = dynamics.peak_force(theta, 3000.0, p.longitudinal_stiffness_n[0])
    assert forces_n.max() == pytest.approx(peak_n, rel=1e-5)
    c, e = FORMULA["shape"], FORMULA["curvature"]
    b = dynamics.INITIAL_SLOPE * p.longitudinal_stiffness_n[0] / (c * peak_n)
    pacejka = peak_n * np.sin(c * np.arctan(b * slips - e * (b * slips - np.arctan(b * slips))))
    np.testing.assert_allclose(forces_n, pacejka, rtol=1e-12)
    half = p._replace(formula_share=0.5)
    middle = 0.5 * (
        by_formula(p, 0.2)[0] + dynamics.tyre_force(0.5, 0.2, 3000.0, p.longitudinal_stiffness_n[0])[0]
    )
    assert by_formula(half, 0.2)[0] == pytest.approx(middle, rel=1e-12)


@pytest.mark.parametrize("slip", [0.003, 0.012, 0.03, 0.08, 0.3])
def test_a_formulas_slopes_are_those_of_its_force(parameters, slip):
    p = parameters._replace(formula_share=0.8, formula_shape=1.3, formula_curvature=0.4)
    _, by_slip, by_load = by_formula(p, slip)
    h = 1e-6
    assert by_slip == pytest.approx(
        (by_formula(p, slip + h)[0] - by_formula(p, slip - h)[0]) / (2 * h), rel=1e-4
    )
    by_difference = by_formula(p, slip, 3000.5)[0] - by_formula(p, slip, 2999.5)[0]
    assert by_load == pytest.approx(by_difference, rel=1e-3, abs=1e-6)


def hard_driving(duration_s):
    """Full torque and hard braking in turn: tyres pass their maximum on the slippery stretches."""
    points = [(0.0, 0.0)]
    for k in range(int(duration_s / 4.0)):
        points += [(4 * k + t, T) for t, T in ((0.3, 0), (0.5, 300), (1.6, 300), (1.8, 0), (2.2, 0))]
        points += [(4 * k + t, T) for t, T in ((2.4, -420), (3.1, -420), (3.3, 0))]
    return trace(*points, duration_s=duration_s)


@pytest.mark.long
def test_another_tyre_alone_is_no_effect_of_the_library():
    logs = [
        noisy(clean(hard_driving(12.0), v0, ROAD, effects={"tyre_shape": SHAPE}), seed)
        for seed, v0 in enumerate((9.0, 13.0))
    ]
    found = find(
        MODEL, logs[:1], logs[1], exclude=only("mass_offset", "torque_lag", "aero_drag", "tyre_shape")
    )
    assert found.decision.verdict is Verdict.UNKNOWN


def test_sides_of_one_friction_are_no_split():
    assert not MuSplit(0.9, 0.9).is_itself(MODEL.vehicle.to_core())
    assert MuSplit(0.9, 0.95).is_itself(MODEL.vehicle.to_core())
    logs = [
        noisy(clean(hard_driving(10.0), v0, ROAD, effects={"friction_offset": {"factor": 0.93}}), seed)
        for seed, v0 in enumerate((9.0, 13.0))
    ]
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    first = first_round(MODEL, fit_to, only("mu_split", "mass_offset"))
    (split,) = [f for f in first if f.candidate.ids == ("mu_split",)]
    contest = hold_contest(MODEL, fit_to, held, first)
    assert [e.ids for e in contest.singles] == [("mass_offset",)]
    assert all(e.fitted.candidate.is_proper(e.fitted.x) for e in contest.singles)
    alone = replace(contest, singles=(enter(split.candidate, fit_to, held, split.x, 4),))
    said = decide(contest, fit_to, held)
    assert beside_another_build(said, alone, MODEL, fit_to, held) == (alone, said)
