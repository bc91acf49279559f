"""How well an entry does, and what that makes of one effect or two: on made-up residuals."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, STEP_S, clean, noisy, pulses

from sim2real.observing.drive import SPEED, WHEEL
from sim2real.observing.evidence import gather
from sim2real.observing.lattice import Lattice
from sim2real.which.contest import Contest, Entry
from sim2real.which.fitting import ROBUST_FROM, Candidate, fit
from sim2real.which.goodness import fitness, gross_share, inflation
from sim2real.which.selection import (
    probabilities,
)

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
