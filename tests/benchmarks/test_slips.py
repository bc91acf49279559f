"""Slips of unit, sign, scale and time base in one column are named; clean logs are not warned of."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.robustness.slips import UNITS, clean_log, slipped, told


@pytest.fixture(scope="module")
def logs():
    return [clean_log(77_000 + k) for k in range(12)]


def test_no_clean_log_is_warned_of(logs):
    assert [told(frame) for frame in logs] == [()] * len(logs)


def test_each_slip_is_named_by_its_column(logs):
    rng = np.random.default_rng(5)
    seen = set()
    for k in range(120):
        frame, column, slip = slipped(logs[k % len(logs)], rng)
        seen.add(column)
        texts = told(frame)
        assert any(column in text or (column == "time_s" and "comes at" in text) for text in texts), (
            column,
            slip,
            texts,
        )
    assert seen == set(UNITS)


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("time_s", 1.6, "time_s looks about 1.6 times too large"),
        ("vehicle_speed_m_s", 1.6, "vehicle_speed_m_s looks about 1.6 times"),
        ("position_m", 0.6, "position_m looks about 0.6 times"),
        ("accel_x_m_s2", 1.6, "accel_x_m_s2 looks about 1.7 times"),
        ("wheel_speed_rl_rad_s", 1.5, "wheel_speed_rl_rad_s is 1.5 times the other wheels' speed"),
        ("wheel_torque_fr_nm", -1.0, "wheel_torque_fl_nm has the other sign than wheel_torque_fr_nm"),
        ("wheel_torque_rr_nm", 2.0, "wheel_torque_rl_nm is 0.5 times wheel_torque_rr_nm in the whole log"),
    ],
)
def test_the_column_that_is_off_is_told_from_those_that_agree(logs, column, factor, said):
    frame = logs[0]
    assert said in " ".join(told(frame.assign(**{column: factor * frame[column]})))


def test_torques_of_one_axle_may_differ_where_they_do_not_keep_a_factor(logs):
    frame = logs[0]
    t = frame["time_s"].to_numpy()
    for side, torque in (("l", 200.0 * np.sin(t)), ("r", 80.0 * np.cos(1.3 * t))):
        frame = frame.assign(**{f"wheel_torque_f{side}_nm": torque})
    assert told(frame) == ()


def curve(seconds=20.0, rate_hz=100.0, radius_m=0.3, track_m=1.5, wheelbase_m=2.7):
    """A drive through curves, with the signals of a car on them."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    speed, yaw = 12.0 + np.sin(0.7 * t), 0.3 * np.sin(0.5 * t)
    rng = np.random.default_rng(3)
    side = {"fl": -1, "fr": 1, "rl": -1, "rr": 1}
    columns = {"time_s": t}
    columns |= {f"wheel_torque_{w}_nm": 50.0 * np.cos(0.7 * t) + rng.normal(size=len(t)) for w in side}
    columns |= {
        f"wheel_speed_{w}_rad_s": (speed + s * 0.5 * track_m * yaw) / radius_m for w, s in side.items()
    }
    columns |= {"vehicle_speed_m_s": speed, "accel_x_m_s2": 0.7 * np.cos(0.7 * t)}
    columns |= {
        "yaw_rate_rad_s": yaw,
        "accel_y_m_s2": speed * yaw,
        "steering_angle_rad": wheelbase_m * yaw / speed,
    }
    return columns


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        (None, 1.0),
        ("yaw_rate_rad_s", 57.3),
        ("yaw_rate_rad_s", -1.0),
        ("accel_y_m_s2", 1 / 9.81),
        ("accel_y_m_s2", -1.0),
        ("steering_angle_rad", 57.3),
        ("steering_angle_rad", -1.0),
        ("steering_angle_rad", 15.0),
    ],
)
def test_signals_of_a_curve(column, factor):
    columns = curve()
    if column:
        columns[column] = factor * columns[column]
    texts = told(pd.DataFrame(columns))
    assert any(text.startswith(column) for text in texts) if column else texts == ()
