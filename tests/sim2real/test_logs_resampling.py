"""Logs onto a uniform grid: no delay, no aliasing, no bridging."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_maker import make_frame, save

from sim2real.logs import read_log, resample
from sim2real.logs.resampling import hold, lost_share, onto
from sim2real.observing.drive import RECOVERY_S
from sim2real.sources import read_source

STEPS = st.sampled_from([0.001, 0.002, 0.0025, 0.004, 0.01, 0.013, 0.05])


def read(tmp_path, frame):
    return read_log(save(frame, tmp_path / "log.csv"))


@given(step=STEPS, jitter=st.floats(0.0, 0.45), seed=st.integers(0, 1000))
def test_straight_lines_stay_exact_at_any_ratio(step, jitter, seed):
    """So there is no delay: a delayed ramp would be off by slope times delay."""
    time_s = 5.0 + np.arange(800) * 0.004
    time_s = time_s + 0.004 * jitter * np.random.default_rng(seed).uniform(-0.5, 0.5, 800)
    grid = np.arange(time_s[0], time_s[-1], step)
    assert onto(time_s, 3.0 - 7.0 * time_s, grid, step) == pytest.approx(3.0 - 7.0 * grid, abs=1e-7)


@pytest.mark.parametrize("ratio", [2, 3, 5, 10, 12.5])
def test_white_noise_is_averaged(ratio):
    noise = np.random.default_rng(0).normal(size=100_001)
    time_s = np.arange(len(noise)) * 0.001
    grid = np.arange(1.0, 99.0, ratio * 0.001)
    mean = onto(time_s, noise, grid, ratio * 0.001)
    assert np.std(mean) == pytest.approx(1.0 / np.sqrt(ratio), rel=0.15)


def test_what_is_too_fast_for_the_grid_is_not_folded_back():
    """A 99 Hz tone on a 100 Hz grid would be a 1 Hz tone of full size if samples were just left out."""
    time_s = np.arange(10_001) * 0.001
    tone = np.sin(2.0 * np.pi * 99.0 * time_s)
    grid = np.arange(1.0, 9.0, 0.01)
    assert np.max(np.abs(np.interp(grid, time_s, tone))) > 0.99
    assert np.max(np.abs(onto(time_s, tone, grid, 0.01))) < 0.02


def test_a_pulse_stays_centred():
    time_s = np.arange(1001) * 0.001
    pulse = np.exp(-(((time_s - 0.5) / 0.02) ** 2))
    grid = np.arange(101) * 0.01
    slow = onto(time_s, pulse, grid, 0.01)
    assert np.sum(grid * slow) / np.sum(slow) == pytest.approx(0.5, abs=1e-6)


def test_the_logs_own_grid_changes_nothing(tmp_path):
    log = read(tmp_path, make_frame(rate_hz=200.0, camera=True))
    time_s, signals = resample(log, 0.005)
    assert time_s == pytest.approx(log.time_s, abs=1e-12)
    for name, values in log.signals.items():
        assert np.array_equal(signals[name], values), name


@pytest.mark.parametrize(
    ("ratio", "count"),
    [(1, 1), (1, 3), (2, 1), (2, 2), (3, 3), (4, 3), (4, 4), (8, 9), (10, 9), (10, 30), (200, 3), (200, 250)],
)
def test_what_is_lost_for_longer_than_a_step_is_not_bridged(tmp_path, ratio, count):
    """Samples from 500 on are lost, and with them every value whose box reaches into what lies between the others."""
    log = read(tmp_path, make_frame(rate_hz=500.0))
    log.signals["vehicle_speed_m_s"][500 : 500 + count] = np.nan
    _, signals = resample(log, 0.002 * ratio)
    middle = np.arange(len(signals["position_m"])) * ratio
    half = 0.5 * ratio if ratio > 1 else 0.0
    lost = (middle + half > 499) & (middle - half < 500 + count) & (count + 1 > ratio)
    assert np.array_equal(np.isnan(signals["vehicle_speed_m_s"]), lost)
    assert np.isfinite(signals["position_m"]).all()


def test_samples_lost_at_random_cost_a_fast_log_little(tmp_path):
    log = read(tmp_path, make_frame(rate_hz=2000.0))
    speed = log.signals["vehicle_speed_m_s"]
    random = np.random.default_rng(1)
    for share in (0.04, 0.45):
        holed = np.where(random.random(len(speed)) < share, np.nan, speed)
        whole, with_holes = (
            resample(replace(log, signals={**log.signals, "vehicle_speed_m_s": values}), 0.008)[1][
                "vehicle_speed_m_s"
            ]
            for values in (speed, holed)
        )
        assert np.isfinite(with_holes[1:-1]).mean() > 0.99
        np.testing.assert_allclose(with_holes[1:-1], whole[1:-1], atol=0.05)


def test_missing_rows_are_lost_samples(tmp_path):
    log = read(tmp_path, make_frame().drop(index=[*range(100, 150), 200]))
    time_s, signals = resample(log, 0.01)
    lost = np.isnan(signals["vehicle_speed_m_s"])
    assert time_s[lost] == pytest.approx([*np.arange(100, 150) * 0.01, 2.0])
    _, coarse = resample(log, 0.05)
    assert np.flatnonzero(np.isnan(coarse["vehicle_speed_m_s"])).tolist() == [*range(20, 31)]


def test_classes_are_held_not_averaged(tmp_path):
    log = read(tmp_path, make_frame(rate_hz=1000.0, camera=True))
    time_s, signals = resample(log, 0.013)
    expected = np.floor(time_s * 10.0 + 1e-6)
    assert np.array_equal(signals["frame_id"], expected)
    assert set(np.unique(signals["image_class"])) == {-1.0, 0.0, 1.0}


def test_hold_knows_nothing_before_the_first():
    held = hold(np.array([1.0, 2.0]), np.array([5.0, 6.0]), np.array([0.9, 1.0, 1.99, 2.0 - 1e-9, 7.0]))
    assert np.array_equal(held, [np.nan, 5.0, 5.0, 6.0, 6.0], equal_nan=True)


@pytest.mark.parametrize("step_s", [0.0, -1.0, np.nan, 4.0])
def test_steps_that_make_no_grid(tmp_path, step_s):
    with pytest.raises(ValueError, match="expected more than 0 and at most the log's 3 s"):
        resample(read(tmp_path, make_frame()), step_s)


def test_drives_leave_out_what_follows_a_torque_that_is_lost_for_long(tmp_path):
    frame = make_frame(rate_hz=500.0, duration_s=12.0)
    frame.loc[2000:2200, "wheel_torque_rl_nm"] = np.nan
    frame.loc[4500:4520, "wheel_torque_fl_nm"] = np.nan
    road = tmp_path / "road.yaml"
    road.write_text(
        "schema: 1\nsegments: [{start_m: 0.0, mu_left: 0.9, mu_right: 0.9, surface: dry}]\n", encoding="utf-8"
    )
    source = read_source(str(save(frame, tmp_path / "log.csv")), road)
    left_out = source.drive.time_s[~source.drive.moving]
    assert left_out.min() == pytest.approx(4.0, abs=0.02)
    assert left_out.max() == pytest.approx(4.4 + RECOVERY_S, abs=0.02)
    assert (
        "2.41 s are left out: the torque of a wheel is missing there or shortly before."
        in source.log.warnings
    )
    assert np.isfinite(source.drive.torque_nm).all()


@pytest.mark.parametrize("every", [2, 3, 5])
def test_a_signal_that_comes_slower_than_the_rows_has_its_own_rate(every):
    time_s = np.arange(1000) * 0.01
    values = np.where(np.arange(1000) % every == 0, 3.0 + 2.0 * time_s, np.nan)
    assert lost_share(values, 0.01) == pytest.approx(0.0, abs=5e-3)
    grid = np.arange(0.0, 9.9, 0.008)
    found = onto(time_s, values, grid, 0.008)
    np.testing.assert_allclose(found, 3.0 + 2.0 * grid, atol=1e-9)
    values[300:360] = np.nan
    assert lost_share(values, 0.01) == pytest.approx(0.06, abs=0.01)
    found = onto(time_s, values, grid, 0.008)
    assert np.isnan(found[(grid > 3.01) & (grid < 3.54)]).all()


def test_a_signal_that_comes_once_a_second_is_lost_between():
    time_s = np.arange(1000) * 0.01
    values = np.where(np.arange(1000) % 100 == 0, 3.0, np.nan)
    assert lost_share(values, 0.01) == pytest.approx(0.99)
    assert np.isnan(onto(time_s, values, np.arange(0.004, 9.9, 0.008), 0.008)).mean() > 0.98


def test_a_signal_on_the_drives_rows_has_a_value_for_each_at_any_time_of_day(tmp_path):
    """A logger's clock counts from midnight: differences of its times carry the rounding of five digits before them."""
    frame = make_frame(rate_hz=150.0, duration_s=47.04)
    frame["time_s"] = np.round(frame["time_s"] + 74490.2966667, 7)
    frame["mu_reference"] = 0.8
    road = tmp_path / "road.yaml"
    road.write_text("schema: 1\nsegments:\n  - {start_m: 0.0, mu_left: 0.8, mu_right: 0.8, surface: dry}\n")
    source = read_source(str(save(frame, tmp_path / "day.csv")), road)
    assert len(source.on_rows("mu_reference")) == len(source.drive)
    assert source.on_rows("mu_reference") == pytest.approx(0.8)
    assert len(resample(source.log, source.drive.step_s)[0]) != len(
        source.drive
    )  # what the drive's own step would do
