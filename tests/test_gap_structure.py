"""Tyres of another curve: the plant's force and slopes, and an effect that is found beside them."""

import pytest
from gap_drives import MODEL, clean, noisy, road_of, trace

from scenarios.effects import EFFECTS, FORMS
from scenarios.effects.mu_split import MuSplit
from scenarios.plant import dynamics
from scenarios.plant.pipeline import make_setup
from sim2real.contest import first_round, hold_contest, is_proper, priced
from sim2real.diagnose import diagnose, find
from sim2real.evidence import gather
from sim2real.result import Verdict

SHAPE = {"knee": -0.08, "crest": 0.06, "sliding": -0.1}
ROAD = road_of(0.9, 0.5, 0.9, 0.5, 0.9, 0.5)


def only(*keys):
    return set(EFFECTS) - set(keys)


@pytest.fixture(scope="module")
def parameters():
    return make_setup(MODEL.vehicle, ROAD).parameters


def shaped(p, slip, load_n=3000.0, theta=0.5):
    tyre = dynamics.tyre_force(theta, slip, load_n, p.longitudinal_stiffness_n)
    return dynamics.reshaped(tyre, slip, theta * load_n, load_n, p)


def test_a_shape_keeps_the_initial_slope_and_shifts_the_sliding_force(parameters):
    p = parameters._replace(**SHAPE)
    small, plain = 1e-5, dynamics.tyre_force(0.5, 1e-5, 3000.0, p.longitudinal_stiffness_n)[0]
    assert shaped(p, small)[0] == pytest.approx(plain, rel=1e-4)
    locked = dynamics.tyre_force(0.5, 1.0, 3000.0, p.longitudinal_stiffness_n)[0]
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


def hard_driving(duration_s):
    """Full torque and hard braking in turn: tyres pass their maximum on the slippery stretches."""
    points = [(0.0, 0.0)]
    for k in range(int(duration_s / 4.0)):
        points += [(4 * k + t, T) for t, T in ((0.3, 0), (0.5, 300), (1.6, 300), (1.8, 0), (2.2, 0))]
        points += [(4 * k + t, T) for t, T in ((2.4, -420), (3.1, -420), (3.3, 0))]
    return trace(*points, duration_s=duration_s)


def test_an_effect_beside_another_tyre_is_blamed_alone():
    effects = {"mass_offset": {"mass_kg": 160.0}, "tyre_shape": SHAPE}
    logs = [
        noisy(clean(hard_driving(12.0), v0, ROAD, effects=effects), seed)
        for seed, v0 in enumerate((9.0, 13.0))
    ]
    kept = only("mass_offset", "torque_gain", "vehicle_speed_scale", "tyre_shape")
    found = find(MODEL, logs[:1], logs[1], exclude=kept)
    assert found.decision.winner.ids == ("mass_offset", "tyre_shape")
    assert [effect.id for effect in found.added()] == ["mass_offset"]
    assert found.added()[0].mass_kg == pytest.approx(160.0, rel=0.1)

    said = diagnose(MODEL, logs[:1], logs[1], exclude=kept)
    assert said.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
    assert said.causes[0].effect == "mass_offset"
    assert "tyre_shape" not in {c.effect for c in said.causes}
    assert said.structure.effect == "tyre_shape"
    assert said.structure.gap_after < said.gap.after.total < said.gap.before.total
    assert "another one than the simulation's" in said.sentence
    assert said.to_json()["structure"]["parameters"].keys() == SHAPE.keys()
    assert all("tyre_shape" not in name for group in said.ambiguous_with for name in group)


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
    assert "mu_split" in [f.candidate.ids[0] for f in first]
    contest = hold_contest(MODEL, fit_to, held, first)
    assert [e.ids for e in contest.singles] == [("mass_offset",)]
    assert all(is_proper(e) for e in contest.singles)


def test_every_form_of_an_effect_reaches_the_contest_and_the_best_one_stays():
    logs = [noisy(clean(hard_driving(6.0), 10.0, ROAD), 3)]
    first = first_round(MODEL, gather(MODEL, logs), only("rolling_resistance"))
    assert len(first) == len(FORMS["rolling_resistance"])
    contest = hold_contest(MODEL, gather(MODEL, logs), gather(MODEL, logs), first)
    assert len(contest.singles) == 1
    assert contest.singles[0] is min((*contest.singles, *contest.forms), key=priced)
