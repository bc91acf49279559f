"""Forms of an effect, noise read anew, partners of the best effect, a sensor that stands alone."""

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from gap_drives import (
    BARE,
    MODEL,
    SIGMA,
    STEP_S,
    clean,
    noisy,
    pulses,
    random_drives,
    remeasured,
    road_of,
    trace,
)
from long import beyond

from scenarios.effects import EFFECTS, FORMS, form_of
from scenarios.effects.driveline_compliance import DrivelineComplianceOfWheels
from scenarios.effects.mass_offset import MassOffset, MassOffsetPlaced
from scenarios.effects.rolling_resistance import RollingResistanceForce
from scenarios.effects.tyre_relaxation import TyreRelaxationOfSlip, TyreRelaxationOfWheels
from scenarios.effects.tyre_stiffness_offset import TyreStiffnessOffset, TyreStiffnessOffsetOfWheels
from scenarios.effects.wheel_radius_offset import WheelRadiusOffsetOfWheels
from scenarios.plant import dynamics
from scenarios.plant.pipeline import make_setup
from sim2real.diagnose import diagnose, find
from sim2real.observing.drive import ACCEL, SPEED, WHEEL
from sim2real.observing.evidence import Evidence, gather
from sim2real.observing.noise import Noise
from sim2real.result import Verdict
from sim2real.telling.estimates import joint
from sim2real.telling.findings import Findings, describe
from sim2real.which.contest import first_round, hold_contest, silent, wheel_by_wheel
from sim2real.which.fitting import Candidate, fit
from sim2real.which.pairs import add_pairs, add_partners
from sim2real.which.quiet import is_noise
from sim2real.which.selection import decide, needs_pairs
from sim2real.which.suspect import lone_sensor
from sim2real.which.varying import vary


def only(*keys):
    return set(EFFECTS) - set(keys)


SLIPPERY = road_of(0.9, 0.35, 0.9, 0.35, 0.9, 0.35)


def driven_by(effects, torque_nm, speed_m_s, seed=0):
    """A drive of a car with effects in forms of theirs, over ice where its wheels slide."""
    setup = make_setup(BARE, SLIPPERY)
    p = reduce(lambda p, effect: effect.dynamics(p), effects, setup.parameters)
    y = dynamics.initial_y(speed_m_s, 0.0, p)
    states, accel, *_ = dynamics.run(y, torque_nm, STEP_S, p, setup.road)
    measured = np.column_stack([states[:, :6], accel])
    return noisy(remeasured(clean(torque_nm, speed_m_s, SLIPPERY), measured), seed)


# --- forms


@pytest.mark.parametrize("effect", [RollingResistanceForce(0.03), TyreRelaxationOfSlip(0.5)])
def test_the_form_that_the_car_has_is_the_one_that_is_told(effect):
    logs = [driven_by([effect], pulses(8.0) * 1.4, v0, seed) for seed, v0 in enumerate((8.0, 14.0))]
    found = find(MODEL, logs[:1], logs[1], exclude=only(effect.id, "mass_offset", "road_grade"))
    assert found.decision.winner.ids == (effect.id,)
    candidate, x = found.decision.winner.fit.candidate, found.decision.winner.fit.x
    assert candidate.kinds == (type(effect),)
    (name,) = (p.name for p in effect.parameters())
    assert x[0] == pytest.approx(getattr(effect, name), rel=0.1)
    assert type(found.added()[0]) is type(effect)


@pytest.mark.parametrize(
    ("shares", "verdict"),
    [
        ((0.012, 0.020, 0.008, 0.016), Verdict.IDENTIFIED),
        ((0.0, 0.0, 0.02, 0.0), Verdict.UNKNOWN),
    ],
)
def test_wheels_of_a_size_each_are_found_and_one_wrong_wheel_is_no_car_on_other_wheels(shares, verdict):
    radius_m = MODEL.vehicle.wheel_radius_m
    fl, fr, rl, rr = (1.0 + share for share in shares)
    mean = (fl + fr + rl + rr) / 4.0
    sides = ((fl + fr - 2.0 * mean) / (2.0 * mean), (fl - fr) / (2.0 * mean), (rl - rr) / (2.0 * mean))
    effect = WheelRadiusOffsetOfWheels(radius_m * mean, *sides)
    logs = [driven_by([effect], pulses(8.0), v0, seed) for seed, v0 in enumerate((8.0, 14.0))]
    found = find(MODEL, logs[:1], logs[1], exclude=only(effect.id, "vehicle_speed_scale", "mass_offset"))
    assert found.decision.verdict is verdict
    if verdict is Verdict.IDENTIFIED:
        (told,) = found.added()
        radii_m = (each.per_wheel(each.radius_m) for each in (told, effect))
        np.testing.assert_allclose(*radii_m, rtol=5e-4)


