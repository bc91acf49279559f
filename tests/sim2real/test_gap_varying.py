"""Effects that are not the same everywhere: told by what a constant leaves, and not mistaken for other effects."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, STEP_S, clean, noisy, pulses, remeasured, trace

from scenarios.effects import EFFECTS, FORMS
from scenarios.effects.road_grade import RoadGrade
from scenarios.effects.torque_gain import TorqueGain, TorqueGainOfAxles
from scenarios.effects.torque_lag import TorqueLag, TorqueLagInTwoStages
from sim2real.diagnose import find
from sim2real.observing.drive import SPEED
from sim2real.observing.evidence import gather
from sim2real.observing.observer import Towards
from sim2real.observing.probing import FORGOTTEN_S, sets_apart, windows
from sim2real.result import Verdict
from sim2real.telling.findings import describe
from sim2real.which.contest import enter, silent
from sim2real.which.fitting import FULL_STEPS, Candidate
from sim2real.which.goodness import fitness
from sim2real.which.selection import decide
from sim2real.which.varying import STEP, vary

DURATION_S = 16.0


def swaying(drive, mean=0.97, sway=0.012):
    """The drive with a ground speed whose scale sways."""
    factor = mean + sway * np.sin(2.0 * np.pi * drive.time_s / 8.0)
    measured = drive.measured.copy()
    measured[:, SPEED] *= factor
    return remeasured(drive, measured)


@pytest.fixture(scope="module")
def logs():
    nominal = clean(pulses(DURATION_S), 14.0)
    return [noisy(swaying(nominal), seed) for seed in range(3)]


def test_a_model_between_two_is_each_at_its_end(logs):
    other = MODEL.with_effects(RoadGrade(0.03), TorqueGain(1.1))
    n = len(logs[0])
    for share, end in ((0.0, MODEL), (1.0, other)):
        mixed = MODEL.predict(logs[0], towards=Towards((other,), np.full((n, 1), share))).channels
        np.testing.assert_allclose(mixed, end.predict(logs[0]).channels, rtol=1e-9, atol=1e-9)


def test_a_value_that_sways_is_followed_to_the_noise(logs):
    fit_to, held = gather(MODEL, logs[:2]), gather(MODEL, logs[2:])
    entry = enter(Candidate(MODEL, ("vehicle_speed_scale",)), fit_to, held, np.array([0.98]), FULL_STEPS)
    fit_to, held = (
        e.sharpened(MODEL.with_effects(*entry.fitted.candidate.effects(entry.fitted.x)))
        for e in (fit_to, held)
    )
    entry = enter(entry.fitted.candidate, fit_to, held, entry.fitted.x, FULL_STEPS)
    varied = vary(entry, fit_to, held, "time")
    assert fitness(entry, fit_to, held).misfit > 3.0
    assert fitness(varied.entry, fit_to, held).misfit < 1.5
    assert varied.spread["vehicle_speed_scale", "factor"] == pytest.approx(0.012 / np.sqrt(2.0), rel=0.3)


def test_a_value_that_varies_stays_within_its_bounds(logs, monkeypatch):
    """Beyond them an inertia may be negative, which the plant would follow in steps without end."""
    fit_to, held = gather(MODEL, logs[:2]), gather(MODEL, logs[2:])
    candidate = Candidate(MODEL, ("wheel_inertia_offset",))
    entry = enter(candidate, fit_to, held, np.array([1.2]), 1)
    (low,), (high,) = candidate.bounds
    driven = []

    def far_off(z, slopes, prior, a):
        return np.where(np.arange(len(a)) % 2, 1e6, -1e6)

    def predict(self, drive, push=None, towards=None):
        driven.append(towards.shares[:, 0])
        return plain(self, drive, push, towards)

    plain = type(MODEL).predict
    monkeypatch.setattr("sim2real.which.varying._solved", far_off)
    monkeypatch.setattr(type(MODEL), "predict", predict)
    vary(entry, fit_to, held, "time")
    step = STEP * float(candidate.scale[0])
    values = float(entry.fitted.x[0]) + step * np.concatenate(driven)
    assert values.min() == pytest.approx(low)
    assert values.max() == pytest.approx(high)


@pytest.mark.long
def test_a_swaying_scale_is_named_with_its_spread(logs):
    rest = set(EFFECTS) - {"vehicle_speed_scale", "wheel_radius_offset", "road_grade"}
    found = find(MODEL, logs[:2], logs[2], exclude=rest)
    assert found.decision.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
    assert found.decision.winner.ids == ("vehicle_speed_scale",)
    assert found.decision.varied is not None
    assert found.decision.varied.over == "time"


@pytest.mark.long
def test_two_causes_are_named_though_one_of_them_sways():
    nominal = clean(pulses(DURATION_S), 14.0, effects={"torque_gain": {"factor": 1.12}})
    both = [noisy(swaying(nominal), seed) for seed in range(3)]
    few = {"vehicle_speed_scale", "torque_gain", "aero_drag", "tyre_stiffness_offset"}
    found = find(MODEL, both[:2], both[2], exclude=set(EFFECTS) - few)
    assert found.decision.verdict is Verdict.COMPOUND
    assert found.decision.winner.ids == ("torque_gain", "vehicle_speed_scale")
    assert found.decision.varied is not None
    spread = found.decision.varied.spread
    assert spread["vehicle_speed_scale", "factor"] > 5e-3
    said = describe(found, seed=0, jobs=1, progress=silent)
    assert said.variation.effect == "vehicle_speed_scale"
    gain, scale = (next(c for c in said.causes if c.effect == key) for key in found.decision.winner.ids)
    assert gain.parameters["factor"].low <= 1.12 <= gain.parameters["factor"].high
    assert scale.parameters["factor"].low <= 0.97 <= scale.parameters["factor"].high


@pytest.mark.long
def test_torque_that_a_dead_band_takes_is_no_gain_that_varies():
    """Six values over the torque do in the gain's place what the gain does only as it varies."""
    rng = np.random.default_rng(3)
    sizes = [(t, rng.choice([-1, 1]) * rng.uniform(5.0, 200.0)) for t in range(17)]
    command = trace(*((t + dt, size) for t, size in sizes for dt in (0.0, 0.7)), duration_s=DURATION_S)
    real = np.sign(command) * np.maximum(np.abs(command) - 12.0, 0.0)
    logs = [noisy(clean(real, 14.0, commanded_nm=command), seed) for seed in range(3)]
    found = find(MODEL, logs[:2], logs[2], exclude=set(EFFECTS) - {"torque_gain"})
    assert found.decision.verdict is Verdict.UNKNOWN
    free = replace(found.contest, motion=np.inf)  # as where a curve beside the gain does a little less
    assert decide(free, found.fit_to, found.holdout).verdict is Verdict.UNKNOWN
    fooled = decide(replace(free, instead=np.inf), found.fit_to, found.holdout)
    assert fooled.varied is not None
    assert fooled.winner.ids == ("torque_gain",)


