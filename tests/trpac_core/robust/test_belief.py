"""The filter against a plain one: loops over tyres and cells, 2 x 2 matrices, slopes by differences."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core import tyre
from trpac_core.robust.belief import (
    Belief,
    WheelModel,
    driven,
    hypotheses,
    mean_offset,
    read,
    shows,
    told_formula,
    unread,
)
from trpac_core.robust.blocks import Reading
from trpac_core.robust.tyres import TOLD, TYRES

THETA = np.array([0.1, 0.2, 0.35, 0.5, 0.8, 1.1])
KNOWN = hypotheses(TYRES)
WHEEL = WheelModel(stiffness_n=5e4, mean_load_n=3200.0, inertia_kg_m2=1.2, radius_m=0.29)
NOISE = {"wheel_noise": 1e-4, "speed_noise": 9e-6, "torque_noise_nm": 3.2}
PRIOR = np.array([0.1, 0.3, 0.2, 0.2, 0.1, 0.1])
STATES = ("offset", "softness", "offset_variance", "covariance", "softness_variance")


def drawn(seed, spread=0.6):
    """A belief whose variances are below the first ones."""
    draw = np.random.default_rng(seed)
    shape = len(TYRES), len(THETA)
    road, tyres = draw.uniform(0.05, 1.0, shape), draw.uniform(0.1, 1.0, len(TYRES))
    o = spread * np.sqrt(KNOWN.offset_variance) * draw.uniform(0.3, 1.0, shape)
    c = spread * np.sqrt(KNOWN.softness_variance) * draw.uniform(0.3, 1.0, shape)
    return Belief(
        tyres / tyres.sum(),
        road / road.sum(axis=1, keepdims=True),
        0.3 * o * draw.standard_normal(shape),
        0.3 * c * draw.standard_normal(shape),
        o * o,
        o * c * draw.uniform(-0.9, 0.9, shape),
        c * c,
    )


def reading(slip=0.012, friction=0.25, duration_s=0.01, **other):
    whole = {
        "load_n": 3000.0,
        "speed_m_s": 10.0,
        "slip_change": 1e-4,
        "friction_change": 0.002,
        "rim_m_s": 10.0,
        "samples": 10,
    }
    return Reading(slip=slip, friction=friction, duration_s=duration_s, **(whole | other))


def matrices(belief, tyre_at, cell):
    oo, oc, cc = (
        getattr(belief, n)[tyre_at, cell] for n in ("offset_variance", "covariance", "softness_variance")
    )
    mean = np.array([belief.offset[tyre_at, cell], belief.softness[tyre_at, cell]])
    return mean, np.array([[oo, oc], [oc, cc]])


def put(belief, tyre_at, cell, road, mean, covariance):
    for name, value in zip(
        ("road", *STATES), (road, *mean, covariance[0, 0], covariance[0, 1], covariance[1, 1]), strict=True
    ):
        getattr(belief, name)[tyre_at, cell] = value


def blank():
    return Belief(np.zeros(len(TYRES)), *[np.zeros((len(TYRES), len(THETA))) for _ in range(6)])


# A plain filter of one tyre and cell


def stiffness_of(tyre_at, softness, load_n):
    """Told at the mean load; that of all but the told tyre goes with the load."""
    by_load = 1.0 if tyre_at == TOLD else load_n / WHEEL.mean_load_n
    return WHEEL.stiffness_n * math.exp(-softness) * by_load


def used(tyre_at, theta, slip, softness, load_n):
    """Signed used friction of a hypothesis at a signed slip."""
    told, size, stiffness = TYRES[tyre_at], abs(slip), stiffness_of(tyre_at, softness, load_n)
    if told.peak == 0.0:
        return math.copysign(tyre.used_friction(theta, size, load_n, stiffness), slip)
    over_road = size / (1.0 - size) if slip > 0.0 else size
    x = stiffness / load_n * over_road / theta
    s = x / told.peak
    share = x / (1.0 + s * (s + told.peak - 2.0))
    if s > 1.0:
        share = 1.0 - told.fall * (1.0 - share)
    return math.copysign(theta * share, slip)


def slides(tyre_at, theta, slip, softness, load_n):
    """From 0 to 1 where the normalised slip goes beyond 5, twice that of the peak."""
    told, size, stiffness = TYRES[tyre_at], abs(slip), stiffness_of(tyre_at, softness, load_n)
    over_road = size / (1.0 - size) if slip > 0.0 or told.peak == 0.0 else size
    x = stiffness * over_road / load_n / theta
    return x * x / (x * x + 25.0)


def innovation(belief, tyre_at, cell, now):
    """Error, its variance, slope by slip, and the Jacobian by offset and softness."""
    theta, load, step = THETA[cell], now.load_n, 1e-7
    mean, covariance = matrices(belief, tyre_at, cell)
    slip = now.slip - mean[0]

    def predicted(offset, softness):
        return used(tyre_at, theta, now.slip - offset, softness, load)

    jacobian = np.array(
        [
            (predicted(mean[0] + step, mean[1]) - predicted(mean[0] - step, mean[1])) / (2.0 * step),
            (predicted(mean[0], mean[1] + step) - predicted(mean[0], mean[1] - step)) / (2.0 * step),
        ]
    )
    model = (0.02 + 0.2 * slides(tyre_at, theta, slip, mean[1], load)) * predicted(*mean)
    torque = (NOISE["torque_noise_nm"] / (WHEEL.radius_m * load)) ** 2 / now.samples
    inertial = 2.0 * (WHEEL.inertia_kg_m2 / now.duration_s / WHEEL.radius_m / load) ** 2
    changing = (1.0 + 0.3 / now.speed_m_s / now.duration_s) * now.friction_change
    speeds = (WHEEL.radius_m**2 * NOISE["wheel_noise"] + NOISE["speed_noise"]) / now.samples
    slip_variance = speeds / now.speed_m_s**2 + (now.slip_change / 2.0) ** 2
    measured = torque + inertial * NOISE["wheel_noise"] / now.samples + changing**2 + model**2
    variance = measured + jacobian[0] ** 2 * slip_variance + jacobian @ covariance @ jacobian
    return now.friction - predicted(*mean), variance, jacobian


def plainly_read(belief, now):
    after, mass = blank(), np.zeros(len(TYRES))
    power, independent = min(20.0 * now.duration_s, 1.0), 1.0 * now.duration_s
    weight = np.zeros_like(belief.road)
    for i in range(len(TYRES)):
        for j in range(len(THETA)):
            error, variance, jacobian = innovation(belief, i, j, now)
            mean, covariance = matrices(belief, i, j)
            gain = covariance @ jacobian / variance
            put(
                after,
                i,
                j,
                0.0,
                mean + power * gain * error,
                covariance - power * np.outer(gain, gain) * variance,
            )
            slope = max(abs(jacobian[0]), 0.5)
            likelihood = math.exp(-0.5 * error**2 / variance) ** power
            weight[i, j] = belief.road[i, j] * likelihood * (slope / math.sqrt(variance)) ** independent
    mass = weight.sum(axis=1)
    after.road[:] = weight / mass[:, None]
    tyres = belief.tyre * mass / (belief.tyre * mass).sum()
    forgotten = 0.1 * now.duration_s
    after.tyre[:] = (1.0 - forgotten) * tyres + forgotten * np.array([0.35, 0.15, 0.3, 0.2])
    return after


def agree(found, wanted, rel=1e-6):
    for field in fields(Belief):
        a, b = getattr(found, field.name), getattr(wanted, field.name)
        assert a == pytest.approx(b, rel=rel, abs=rel * np.abs(b).max()), field.name


def after(belief, now):
    return read(belief, KNOWN, THETA, now, WHEEL, **NOISE)


@pytest.mark.parametrize("duration_s", [0.01, 0.05, 0.2])
@pytest.mark.parametrize(
    ("slip", "friction"),
    [(0.004, 0.07), (0.015, 0.28), (-0.015, -0.28), (0.2, 0.4), (-0.3, -0.4), (0.01, -0.1)],
)
def test_a_reading_counts_as_in_a_plain_filter(slip, friction, duration_s):
    """From 0.05 s on the power is 1: a textbook extended Kalman filter with the likelihood of its innovation."""
    for seed in range(3):
        belief = drawn(seed)
        now = reading(slip, friction, duration_s, load_n=2800.0, samples=7)
        agree(after(belief, now), plainly_read(belief, now), rel=2e-5)


def test_every_term_of_the_noise_counts():
    """One after the other so large that it decides."""
    for other in (
        {"friction_change": 0.2},
        {"slip_change": 0.01},
        {"samples": 1},
        {"speed_m_s": 1.6},
        {"friction_change": 0.1, "speed_m_s": 40.0, "duration_s": 0.05},
    ):
        now = reading(**({"duration_s": 0.01} | other))
        agree(after(drawn(5), now), plainly_read(drawn(5), now), rel=2e-5)


def test_some_steps_in_a_row_agree_too():
    found, wanted = drawn(9), drawn(9)
    for k in range(5):
        now = reading(0.01 + 0.004 * k, 0.2 + 0.03 * k)
        found = driven(after(found, now), KNOWN, PRIOR, 0.05, 0.01)
        wanted = plainly_driven(plainly_read(wanted, now), 0.05, 0.01)
    agree(found, wanted, rel=1e-4)


@given(st.integers(0, 10_000), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0), st.floats(0.001, 0.05))
def test_a_reading_leaves_probabilities_and_covariances(seed, slip, friction, duration_s):
    found = after(drawn(seed), reading(slip, friction, duration_s))
    assert found.tyre.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.road.sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    assert (found.road > 0.0).all()
    assert (found.tyre > 0.0).all()
    determinant = found.offset_variance * found.softness_variance - found.covariance**2
    assert (determinant > 0.0).all()
    assert (found.offset_variance <= drawn(seed).offset_variance).all()
    assert (found.softness_variance <= drawn(seed).softness_variance).all()


def test_no_cell_is_ruled_out_for_good():
    belief = drawn(1)
    for _ in range(500):
        belief = after(belief, reading(0.05, 0.35))
    assert 1e-31 <= belief.road[0].min() < 1e-20


def test_the_order_of_the_tyres_with_a_peak_does_not_matter():
    order = [0, 1, 3, 2]
    permuted = hypotheses(tuple(TYRES[i] for i in order))
    belief = drawn(2)
    found = read(
        Belief(*(getattr(belief, f.name)[order] for f in fields(Belief))),
        permuted,
        THETA,
        reading(0.02, 0.3),
        WHEEL,
        **NOISE,
    )
    straight = after(belief, reading(0.02, 0.3))
    agree(found, Belief(*(getattr(straight, f.name)[order] for f in fields(Belief))), rel=1e-12)


def test_braking_says_what_driving_says_of_the_told_formula():
    """Mirrored: a tyre's offset changes its sign, the rest stays."""
    belief = drawn(3)
    mirrored = replace(belief, offset=-belief.offset, covariance=-belief.covariance)
    drives, brakes = after(belief, reading(0.02, 0.3)), after(mirrored, reading(-0.02, -0.3))
    for name in ("road", "softness", "offset_variance", "softness_variance"):
        assert getattr(drives, name)[:2] == pytest.approx(getattr(brakes, name)[:2], rel=1e-12)
    assert drives.offset[:2] == pytest.approx(-brakes.offset[:2], rel=1e-12)


