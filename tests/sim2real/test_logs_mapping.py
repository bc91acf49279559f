"""Mapping files: other names, units, signs, sums; and what is wrong with them."""

import re
from pathlib import Path

import numpy as np
import pytest
from log_maker import RADIUS_M, WHEELS, make_frame, save

from sim2real.logs import COLUMNS, LogError, load_mapping, read_log
from sim2real.logs.units import UNITS, factor


@pytest.fixture
def mapping(tmp_path):
    def load(text):
        path = tmp_path / "map.yaml"
        path.write_text(text, encoding="utf-8")
        return load_mapping(path)

    return load


@pytest.fixture
def problems(mapping, tmp_path):
    def refuse(text):
        with pytest.raises(LogError) as error:
            mapping(text)
        lines = str(error.value).splitlines()
        assert all(line.startswith(f"{tmp_path / 'map.yaml'}: ") for line in lines)
        return [line.removeprefix(f"{tmp_path / 'map.yaml'}: ") for line in lines]

    return refuse


@pytest.fixture
def read(tmp_path, mapping):
    def read_frame(frame, text):
        return read_log(save(frame, tmp_path / "log.csv"), mapping(text))

    return read_frame


class TestReading:
    def test_names_and_units(self, read):
        frame = make_frame()
        foreign = frame.rename(columns={"vehicle_speed_m_s": "VehSpd", "time_s": "t"})
        foreign["VehSpd"] *= 3.6
        foreign["t"] *= 1000.0
        foreign["accel_x_m_s2"] /= -9.80665
        for w in WHEELS:
            foreign[f"wheel_speed_{w}_rad_s"] *= 30.0 / np.pi
            foreign[f"wheel_torque_{w}_nm"] /= 1000.0
        text = """
            schema: 1
            time_s: {column: t, unit: ms}
            vehicle_speed_m_s: {column: VehSpd, unit: km/h}
            accel_x_m_s2: {column: accel_x_m_s2, unit: g, sign: -1}
        """ + "".join(
            f"""
            wheel_speed_{w}_rad_s: {{column: wheel_speed_{w}_rad_s, unit: rpm}}
            wheel_torque_{w}_nm: {{column: wheel_torque_{w}_nm, unit: kN m}}"""
            for w in WHEELS
        )
        log = read(foreign, text)
        assert log.warnings == ()
        assert log.ignored == ()
        assert log.derived == frozenset()
        assert log.time_s == pytest.approx(frame["time_s"].to_numpy(), abs=1e-12)
        for name, values in log.signals.items():
            assert values == pytest.approx(frame[name].to_numpy(), rel=1e-12), name

    @pytest.mark.parametrize("form", ["{0}", "columns:\n  {0}", "schema: 1\ncolumns:\n  {0}"])
    def test_both_forms(self, read, form):
        frame = make_frame().rename(columns={"vehicle_speed_m_s": "v"})
        log = read(frame, form.format("vehicle_speed_m_s: v"))
        assert np.array_equal(log.signals["vehicle_speed_m_s"], frame["v"])

    def test_a_mapping_beats_a_column_of_the_right_name(self, read):
        log = read(make_frame().assign(other=0.25), "mu_reference: {column: other}\naccel_y_m_s2: other")
        assert log.signals["mu_reference"][0] == 0.25
        frame = make_frame().assign(v2=lambda f: f["vehicle_speed_m_s"] * 1.01)
        log = read(frame, "vehicle_speed_m_s: v2")
        assert np.array_equal(log.signals["vehicle_speed_m_s"], frame["v2"])
        assert log.ignored == ("vehicle_speed_m_s",)

    def test_sums_constants_scales_and_offsets(self, read):
        frame = make_frame().assign(engine=800.0, brake=-100.0)
        text = """
            wheel_torque_fl_nm: {sum: [{column: engine, scale: 0.25}, {column: brake, scale: 0.3}], offset: 1.5}
            wheel_torque_rl_nm: {sum: [engine, {constant: 7}], sign: -1, scale: 2}
            steering_angle_rad: {constant: 0.0}
            yaw_rate_rad_s: {sum: [{constant: 0.5}, {constant: -0.25, sign: -1}]}
        """
        log = read(frame, text)
        assert log.signals["wheel_torque_fl_nm"] == pytest.approx(np.full(len(frame), 200.0 - 30.0 + 1.5))
        assert log.signals["wheel_torque_rl_nm"] == pytest.approx(np.full(len(frame), -1614.0))
        assert not log.signals["steering_angle_rad"].any()
        assert set(log.signals["yaw_rate_rad_s"]) == {0.75}
        assert log.derived == {"yaw_rate_rad_s", "steering_angle_rad"}

    def test_circumferential_speeds(self, read):
        frame = make_frame()
        foreign = frame.assign(w=frame["wheel_speed_fr_rad_s"] * RADIUS_M * 3.6)
        log = read(foreign, f"wheel_speed_fr_rad_s: {{column: w, unit: km/h, radius_m: {RADIUS_M}}}")
        assert log.signals["wheel_speed_fr_rad_s"] == pytest.approx(
            frame["wheel_speed_fr_rad_s"].to_numpy(), rel=1e-12
        )

    def test_time_in_two_columns(self, read):
        frame = make_frame()
        whole = np.floor(frame["time_s"])
        foreign = frame.assign(sec=whole, nsec=(frame["time_s"] - whole) * 1e9).drop(columns="time_s")
        log = read(foreign, "time_s: {sum: [sec, {column: nsec, unit: ns}]}")
        assert log.time_s == pytest.approx(frame["time_s"].to_numpy(), abs=1e-9)

    def test_pictures(self, read):
        log = read(make_frame(camera=True).rename(columns={"image_path": "file"}), "image_path: file")
        assert log.image_path[-1] == "frames/straße_0030.png"