@pytest.mark.parametrize(
    ("effect", "among"),
    beyond(
        1,
        [
            (TyreRelaxationOfWheels(0.5, 0.0, 0.2, -0.2), ("torque_lag", "torque_delay")),
            (TyreRelaxationOfWheels(0.5, 0.15, -0.15, 0.05), ("torque_lag", "torque_delay")),
            (
                DrivelineComplianceOfWheels(1500.0, 2.0, 0.3, 0.1, 0.1, -0.15),
                ("tyre_relaxation", "torque_lag"),
            ),
            (TyreStiffnessOffsetOfWheels(35_000.0, 0.0, 0.15, -0.15), ("friction_offset", "mass_offset")),
        ],
    ),
)
def test_each_wheels_own_lag_or_stiffness_is_found(effect, among):
    """Wheels that ring at frequencies of their own are out of step after a few periods."""
    logs = [driven_by([effect], pulses(8.0) * 2.0, v0, seed) for seed, v0 in enumerate((8.0, 14.0))]
    found = find(MODEL, logs[:1], logs[1], exclude=only(effect.id, *among))
    assert found.decision.verdict is Verdict.IDENTIFIED
    (told,) = found.added()
    assert isinstance(told, type(effect))
    np.testing.assert_allclose(*((e.unlike, e.front_sides, e.rear_sides) for e in (told, effect)), atol=0.03)


def test_wheels_that_ring_are_started_from_what_suits_each_of_them():
    """About a mean that one wheel's ringing alone has fixed, all shares at once are out of a fit's reach."""
    effect = TyreRelaxationOfWheels(0.4, 0.1, 0.15, -0.2)
    log = driven_by([effect], pulses(8.0) * 2.0, 8.0)
    candidate = Candidate(MODEL, (effect.id,), (FORMS[effect.id].index(type(effect)),))
    start = wheel_by_wheel(candidate, np.array([0.46]), gather(MODEL, [log]))
    np.testing.assert_allclose(start, [0.4, 0.1, 0.15, -0.2], atol=0.07)


def test_each_effect_enters_the_contest_once():
    held = gather(MODEL, random_drives({}, count=1, seed=3, duration_s=5.0))
    first = first_round(MODEL, held, only("rolling_resistance", "tyre_relaxation", "mass_offset"))
    contest = hold_contest(MODEL, held, held, first)
    assert sorted(e.ids[0] for e in contest.singles) == [
        "mass_offset",
        "rolling_resistance",
        "tyre_relaxation",
    ]
    tried = len({(f.candidate.ids, f.candidate.forms) for f in first})
    assert len(contest.singles) + len(contest.forms) == tried


def test_an_interval_holds_those_of_all_forms_that_do_as_well():
    """A hard stop tells the fall's two shapes apart; a log that does not is made of one's residuals for both."""
    fall = {"friction_falloff": {"falloff_s_m": 0.15, "floor": 0.5}}
    torque = trace((0.0, -1200.0), (0.4, 0.0), (1.0, -1500.0), (1.5, 0.0), duration_s=3.0)
    logs = [noisy(clean(torque, v0, SLIPPERY, effects=fall), seed) for seed, v0 in enumerate((12.0, 14.0))]
    found = find(MODEL, logs[:1], logs[1], exclude=only("friction_falloff"))
    (best,), (other,) = found.contest.singles, found.contest.forms
    assert best.fitted.candidate.kinds[0].form == "exponential"

    def told(contest):
        return describe(replace(found, contest=contest), seed=0, jobs=1, progress=silent).causes[0].parameters

    alone, there = ({name: said for (_, name), said in joint(e, found.fit_to).items()} for e in (best, other))
    assert told(found.contest) == alone
    alike = told(replace(found.contest, forms=(replace(other, z_fit=best.z_fit, z_hold=best.z_hold),)))
    for name, said in alike.items():
        assert said.value == alone[name].value
        assert said.low == min(alone[name].low, there[name].low)
        assert said.high == max(alone[name].high, there[name].high)
    assert alike != alone


