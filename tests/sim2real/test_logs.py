"""Reading logs: formats, what is refused, and what is only warned of."""

import hashlib

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from log_maker import lines_of, make_frame, save

from scenarios.errors import ScenarioError
from sim2real.logs import COLUMNS, REQUIRED, Log, LogError, read_log, write_log


@pytest.fixture
def frame():
    return make_frame()


@pytest.fixture
def read(tmp_path):
    def read_frame(frame):
        return read_log(save(frame, tmp_path / "log.csv"))

    return read_frame


@pytest.fixture
def refusal(tmp_path):
    """The problems of a log, one a line."""

    def refuse(log):
        path = tmp_path / "log.csv"
        if isinstance(log, pd.DataFrame):
            save(log, path)
        elif isinstance(log, bytes):
            path.write_bytes(log)
        else:
            path.write_text("\n".join(log) + "\n", encoding="utf-8")
        with pytest.raises(LogError) as error:
            read_log(path)
        lines = str(error.value).splitlines()
        assert all(line.startswith(f"{path}: ") for line in lines)
        return [line.removeprefix(f"{path}: ") for line in lines]

    return refuse


def assert_same(log: Log, frame: pd.DataFrame):
    assert np.array_equal(log.time_s, frame["time_s"])
    texts = {"image_path"} & set(frame)
    assert set(log.signals) == set(frame) - {"time_s"} - texts
    for name, values in log.signals.items():
        assert values.dtype == np.float64
        assert np.array_equal(values, frame[name], equal_nan=True), name
    if texts:
        assert list(log.image_path) == list(frame["image_path"])