class TestIntegrals:
    TEXT = "position_m: {integrate: {copy: vehicle_speed_m_s}, offset: 12}"

    def test_position_from_speed(self, read):
        frame = make_frame(rate_hz=200.0)
        frame["vehicle_speed_m_s"] = 15.0 + 2.0 * np.sin(2.0 * frame["time_s"])
        log = read(frame.drop(columns="position_m"), self.TEXT)
        truth = 12.0 + 15.0 * log.time_s + 1.0 - np.cos(2.0 * log.time_s)
        assert log.signals["position_m"] == pytest.approx(truth, abs=2e-4)
        assert log.derived == {"position_m"}
        assert log.warnings == ()

    def test_the_copy_follows_the_mapping(self, read):
        frame = make_frame().rename(columns={"vehicle_speed_m_s": "v"}).drop(columns="position_m")
        frame["v"] *= 3.6
        log = read(frame, self.TEXT + "\nvehicle_speed_m_s: {column: v, unit: km/h}")
        assert log.signals["position_m"][-1] == pytest.approx(12.0 + 46.04 - 1.0, abs=0.1)

    def test_speed_from_acceleration_in_g(self, read):
        frame = make_frame()
        frame["accel_x_m_s2"] /= 9.80665
        text = (
            "accel_x_m_s2: &a {column: accel_x_m_s2, unit: g}\nvehicle_speed_m_s: {integrate: *a, offset: 15}"
        )
        log = read(frame, text)
        assert log.signals["vehicle_speed_m_s"] == pytest.approx(15 + 2 * np.sin(2 * log.time_s), abs=0.03)
        assert log.derived == {"vehicle_speed_m_s"}

    def test_lost_samples_are_bridged_by_a_straight_line_and_long_ones_told(self, read):
        frame = make_frame().drop(columns="position_m")
        whole = read(frame, self.TEXT)
        frame.loc[[40, 41, 42], "vehicle_speed_m_s"] = np.nan
        short = read(frame, self.TEXT)
        assert short.warnings == ()
        assert short.signals["position_m"][-1] == pytest.approx(whole.signals["position_m"][-1], abs=0.01)
        frame.loc[100:140, "vehicle_speed_m_s"] = np.nan
        assert "position_m is integrated across 0.42 s without samples" in read(frame, self.TEXT).warnings[0]


