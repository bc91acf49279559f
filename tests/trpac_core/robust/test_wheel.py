"""The robust estimator on simulated wheels of which tyre and road are known."""

import json
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest
from quarter_car import LOAD, I, R, driven, magic_formula, pulses, softer_curve, told_curve

from trpac_core.robust import belief as beliefs
from trpac_core.robust.belief import Belief, WheelModel, hypotheses
from trpac_core.robust.interval import Interval, interval
from trpac_core.robust.roads import NONE, priors
from trpac_core.robust.tyres import TYRES
from trpac_core.robust.wheel import RobustState, Sample, begun, claim, point, setup, stepped
from trpac_core.vehicle import EXACT_CAR, CarTolerance

DRY, WET, SNOW = range(3)
CLASSES = (0.8, 0.6, 0.2)
WHEEL = WheelModel(5e4, LOAD, I, R)
KNOWN = setup(WHEEL, 0.0, 0.0042, 3.2, CarTolerance(), CLASSES)
CURVES = {"told": told_curve, "softer": softer_curve, "magic formula": magic_formula}


def course(drive, step_s=1e-3, state=None, known=KNOWN, given=NONE, observed=False):
    """The state after each step; None for a sample where the wheel speed is not a number."""
    state, states = begun(known) if state is None else state, []
    for omega, torque, speed in zip(*(s.tolist() for s in drive[:3]), strict=True):
        sample = None if np.isnan(omega) else Sample(omega, torque, speed, LOAD)
        way_m = 0.0 if sample is None else speed * step_s
        state = stepped(state, known, sample, given, step_s, way_m, observed)
        states.append(state)
    return states


def road(before, after, at_s):
    return lambda t: before if t < at_s else after


@lru_cache
def on(curve, before, after, torque_nm):
    """Drive and states on a road that changes after 1.5 of 3 s."""
    drive = driven(
        pulses(torque_nm),
        road(before, after, 1.5),
        3.0,
        CURVES[curve],
        speed_m_s=8.0 if torque_nm > 0.0 else 30.0,
    )
    return drive, course(drive)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize(
    ("before", "after", "torque_nm"), [(0.9, 0.3, 230.0), (0.3, 0.9, 330.0), (0.9, 0.5, -350.0)]
)
def test_the_interval_holds_the_truth_through_a_change_of_the_road(curve, before, after, torque_nm):
    """But for the first half of a second after the change, in which the wheel may roll."""
    drive, states = on(curve, before, after, torque_nm)
    said = np.array([s.said for s in states])
    low, high = said[:, 2], said[:, 3]
    inside = (low <= drive.theta) & (drive.theta <= high)
    time_s = np.arange(len(inside)) * 1e-3
    assert inside[(time_s < 1.5) | (time_s > 2.0)].mean() > 0.97
    assert (high - low)[0] > 1.0


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize(("theta", "torque_nm"), [(0.2, 230.0), (0.3, 330.0)])
def test_a_tyre_that_slides_makes_the_interval_narrow(curve, theta, torque_nm):
    """Whatever its curve; while it rolls on the road may change."""
    _, states = on(curve, theta, theta, torque_nm)
    said = min((s.said for s in states), key=lambda said: said.high - said.low)
    assert said.high - said.low < 0.15
    assert said.low < theta < said.high
    assert abs(said.mean - theta) < 2.0 * said.std


def test_a_gentle_wheel_leaves_the_interval_open_upwards():
    _, states = on("told", 0.9, 0.9, 60.0)
    said = states[-1].said
    assert said.high > 1.1
    assert 0.05 < said.low < 0.2


def test_the_told_formula_wins_where_it_holds_and_loses_to_a_magic_formula():
    told, other = (
        np.array([beliefs.told_formula(s.belief) for s in on(curve, 0.3, 0.3, 230.0)[1]])
        for curve in ("told", "magic formula")
    )
    assert told[1000:].mean() > 0.4
    assert other[1000:].mean() < 0.2


# The camera


def test_the_class_moves_the_belief_before_the_tyre_slips():
    """Coasting from dry to snow: a new class moves it at once, 4 m of it to where the class lies."""
    coasting = driven(lambda t: 0.0, lambda t: 0.2, 2.0)
    states = course(coasting, given=SNOW)
    way = np.cumsum(coasting.vehicle_speed_m_s) * 1e-3
    mean = np.array([s.said.mean for s in states])
    first, stood = states[20].said, states[int(np.searchsorted(way, 4.1))].said
    assert 0.3 < first.mean < states[0].said.mean - 0.05
    assert stood.mean == pytest.approx(KNOWN.theta @ KNOWN.known.stood[SNOW], abs=0.04)
    assert mean[-1] == pytest.approx(stood.mean, abs=0.03)


