"""What is blamed on no effect: a hum, a slow sensor, a limited rate, rare faults, laws of another, gaps left open."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, SIGMA, STEP_S, clean, noisy, pulses, remeasured, trace
from scipy.signal import lfilter

from scenarios.effects import EFFECTS
from scenarios.effects.shifting import delayed
from scenarios.effects.torque_gain import TorqueGainOfAxles
from scenarios.effects.torque_lag import TorqueLag
from sim2real.diagnose import find
from sim2real.observing.drive import CHANNELS, SPEED, WHEEL
from sim2real.observing.evidence import gather
from sim2real.observing.hum import hum
from sim2real.result import Structure, Verdict
from sim2real.telling.findings import describe
from sim2real.telling.sentences import verdict as verdict_of
from sim2real.which import closure, law, sluggish
from sim2real.which.closure import FLOOR_DOUBT, MOST_LEFT, closing, left_open
from sim2real.which.contest import Entry, enter, silent
from sim2real.which.fitting import FULL_STEPS, Candidate
from sim2real.which.goodness import Fitness, fitness
from sim2real.which.law import held_to_curves
from sim2real.which.quiet import NO_GAP_MISFIT
from sim2real.which.selection import EXPLAINED_MISFIT, PAIR_MISFIT, Decision, decide

DURATION_S = 16.0


def only(*keys):
    return set(EFFECTS) - set(keys)


@pytest.fixture(scope="module")
def nominal():
    return clean(pulses(DURATION_S), 14.0)


def ringing(n, pitch_hz, rng):
    """Noise of unit variance about one pitch: a resonance 0.3 Hz wide, driven by white noise."""
    keep = np.exp(-np.pi * 0.3 * STEP_S)
    turn = 2.0 * np.pi * pitch_hz * STEP_S
    rows = lfilter([1.0], [1.0, -2.0 * keep * np.cos(turn), keep**2], rng.standard_normal(n))
    return rows / rows.std()


def humming(drive, seed):
    rng = np.random.default_rng(seed + 100)
    off = np.zeros_like(drive.measured)
    for i, pitch_hz in zip(range(WHEEL.start, WHEEL.stop), (18.0, 23.0, 26.0, 31.0), strict=True):
        off[:, i] = 2.0 * SIGMA[i] * ringing(len(drive), pitch_hz, rng)
    return noisy(remeasured(drive, drive.measured + off), seed)


def test_a_hum_is_no_gap_though_an_effect_would_damp_it(nominal):
    found = find(
        MODEL,
        [humming(nominal, 0), humming(nominal, 1)],
        humming(nominal, 2),
        exclude=only("tyre_relaxation"),
    )
    null, damping = found.contest.null, found.contest.singles[0]
    assert damping.loss < 0.97 * null.loss  # what would be taken for an effect
    assert found.decision.verdict is Verdict.NO_GAP


def test_a_hum_is_what_left_and_right_do_not_share():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((2000, len(CHANNELS)))
    assert not hum(rows, STEP_S).any()
    rows[:, WHEEL] += 2.0 * ringing(2000, 20.0, rng)[:, None]  # of the driveline
    assert not hum(rows, STEP_S).any()
    rows[:, WHEEL.start] += 2.0 * ringing(2000, 30.0, rng)
    front, rear = hum(rows, STEP_S)[:, [WHEEL.start, WHEEL.start + 2]].T
    pitch = np.fft.rfftfreq(2000, STEP_S)
    assert front.any()
    assert np.all(np.abs(pitch[front] - 30.0) < 5.0)
    assert not rear.any()


def test_a_cause_that_leaves_much_of_the_gap_is_not_blamed(nominal):
    logs = [
        noisy(clean(pulses(DURATION_S), 14.0, effects={"torque_gain": {"factor": 1.1}}), seed)
        for seed in range(3)
    ]
    fit_to, held = gather(MODEL, logs[:2]), gather(MODEL, logs[2:])
    entry = enter(Candidate(MODEL, ("torque_gain",)), fit_to, held, np.array([1.08]), FULL_STEPS)
    half = enter(Candidate(MODEL, ("torque_gain",)), fit_to, held, np.array([1.05]), 1)
    fits = fitness(entry, fit_to, held)
    for which, low, high in ((entry, 0.0, 0.02), (half, MOST_LEFT, 1.0)):
        share, floors = left_open(MODEL, which, held)
        assert low <= share <= high
        assert (floors > FLOOR_DOUBT) is (which is half)
        said = Decision(Verdict.IDENTIFIED, which, (), {"torque_gain": 0.9}, fits, fits)
        left = closing(said, MODEL, held)
        assert left.verdict is (Verdict.IDENTIFIED if which is entry else Verdict.UNKNOWN)
        assert (left.left_open > 0.0) is (which is half)
        assert left.probability["torque_gain"] <= 0.9


@pytest.mark.parametrize(
    ("share", "floors", "verdict"),
    [
        (0.1, 5.0, Verdict.IDENTIFIED),
        (0.3, 1.2, Verdict.IDENTIFIED),
        (0.3, 1.5, Verdict.UNKNOWN),
        (0.6, 1.2, Verdict.UNKNOWN),
    ],
)
def test_what_is_left_near_the_floor_may_be_the_noise(monkeypatch, share, floors, verdict):
    monkeypatch.setattr(closure, "left_open", lambda *_: (share, floors))
    null = Entry((), None, np.zeros(1), np.zeros(1))
    fits = Fitness(1.0, {})
    said = closing(Decision(Verdict.IDENTIFIED, null, (), {"torque_gain": 0.9}, fits, fits), MODEL, None)
    assert said.verdict is verdict


@pytest.mark.parametrize(("slow", "verdict"), [(True, Verdict.UNKNOWN), (False, Verdict.IDENTIFIED)])
def test_a_slow_speed_sensor_is_not_called_late(nominal, slow, verdict):
    lag_s = 0.06
    speed = nominal.measured[:, SPEED]
    keep = np.exp(-STEP_S / lag_s)
    filtered = lfilter([1.0 - keep], [1.0, -keep], speed, zi=[keep * speed[0]])[0]
    measured = nominal.measured.copy()
    measured[:, SPEED] = filtered if slow else delayed(nominal.time_s, speed, lag_s)
    logs = [noisy(remeasured(nominal, measured), seed, 0.2 * SIGMA) for seed in range(3)]
    found = find(MODEL, logs[:2], logs[2], exclude=only("vehicle_speed_delay"))
    assert found.decision.winner.ids == ("vehicle_speed_delay",)
    assert found.decision.verdict is verdict
    said = sluggish.characterise(found.contest)
    assert (said is not None) is slow
    if said:
        assert said.subsystem == "vehicle_speed_sensor"
        (filtering,) = found.contest.impostor.fitted.candidate.effects(found.contest.impostor.fitted.x)
        assert filtering.delay_s == pytest.approx(
            lag_s - 0.5 * STEP_S, rel=0.02
        )  # the log's filter knows no half rows
        assert f"low-pass filter of {filtering.delay_s:.3g} s" in said.sentence


@pytest.mark.parametrize("limited", [True, False])
def test_a_torque_of_limited_rate_is_no_lag(limited):
    """Steps of up to 200 N m in 0.2 s: 1,000 N m/s at most, and a limit of 700."""
    torque = pulses(DURATION_S)
    time_s = np.arange(len(torque)) * STEP_S
    follows = sluggish.LimitedTorqueRate(1.0 / 0.7) if limited else TorqueLag(0.05)
    logs = [
        noisy(clean(follows.actuate(time_s, torque), 14.0, commanded_nm=torque), seed, 0.3 * SIGMA)
        for seed in range(3)
    ]
    found = find(MODEL, logs[:2], logs[2], exclude=only("torque_lag"))
    said = sluggish.characterise(found.contest)
    if limited:
        assert found.decision.verdict is Verdict.UNKNOWN
        assert said is not None
        assert said.subsystem == "powertrain"
        assert "no more than 7" in said.sentence
        (effect,) = found.contest.impostor.fitted.candidate.effects(found.contest.impostor.fitted.x)
        assert effect.s_per_kn_m == pytest.approx(1.0 / 0.7, rel=0.03)
    else:
        assert found.decision.verdict is Verdict.IDENTIFIED
        assert found.decision.winner.ids == ("torque_lag",)
        assert said is None


def test_a_rate_that_no_command_reaches_is_none():
    torque = pulses(DURATION_S)
    time_s = np.arange(len(torque)) * STEP_S
    np.testing.assert_array_equal(sluggish.LimitedTorqueRate(0.9).actuate(time_s, torque), torque)
    limited = sluggish.LimitedTorqueRate(2.0).actuate(time_s, torque)
    assert np.abs(np.diff(limited, axis=0)).max() == pytest.approx(500.0 * STEP_S)
    np.testing.assert_array_equal(sluggish.LimitedTorqueRate(0.0).actuate(time_s, torque), torque)


# --- what is rare but far beyond noise


@pytest.mark.parametrize(
    ("faults", "verdict"),
    [((0, 0, 0), Verdict.NO_GAP), ((0, 1, 0), Verdict.NO_GAP), ((4, 4, 4), Verdict.UNKNOWN)],
    ids=["none", "one", "many"],
)
def test_what_is_rare_but_far_beyond_noise_is_a_gap(nominal, faults, verdict):
    """A wheel that reads 0.3 rad/s less for a tenth of a second, now and then: one block of 240 may be chance."""
    logs = []
    for seed, count in enumerate(faults):
        measured = nominal.measured.copy()
        for begin in 200 + 400 * np.arange(count):
            measured[begin : begin + 12, WHEEL.start] -= 0.3
        logs.append(noisy(remeasured(nominal, measured), seed))
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "wheel_radius_offset"))
    assert found.decision.before.misfit < NO_GAP_MISFIT
    assert found.decision.verdict is verdict
    assert (found.decision.rare > 0.0) is (verdict is Verdict.UNKNOWN)
    sentence = describe(found, seed=0, jobs=1, progress=silent).sentence
    assert ("% of the logs' time" in sentence) is (verdict is Verdict.UNKNOWN)


def test_no_effect_is_blamed_that_leaves_what_is_rare(nominal):
    """All wheels read 0.25 rad/s less for a tenth of a second, in one log to fit alone: the hold-out has no gap."""
    measured = nominal.measured.copy()
    for begin in 100 + 100 * np.arange(10):
        measured[begin : begin + 12, WHEEL] -= 0.25
    logs = [noisy(remeasured(nominal, measured), 0), *(noisy(nominal, seed) for seed in (1, 2))]
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "rolling_resistance"))
    assert found.decision.before.misfit < NO_GAP_MISFIT
    decision = decide(found.contest, found.fit_to, found.holdout)
    assert decision.rare
    assert decision.verdict is Verdict.UNKNOWN


# --- an effect whose work a free curve does as well


def three_logs(effects):
    return [
        noisy(clean(f * pulses(DURATION_S), 14.0, effects=effects), seed)
        for seed, f in enumerate((1.0, 0.8, 1.2))
    ]


@pytest.fixture(scope="module")
def loaded():
    """Logs of a car that is 60 kg heavier than its simulation."""
    return three_logs({"mass_offset": {"mass_kg": 60.0}})


@pytest.fixture(scope="module")
def mistaken(loaded):
    """What is found where the library knows a torque's gain and no payload."""
    return find(MODEL, loaded[:2], loaded[2], exclude=only("torque_gain"))