def test_a_wheel_that_rolls_freely_says_nothing_of_the_road_but_its_offset():
    belief = unread(KNOWN, PRIOR)
    found = after(belief, reading(0.0, 0.0))
    assert found.road == pytest.approx(belief.road, rel=1e-6)
    assert (found.offset_variance < belief.offset_variance).all()
    assert found.softness_variance == pytest.approx(belief.softness_variance, rel=1e-6)


def test_a_sliding_wheel_shows_the_road_and_a_gentle_one_a_lower_bound():
    """Of the told tyre: all frictions from 0.5 on look alike at a slip of 0.006, and 0.1 does not bear the force."""
    gentle = sliding = unread(KNOWN, np.full(len(THETA), 1.0 / len(THETA)))
    for _ in range(200):
        gentle = after(gentle, reading(0.006, used(0, 0.8, 0.006, 0.0, 3000.0)))
        sliding = after(sliding, reading(0.04, used(0, 0.35, 0.04, 0.0, 3000.0)))
    assert sliding.road[0, 2] > 0.99
    assert gentle.road[0, 0] < 0.1 * gentle.road[0, 3:].min()
    assert gentle.road[0, 3:].max() < 2.0 * gentle.road[0, 3:].min()


@pytest.mark.parametrize(
    ("speed", "rim", "slip", "said"),
    [
        (1.6, 0.6, 0.0, True),
        (1.5, 9.0, 0.0, False),
        (20.0, 0.5, 0.0, False),
        (20.0, 0.51, 0.0, True),
        (20.0, 20.0, 0.39, True),
        (20.0, 20.0, 0.4, False),
        (20.0, 9.0, -0.6, True),
    ],
)
def test_a_slow_car_and_a_wheel_that_stands_or_spins_say_nothing(speed, rim, slip, said):
    assert shows(reading(slip, speed_m_s=speed, rim_m_s=rim)) is said