def test_forms_differ_in_name_and_share_id_and_begin_with_the_same_parameters():
    for key, kinds in FORMS.items():
        assert {kind.id for kind in kinds} == {key}
        assert len({kind.form for kind in kinds}) == len(kinds)
        assert len(kinds) == 1 or all(kind.form for kind in kinds)
        own = kinds[0].parameters()
        assert all(kind.parameters()[: len(own)] == own for kind in kinds)


# --- noise


def test_the_smaller_reading_of_the_noise_counts_channel_by_channel():
    first = Noise(np.array([1.0, 2.0]), np.array([0.1, 0.2]), np.array([[1.0, 1.0], [2.0, 2.0]]))
    other = Noise(np.array([2.0, 1.0]), np.array([0.5, 0.6]), np.array([[1.0, 1.0], [3.0, 3.0]]))
    both = first.sharper(other)
    np.testing.assert_array_equal(both.sigma, [1.0, 1.0])
    np.testing.assert_array_equal(both.correlation, [0.1, 0.6])
    # a doubt of sqrt(8) sigma of the other, in units of what is kept
    np.testing.assert_allclose(both.widening[1], [np.sqrt(1.0 + 8.0 * 4.0), 3.0])


def test_a_gap_that_looked_like_noise_no_longer_does_once_its_cause_is_known():
    """A driveline's ringing is as fast as noise."""
    ringing = {
        "driveline_compliance": {
            "stiffness_nm_rad": 1500.0, "damping_nm_s_rad": 1.0, "motor_inertia_kg_m2": 0.6,
        }
    }  # fmt: skip
    drive = noisy(clean(pulses(8.0) * 1.5, 12.0, effects=ringing))
    blind = gather(MODEL, [drive])
    knowing = MODEL.with_effects(EFFECTS["driveline_compliance"](1500.0, 1.0, 0.6))
    seen = blind.sharpened(knowing)
    assert blind.noises[0].sigma[WHEEL].max() > 1.3 * SIGMA[WHEEL].max()
    np.testing.assert_allclose(seen.noises[0].sigma[WHEEL], SIGMA[WHEEL], rtol=0.15)
    assert seen.drives == blind.drives


# --- no gap


def test_a_gap_that_the_blocks_average_out_is_none_the_less_one():
    held = gather(MODEL, random_drives({"mass_offset": {"mass_kg": 150.0}}, count=1, seed=5, duration_s=6.0))
    contest = hold_contest(MODEL, held, held, first_round(MODEL, held, only("mass_offset")))
    assert not is_noise(contest, held, held)


def test_sensors_that_drift_are_no_gap():
    """A quarter of the noise, over seconds: more than white noise averages to, less than anyone would call a gap."""
    rng = np.random.default_rng(2)
    logs = []
    for drive in random_drives({}, count=2, seed=11, duration_s=12.0):
        knots = 0.25 * SIGMA * rng.standard_normal((5, 7))
        at = np.linspace(drive.time_s[0], drive.time_s[-1], 5)
        slow = np.column_stack([np.interp(drive.time_s, at, k) for k in knots.T])
        logs.append(remeasured(drive, drive.measured + slow))
    assert (
        find(MODEL, logs[:1], logs[1], exclude=only("mass_offset", "torque_lag")).decision.verdict
        is Verdict.NO_GAP
    )


def test_a_gap_without_a_library_is_unknown():
    logs = random_drives({"mass_offset": {"mass_kg": 150.0}}, count=2, seed=5, duration_s=6.0)
    assert diagnose(MODEL, logs[:1], logs[1], exclude=set(EFFECTS)).verdict is Verdict.UNKNOWN


# --- partners