@pytest.fixture(scope="module")
def told(mistaken):
    """What is said of it."""
    return describe(mistaken, seed=0, jobs=1, progress=silent)


def test_a_look_alike_whose_law_is_not_the_cars_is_not_blamed(mistaken):
    """A torque's gain for a payload: a force over acceleration does as well, and the slip says that torque is right."""
    decision = mistaken.decision
    assert decision.verdict is Verdict.UNKNOWN
    assert decision.winner.ids == ("torque_gain",)
    assert decision.after.misfit < EXPLAINED_MISFIT  # no other gate would have seen it
    assert sum(decision.probability.values()) < 0.25
    assert decision.curve.endswith("over acceleration")


def test_what_comes_nearest_is_told_and_what_speaks_against_it(told):
    assert "Nearest comes torque_gain (factor 0.962" in told.sentence
    assert any("A free curve (" in reason for reason in told.causes[0].evidence_against)


def test_the_right_effect_is_held_to_curves_and_stands(loaded):
    found = find(MODEL, loaded[:2], loaded[2], exclude=only("torque_gain", "mass_offset"))
    assert found.decision.verdict is Verdict.IDENTIFIED
    assert found.decision.winner.ids == ("mass_offset",)


def test_an_effect_whose_law_is_a_curve_itself_stands_where_nothing_is_left_beside_it():
    """A bias of the accelerometer: a curve over speed there does its work as well, of course."""
    logs = three_logs({"accelerometer_bias": {"bias_m_s2": 0.3}})
    found = find(MODEL, logs[:2], logs[2], exclude=only("accelerometer_bias", "mass_offset"))
    assert found.decision.verdict is Verdict.IDENTIFIED
    assert found.decision.winner.ids == ("accelerometer_bias",)