class TestFormats:
    @pytest.mark.parametrize("suffix", ["csv", "parquet", "mf4"])
    @pytest.mark.parametrize("camera", [False, True])
    def test_round_trip_keeps_every_bit(self, tmp_path, suffix, camera):
        frame = make_frame(rate_hz=333.0, camera=camera)
        frame.loc[5:20, "wheel_speed_rl_rad_s"] = np.nan
        first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
        write_log(frame, first)
        log = read_log(first)
        assert_same(log, frame)
        assert log.ignored == ()
        assert log.warnings == ()
        write_log(log, second)
        assert_same(read_log(second), frame)

    @given(
        torque=arrays(np.float64, 151, elements=st.floats(allow_infinity=False)),
        suffix=st.sampled_from(["csv", "parquet"]),
    )
    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
    def test_round_trip_of_any_numbers(self, tmp_path, torque, suffix):
        torque[:76] = np.nan_to_num(torque[:76])
        frame = make_frame(rate_hz=50.0).assign(image_from_m=torque)
        write_log(frame, tmp_path / f"log.{suffix}")
        assert_same(read_log(tmp_path / f"log.{suffix}"), frame)

    def test_round_trip_of_extreme_numbers_as_mdf(self, tmp_path, frame):
        extremes = [5e-324, 1.7976931348623157e308, -1e-300, 0.1, 1 / 3]
        frame["image_from_m"] = np.resize(extremes, len(frame))
        write_log(frame, tmp_path / "log.mf4")
        assert_same(read_log(tmp_path / "log.mf4"), frame)

    def test_a_log_knows_its_file(self, tmp_path, frame):
        path = save(frame, tmp_path / "drive.csv")
        log = read_log(str(path))
        assert log.name == "drive.csv"
        assert log.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
        assert log.rate_hz == pytest.approx(100.0)
        assert log.image_folder == tmp_path
        assert log.image_path is None
        assert log.derived == frozenset()
        assert len(log) == len(frame)

    def test_the_content_tells_the_format(self, tmp_path, frame):
        write_log(frame, tmp_path / "log.parquet")
        (tmp_path / "log.parquet").rename(tmp_path / "log.dat0")
        assert_same(read_log(tmp_path / "log.dat0"), frame)

    @pytest.mark.parametrize("suffix", ["parquet", "mf4", "mdf"])
    def test_a_false_name_is_refused(self, tmp_path, frame, suffix):
        with pytest.raises(LogError, match=f"log.{suffix}: is named like"):
            read_log(save(frame, tmp_path / f"log.{suffix}"))

    def test_missing_files_and_unknown_endings(self, tmp_path, frame):
        with pytest.raises(LogError, match="cannot be read: No such file"):
            read_log(tmp_path / "no.csv")
        with pytest.raises(LogError, match="is a folder; expected a log"):
            read_log(tmp_path)
        with pytest.raises(LogError, match="expected a name that ends with"):
            write_log(frame, tmp_path / "log.xlsx")

    def test_errors_are_those_of_scenarios(self, tmp_path):
        with pytest.raises(ScenarioError):
            read_log(tmp_path / "no.csv")

    def test_csv_dialects_that_say_the_same(self, tmp_path, frame):
        path = tmp_path / "log.csv"
        text = frame.to_csv(index=False)
        path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").replace(",", " , ").encode())
        assert_same(read_log(path), frame)
        path.write_text(text.replace("\n", "\n\n") + "\n\n")
        assert_same(read_log(path), frame)

    @pytest.mark.parametrize("cell", ["", "NaN", "nan", "NA", "null", "-nan", " "])
    def test_lost_samples(self, tmp_path, frame, cell):
        lines = lines_of(frame)
        cells = lines[7].split(",")
        cells[3] = cell
        lines[7] = ",".join(cells)
        (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
        frame.iloc[6, 3] = np.nan
        assert_same(read_log(tmp_path / "log.csv"), frame)

    @pytest.mark.parametrize("cell", ["", "nan", "NA", "null"])
    def test_a_lost_picture_is_none(self, tmp_path, cell):
        named = make_frame(camera=True)
        named.loc[3, "image_path"] = cell
        named.to_csv(tmp_path / "log.csv", index=False)
        assert read_log(tmp_path / "log.csv").image_path[3] == ""

    def test_parquet_types(self, tmp_path, frame):
        path = tmp_path / "log.parquet"
        table = pa.Table.from_pandas(frame, preserve_index=False)
        whole = pa.array([None, *range(1, len(frame))], type=pa.int32())
        table = table.append_column("frame_id", whole)
        pq.write_table(table, path)
        log = read_log(path)
        assert np.isnan(log.signals["frame_id"][0])
        assert log.signals["frame_id"][1:].tolist() == list(range(1, len(frame)))
        names = pa.array([f"{x:g}" for x in frame["vehicle_speed_m_s"]])
        i = table.column_names.index("vehicle_speed_m_s")
        pq.write_table(table.set_column(i, "vehicle_speed_m_s", names), path)
        with pytest.raises(LogError, match="column vehicle_speed_m_s holds string; expected numbers"):
            read_log(path)

    def test_a_parquet_column_without_any_value_was_not_measured(self, tmp_path, frame):
        path = tmp_path / "log.parquet"
        frame["yaw_rate_rad_s"] = None
        frame.to_parquet(path)
        log = read_log(path)
        assert "yaw_rate_rad_s has no value at all; it is taken as not measured." in " ".join(log.warnings)

    def test_damaged_parquet(self, tmp_path, frame):
        path = tmp_path / "log.parquet"
        write_log(frame, path)
        raw = path.read_bytes()
        path.write_bytes(raw[: len(raw) // 2])
        with pytest.raises(LogError, match="cannot be read as Parquet"):
            read_log(path)

    def test_frames_may_be_numbered_by_names(self, tmp_path):
        frame = make_frame(camera=True)
        frame["frame_id"] = [f"cam_{int(k)}" for k in frame["frame_id"]]
        frame.loc[:9, "frame_id"] = ""
        for suffix in ("csv", "parquet", "mf4"):
            write_log(frame, tmp_path / f"log.{suffix}")
            ids = read_log(tmp_path / f"log.{suffix}").signals["frame_id"]
            assert np.isnan(ids[:10]).all()
            assert ids[10:].tolist() == [(i // 10) - 1 for i in range(10, len(frame))]


class TestRefusals:
    def test_all_problems_in_one_error(self, refusal, frame):
        frame = frame.drop(columns=["position_m", "accel_x_m_s2"])
        frame["vehicle_speed_m_s"] *= 3.6
        lines = lines_of(frame)
        lines[10] = lines[10].replace(lines[10].split(",")[2], "abc", 1)
        lines[20] += ",1"
        problems = refusal(lines)
        assert any("row 21 (11): not as many cells as row 1 has names (10)" in p for p in problems)
        assert any("column wheel_torque_fr_nm: row 11 ('abc') is not a number" in p for p in problems)
        assert any("required column missing: accel_x_m_s2" in p for p in problems)
        assert sum("km/h" in p for p in problems) == 1
        assert len(problems) == 4

    @pytest.mark.parametrize("name", REQUIRED)
    def test_a_missing_column_is_named_with_what_it_may_be_called(self, refusal, frame, name):
        (problem,) = refusal(frame.rename(columns={name: name.upper() + "_"}))
        assert problem.startswith(f"required column missing: {name} (is it '{name.upper()}_'?)")
        assert f"`{name}: {{" in problem

    def test_rows_are_those_of_an_editor(self, refusal, frame):
        lines = lines_of(frame)
        lines[5] = ""
        lines[8] = lines[8].rsplit(",", 1)[0] + ",x"
        assert "row 9 ('x')" in refusal(lines)[0]

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            (b"", "is empty"),
            (b"\n\n", "is empty"),
            (b"time_s,position_m\n", "has column names and no rows"),
            (b"\xff\xfet\x00", "has column names and no rows"),
            (b"\x00\x01\x02\x00\x80\x00", "expected"),
            (b"1,2\n3,4\n", "row 1 holds numbers in 2 columns, and no row above it"),
            (b"time_s,position_m\n1,2,3\n", "row 2 (3): not as many cells"),
            (b"time_s,position_m\n1,2,3", "row 2 (3): not as many cells"),
            (b"a;b\n1,234;2\n2,345;3\n", "may be a decimal comma or one between thousands"),
        ],
    )
    def test_no_table(self, refusal, text, expected):
        assert expected in refusal(text)[0]

    def test_damaged_utf8_names_the_row(self, refusal):
        text = "\n".join(lines_of(make_frame(camera=True))).encode()
        at = text.index(b"\n", 3000) + 2
        row = text[:at].count(b"\n") + 1
        assert f"row {row} is not UTF-8" in refusal(text[:at] + b"\xe4" + text[at:])[0]

    def test_one_decimal_comma_among_points(self, refusal, frame):
        lines = lines_of(frame)
        lines[1] = lines[1].rsplit(",", 1)[0] + ',"1,5"'
        assert "decimal comma" in refusal(lines)[0]

    def test_a_stray_quote_does_not_swallow_rows(self, refusal, frame):
        lines = lines_of(frame.assign(note=1))
        lines[20] = lines[20].rsplit(",", 1)[0] + ',"1'
        assert "unexpected end of data; expected cells without stray quotes" in refusal(lines)[0]

    @pytest.mark.parametrize("cell", ["1_000", "１", "0x10", "1e", "1.2.3", "--1", "true"])
    def test_what_is_no_number_here(self, refusal, frame, cell):
        lines = lines_of(frame)
        lines[3] = lines[3].rsplit(",", 1)[0] + f",{cell}"
        assert f"column position_m: row 4 ({cell!r}) is not a number" in refusal(lines)[0]

    def test_many_bad_cells_are_counted(self, refusal, frame):
        lines = lines_of(frame)
        lines[1:] = [line.rsplit(",", 1)[0] + ",x" for line in lines[1:]]
        assert "row 2 ('x'), row 3 ('x'), row 4 ('x') (and 298 more)" in refusal(lines)[0]

    def test_doubled_column(self, refusal, frame):
        lines = [f"{line},{'position_m' if i == 0 else 0}" for i, line in enumerate(lines_of(frame))]
        assert refusal(lines) == ["column 'position_m' stands 2 times; expected once."]

    def test_infinite_values(self, refusal, frame):
        frame.loc[3, "accel_x_m_s2"] = np.inf
        frame.loc[4, "position_m"] = -np.inf
        first, second = refusal(frame)
        assert "column accel_x_m_s2: row 5 is infinite" in first
        assert "column position_m: row 6 is infinite" in second

    def test_a_required_column_without_values(self, refusal, frame):
        frame["accel_x_m_s2"] = np.nan
        frame.loc[:200, "position_m"] = np.nan
        assert refusal(frame) == [
            "column accel_x_m_s2 has no value at all; expected measured values.",
            "column position_m: 67% of its samples are lost; expected at most 50%.",
        ]

    @pytest.mark.parametrize(
        ("name", "value", "expected"),
        [
            ("image_class", 3.0, "row 7 is 3; expected 0, 1, 2 or -1"),
            ("image_confidence", 93.0, "row 7 is 93; expected 0 to 1"),
            ("mu_reference", 85.0, "row 7 is 85; expected 0 to 2"),
        ],
    )
    def test_impossible_values(self, refusal, name, value, expected):
        frame = make_frame(camera=True)
        frame[name] = frame.get(name, 0.8)
        frame.loc[5, name] = value
        (problem,) = refusal(frame)
        assert problem.startswith(f"column {name}: {expected}")


class TestTime:
    @pytest.mark.parametrize(
        ("time_s", "said"),
        [
            (0.06, "repeats the time above (0.06 after 0.06)"),
            (0.03, "has a time that is out of order (0.03"),
            (9.0, ""),
            (np.nan, "has no time"),
        ],
    )
    def test_a_row_out_of_order_is_left_out_and_told(self, read, refusal, frame, time_s, said):
        frame.loc[7, "time_s"] = time_s
        log = read(frame)
        assert log.warnings[0].startswith(f"column time_s: row 9 {said}")
        assert log.warnings[0].endswith("; left out.")
        assert_same(log, frame.drop(index=7).reset_index(drop=True))
        frame.loc[[20, 40, 60, 80], "time_s"] = time_s
        assert "in all but 1% of the rows" in refusal(frame)[0]

    @pytest.mark.parametrize(
        ("unit", "per_second"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("min", 1 / 60), ("h", 1 / 3600)]
    )
    def test_another_unit_is_suspected(self, refusal, frame, unit, per_second):
        frame["time_s"] *= per_second
        assert f"Is the time in {unit}?" in refusal(frame)[0]

    @pytest.mark.parametrize("rate_hz", [10.0, 2500.0])
    def test_rates_that_are_no_use(self, refusal, rate_hz):
        assert f"comes at {rate_hz:g} Hz; expected 50 to 2000 Hz" in refusal(make_frame(rate_hz))[0]

    @pytest.mark.parametrize(
        ("rate_hz", "warns"), [(25.0, True), (49.9, False), (50.0, False), (2000.0, False)]
    )
    def test_rates_that_can_be_read(self, read, rate_hz, warns):
        log = read(make_frame(rate_hz))
        assert log.rate_hz == pytest.approx(rate_hz)
        assert any("less than the 50 Hz expected" in w for w in log.warnings) == warns

    def test_too_short(self, refusal):
        assert refusal(make_frame(duration_s=1.5)) == ["is 1.5 s long; expected at least 2 s."]
        assert refusal(make_frame().head(1)) == ["is 0 s long; expected at least 2 s."]

    def test_slight_jitter_is_fine(self, read, frame):
        frame["time_s"] += np.random.default_rng(1).uniform(-0.0012, 0.0012, len(frame))
        log = read(frame)
        assert log.warnings == ()
        assert log.rate_hz == pytest.approx(100.0, rel=0.02)

    def test_heavy_jitter_is_not(self, refusal, frame):
        frame["time_s"] += np.random.default_rng(1).uniform(-0.0049, 0.0049, len(frame))
        assert "expected a constant or slightly jittered rate" in refusal(frame)[0]

    @pytest.mark.parametrize("share", [0.1, 0.3])
    def test_rows_left_out_of_an_even_clock_are_lost_samples(self, read, share):
        """As a rig writes it that leaves out the cycles for which it comes too late."""
        whole = make_frame(1000.0, duration_s=3.0)
        kept = whole[np.random.default_rng(4).uniform(size=len(whole)) >= share]
        kept = kept.assign(time_s=kept["time_s"] + np.random.default_rng(5).uniform(-5e-5, 5e-5, len(kept)))
        log = read(kept)
        assert log.rate_hz == pytest.approx(1000.0, rel=0.03)
        assert len(log) == len(kept)
        assert "more than half a step" in log.warnings[0]

    def test_gaps_are_listed_and_short_ones_told(self, read, frame):
        log = read(frame.drop(index=[50, *range(100, 130)]))
        assert log.gaps == ((0.99, 1.3),)
        jitter, gap = log.warnings
        assert "row 52, row 101 is more than half a step (5 ms) off" in jitter
        assert gap == "has no rows from 0.99 to 1.3 s."


class TestScales:
    @pytest.mark.parametrize("factor", [3.6, 1 / 3.6])
    def test_speed_in_another_unit(self, refusal, frame, factor):
        """One finding for all wheels, short, and with what would mend it."""
        frame["vehicle_speed_m_s"] *= factor
        (said,) = [p for p in refusal(frame) if "over vehicle_speed_m_s" in p]
        assert said.startswith("every wheel speed")
        assert len(said) < 300
        assert "unit:" in said

    @pytest.mark.parametrize(("wheels", "factor"), [(("fl",), 0.0), (("fl", "fr", "rl", "rr"), 2.4)])
    def test_wheels_that_lock_or_spin_most_of_the_time_are_no_matter_of_units(
        self, read, frame, wheels, factor
    ):
        for w in wheels:
            frame.loc[: int(0.7 * len(frame)), f"wheel_speed_{w}_rad_s"] *= factor
        assert read(frame).warnings == ()

    def test_two_wheels_in_another_unit_are_named(self, refusal, frame):
        for w in ("fl", "rr"):
            frame[f"wheel_speed_{w}_rad_s"] *= 9.549
        assert [p.split(" over ")[0] for p in refusal(frame)] == [
            "column wheel_speed_fl_rad_s",
            "column wheel_speed_rr_rad_s",
        ]

    def test_mph_look_like_a_lorrys_wheels_and_show_in_the_position(self, refusal, frame):
        frame["vehicle_speed_m_s"] *= 2.237
        (problem,) = refusal(frame)
        assert problem.startswith(
            "column position_m changes by 45.04 m while the speed integrates to 100.7 m"
        )

    @pytest.mark.parametrize(
        ("factor", "hint"), [(9.549, "rpm"), (57.3, "deg/s"), (0.29, "in m/s"), (-1.0, "sign")]
    )
    def test_one_wheel_in_another_unit(self, refusal, frame, factor, hint):
        frame["wheel_speed_rl_rad_s"] *= factor
        (problem,) = (p for p in refusal(frame) if "over vehicle_speed_m_s" in p)
        assert problem.startswith("column wheel_speed_rl_rad_s over vehicle_speed_m_s is")
        assert hint in problem

    def test_speed_in_km_h_and_wheels_in_rpm(self, refusal, frame):
        frame["vehicle_speed_m_s"] *= 3.6
        for w in ("fl", "fr", "rl", "rr"):
            frame[f"wheel_speed_{w}_rad_s"] *= 9.549
        assert len([p for p in refusal(frame) if "rad/m" in p]) == 1

    @pytest.mark.parametrize("radius_m", [0.16, 0.2, 0.35, 0.5, 0.65])
    def test_wheels_of_any_road_vehicle(self, read, frame, radius_m):
        for w in ("fl", "fr", "rl", "rr"):
            frame[f"wheel_speed_{w}_rad_s"] *= 0.29 / radius_m
        assert read(frame).warnings == ()

    def test_standing_says_nothing(self, read, frame):
        for name in frame.columns.drop(["time_s", "accel_x_m_s2"]):
            frame[name] = 0.0
        assert read(frame).warnings == ()

    @pytest.mark.parametrize(
        ("factor", "hint"),
        [(1 / 9.81, "is it in g?"), (-1.0, "is its sign reversed?"), (0.0, "is it the longit")],
    )
    def test_the_accelerometer_is_only_warned_of(self, read, frame, factor, hint):
        frame["accel_x_m_s2"] *= factor
        (warning,) = read(frame).warnings
        assert hint in warning

    def test_a_grade_and_a_bias_are_no_reason(self, read, frame):
        frame["accel_x_m_s2"] = 0.8 * frame["accel_x_m_s2"] + 1.5
        assert read(frame).warnings == ()

    def test_odometer_in_km(self, refusal, frame):
        frame["position_m"] /= 1000.0
        assert "position_m changes by 0.04" in refusal(frame)[0]


class TestColumns:
    def test_unknown_columns_are_listed_and_slips_told(self, read, frame):
        log = read(frame.assign(rpm=1.0, Mu_Reference=0.9, gear=2))
        assert log.ignored == ("rpm", "Mu_Reference", "gear")
        assert log.warnings == ("column 'Mu_Reference' is ignored; did you mean 'mu_reference'?",)

    def test_what_is_not_there_was_not_measured(self, read, frame):
        log = read(frame.assign(yaw_rate_rad_s=np.nan, mu_reference=np.where(frame.index < 250, np.nan, 0.9)))
        assert "steering_angle_rad" not in log.signals
        assert "yaw_rate_rad_s" not in log.signals
        assert log.warnings == ("column yaw_rate_rad_s has no value at all; it is taken as not measured.",)
        assert np.isnan(log.signals["mu_reference"]).sum() == 250

    def test_many_lost_samples_are_told(self, read, frame):
        frame.loc[10:40, "vehicle_speed_m_s"] = np.nan
        assert read(frame).warnings == ("column vehicle_speed_m_s: 10% of its samples are lost.",)

    def test_signals_come_in_the_contracts_order(self, read):
        log = read(make_frame(camera=True).iloc[:, ::-1])
        assert list(log.signals) == [n for n in COLUMNS if n in log.signals]
        assert log.to_frame().columns.tolist() == [n for n in COLUMNS if n in log.to_frame()]

    def test_a_file_cut_off_is_told(self, tmp_path, frame):
        path = tmp_path / "log.csv"
        path.write_text(frame.to_csv(index=False)[:-3])
        assert "row 302 ends the file without a line break" in read_log(path).warnings[0]


class TestWindow:
    def test_neighbours_share_no_row(self, read, frame):
        log = read(frame.drop(index=range(100, 150)))
        early, late = log.window(0.0, 1.0), log.window(1.0, 9.0)
        assert len(early) + len(late) == len(log)
        assert early.gaps == late.gaps == ()
        assert log.window(0.5, 2.0).gaps == log.gaps == ((0.99, 1.5),)
        assert np.array_equal(late.signals["position_m"], log.signals["position_m"][len(early) :])

    def test_pictures_go_along(self, read):
        log = read(make_frame(camera=True)).window(1.0, 2.0)
        assert log.image_path[0] == "frames/straße_0010.png"
        assert len(log.image_path) == len(log) == 100

    def test_nothing_inside(self, read, frame):
        with pytest.raises(
            LogError, match="fewer than two rows from 7 to 8 s; expected a window within 0 to 3 s"
        ):
            read(frame).window(7.0, 8.0)