def test_the_mean_offset_is_that_over_tyres_and_cells():
    belief = drawn(1)
    weights = belief.tyre[:, None] * belief.road
    assert mean_offset(belief) == pytest.approx(np.average(belief.offset, weights=weights), rel=1e-12)


@pytest.mark.parametrize(("slip", "said"), [(0.39, True), (0.4, False), (0.9, False), (-0.9, True)])
def test_a_spinning_wheel_says_nothing_and_a_braked_one_does_until_it_locks(slip, said):
    assert shows(reading(slip)) is said


def test_the_first_belief_is_the_priors():
    found = unread(KNOWN, PRIOR)
    assert found.tyre == pytest.approx([t.weight for t in TYRES])
    for i, told in enumerate(TYRES):
        assert (found.road[i] == PRIOR).all()
        for name, value in zip(
            STATES, (0.0, told.mean_softness, told.slip_offset**2, 0.0, told.softness**2), strict=True
        ):
            assert getattr(found, name)[i] == pytest.approx(value), name


def test_the_told_formula_is_that_of_the_first_two_tyres():
    assert told_formula(unread(KNOWN, PRIOR)) == pytest.approx(0.5)
    only = replace(drawn(1), tyre=np.array([0.1, 0.2, 0.3, 0.4]))
    assert told_formula(only) == pytest.approx(0.3)


