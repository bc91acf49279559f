"""Whatever happens to a CSV file: a LogError, or nothing but the damaged cell, or a row that is told, has changed."""

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from log_maker import lines_of, make_frame

from sim2real.logs import LogError, read_log

FRAME = make_frame(rate_hz=50.0, duration_s=2.4, camera=True)
FRAME.loc[20:24, "wheel_speed_rr_rad_s"] = np.nan
LINES = lines_of(FRAME)
RAW = ("\n".join(LINES) + "\n").encode()
NUMBERS = FRAME.drop(columns="image_path").to_numpy(dtype=float)

SAME_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80)


@pytest.fixture
def attempt(tmp_path):
    """What reading these bytes gives: a table with the original's columns, lost ones NaN, or None for a LogError."""

    def read(raw):
        path = tmp_path / "log.csv"
        path.write_bytes(raw)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                log = read_log(path)
        except LogError:
            return None
        return log

    return read


def changed_cells(log):
    """Cells that are not as in the original; a column or a row that is gone must be told of; a row is one cell."""
    read = log.to_frame().reindex(columns=FRAME.columns)
    gone = [name for name in FRAME if name not in log.to_frame()]
    assert not gone or log.ignored or log.warnings
    lost = len(FRAME) - len(log)
    assert lost == 0 or (lost == 1 and "left out" in " ".join(log.warnings))
    rows = np.isin(FRAME["time_s"], read["time_s"]) if lost else np.ones(len(FRAME), dtype=bool)
    if np.count_nonzero(rows) != len(read):  # a time has changed, and a row is out of order by it
        rows = np.arange(len(FRAME)) != np.flatnonzero(~rows)[0]
    texts_before, before = FRAME["image_path"][rows].to_numpy(), NUMBERS[rows]
    numbers = read.drop(columns="image_path").to_numpy(dtype=float)
    differs = ~((numbers == before) | (np.isnan(numbers) & np.isnan(before)))
    differs[:, [FRAME.columns.get_loc(name) for name in gone if name != "image_path"]] = False
    texts = 0 if "image_path" in gone else np.count_nonzero(read["image_path"].to_numpy() != texts_before)
    return int(np.count_nonzero(differs)) + int(texts) + lost


def test_the_original_is_fine(attempt):
    log = attempt(RAW)
    assert changed_cells(log) == 0
    assert log.warnings == ()


@SAME_FILE
@given(at=st.integers(0, len(RAW) - 1), byte=st.integers(0, 255))
def test_one_changed_byte_changes_at_most_one_cell(attempt, at, byte):
    log = attempt(RAW[:at] + bytes([byte]) + RAW[at + 1 :])
    assert log is None or changed_cells(log) <= 1


@SAME_FILE
@given(at=st.integers(0, len(RAW)), text=st.binary(max_size=4), drop=st.integers(0, 4))
def test_bytes_put_in_or_taken_out(attempt, at, text, drop):
    """Four bytes reach into three cells at most."""
    log = attempt(RAW[:at] + text + RAW[at + drop :])
    assert log is None or changed_cells(log) <= 3


@SAME_FILE
@given(end=st.integers(0, len(RAW) - 1))
def test_a_file_cut_off_is_refused_or_told(attempt, end):
    """Cut at the end of a line nothing is wrong with what is left."""
    log = attempt(RAW[:end])
    assert log is None or RAW[end - 1 : end] == b"\n" or "without a line break" in log.warnings[-1]


ROWS = st.integers(1, len(LINES) - 1)
COLUMNS = st.integers(0, len(FRAME.columns) - 2)


@SAME_FILE
@given(row=ROWS, column=COLUMNS, cell=st.text(max_size=6))
def test_any_text_in_a_cell(attempt, row, column, cell):
    lines = list(LINES)
    cells = lines[row].split(",")
    cells[column] = cell
    lines[row] = ",".join(cells)
    log = attempt("\n".join(lines).encode("utf-8", "replace") + b"\n")
    assert log is None or changed_cells(log) <= 1


def with_rows(lines):
    return "\n".join(lines).encode() + b"\n"


@SAME_FILE
@given(first=ROWS, second=ROWS)
def test_swapped_rows_are_told_and_refused_where_many_are_out_of_order(attempt, first, second):
    lines = list(LINES)
    lines[first], lines[second] = lines[second], lines[first]
    log = attempt(with_rows(lines))
    assert (
        log is None or first == second or (len(log) == len(FRAME) - 1 and "out of order" in log.warnings[0])
    )
    assert log is not None or abs(first - second) > 1


@SAME_FILE
@given(row=ROWS)
def test_a_doubled_row_is_left_out_and_told(attempt, row):
    log = attempt(with_rows([*LINES[:row], LINES[row], *LINES[row:]]))
    assert changed_cells(log) == 0
    assert f"row {row + 2} repeats the time above" in log.warnings[0]


@SAME_FILE
@given(rows=st.sets(ROWS, min_size=2, max_size=20))
def test_more_doubled_rows_than_one_in_a_hundred_are_refused(attempt, rows):
    assert attempt(with_rows([line for i, line in enumerate(LINES) for _ in range(1 + (i in rows))])) is None


@SAME_FILE
@given(row=ROWS, column=st.integers(0, len(FRAME.columns) - 1), more=st.booleans())
def test_a_cell_too_few_or_too_many_is_refused(attempt, row, column, more):
    lines = list(LINES)
    cells = lines[row].split(",")
    cells[column : column + 1] = [cells[column], cells[column]] if more else []
    lines[row] = ",".join(cells)
    assert attempt("\n".join(lines).encode() + b"\n") is None


@SAME_FILE
@given(rows=st.sets(st.integers(2, len(LINES) - 2), min_size=1, max_size=3))
def test_rows_left_out_are_told_and_leave_the_others_alone(attempt, rows):
    log = attempt("\n".join(line for i, line in enumerate(LINES) if i not in rows).encode() + b"\n")
    kept = FRAME.drop(index=[i - 1 for i in rows])
    assert "more than half a step" in log.warnings[0]
    assert np.array_equal(log.time_s, kept["time_s"])
    for name, values in log.signals.items():
        assert np.array_equal(values, kept[name], equal_nan=True), name