def test_another_class_makes_the_observers_estimate_stale_until_it_reads_the_road():
    coasting = driven(lambda t: 0.0, lambda t: 0.2, 1.0)
    read = course(coasting.__class__(*(s[:20] for s in coasting)), observed=True)[-1]
    assert not read.stale
    assert read.unread_m == 0.0
    kept = course(coasting, state=read)[-1]
    assert not kept.stale
    assert kept.unread_m == pytest.approx(8.0, abs=0.1)
    states = course(coasting, state=read, given=SNOW)
    when = next(i for i, s in enumerate(states) if s.stale)
    assert 8.0 * when * 1e-3 == pytest.approx(4.0, abs=0.2)
    assert not course(coasting, state=states[-1], observed=True)[0].stale


def test_what_the_observer_reads_on_the_classs_own_road_is_not_stale():
    """The class stands 4 m after the road began; the observer last read it 3 m ago."""
    coasting = driven(lambda t: 0.0, lambda t: 0.2, 1.0)
    state = begun(KNOWN)._replace(stale=False)
    for k, (omega, torque, speed) in enumerate(zip(*(s.tolist() for s in coasting[:3]), strict=True)):
        state = stepped(state, KNOWN, Sample(omega, torque, speed, LOAD), SNOW, 1e-3, speed * 1e-3, k == 150)
    assert state.memory.stood == SNOW
    assert not state.stale


# The point


def said_of(mean, std=0.05, clip=0.1, high=1.0):
    return Interval(mean, std, 0.86 * clip, 1.06 * high, clip, high)


def state_of(tyre, said, stale=False):
    start = begun(KNOWN)
    belief = replace(start.belief, tyre=np.array(tyre))
    return start._replace(belief=belief, said=said, stale=stale)


@pytest.mark.parametrize(("told", "share"), [(1.0, 1.0), (0.2, 1.0), (0.125, 0.5), (0.05, 0.0), (0.0, 0.0)])
def test_the_point_follows_the_observer_as_far_as_the_told_formula_is_believed(told, share):
    state = state_of([0.5 * told, 0.5 * told, 1.0 - told, 0.0], said_of(0.5))
    assert point(state, 0.4) == pytest.approx(0.5 - 0.1 * share)
    assert point(state._replace(stale=True), 0.4) == pytest.approx(0.5)


def test_the_point_stays_within_the_bounds():
    state = state_of([1.0, 0.0, 0.0, 0.0], said_of(0.5, clip=0.3, high=0.7))
    assert point(state, 0.1) == 0.3
    assert point(state, 0.9) == 0.7
    assert point(state, 0.6) == 0.6


def test_the_points_deviation_has_the_distance_from_the_mean_and_four_per_cent():
    said = said_of(0.5, std=0.05)
    assert claim(said, 0.5).deviation == pytest.approx(np.hypot(0.05, 0.02))
    assert claim(said, 0.4).deviation == pytest.approx(np.sqrt(0.05**2 + 0.02**2 + 0.1**2))


@pytest.mark.parametrize(("theta", "low", "high"), [(0.5, 0.4, 0.6), (0.2, 0.2, 0.6), (0.9, 0.4, 0.9)])
def test_the_interval_of_a_claim_holds_it(theta, low, high):
    said = said_of(0.5)._replace(low=0.4, high=0.6)
    assert claim(said, theta)[1:] == (low, high)


def test_on_the_told_tyre_the_point_is_the_observers():
    states = on("told", 0.3, 0.3, 230.0)[1]
    assert point(states[-1]._replace(stale=False), 0.301) == 0.301


# Steps and blocks


def same(one, other):
    """Whether two states are the same bit by bit."""
    return json.dumps(one.to_json()) == json.dumps(other.to_json())


def test_a_state_that_was_written_goes_on_as_if_it_had_not_been():
    drive, states = on("told", 0.9, 0.3, 230.0)
    for at in (4, 1807):
        written = json.loads(json.dumps(states[at].to_json()))
        restored = RobustState.from_json(written)
        assert same(restored, states[at])
        assert [type(value) for value in restored] == [type(value) for value in states[at]]
        onward = course([s[at + 1 : at + 40] for s in drive], state=restored)
        assert same(onward[-1], states[at + 39])


