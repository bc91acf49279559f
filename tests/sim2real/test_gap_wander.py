"""A ground speed or an accelerometer that wanders by itself is noise; what goes with the car's motion is a gap."""

import numpy as np
import pytest
from gap_drives import MODEL, SIGMA, STEP_S, clean, noisy, pulses, remeasured, road_of, trace
from long import beyond

from scenarios.effects import EFFECTS
from sim2real.diagnose import find
from sim2real.observing.drive import ACCEL, SPEED, WHEEL
from sim2real.observing.noise import Noise
from sim2real.result import Verdict
from sim2real.telling.findings import describe
from sim2real.which.closure import floors
from sim2real.which.contest import silent
from sim2real.which.goodness import fitness
from sim2real.which.selection import explains

ROAD = road_of(0.9, 0.6, 0.9, 0.6)
OTHERS = set(EFFECTS) - {
    "vehicle_speed_scale",
    "vehicle_speed_delay",
    "accelerometer_bias",
    "mass_offset",
    "aero_drag",
}


def slow(drive, tau_s, seed):
    """What forgets within `tau_s`, of unit variance, shape (n, 7)."""
    noise = Noise(np.ones(7), np.full(7, np.exp(-STEP_S / tau_s)), np.ones((1, 7)))
    return noise.draw(len(drive), np.random.default_rng(seed))


def wandering(drive, channel, share, tau_s, seed):
    """The drive with a sensor that wanders by a share of its noise, in standard deviations."""
    measured = drive.measured.copy()
    measured[:, channel] += share * SIGMA[channel] * slow(drive, tau_s, 100 + seed)[:, channel]
    return remeasured(drive, measured)


def drifting(drive, sigma, share, tau_s, seed):
    """The drive with all sensors drifting by a share of their noise."""
    return remeasured(drive, drive.measured + share * sigma * slow(drive, tau_s, 500 + seed))


def humming(drive, share, pitch_hz, seed):
    """The drive with a hum in each wheel's sensor, of so many times its noise and a phase of its own."""
    phases = np.random.default_rng(700 + seed).uniform(0.0, 2.0 * np.pi, 4)
    measured = drive.measured.copy()
    hums = np.sin(2.0 * np.pi * pitch_hz * drive.time_s[:, None] + phases)
    measured[:, WHEEL] += share * SIGMA[WHEEL] * hums
    return remeasured(drive, measured)


def gentle(duration_s, rng):
    """A little torque now and then, shape (n, 4) [N m]."""
    points, time_s = [(0.0, 0.0)], 0.0
    while time_s < duration_s:
        on = time_s + rng.uniform(1.0, 4.0)
        time_s = on + rng.uniform(1.5, 3.0)
        torque = rng.uniform(5.0, 18.0)
        points += [(on, 0.0), (on + 0.1, torque), (time_s, torque), (time_s + 0.1, 0.0)]
    return trace(*points, duration_s=duration_s)


def logs(change):
    drives = [clean(pulses(20.0), v0, ROAD) for v0 in (9.0, 13.0)]
    return [change(noisy(drive, seed), seed) for seed, drive in enumerate(drives)]


@pytest.mark.parametrize(
    ("channel", "name", "tau_s"),
    beyond(1, [(SPEED, "vehicle_speed", 0.8), (SPEED, "vehicle_speed", 0.5), (ACCEL, "accel_x", 0.5)]),
)
def test_a_sensor_that_wanders_within_its_noise_is_no_gap(channel, name, tau_s):
    fit, holdout = logs(lambda drive, seed: wandering(drive, channel, 0.7, tau_s, seed))
    found = find(MODEL, [fit], holdout, exclude=OTHERS)
    shown = fitness(found.contest.null, found.fit_to, found.holdout).misfit
    assert shown > 1.6, "the blocks have to show it"
    assert found.decision.verdict is Verdict.NO_GAP
    assert name in found.decision.wandering
    assert "as sensors do by themselves" in describe(found, seed=0, jobs=1, progress=silent).sentence