@pytest.mark.long
def test_an_effect_whose_work_no_curve_does_stands_though_more_is_found_beside_it(monkeypatch):
    """A late torque, in a car that is loaded too: a curve beside it finds the load, none is late in its place."""
    logs = three_logs({"torque_delay": {"delay_s": 0.08}, "mass_offset": {"mass_kg": 40.0}})
    found = find(MODEL, logs[:2], logs[2], exclude=only("torque_delay"))
    blamed = replace(found.decision, verdict=Verdict.IDENTIFIED, varied=None)
    assert blamed.winner.ids == ("torque_delay",)
    asked = []
    tried = law.with_refined
    monkeypatch.setattr(law, "with_refined", lambda *given: asked.append(1) or tried(*given))
    assert held_to_curves(blamed, found.contest, found.model, found.fit_to, found.holdout) is blamed
    assert asked, "a curve in its place was tried"


def wide_drives(drive):
    """Three noisy logs from walking pace to 20 m/s and down again, by a function of torque and speed at the start."""
    logs = []
    for seed, (f, speed_m_s) in enumerate(((1.0, 3.0), (1.2, 5.0), (0.9, 4.0))):
        points = [
            (0.5, 0.0),
            (0.8, 200.0),
            (9.0, 200.0),
            (9.3, 0.0),
            (13.0, 0.0),
            (13.3, -200.0),
            (18.0, -200.0),
        ]
        logs.append(noisy(drive(f * trace(*points, (18.3, 0.0), duration_s=20.0), speed_m_s), seed))
    return logs