def test_axles_that_are_unlike_have_their_mean_and_their_difference():
    torque = trace((0.0, 100.0), duration_s=2.0)
    made = TorqueGainOfAxles(0.95, 0.04).actuate(np.arange(len(torque)) * 0.008, torque)
    np.testing.assert_allclose(made[0], [99.0, 99.0, 91.0, 91.0])


def test_two_stages_lag_as_long_as_one_and_begin_later():
    time_s = np.arange(400) * 0.008
    step = np.where(time_s[:, None] >= 0.4, 100.0, 0.0) * np.ones(4)
    one, two = (kind(0.2).actuate(time_s, step)[:, 0] for kind in (TorqueLag, TorqueLagInTwoStages))
    assert np.trapezoid(step[:, 0] - two, time_s) == pytest.approx(
        np.trapezoid(step[:, 0] - one, time_s), rel=0.02
    )
    assert two[55] < 0.5 * one[55]


@pytest.mark.parametrize(
    "key",
    [
        "brake_drag",
        "rolling_resistance",
        "wheel_inertia_offset",
        "tyre_stiffness_offset",
        "torque_gain",
        "wheel_radius_offset",
    ],
)
def test_alike_axles_are_the_plain_form(key):
    plain, unlike = FORMS[key][0], next(k for k in FORMS[key] if k.form == "axles unlike")
    car = MODEL.vehicle.to_core()
    value = plain.parameters()[0].start_values(car)[0]
    drive = clean(pulses(4.0), 12.0)
    a, b = (MODEL.with_effects(e).predict(drive).channels for e in (plain(value), unlike(value, 0.0)))
    np.testing.assert_array_equal(a, b)
    c = MODEL.with_effects(unlike(value, 0.05)).predict(drive).channels
    assert np.abs(c - a).max() > 1e-6


def test_bumps_far_apart_are_probed_by_one_run():
    t = np.linspace(0.0, 30.0, 3001)
    knots = np.arange(31.0)
    weights = [np.interp(t, knots, row) for row in np.eye(31)] + [np.zeros_like(t)]
    sets = sets_apart(weights, 1.0)
    assert sorted(b for chosen in sets for b in chosen) == list(range(31))
    assert len(sets) == round(2.0 + FORGOTTEN_S)
    for chosen in sets:
        cuts = windows([weights[b] for b in chosen])
        assert cuts[-1].stop == len(t)
        for b, cut, following in zip(chosen, cuts, cuts[1:], strict=False):
            assert np.flatnonzero(weights[b])[0] == cut.start
            assert cut.stop == following.start
            assert t[cut.stop] - t[cut.start] == pytest.approx(2.0 + FORGOTTEN_S, abs=1.0)


def test_unlike_axles_are_told_from_a_second_effect():
    torque = pulses(DURATION_S)
    true = TorqueGainOfAxles(1.08, 0.05).actuate(np.arange(len(torque)) * STEP_S, torque)
    logs = [noisy(clean(true, 14.0, commanded_nm=torque), seed) for seed in range(3)]
    found = find(
        MODEL, logs[:2], logs[2], exclude=set(EFFECTS) - {"torque_gain", "mass_offset", "torque_lag"}
    )
    assert found.decision.verdict is Verdict.IDENTIFIED
    assert found.decision.winner.fitted.x == pytest.approx([1.08, 0.05], abs=0.01)
    assert found.contest.twins
    for twin in found.contest.twins:
        own = [
            parameter.name
            for effect, parameter in twin.fitted.candidate.parameters
            if effect == "torque_gain"
        ]
        assert own == ["factor"]
    assert found.contest.twins[0].loss > found.decision.winner.loss