# Driving on


def plainly_driven(belief, changed, duration_s, slip_drift=0.0):
    """Mixture of what stays in the cell and what comes from the tyre's mean, replaced by its mean and covariance."""
    found = blank()
    found.tyre[:] = belief.tyre
    for i, told in enumerate(TYRES):
        stays = [matrices(belief, i, j) for j in range(len(THETA))]
        mean, covariance = mixed(belief.road[i], stays)
        covariance[1, 1] += 0.03**2 if told.peak > 0.0 else 0.0
        first = told.slip_offset**2 + slip_drift, told.softness**2
        assert covariance[0, 0] < first[0]
        assert covariance[1, 1] < first[1]
        wander = 0.02**2 * duration_s * np.diag([told.slip_offset**2, told.softness**2])
        for j in range(len(THETA)):
            shares = np.array([(1.0 - changed) * belief.road[i, j], changed * PRIOR[j]])
            m, P = mixed(shares / shares.sum(), [stays[j], (mean, covariance)])
            put(found, i, j, shares.sum(), m, P + wander + np.diag([slip_drift, 0.0]))
    return found


def mixed(weights, parts):
    mean = sum(w * m for w, (m, _) in zip(weights, parts, strict=True))
    spread = [P + np.outer(m - mean, m - mean) for m, P in parts]
    return mean, sum(w * P for w, P in zip(weights, spread, strict=True))