@pytest.fixture(scope="module")
def two_causes():
    """Drag with a light wheel: the wheel's inertia alone is fitted far from where it belongs."""
    effects = {"aero_drag": {"drag_area_m2": 1.6}, "wheel_inertia_offset": {"inertia_kg_m2": 0.9}}
    logs = random_drives(effects, count=2, seed=6, duration_s=8.0)
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    few = only(
        "aero_drag", "wheel_inertia_offset", "friction_offset", "mass_offset", "torque_lag", "brake_drag"
    )
    contest = hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, few))
    return add_partners(contest, fit_to), fit_to, held


def test_the_missing_effect_is_the_first_partner(two_causes):
    contest, fit_to, held = two_causes
    assert contest.singles[0].ids == ("aero_drag",)
    assert contest.partners[0][1] == "wheel_inertia_offset"
    assert [loss for loss, _ in contest.partners] == sorted(loss for loss, _ in contest.partners)
    assert needs_pairs(contest, fit_to, held)


def test_a_shaft_that_swings_is_found_beside_a_resistance():
    """Alone it is fitted to nothing, and at the ends of its starting values it swings otherwise."""
    shaft = {"stiffness_nm_rad": 1800.0, "damping_nm_s_rad": 8.0, "motor_inertia_kg_m2": 0.7}
    effects = {"driveline_compliance": shaft, "rolling_resistance": {"coefficient": 0.026}}
    logs = random_drives(effects, count=2, seed=3, duration_s=15.0)
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    few = only("rolling_resistance", "driveline_compliance", "torque_delay", "torque_lag")
    contest = add_partners(hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, few)), fit_to)
    assert contest.singles[0].ids == ("rolling_resistance",)
    assert contest.partners[0][1] == "driveline_compliance"


def test_a_pair_leaves_no_more_than_its_members(two_causes):
    contest, fit_to, held = two_causes
    paired = add_pairs(contest, MODEL, fit_to, held)
    single = {e.ids[0]: e.loss_fit for e in contest.singles}
    for pair in paired.pairs:
        assert pair.loss_fit <= 1.001 * min(single[key] for key in pair.ids)
    assert decide(paired, fit_to, held).winner.ids == ("aero_drag", "wheel_inertia_offset")


@pytest.fixture(scope="module")
def a_load_behind_and_soft_tyres():
    """Contest of two effects, one of which entered it in a form that it does not have, its evidence and the truth."""
    stiffness_n = 0.8 * MODEL.vehicle.to_core().longitudinal_stiffness_n
    car = [MassOffsetPlaced(250.0, 1.2), TyreStiffnessOffset(stiffness_n)]
    logs = [driven_by(car, pulses(8.0) * 2.0, v0, seed) for seed, v0 in enumerate((8.0, 14.0))]
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    few = only("mass_offset", "tyre_stiffness_offset", "aero_drag")
    contest = hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, few))
    every = (*contest.singles, *contest.forms)
    plain = next(e for e in every if e.fitted.candidate.kinds == (MassOffset,))
    bent = tuple(plain if e.ids == plain.ids else e for e in contest.singles)
    paired = add_pairs(add_partners(replace(contest, singles=bent), fit_to), MODEL, fit_to, held)
    return paired, fit_to, held, {"mass_kg": 250.0, "behind_m": 1.2, "stiffness_n": stiffness_n}


def test_a_pair_is_found_in_the_forms_that_it_does_best_in(a_load_behind_and_soft_tyres):
    paired, _, _, truth = a_load_behind_and_soft_tyres
    assert paired.pairs[0].fitted.candidate.kinds == (MassOffsetPlaced, TyreStiffnessOffset)
    assert paired.pairs[0].fitted.x == pytest.approx(list(truth.values()), rel=0.03)
    assert len({pair.ids for pair in paired.pairs}) == len(paired.pairs)


@pytest.mark.parametrize("verdict", [Verdict.COMPOUND, Verdict.UNKNOWN])
@pytest.mark.parametrize("varies", beyond(1, [False, True]))
def test_causes_are_told_with_the_parameters_of_their_form(a_load_behind_and_soft_tyres, verdict, varies):
    """Together a pair's in its forms; where it is not blamed each cause in the one that it does best in alone."""
    paired, fit_to, held, truth = a_load_behind_and_soft_tyres
    decision = decide(paired, fit_to, held)
    assert decision.winner is paired.pairs[0]
    decision = replace(decision, verdict=verdict)
    if varies:
        decision = replace(decision, varied=vary(decision.winner, fit_to, held, "time"))
    said = describe(Findings(MODEL, fit_to, held, paired, decision), seed=0, jobs=1, progress=silent)
    for cause in said.causes:
        assert list(cause.parameters) == [p.name for p in form_of(cause.effect, cause.form).parameters()]
    told = {name: value for cause in said.causes[:2] for name, value in cause.parameters.items()}
    if verdict is Verdict.COMPOUND:
        assert all(told[name].low <= value <= told[name].high for name, value in truth.items())


