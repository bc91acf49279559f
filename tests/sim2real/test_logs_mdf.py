"""Reading MDF: rasters, groups, invalid samples, and files that are damaged."""

import json
import os
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal
from log_maker import make_frame

from sim2real.logs import LogError, load_mapping, read_log, write_log
from sim2real.logs.formats import extraction, mdf_file
from sim2real.logs.formats.extraction import EXTRACTOR
from sim2real.logs.read import understood
from sim2real.logs.table import Wanted


@pytest.fixture
def frame():
    return make_frame()


def save_groups(path, *groups):
    """Signals of one group share a time base; each group is a list of Signals."""
    with MDF(version="4.10") as mdf:
        for group in groups:
            mdf.append(group, common_timebase=True)
        mdf.save(path, overwrite=True)
    return path


def signals(frame, drop=()):
    time_s = frame["time_s"].to_numpy()
    return [
        Signal(frame[name].to_numpy(), time_s, name=name) for name in frame.columns.drop(["time_s", *drop])
    ]


def test_the_wheel_speeds_give_the_time_base(tmp_path, frame):
    """A faster channel is averaged, a slower one interpolated, a class held; wherever the file has them."""
    fast_s, slow_s = np.arange(3001) / 1000.0, np.arange(31) / 10.0
    rng = np.random.default_rng(2)
    noise = rng.normal(size=len(fast_s))
    path = save_groups(
        tmp_path / "log.mf4",
        [Signal(4.0 * np.cos(2.0 * fast_s) + noise, fast_s, name="accel_x_m_s2")],
        [
            Signal(15.0 + 0.3 * slow_s, slow_s, name="vehicle_speed_m_s"),
            Signal(np.arange(31) % 3, slow_s, name="image_class"),
        ],
        signals(frame, drop=["vehicle_speed_m_s", "accel_x_m_s2"]),
    )
    log = read_log(path)
    assert np.array_equal(log.time_s, frame["time_s"])
    assert log.signals["vehicle_speed_m_s"] == pytest.approx(15.0 + 0.3 * log.time_s, abs=1e-9)
    assert log.warnings == ("channel vehicle_speed_m_s comes at 10 Hz and was interpolated onto 100 Hz.",)
    assert log.signals["image_class"].tolist() == [(i // 10) % 3 for i in range(301)]
    error = log.signals["accel_x_m_s2"][5:-5] - 4.0 * np.cos(2.0 * log.time_s[5:-5])
    assert np.std(error) == pytest.approx(1.0 / np.sqrt(10.0), rel=0.15)
    means = np.convolve(noise, np.r_[0.5, np.ones(9), 0.5] / 10.0, "same")[50:-50:10]
    assert error == pytest.approx(means, abs=1e-3)


def test_outside_its_own_time_a_channel_is_lost(tmp_path, frame):
    late_s = frame["time_s"].to_numpy()[100:]
    other = Signal(frame["accel_x_m_s2"].to_numpy()[100:], late_s, name="accel_x_m_s2")
    log = read_log(save_groups(tmp_path / "log.mf4", signals(frame, drop=["accel_x_m_s2"]), [other]))
    assert np.isnan(log.signals["accel_x_m_s2"][:100]).all()
    assert np.array_equal(log.signals["accel_x_m_s2"][100:], frame["accel_x_m_s2"][100:])


def test_the_units_that_it_states_are_converted_and_known_of_all_channels(tmp_path, frame):
    time_s = frame["time_s"].to_numpy()
    units = {"vehicle_speed_m_s": ("km/h", 3.6), "accel_x_m_s2": ("g", 1 / 9.80665)}
    with MDF(version="4.10") as mdf:
        for name in frame.columns.drop("time_s"):
            unit, by = units.get(name, ("", 1.0))
            mdf.append(Signal(by * frame[name].to_numpy(), time_s, name=name, unit=unit))
        mdf.append(Signal(time_s, time_s, name="Other", unit="bar"))
        mdf.save(tmp_path / "log.mf4")
    log = read_log(tmp_path / "log.mf4")
    assert log.warnings == ()
    for name in units:
        assert np.allclose(log.signals[name], frame[name], rtol=1e-12)
    assert understood(tmp_path / "log.mf4").table.units["Other"] == "bar"


def test_a_raster_without_a_clock_comes_onto_an_even_rate(tmp_path, frame):
    rng = np.random.default_rng(2)
    time_s = frame["time_s"].to_numpy() + rng.uniform(0.0, 0.008, len(frame))
    with MDF(version="4.10") as mdf:
        for name in frame.columns.drop("time_s"):
            mdf.append(Signal(frame[name].to_numpy(), time_s, name=name))
        mdf.save(tmp_path / "log.mf4")
    log = read_log(tmp_path / "log.mf4")
    assert "channel wheel_speed_fl_rad_s is sampled unevenly" in log.warnings[0]
    assert np.ptp(np.diff(log.time_s)) < 1e-9
    assert log.rate_hz == pytest.approx(100.0, rel=0.01)
    assert np.allclose(
        log.signals["position_m"], np.interp(log.time_s, time_s, frame["position_m"]), atol=1e-9
    )


def test_messages_that_come_in_bursts_after_pauses_are_bridged_up_to_a_tenth_of_a_second(tmp_path, frame):
    number = np.arange(len(frame))
    late = 0.05 * (number // 5 + 1) + 1e-4 * (number % 5)
    late[200:] += 0.15
    with MDF(version="4.10") as mdf:
        for name in frame.columns.drop("time_s"):
            mdf.append(Signal(frame[name].to_numpy(), late, name=name))
        mdf.save(tmp_path / "log.mf4")
    log = read_log(tmp_path / "log.mf4")
    lost = np.isnan(log.signals["position_m"])
    assert 5 <= np.count_nonzero(lost) <= 30
    assert log.time_s[lost].min() > late[199] - 1e-9
    assert log.time_s[lost].max() < late[200] + 1e-9


def test_invalid_samples_are_lost_ones(tmp_path, frame):
    group = signals(frame)
    marks = np.zeros(len(frame), dtype=bool)
    marks[30:35] = True
    k = [s.name for s in group].index("accel_x_m_s2")
    group[k] = Signal(group[k].samples, group[k].timestamps, name="accel_x_m_s2", invalidation_bits=marks)
    values = read_log(save_groups(tmp_path / "log.mf4", group)).signals["accel_x_m_s2"]
    assert np.array_equal(np.isnan(values), marks)


def test_raw_counts_and_value_tables(tmp_path, frame):
    """A linear conversion is applied; a table of texts beside numbers leaves the numbers."""
    group = signals(frame)
    time_s = group[0].timestamps
    counts = np.arange(len(frame), dtype=np.uint16)
    names = {"val_0": 0, "text_0": b"dry", "val_1": 1, "text_1": b"wet", "default": b""}
    group += [
        Signal(counts, time_s, name="steering_angle_rad", conversion={"a": 0.001, "b": -0.1}),
        Signal(counts % 2, time_s, name="image_class", conversion=names),
    ]
    log = read_log(save_groups(tmp_path / "log.mf4", group))
    assert log.signals["steering_angle_rad"] == pytest.approx(0.001 * counts - 0.1)
    assert log.signals["image_class"].tolist() == (counts % 2).tolist()


def test_names_that_stand_in_several_groups(tmp_path, frame):
    speed = frame["vehicle_speed_m_s"].to_numpy()
    time_s = frame["time_s"].to_numpy()
    path = save_groups(
        tmp_path / "log.mf4", signals(frame), [Signal(speed * 3.6, time_s, name="vehicle_speed_m_s")]
    )
    with pytest.raises(LogError, match=r"missing: vehicle_speed_m_s \(is it 'vehicle_speed_m_s#[01]'\?\)"):
        read_log(path)
    (tmp_path / "map.yaml").write_text("vehicle_speed_m_s: {column: 'vehicle_speed_m_s#1', unit: km/h}")
    log = read_log(path, load_mapping(tmp_path / "map.yaml"))
    assert log.signals["vehicle_speed_m_s"] == pytest.approx(speed, rel=1e-12)
    assert log.ignored == ("vehicle_speed_m_s#0", "time")


def test_the_master_goes_by_its_name_too(tmp_path, frame):
    path = save_groups(tmp_path / "log.mf4", signals(frame))
    (tmp_path / "map.yaml").write_text("time_s: {column: time}")
    log = read_log(path, load_mapping(tmp_path / "map.yaml"))
    assert np.array_equal(log.time_s, frame["time_s"])
    assert log.ignored == ()


PAIR = np.dtype([("near", "f8"), ("far", "f8")])


@pytest.mark.parametrize(
    ("samples", "options", "expected"),
    [
        (np.array([b"x"] * 301), {"encoding": "utf-8"}, "channel position_m holds text"),
        (np.zeros(301, dtype=PAIR), {}, "channel position_m holds several values"),
        (
            np.ones(301),
            {"master_metadata": ("wheel", 3)},
            "channel position_m is recorded over an angle, a dist",
        ),
    ],
)
def test_channels_that_are_no_signal(tmp_path, frame, samples, options, expected):
    odd = Signal(samples, frame["time_s"].to_numpy(), name="position_m", **options)
    path = save_groups(tmp_path / "log.mf4", signals(frame, drop=["position_m"]), [odd])
    with pytest.raises(LogError, match=expected):
        read_log(path)


def converted(path, frame, formula):
    """A log whose speed is the converted value of a channel that holds half of it."""
    half = Signal(
        0.5 * frame["vehicle_speed_m_s"].to_numpy(),
        frame["time_s"].to_numpy(),
        name="vehicle_speed_m_s",
        conversion={"formula": formula},
    )
    return save_groups(path, signals(frame, drop=["vehicle_speed_m_s"]), [half])


def test_a_formula_of_numbers_is_evaluated(tmp_path, frame):
    log = read_log(converted(tmp_path / "log.mf4", frame, "2 * X1 + 0 * sqrt(X1)"))
    assert log.signals["vehicle_speed_m_s"] == pytest.approx(frame["vehicle_speed_m_s"], rel=1e-12)


def test_a_formula_is_never_run_as_a_program(tmp_path, capfd, frame):
    mark = tmp_path / "run"
    formula = f"__import__('pathlib').Path({str(mark)!r}).touch() or 2 * X1"
    with pytest.raises(
        LogError,
        match=r"log\.mf4: cannot be read as MDF \(the formula .* of a channel has .* expected numbers",
    ):
        read_log(converted(tmp_path / "log.mf4", frame, formula))
    assert not mark.exists()
    assert capfd.readouterr().err == ""


def test_samples_are_numbered(tmp_path, frame):
    frame.loc[7, "accel_x_m_s2"] = np.inf
    with pytest.raises(LogError, match="column accel_x_m_s2: sample 8 is infinite"):
        read_log(save_groups(tmp_path / "log.mf4", signals(frame)))


@pytest.mark.parametrize("damage", ["cut in the data", "cut in the header", "garbage"])
def test_damage_is_one_clean_error(tmp_path, capfd, frame, damage):
    path = tmp_path / "log.mf4"
    write_log(frame, path)
    raw = bytearray(path.read_bytes())
    if damage == "garbage":
        raw[64:] = np.random.default_rng(0).bytes(len(raw) - 64)
    else:
        raw = raw[: len(raw) // 2 if damage == "cut in the data" else 80]
    path.write_bytes(raw)
    with pytest.raises(LogError, match="cannot be read as MDF") as error:
        read_log(path)
    assert len(str(error.value).splitlines()) == 1
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import os; os.abort()", "cannot be read as MDF; "),
        ("while True: pass", "no MDF that can be read within 1 s"),
    ],
)
def test_a_reader_that_crashes_or_hangs_is_one_too(tmp_path, monkeypatch, capfd, frame, code, expected):
    """Damaged sizes make asammdf do both."""
    write_log(frame, tmp_path / "log.mf4")
    (tmp_path / "reader.py").write_text(code)
    monkeypatch.setattr(extraction, "EXTRACTOR", tmp_path / "reader.py")
    monkeypatch.setattr(extraction, "LEAST_LIMIT_S", 1.0)
    with pytest.raises(LogError, match=expected):
        read_log(tmp_path / "log.mf4")
    assert capfd.readouterr().err == ""


PRINTING = """
import os, runpy, sys
sys.argv = [sys.argv[1]]
import asammdf
select = asammdf.MDF.select
asammdf.MDF.select = lambda *a, **k: (print("10 s on", flush=True), os.write(1, b"bar"), select(*a, **k))[2]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_what_a_library_prints_while_it_reads_is_no_part_of_the_answer(tmp_path, frame):
    path = save_groups(tmp_path / "log.mf4", signals(frame))
    order = {"reader": "mdf_channels", "path": str(path), "wanted": ["accel_x_m_s2"]}
    order |= {"most_numbers": 10**6, "most_bytes": 10**9}
    done = subprocess.run(
        [sys.executable, "-c", PRINTING, EXTRACTOR],
        input=json.dumps(order).encode(),
        capture_output=True,
        check=True,
    )
    assert b"10 s on" in done.stderr
    with np.load(BytesIO(done.stdout), allow_pickle=False) as arrays:
        assert np.array_equal(arrays["samples_0"], frame["accel_x_m_s2"])


@pytest.mark.skipif(
    sys.platform != "linux", reason="the reading process hears of its parent's end on Linux alone"
)
def test_the_reading_process_ends_with_the_command_that_was_killed(tmp_path):
    hold, unused = os.pipe()  # the reader's order never comes, and its input is never closed
    starter = f"import subprocess, sys; print(subprocess.Popen([sys.executable, {str(EXTRACTOR)!r}]).pid, flush=True)"
    starter += "; sys.stdin.close(); import time; time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", starter], stdin=hold, stdout=subprocess.PIPE) as command:
        reader = int(command.stdout.readline())
        time.sleep(1.0)
        assert Path(f"/proc/{reader}/stat").read_text().split()[2] != "Z"
        command.kill()
    for _ in range(100):
        try:
            ended = Path(f"/proc/{reader}/stat").read_text().split()[2] == "Z"
        except FileNotFoundError:
            ended = True
        if ended:
            break
        time.sleep(0.05)
    os.close(unused)
    os.close(hold)
    assert ended


def packed(path, names, n):
    """A log of these channels without any change, which takes next to nothing in the file."""
    with MDF(version="4.10") as mdf:
        mdf.append([Signal(np.zeros(n, np.int8), np.arange(n) * 1e-3, name=name) for name in names])
        mdf.save(path, compression=2)
    return path


def read_mdf_columns(path):
    wanted = Wanted(frozenset({"wheel_speed_fl_rad_s"}), base=("wheel_speed_fl_rad_s",))
    return set(mdf_file.read_mdf(path, wanted).numbers)


def test_a_file_that_unfolds_is_refused(tmp_path, frame):
    """A megabyte of packed zeros is a gigabyte of samples."""
    with pytest.raises(LogError, match="samples in the channels that are read; expected at most"):
        read_log(packed(tmp_path / "log.mf4", frame.columns[1:11], 7_000_000))


def test_the_process_that_reads_has_no_more_memory_than_it_needs(tmp_path, monkeypatch):
    path = packed(tmp_path / "log.mf4", ["wheel_speed_fl_rad_s"], 3_000_000)
    assert read_mdf_columns(path) == {"wheel_speed_fl_rad_s"}
    monkeypatch.setattr(extraction, "LEAST_MEMORY_BYTES", 0)
    monkeypatch.setattr(extraction, "MEMORY_PER_BYTE", 0)
    with pytest.raises(LogError, match="cannot be read as MDF"):
        read_mdf_columns(path)