def with_bearing_drag(torque_nm, speed_m_s, nm_s_rad=0.1):
    """A moment at each wheel that grows with its speed; the log tells of the torque without it."""
    true = torque_nm
    for _ in range(6):
        drive = clean(true, speed_m_s, commanded_nm=torque_nm)
        true = torque_nm - nm_s_rad * drive.measured[:, WHEEL]
    return clean(true, speed_m_s, commanded_nm=torque_nm)


@pytest.mark.long
def test_two_resistances_that_only_make_up_a_third_are_not_blamed():
    """Air and rolling together come near to a drag that grows with speed, which a curve over speed says better."""
    logs = wide_drives(with_bearing_drag)
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "rolling_resistance"))
    decision = found.decision
    assert decision.verdict is Verdict.UNKNOWN
    assert decision.winner.ids == ("aero_drag", "rolling_resistance")
    assert decision.after.misfit < PAIR_MISFIT  # no other gate would have seen it
    assert decision.curve == "bearing over speed"
    causes = describe(found, seed=0, jobs=1, progress=silent).causes
    assert all(any("the work of both" in text for text in c.evidence_against) for c in causes)


@pytest.mark.long
def test_two_resistances_stand_as_what_they_are():
    effects = {"aero_drag": {"drag_area_m2": 0.5}, "rolling_resistance": {"coefficient": 0.012}}
    logs = wide_drives(lambda torque_nm, speed_m_s: clean(torque_nm, speed_m_s, effects=effects))
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "rolling_resistance"))
    assert found.decision.verdict is Verdict.COMPOUND
    assert found.decision.winner.ids == ("aero_drag", "rolling_resistance")


