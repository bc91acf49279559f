"""Noise and loggers of the withheld cases, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from withheld_cars import numbered
from withheld_plant import QUIET

from benchmarks.gap.withheld.generator.loggers import (
    BEFORE_S,
    CHANGES,
    CLOCK_OFF,
    DIGITS,
    FRAME_LOST,
    OVERRUNS,
    REPEATED,
    TICK_S,
    WAKES_S,
    filled_in,
    in_ticks,
    losing_frames,
    losing_runs,
    on_change,
    overrunning,
    own_clock,
    repeating,
    significant_digits,
    triggered,
    waking,
)
from benchmarks.gap.withheld.generator.noise import (
    AXLE_SHARE,
    CHIRP_HZ,
    CHIRP_SHARE,
    NOISES,
    POPS_S,
    POPS_SHARE,
    SHARED,
    SUPPLY_SHARE,
    bounded,
    by_axle,
    chirping,
    mains,
    own_colours,
    popping,
    rough_stretches,
    shaking_together,
    shared_supply,
    skewed,
    stones,
)
from benchmarks.gap.withheld.generator.sensors import Noise

pytestmark = pytest.mark.long

MEASURED = ["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]
WHITE = replace(QUIET, coloured_share=0.0)


@pytest.mark.parametrize("noisy", numbered(NOISES.values()))
def test_noise_of_every_kind_has_its_size_and_little_of_it_is_slow(noisy):
    noise, rate = Noise(0.05, 0.02, 0.1, 0.0, 0.2, 0.01, 0.0, 0.0), 200.0
    clock = np.arange(int(30.0 * rate)) / rate
    values = [noisy(noise, clock, np.random.default_rng(i)) / noise.sigmas for i in range(12)]
    sizes = np.std(values, axis=1)
    assert sizes.mean() == pytest.approx(1.0, rel=0.03)
    assert np.all(np.abs(sizes - 1.0) < 0.2)
    assert np.mean(np.reshape(values, (12, 30, -1, 6)), axis=2).std() < 0.35


def test_kinds_of_noise_are_told_apart():
    clock = np.arange(900) / 100.0
    kinds = {noisy(QUIET, clock, np.random.default_rng(0)).tobytes() for noisy in NOISES.values()}
    assert len(kinds) == len(NOISES)


@pytest.mark.parametrize(
    ("noisy", "pairs", "share"),
    [
        (shared_supply, [(0, 1), (0, 4), (4, 5)], SUPPLY_SHARE),
        (shaking_together, [(0, 1), (0, 3), (2, 3)], SHARED),
        (shaking_together, [(0, 4), (4, 5)], 0.0),
        (by_axle, [(0, 1), (2, 3)], AXLE_SHARE),
        (by_axle, [(0, 2), (1, 2), (4, 0)], 0.0),
    ],
)
def test_noise_that_readings_share_has_its_share(noisy, pairs, share):
    alike = np.corrcoef(noisy(WHITE, np.arange(100_000) * 5e-3, np.random.default_rng(0)).T)
    assert_allclose([alike[pair] for pair in pairs], share, atol=0.02)


def test_noise_has_its_spectrum():
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    hertz = np.fft.rfftfreq(clock.size, 5e-3)
    for noisy, low, high, share in (
        (mains, 49.8, 50.2, 0.2),
        (chirping, CHIRP_HZ[0], CHIRP_HZ[1], CHIRP_SHARE),
    ):
        spectrum = np.abs(np.fft.rfft(noisy(WHITE, clock, rng) / WHITE.sigmas, axis=0)) ** 2
        inside = (hertz > low - 1.0) & (hertz < high + 1.0)
        floor = spectrum[~inside].mean(axis=0) * inside.sum()
        assert_allclose((spectrum[inside].sum(axis=0) - floor) / spectrum.sum(axis=0), share, atol=0.02)


def test_noise_has_its_distribution():
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    level = popping(WHITE, clock, rng) / WHITE.sigmas
    assert_allclose(np.mean(level[20:] * level[:-20], axis=0), POPS_SHARE * np.exp(-0.2 / POPS_S), atol=0.02)
    assert np.abs(bounded(WHITE, clock, rng) / WHITE.sigmas).max() == pytest.approx(np.sqrt(3.0), rel=1e-3)
    assert np.all(np.mean((stones(WHITE, clock, rng) / WHITE.sigmas) ** 4, axis=0) > 3.3)
    sides = np.mean((skewed(WHITE, clock, rng) / WHITE.sigmas) ** 3, axis=0)
    assert_allclose(np.abs(sides), 2.0 / np.sqrt(6.0), rtol=0.1)
    loud = np.abs(rough_stretches(WHITE, clock, rng) / WHITE.sigmas).reshape(-1, 40, 6).mean(axis=1)
    assert np.corrcoef(loud.T).min() > 0.5
    own = own_colours(QUIET, np.arange(60_000) * 1e-3, rng) / QUIET.sigmas
    assert np.ptp(np.mean(own[2:] * own[:-2], axis=0)) > 0.1


@pytest.mark.parametrize("digits", numbered(DIGITS.values()))
def test_loggers_keep_columns_rows_order_and_the_command(digits, log):
    log = log.assign(accel_x_m_s2=0.3 * (log["accel_x_m_s2"] - 20.0))
    kept = digits(log)
    assert list(kept) == list(log)
    assert len(kept) == len(log)
    assert np.diff(kept["time_s"]).min() > 0.0
    assert_allclose(kept["wheel_torque_fl_nm"], log["wheel_torque_fl_nm"], atol=0.26)
    off = (kept - log)[MEASURED].abs().median()
    assert np.all(off < [0.01, 0.006, 0.016]), "no more than half of the best sensor's noise"


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("slow_receiver", ["vehicle_speed_m_s"]),
        ("slow_accelerometer", ["accel_x_m_s2"]),
        ("slow_place", ["position_m"]),
        ("slow_wheels", [f"wheel_speed_{w}_rad_s" for w in ("fl", "fr", "rl", "rr")]),
    ],
)
def test_a_slow_signal_comes_with_every_second_row(name, columns, log):
    told = DIGITS[name](log)
    assert told[columns][::2].equals(log[columns][::2])
    assert told[columns][1::2].isna().all(axis=None)
    assert told.drop(columns=columns).equals(log.drop(columns=columns))


def test_a_repeated_sample_is_the_one_before(log):
    kept = repeating(log)
    for name in MEASURED:
        changed = np.flatnonzero(kept[name].to_numpy() != log[name].to_numpy())
        assert 0.5 * REPEATED < changed.size / len(log) < 2.0 * REPEATED
        assert np.array_equal(kept[name].to_numpy()[changed], kept[name].to_numpy()[changed - 1])


def test_what_is_lost_is_little_and_all_that_a_message_carries(log):
    runs = losing_runs(log).isna()
    assert 20 < runs.to_numpy().sum() < 200
    over = overrunning(log).isna()
    assert over[MEASURED].nunique(axis=1).eq(1).all()
    assert 1 <= (np.diff(over["accel_x_m_s2"].astype(int)) == 1).sum() <= OVERRUNS
    frames = losing_frames(log).isna()
    assert frames["wheel_speed_fl_rad_s"].equals(frames["wheel_speed_rr_rad_s"])
    assert frames[MEASURED].mean().to_numpy() == pytest.approx(FRAME_LOST, rel=0.5)
    asleep = waking(log)[MEASURED].isna().sum() / 250.0
    assert np.all((asleep >= WAKES_S[0] - 0.01) & (asleep <= WAKES_S[1]))


def test_what_was_lost_is_a_straight_line(log):
    lost = log.copy()
    lost.loc[[500, 501], "vehicle_speed_m_s"] = np.nan
    told, speed = filled_in(lost)["vehicle_speed_m_s"], log["vehicle_speed_m_s"]
    line = speed[499] + (speed[502] - speed[499]) * np.array([1.0, 2.0]) / 3.0
    assert_allclose(told.iloc[500:502], line, rtol=1e-9)


def test_a_value_stands_until_it_has_changed(log):
    slow = log.assign(accel_x_m_s2=np.cumsum(0.01 * np.random.default_rng(0).normal(size=len(log))))
    told = on_change(slow)["accel_x_m_s2"]
    assert (told - slow["accel_x_m_s2"]).abs().max() < CHANGES["accel"]
    moved = told.diff().iloc[1:]
    assert np.all((moved == 0.0) | (moved.abs() >= CHANGES["accel"]))


def test_values_have_so_many_figures(log):
    told = significant_digits(
        log.assign(vehicle_speed_m_s=[0.0, np.nan, 12.3456, -0.98768, 9.99996, 123.45] * 1000)
    )
    assert_allclose(told["vehicle_speed_m_s"].to_numpy()[:6], [0.0, np.nan, 12.35, -0.9877, 10.0, 123.4])


def test_clocks_have_ticks_a_trigger_and_a_rate_of_their_own(log):
    uneven = log.assign(time_s=np.arange(1, 6001) / 700.0)
    ticks = in_ticks(uneven)["time_s"] / TICK_S
    assert_allclose(ticks, np.round(ticks), atol=1e-6)
    before = (log["time_s"] - triggered(log)["time_s"]).to_numpy()
    assert BEFORE_S[0] <= before[0] <= BEFORE_S[1]
    assert_allclose(before, before[0], atol=1e-6)
    rate = (own_clock(log)["time_s"] / log["time_s"]).to_numpy()
    assert 1e-6 < abs(rate[-1] - 1.0) <= CLOCK_OFF
    assert_allclose(rate[100:], rate[-1], atol=1e-6)
