"""Forms of an effect, noise read anew, partners of the best effect, a sensor that stands alone."""

import numpy as np
import pytest
from gap_drives import (
    MODEL,
    SIGMA,
    clean,
    noisy,
    pulses,
    random_drives,
    remeasured,
)

from scenarios.effects import EFFECTS, FORMS
from sim2real.diagnose import diagnose, find
from sim2real.hypotheses.contest import first_round, hold_contest, silent
from sim2real.hypotheses.fitting import Candidate, fit
from sim2real.hypotheses.no_gap import is_noise
from sim2real.hypotheses.pairs import add_pairs, beside
from sim2real.hypotheses.selection import decide
from sim2real.observing.drive import ACCEL, SPEED, WHEEL
from sim2real.observing.evidence import Evidence, gather
from sim2real.observing.noise import Noise
from sim2real.result import Verdict
from sim2real.where.sensor_isolation import lone_sensor


def only(*keys):
    return set(EFFECTS) - set(keys)


# --- forms


def test_each_effect_enters_the_contest_once():
    held = gather(MODEL, random_drives({}, count=1, seed=3, duration_s=5.0))
    first = first_round(MODEL, held, only("rolling_resistance", "tyre_relaxation", "mass_offset"))
    contest = hold_contest(MODEL, held, held, first)
    assert sorted(e.ids[0] for e in contest.singles) == [
        "mass_offset",
        "rolling_resistance",
        "tyre_relaxation",
    ]
    tried = [(f.candidate.ids[0], f.candidate.forms[0]) for f in first]
    assert sorted(tried) == sorted(
        (key, form)
        for key in ("mass_offset", "rolling_resistance", "tyre_relaxation")
        for form, kind in enumerate(FORMS[key])
        if len(kind.parameters()) == len(FORMS[key][0].parameters())
    )


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
    return hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, few)), fit_to, held


def partners(contest, fit_to):
    """What each effect promises to leave beside the best one, and its id."""
    best, *others = contest.singles
    found = best.fitted
    return beside(found.candidate, found.x, found.jacobian, others, fit_to, 1, silent)


def test_the_missing_effect_is_the_first_partner(two_causes):
    contest, fit_to, held = two_causes
    assert contest.singles[0].ids == ("aero_drag",)
    found = partners(contest, fit_to)
    assert found[0][1] == "wheel_inertia_offset"
    assert [loss for loss, _ in found] == sorted(loss for loss, _ in found)
    assert decide(contest, fit_to, held).verdict is Verdict.UNKNOWN


def test_a_shaft_that_swings_is_found_beside_a_resistance():
    """Alone it is fitted to nothing, and at the ends of its starting values it swings otherwise."""
    shaft = {"stiffness_nm_rad": 1800.0, "damping_nm_s_rad": 8.0, "motor_inertia_kg_m2": 0.7}
    effects = {"driveline_compliance": shaft, "rolling_resistance": {"coefficient": 0.026}}
    logs = random_drives(effects, count=2, seed=3, duration_s=15.0)
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    few = only("rolling_resistance", "driveline_compliance", "torque_delay", "torque_lag")
    contest = hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, few))
    assert contest.singles[0].ids == ("rolling_resistance",)
    assert partners(contest, fit_to)[0][1] == "driveline_compliance"


def test_a_pair_leaves_no_more_than_its_members(two_causes):
    contest, fit_to, held = two_causes
    paired = add_pairs(contest, MODEL, fit_to, held)
    single = {e.ids[0]: e.loss_fit for e in contest.singles}
    for pair in paired.pairs:
        assert pair.loss_fit <= 1.001 * min(single[key] for key in pair.ids)
    assert decide(paired, fit_to, held).winner.ids == ("aero_drag", "wheel_inertia_offset")


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
    assert "Without the signal of the accelerometer all other signals agree" in said.unexplained.sentence
    assert {place.subsystem for place in said.where} == {"accelerometer"}


def test_fits_take_the_best_of_several_starts():
    held = gather(MODEL, random_drives({"mass_offset": {"mass_kg": 200.0}}, count=1, seed=9, duration_s=6.0))
    found = fit(Candidate(MODEL, ("mass_offset",)), held, np.array([[-300.0], [190.0]]), 1)
    assert found.x[0] == pytest.approx(200.0, rel=0.05)
