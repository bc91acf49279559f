"""The mark of a pulse-counting wheel-speed sensor: found where it is, and nowhere else."""

import numpy as np
import pytest
from counters import RATE_HZ, TURN, count, counted_wheels, driving, running
from gap_drives import MODEL, random_drives
from hypothesis import given, settings
from hypothesis import strategies as st
from long import beyond
from scipy.signal import lfilter

from scenarios.effects.wheel_speed_quantisation import WheelSpeedQuantisation
from sim2real.observing.lattice import (
    Lattice,
    Reading,
    RunningCounter,
    SmoothCounter,
    common_lattice,
    find_lattice,
    is_digit,
)

# --- found


@pytest.mark.parametrize("noise_quanta", [0.0, 0.05, 0.12])
@pytest.mark.parametrize(
    ("teeth", "window_s"),
    beyond(2, [(48, 0.02), (29, 0.03), (48, 0.05), (100, 0.01), (60, 0.04), (96, 0.1)]),
)
def test_a_counter_is_found_with_its_teeth_and_its_window(teeth, window_s, noise_quanta):
    found = find_lattice(*counted_wheels(teeth, window_s, noise_quanta))
    assert found is not None
    assert found.quantum_rad_s == pytest.approx(TURN / (teeth * window_s), rel=5e-3)
    assert found.window_s == pytest.approx(window_s, abs=0.5 / RATE_HZ)
    assert found.teeth == pytest.approx(teeth, rel=0.03, abs=0.5)
    assert found.sigma_rad_s == pytest.approx(
        noise_quanta * found.quantum_rad_s, rel=0.15, abs=0.01 * found.quantum_rad_s
    )


@pytest.mark.parametrize("rate_hz", [100.0, 250.0, 1000.0])
def test_a_counter_is_found_at_any_rate_of_the_log(rate_hz):
    found = find_lattice(*counted_wheels(48, 0.05, 0.05, rate_hz=rate_hz))
    assert found is not None
    assert found.teeth == pytest.approx(48, rel=0.06)
    assert found.window_s == pytest.approx(0.05, abs=0.5 / rate_hz)


@pytest.mark.parametrize("window_s", [0.0233, 0.0371, 0.0457])
def test_a_window_that_is_no_multiple_of_the_logs_step_is_found(window_s):
    found = find_lattice(*counted_wheels(48, window_s, 0.05))
    assert found is not None
    assert found.window_s == pytest.approx(window_s, abs=0.5 / RATE_HZ)
    assert found.teeth == pytest.approx(48, rel=0.03)


def test_the_plants_own_counter_is_found():
    case = {"wheel_speed_quantisation": {"teeth": 48.0, "window_s": 0.04}}
    for drive in random_drives(case, count=2, seed=2):
        assert drive.lattice is not None
        assert drive.lattice.teeth == pytest.approx(48, rel=0.03)
        assert drive.lattice.window_s == pytest.approx(0.04, abs=0.001)


def test_lost_samples_do_not_hide_it():
    time_s, wheels = counted_wheels(48, 0.04, 0.05)
    rng = np.random.default_rng(0)
    patchy = [np.where(rng.uniform(size=len(w)) < 0.02, np.nan, w) for w in wheels]
    found = find_lattice(time_s, patchy)
    assert found is not None
    assert found.quantum_rad_s == pytest.approx(TURN / (48 * 0.04), rel=1e-3)
    assert found.window_s == pytest.approx(0.04, abs=0.001)
    assert found.teeth == 48


def test_wheels_that_are_logged_in_turns_show_their_window():
    time_s, wheels = counted_wheels(48, 0.04, 0.05)
    in_turns = [np.where(np.arange(len(w)) % 2 == i % 2, w, np.nan) for i, w in enumerate(wheels)]
    found = find_lattice(time_s, in_turns)
    assert found is not None
    assert found.window_s == pytest.approx(0.04, abs=0.001)
    assert found.teeth == 48
    assert found.step_s == pytest.approx(2.0 * (time_s[1] - time_s[0]))


def test_changes_across_a_gap_tell_no_time():
    time_s, wheels = counted_wheels(48, 0.04, 0.05)
    at = np.arange(len(time_s))
    holes = [np.where(at % 23 < 6, np.nan, w) for w in wheels]
    found = find_lattice(time_s, holes)
    assert found is not None
    assert found.window_s == pytest.approx(0.04, abs=0.001)


def test_wheels_whose_windows_begin_at_times_of_their_own_share_one_window():
    time_s, speed = driving()
    wheels = [count(time_s, speed, 48, 0.04, 0.3 * i, begin_s=0.011 * i) for i in range(4)]
    found = find_lattice(time_s, wheels)
    assert found is not None
    assert found.window_s == pytest.approx(0.04, abs=0.5 / RATE_HZ)