class TestFileProblems:
    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("vehicle_sped_m_s: v", "vehicle_sped_m_s: unknown key; did you mean 'vehicle_speed_m_s'?"),
            ("columns: {speed: v}", "speed: unknown key; "),
            ("vehicle_speed_m_s: {column: v, unt: km/h}", "vehicle_speed_m_s.unt: unknown key; did you mean 'unit'?"),
            ("vehicle_speed_m_s: {column: v, unit: Nm}", "unit 'Nm' cannot become [m/s]; known units: m/s, km/h"),
            ("wheel_torque_fl_nm: {column: t, unit: g}", "unit 'g' cannot become [N m]; known units: Nm, kNm"),
            ("wheel_speed_fl_rad_s: {column: w, unit: Hz}", "unit 'Hz' cannot become [rad/s]"),
            ("wheel_speed_fl_rad_s: {column: w, unit: rpm, radius_m: 0.3}", "unit 'rpm' cannot become [m/s]"),
            ("vehicle_speed_m_s: {column: v, radius_m: 0.3}", "radius_m turns a circumferential speed into"),
            ("vehicle_speed_m_s: {column: v, constant: 1}", "has column and constant; expected exactly one of"),
            ("vehicle_speed_m_s: {unit: km/h}", "has no source; expected exactly one of column, constant"),
            ("vehicle_speed_m_s: {constant: 3, unit: km/h}", "unit and radius_m belong to a column"),
            ("vehicle_speed_m_s: {column: v, sign: 2}", "vehicle_speed_m_s.sign: is 2;"),
            ("vehicle_speed_m_s: {column: v, scale: '2'}", "vehicle_speed_m_s.scale: is '2';"),
            ("vehicle_speed_m_s: {column: v, scale: .inf}", "vehicle_speed_m_s.scale: is inf;"),
            ("vehicle_speed_m_s: {constant: null}", "has no source; "),
            ("vehicle_speed_m_s: 3.0", "vehicle_speed_m_s: is 3.0; expected a column's name, or one of"),
            ("vehicle_speed_m_s:", "vehicle_speed_m_s: is None; expected a column's name"),
            ("wheel_torque_fl_nm: {sum: []}", "has no source; expected exactly one"),
            ("wheel_torque_fl_nm: {sum: [a, {column: b, unit: V}]}", "unit 'V' cannot become [N m]"),
            ("wheel_torque_fl_nm: {sum: [a, {column: b, unt: V}]}", "wheel_torque_fl_nm.sum[1].unt: unknown key"),
            ("yaw_rate_rad_s: {integrate: a}", "integrate gives no [rad/s]"),
            ("position_m: {integrate: {column: v, unit: m}}", "unit 'm' cannot become [m/s]"),
            ("position_m: {integrate: {copy: accel_x_m_s2}}", "copy: 'accel_x_m_s2' is in [m/s2]; expected"),
            ("position_m: {copy: distance}", "copy: 'distance' is no column of the log format; expected"),
            ("wheel_speed_fl_rad_s: {copy: wheel_speed_fl_rad_s}", "is copied from itself in a circle"),
            ("wheel_speed_fl_rad_s: {copy: wheel_speed_fr_rad_s}\n"
             "wheel_speed_fr_rad_s: {sum: [{copy: wheel_speed_fl_rad_s}]}", "is copied from itself in a circle"),
            ("time_s: {constant: 1}", "time_s: expected measured columns only"),
            ("time_s: {sum: [t, {integrate: u}]}", "time_s: expected measured columns only"),
            ("image_path: {constant: 1}", "image_path: holds text; expected the bare name of a column"),
            ("image_path: {column: a, scale: 2}", "image_path: holds text"),
            ("schema: 2\ntime_s: t", "schema: is 2;"),
            ("schema: 1", "maps nothing"),
            ("format: {encoding: klingon}", "encoding: 'klingon' is not known; expected a name such as utf-8"),
            ("format: {encoding: base64}", "encoding: 'base64' is not known"),
            ("format: {separator: abc}", "separator: 'abc'; expected one character, or blanks"),
            ("format: {decimal: ';'}", "format.decimal: is ';'"),
            ("format: {header_row: 5, unit_row: 3}", "unit_row: expected a row below header_row"),
            ("time: {column: t}\ntime_s: t", "time: stands beside time_s"),
            ("invalid: {a: [x]}", "invalid.a[0]: is 'x'"),
            ("columns: {time_s: t}\nposition_m: x", "columns: stands beside position_m"),
            ("columns: 3", "columns: expected one line"),
            ("[1, 2]", "holds no keys at its top"),
            ("time_s: t\ntime_s: u", "stands twice"),
            ("a: [", "not valid YAML"),
        ],
    )  # fmt: skip
    def test_each_is_named_with_file_and_key(self, mapping, tmp_path, text, expected):
        with pytest.raises(LogError) as error:
            mapping(text)
        assert str(error.value).startswith(f"{tmp_path / 'map.yaml'}: ")
        assert expected in str(error.value)

    def test_all_at_once(self, problems):
        text = "time_s: {constant: 1}\nposition_m: {copy: x}\naccel_x_m_s2: {column: a, unit: V}"
        found = problems(text)
        assert {p.partition(":")[0] for p in found} == {"time_s", "accel_x_m_s2", "position_m"}

    def test_missing_file(self, tmp_path):
        with pytest.raises(LogError, match=r"no\.yaml: cannot be read"):
            load_mapping(tmp_path / "no.yaml")

    def test_columns_that_the_log_does_not_have(self, tmp_path, mapping):
        path = save(make_frame().rename(columns={"vehicle_speed_m_s": "VehSpd"}), tmp_path / "log.csv")
        wrong = mapping(
            "mu_reference: mue\nvehicle_speed_m_s: vehspeed\nwheel_speed_fl_rad_s: {copy: yaw_rate_rad_s}"
        )
        with pytest.raises(LogError) as error:
            read_log(path, wrong)
        copy, speed, friction = str(error.value).splitlines()
        where = tmp_path / "map.yaml"
        assert friction.startswith(
            f"{path}: column 'mue' is missing, which {where} wants for mu_reference. The file has:"
        )
        assert speed == (
            f"{path}: column 'vehspeed' is missing, which {where} wants for vehicle_speed_m_s. Did you mean 'VehSpd'?"
        )
        assert (
            copy
            == f"{path}: column 'yaw_rate_rad_s' is missing, which {where} copies to wheel_speed_fl_rad_s."
        )


