"""Logs as people have them: dialects, units, times, rows out of order, codes for "no value"."""

import numpy as np
import pandas as pd
import pytest
from log_maker import WHEELS, lines_of, make_frame
from plant_drives import make_road

import trpac
from scenarios.errors import ScenarioError
from sim2real.logs import LogError, load_mapping, read_log
from sim2real.sources import make_source

CAR = trpac.Vehicle.builtin("four_in_wheel_motor_ev")
GERMAN = {
    "time_s": "Zeit",
    "vehicle_speed_m_s": "Geschw",
    "accel_x_m_s2": "ax",
    "position_m": "Weg",
    **{f"wheel_speed_{w}_rad_s": f"n_{w}" for w in WHEELS},
    **{f"wheel_torque_{w}_nm": f"M_{w}" for w in WHEELS},
}
UNITS = {"Zeit": "s", "Geschw": "km/h", "ax": "m/s²", "Weg": "m"}
UNITS |= {f"n_{w}": "1/min" for w in WHEELS} | {f"M_{w}": "Nm" for w in WHEELS}
FACTORS = {"Geschw": 3.6} | {f"n_{w}": 30.0 / np.pi for w in WHEELS}
MAP = "schema: 1\n" + "".join(f"{ours}: {theirs}\n" for ours, theirs in GERMAN.items())


@pytest.fixture
def frame():
    return make_frame()


@pytest.fixture
def german(frame):
    theirs = frame.rename(columns=GERMAN)
    return theirs.assign(**{name: theirs[name] * factor for name, factor in FACTORS.items()})


@pytest.fixture
def read(tmp_path):
    """The log of a text under a mapping."""

    def read_text(text, mapping=None, encoding="utf-8", name="log.csv"):
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        if mapping is None:
            return read_log(tmp_path / name)
        (tmp_path / "map.yaml").write_text(mapping, encoding="utf-8")
        return read_log(tmp_path / name, load_mapping(tmp_path / "map.yaml"))

    return read_text


def assert_same(log, frame, rtol=1e-12, start=0.0):
    assert log.warnings == ()
    assert np.allclose(log.time_s - start, frame["time_s"], rtol=0.0, atol=1e-6)
    for name in frame.columns.drop("time_s"):
        assert np.allclose(log.signals[name], frame[name], rtol=rtol, atol=1e-12), name


def with_units(german, form="{} [{}]"):
    return german.rename(columns={name: form.format(name, UNITS[name]) for name in german})


class TestDialects:
    @pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-8", "cp1252", "utf-16", "utf-16-le"])
    @pytest.mark.parametrize("form", ["{} [{}]", "{} ({})", "{}/{}"])
    def test_units_in_names(self, read, frame, german, encoding, form):
        text = with_units(german, form).to_csv(index=False, sep=";", decimal=",")
        assert_same(read(text, MAP, encoding), frame)

    def test_tabs_and_decimal_commas(self, read, frame):
        log = read(frame.to_csv(index=False, sep="\t", decimal=","))
        assert_same(log, frame)
        assert log.notes == ("tabs", "decimal comma")

    def test_decimal_commas_in_quotes_between_commas(self, read, frame):
        text = "\n".join(
            [
                ",".join(frame),
                *(",".join(f'"{x}"'.replace(".", ",") for x in row) for row in frame.to_numpy()),
            ]
        )
        assert_same(read(text + "\n"), frame)

    def test_a_separator_at_the_end_of_each_row(self, read, frame):
        names, *rows = lines_of(frame)
        assert_same(read("\n".join([names, *(row + "," for row in rows)]) + "\n"), frame)
        assert_same(read("\n".join(row + "," for row in (names, *rows)) + "\n"), frame)

    def test_one_column_of_thousands_and_text_among_them(self, read, frame):
        wide = pd.concat(
            [frame, pd.DataFrame({f"x{i}": "off" for i in range(1000)}, index=frame.index)], axis=1
        )
        assert_same(read(wide.to_csv(index=False)), frame)

    def test_two_units_for_one_column_are_refused(self, read, german):
        names, *rows = lines_of(with_units(german))
        units = ",".join({"Geschw": "m/s"}.get(name, unit) for name, unit in UNITS.items())
        order = ",".join(dict(zip(UNITS, units.split(","), strict=True))[name] for name in german)
        with pytest.raises(
            LogError, match=r"column 'Geschw \[km/h\]' states two units, 'km/h' in its name and 'm/s'"
        ):
            read("\n".join([names, order, *rows]) + "\n", MAP)

    def test_a_unit_that_is_unknown_is_refused_with_the_line_that_settles_it(self, read, frame):
        text = frame.rename(columns={"vehicle_speed_m_s": "v [parsec]"}).to_csv(index=False)
        with pytest.raises(
            LogError, match=r"states the unit 'parsec'.*`vehicle_speed_m_s: \{column: 'v', unit: UNIT\}`"
        ):
            read(text, "schema: 1\nvehicle_speed_m_s: v\n")
        assert_same(read(text, "schema: 1\nvehicle_speed_m_s: {column: v, unit: m/s}\n"), frame)

    def test_the_mappings_unit_holds_and_the_files_is_told(self, read, frame):
        text = frame.rename(columns={"vehicle_speed_m_s": "v [km/h]"}).to_csv(index=False)
        log = read(text, "schema: 1\nvehicle_speed_m_s: {column: v, unit: m/s}\n")
        assert log.warnings == (
            "column 'v' is in km/h by the file and in m/s by the mapping; the mapping's is used.",
        )