@pytest.mark.parametrize("noise_quanta", [0.0, 0.1])
@pytest.mark.parametrize(
    ("teeth", "window_s", "rate_hz"),
    [
        (48, 0.02, 100.0),
        (48, 0.05, 500.0),
        (100, 0.03, 100.0),
        (96, 0.1, 200.0),
        (48, 0.024, 500.0),
        (48, 0.02, 50.0),
    ],
)
def test_a_counter_that_runs_along_with_the_log_shows_its_window_too(teeth, window_s, rate_hz, noise_quanta):
    rng = np.random.default_rng(0)
    time_s, speed = driving(rate_hz=rate_hz, duration_s=20.0)
    quantum = TURN / (teeth * window_s)
    wheels = [
        running(time_s, speed * (1.0 + 0.002 * i), teeth, window_s, rng.uniform())
        + noise_quanta * quantum * rng.standard_normal(len(time_s))
        for i in range(4)
    ]
    found = find_lattice(time_s, wheels)
    assert found is not None
    assert found.reading is Reading.RUNNING
    assert found.quantum_rad_s == pytest.approx(quantum, rel=5e-3)
    assert found.window_s == pytest.approx(window_s, abs=0.51 / rate_hz)
    low, high = found.teeth_range
    assert low <= teeth <= high


def test_rows_at_uneven_times_leave_the_window_of_a_running_counter_open():
    """A pulse is taken off at another row than the one that many steps later: none of them is the window."""
    teeth, window_s = 96, 0.05
    even_s, speed = driving()
    step_s = even_s[1] - even_s[0]
    time_s = even_s + 0.1 * step_s * np.random.default_rng(3).standard_normal(len(even_s))
    wheels = [
        running(time_s, np.interp(time_s, even_s, speed) * (1.0 + 0.002 * i), teeth, window_s, 0.2 * i)
        for i in range(4)
    ]
    found = find_lattice(time_s, wheels)
    assert found is not None
    assert found.reading in (Reading.ROUNDED, Reading.RUNNING)
    assert found.quantum_rad_s == pytest.approx(TURN / (teeth * window_s), rel=5e-3)
    assert found.window_range_s[0] <= window_s <= found.window_range_s[1]
    assert found.teeth_range[0] <= teeth <= found.teeth_range[1]


def test_a_speed_that_is_rounded_at_every_row_leaves_the_window_open():
    time_s, speed = driving()
    quantum = TURN / (48 * 0.04)
    wheels = [np.floor(speed * (1.0 + 0.002 * i) / quantum) * quantum for i in range(4)]
    found = find_lattice(time_s, wheels)
    assert found is not None
    assert found.reading is Reading.ROUNDED
    assert found.window_range_s[0] < 0.04 < found.window_range_s[1]
    assert found.teeth_range[0] < 48 < found.teeth_range[1]


def test_the_coarsest_lattice_is_it_though_the_car_cruises():
    """Nine tenths of the time at constant speed: the spread of the fast part is a small part of the quantum."""
    time_s = np.arange(3000) / 100.0
    speed = 40.0 + 0.2 * np.sin(0.7 * time_s) + 15.0 * np.clip(time_s - 27.0, 0.0, None) / 3.0
    wheels = [running(time_s, speed, 48, 0.02, 0.2 * i) + 0.02 * np.sin(1e5 * time_s + i) for i in range(4)]
    found = find_lattice(time_s, wheels)
    assert found is not None
    assert found.teeth == 48


# --- not found


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("sigma", [0.0, 0.02, 0.2, 1.0])
def test_smooth_signals_with_noise_have_no_lattice(seed, sigma):
    rng = np.random.default_rng(seed)
    time_s, speed = driving(seed=seed)
    wheels = [speed * (1.0 + 0.002 * i) + sigma * rng.standard_normal(len(speed)) for i in range(4)]
    assert find_lattice(time_s, wheels) is None


@pytest.mark.parametrize("sigma", [0.0, 0.05])
def test_a_cruise_at_constant_speed_has_no_lattice(sigma):
    rng = np.random.default_rng(1)
    time_s = np.arange(5000) / RATE_HZ
    assert find_lattice(time_s, [50.0 + sigma * rng.standard_normal(5000) for _ in range(4)]) is None


@pytest.mark.parametrize("sigma", [0.0, 0.05])
def test_a_standing_car_has_no_lattice(sigma):
    rng = np.random.default_rng(1)
    time_s = np.arange(5000) / RATE_HZ
    assert find_lattice(time_s, [sigma * rng.standard_normal(5000) for _ in range(4)]) is None


def test_digits_of_a_file_are_no_counter():
    """Speeds written with two digits behind the point, under noise of five such steps."""
    rng = np.random.default_rng(1)
    time_s, speed = driving()
    wheels = [np.round(speed + 0.05 * rng.standard_normal(len(speed)), 2) for _ in range(4)]
    assert find_lattice(time_s, wheels) is None


def test_random_drives_without_a_counter_have_no_lattice():
    assert all(d.lattice is None for d in random_drives({}, count=3, seed=5))