def test_the_document_is_true(mapping):
    page = (Path(__file__).parents[2] / "docs" / "guide" / "logs.md").read_text(encoding="utf-8")
    example, stated, bus = (mapping(text) for text in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL))
    assert bus.sources("vehicle_speed_m_s") == ["Esp.VehSpd"]
    assert len(example.columns) == 9
    assert stated.format.encoding == "cp1252"
    assert stated.time_form == "iso8601"
    assert stated.invalid == {"*": (655.35,), "YawRate": (-4.096,)}
    for quantity, units in UNITS.items():
        assert f"| {quantity} | {', '.join(units)} |" in page
    for column in COLUMNS:
        name = re.sub("_(fl|fr|rl|rr)_", "_{fl,fr,rl,rr}_", column)
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    ("unit", "quantity", "expected"),
    [
        ("km/h", "m/s", 1 / 3.6),
        ("MPH", "m/s", 0.44704),
        ("knot", "m/s", 1852 / 3600),
        ("rpm", "rad/s", 0.10471975511965977),
        ("1/min", "rad/s", 0.10471975511965977),
        ("°/s", "rad/s", 0.017453292519943295),
        ("deg", "rad", 0.017453292519943295),
        ("g", "m/s2", 9.80665),
        ("m/s^2", "m/s2", 1.0),
        ("m/s²", "m/s2", 1.0),
        ("m/s**2", "m/s2", 1.0),
        ("Nm", "N m", 1.0),
        ("N.m", "N m", 1.0),
        ("N·m", "N m", 1.0),
        ("kN m", "N m", 1000.0),
        ("lbf ft", "N m", 1.3558179483314004),
        ("lbf in", "N m", 0.1129848290276167),
        ("mi", "m", 1609.344),
        ("µs", "s", 1e-6),
        ("%", "-", 0.01),
    ],
)
def test_units(unit, quantity, expected):
    assert factor(unit, quantity) == pytest.approx(expected, rel=1e-14)