@pytest.mark.parametrize("verdict", [Verdict.NO_GAP, Verdict.AMBIGUOUS, Verdict.UNKNOWN])
def test_what_is_not_blamed_for_sure_is_not_held_to_curves(mistaken, verdict):
    decision = replace(mistaken.decision, verdict=verdict)
    said = held_to_curves(decision, mistaken.contest, mistaken.model, mistaken.fit_to, mistaken.holdout)
    assert said is decision


# --- what an ambiguous verdict says


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ([("mass_offset",)], "torque_gain or as well mass_offset: these"),
        ([("torque_gain", "aero_drag")], "torque_gain, perhaps not alone (with aero_drag): these"),
        (
            [("mass_offset", "road_grade"), *(("torque_gain", key) for key in "abcde")],
            "torque_gain or as well mass_offset with road_grade, perhaps not alone (with a or b or c or one of 2 more)",
        ),
    ],
)
def test_a_sentence_lists_a_few_rivals_and_counts_the_others(mistaken, told, monkeypatch, rivals, said):
    for key in "abcde":
        monkeypatch.setitem(EFFECTS, key, EFFECTS["aero_drag"])
    null = mistaken.contest.null
    decision = replace(
        mistaken.decision,
        verdict=Verdict.AMBIGUOUS,
        rivals=tuple(replace(null, ids=ids) for ids in rivals),
    )
    assert said in verdict_of(decision, told.gap, told.causes)


# --- an effect that is needed for what its form adds alone


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.0, Verdict.UNKNOWN), (1.05, Verdict.IDENTIFIED)], ids=["split", "gain"]
)
def test_torque_that_moves_between_the_axles_is_no_gain(factor, verdict):
    """With every wheel pulling alike the axles' shares are told by slip alone: logs of little noise."""
    torque = pulses(DURATION_S)
    time_s = np.arange(len(torque)) * STEP_S
    true = TorqueGainOfAxles(factor, 0.08).actuate(time_s, torque)
    logs = [noisy(clean(true, 14.0, commanded_nm=torque), seed, 0.2 * SIGMA) for seed in range(3)]
    found = find(MODEL, logs[:2], logs[2], exclude=only("torque_gain"))
    assert found.decision.winner.fitted.x == pytest.approx([factor, 0.08], abs=0.005)
    assert found.decision.verdict is verdict
    assert found.decision.further is (factor == 1.0)
    against = describe(found, seed=0, jobs=1, progress=silent).causes[0].evidence_against
    assert any("not what it is" in text for text in against) is found.decision.further


def test_a_sentence_takes_what_stands_beside_the_cause_together_with_it(mistaken, told):
    """Alone the cause may even enlarge the gap, where another curve of the tyres stands beside it."""
    decision = replace(mistaken.decision, verdict=Verdict.IDENTIFIED)
    before = f"takes the gap from {told.gap.before.total:.1f} to "
    alone = verdict_of(decision, told.gap, told.causes)
    beside = verdict_of(decision, told.gap, told.causes, Structure("tyre_shape", {}, 1.04))
    assert f"{before}{told.gap.after.total:.1f} times the noise floor." in alone
    assert f"{before}1.0 times the noise floor, together with what stands beside it." in beside