class TestUnitRows:
    def rows(self, german, units, *more):
        names, *rows = lines_of(german)
        return "\n".join([names, *more, ",".join(units[name] for name in german), *rows]) + "\n"

    def test_below_the_names(self, read, frame, german):
        log = read(self.rows(german, UNITS), MAP)
        assert_same(log, frame)
        assert log.notes == ("units in row 2",)

    def test_in_brackets_below_a_row_of_descriptions(self, read, frame, german):
        said = ",".join(f"Signal {name}" for name in german)
        log = read(self.rows(german, {k: f"[{u}]" for k, u in UNITS.items()}, said), MAP)
        assert_same(log, frame)
        assert log.notes == ("units in row 3",)

    def test_below_a_preamble_with_units_of_others_that_are_unknown(self, read, frame, german):
        wide = german.assign(U=12.5, T=80.0, p=1.0)
        text = "Recorder 7\nBy: NN\n" + self.rows(wide, UNITS | {"U": "V", "T": "°C", "p": "bar"})
        assert_same(read(text, MAP), frame)

    @pytest.mark.parametrize("key", ["header_row", "unit_row"])
    def test_stated_where_there_is_no_row(self, read, german, key):
        with pytest.raises(LogError, match="has 304 rows in its head; the mapping's format has row 9000"):
            read(self.rows(german, UNITS) + "\n", MAP + f"format: {{{key}: 9000}}\n")

    def test_stated_to_be_none(self, read, german):
        with pytest.raises(LogError, match=r"row 2 \('s'\) is not a number"):
            read(self.rows(german, UNITS), MAP + "format: {unit_row: 0}\n")