@pytest.mark.parametrize("changed", [0.0, 0.1, 0.9, 1.0])
@pytest.mark.parametrize(("duration_s", "slip_drift"), [(0.01, 0.0), (5.0, 1e-6)])
def test_driving_on_mixes_what_stays_with_what_comes(changed, duration_s, slip_drift):
    for seed in range(3):
        belief = drawn(seed)
        found = driven(belief, KNOWN, PRIOR, changed, duration_s, slip_drift)
        agree(found, plainly_driven(belief, changed, duration_s, slip_drift), rel=1e-9)


def test_a_merged_cell_has_the_moments_of_samples_of_both():
    draw, belief = np.random.default_rng(0), drawn(4)
    i, j, changed, n = 1, 2, 0.3, 200_000
    cells = draw.choice(len(THETA), n, p=belief.road[i])
    share = changed * PRIOR[j] / ((1.0 - changed) * belief.road[i, j] + changed * PRIOR[j])
    cells = np.where(draw.uniform(size=n) < share, cells, j)
    samples = np.empty((n, 2))
    for cell in range(len(THETA)):
        mean, covariance = matrices(belief, i, cell)
        here = cells == cell
        samples[here] = draw.multivariate_normal(mean, covariance, here.sum())
    found = matrices(driven(belief, KNOWN, PRIOR, changed, 0.0), i, j)
    deviation = np.sqrt(np.diag(np.cov(samples.T)))
    assert np.abs(found[0] - samples.mean(axis=0)).max() < 0.01 * deviation.max()
    assert found[1] / np.outer(deviation, deviation) == pytest.approx(np.corrcoef(samples.T), abs=0.02)


def test_nothing_changes_on_no_way_in_no_time():
    belief = drawn(6)
    agree(driven(belief, KNOWN, PRIOR, 0.0, 0.0), belief, rel=1e-12)


@given(st.integers(0, 10_000), st.floats(0.0, 1.0))
def test_driving_on_conserves_probability_and_the_tyres_mean(seed, changed):
    belief = drawn(seed)
    found = driven(belief, KNOWN, PRIOR, changed, 0.0)
    assert found.road.sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    assert (found.tyre == belief.tyre).all()
    for name in ("offset", "softness"):
        before, now = ((b.road * getattr(b, name)).sum(axis=1) for b in (belief, found))
        assert now == pytest.approx(before, rel=1e-9, abs=1e-12)
    second = [(b.road * (b.offset_variance + b.offset**2)).sum(axis=1) for b in (belief, found)]
    assert second[1] == pytest.approx(second[0], rel=1e-9)


def test_on_another_road_the_tyre_is_not_less_known_than_at_first():
    belief = drawn(7, spread=3.0)
    for slip_drift in (0.0, 1e-5):
        found = driven(belief, KNOWN, PRIOR, 1.0, 0.0, slip_drift)
        for i, told in enumerate(TYRES):
            assert found.softness_variance[i] == pytest.approx(told.softness**2)
            assert found.offset_variance[i] == pytest.approx(told.slip_offset**2 + 2.0 * slip_drift)
        determinant = found.offset_variance * found.softness_variance - found.covariance**2
        assert (determinant > 0.0).all()


def test_only_a_tyre_of_unknown_curve_gets_softer_on_another_road():
    belief = drawn(8, spread=0.2)
    kept, other = (driven(belief, KNOWN, PRIOR, 1.0, 0.0), plainly_driven(belief, 1.0, 0.0))
    agree(kept, other, rel=1e-9)
    mean = (belief.road * belief.softness).sum(axis=1, keepdims=True)
    spread = (belief.road * (belief.softness_variance + (belief.softness - mean) ** 2)).sum(axis=1)
    gained = kept.softness_variance[:, 0] - spread
    assert gained == pytest.approx([0.0, 0.0, 9e-4, 9e-4], abs=1e-9)
