"""Signals that a recorder holds between messages: told, with their age; others that repeat values are not."""

import numpy as np
import pytest
from log_maker import make_frame, save

from sim2real.logs import read_log


@pytest.fixture
def frame():
    return make_frame(duration_s=10.0)


@pytest.fixture
def warnings(tmp_path):
    return lambda frame: read_log(save(frame, tmp_path / "log.csv")).warnings


def held(values, steps):
    """Values that stand until the row of the next of some steps."""
    newest = np.searchsorted(steps, np.arange(len(values)), side="right") - 1
    return values.to_numpy()[steps[newest]]


@pytest.mark.parametrize(
    ("rows", "told", "age_ms"), [(2, "2 rows, 20 ms", "5 ms"), (5, "5 rows, 50 ms", "20 ms")]
)
def test_a_held_message_is_told_with_its_age(frame, warnings, rows, told, age_ms):
    for name in ("vehicle_speed_m_s", "wheel_speed_fl_rad_s"):
        frame[name] = held(frame[name], np.arange(0, len(frame), rows))
    (warning,) = warnings(frame)
    assert "wheel_speed_fl_rad_s, vehicle_speed_m_s: every value stands for " + told in warning
    assert f"it is {age_ms} old" in warning


def test_messages_at_no_whole_number_of_rows_are_held_too(frame, warnings):
    steps = np.arange(0.0, len(frame), 3.6).astype(int)
    frame["vehicle_speed_m_s"] = held(frame["vehicle_speed_m_s"], steps)
    (warning,) = warnings(frame)
    assert "stands for 3.6 rows, 36 ms" in warning


def test_once_the_repeated_cells_are_empty_nothing_is_held(frame, warnings):
    frame["vehicle_speed_m_s"] = frame["vehicle_speed_m_s"].where(frame.index % 4 == 0)
    assert warnings(frame) == ()


@pytest.mark.parametrize("digit", [0.01, 0.1, 0.5])
def test_digits_repeat_values_without_a_pace(frame, warnings, digit):
    frame["vehicle_speed_m_s"] = (frame["vehicle_speed_m_s"] / digit).round() * digit
    assert warnings(frame) == ()


def test_digits_of_a_signal_without_noise_are_not_held(frame, warnings):
    speed = 15.0 + 2.0 * np.sin(2.0 * frame["time_s"])
    frame["vehicle_speed_m_s"] = (speed / 0.05).round() * 0.05
    assert warnings(frame) == ()
