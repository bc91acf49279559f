"""Sensors that drift over seconds: how much is read off the log, what is allowed for it, and what is not drift."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, SIGMA, STEP_S, clean, noisy, pulses, remeasured

from scenarios.effects import EFFECTS
from sim2real.diagnose import find
from sim2real.hypotheses.contest import Entry
from sim2real.hypotheses.goodness import fitness
from sim2real.hypotheses.no_gap import NO_GAP_MISFIT
from sim2real.observing.drift import DRIFT_S, block_sums, read_drift, with_drift
from sim2real.observing.drive import BLOCK_S, CHANNELS, WHEEL
from sim2real.observing.evidence import Evidence, drift_of, gather
from sim2real.observing.noise import Noise
from sim2real.result import Verdict

DURATION_S = 30.0
SHARE = 0.4
"""Drift of the tests' sensors, in standard deviations of their noise."""


def coloured(n, seed, time_constant_s=DRIFT_S[-1]):
    """First-order coloured noise of unit variance, by its own recursion, shape (n, 7)."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-STEP_S / time_constant_s)
    out = np.zeros((n, len(CHANNELS)))
    out[0] = rng.standard_normal(len(CHANNELS))
    for k in range(1, n):
        out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal(len(CHANNELS))
    return out


def drifting(drive, share, seed):
    """White noise, and drift on top."""
    off = SIGMA * share * coloured(len(drive), seed + 1000)
    return noisy(remeasured(drive, drive.measured + off), seed)


@pytest.fixture(scope="module")
def nominal():
    return clean(pulses(DURATION_S), 12.0)


def logs_of(nominal, share, count=4):
    return [drifting(nominal, share, seed) for seed in range(count)]


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_the_drift_of_the_sensors_is_read_off_left_and_right(nominal, share):
    # Thirty seconds hold ten correlation times, four logs forty: a variance within a third, twice over.
    found = drift_of(MODEL, gather(MODEL, logs_of(nominal, share)))
    assert np.linalg.norm(found) == pytest.approx(share, rel=0.3)


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_white_and_coloured_noise_is_no_drift(nominal, correlation):
    ones = np.ones(len(CHANNELS))
    noise = Noise(SIGMA, correlation * ones, np.ones((len(nominal), len(CHANNELS))))
    rows = [noise.draw(len(nominal), np.random.default_rng(seed)) for seed in range(3)]
    assert np.linalg.norm(read_drift([nominal] * 3, [noise] * 3, rows)) < 0.15


def test_short_and_long_memories_of_a_drift_are_told_apart(nominal):
    noise = Noise(SIGMA, np.zeros(len(CHANNELS)), np.ones((len(nominal), len(CHANNELS))))
    for at, tau in ((0, DRIFT_S[0]), (2, DRIFT_S[2])):
        rows = [
            SIGMA
            * (
                np.random.default_rng(k).standard_normal((len(nominal), len(CHANNELS)))
                + 0.5 * coloured(len(nominal), k, tau)
            )
            for k in range(4)
        ]
        found = read_drift([nominal] * 4, [noise] * 4, rows)
        assert np.argmax(found) == at
        assert np.linalg.norm(found) == pytest.approx(0.5, rel=0.35)


def test_what_both_sides_share_and_what_one_wheel_alone_has_is_no_drift(nominal):
    noise = Noise(SIGMA, np.zeros(len(CHANNELS)), np.ones((len(nominal), len(CHANNELS))))
    white = SIGMA * np.random.default_rng(1).standard_normal((len(nominal), len(CHANNELS)))
    wave = np.sin(0.7 * nominal.time_s)
    both, one = white.copy(), white.copy()
    both[:, WHEEL] += 5.0 * wave[:, None]
    one[:, 2] += 5.0 * wave
    assert np.linalg.norm(read_drift([nominal], [noise], [both])) < 0.15
    assert np.linalg.norm(read_drift([nominal], [noise], [one])) < 0.15


def test_a_car_whose_left_wheels_alone_are_measured_shows_no_drift(nominal):
    noise = Noise(SIGMA, np.zeros(len(CHANNELS)), np.ones((len(nominal), len(CHANNELS))))
    rows = SIGMA * np.random.default_rng(1).standard_normal((len(nominal), len(CHANNELS)))
    rows[:, [3, 5]] = np.nan
    assert not read_drift([nominal], [noise], [rows]).any()


def test_what_is_allowed_is_what_a_right_model_leaves_of_a_drifting_log(nominal):
    seen = gather(MODEL, logs_of(nominal, SHARE, count=6))
    known = Noise(SIGMA, np.zeros(len(CHANNELS)), np.ones((len(nominal), len(CHANNELS))))
    allowed = 1.0 + with_drift(MODEL, nominal, known, np.array([0.0, 0.0, SHARE])).slow
    left = [known.whitened(r) for r in seen.residuals(MODEL)]
    found = np.mean(
        [np.mean(block_sums(np.nan_to_num(z), nominal.rows_in(BLOCK_S)) ** 2, axis=0) for z in left], 0
    )
    assert np.all(allowed > 1.2)
    np.testing.assert_allclose(
        found, allowed, rtol=0.5
    )  # a drift's variance over six logs of ten memories each


def test_without_drift_nothing_is_added(nominal):
    noise = gather(MODEL, [nominal]).noises[0]
    assert np.all(with_drift(MODEL, nominal, noise, np.zeros(3)).slow == 0.0)
    assert np.all(with_drift(MODEL, nominal, noise, np.array([0.0, 0.0, 0.3])).slow > 0.0)


@pytest.mark.long
def test_a_drifting_log_of_the_right_model_has_no_gap_and_a_gap_is_still_found(nominal):
    few = set(EFFECTS) - {"mass_offset", "road_grade", "accelerometer_bias", "aero_drag"}
    logs = [drifting(nominal, SHARE, seed) for seed in (11, 12)]
    found = find(MODEL, logs[:1], logs[1], exclude=few)
    assert found.decision.verdict is Verdict.NO_GAP
    blind = [without_drift(e) for e in (found.fit_to, found.holdout)]
    null = found.contest.null
    assert fitness(Entry((), None, null.z_fit, null.z_hold), *blind).misfit > NO_GAP_MISFIT

    heavy = clean(pulses(DURATION_S), 12.0, effects={"mass_offset": {"mass_kg": 150.0}})
    logs = [drifting(heavy, SHARE, seed) for seed in (13, 14)]
    found = find(MODEL, logs[:1], logs[1], exclude=few)
    assert found.decision.verdict is Verdict.IDENTIFIED
    assert found.decision.winner.ids == ("mass_offset",)
    assert found.decision.winner.fitted.x[0] == pytest.approx(150.0, rel=0.1)


def without_drift(evidence):
    """The same evidence as if sensors never drifted."""
    noises = tuple(replace(n, slow=np.zeros(len(CHANNELS))) for n in evidence.noises)
    return Evidence(evidence.drives, noises)
