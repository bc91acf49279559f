"""The sensors' noise as it is read off residuals, and the doubt about what no model can foretell."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, SIGMA, STEP_S, clean, noisy, rms, road_of, trace

from scenarios.effects.friction_offset import FrictionOffset
from sim2real.observing.doubt import FRICTION, doubt
from sim2real.observing.drive import ACCEL, CHANNELS, POSITION, SPEED, WHEEL
from sim2real.observing.evidence import residuals
from sim2real.observing.noise import FEWEST, RESOLUTION, Noise, read_noise

ROWS = 2500
NO_DOUBT = np.zeros((ROWS, len(CHANNELS)))


@pytest.fixture(scope="module")
def drive():
    """Any drive that moves all the time."""
    return clean(trace((0, 0), duration_s=(ROWS - 1) * STEP_S), 15.0)


def noise_of(sigma, correlation):
    ones = np.ones(len(CHANNELS))
    return Noise(sigma * ones, correlation * ones, np.ones((ROWS, len(CHANNELS))))


def slow_gap():
    """Ten times the noise, over seconds, and a step."""
    time_s = np.arange(ROWS) * STEP_S
    return (2.0 * np.sin(2.0 * np.pi * 0.3 * time_s) + 1.0 * (time_s > 9.0))[:, None]


# --- reading


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6, 0.8])
def test_noise_is_read_off_residuals_with_a_slow_gap_on_top(drive, correlation, gap):
    true = noise_of(0.2, correlation)
    rest = true.draw(ROWS, np.random.default_rng(4)) + gap * slow_gap()
    read = read_noise(drive, rest, NO_DOUBT)
    # 0.8 forgets itself over the long lag only to a third: sigma and correlation are told apart less well
    loose = 0.25 if correlation > 0.7 else 0.1
    np.testing.assert_allclose(read.sigma, 0.2, rtol=loose)
    np.testing.assert_allclose(read.correlation, correlation, atol=0.1)


def test_the_noise_of_a_drive_is_its_sensors(drive):
    made = noisy(drive)
    rest = residuals(MODEL, made)
    read = read_noise(made, rest, NO_DOUBT)
    np.testing.assert_allclose(read.sigma, SIGMA, rtol=0.12)
    assert read.correlation.max() < 0.1


def test_a_signal_without_noise_is_credited_with_its_resolution(drive):
    read = read_noise(drive, np.zeros((ROWS, 7)), NO_DOUBT)
    np.testing.assert_array_equal(read.sigma, RESOLUTION)
    np.testing.assert_array_equal(read.correlation, 0.0)


def test_lost_samples_do_not_change_the_noise(drive):
    generator = np.random.default_rng(7)
    rest = noise_of(0.2, 0.0).draw(ROWS, generator)
    rest[generator.uniform(size=rest.shape) < 0.3] = np.nan
    np.testing.assert_allclose(read_noise(drive, rest, NO_DOUBT).sigma, 0.2, rtol=0.15)


def test_too_few_samples_tell_no_noise(drive):
    rest = np.full((ROWS, 7), np.nan)
    rest[: FEWEST // 2] = np.random.default_rng(0).standard_normal((FEWEST // 2, 7))
    np.testing.assert_array_equal(read_noise(drive, rest, NO_DOUBT).sigma, RESOLUTION)


def test_a_standing_car_tells_no_noise(drive):
    rest = noise_of(0.2, 0.0).draw(ROWS, np.random.default_rng(7))
    rest[ROWS // 2 :] *= 10.0
    moving = np.arange(ROWS) < ROWS // 2
    np.testing.assert_allclose(read_noise(replace(drive, moving=moving), rest, NO_DOUBT).sigma, 0.2, rtol=0.1)


# --- using it


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.85])
def test_whitening_undoes_the_drawing(correlation):
    noise = noise_of(0.3, correlation)
    drawn = noise.draw(ROWS, np.random.default_rng(11))
    np.testing.assert_allclose(rms(noise.scaled(drawn)), 1.0, atol=0.15)
    white = noise.whitened(drawn)
    np.testing.assert_allclose(rms(white), 1.0, atol=0.05)
    again = np.mean(white[1:] * white[:-1], axis=0)
    assert np.abs(again).max() < 0.08


def test_whitening_starts_anew_after_a_lost_sample():
    noise = noise_of(0.5, 0.6)
    rest = noise.draw(ROWS, np.random.default_rng(3))
    rest[100:103] = np.nan
    white = noise.whitened(rest)
    assert np.isnan(white[100:103]).all()
    np.testing.assert_array_equal(white[103], rest[103] / 0.5)
    np.testing.assert_allclose(white[104], (rest[104] - 0.6 * rest[103]) / 0.5 / 0.8)


def test_doubt_widens_what_a_residual_is_held_against():
    rest = np.ones((ROWS, 7))
    size = np.zeros((ROWS, 7))
    size[50] = 0.4
    wide = Noise(np.full(7, 0.3), np.zeros(7), np.sqrt(1.0 + (size / 0.3) ** 2))
    assert wide.scaled(rest)[49, 0] == pytest.approx(1.0 / 0.3)
    assert wide.scaled(rest)[50, 0] == pytest.approx(1.0 / 0.5)
    assert wide.whitened(rest)[50, 0] == pytest.approx(1.0 / 0.5)


def test_read_noise_takes_the_doubt_in(drive):
    size = np.zeros((ROWS, 7))
    size[200, SPEED] = 3.0
    rest = noise_of(0.3, 0.0).draw(ROWS, np.random.default_rng(2))
    read = read_noise(drive, rest, size)
    assert read.widening[200, SPEED] == pytest.approx(np.hypot(1.0, 3.0 / read.sigma[SPEED]))
    assert (np.delete(read.widening[:, SPEED], 200) == 1.0).all()


# --- doubt

ICE = road_of(0.9, 0.25, length_m=60.0)


@pytest.fixture(scope="module")
def locking():
    """Cruising on dry road, then a brake that locks the wheels on ice."""
    return clean(trace((0, 20), (4.9, 20), (5.1, -300), (7, -300), duration_s=7.0), 16.0, ICE)


def test_a_cruise_is_not_doubted(locking):
    calm = (locking.time_s > 1.0) & (locking.time_s < 3.0)
    size = doubt(MODEL, locking)[calm] / SIGMA
    assert size[:, SPEED:].max() < 0.3


def test_a_locking_wheel_is_doubted(locking):
    seen = MODEL.predict(locking)
    locked = (seen.slip[:, 0] > 0.1) & (seen.slip[:, 0] < 0.9)
    assert locked.sum() > 3
    size = doubt(MODEL, locking) / SIGMA
    assert size[locked, WHEEL].max() > 1.0
    assert size[locked, WHEEL].max() > 20.0 * size[locking.time_s < 3.0, WHEEL].max()


def test_a_border_under_torque_is_doubted_in_the_wheels():
    """On the border of dry and ice a brake that ice cannot take meets other friction at another place."""
    drive = clean(trace((0, -245), duration_s=5.0), 18.0, ICE)
    seen = MODEL.predict(drive)
    at = int(np.flatnonzero(np.diff(seen.theta[:, 0]))[0])
    size = doubt(MODEL, drive)
    assert size[at - 3 : at + 8, WHEEL].max() > 5.0 * size[at - 60 : at - 20, WHEEL].max()


def test_doubt_is_never_about_the_place_itself(locking):
    size = doubt(MODEL, locking)
    assert (size >= 0.0).all()
    # a clock that is off by a millisecond moves a car at 16 m/s by 16 mm, and friction hardly anything
    assert size[: round(4.0 / STEP_S), POSITION].max() < 0.02


def test_doubt_is_about_the_friction_that_the_model_has():
    """A model that knows of less friction doubts where it locks, one that knows of more does not lock."""
    drive = clean(trace((0, 0), (1, 0), (1.2, -420), (3, -420), duration_s=3.0), 16.0, road_of(0.6))
    braking = drive.time_s > 1.5
    slippery = doubt(MODEL.with_effects(FrictionOffset(0.6)), drive)[braking]
    sticky = doubt(MODEL.with_effects(FrictionOffset(2.0)), drive)[braking]
    assert slippery[:, WHEEL].max() > 5.0 * sticky[:, WHEEL].max()


def test_a_right_model_is_not_blamed_for_friction_that_is_hardly_off(locking):
    """What the doubt is for: without it two thousandths of friction at a locking wheel were a gap of many sigmas."""
    fine = SIGMA / 5.0
    off = noisy(clean(locking.torque_nm, 16.0, ICE, {"friction_offset": {"factor": 1.0 - FRICTION}}), 5, fine)
    rest = residuals(MODEL, off)
    read = read_noise(off, rest, doubt(MODEL, off))
    assert np.nanmax(np.abs(rest[:, WHEEL] / fine[WHEEL])) > 6.0
    assert rms(read.scaled(rest)[:, WHEEL], axis=None) < 1.15
    assert rms(read.scaled(rest)[:, ACCEL], axis=None) < 1.15
