"""Foreign tyres, noise and loggers, each held to its known limit by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from withheld_cars import (
    DRY,
    WET,
    numbered,
)
from withheld_plant import CAR, QUIET, LimitDrive, roll

from benchmarks.gap.withheld.baselines import _on_grid
from benchmarks.gap.withheld.generator import details, kernel
from benchmarks.gap.withheld.generator.car import Road
from benchmarks.gap.withheld.generator.forms import form_of
from benchmarks.gap.withheld.generator.kernel import N, X
from benchmarks.gap.withheld.generator.loggers import (
    BEFORE_S,
    BITS,
    CHANGES,
    CLOCK_OFF,
    CLOCK_S,
    DIGITS,
    FRAME_LOST,
    OVERRUNS,
    RANGES,
    REPEATED,
    TICK_S,
    WAKES_S,
    by_the_clock,
    converted_in_bits,
    filled_in,
    in_ticks,
    in_turns,
    losing_frames,
    losing_runs,
    on_change,
    overrunning,
    own_clock,
    repeating,
    significant_digits,
    slow_accelerometer,
    slow_place,
    slow_receiver,
    slow_wheels,
    triggered,
    truncating,
    waking,
)
from benchmarks.gap.withheld.generator.noise import (
    AXLE_SHARE,
    BOX_SHARE,
    CHIRP_HZ,
    CHIRP_SHARE,
    DIFFERENCED,
    KEPT_SHARE,
    LOOSER,
    NOISES,
    POPS_S,
    POPS_SHARE,
    SHARED,
    SUPPLY_SHARE,
    YAW_SHARE,
    beating_tones,
    bounded,
    by_axle,
    chirping,
    differenced,
    mains,
    meaned,
    multiplexed,
    one_box,
    own_colours,
    popping,
    resampled,
    rough_stretches,
    shaking_together,
    shared_supply,
    skewed,
    spiking,
    standing,
    stones,
    working_loose,
    yawing,
)
from benchmarks.gap.withheld.generator.outside import OUTSIDE
from benchmarks.gap.withheld.generator.sensors import Noise
from benchmarks.gap.withheld.generator.tyre import (
    COMPOSITE_AT,
    COMPOSITE_TOP,
    arctangent,
    blended,
    bristles,
    brush_elliptic,
    brush_falling,
    brush_uniform,
    composite,
    cubed,
    humped,
    plain_dugoff,
    sine_rise,
    splined,
    two_lines,
)
from benchmarks.gap.withheld.generator.world import nominal

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def steady_log():
    rng = np.random.default_rng(3)
    columns = [
        "time_s",
        "wheel_torque_fl_nm",
        "wheel_speed_fl_rad_s",
        "vehicle_speed_m_s",
        "accel_x_m_s2",
        "position_m",
    ]
    made = pd.DataFrame(rng.normal(size=(20_000, 6)), columns=columns)
    made.loc[7, "vehicle_speed_m_s"] = np.nan
    return made


@pytest.fixture(scope="module")
def quiet_log():
    rng = np.random.default_rng(3)
    columns = [
        "wheel_torque_fl_nm",
        "wheel_speed_fl_rad_s",
        "vehicle_speed_m_s",
        "accel_x_m_s2",
        "position_m",
    ]
    made = pd.DataFrame(rng.normal(size=(6000, 5)), columns=columns)
    made.insert(0, "time_s", np.arange(6000) * 5e-3)
    return made


@pytest.fixture(scope="module")
def walking_log():
    rng = np.random.default_rng(3)
    columns = ["wheel_torque_fl_nm", "wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]
    made = pd.DataFrame(np.cumsum(0.01 * rng.normal(size=(3000, 4)), axis=0), columns=columns)
    made.insert(0, "time_s", np.arange(3000) * 5e-3)
    made["position_m"] = 5.0 * made["time_s"]
    made.loc[[5, 900], "accel_x_m_s2"] = np.nan
    return made


@pytest.fixture(scope="module")
def uneven_log():
    rng = np.random.default_rng(3)
    columns = ["wheel_torque_fl_nm", "wheel_speed_fl_rad_s", "wheel_speed_rr_rad_s", "vehicle_speed_m_s"]
    made = pd.DataFrame(rng.normal(20.0, 9.0, (6000, 4)), columns=columns)
    made.insert(0, "time_s", np.arange(1, 6001) / 700.0)
    made["accel_x_m_s2"], made["position_m"] = rng.normal(0.0, 3.0, 6000), 15.0 * made["time_s"]
    return made


@pytest.mark.parametrize("noisy", numbered(noise for since, noise in NOISES.values() if since in (3, 4)))
@pytest.mark.parametrize("rate", [100.0, 1200.0])
def test_noise_has_its_size_in_a_log_and_little_of_it_is_slow(noisy, rate):
    noise, rows = Noise(0.05, 0.02, 0.1, 0.0, 0.2, 0.01, 0.0, 0.0), int(30.0 * rate)
    values = [
        noisy(noise, np.arange(rows) / rate, np.random.default_rng(i)) / noise.sigmas for i in range(12)
    ]
    sizes = np.std(values, axis=1)
    assert sizes.mean() == pytest.approx(1.0, rel=0.03)
    assert np.all(np.abs(sizes - 1.0) < 0.15)
    seconds = np.mean(np.reshape(values, (12, 30, -1, 6)), axis=2)
    assert seconds.std() < 0.35


@pytest.mark.parametrize("digits", numbered(digits for since, digits in DIGITS.values() if since in (3, 4)))
def test_loggers_leave_clock_command_and_places(digits, steady_log):
    kept = digits(steady_log)
    assert list(kept) == list(steady_log)
    assert len(kept) == len(steady_log)
    assert kept["time_s"].equals(steady_log["time_s"])
    assert_allclose(kept["wheel_torque_fl_nm"], steady_log["wheel_torque_fl_nm"], atol=0.051)
    assert_allclose(kept["position_m"], steady_log["position_m"], atol=0.0051)


def test_a_repeated_sample_is_the_one_before(steady_log):
    kept = repeating(steady_log)
    for name in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"):
        changed = np.flatnonzero(kept[name].to_numpy() != steady_log[name].to_numpy())
        assert 0.5 * REPEATED < changed.size / len(steady_log) < 2.0 * REPEATED
        assert np.array_equal(kept[name].to_numpy()[changed], kept[name].to_numpy()[changed - 1])
    assert not kept.isna().any().any()


def test_lost_runs_are_few_and_the_rest_is_kept(steady_log):
    kept = losing_runs(steady_log)
    lost = kept.isna() & steady_log.notna()
    assert 20 < lost.to_numpy().sum() < 200
    assert kept[~lost].equals(steady_log[~lost])
    ends = lost.to_numpy().astype(int)
    assert (np.diff(ends, axis=0) == 1).sum() <= 12


def test_messages_wait_evenly():
    waits = np.array([details.wait_of(float(cycle)) for cycle in range(3000)])
    assert abs(waits.mean()) < 0.02
    assert waits.std() == pytest.approx(1.0 / np.sqrt(12.0), rel=0.03)
    assert np.abs(np.corrcoef(waits[1:], waits[:-1])[0, 1]) < 0.05


def test_brushes_at_the_locked_wheel():
    assert brush_uniform(1.0, 60_000.0, 3000.0) == pytest.approx(3000.0)
    assert brush_uniform(0.05, 60_000.0, 3000.0) == pytest.approx(0.75 * 3000.0)
    forces = [brush_falling(s, 60_000.0, 3000.0, 0.8) for s in np.linspace(0.0, 1.0, 5001)]
    assert max(forces) == pytest.approx(3000.0, rel=1e-5)
    held = 2.0 * 0.2 / 1.4
    whole = 3.0 * (1.0 - held) * held**2 + 0.8 * (1.0 - 3.0 * held**2 + 2.0 * held**3)
    assert forces[-1] == pytest.approx(0.8 / whole * 3000.0)


def test_noise_has_its_spectrum():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    fast = differenced(white, clock, rng) / white.sigmas
    assert_allclose(np.mean(fast[1:] * fast[:-1], axis=0), -0.5 * DIFFERENCED, atol=0.02)
    alike = np.corrcoef(shaking_together(white, clock, rng).T)
    assert_allclose(alike[:4, :4][~np.eye(4, dtype=bool)], SHARED, atol=0.02)
    assert_allclose(alike[4:, :4], 0.0, atol=0.02)
    outliers = np.abs(spiking(white, clock, rng) / white.sigmas) > 4.5
    assert 0.001 < outliers.mean() < 0.003


def test_steps_are_dropped_downwards_by_little(quiet_log):
    off = (quiet_log - truncating(quiet_log))[["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]]
    assert off.to_numpy().min() >= 0.0
    assert np.all(off.mean() < 0.21 * QUIET.sigmas[3:])


def test_overruns_lose_what_is_measured_at_once(quiet_log):
    lost = overrunning(quiet_log).isna()
    measured = ["wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"]
    assert not lost.drop(columns=measured).to_numpy().any()
    assert lost[measured].nunique(axis=1).eq(1).all()
    assert 1 <= (np.diff(lost["accel_x_m_s2"].astype(int)) == 1).sum() <= OVERRUNS
    assert lost["accel_x_m_s2"].mean() < 0.02


def test_tyres_at_known_points():
    x = 0.05 * 60_000.0 / 3000.0
    expected = 3000.0 * (1.0 - np.exp(-(x + 0.2 * x**2 + (0.04 + 1.0 / 12.0) * x**3)))
    assert cubed(0.05, 60_000.0, 3000.0, 0.2) == pytest.approx(expected)
    p = form_of("foreign_tyre", "hyperbolic_tangent").apply(nominal(CAR, Road()), share=1.0).physics
    load = CAR.mass_kg * 9.81 / 4.0
    whole = kernel.tyre_force(p, 1.0, 0.0, 0.9, load, 0.0)
    slip = whole / (1.27 * CAR.stiffness_n)
    assert kernel.tyre_force(p, slip, 0.0, 0.9, load, 0.0) == pytest.approx(np.tanh(1.0) * whole, rel=1e-6)


def test_noise_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    spectrum = np.abs(np.fft.rfft(mains(white, clock, rng)[:, 3] / white.sigmas[3])) ** 2
    hertz = np.fft.rfftfreq(clock.size, 5e-3)
    near = spectrum[np.abs(hertz - 50.0) < 0.2].sum() / spectrum.sum()
    assert near == pytest.approx(0.2, abs=0.02)
    level = popping(white, clock, rng) / white.sigmas
    assert_allclose(np.mean(level[20:] * level[:-20], axis=0), POPS_SHARE * np.exp(-0.2 / POPS_S), atol=0.02)
    alike = np.corrcoef(shared_supply(white, clock, rng).T)
    assert_allclose(alike[~np.eye(6, dtype=bool)], SUPPLY_SHARE, atol=0.02)
    assert np.abs(bounded(white, clock, rng) / white.sigmas).max() == pytest.approx(np.sqrt(3.0), rel=1e-3)
    hits = stones(white, clock, rng) / white.sigmas
    loud = np.corrcoef((hits**2).T)
    assert np.all(loud[~np.eye(6, dtype=bool)] > 0.02)
    assert np.all(np.mean(hits**4, axis=0) > 3.3)


def test_a_converter_has_whole_steps(walking_log):
    told = converted_in_bits(walking_log)
    steps = told["wheel_speed_fl_rad_s"] / (RANGES["wheel_speed"] / 2**BITS)
    assert_allclose(steps, np.round(steps), atol=1e-9)
    assert RANGES["wheel_speed"] > 45.0 / 0.285
    assert told["position_m"].equals(walking_log["position_m"])


def test_a_value_stands_until_it_has_changed(walking_log):
    told, least = on_change(walking_log), CHANGES["accel"]
    off = (told - walking_log)["accel_x_m_s2"]
    assert off.abs().max() < least
    moved = told["accel_x_m_s2"].dropna().diff().iloc[1:]
    assert np.all((moved == 0.0) | (moved.abs() >= least))
    assert 0.1 < (moved == 0.0).mean() < 0.9
    assert told["time_s"].equals(walking_log["time_s"])


def test_a_slow_receiver_leaves_every_second_row_without_a_speed(walking_log):
    told = slow_receiver(walking_log)
    assert told["vehicle_speed_m_s"].isna().to_numpy().tolist() == [False, True] * 1500
    assert told.drop(columns="vehicle_speed_m_s").equals(walking_log.drop(columns="vehicle_speed_m_s"))


def test_blended_and_plain_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    level = (peak**-2.0 - slope**-2.0) ** -0.5
    assert blended(0.05, slope, peak, 2.0) == pytest.approx((3000.0**-2.0 + level**-2.0) ** -0.5)
    assert blended(1.0, slope, peak, 2.4) == pytest.approx(peak)
    assert two_lines(0.1, slope, peak, 0.8) == pytest.approx(peak)
    assert two_lines(0.05, slope, peak, 0.8) == pytest.approx(0.75 * peak)
    assert two_lines(0.55, slope, peak, 0.8) == pytest.approx(0.9 * peak)
    assert two_lines(1.0, slope, peak, 0.8) == pytest.approx(0.8 * peak)
    slip = 1.0 / 21.0  # where the adhesion is the peak
    assert plain_dugoff(slip, slope, peak) == pytest.approx(0.75 * peak)
    assert plain_dugoff(0.5 * slip, slope, peak) == pytest.approx(slope / 41.0)


def test_noise_of_roads_and_axles_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 5e-3, np.random.default_rng(0)
    loud = np.abs(rough_stretches(white, clock, rng) / white.sigmas).reshape(-1, 40, 6).mean(axis=1)
    alike = np.corrcoef(loud.T)
    assert np.all(alike[~np.eye(6, dtype=bool)] > 0.5)
    sides = np.mean((skewed(white, clock, rng) / white.sigmas) ** 3, axis=0)
    assert_allclose(np.abs(sides), 2.0 / np.sqrt(6.0), rtol=0.1)
    spectrum = np.abs(np.fft.rfft(chirping(white, clock, rng) / white.sigmas, axis=0)) ** 2
    hertz = np.fft.rfftfreq(clock.size, 5e-3)
    inside = (hertz > CHIRP_HZ[0] - 1.0) & (hertz < CHIRP_HZ[1] + 1.0)
    floor = spectrum[~inside].mean(axis=0) * inside.sum()
    share = (spectrum[inside].sum(axis=0) - floor) / spectrum.sum(axis=0)
    assert_allclose(share, CHIRP_SHARE, atol=0.02)
    alike = np.corrcoef(by_axle(white, clock, rng).T)
    assert_allclose(alike[[0, 2], [1, 3]], AXLE_SHARE, atol=0.02)
    assert_allclose(alike[[0, 0, 1, 4], [2, 3, 2, 0]], 0.0, atol=0.02)


def test_readings_have_their_own_colours():
    clock, rng = np.arange(60_000) * 1e-3, np.random.default_rng(1)
    values = own_colours(QUIET, clock, rng) / QUIET.sigmas
    near = np.mean(values[2:] * values[:-2], axis=0)
    assert np.ptp(near) > 0.1
    assert np.all((near > 0.02) & (near < 0.62))


def test_rows_are_stamped_in_ticks_and_stay_in_order(uneven_log):
    told = in_ticks(uneven_log)
    ticks = told["time_s"] / TICK_S
    assert_allclose(ticks, np.round(ticks), atol=1e-6)
    assert np.abs(told["time_s"] - uneven_log["time_s"]).max() <= 0.5 * TICK_S + 1e-9
    assert np.diff(told["time_s"]).min() > 0.0
    assert told.drop(columns="time_s").equals(uneven_log.drop(columns="time_s"))


def test_values_have_so_many_figures(uneven_log):
    told = significant_digits(
        uneven_log.assign(vehicle_speed_m_s=[0.0, np.nan, 12.3456, -0.98768, 9.99996, 123.45] * 1000)
    )
    assert_allclose(told["vehicle_speed_m_s"].to_numpy()[:6], [0.0, np.nan, 12.35, -0.9877, 10.0, 123.4])
    figures = [float(f"{value:.3g}") for value in uneven_log["accel_x_m_s2"]]
    assert_allclose(told["accel_x_m_s2"], figures, atol=1e-9)
    assert told["time_s"].equals(uneven_log["time_s"])


def test_messages_get_lost_with_all_that_they_carry(uneven_log):
    lost = losing_frames(uneven_log).isna()
    assert lost["wheel_speed_fl_rad_s"].equals(lost["wheel_speed_rr_rad_s"])
    for column in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2"):
        assert lost[column].mean() == pytest.approx(FRAME_LOST, rel=0.5)
    assert not (lost["wheel_speed_fl_rad_s"] & lost["accel_x_m_s2"]).sum() > 3
    assert not lost[["time_s", "wheel_torque_fl_nm", "position_m"]].to_numpy().any()


def test_a_slow_accelerometer_leaves_every_second_row_without_it(uneven_log):
    told = slow_accelerometer(uneven_log)
    assert told["accel_x_m_s2"].isna().to_numpy().tolist() == [False, True] * 3000
    assert told.drop(columns="accel_x_m_s2").equals(uneven_log.drop(columns="accel_x_m_s2"))


def test_risen_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert sine_rise(np.pi / 6.0 / 20.0, slope, peak, 0.8) == pytest.approx(0.5 * peak)
    assert sine_rise(np.pi / 2.0 / 20.0, slope, peak, 0.8) == pytest.approx(peak)
    bell = sine_rise(3.0 * np.pi / 20.0, slope, peak, 0.8)
    assert bell == pytest.approx(peak * (0.8 + 0.2 * np.exp(-1.0)))
    assert arctangent(1.0, slope, peak) == pytest.approx(peak, rel=1e-6)
    assert arctangent(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-5)
    assert 0.4 < arctangent(0.05, slope, peak) / peak < 0.7


def test_noise_of_yawing_and_looseness_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(200_000) * 5e-3, np.random.default_rng(0)
    alike = np.corrcoef(yawing(white, clock, rng).T)
    assert_allclose(alike[[0, 2, 0], [1, 3, 3]], -YAW_SHARE, atol=0.03)
    assert_allclose(alike[[0, 1], [2, 3]], YAW_SHARE, atol=0.03)
    assert_allclose(alike[[0, 1, 4], [4, 5, 5]], 0.0, atol=0.03)
    thirds = working_loose(white, clock, rng).reshape(10, -1, 6).std(axis=1) / white.sigmas
    assert np.all(np.diff(thirds[::3], axis=0) > 0.0)
    ratios = thirds[-1] / thirds[0]
    least, most = ((1.0 + 0.45 * more) / (1.0 - 0.45 * more) for more in LOOSER)
    assert np.all((ratios > 0.95 * least) & (ratios < 1.05 * most))


def test_axles_come_in_turn(log):
    told = in_turns(log)
    for place, gone in (("fl", 1), ("fr", 1), ("rl", 0), ("rr", 0)):
        lost = told[f"wheel_speed_{place}_rad_s"].isna().to_numpy()
        assert np.array_equal(lost, np.arange(6000) % 2 == gone)
    rest = [c for c in log if not c.startswith("wheel_speed")]
    assert told[rest].equals(log[rest])
    kept = told["wheel_speed_rl_rad_s"].dropna()
    assert kept.equals(log["wheel_speed_rl_rad_s"].loc[kept.index])


def test_senders_wake_one_after_another(log):
    lost = waking(log).isna()
    assert not lost[["time_s", "wheel_torque_fl_nm"]].to_numpy().any()
    wheels = lost[[c for c in lost if c.startswith("wheel_speed")]].to_numpy()
    assert np.all(wheels == wheels[:, :1])
    first = [int(np.argmin(lost[c])) for c in ("wheel_speed_fl_rad_s", "vehicle_speed_m_s", "accel_x_m_s2")]
    assert len(set(first)) == 3
    assert all(WAKES_S[0] <= n / 250.0 <= WAKES_S[1] + 0.004 for n in first)
    assert not lost.iloc[max(first) :].to_numpy().any()


def test_locked_wheels_feel_a_blurred_border_over_its_length():
    road = Road((0.0, 30.0), (DRY, WET))
    blurs = OUTSIDE["road_borders_blurred"].apply(nominal(CAR, road), {"over_m": 16.0})
    path = roll(blurs, 30.0, 2.5, -3000.0)[300:]
    axles = [path[:, X] + CAR.wheelbase_m - CAR.cog_to_rear_axle_m, path[:, X] - CAR.cog_to_rear_axle_m]
    share = [np.interp(at, [22.0, 38.0], [DRY, WET]) for at in axles]
    front = CAR.cog_to_rear_axle_m / CAR.wheelbase_m
    told = -0.79 * 9.81 * (front * share[0] + (1.0 - front) * share[1])
    assert_allclose(path[:, N], told, rtol=2e-3)
    assert path[-1, X] > 45.0
    assert path[0, X] < 15.0


def test_bristled_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert bristles(1.0, slope, peak) == pytest.approx(peak, rel=1e-6)
    assert bristles(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-4)
    top = peak / (1.0 - (1.0 - np.exp(-40.0 * 0.975)) / (40.0 * 0.975))
    assert bristles(0.5 * top / slope, slope, peak) == pytest.approx(top * np.exp(-1.0), rel=2e-4)
    best = COMPOSITE_AT / (0.25 * np.pi * 20.0 * COMPOSITE_TOP)
    assert composite(best, slope, peak, 0.2) == pytest.approx(peak, rel=1e-7)
    assert max(composite(s, slope, peak, 0.0) for s in np.linspace(0.0, 1.0, 4001)) <= peak * (1.0 + 1e-9)
    one = composite(best / COMPOSITE_AT, slope, peak, 0.2)
    assert one == pytest.approx(peak / COMPOSITE_TOP * (4.0 / np.pi + 1.34) / 2.89)
    assert 0.78 < composite(1.0, slope, peak, 0.2) / peak < 0.81


def test_noise_of_one_box_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    alike = np.corrcoef(one_box(white, clock, rng).T)
    assert np.abs(alike[4, 5]) == pytest.approx(BOX_SHARE, abs=0.02)
    assert_allclose([alike[0, 1], alike[0, 4], alike[3, 5]], 0.0, atol=0.03)
    values = resampled(white, clock, rng)
    bends = np.abs(np.diff(values, 2, axis=0)) > 1e-9 * white.sigmas
    rates = bends.mean(axis=0) / 2e-3 / 2.0
    assert np.all((rates > 57.0) & (rates < 123.0))
    assert len(set(np.round(rates))) > 3


def test_what_was_lost_is_a_straight_line(log):
    lost = log.copy()
    lost.loc[[0, 500, 501, 5999], "vehicle_speed_m_s"] = np.nan
    told = filled_in(lost)
    assert list(told) == list(log)
    assert not told.isna().to_numpy().any()
    assert told[["time_s", "wheel_torque_fl_nm"]].equals(log[["time_s", "wheel_torque_fl_nm"]])
    speed = log["vehicle_speed_m_s"]
    line = speed[499] + (speed[502] - speed[499]) * np.array([1.0, 2.0]) / 3.0
    assert_allclose(told["vehicle_speed_m_s"].iloc[500:502], line, rtol=1e-9)
    changed = (told != log).sum()
    assert 20 < changed.sum() < 120
    assert (told["vehicle_speed_m_s"][[0, 5999]] == speed[[1, 5998]].to_numpy()).all()


def test_rows_are_stamped_by_the_time_of_day(log):
    told = by_the_clock(log)
    begun = told["time_s"][0] - log["time_s"][0]
    assert CLOCK_S[0] <= begun <= CLOCK_S[1]
    assert_allclose(np.diff(told["time_s"]), 1.0 / 250.0, rtol=1e-7)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_physics_of_nothing_is_the_nominal_car():
    """All that is neutral at nothing, set by hand, is the nominal car bit for bit."""
    limit = LimitDrive()
    names = ("height_jack", "load_side", "radius_wet", "inertia_speed", "grip_sign", "grip_slide", "lag_warm")
    more = ("relaxation_rise", "drag_shelter", "bend_drag", "roll_slow", "brake_wet", "delay_speed")
    rest = ("gain_turn", "torque_step", "shaft_turn")
    assert all(getattr(limit.world.physics, name) == 0.0 for name in (*names, *more, *rest))
    scaled = ("height_jack", "lag_warm", "relaxation_rise", "drag_shelter", "roll_slow", "brake_wet")
    of_none = limit.world.moved(**dict.fromkeys((*scaled, "grip_sign", "grip_slide", "gain_turn"), 0.3))
    assert limit.is_nominal(of_none)


def test_splined_tyres_at_known_points():
    slope, peak = 60_000.0, 3000.0
    assert brush_elliptic(1e-6, slope, peak) == pytest.approx(0.06, rel=1e-4)
    half = brush_elliptic(4.0 / np.pi * peak / slope, slope, peak)
    assert half == pytest.approx(peak * (0.5 + 1.0 / np.pi), rel=1e-9)
    assert peak * (1.0 - 1e-3) < brush_elliptic(1.0, slope, peak) <= peak
    best = 2.5 * peak / slope
    assert splined(1e-7, slope, peak, 2.5, 0.8) == pytest.approx(0.006, rel=1e-4)
    assert splined(best, slope, peak, 2.5, 0.8) == pytest.approx(peak)
    assert splined(0.5 * best, slope, peak, 2.5, 0.8) == pytest.approx(peak * (0.125 * 2.5 + 0.5))
    assert splined(1.0, slope, peak, 2.5, 0.8) == pytest.approx(0.8 * peak)
    assert splined(0.5 * (best + 1.0), slope, peak, 2.5, 0.8) == pytest.approx(0.9 * peak)


def test_noise_of_tones_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    values = beating_tones(white, clock, rng) / white.sigmas
    power = np.abs(np.fft.rfft(values, axis=0)) ** 2
    power /= power.sum(axis=0)
    top = np.sort(power[1:], axis=0)[-6:]
    hertz = np.fft.rfftfreq(clock.size, 2e-3)[1:][np.argmax(power[1:], axis=0)]
    assert np.all((top.sum(axis=0) > 0.18) & (top.sum(axis=0) < 0.27))
    assert np.all((hertz > 17.9) & (hertz < 41.3))
    values = meaned(white, clock, rng)
    near, far = ([np.corrcoef(column[lag:], column[:-lag])[0, 1] for column in values.T] for lag in (1, 13))
    assert np.all(np.array(near) > 0.4)
    assert_allclose(far, 0.0, atol=0.03)
    sparse = meaned(white, np.arange(50_000) * 0.02, rng)
    assert_allclose([np.corrcoef(c[1:], c[:-1])[0, 1] for c in sparse.T], 0.0, atol=0.03)


def test_a_place_comes_with_every_second_row(log):
    told = slow_place(log)
    assert told["position_m"][::2].equals(log["position_m"][::2])
    assert told["position_m"][1::2].isna().all()
    assert told.drop(columns="position_m").equals(log.drop(columns="position_m"))


def test_rows_are_stamped_from_a_trigger_on(log):
    told = triggered(log)
    before = log["time_s"][0] - told["time_s"][0]
    assert BEFORE_S[0] <= before <= BEFORE_S[1]
    assert told["time_s"].iloc[0] < 0.0 < told["time_s"].iloc[-1]
    assert_allclose(np.diff(told["time_s"]), 1.0 / 250.0, rtol=1e-4)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_a_simple_ranker_reads_such_logs(log):
    shown, place = _on_grid(log, 8000)
    for other in (slow_place(log), triggered(log)):
        told, there = _on_grid(other, 8000)
        assert_allclose(told, shown, rtol=0, atol=1e-3)
        assert_allclose(there, place, rtol=0, atol=1e-3)


def test_scaled_physics_of_nothing_is_the_nominal_car():
    """All that is neutral at nothing, set by hand, is the nominal car bit for bit."""
    limit = LimitDrive()
    scaled = ("drag_nod", "roll_flat", "relaxation_side", "grip_load", "gain_power", "brake_texture")
    absolute = ("pitch_stops", "stiffness_sides", "grip_axles", "delay_warm", "lag_tail", "notch")
    assert all(getattr(limit.world.physics, name) == 0.0 for name in (*scaled, *absolute, "shaft_warm"))
    of_none = limit.world.moved(**dict.fromkeys((*scaled, "shaft_warm"), 0.3))
    assert limit.is_nominal(of_none)


def test_a_tyre_at_known_points():
    slope, peak = 60_000.0, 3000.0
    best = np.e * peak / slope
    assert humped(1e-7, slope, peak, 0.8) == pytest.approx(0.006, rel=1e-4)
    assert humped(best, slope, peak, 0.8) == pytest.approx(peak)
    assert humped(0.5 * best, slope, peak, 0.8) == pytest.approx(0.5 * np.exp(0.5) * peak)
    assert humped(2.0 * best, slope, peak, 0.8) == pytest.approx((0.8 + 0.2 * 2.0 / np.e) * peak)
    assert humped(1.0, slope, peak, 0.8) == pytest.approx(0.8 * peak, rel=5e-3)


def test_noise_that_stands_has_its_kind():
    white = replace(QUIET, coloured_share=0.0)
    clock, rng = np.arange(100_000) * 2e-3, np.random.default_rng(0)
    together = np.corrcoef(multiplexed(white, clock, rng).T)
    kept = np.sqrt(KEPT_SHARE * (1.0 - KEPT_SHARE))
    expected = np.eye(6) + kept * (np.roll(np.eye(6), 1, axis=0) + np.roll(np.eye(6), -1, axis=0))
    assert_allclose(together, expected, atol=0.02)
    values = standing(white, clock, rng)
    stands = np.mean(np.diff(values, axis=0) == 0.0, axis=0)
    assert np.all((stands > 1.0 - 141.0 / 500.0) & (stands < 1.0 - 69.0 / 500.0))
    sparse = standing(white, np.arange(50_000) * 0.02, rng)
    assert_allclose([np.corrcoef(c[1:], c[:-1])[0, 1] for c in sparse.T], 0.0, atol=0.03)


def test_wheels_come_with_every_second_row(log):
    told, wheels = slow_wheels(log), [c for c in log if c.startswith("wheel_speed")]
    assert len(wheels) == 4
    assert told[wheels][::2].equals(log[wheels][::2])
    assert told[wheels][1::2].isna().all(axis=None)
    assert told.drop(columns=wheels).equals(log.drop(columns=wheels))


def test_a_logger_has_its_own_clock(log):
    told = own_clock(log)
    rate = told["time_s"].to_numpy() / log["time_s"].to_numpy()
    assert 1e-6 < abs(rate[-1] - 1.0) <= CLOCK_OFF
    assert_allclose(rate[100:], rate[-1], atol=1e-6)
    assert told.drop(columns="time_s").equals(log.drop(columns="time_s"))


def test_a_simple_ranker_reads_slow_and_off_clocks(log):
    slow = log.assign(**{c: 20.0 + np.sin(log["time_s"]) for c in log if c.startswith("wheel_speed")})
    shown, place = _on_grid(slow, 8000)
    for other in (slow_wheels(slow), own_clock(slow)):
        told, there = _on_grid(other, 8000)
        assert_allclose(told[:, :4], shown[:, :4], rtol=0, atol=2e-3)
        assert_allclose(there, place, rtol=0, atol=0.05)


def test_kinds_of_noise_are_told_apart():
    clock = np.arange(900) / 100.0
    kinds = {noisy(QUIET, clock, np.random.default_rng(0)).tobytes() for _, noisy in NOISES.values()}
    assert len(kinds) == len(NOISES)