class TestTimes:
    @pytest.mark.parametrize(
        "form",
        ["%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ", "%Y-%m-%dT%H:%M:%S.%f+02:00", "%Y%m%dT%H%M%S.%f"],
    )
    def test_iso_8601(self, read, frame, form):
        stamps = pd.Timestamp("2024-05-03 23:59:58.5") + pd.to_timedelta(frame["time_s"], unit="s").dt.round(
            "us"
        )
        log = read(frame.assign(time_s=stamps.dt.strftime(form)).to_csv(index=False))
        assert_same(log, frame)
        assert log.notes == ("time as ISO 8601, from the first row on",)

    def test_a_cell_without_a_time_is_a_row_left_out(self, read, frame):
        stamps = pd.Timestamp("2024-05-03") + pd.to_timedelta(frame["time_s"], unit="s").dt.round("us")
        texts = stamps.dt.strftime("%Y-%m-%d %H:%M:%S.%f").mask(frame.index == 7, "")
        log = read(frame.assign(time_s=texts).to_csv(index=False))
        assert log.warnings[0] == "column time_s: row 9 has no time; left out."
        assert np.array_equal(log.signals["position_m"], frame["position_m"].drop(7))

    @pytest.mark.parametrize("start", ["12:34:58.5", "12:59:59", "23:59:58.9"])
    @pytest.mark.parametrize("form", ["%H%M%S.%f", "%H:%M:%S.%f"])
    def test_a_clock_over_a_minute_an_hour_and_midnight(self, read, frame, start, form):
        stamps = pd.Timestamp(f"2024-05-03 {start}") + pd.to_timedelta(frame["time_s"], unit="s").dt.round(
            "us"
        )
        log = read(frame.assign(time_s=stamps.dt.strftime(form)).to_csv(index=False))
        assert_same(log, frame, start=log.time_s[0])
        assert log.gaps == ()
        assert log.time_s[0] == pytest.approx(pd.Timedelta(start).total_seconds())

    @pytest.mark.parametrize("start", [58.0, 98.5, 123_458.0])
    def test_seconds_that_only_look_like_a_clock(self, read, frame, start):
        log = read(frame.assign(time_s=np.round(frame["time_s"] + start, 3)).to_csv(index=False))
        assert_same(log, frame, start=start)
        assert log.notes == ()

    def test_dates_that_may_be_read_two_ways_ask_for_their_form(self, read, frame):
        stamps = pd.Timestamp("2024-05-03") + pd.to_timedelta(frame["time_s"], unit="s").dt.round("us")
        text = frame.assign(time_s=stamps.dt.strftime("%d.%m.%Y %H:%M:%S.%f")).to_csv(index=False)
        with pytest.raises(LogError, match=r"time: \{column: 'time_s', form: "):
            read(text)
        assert_same(read(text, "schema: 1\ntime: {column: time_s, form: '%d.%m.%Y %H:%M:%S.%f'}\n"), frame)

    @pytest.mark.parametrize(
        ("time", "said"),
        [
            ("{column: t, form: noon}", "form: 'noon'; expected seconds, iso8601"),
            ("{column: t, form: iso8601, unit: ms}", "unit: belongs to form seconds"),
            ("{column: t, unit: parsec}", "unit 'parsec' cannot become"),
        ],
    )
    def test_a_mapping_that_states_no_time(self, read, frame, time, said):
        with pytest.raises(LogError, match=said):
            read(frame.to_csv(index=False), f"schema: 1\ntime: {time}\n")


