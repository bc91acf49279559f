"""How well an entry does on made-up residuals, and what is no more than noise."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, STEP_S, clean, noisy, pulses, remeasured

from scenarios.effects import EFFECTS
from sim2real.diagnose import find
from sim2real.hypotheses.contest import Contest, Entry, as_it_is
from sim2real.hypotheses.fitting import ROBUST_FROM, Candidate, fit
from sim2real.hypotheses.goodness import fitness, gross_share, inflation
from sim2real.hypotheses.no_gap import NO_GAP_MISFIT, is_noise
from sim2real.hypotheses.selection import probabilities
from sim2real.observing.drive import SPEED, WHEEL
from sim2real.observing.evidence import gather
from sim2real.observing.lattice import Lattice
from sim2real.result import Verdict

COUNTER = Lattice(quantum_rad_s=0.1, window_s=0.02, sigma_rad_s=0.01, step_s=STEP_S)


def made_up(loss_fit, loss_hold, size, count=1000):
    """An entry with residuals of these losses, all alike."""

    def alike(total):
        level = total / count
        size = np.sqrt(level + level**2 / (4.0 * ROBUST_FROM**2))
        return size * np.random.default_rng(0).choice([-1.0, 1.0], count)

    stub = None
    if size:
        ids = ("accelerometer_bias",) if size == 1 else ("mu_split",)
        stub = fit_of(ids)
    return Entry(("x",) * bool(size), stub, alike(loss_fit), alike(loss_hold))


def fit_of(ids):
    drive = noisy(clean(pulses(1.5), 12.0))
    return fit(Candidate(MODEL, ids), gather(MODEL, [drive]), steps=1)


@pytest.fixture(scope="module")
def tiny():
    """Evidence of one drive of 143 rows, 1001 values."""
    return gather(MODEL, [noisy(clean(pulses(142 * STEP_S), 12.0))])


def test_probabilities_follow_loss_and_pay_for_parameters(tiny):
    count = tiny.drives[0].measured.size
    null = made_up(3.0 * count, 3.0 * count, 0, count)
    good, wordy, bad = (made_up(a * count, a * count, k, count) for a, k in ((1.0, 1), (1.0, 2), (1.5, 1)))
    shares = probabilities(Contest(null, (), ()), [good, wordy, bad], tiny, tiny)
    assert shares.sum() == pytest.approx(1.0)
    none, first, second, third = shares
    assert first > second > 0.0
    assert first > third
    assert none < 1e-6


def test_correlated_residuals_carry_less_information(tiny):
    count = tiny.drives[0].measured.size
    rng = np.random.default_rng(0)
    white = Entry((), None, rng.standard_normal(count), rng.standard_normal(count))
    shape = tiny.drives[0].measured.shape
    slow = np.repeat(rng.standard_normal((shape[0] // 50 + 1, 7)), 50, axis=0)[: shape[0]].ravel()
    coloured = Entry((), None, slow, slow)
    assert inflation(white, tiny, tiny) < 3.0
    assert inflation(coloured, tiny, tiny) > 10.0


def test_fitness_is_one_for_noise_and_grows_with_what_noise_would_average_out(tiny):
    rng = np.random.default_rng(1)
    rows = len(tiny.drives[0])
    noise = rng.standard_normal((rows, 7))
    off = noise + np.eye(7)[SPEED]
    flat = fitness(Entry((), None, noise.ravel(), noise.ravel()), tiny, tiny)
    moved = fitness(Entry((), None, off.ravel(), off.ravel()), tiny, tiny)
    assert flat.misfit == pytest.approx(1.0, abs=0.25)
    assert moved.signals["vehicle_speed"] == pytest.approx(5.1, abs=0.6)  # 1 sigma over 25 rows, and noise
    assert moved.signals["accel_x"] == flat.signals["accel_x"]


@pytest.mark.parametrize(("channel", "counted"), [(WHEEL, 0.0), (SPEED, 0.2)])
def test_a_counters_flanks_are_no_rare_gap_and_what_other_sensors_have_is_one(tiny, channel, counted):
    rows = np.zeros((len(tiny.drives[0]), 7))
    rows[:20, channel] = 30.0  # within the first of five blocks
    entry = Entry((), None, rows.ravel(), rows.ravel())
    pulse_counted = replace(tiny, drives=(replace(tiny.drives[0], lattice=COUNTER),))
    assert gross_share(entry, tiny, tiny) == pytest.approx(0.2, abs=0.05)
    assert gross_share(entry, pulse_counted, pulse_counted) == pytest.approx(counted, abs=0.05)


# --- what is no more than noise


@pytest.fixture(scope="module")
def slight():
    """Logs with a slight gap, and their contest."""
    car = {"accelerometer_bias": {"bias_m_s2": 0.004}}
    drives = [clean(pulses(24.0), v0, effects=car) for v0 in (10.0, 16.0)]
    fit_to, held = (
        gather(MODEL, [noisy(drive, seed + i) for i, drive in enumerate(drives)]) for seed in (1, 5)
    )
    found = fit(Candidate(MODEL, ("accelerometer_bias",)), fit_to, steps=3)
    best = found.candidate.model(found.x)
    entry = Entry(("accelerometer_bias",), found, found.z, held.whitened(held.residuals(best)))
    return fit_to, held, Contest(as_it_is(MODEL, fit_to, held), (entry,))


def leaving(misfit, taken, fit_to, held, contest):
    """The contest if its model as it is had this misfit, and its only effect took this share off the loss."""
    [entry] = contest.singles
    louder = misfit / fitness(contest.null, fit_to, held).misfit
    z_fit, z_hold = louder * contest.null.z_fit, louder * contest.null.z_hold
    left = np.sqrt(1.0 - taken)
    return Contest(
        replace(contest.null, z_fit=z_fit, z_hold=z_hold),
        (replace(entry, z_fit=left * z_fit, z_hold=left * z_hold),),
    )


@pytest.mark.parametrize(
    ("misfit", "taken", "noise"),
    [
        (0.95, 0.10, True),
        (0.95, 0.14, False),
        (1.05, 0.10, False),
        (1.05, 0.02, True),
        (1.35, 0.05, False),
        (1.35, 0.02, True),
        (1.45, 0.0, False),
    ],
)
def test_what_an_effect_may_take_where_noise_is_left_hangs_on_the_misfit(misfit, taken, noise, slight):
    fit_to, held, _ = slight
    assert is_noise(leaving(misfit, taken, *slight), fit_to, held) is noise


def test_an_effect_that_is_next_to_none_may_take_what_it_will(slight):
    fit_to, held, _ = slight
    contest = leaving(0.95, 0.14, *slight)
    [entry] = contest.singles
    candidate = entry.fit.candidate
    none = replace(entry, fit=replace(entry.fit, x=candidate.neutral + 0.01 * candidate.scale))
    assert is_noise(replace(contest, singles=(none,)), fit_to, held)


@pytest.mark.parametrize(
    ("faults", "verdict"),
    [((0, 0, 0), Verdict.NO_GAP), ((0, 1, 0), Verdict.NO_GAP), ((4, 4, 4), Verdict.UNKNOWN)],
    ids=["none", "one", "many"],
)
def test_what_is_rare_but_far_beyond_noise_is_a_gap(faults, verdict):
    """A wheel that reads 0.3 rad/s less for a tenth of a second, now and then: one block of 240 may be chance."""
    nominal, logs = clean(pulses(16.0), 14.0), []
    for seed, count in enumerate(faults):
        measured = nominal.measured.copy()
        for begin in 200 + 400 * np.arange(count):
            measured[begin : begin + 12, WHEEL.start] -= 0.3
        logs.append(noisy(remeasured(nominal, measured), seed))
    few = set(EFFECTS) - {"aero_drag", "wheel_radius_offset"}
    decision = find(MODEL, logs[:2], logs[2], exclude=few).decision
    assert decision.before.misfit < NO_GAP_MISFIT
    assert decision.verdict is verdict