def test_what_an_effect_takes_off_a_hum_is_not_held_against_a_wandering_speed():
    """A relaxation length filters the wheels' hum, and takes an eighth off the loss with it: off noise."""
    drives = [clean(pulses(20.0), v0, ROAD) for v0 in (5.0, 8.0)]
    fit, holdout = (
        wandering(humming(noisy(drive, 10 + i), 2.5, 16.0, 10 + i), SPEED, 0.9, 0.5, 10 + i)
        for i, drive in enumerate(drives)
    )
    found = find(MODEL, [fit], holdout, exclude=set(EFFECTS) - {"tyre_relaxation"})
    null, (relaxation,) = found.contest.null, found.contest.singles
    assert relaxation.loss < 0.95 * null.loss
    assert found.decision.verdict is Verdict.NO_GAP
    assert "vehicle_speed" in found.decision.wandering


def test_no_gap_where_an_effect_leaves_open_what_drifting_sensors_do():
    """Sensors that drift beside precise wheels move all wheels alike, and the wheels' inertia filters some of it."""
    sigma = np.array([0.0265, 0.03, 0.0185, 0.0185, 0.0185, 0.0185, 0.0255])
    rng = np.random.default_rng(8)
    drives = [clean(gentle(30.0, rng), v0) for v0 in (15.0, 12.0)]
    fit, holdout = (
        drifting(noisy(drive, i, sigma), sigma, 0.28, 3.0, i) for i, drive in enumerate(drives, 80)
    )
    found = find(MODEL, [fit], holdout, exclude=set(EFFECTS) - {"wheel_inertia_offset", "mass_offset"})
    inertia = found.contest.singles[0]
    assert inertia.loss < 0.95 * found.contest.null.loss, "an effect has to seem worth blaming"
    assert found.decision.verdict is Verdict.NO_GAP
    assert found.decision.wandering


@pytest.mark.long
def test_rows_of_precise_wheels_may_show_all_that_a_wandering_speed_does():
    precise = SIGMA * np.array([1.0, 1.0, 0.4, 0.4, 0.4, 0.4, 1.0])
    drives = [clean(pulses(20.0), v0, ROAD) for v0 in (9.0, 13.0)]
    fit, holdout = (
        wandering(noisy(drive, seed, precise), SPEED, 1.3, 0.5, seed) for seed, drive in enumerate(drives)
    )
    found = find(MODEL, [fit], holdout, exclude=OTHERS)
    assert floors(MODEL, MODEL, found.fit_to) > 1.5, "more than any fixed limit would let pass"
    assert found.decision.verdict is Verdict.NO_GAP


@pytest.mark.long
def test_an_effect_is_found_though_the_speed_wanders_beside_it():
    """What wanders leaves more in the blocks than any effect may, and most of the gap's misfit."""
    off = {"tyre_relaxation": {"length_m": 0.7}}
    drives = [clean(pulses(20.0), v0, ROAD, effects=off) for v0 in (4.0, 6.0)]
    fit, holdout = (wandering(noisy(drive, seed), SPEED, 1.4, 0.4, seed) for seed, drive in enumerate(drives))
    kept = {
        "tyre_relaxation",
        "torque_lag",
        "vehicle_speed_scale",
        "wheel_inertia_offset",
        "accelerometer_bias",
    }
    found = find(MODEL, [fit], holdout, exclude=set(EFFECTS) - kept)
    seen, left = (
        fitness(e, found.fit_to, found.holdout) for e in (found.contest.null, found.contest.singles[0])
    )
    assert not explains(left, seen)
    assert found.decision.verdict is Verdict.IDENTIFIED
    assert found.decision.winner.ids == ("tyre_relaxation",)
    assert found.decision.wandering == ("vehicle_speed",)
    assert found.added()[0].length_m == pytest.approx(0.7, rel=0.1)


def test_one_that_wanders_by_more_than_its_noise_is_a_gap():
    fit, holdout = logs(lambda drive, seed: wandering(drive, SPEED, 3.0, 0.5, seed))
    assert find(MODEL, [fit], holdout, exclude=OTHERS).decision.verdict is Verdict.UNKNOWN


def test_a_small_error_that_goes_with_the_motion_is_no_wandering():
    """The speed is off by what the car does, by as much as such a wandering: an effect or a term may say so."""

    def off(drive, seed):
        measured = drive.measured.copy()
        measured[:, SPEED] *= 1.0 + 3e-3
        return remeasured(drive, measured)

    fit, holdout = logs(off)
    found = find(MODEL, [fit], holdout, exclude=OTHERS)
    assert found.decision.verdict is not Verdict.NO_GAP
    assert not found.decision.wandering