class TestRowsOfMessages:
    MESSAGES = (
        ["accel_x_m_s2"],
        [f"wheel_torque_{w}_nm" for w in WHEELS] + ["position_m"],
        [f"wheel_speed_{w}_rad_s" for w in WHEELS] + ["vehicle_speed_m_s"],
    )

    def rows(self, frame, shifts=(0.0, 0.0, 0.0), every=(1, 1, 1)):
        parts = [
            frame[["time_s", *columns]].assign(time_s=frame["time_s"] + shift).iloc[::step]
            for columns, shift, step in zip(self.MESSAGES, shifts, every, strict=True)
        ]
        return pd.concat(parts).sort_values("time_s", kind="stable")

    def test_each_message_has_its_own_times(self, read, frame):
        log = read(self.rows(frame, shifts=(0.0003, 0.0007, 0.0)).to_csv(index=False))
        assert log.notes == ("one row per message",)
        assert log.warnings == ()
        assert np.array_equal(log.time_s, frame["time_s"])
        middle = slice(2, -2)
        expected = np.interp(log.time_s[middle], frame["time_s"] + 0.0007, frame["position_m"])
        assert np.allclose(log.signals["position_m"][middle], expected, atol=1e-9)

    def test_at_rates_of_their_own(self, read):
        frame = make_frame(rate_hz=200.0)
        log = read(self.rows(frame, every=(1, 4, 2)).to_csv(index=False, sep=";", decimal=","))
        assert log.rate_hz == pytest.approx(100.0)
        assert np.array_equal(log.signals["vehicle_speed_m_s"], frame["vehicle_speed_m_s"][::2])
        assert np.allclose(log.signals["position_m"], frame["position_m"][::2], atol=1e-3, equal_nan=True)

    @pytest.mark.parametrize("samples", [0, 1])
    def test_a_column_that_is_empty_was_not_measured(self, read, frame, samples):
        rows = self.rows(frame, shifts=(0.0003, 0.0007, 0.0)).assign(yaw_rate_rad_s=np.nan)
        rows.iloc[:samples, -1] = 0.1
        log = read(rows.to_csv(index=False))
        assert log.warnings == ("column yaw_rate_rad_s has no value at all; it is taken as not measured.",)

    def test_with_the_other_cells_carried_forward(self, read, frame):
        rows = self.rows(frame, shifts=(0.0003, 0.0007, 0.0)).ffill().dropna()
        log = read(rows.to_csv(index=False))
        assert log.notes == ("one row per message, other cells carried forward",)
        assert log.rate_hz == pytest.approx(100.0)
        assert np.array_equal(log.time_s, frame["time_s"][1:])
        assert np.array_equal(log.signals["wheel_speed_rr_rad_s"], frame["wheel_speed_rr_rad_s"][1:])
        expected = np.interp(log.time_s[2:-2], frame["time_s"] + 0.0003, frame["accel_x_m_s2"])
        assert np.allclose(log.signals["accel_x_m_s2"][2:-2], expected, atol=1e-9)

    def test_a_torque_that_seldom_changes_is_carried_along(self, read, frame):
        for w in WHEELS:
            frame[f"wheel_torque_{w}_nm"] = np.where(frame["time_s"] > 1.5, -200.0, 0.0)
        rows = self.rows(frame, shifts=(0.0003, 0.0007, 0.0)).ffill().dropna()
        log = read(rows.to_csv(index=False))
        torque = log.signals["wheel_torque_fl_nm"]
        assert not np.isnan(torque).any()
        assert np.count_nonzero(torque != frame["wheel_torque_fl_nm"].to_numpy()[1:]) <= 1

    def test_of_a_parquet_file_with_pictures(self, tmp_path):
        frame = make_frame(camera=True)
        pictures = (
            frame[["time_s", "frame_id", "image_path"]]
            .iloc[::10]
            .assign(time_s=lambda f: f["time_s"] + 0.001)
        )
        pd.concat([self.rows(frame), pictures]).sort_values("time_s", kind="stable").to_parquet(
            tmp_path / "log.parquet"
        )
        log = read_log(tmp_path / "log.parquet")
        assert len(log) == len(frame)
        assert list(log.image_path[1:]) == list(
            frame["image_path"][:-1].where(frame.index[:-1] % 10 == 0).ffill()
        )


TIME_S = np.arange(0.0, 4.0, 0.005)


@pytest.fixture(scope="module")
def drive():
    torque = np.column_stack([-280.0 * (TIME_S > 1.0)] * 4)
    return trpac.simulate(CAR, trpac.Road.uniform(0.8, "dry"), torque=torque, speed=20.0).drop(
        columns="mu_reference"
    )


@pytest.fixture(scope="module")
def clean(drive):
    return trpac.estimate(drive, CAR).frame["TRPAC"].to_numpy()