def test_one_effect_beside_which_much_is_left_is_ambiguous():
    """Of two causes the small one is too small for a compound, but large enough that the great one is not all."""
    effects = {"mass_offset": {"mass_kg": 200.0}, "torque_lag": {"time_constant_s": 0.0016}}
    logs = random_drives(effects, count=2, seed=7, duration_s=8.0)
    found = find(MODEL, logs[:1], logs[1], exclude=only("mass_offset", "torque_lag", "aero_drag"))
    assert found.decision.verdict is Verdict.AMBIGUOUS
    assert found.decision.winner.ids == ("mass_offset",)
    assert [e.ids for e in found.decision.rivals] == [("torque_lag", "mass_offset")]
    assert found.decision.probability["mass_offset"] < 0.85


# --- a sensor that stands alone


def spoiled(channel, how, seed=0):
    drive = noisy(clean(pulses(10.0), 14.0), seed)
    measured = drive.measured.copy()
    measured[:, channel] = how(measured[:, channel])
    return remeasured(drive, measured)


@pytest.mark.parametrize(
    ("channel", "how", "key"),
    [
        (SPEED, lambda v: np.repeat(v[::60], 60)[: len(v)], "speed sensor"),
        (SPEED, lambda v: 1.03 * v, "speed sensor"),
        (ACCEL, lambda a: a + 0.3 * np.abs(a), "accelerometer"),
        (WHEEL.start + 2, lambda w: 1.02 * w, "wheel sensor rl"),
    ],
    ids=["held", "scaled", "one-sided", "one wheel"],
)
def test_the_faulty_sensor_is_the_one_without_which_all_else_agrees(channel, how, key):
    held = gather(MODEL, [spoiled(channel, how)])
    found = lone_sensor(MODEL, held, held)
    assert found is not None
    assert (found.key, found.channel) == (key, channel)


@pytest.mark.parametrize(
    "effects",
    [
        {"mass_offset": {"mass_kg": 300.0}},
        {"road_grade": {"grade": 0.03}},
        {"tyre_stiffness_offset": {"stiffness_n": 25000.0}},
        {"torque_lag": {"time_constant_s": 0.1}},
    ],
    ids=lambda effects: next(iter(effects)),
)
def test_where_the_car_itself_differs_no_sensor_stands_alone(effects):
    held = gather(MODEL, random_drives(effects, count=2, seed=8, duration_s=8.0))
    one, other = (Evidence(held.drives[i : i + 1], held.noises[i : i + 1]) for i in (0, 1))
    assert lone_sensor(MODEL, one, other) is None


def test_where_nothing_is_more_than_noise_no_sensor_stands_alone():
    held = gather(MODEL, random_drives({}, count=1, seed=8, duration_s=8.0))
    assert lone_sensor(MODEL, held, held) is None


def test_an_unknown_sensor_fault_is_told_in_words():
    logs = [spoiled(ACCEL, lambda a: a + 0.3 * np.abs(a), seed) for seed in (0, 1)]
    said = diagnose(MODEL, logs[:1], logs[1], exclude=only("mass_offset", "aero_drag"))
    assert said.verdict is Verdict.UNKNOWN
    assert said.unexplained.subsystem == "accelerometer"
    assert "Without the accelerometer's signal all else agrees" in said.unexplained.sentence
    assert {place.subsystem for place in said.where} == {"accelerometer"}


def test_fits_take_the_best_of_several_starts():
    held = gather(MODEL, random_drives({"mass_offset": {"mass_kg": 200.0}}, count=1, seed=9, duration_s=6.0))
    found = fit(Candidate(MODEL, ("mass_offset",)), held, np.array([[-300.0], [190.0]]), 1)
    assert found.x[0] == pytest.approx(200.0, rel=0.05)