def test_too_short_a_log_tells_nothing():
    time_s, wheels = counted_wheels(48, 0.04)
    assert find_lattice(time_s[:99], [w[:99] for w in wheels]) is None


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.97))
def test_coloured_noise_has_no_lattice(seed, correlation):
    rng = np.random.default_rng(seed)
    time_s, speed = driving(duration_s=6.0)
    wheels = []
    for _ in range(4):
        white = np.sqrt(1.0 - correlation**2) * rng.standard_normal(len(speed))
        wheels.append(speed + 0.1 * lfilter([1.0], [1.0, -correlation], white))
    assert find_lattice(time_s, wheels) is None


# --- what is made of it


def test_a_sensor_is_there_if_most_logs_show_it():
    found = [
        Lattice(3.27, 0.04, 0.05, 0.01),
        None,
        Lattice(3.28, 0.041, 0.05, 0.01),
        Lattice(3.26, 0.04, 0.06, 0.01),
    ]
    shared = common_lattice(found)
    assert shared is not None
    assert (shared.quantum_rad_s, shared.window_s) == (3.27, 0.04)
    assert common_lattice([*found[:2]]) is None
    assert common_lattice([None, None, None]) is None
    assert common_lattice([]) is None


def test_the_smooth_counter_is_the_counter_on_average():
    """Over many phases of teeth the rounding averages out, and what is left is the smooth counter."""
    time_s, speed = driving(duration_s=4.0)
    window_s = 0.05
    rng = np.random.default_rng(3)
    many = np.mean(
        [count(time_s, speed, 48, window_s, rng.uniform(), rng.uniform(0.0, window_s)) for _ in range(200)],
        axis=0,
    )
    smooth = SmoothCounter(48.0, window_s).sense(
        time_s, {"wheel_speed_fl_rad_s": speed, "accel_x_m_s2": speed}
    )
    late = time_s > 0.2
    np.testing.assert_allclose(smooth["wheel_speed_fl_rad_s"][late], many[late], atol=0.25)
    assert np.abs(speed - many)[late].max() > 1.0
    np.testing.assert_array_equal(smooth["accel_x_m_s2"], speed)


def test_a_running_counter_is_on_average_half_a_window_late():
    time_s, speed = driving(duration_s=4.0)
    rng = np.random.default_rng(3)
    many = np.mean([running(time_s, speed, 48, 0.05, rng.uniform()) for _ in range(200)], axis=0)
    (smooth,) = RunningCounter(48.0, 0.05).sense(time_s, {"wheel_speed_fl_rad_s": speed}).values()
    late = time_s > 0.2
    np.testing.assert_allclose(smooth[late], many[late], atol=0.25)
    assert np.abs(speed - many)[late].max() > 0.5


@pytest.mark.parametrize("counter", [SmoothCounter(48.0, 0.05), RunningCounter(48.0, 0.05)])
def test_a_model_predicts_with_the_counter_that_was_read(counter):
    (effect,) = MODEL.with_effects(counter).effects
    assert effect == counter
    assert type(effect) is type(counter)
    (plants,) = MODEL.with_effects(WheelSpeedQuantisation(48.0, 0.05)).effects
    assert type(plants) is SmoothCounter


def test_a_counter_without_a_window_is_an_ideal_sensor():
    signals = {"wheel_speed_fl_rad_s": np.arange(5.0)}
    assert SmoothCounter(48.0, 0.0).sense(np.arange(5.0), signals) is signals


def test_the_effect_of_a_lattice_is_its_counter():
    assert Lattice(TURN / (48 * 0.04), 0.04, 0.0, 0.002).effect() == SmoothCounter(48.0, 0.04)


def test_the_own_counter_of_this_file_is_the_plants():
    """The oracle above and the plant's effect agree where their windows and teeth begin alike."""
    time_s, speed = driving(duration_s=3.0)
    ours = count(time_s, speed, 48, 0.04)
    theirs = WheelSpeedQuantisation(48.0, 0.04).sense(time_s, {"wheel_speed_fl_rad_s": speed})
    quantum = TURN / (48 * 0.04)
    late = time_s > 0.2
    off = (theirs["wheel_speed_fl_rad_s"] - ours)[late] / quantum
    assert np.mean(np.abs(off) < 1e-6) > 0.95  # the others: a tooth that passes just at a window's end


@pytest.mark.parametrize("digit", [0.1, 0.01, 0.05, 1.0 / 64.0, 1e-3])
def test_the_last_digit_of_a_file_is_no_counter(digit):
    rng = np.random.default_rng(4)
    time_s, speed = driving()
    wheels = [
        np.round((speed + 0.3 * digit * rng.standard_normal(len(speed))) / digit) * digit for _ in range(4)
    ]
    assert find_lattice(time_s, wheels) is None


def test_round_numbers_are_told_from_a_counters_quanta():
    assert all(is_digit(q) for q in (0.1, 0.02, 0.05, 0.0025, 1.0, 1.0 / 64.0, 0.00625, 0.0015625))
    assert not any(
        is_digit(TURN / (teeth * w)) for teeth in (48, 96, 100, 1018, 4096) for w in (0.005, 0.01, 0.04)
    )