class TestLostSamples:
    """What a bus writes for "no value" is lost, named with signal, value and count, and the estimate stays."""

    @pytest.mark.parametrize(
        ("column", "value", "rows"),
        [
            ("wheel_speed_fl_rad_s", 655.35, 21),
            ("wheel_speed_rr_rad_s", 655.34, 5),
            ("wheel_speed_fr_rad_s", 400.0, 9),
            ("vehicle_speed_m_s", 0.0, 3),
            ("vehicle_speed_m_s", 327.67, 12),
            ("vehicle_speed_m_s", 102.35, 3),
            ("accel_x_m_s2", -327.68, 7),
            ("wheel_torque_fl_nm", -8192.0, 4),
            ("wheel_torque_fl_nm", 65535.0, 1),
        ],
    )
    def test_a_burst_is_lost_and_named(self, drive, clean, column, value, rows):
        wrong = drive.copy()
        wrong.loc[300 : 299 + rows, column] = value
        log = trpac.read_log(wrong)
        (warning,) = log.warnings
        assert column in warning
        assert f"{rows} samples" in warning
        assert f"{value:g}" in warning
        assert np.count_nonzero(np.isnan(log.signals[column])) == rows
        if rows > 8:
            assert abs(trpac.estimate(log, CAR).frame["TRPAC"].iloc[-1] - clean[-1]) < 0.01

    def test_stated_codes_are_lost_without_a_warning(self, drive, tmp_path):
        wrong = drive.copy()
        wrong.loc[100:103, "accel_x_m_s2"] = -4.096
        wrong.loc[200:201, "wheel_speed_fl_rad_s"] = 60.0
        (tmp_path / "map.yaml").write_text(
            "schema: 1\ninvalid: {'*': [-4.096], wheel_speed_fl_rad_s: [60]}\n"
        )
        log = trpac.read_log(wrong, mapping=tmp_path / "map.yaml")
        assert log.warnings == ()
        assert log.notes == (
            "2 invalid samples of 'wheel_speed_fl_rad_s' lost",
            "4 invalid samples of 'accel_x_m_s2' lost",
        )
        assert np.flatnonzero(np.isnan(log.signals["accel_x_m_s2"])).tolist() == [100, 101, 102, 103]

    def test_a_wheel_that_locks_and_one_that_spins_up_stay(self, drive):
        hard = drive.copy()
        t = hard["time_s"].to_numpy()
        hard["wheel_speed_fl_rad_s"] *= np.clip(1.0 - 8.0 * (t - 2.0), 0.0, 1.0)
        hard["wheel_speed_rr_rad_s"] *= np.where(t < 3.0, 1.0, 1.0 + np.minimum(5.0 * (t - 3.0), 2.0))
        assert np.isfinite(trpac.read_log(hard).signals["wheel_speed_fl_rad_s"]).all()
        assert not any("lost" in text for text in trpac.read_log(hard).warnings)

    def test_a_motor_at_its_limit_is_no_code_though_the_limit_looks_like_one(self, drive):
        limited = drive.copy()
        for w in WHEELS:
            limited[f"wheel_torque_{w}_nm"] = np.clip(300.0 * np.sin(3.0 * TIME_S), -300.0, 255.0)
        log = trpac.read_log(limited)
        assert np.isfinite(log.signals["wheel_torque_fl_nm"]).all()
        assert not any("lost" in text for text in log.warnings)

    def test_a_signal_that_is_impossible_for_long_is_refused(self, drive):
        with pytest.raises(LogError, match="accel_x_m_s2: 400 samples are impossible for a car"):
            trpac.read_log(drive.assign(accel_x_m_s2=np.where(TIME_S < 2.0, 500.0, drive["accel_x_m_s2"])))


class TestPosition:
    """A log without a measured position can be estimated on, and diagnosed on a road of one stretch."""

    def test_it_is_the_way_since_the_first_row(self, drive, clean):
        log = trpac.read_log(drive.drop(columns="position_m"))
        assert "position_m" not in log.signals
        assert np.array_equal(trpac.estimate(log, CAR).frame["TRPAC"], clean)

    def test_a_road_of_several_stretches_asks_for_it(self, drive):
        log = trpac.read_log(drive.drop(columns="position_m"))
        assert "position_m" in make_source(log, make_road((0.0, 0.8, 0.8))).log.derived
        with pytest.raises(ScenarioError, match=r"column position_m is missing.* has 2 stretches"):
            make_source(log, make_road((0.0, 0.8, 0.8), (30.0, 0.3, 0.3)))

    def test_stretches_of_pictures_ask_for_it(self):
        with pytest.raises(LogError, match="required column missing: position_m"):
            trpac.read_log(make_frame(camera=True).drop(columns="position_m"))