def test_a_block_is_full_after_10_ms():
    drive, states = on("told", 0.9, 0.3, 230.0)
    full = [i for i in range(1, 200) if states[i].filling.duration_s < states[i - 1].filling.duration_s]
    assert full == list(range(9, 200, 10))
    means = states[9].before
    for value, signal in zip(means[:3], drive[:3], strict=True):
        assert value == pytest.approx(signal[:10].mean(), rel=1e-9)
    assert (means.load_n, means.samples) == (pytest.approx(LOAD), 10)
    assert states[8].way_m == pytest.approx(drive.vehicle_speed_m_s[:9].sum() * 1e-3)
    assert states[9].way_m == 0.0
    assert states[19].friction == pytest.approx(drive.wheel_torque_nm[:20].mean() / R / LOAD, abs=0.02)
    assert states[19].slowness_s_m == pytest.approx(1.0 / 8.0, rel=0.01)


def test_a_value_that_is_held_is_one_sample():
    drive = driven(lambda t: 100.0, lambda t: 0.9, 0.02)
    held = drive.__class__(*(np.repeat(s[::5], 5) for s in drive))
    assert course(held)[9].before.samples == 2


def test_signals_of_20_hz_that_are_held_make_it_no_surer_than_those_at_their_own_steps():
    """On a road of 0.3 and on one of 0.9; half as wide would be as if each held sample were four."""
    for theta in (0.3, 0.9):
        drive = driven(pulses(230.0), lambda t, theta=theta: theta, 3.0)
        slow = drive.__class__(*(s[::50] for s in drive))
        held = drive.__class__(*(np.repeat(s, 50) for s in slow))
        own, by_ms = (
            np.array([s.said for s in course(d, step_s)]) for d, step_s in ((slow, 0.05), (held, 1e-3))
        )
        own_width, held_width = ((s[:, 3] - s[:, 2]) for s in (own[20:], by_ms[49::50][20:]))
        assert held_width.mean() > 0.5 * own_width.mean()
        assert np.median(held_width / own_width) > 0.5


def test_steps_of_10_ms_say_what_steps_of_1_ms_say():
    drive, states = on("told", 0.9, 0.3, 230.0)
    slow = drive.__class__(*(s.reshape(-1, 10).mean(axis=1) for s in drive))
    fine, coarse = (np.array([s.said for s in of]) for of in (states[9::10], course(slow, 0.01)))
    for k in (0, 2, 3):
        assert np.abs(coarse[:, k] - fine[:, k]).mean() < 0.03


def test_unusable_readings_leave_the_tyre_and_let_the_road_fade():
    state = on("told", 0.3, 0.3, 230.0)[1][-1]
    gone = state
    for _ in range(1000):
        gone = stepped(gone, KNOWN, None, NONE, 1e-3, 0.02, False)
    assert gone.before is None
    assert (gone.friction, gone.filling.samples) == (0.0, 0)
    assert gone.unread_m == pytest.approx(state.unread_m + 20.0)
    assert (gone.belief.tyre == state.belief.tyre).all()
    prior = KNOWN.known.none
    kept = np.exp(-0.02 * 20.0)
    assert gone.belief.road == pytest.approx(kept * state.belief.road + (1.0 - kept) * prior, abs=1e-9)
    assert gone.said == interval(gone.belief, KNOWN.theta)
    assert gone.said.std > state.said.std


def test_after_unusable_readings_the_first_block_is_not_compared_with_the_old_one():
    """At another speed: neither the jump over the gap nor what was lost in a block is a force."""
    drive = driven(lambda t: 100.0, lambda t: 0.9, 0.105)
    state = course(drive)[-1]
    for _ in range(3):
        state = stepped(state, KNOWN, None, NONE, 1e-3, 0.0, False)
    faster = driven(lambda t: 100.0, lambda t: 0.9, 0.1, speed_m_s=20.0)
    states = course(faster, state=state)
    assert max(abs(s.friction) for s in states) < 0.2


def test_a_wheel_that_stands_says_nothing():
    still = course([np.zeros(300), np.zeros(300), np.zeros(300)])
    assert (still[-1].belief.tyre == begun(KNOWN).belief.tyre).all()
    assert still[-1].belief.road == pytest.approx(begun(KNOWN).belief.road, abs=1e-12)
    assert still[-1].slowness_s_m == 0.0


def test_a_constant_error_of_the_speed_is_another_slip_at_another_speed():
    """Coasting at 5 m/s, then at 20: the offset's variance gains b^2 (1 / 5 - 1 / 20) / 5, less what is read."""
    told = setup(WHEEL, 0.0, 0.0042, 3.2, CarTolerance(speed_bias_m_s=0.0), CLASSES)
    biased = replace(told, speed_bias_m_s=0.1)
    slow, fast = (driven(lambda t: 0.0, lambda t: 0.9, 0.05, speed_m_s=v, noise=0.0) for v in (5.0, 20.0))
    gap = [np.full(10, np.nan)] * 3
    state = course(gap, known=told, state=course(slow, known=told)[-1])[-1]
    known = [course(fast, known=k, state=state)[19].belief.offset_variance.mean() for k in (told, biased)]
    gained = 0.1**2 * (1.0 / 5.0 - 1.0 / 20.0) / 5.0
    assert 0.5 * gained < known[1] - known[0] < gained


# Set-up


def test_the_set_up_takes_what_is_told():
    known = setup(WHEEL, 0.0065, 0.0042, 3.2, CarTolerance(0.014, ratio=0.001, compliance=0.02), CLASSES)
    assert known.tyres.offset_variance[:, 0] == pytest.approx([0.001**2, 0.005**2, 0.005**2, 0.005**2])
    assert known.tyres.softness_variance[:, 0] == pytest.approx([0.02**2, 0.15**2, 0.2**2, 0.2**2])
    assert (known.rolling_resistance, known.torque_noise_nm, known.speed_bias_m_s) == (0.0065, 3.2, 0.014)
    sliding = known.wheel_noise * R * R + known.speed_noise
    assert sliding == pytest.approx(0.0042**2)
    assert known.speed_noise == pytest.approx(0.5 * 0.0042**2)
    for found, wanted in zip(known.known, priors(known.theta, CLASSES), strict=True):
        assert (found == wanted).all()
    for name in ("weight", "peak", "fall"):
        assert (getattr(known.tyres, name) == getattr(hypotheses(TYRES), name)).all()


def test_a_car_that_is_exactly_as_told_still_has_a_variance():
    known = setup(WHEEL, 0.0, 0.0, 0.0, EXACT_CAR, CLASSES)
    assert known.tyres.offset_variance[0, 0] == pytest.approx(1e-8)
    assert known.tyres.softness_variance[0, 0] == pytest.approx(1e-8)
    drive = driven(pulses(230.0), lambda t: 0.3, 1.0, noise=0.0)
    state = course(drive, known=known)[-1]
    assert all(np.isfinite(getattr(state.belief, f.name)).all() for f in fields(Belief))
    assert state.said.low < 0.3 < state.said.high


def test_before_anything_was_read_nothing_is_known_but_how_rare_wet_ice_is():
    state = begun(KNOWN)
    assert state.stale
    assert state.said == interval(state.belief, KNOWN.theta)
    assert (state.said.low, state.said.high) == (
        pytest.approx(0.018, abs=0.03),
        pytest.approx(1.26, abs=0.03),
    )
    assert (state.memory.last, state.before) == (NONE, None)
    assert (state.friction, state.slowness_s_m, state.way_m, state.unread_m) == (0.0, 0.0, 0.0, 0.0)
    assert (state.wheel_noise.variance, state.speed_noise.variance) == (KNOWN.wheel_noise, KNOWN.speed_noise)


# What contradicts the told car


def test_the_time_of_doubt_grows_while_another_curve_is_used_and_ends_where_the_told_is_believed():
    _, states = on("magic formula", 0.3, 0.3, 230.0)
    told = np.array([beliefs.told_formula(s.belief) for s in states])
    doubt = np.array([s.doubted_s for s in states])
    assert doubt[-1] > 0.5
    assert (doubt[told >= 0.2] == 0.0).all()
    gained = np.diff(doubt)
    assert gained[gained > 0.0] == pytest.approx(0.01, rel=1e-6)
    used = np.array([abs(s.friction) / s.said.mean for s in states])[1:]
    assert (used[gained > 0.0] > 0.1).all()
    full = np.array([s.filling.duration_s == 0.0 for s in states])[1:]
    assert (gained[full & (told[1:] < 0.2) & (used > 0.1)] > 0.0).all()
    assert not any(s.doubted_s for s in on("told", 0.3, 0.3, 330.0)[1])


@pytest.mark.parametrize(("radius_share", "strange"), [(1.0, False), (1.02, True), (0.98, True)])
def test_a_wheel_of_another_radius_reads_a_strange_offset(radius_share, strange):
    """Coasting; 2 % is more than twice the told tolerance of 0.3 % and the speed's bias at 20 m/s."""
    drive = driven(lambda t: 0.0, lambda t: 0.9, 1.0, speed_m_s=20.0)
    state = course(drive._replace(wheel_speed_rad_s=drive.wheel_speed_rad_s * radius_share))[-1]
    assert (state.offset_s > 0.5) is strange
    assert beliefs.mean_offset(state.belief) == pytest.approx(radius_share - 1.0, abs=0.004)
